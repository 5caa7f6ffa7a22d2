"""Streams of events as networks read them: graphs as the engine builds them, and signed frames over a sliding window.

Nothing is searched, pooled or scaled here, so that training and inference see the same graph. A stream is an array of shape (events, 4)
with columns t in microseconds, x, y and 1 where the brightness rose, or a structured array with the fields t, x, y, p.
"""

from __future__ import annotations

import json
from dataclasses import dataclass, field, fields, replace
from fractions import Fraction
from functools import cached_property

import numpy as np
import torch
from safetensors import numpy as tensors

from .. import InputError
from .._meissner import _graphs


@dataclass
class Level:
    """Events or pooled cells of some streams: their rows, numbered consecutively, and the rows that they read."""

    source: torch.Tensor  # (rows, k), rows that are read
    there: torch.Tensor  # (rows, k), whether there is such an in-edge
    attribute: torch.Tensor  # (rows, k, 3), from 0 to 1
    offset: torch.Tensor | None = None  # (rows, k, 3), if PointNet blocks read them
    row: torch.Tensor | None = None  # (pooled,), pooled rows of the level below; None for events
    place: torch.Tensor | None = None  # (pooled,), the row of this level that pools each
    bases: dict = field(default_factory=dict)

    @cached_property
    def in_edges(self):
        """(rows, 1), number of in-edges, at least 1."""
        return self.there.sum(1, keepdim=True).clamp(min=1).to(self.attribute.dtype)

    def basis(self, kernel):
        """Products of the linear weights of the axes (rows, slots, k), the slot of x varies fastest; 0 where there is no in-edge
        (SplineCNN, Fey et al. 2018, Eq. 2)."""
        if tuple(kernel) not in self.bases:
            product = self.there[:, None].to(self.attribute.dtype)
            for axis in (2, 1, 0):
                slots = torch.arange(kernel[axis], device=self.attribute.device)[:, None]
                place = self.attribute[:, None, :, axis] * max(kernel[axis] - 1, 1)
                hats = (1 - (place - slots).abs()).clamp(min=0) if kernel[axis] > 1 else torch.ones_like(place)
                product = (product[:, :, None] * hats[:, None]).flatten(1, 2)
            self.bases[tuple(kernel)] = product
        return self.bases[tuple(kernel)]

    def in_numpy(self):
        """Sources, whether they exist, and attributes, as functions in Rust read them."""
        return tuple(tensor.contiguous().numpy() for tensor in (self.source, self.there, self.attribute))

    def to(self, device):
        moved = {each.name: getattr(self, each.name) for each in fields(self) if each.name != "bases"}
        return Level(**{name: tensor if tensor is None else tensor.to(device) for name, tensor in moved.items()})


@dataclass
class Batch:
    """Some streams, and readouts of each at some times."""

    input: torch.Tensor  # (events, channels)
    levels: list[Level]
    row: torch.Tensor  # (read,), rows of the last level that a readout reads
    place: torch.Tensor  # (read,), cell of the readout, readout after readout
    readouts: int

    def to(self, device):
        levels = [level.to(device) for level in self.levels]
        return Batch(self.input.to(device), levels, self.row.to(device), self.place.to(device), self.readouts)


def columns_of(stream):
    """A stream as int64 of shape (events, 4)."""
    if stream.dtype.names:
        stream = np.stack([stream[name] for name in ("t", "x", "y", "p")], 1)
    if stream.ndim != 2 or stream.shape[1] != 4:
        raise InputError(f"stream: expected shape (events, 4) or fields t, x, y, p, found {stream.shape}")
    return stream.astype(np.int64)


def moved(stream, sensor, mirrors=(), shift=(0, 0)):
    """The events mirrored along columns or rows, then shifted by pixels; events outside the sensor are left out."""
    (width, height), (t_us, x, y, on) = sensor, stream.T
    x = (width - 1 - x if "columns" in mirrors else x) + shift[0]
    y = (height - 1 - y if "rows" in mirrors else y) + shift[1]
    there = (x >= 0) & (x < width) & (y >= 0) & (y < height)
    return np.stack([t_us, x, y, on], axis=1)[there]


