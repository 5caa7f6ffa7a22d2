"""Graphs as the engine builds them: `meissner prepare graphs`, and batches of what it writes.

Nothing is searched or scaled here, so that training and inference see the same graph. Where rows read earlier rows only, what an
event says does not depend on what follows, so that one graph of a press can be read at any of its times. Otherwise, and where blocks
read cells of a pooling, a graph is read at the end of its stream. A mirror changes no neighbourhood of events: it swaps the slots of the
kernels. It does change the cells of a pooling: there the events are mirrored and shifted before the graphs are built.
"""

import json
import subprocess
from dataclasses import dataclass, replace
from fractions import Fraction
from pathlib import Path

import numpy as np
import torch
from safetensors import safe_open
from safetensors.numpy import save_file


@dataclass
class Level:
    """Events, or cells of a pooling, of some streams: their rows numbered through, and what they read."""

    source: torch.Tensor  # (rows, k), rows that are read
    basis: torch.Tensor  # (rows, 8, k), of kernels of 2 x 2 x 2; 0 where there is no in-edge
    in_edges: torch.Tensor  # (rows, 1), at least 1
    row: torch.Tensor = None  # (pooled,), rows of the level below that are pooled, above the events
    place: torch.Tensor = None  # (pooled,), the row of this level that pools each


@dataclass
class Batch:
    """Some streams, and readouts of each at some times."""

    input: torch.Tensor  # (events, channels), the polarity, and the place in a cell where the network asks for it
    levels: list  # of events, then of each pooling where blocks read its cells
    row: torch.Tensor  # (read,), rows of the last level that a readout reads
    place: torch.Tensor  # (read,), cell of the readout, readout after readout
    readouts: int


def inspected(meissner, network):
    """What `meissner inspect` says about `network`, which must be one that this folder can train."""
    command = [str(meissner), "inspect", str(network), "--json"]
    said = json.loads(subprocess.run(command, check=True, capture_output=True).stdout)
    kinds = {layer["kind"] for layer in said["layers"]}
    if "graph" not in said:
        return said
    if kinds - {"spline", "pool", "readout", "dense"}:
        raise SystemExit(f"{network}: expected spline blocks, poolings, a readout and dense layers, found {sorted(kinds)}")
    return said


def has_pooled_blocks(said):
    """Whether blocks read cells of a pooling."""
    return "graph" in said and any(layer["level"] > 0 for layer in said["layers"] if layer["kind"] == "spline")


def reads_later_rows(said):
    """Whether rows read rows after them, or cells that these change, so that a graph can be read at its end alone."""
    return "graph" in said and (said["graph"]["candidates"] == "all" or has_pooled_blocks(said))


def built(meissner, network, sensor, streams, folder, names=None):
    """The tensors of the graphs of `streams`, as `meissner prepare graphs` writes them; all, or those with `names`."""
    events, out = Path(folder) / "events.safetensors", Path(folder) / "graphs.safetensors"
    columns = np.concatenate(streams).astype(np.int64).T
    tensors = dict(zip(("t_us", "x", "y", "on"), map(np.ascontiguousarray, columns)))
    tensors["start"] = np.cumsum([0] + [len(stream) for stream in streams])
    save_file(tensors, events, {"sensor": json.dumps(sensor)})
    command = [meissner, "prepare", "graphs", events, "--network", network, "--out", out]
    subprocess.run([str(word) for word in command], check=True, stdout=subprocess.DEVNULL)
    with safe_open(out, "np") as file:
        return {name: file.get_tensor(name) for name in names or file.keys()}


