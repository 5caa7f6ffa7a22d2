"""Graphs as the engine builds them: `meissner prepare graphs`, and batches of what it writes.

Nothing is searched or scaled here, so that training and inference see the same graph. Where rows read earlier rows only, what an
event says does not depend on what follows, so that one graph of a press can be read at any of its times. Otherwise a graph is read at
the end of its stream. A mirror changes no neighbourhood: it swaps the slots of the kernels.
"""

import json
import subprocess
from dataclasses import dataclass
from fractions import Fraction
from pathlib import Path

import numpy as np
import torch
from safetensors.numpy import load_file, save_file


@dataclass
class Batch:
    """Some streams, their rows numbered through, and readouts of each at some times."""

    input: torch.Tensor  # (rows, channels), the polarity, and the place in a cell where the network asks for it
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
    if "graph" not in said:
        return said
    blocks = [layer["level"] for layer in said["layers"] if layer["kind"] == "spline"]
    if kinds - {"spline", "pool", "readout", "dense"} or max(blocks) > 0:
        raise SystemExit(f"{network}: expected spline blocks over events, a readout and dense layers, found {sorted(kinds)}")
    return said


def reads_later_rows(said):
    """Whether rows read rows after them, so that a graph can be read at its end alone."""
    return "graph" in said and said["graph"]["candidates"] == "all"


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
        self.span_us, self.sensor, self.cell = said["span_us"], sensor, [Fraction(size) for size in said.get("place", [])]
        grid = next(layer for layer in said["layers"] if layer["kind"] == "readout")
        self.grid, self.times = (grid["columns"], grid["rows"]), grid["times"]
        # The cells in time that the readout keeps apart, as a fraction of the span. Pooling takes the same maxima as the readout.
        pools = [layer["time"] for layer in said["layers"] if layer["kind"] == "pool"]
        self.time = Fraction(pools[-1]) if self.times > 1 else None

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
            input=None,
            source=torch.from_numpy(source.astype(np.int64)),
            basis=basis.mT.contiguous(),
            in_edges=torch.from_numpy(np.maximum(count, 1).astype(np.float32))[:, None],
            row=None,
            place=None,
            readouts=0,
        )
        stream = np.repeat(np.arange(len(streams)), np.diff(starts))
        # Cells in time start at the first event of a stream.
        epoch = t_us[np.minimum(starts[:-1] - starts[0], len(t_us) - 1)]
        return Part(batch, stream, t_us, x, y, 2.0 * on - 1, epoch, self)


@dataclass
class Part:
    """Graphs of some streams, before they are read."""

    batch: Batch
    stream: np.ndarray  # (rows,)
    t_us: np.ndarray
    x: np.ndarray
    y: np.ndarray
    polarity: np.ndarray
    epoch_us: np.ndarray  # (streams,)
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
        cells = self.graphs.times * grid[0] * grid[1]
        row, place = [], []
        for i in range(times.shape[1]):
            end = times[self.stream, i]
            inside = np.flatnonzero(there & (self.t_us <= end) & (self.t_us >= end - self.graphs.span_us))
            row.append(inside)
            of = self.stream[inside]
            age = self.in_time(end[inside] - self.epoch_us[of]) - self.in_time(self.t_us[inside] - self.epoch_us[of])
            place.append((of * times.shape[1] + i) * cells + age * grid[0] * grid[1] + cell[inside])
        batch = self.batch
        row, place = (torch.from_numpy(np.concatenate(each)) for each in (row, place))
        return Batch(self.features(x, y), batch.source, basis, batch.in_edges, row, place, times.size)

    def in_time(self, since_us):
        """The cell in time at a time since the epoch."""
        size = self.graphs.time
        return since_us * size.denominator // (self.graphs.span_us * size.numerator) if size else np.zeros_like(since_us)

    def features(self, x, y):
        """The polarity, and the place of the pixel's centre in its cell: -1 at the start of the cell, 1 at its end."""
        columns = [self.polarity]
        for pixel, side, size in zip((x, y), self.graphs.sensor, self.graphs.cell):
            length = side * size.numerator
            columns.append((2 * (pixel * size.denominator % length) + size.denominator - length) / length)
        return torch.from_numpy(np.stack(columns, axis=1).astype(np.float32))


def spline_basis(attribute):
    """Products of the axes' linear weights, (..., 8), the slot of x running fastest (SplineCNN, Fey et al. 2018, Eq. 2)."""
    x, y, t = (torch.stack([1 - u, u], -1) for u in attribute.unbind(-1))
    return (t[..., :, None, None] * y[..., None, :, None] * x[..., None, None, :]).flatten(-3)
