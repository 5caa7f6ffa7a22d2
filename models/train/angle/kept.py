"""Graphs that are built once and kept on a device, for networks with blocks over cells.

The engine builds the event level, as in `graphs.py`. Poolings are computed here, because they change with each mirror and shift: without
one they are the engine's. A mirrored press keeps its edges, though the engine would choose otherwise among nodes at equal distances.
"""

import os
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from fractions import Fraction
from tempfile import TemporaryDirectory

import numpy as np
import torch
import torch.nn.functional as F
from graphs import Batch, Level, built, spline_basis
from presses import SHIFT, random_mirrors, times, turned

# Streams whose graphs are built together.
CHUNK = 40


@dataclass
class Nodes:
    """Events, or cells of a pooling, that are to be pooled."""

    stream: torch.Tensor  # (nodes,)
    position: torch.Tensor  # (nodes, 3), as shares of `extent`
    extent: torch.Tensor  # (3,), sensor and span in pixels and microseconds for events, whose sums are exact; 1 for cells
    inside: torch.Tensor  # (nodes,), whether the node is in the window
    edges: tuple  # (edges,) twice, the nodes that read and those that are read
    twice: list  # (nodes,) twice, 2 x the place in units of `size`: of an event its pixel, of a cell its centre
    size: list  # of a pixel or a cell, as fractions of the sensor


