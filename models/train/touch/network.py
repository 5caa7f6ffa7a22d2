"""The network, as `models/networks/touch-*.toml` describes it, over the graphs of streams.

Event level: each spike counts its neighbours by sign and by how long ago they were. A cell of the readout is a taxel for
40 ms. The head adds cells up over times that overlap, bends the sums as a square root does, and has a linear classifier for
each age of the contact. Sums run in another order than the engine's: logits agree to some 1e-5 of the largest.
"""

import torch
import torch.nn.functional as F
from torch import nn

LAGS = 5  # slots of the past; the kernel has as many for a future that no node reads from
SLOTS = 2 * LAGS - 1
CHANNELS = 2 * LAGS + 2  # lags of each sign, then the spike itself by its sign
COLUMNS, ROWS = 8, 9  # of the readout: every taxel has a cell of its own
TIMES = 126  # cells in time that a window can fill
CELLS = TIMES * ROWS * COLUMNS
WINDOWS = 12  # sums over overlapping times
KNOTS = (0.0, 0.05, 0.3, 1.0, 3.0)  # where a bent sum changes its slope
SHIFT, CLOSED = 32.0, 128.0  # logits are above -SHIFT; a classifier for another age is closed by -CLOSED


class Touch(nn.Module):
    """Linear layers by the names of the description. Contacts younger than each of `ages`, in cells in time, have another classifier."""

    def __init__(self, classes, code, ages):
        super().__init__()
        self.ages = ages
        sums, experts = WINDOWS * CHANNELS, (len(ages) + 1) * classes
        self.shapes = {
            "sides.conv.weight": (1, 1, 2),
            "sides.conv.lin.weight": (2, 1),
            "sides.conv.bias": (2,),
            "lags.conv.weight": (SLOTS, 2, CHANNELS),
            "lags.conv.lin.weight": (CHANNELS, 2),
            "sums.weight": (sums, TIMES * CHANNELS, 1, 1),
            "steps.weight": (len(KNOTS) * sums, sums, 1, 1),
            "steps.bias": (len(KNOTS) * sums,),
            "code.weight": (code, len(KNOTS) * sums, 1, 1),
            "old.weight": (len(ages), TIMES * CHANNELS, 1, 1),
            "past.weight": (2 * len(ages), len(ages)),
            "past.bias": (2 * len(ages),),
            "age.weight": (len(ages), 2 * len(ages)),
            "experts.weight": (experts, ROWS * COLUMNS * code + len(ages)),
            "experts.bias": (experts,),
            "out.weight": (classes, experts),
            "out.bias": (classes,),
        }
        self.tensors = {name: torch.zeros(shape) for name, shape in self.shapes.items()}

    def image(self, graphs, streams):
        """The readout of `streams` streams as images (streams, TIMES * CHANNELS, ROWS * COLUMNS)."""
        t, level = self.tensors, graphs.tensors
        x = torch.from_numpy(graphs.input)[:, None]
        sides = x @ t["sides.conv.lin.weight"].T + t["sides.conv.bias"]
        edges = torch.from_numpy(level["level0.edges"]).long()
        count = edges.diff()
        row = torch.repeat_interleave(torch.arange(len(count)), count) * SLOTS
        read = sides[torch.from_numpy(level["level0.source"]).long()]
        place = torch.from_numpy(level["level0.attribute"][:, 2]) * (SLOTS - 1)
        slot = place.floor().clamp(max=SLOTS - 2)
        share = (place - slot)[:, None]
        row += slot.long()
        summed = torch.zeros(len(count) * SLOTS, 2)
        summed.index_add_(0, row, read * (1 - share)).index_add_(0, row + 1, read * share)
        lags = summed.view(len(count), -1) @ t["lags.conv.weight"].flatten(0, 1) / count.clamp(min=1)[:, None]
        rows = lags + sides @ t["lags.conv.lin.weight"].T
        cell = torch.from_numpy(level["readout"]).long()[torch.from_numpy(level["level1.cell"]).long()]
        stream = torch.repeat_interleave(torch.arange(streams), torch.from_numpy(level["level0.start"]).long().diff())
        # No channel is below 0, which is the value of an empty cell.
        grid = torch.zeros(streams * CELLS, CHANNELS)
        grid.scatter_reduce_(0, (stream * CELLS + cell)[:, None].expand_as(rows), rows, "amax")
        grid = grid.view(streams, TIMES, ROWS * COLUMNS, CHANNELS)
        return grid.transpose(2, 3).flatten(1, 2)

    def bent(self, image):
        """The sums over times, bent: (streams, WINDOWS * CHANNELS * knots, ROWS * COLUMNS)."""
        return F.relu(self.on(self.on(image, "sums"), "steps"))

    def on(self, image, name):
        """A convolution that reads one cell."""
        found = self.tensors[f"{name}.weight"].flatten(1) @ image
        return found + self.tensors[f"{name}.bias"][:, None] if f"{name}.bias" in self.tensors else found

    def features(self, graphs, streams):
        """What the classifiers read (streams, code * ROWS * COLUMNS + ages)."""
        image = self.image(graphs, streams)
        code = self.on(self.bent(image), "code").flatten(1)
        past = F.relu(self.dense(self.on(image, "old").sum(2), "past"))
        return torch.cat([code, past @ self.tensors["age.weight"].T], 1)

    def forward(self, features):
        """Logits (streams, classes)."""
        return self.dense(F.relu(self.dense(features, "experts")), "out")

    def dense(self, values, name):
        return F.linear(values, self.tensors[f"{name}.weight"], self.tensors[f"{name}.bias"])
