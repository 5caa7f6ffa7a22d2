"""Graphs as the engine builds them: `meissner prepare graphs`, and batches of what it writes.

Nothing is searched or scaled here, so that training and inference see the same graph. Rows of these networks read earlier rows
only: what an event says does not depend on what follows, so that one graph of a press can be read at any of its times. A mirror
changes no neighbourhood: it swaps the slots of the kernels.
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
    """Some streams, their rows numbered through, and readouts of each at some times."""

    input: torch.Tensor  # (rows, 1), the polarity
    source: torch.Tensor  # (rows, k), rows that are read
    basis: torch.Tensor  # (rows, 8, k), of kernels of 2 x 2 x 2; 0 where there is no in-edge
    in_edges: torch.Tensor  # (rows, 1), at least 1
    row: torch.Tensor  # (read,), rows that a readout reads
    place: torch.Tensor  # (read,), cell of the readout, readout after readout
    readouts: int


def inspected(meissner, network):
    """What `meissner inspect` says about `network`, which must be one that this folder can train."""
    command = [str(meissner), "inspect", str(network), "--json"]
    said = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    kinds = {layer["kind"] for layer in said["layers"]}
    if kinds - {"spline", "readout", "dense"} or said["graph"]["lifetime"] != "frozen":
        raise SystemExit(f"{network}: expected frozen spline blocks, a readout and dense layers, found {sorted(kinds)}")
    return said


class Graphs:
    """Graphs of streams of events, for the network that `inspected` described."""

    def __init__(self, meissner, network, said, sensor, streams, folder):
        events, out = Path(folder) / "events.safetensors", Path(folder) / "graphs.safetensors"
        self.columns = np.concatenate(streams).astype(np.int64).T
        tensors = dict(zip(("t_us", "x", "y", "on"), map(np.ascontiguousarray, self.columns)))
        tensors["start"] = np.cumsum([0] + [len(stream) for stream in streams])
        save_file(tensors, events, {"sensor": json.dumps(sensor)})
        command = [meissner, "prepare", "graphs", events, "--network", network, "--out", out]
        subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
        self.tensors = load_file(out)
        self.span_us, self.sensor = said["span_us"], sensor
        grid = next(layer for layer in said["layers"] if layer["kind"] == "readout")
        self.grid = grid["columns"], grid["rows"]

    def part(self, streams):
        """The graphs of `streams`, a range of their numbers."""
        starts = self.tensors["level0.start"][streams.start : streams.stop + 1]
        rows = slice(starts[0], starts[-1])
        edges = self.tensors["level0.edges"][rows.start : rows.stop + 1]
        count = np.diff(edges)
        slot = np.arange(max(count.max(initial=1), 1))[None]
        there = slot < count[:, None]
        edge = np.where(there, edges[:-1, None] + slot, 0)
        source = np.where(there, self.tensors["level0.source"][edge] - rows.start, 0)
        basis = spline_basis(torch.from_numpy(self.tensors["level0.attribute"][edge]))
        basis = basis * torch.from_numpy(there.astype(np.float32))[..., None]
        t_us, x, y, on = self.columns[:, self.tensors["event"][rows]]
        batch = Batch(
            input=torch.from_numpy(2 * on.astype(np.float32) - 1)[:, None],
            source=torch.from_numpy(source.astype(np.int64)),
            basis=basis.mT.contiguous(),
            in_edges=torch.from_numpy(np.maximum(count, 1).astype(np.float32))[:, None],
            row=None,
            place=None,
            readouts=0,
        )
        return Part(batch, np.repeat(np.arange(len(streams)), np.diff(starts)), t_us, x, y, self)


@dataclass
class Part:
    """Graphs of some streams, before they are read."""

    batch: Batch
    stream: np.ndarray  # (rows,)
    t_us: np.ndarray
    x: np.ndarray
    y: np.ndarray
    graphs: Graphs

    def read(self, times, mirrors=(), shift=(0, 0)):
        """The batch whose streams are read at `times` (streams, readouts): the window ends there, and events after it are as if
        they had not been. The image is mirrored along columns or rows, then shifted by pixels."""
        (width, height), grid = self.graphs.sensor, self.graphs.grid
        x, y, basis = self.x, self.y, self.batch.basis
        if "columns" in mirrors:
            x, basis = width - 1 - x, basis[:, [1, 0, 3, 2, 5, 4, 7, 6]]
        if "rows" in mirrors:
            y, basis = height - 1 - y, basis[:, [2, 3, 0, 1, 6, 7, 4, 5]]
        x, y = x + shift[0], y + shift[1]
        there = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        cell = x * grid[0] // width + grid[0] * (y * grid[1] // height)
        row, place = [], []
        for i in range(times.shape[1]):
            end = times[self.stream, i]
            inside = np.flatnonzero(there & (self.t_us <= end) & (self.t_us >= end - self.graphs.span_us))
            row.append(inside)
            place.append((self.stream[inside] * times.shape[1] + i) * (grid[0] * grid[1]) + cell[inside])
        batch = self.batch
        row, place = (torch.from_numpy(np.concatenate(each)) for each in (row, place))
        return Batch(batch.input, batch.source, basis, batch.in_edges, row, place, times.size)


def spline_basis(attribute):
    """Products of the axes' linear weights, (..., 8), the slot of x running fastest (SplineCNN, Fey et al. 2018, Eq. 2)."""
    x, y, t = (torch.stack([1 - u, u], -1) for u in attribute.unbind(-1))
    return (t[..., :, None, None] * y[..., None, :, None] * x[..., None, None, :]).flatten(-3)
