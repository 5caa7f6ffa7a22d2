"""Graphs as the engine builds them: `meissner prepare graphs`, and batches of what it writes.

Nothing is searched, pooled or scaled here, so that training and inference see the same graph.
"""

import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from safetensors.numpy import load_file, save_file


@dataclass
class Batch:
    """Some streams, their rows numbered through. E rows at the event level, C cells, M in-edges of cells."""

    input: torch.Tensor  # (E, 1), the polarity
    source: torch.Tensor  # (E, k), rows that are read
    basis: torch.Tensor  # (E, k, 8), of kernels of 2 x 2 x 2; 0 where there is no in-edge
    in_edges: torch.Tensor  # (E, 1), at least 1
    cell: torch.Tensor  # (E,), the cell that pools the row
    cell_source: torch.Tensor  # (M,)
    cell_reader: torch.Tensor  # (M,)
    cell_slot: torch.Tensor  # (M,), slot of a kernel of 3 x 3 x 3
    cell_in_edges: torch.Tensor  # (C, 1), at least 1
    readout: torch.Tensor  # (C,), stream times cells of the readout, plus its cell
    streams: int


class Graphs:
    """Graphs of streams of events, for one network."""

    def __init__(self, meissner, network, sensor, streams, folder):
        events, out = Path(folder) / "events.safetensors", Path(folder) / "graphs.safetensors"
        columns = np.concatenate(streams).astype(np.int64).T
        tensors = dict(zip(("t_us", "x", "y", "on"), map(np.ascontiguousarray, columns)))
        tensors["start"] = np.cumsum([0] + [len(stream) for stream in streams])
        save_file(tensors, events, {"sensor": sensor})
        command = [meissner, "prepare", "graphs", events, "--network", network, "--out", out]
        subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
        self.tensors = load_file(out)
        self.input = 2 * columns[3][self.tensors["event"]].astype(np.float32) - 1

    def batch(self, streams, neighbours, readout_cells):
        """The batch of `streams`, a range of their numbers, where a row reads from up to `neighbours` others."""
        level = {name: tensor for name, tensor in self.tensors.items()}
        rows = slice(*level["level0.start"][[streams.start, streams.stop]])
        cells = slice(*level["level1.start"][[streams.start, streams.stop]])
        edges = level["level0.edges"][rows.start : rows.stop + 1]
        count = np.diff(edges)
        place = np.arange(neighbours)[None]
        there = place < count[:, None]
        edge = np.where(there, edges[:-1, None] + place, 0)
        source = np.where(there, level["level0.source"][edge] - rows.start, 0)
        basis = spline_basis(torch.from_numpy(level["level0.attribute"][edge]))
        edges = level["level1.edges"][cells.start : cells.stop + 1]
        own = slice(edges[0], edges[-1])
        # Cells that touch differ by 0, 1 or more cells on each axis: attributes are 0, 1/2 or 1.
        attribute = np.rint(2 * level["level1.attribute"][own]).astype(np.int64)
        starts = level["level1.start"][streams.start : streams.stop + 1]
        stream = np.repeat(np.arange(len(streams)), np.diff(starts))
        return Batch(
            input=torch.from_numpy(self.input[rows])[:, None],
            source=integers(source),
            basis=basis * torch.from_numpy(there.astype(np.float32))[..., None],
            in_edges=at_least_one(count),
            cell=integers(level["level1.cell"][rows] - cells.start),
            cell_source=integers(level["level1.source"][own] - cells.start),
            cell_reader=integers(np.repeat(np.arange(len(edges) - 1), np.diff(edges))),
            cell_slot=integers(attribute @ np.array([1, 3, 9])),
            cell_in_edges=at_least_one(np.diff(edges)),
            readout=integers(stream * readout_cells + level["readout"][cells]),
            streams=len(streams),
        )


def spline_basis(attribute):
    """Products of the axes' linear weights, (..., 8), the slot of x running fastest (SplineCNN, Fey et al. 2018, Eq. 2)."""
    x, y, t = (torch.stack([1 - u, u], -1) for u in attribute.unbind(-1))
    return (t[..., :, None, None] * y[..., None, :, None] * x[..., None, None, :]).flatten(-3)


def integers(values):
    return torch.from_numpy(np.asarray(values, np.int64))


def at_least_one(count):
    return torch.from_numpy(np.maximum(count, 1).astype(np.float32))[:, None]