class Graphs:
    """Graphs of streams, each from a reset to its last event, for a network over events."""

    def __init__(self, module, sensor, streams):
        said = module.said
        self.columns = np.concatenate([columns_of(stream) for stream in streams]).T
        file = dict(zip(("t_us", "x", "y", "on"), map(np.ascontiguousarray, self.columns)))
        file["start"] = np.cumsum([0] + [len(stream) for stream in streams])
        made = _graphs(module.description, tensors.save(file, {"sensor": json.dumps(list(map(int, sensor)))}))
        self.tensors = tensors.load(made)
        self.sensor, self.span_us, self.capacity = sensor, said["span_us"], said["capacity"]
        self.cell = [Fraction(size) for size in said.get("place") or []]
        grid = next(layer for layer in said["layers"] if layer["kind"] == "readout")
        self.grid, self.cells = (grid["columns"], grid["rows"]), grid["times"] * grid["columns"] * grid["rows"]
        self.read, self.levels = module.levels_read, module.levels

    def batch(self, streams, times=None, mirrors=(), shift=(0, 0)):
        """The batch of `streams`, a range of indices, each read at its end.

        With `times` (streams, readouts) in microseconds, it is read at these times: the window ends there, and later events have no
        effect. The image is mirrored along columns or rows, then shifted by pixels. Both need a module with `reads_any_time`."""
        starts = self.tensors["level0.start"][streams.start : streams.stop + 1]
        t_us, x, y, on = self.columns[:, self.tensors["event"][starts[0] : starts[-1]]]
        levels = [self.level(number, streams) for number in range(self.levels)]
        stream = np.repeat(np.arange(len(streams)), np.diff(starts))
        if times is None and self.levels > 1:
            last = self.tensors[f"level{self.levels - 1}.start"][streams.start : streams.stop + 1]
            row = np.arange(last[-1] - last[0])
            place = self.tensors["readout"][last[0] : last[-1]] + self.cells * np.repeat(np.arange(len(streams)), np.diff(last))
            return Batch(self.features(x, y, on), levels, torch.from_numpy(row), torch.from_numpy(place).long(), len(streams))
        if times is None:
            times = np.array([t_us[end - starts[0] - 1] if end > start else 0 for start, end in zip(starts, starts[1:])])[:, None]
        width, height = self.sensor
        # A mirror swaps the slots of the kernels, and changes no neighbourhood of events.
        attribute = levels[0].attribute
        for axis, (name, side) in enumerate((("columns", width), ("rows", height))):
            if name in mirrors:
                x, y = (width - 1 - x, y) if axis == 0 else (x, height - 1 - y)
                attribute = attribute.clone()
                attribute[..., axis] = 1 - attribute[..., axis]
        x, y = x + shift[0], y + shift[1]
        there = (x >= 0) & (x < width) & (y >= 0) & (y < height)
        cell = x * self.grid[0] // width + self.grid[0] * (y * self.grid[1] // height)
        rows, places = [], []
        for i in range(times.shape[1]):
            end = times[:, i]
            inside = np.flatnonzero(there & (t_us <= end[stream]) & (t_us >= end[stream] - self.span_us))
            # The window has no more events than its capacity.
            of = stream[inside]
            newer = np.cumsum(np.bincount(of, minlength=len(streams)))[of] - np.arange(len(of))
            inside, of = inside[newer <= self.capacity], of[newer <= self.capacity]
            rows.append(inside)
            places.append((of * times.shape[1] + i) * self.cells + cell[inside])
        row, place = (torch.from_numpy(np.concatenate(each)) for each in (rows, places))
        return Batch(self.features(x, y, on), [replace(levels[0], attribute=attribute)], row, place, times.size)

    def level(self, number, streams):
        """A level of the graphs of `streams`."""
        first, end = self.tensors[f"level{number}.start"][[streams.start, streams.stop]].tolist()
        edges = self.tensors[f"level{number}.edges"][first : end + 1].astype(np.int64)
        # If no block reads the in-edges of the level, they are left out.
        count = np.diff(edges) * (number in self.read)
        slot = np.arange(max(count.max(initial=1), 1))[None]
        there = slot < count[:, None]
        edge = np.where(there, edges[:-1, None] + slot, 0)
        taken = {name: self.tensors.get(f"level{number}.{name}") for name in ("source", "attribute", "offset")}
        empty = {"source": np.zeros(edge.shape, np.int32), "attribute": np.zeros((*edge.shape, 3), np.float32)}
        taken = {name: empty.get(name) if values is None or not len(values) else values[edge] for name, values in taken.items()}
        level = Level(
            source=torch.from_numpy(np.where(there, taken["source"].astype(np.int64) - first, 0)),
            there=torch.from_numpy(there),
            attribute=torch.from_numpy(taken["attribute"]),
            offset=None if taken["offset"] is None else torch.from_numpy(taken["offset"]),
        )
        if number > 0:
            # Events that have left the window are in no cell.
            below = slice(*self.tensors[f"level{number - 1}.start"][[streams.start, streams.stop]].tolist())
            cell = self.tensors[f"level{number}.cell"][below].astype(np.int64)
            level.row, level.place = torch.from_numpy(np.flatnonzero(cell >= 0)), torch.from_numpy(cell[cell >= 0] - first)
        return level

    def features(self, x, y, on):
        """The polarity, and the position of the pixel's centre in its cell: -1 at the start of the cell, 1 at its end."""
        columns = [2.0 * on - 1]
        for pixel, side, size in zip((x, y), self.sensor, self.cell):
            length = side * size.numerator
            columns.append((2 * (pixel * size.denominator % length) + size.denominator - length) / length)
        return torch.from_numpy(np.stack(columns, axis=1).astype(np.float32))


class SlidingFrames:
    """Streams for a frame network over sums of the polarities, 1 or -1, of a sliding window."""

    def __init__(self, module, sensor, streams):
        source = module.said["source"]
        if source.get("rule") != "sum" or not source.get("span_us") or module.said["input"] != [1, sensor[1], sensor[0]]:
            expected = f'frames = "signed" with a span and rule = "sum", of {sensor[0]} x {sensor[1]} pixels'
            raise InputError(f"network {module.said['name']!r}: expected {expected}, found {source} of {module.said['input']}")
        self.span_us, self.sensor, self.streams = source["span_us"], sensor, [columns_of(stream) for stream in streams]

    def batch(self, streams, times=None, mirrors=(), shift=(0, 0)):
        """Frames (streams x readouts, 1, height, width) of `streams`, a range of indices, at `times` or at their ends."""
        width, height = self.sensor
        if times is None:
            times = np.array([self.streams[i][-1:, 0].max(initial=0) for i in streams])[:, None]
        frames = np.zeros((times.size, height * width), np.float32)
        for i, number in enumerate(streams):
            t_us, x, y, on = moved(self.streams[number], self.sensor, mirrors, shift).T
            for j, end in enumerate(times[i]):
                inside = (t_us <= end) & (t_us >= end - self.span_us)
                place = y[inside] * width + x[inside]
                frames[i * times.shape[1] + j] = np.bincount(place, 2.0 * on[inside] - 1, height * width)
        return torch.from_numpy(frames).view(-1, 1, height, width)
