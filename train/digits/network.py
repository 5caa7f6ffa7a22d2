"""The classifier, as `models/networks/digits-*.toml` describes it, over batches of graphs.

Sums of a row run in another order than the engine's: logits agree to some 1e-5 of the largest.
"""

import torch
import torch.nn.functional as F
from torch import nn

NEIGHBOURS = 8
EVENT_CHANNELS = (8, 16, 16)
CELL_CHANNELS = (32, 16)
READOUT_CELLS = 4 * 9 * 9  # cells in time that a window can fill, times those of the image
HIDDEN = 48
CLASSES = 10
DROPOUT = 0.3


class Digits(nn.Module):
    """Three spline blocks over events, two over cells, the maxima of the image's cells, two dense layers."""

    def __init__(self):
        super().__init__()
        channels = (1, *EVENT_CHANNELS, *CELL_CHANNELS)
        pairs = list(zip(channels, channels[1:]))
        slots = [8] * len(EVENT_CHANNELS) + [27] * len(CELL_CHANNELS)
        self.weight = nn.ParameterList(he((s, c, o), c) for s, (c, o) in zip(slots, pairs))
        self.root = nn.ParameterList(he((o, c), c) for c, o in pairs[len(EVENT_CHANNELS) :])
        self.norm = nn.ModuleList(nn.BatchNorm1d(o) for _, o in pairs)
        self.hidden = nn.Linear(READOUT_CELLS * channels[-1], HIDDEN)
        self.out = nn.Linear(HIDDEN, CLASSES)
        self.dropout = nn.Dropout(DROPOUT)

    def forward(self, batch):
        """Logits (streams, 10)."""
        x = batch.input
        for weight, norm in zip(self.weight[: len(EVENT_CHANNELS)], self.norm):
            read = x.index_select(0, batch.source.flatten()).unflatten(0, batch.source.shape)
            sums = torch.bmm(batch.basis.mT, read).flatten(1)
            x = norm(F.elu(sums @ weight.flatten(0, 1) / batch.in_edges))
        x = maxima(x, batch.cell, len(batch.cell_in_edges))
        for weight, root, norm in zip(self.weight[len(EVENT_CHANNELS) :], self.root, self.norm[len(EVENT_CHANNELS) :]):
            sums = x.new_zeros(27 * len(x), x.shape[1])
            sums = sums.index_add(0, 27 * batch.cell_reader + batch.cell_slot, x[batch.cell_source])
            sums = sums.view(len(x), -1)
            x = norm(F.elu(sums @ weight.flatten(0, 1) / batch.cell_in_edges + x @ root.T))
        x = maxima(x, batch.readout, batch.streams * READOUT_CELLS).view(batch.streams, -1)
        x = F.elu(self.hidden(self.dropout(x)))
        return self.out(self.dropout(x))

    def exported(self):
        """Tensors by the names of the description."""
        blocks = {f"blocks.{i}.conv.weight": weight for i, weight in enumerate(self.weight)}
        roots = {f"blocks.{i}.conv.lin.weight": root for i, root in enumerate(self.root, len(EVENT_CHANNELS))}
        norms = {f"blocks.{i}.norm.{name}": t for i, n in enumerate(self.norm) for name, t in n.state_dict().items()}
        dense = {f"{name}.{key}": t for name in ("hidden", "out") for key, t in getattr(self, name).state_dict().items()}
        return {name: t for name, t in (blocks | roots | norms | dense).items() if not name.endswith("num_batches_tracked")}


def he(shape, inputs):
    """Normal values of variance 2 / inputs (He et al. 2015)."""
    return nn.Parameter(torch.randn(shape) * (2 / inputs) ** 0.5)


def maxima(x, place, places):
    """Channel-wise maximum of the rows of each place, 0 where there are none."""
    empty = x.new_full((places, x.shape[1]), -torch.inf)
    found = empty.scatter_reduce(0, place[:, None].expand_as(x), x, "amax")
    return torch.where(torch.isinf(found), 0, found)
