"""`graphres` as a user of PyTorch Geometric would run it; imported only with --with-pyg."""
import numpy as np
import torch
import torch_geometric
from scipy.spatial import cKDTree
from torch_geometric.nn import SplineConv

NAME = f"PyTorch Geometric {torch_geometric.__version__}, graph by SciPy"

CELL = np.array([16 / 346, 12 / 260], np.float32)
COLUMNS = 22


class GraphRes:
    """Five blocks over events, a maximum over cells with merged edges, two blocks, a 4 x 4 readout, one dense layer."""

    WIDTHS = [1, 8, 16, 16, 16, 32, 32, 32]

    def __init__(self, window):
        self.window = window
        self.positions = torch.from_numpy(window.positions)
        self.polarity = torch.from_numpy(window.polarity)
        self.blocks = [self.block(i) for i in range(7)]
        self.dense = torch.from_numpy(window.tensors["fc.weight"])
        self.exact = self.edges(window.near)

    def block(self, i):
        inputs, outputs = self.WIDTHS[i:i + 2]
        conv = SplineConv(inputs, outputs, dim=3, kernel_size=2, bias=False, root_weight=False)
        norm = torch.nn.BatchNorm1d(outputs).eval()
        values = {name: torch.from_numpy(self.window.tensors[f"blocks.{i}.{name}"]) for name in (
            "conv.weight", "norm.weight", "norm.bias", "norm.running_mean", "norm.running_var")}
        conv.weight.data.copy_(values["conv.weight"])
        for part in ("weight", "bias", "running_mean", "running_var"):
            getattr(norm, part).data.copy_(values[f"norm.{part}"])
        return lambda x, edges, attributes: norm(torch.nn.functional.elu(conv(x, edges, attributes)))

    @staticmethod
    def edges(near):
        n, k = near.shape
        return torch.stack((torch.from_numpy(near).reshape(-1), torch.arange(n).repeat_interleave(k)))

    def search(self):
        """The graph. A tie may put another event before the event itself, so the event itself is left out, not the first entry."""
        positions, k = self.window.positions.astype(np.float64), self.window.near.shape[1]
        found = cKDTree(positions).query(positions, k=k + 1)[1]
        itself = found == np.arange(len(found))[:, None]
        itself[~itself.any(1), -1] = True
        return found[~itself].reshape(-1, k)

    @staticmethod
    def attributes(positions, edges, scale):
        return ((positions[edges[0]] - positions[edges[1]]) / (2 * scale) + 0.5).clamp(0, 1)

    def pool(self, x, edges):
        """Maxima and mean positions of the cells with members, and the edges between them, once each."""
        index = (self.positions[:, :2] / torch.from_numpy(CELL)).floor().long()
        ids, member = torch.unique(index[:, 1] * COLUMNS + index[:, 0], return_inverse=True)
        wide = member[:, None]
        maxima = torch.full((len(ids), x.shape[1]), -torch.inf)
        maxima.scatter_reduce_(0, wide.expand_as(x), x, "amax")
        sums = torch.zeros(len(ids), 3).scatter_add_(0, wide.expand(-1, 3), self.positions)
        between = member[edges]
        between = torch.unique(between[:, between[0] != between[1]], dim=1)
        return maxima, sums / torch.bincount(member)[:, None], between

    @staticmethod
    def readout(x, positions):
        index = (positions[:, :2] * 4).floor().long().clamp(0, 3)
        cell = (index[:, 1] * 4 + index[:, 0])[:, None].expand_as(x)
        out = torch.full((16, x.shape[1]), -torch.inf).scatter_reduce_(0, cell, x, "amax")
        return torch.where(out.isinf(), 0, out).reshape(-1)

    def forward(self, edges=None):
        """The prediction, over the exported graph unless another one is given."""
        edges = self.exact if edges is None else edges
        attributes = self.attributes(self.positions, edges, self.window.scale)
        x = self.polarity
        for i in range(5):
            y = self.blocks[i](x, edges, attributes)
            if i == 1:
                kept = y
            x = y + kept if i == 3 else y
        x, positions, edges = self.pool(x, edges)
        attributes = self.attributes(positions, edges, self.window.pooled_scale)
        y = self.blocks[6](self.blocks[5](x, edges, attributes), edges, attributes) + x
        return self.dense @ self.readout(y, positions)

    def whole(self):
        """Graph and forward pass."""
        return self.forward(self.edges(self.search()))
