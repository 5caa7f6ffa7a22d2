"""Grasps as `meissner simulate grasp` writes them, as frames of event counts with the force at the end of each."""

from copy import copy

import numpy as np
import torch
from meissner.torch import Film, Presses, errors

SIDE, FRAMES, PERIOD_US = 115, 41, 10_000
MAXIMUM = 8.0  # divisor of counts: `maximum` of the descriptions


class Grasps:
    """Frames of event counts, or a layer of `module` applied to them, with the force at the end of each frame."""

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
        self.settings = None  # step in pixels, recordings of an epoch, recordings of a step
        self.bolt = np.array([film.labels["bolt"][press][0] for press in self.presses])
        self.force = torch.from_numpy(np.stack([film.at(["force"], press, ends)[:, 0] for press in self.presses]).astype(np.float32))

    def __len__(self):
        return len(self.force)

    def part(self, chosen):
        """Some of these recordings, by their index here."""
        part = copy(self)
        part.presses, part.bolt, part.values, part.force = (each[chosen] for each in (self.presses, self.bolt, self.values, self.force))
        return part

    def of(self, chosen, every, random=None):
        """Frames of some recordings, every n-th pixel from a random one on, mirrored at random."""
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


class Streams:
    """The same recordings as events, for a network that can be read at any time; `settings` are those of `Presses`."""

    def __init__(self, path, settings):
        self.film, self.settings = Film(path), settings
        self.presses, self.bolt = np.arange(len(self.film)), np.array([bolt[0] for bolt in self.film.labels["bolt"]])

    def part(self, chosen):
        """Some of these recordings, by their index here."""
        part, film = copy(self), copy(self.film)
        film.events, film.times = ([each[i] for i in chosen] for each in (film.events, film.times))
        film.labels = {name: [each[i] for i in chosen] for name, each in film.labels.items()}
        film.contact_us, film.end_us = film.contact_us[chosen], film.end_us[chosen]
        part.film, part.presses, part.bolt = film, self.presses[chosen], self.bolt[chosen]
        return part

    def __len__(self):
        return len(self.film)

    def presses_of(self, **settings):
        """The training data for `fit`."""
        return Presses(self.film, **self.settings | settings)

    def error(self, module, _, most):
        """As `Grasps.error`; all recordings end with their last frame."""
        film = self.part(np.arange(min(len(self.film), most))).film
        film.contact_us = np.zeros_like(film.end_us)  # shares of a whole recording are the ends of its frames
        found = errors(module, Presses(film, **self.settings), np.arange(1, FRAMES + 1) / FRAMES)
        return float(np.square(found).mean())