class Graphs:
    """Graphs of streams of events, for the network that `inspected` described."""

    def __init__(self, meissner, network, said, sensor, streams, folder):
        self.columns = np.concatenate(streams).astype(np.int64).T
        self.tensors = built(meissner, network, sensor, streams, folder)
        self.span_us, self.sensor, self.cell = said["span_us"], sensor, [Fraction(size) for size in said.get("place", [])]
        grid = next(layer for layer in said["layers"] if layer["kind"] == "readout")
        self.grid, self.times = (grid["columns"], grid["rows"]), grid["times"]
        # The cells in time that the readout keeps apart, as a fraction of the span. Pooling takes the same maxima as the readout.
        pools = [layer["time"] for layer in said["layers"] if layer["kind"] == "pool"]
        self.time = Fraction(pools[-1]) if self.times > 1 else None
        self.levels = 1 + len(pools) if has_pooled_blocks(said) else 1

    def part(self, streams):
        """The graphs of `streams`, a range of their numbers."""
        starts = self.tensors["level0.start"][streams.start : streams.stop + 1]
        t_us, x, y, on = self.columns[:, self.tensors["event"][starts[0] : starts[-1]]]
        stream = np.repeat(np.arange(len(streams)), np.diff(starts))
        # Cells in time start at the first event of a stream.
        epoch = t_us[np.minimum(starts[:-1] - starts[0], len(t_us) - 1)]
        levels = [self.level(number, streams) for number in range(self.levels)]
        return Part(levels, streams, stream, t_us, x, y, 2.0 * on - 1, epoch, self)

    def level(self, number, streams):
        """A level of the graphs of `streams`."""
        rows = self.rows(number, streams)
        edges = self.tensors[f"level{number}.edges"][rows.start : rows.stop + 1]
        count = np.diff(edges)
        slot = np.arange(max(count.max(initial=1), 1))[None]
        there = slot < count[:, None]
        edge = np.where(there, edges[:-1, None] + slot, 0)
        source = np.where(there, self.tensors[f"level{number}.source"].take(edge) - rows.start, 0)
        attribute = self.tensors[f"level{number}.attribute"].take(edge, axis=0)
        level = Level(
            source=torch.from_numpy(source.astype(np.int64)),
            basis=spline_basis(torch.from_numpy(attribute), torch.from_numpy(there.astype(np.float32))),
            in_edges=torch.from_numpy(np.maximum(count, 1).astype(np.float32))[:, None],
        )
        if number > 0:
            # Events that have left the window are in no cell.
            cell = self.tensors[f"level{number}.cell"][self.rows(number - 1, streams)].astype(np.int64)
            level.row = torch.from_numpy(np.flatnonzero(cell >= 0))
            level.place = torch.from_numpy(cell[cell >= 0] - rows.start)
        return level

    def rows(self, number, streams):
        """The rows of `streams` at a level."""
        return slice(*self.tensors[f"level{number}.start"][[streams.start, streams.stop]].tolist())


@dataclass
class Part:
    """Graphs of some streams, before they are read."""

    levels: list
    streams: range
    stream: np.ndarray  # (events,)
    t_us: np.ndarray
    x: np.ndarray
    y: np.ndarray
    polarity: np.ndarray
    epoch_us: np.ndarray  # (streams,)
    graphs: Graphs

    def read(self, times, mirrors=(), shift=(0, 0)):
        """The batch whose streams are read at `times` (streams, readouts): the window ends there, and events after it are as if
        they had not been. The image is mirrored along columns or rows, then shifted by pixels."""
        if len(self.levels) > 1:
            assert not mirrors and not any(shift) and times.shape[1] == 1, "a pooled graph is read as it was built"
            return self.read_pooled()
        (width, height), grid = self.graphs.sensor, self.graphs.grid
        x, y, basis = self.x, self.y, self.levels[0].basis
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
        row, place = (torch.from_numpy(np.concatenate(each)) for each in (row, place))
        return Batch(self.features(x, y), [replace(self.levels[0], basis=basis)], row, place, times.size)

    def read_pooled(self):
        """The batch whose streams are read at their ends, from the cells of the last pooling."""
        graphs, last = self.graphs, len(self.levels) - 1
        starts = graphs.tensors[f"level{last}.start"][self.streams.start : self.streams.stop + 1]
        cells = graphs.times * graphs.grid[0] * graphs.grid[1]
        place = graphs.tensors["readout"][starts[0] : starts[-1]] + cells * np.repeat(np.arange(len(self.streams)), np.diff(starts))
        row = torch.arange(len(place))
        return Batch(self.features(self.x, self.y), self.levels, row, torch.from_numpy(place), len(self.streams))

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


def spline_basis(attribute, there):
    """Products of the axes' linear weights, (rows, 8, k), the slot of x running fastest (SplineCNN, Fey et al. 2018, Eq. 2), times
    `there` (rows, k)."""
    attribute = attribute.movedim(-1, 0).contiguous()
    x, y, t = zip(1 - attribute, attribute)
    products = [there * c * b for c in t for b in y]
    return torch.stack([product * a for product in products for a in x], 1)
