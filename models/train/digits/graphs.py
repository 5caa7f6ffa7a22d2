"""Graphs as the engine builds them: `meissner prepare graphs`, and batches of what it writes.

Nothing is searched, pooled or scaled here, so that training and inference see the same graph.
"""

import json
import subprocess
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import torch
from safetensors.numpy import load_file, save_file


@dataclass
class Batch:
    """Some streams, their rows numbered through: E events."""

    input: torch.Tensor  # (E, 1), the polarity
    source: torch.Tensor  # (E, k), rows that are read
    basis: torch.Tensor  # (E, k, 8), of kernels of 2 x 2 x 2; 0 where there is no in-edge
    in_edges: torch.Tensor  # (E, 1), at least 1
    readout: torch.Tensor  # (E,), stream times cells of the readout, plus its cell
    streams: int


def preparation(meissner, network):
    """What weights that are trained for `network` say about its graphs, as JSON.

    Without the lifetime of edges: no event leaves a window during a recording, so that both give the same graph.
    """
    command = [str(meissner), "inspect", str(network), "--json"]
    said = json.loads(json.loads(subprocess.run(command, check=True, capture_output=True).stdout)["preparation"])
    said.pop("lifetime", None)
    return json.dumps(said)


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
        level = self.tensors
        rows = slice(*level["level0.start"][[streams.start, streams.stop]])
        edges = level["level0.edges"][rows.start : rows.stop + 1]
        count = np.diff(edges)
        place = np.arange(neighbours)[None]
        there = place < count[:, None]
        edge = np.where(there, edges[:-1, None] + place, 0)
        source = np.where(there, level["level0.source"][edge] - rows.start, 0)
        basis = spline_basis(torch.from_numpy(level["level0.attribute"][edge]))
        # The readout takes its maximum over cells of the pooling, which lie within its own.
        stream = np.repeat(np.arange(len(streams)), np.diff(level["level0.start"][streams.start : streams.stop + 1]))
        return Batch(
            input=torch.from_numpy(self.input[rows])[:, None],
            source=torch.from_numpy(source.astype(np.int64)),
            basis=basis * torch.from_numpy(there.astype(np.float32))[..., None],
            in_edges=torch.from_numpy(np.maximum(count, 1).astype(np.float32))[:, None],
            readout=torch.from_numpy(stream * readout_cells + level["readout"][level["level1.cell"][rows]]),
            streams=len(streams),
        )


def spline_basis(attribute):
    """Products of the axes' linear weights, (..., 8), the slot of x running fastest (SplineCNN, Fey et al. 2018, Eq. 2)."""
    x, y, t = (torch.stack([1 - u, u], -1) for u in attribute.unbind(-1))
    return (t[..., :, None, None] * y[..., None, :, None] * x[..., None, None, :]).flatten(-3)

