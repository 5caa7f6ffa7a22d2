"""Grasps as `meissner simulate grasp` writes them, as frames of event counts with the force at the end of each."""

from copy import copy

import numpy as np
import torch
from meissner.torch import Film

SIDE, FRAMES, PERIOD_US = 115, 41, 10_000
MAXIMUM = 8.0  # what counts are divided by: `maximum` of the descriptions


class Grasps:
    """Frames of event counts, or what a layer of `module` makes of them, with the force at the end of each frame."""

    def __init__(self, path, module, first, chosen):
        film = Film(path)
        ends, size, read = np.arange(1, FRAMES + 1) * PERIOD_US, FRAMES * 2 * SIDE * SIDE, []
        self.presses = np.arange(len(film))[chosen]
        for press in self.presses:
            t_us, x, y, on = film.events[press].T.astype(np.int64)
            value = ((2 * (t_us // PERIOD_US) + on) * SIDE + y) * SIDE + x
            counts = torch.from_numpy(np.bincount(value, minlength=size).astype(np.uint8).reshape(FRAMES, 2, SIDE, SIDE))
            with torch.no_grad():
                read.append(counts if first == "frame" else module.values(counts[None] / MAXIMUM, first)[0])
        self.values, self.first = torch.stack(read), first
        self.settings = None  # every so many pixels, recordings of an epoch, recordings of a step
        self.bolt = np.array([film.labels["bolt"][press][0] for press in self.presses])
        self.force = torch.from_numpy(np.stack([film.at(["force"], press, ends)[:, 0] for press in self.presses]).astype(np.float32))

    def part(self, chosen):
        """Some of these recordings, by their index here."""
        part = copy(self)
        part.presses, part.bolt, part.values, part.force = (each[chosen] for each in (self.presses, self.bolt, self.values, self.force))
        return part

    def of(self, chosen, every, random=None):
        """Frames of some recordings, of every so many pixels from a random one on, mirrored at random."""
        frames = self.values[chosen]
        if frames.dim() == 5:
            row, column = (0, 0) if random is None or every == 1 else random.integers(every, size=2)
            frames = frames[..., row::every, column::every]
            axes = [axis for axis in (3, 4) if random is not None and random.random() < 0.5]
            frames = torch.flip(frames, axes) if axes else frames
        return {self.first: frames.float() / (MAXIMUM if self.first == "frame" else 1.0)}

    def epoch(self, _, random):
        every, recordings, batch = self.settings
        order = np.concatenate([random.permutation(len(self.force)) for _ in range(-(-recordings // len(self.force)))])
        for first in range(0, recordings - batch + 1, batch):
            chosen = np.sort(order[first : first + batch])
            yield first / recordings, self.of(chosen, every, random), self.force[chosen]

    @torch.no_grad()
    def error(self, module, every, most):
        """Mean squared error over all frames of at most `most` recordings."""
        parts = [slice(first, min(first + 4, most)) for first in range(0, min(len(self.force), most), 4)]
        return float(torch.cat([(module(self.of(part, every))[..., 0] - self.force[part]).square().flatten() for part in parts]).mean())