class KeptGraphs:
    """Graphs of the event level of streams, for the network that `inspected` described. They take 80 bytes an event."""

    def __init__(self, settings, sensor, streams, device):
        said = settings.said
        self.sensor, self.span_us, self.capacity, self.device = sensor, said["span_us"], said["capacity"], device
        self.scale = [level["scale"] for level in said["edge_attributes"]["levels"]]
        readout = next(layer for layer in said["layers"] if layer["kind"] == "readout")
        self.grid = readout["columns"], readout["rows"]
        pools = [layer for layer in said["layers"] if layer["kind"] == "pool"]
        assert said["normalisation"] == "fixed" and readout["times"] == 1 and "place" not in said, said
        assert pools and all(pool["position"] == "mean" and not pool["time"] for pool in pools), pools
        self.cells = [[Fraction(size) for size in pool["cell"]] for pool in pools]
        events = sum(map(len, streams))
        self.source = torch.full((events, said["graph"]["most"]), -1, dtype=torch.int32, device=device)
        self.events = torch.empty((events, 4), dtype=torch.int32, device=device)
        self.times, start = [], [0]

        def build(first):
            part = streams[first : first + CHUNK]
            with TemporaryDirectory(dir=settings.folder) as folder:
                names = ["event", "level0.start", "level0.edges", "level0.source"]
                return np.concatenate(part), built(settings.meissner, settings.network, sensor, part, folder, names)

        with ThreadPoolExecutor(os.cpu_count()) as pool:
            for columns, tensors in pool.map(build, range(0, len(streams), CHUNK)):
                first, starts = start[-1], tensors["level0.start"]
                rows = slice(first, first + int(starts[-1]))
                columns = columns[tensors["event"]]
                self.events[rows] = torch.from_numpy(columns).to(device)
                edges, source = (torch.from_numpy(tensors[f"level0.{name}"]).to(device) for name in ("edges", "source"))
                reader = torch.repeat_interleave(torch.arange(len(edges) - 1, device=device), edges.diff())
                slot = torch.arange(len(source), device=device) - edges[reader]
                of_stream = torch.from_numpy(np.repeat(starts[:-1], np.diff(starts))).to(device)
                self.source[first + reader, slot] = source - of_stream[reader]
                self.times += np.split(columns[:, 0], starts[1:-1])
                start += (first + starts[1:]).tolist()
        self.start = np.array(start)

    def read(self, streams, ends, mirrors=None, shifts=None):
        """The batch whose `streams` are read at the last event that is not after `ends`, which are not before the last event if rows read
        later rows. Each stream is mirrored along its axes in `mirrors`, then shifted by pixels (streams, 2)."""
        size = len(streams)
        length = np.array([np.searchsorted(self.times[i], end, "right") for i, end in zip(streams, ends)])
        newest = np.array([self.times[i][count - 1] if count else end for i, count, end in zip(streams, length, ends)])
        device, to = self.device, lambda array: torch.from_numpy(np.asarray(array)).to(self.device)
        first = np.cumsum(length) - length
        stream = torch.repeat_interleave(torch.arange(size, device=device), to(length))
        rows = torch.arange(length.sum(), device=device) + to(self.start[streams] - first)[stream]
        t, x, y, on = self.events[rows].unbind(1)
        if mirrors is not None:
            columns, lines = (to([axis in each for each in mirrors])[stream] for axis in ("columns", "rows"))
            x = torch.where(columns, self.sensor[0] - 1 - x, x)
            y = torch.where(lines, self.sensor[1] - 1 - y, y)
        if shifts is not None:
            x, y = (pixel + to(shifts[:, axis])[stream] for axis, pixel in enumerate((x, y)))
        seen = (x >= 0) & (x < self.sensor[0]) & (y >= 0) & (y < self.sensor[1])
        relative = self.source[rows]
        there = (relative >= 0) & seen[:, None]
        source = torch.where(there, relative + to(first)[stream][:, None], 0)
        there &= seen[source]
        t = t - to(newest)[stream]
        # The window has no more events than its capacity.
        later = to(first + length)[stream] - torch.arange(len(rows), device=device)
        nodes = Nodes(
            stream,
            position=torch.stack([x, y, t], 1).double(),
            extent=torch.tensor([*self.sensor, self.span_us], dtype=torch.float64, device=device),
            inside=seen & (t >= -self.span_us) & (later <= self.capacity),
            edges=(torch.arange(len(rows), device=device)[:, None].expand_as(source)[there], source[there]),
            twice=[2 * x.long(), 2 * y.long()],
            size=[Fraction(1, side) for side in self.sensor],
        )
        levels = [self.level(0, nodes, source, there)]
        for number in range(1, len(self.scale)):
            level, nodes = self.pooled(number, nodes)
            levels.append(level)
        column, line = (
            (nodes.position[:, axis] * cells).floor().long().clamp(0, cells - 1) for axis, cells in enumerate(self.grid)
        )
        place = (nodes.stream * self.grid[1] + line) * self.grid[0] + column
        return Batch((2.0 * on - 1)[:, None].float(), levels, torch.arange(len(place), device=device), place, size)

    def pooled(self, number, below):
        """The level with a number, and its nodes: means of the positions of their members, and edges where members have one."""
        size = self.cells[number - 1]
        columns, lines = (int(np.ceil(1 / side)) for side in size)
        column = cell_of(below.twice[0], below.size[0], size[0]).clamp(max=columns - 1)
        line = cell_of(below.twice[1], below.size[1], size[1]).clamp(max=lines - 1)
        row = below.inside.nonzero().flatten()
        keys, place = torch.unique(((below.stream * lines + line) * columns + column)[row], return_inverse=True)
        members = F.pad(below.position[row], (0, 1), value=1.0)
        sums = members.new_zeros(len(keys), 4).index_add(0, place, members)
        cell = torch.full_like(below.stream, -1)
        cell[row] = place
        reader, source = (cell[rows] for rows in below.edges)
        kept = (reader >= 0) & (source >= 0) & (reader != source)
        pair = torch.unique(reader[kept] * len(keys) + source[kept])
        nodes = Nodes(
            keys // (columns * lines),
            position=sums[:, :3] / (sums[:, 3:] * below.extent),
            extent=torch.ones_like(below.extent),
            inside=torch.ones_like(keys, dtype=torch.bool),
            edges=(pair // len(keys), pair % len(keys)),
            twice=[2 * (keys % columns) + 1, 2 * (keys // columns % lines) + 1],
            size=size,
        )
        reader, source = nodes.edges
        count = torch.bincount(reader, minlength=len(keys))
        slot = torch.arange(len(pair), device=self.device) - (count.cumsum(0) - count)[reader]
        # At least 1, also without any cell.
        most = int(F.pad(count, (0, 1), value=1).max())
        padded = torch.full((len(keys), most), -1, device=self.device)
        padded[reader, slot] = source
        level = self.level(number, nodes, padded.clamp(min=0), padded >= 0)
        level.row, level.place = row, place
        return level, nodes

    def level(self, number, nodes, source, there):
        """A level whose rows read the rows `source` (rows, k) where they are `there`."""
        offset = (nodes.position[source] - nodes.position[:, None]) / (nodes.extent * 2 * self.scale[number])
        attribute = (offset + 0.5).clamp(0, 1).float()
        return Level(source, spline_basis(attribute, there.float()), there.sum(1, keepdim=True).clamp(min=1).float())


def cell_of(twice, inner, outer):
    """The cell of size `outer` at a place, which is given as twice a number of cells of size `inner`."""
    return twice * (inner.numerator * outer.denominator) // (2 * inner.denominator * outer.numerator)


class KeptPresses:
    """The kept graphs of presses as each camera in `data` saw them: of whole presses and, where rows read later rows, of some that were
    cut off."""

    def __init__(self, data, settings, random):
        self.data, self.settings = data, settings
        self.cuts = settings.keep if settings.said["graph"]["candidates"] == "all" else 0

        def cut_off(source):
            return [times(source, press, settings, random)[0] for press in range(len(source))]

        self.ends = np.stack([[source.end_us, *(cut_off(source) for _ in range(self.cuts))] for source in data])
        streams = []
        for source, cuts in zip(data, self.ends):
            for ends in cuts:
                streams += [press[: np.searchsorted(press[:, 0], end, "right")] for press, end in zip(source.events, ends)]
        self.graphs = KeptGraphs(settings, data[0].sensor, streams, settings.device)

    def batches(self, presses, random):
        """Batches of `presses`, each press as a random camera saw it, with their targets in units of the network. Half of the presses are
        cut off."""
        settings = self.settings
        for first in range(0, len(presses) - settings.batch + 1, settings.batch):
            streams, ends, mirrors, targets = [], [], [], []
            for press in presses[first : first + settings.batch]:
                camera, whole = random.integers(len(self.data)), random.random() < 0.5
                cut = 0 if whole or not self.cuts else random.integers(1, self.cuts + 1)
                source = self.data[camera]
                end = self.ends[camera, cut, press] if whole or self.cuts else times(source, press, settings, random)[0]
                label = [source.at(name, press, end) for name in settings.outputs]
                streams.append((camera * (self.cuts + 1) + cut) * len(source) + press)
                ends.append(end)
                mirrors.append(random_mirrors(settings, random))
                targets.append(turned(settings.outputs, mirrors[-1]) * label)
            shifts = random.integers(-SHIFT, SHIFT + 1, (len(streams), 2))
            batch = self.graphs.read(np.array(streams), np.array(ends), mirrors, shifts)
            yield batch, torch.from_numpy((np.array(targets) / settings.unit).astype(np.float32))
