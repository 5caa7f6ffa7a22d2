"""The classifier, as `models/networks/digits-*.toml` describes it, over batches of graphs.

Sums of a row run in another order than the engine's: logits agree to some 1e-5 of the largest.
"""

import torch
import torch.nn.functional as F
from torch import nn

NEIGHBOURS = 8
EVENT_CHANNELS = (8, 16, 16)
SIDE = 8  # cells of the readout along x and along y
TIMES = 4  # cells in time that a window can fill
READOUT_CELLS = TIMES * SIDE * SIDE
HEAD_CHANNELS = 32
HIDDEN = 64
CLASSES = 10
DROPOUT = 0.3


class Digits(nn.Module):
    """Three spline blocks over events, maxima over cells of image and time, and over these, with a channel for each
    channel and age, two convolutions and two dense layers."""

    def __init__(self):
        super().__init__()
        channels = (1, *EVENT_CHANNELS)
        pairs = list(zip(channels, channels[1:]))
        self.weight = nn.ParameterList(he((8, c, o), c) for c, o in pairs)
        self.root = nn.ParameterList(he((o, c), 2 * c) for c, o in pairs)
        self.norm = nn.ModuleList(nn.BatchNorm1d(o) for o in EVENT_CHANNELS)
        image = (TIMES * EVENT_CHANNELS[-1], HEAD_CHANNELS, HEAD_CHANNELS)
        self.head = nn.ModuleDict()
        for i, (c, o) in enumerate(zip(image, image[1:]), 1):
            self.head[f"conv{i}"] = nn.Conv2d(c, o, 3, padding=1, bias=False)
            self.head[f"norm{i}"] = nn.BatchNorm2d(o)
        self.head["hidden"] = nn.Linear(HEAD_CHANNELS * (SIDE // 2) ** 2, HIDDEN)
        self.head["out"] = nn.Linear(HIDDEN, CLASSES)
        self.dropout = nn.Dropout(DROPOUT)

    def forward(self, batch):
        """Logits (streams, 10)."""
        x = batch.input
        for weight, root, norm in zip(self.weight, self.root, self.norm):
            read = x.index_select(0, batch.source.flatten()).unflatten(0, batch.source.shape)
            sums = torch.bmm(batch.basis.mT, read).flatten(1)
            x = norm(F.elu(sums @ weight.flatten(0, 1) / batch.in_edges + x @ root.T))
        x = maxima(x, batch.readout, batch.streams * READOUT_CELLS)
        x = x.view(batch.streams, TIMES, SIDE, SIDE, -1).permute(0, 1, 4, 2, 3).flatten(1, 2)
        for i in (1, 2):
            x = F.relu(self.head[f"norm{i}"](self.head[f"conv{i}"](x)))
        x = F.max_pool2d(x, 2).flatten(1)
        x = F.relu(self.head["hidden"](self.dropout(x)))
        return self.head["out"](self.dropout(x))

    def exported(self):
        """Tensors by the names of the description."""
        blocks = {f"blocks.{i}.conv.weight": weight for i, weight in enumerate(self.weight)}
        roots = {f"blocks.{i}.conv.lin.weight": root for i, root in enumerate(self.root)}
        norms = {f"blocks.{i}.norm.{name}": t for i, n in enumerate(self.norm) for name, t in n.state_dict().items()}
        tensors = blocks | roots | norms | self.head.state_dict()
        return {name: t for name, t in tensors.items() if not name.endswith("num_batches_tracked")}


def he(shape, inputs):
    """Normal values of variance 2 / inputs (He et al. 2015)."""
    return nn.Parameter(torch.randn(shape) * (2 / inputs) ** 0.5)


def maxima(x, place, places):
    """Channel-wise maximum of the rows of each place, 0 where there are none."""
    empty = x.new_full((places, x.shape[1]), -torch.inf)
    found = empty.scatter_reduce(0, place[:, None].expand_as(x), x, "amax")
    return torch.where(torch.isinf(found), 0, found)
