"""A kernel machine that knows that a press can be elsewhere on the skin, and presses made from presses for the layers that learn from it.

It is a ridge regression (Saunders et al. 1998, "Ridge regression learning algorithm in dual variables") of blurred maps. Its kernel is a
sum over shifts of one of two maps, as in Haasdonk and Burkhardt 2007, "Invariant kernel functions for pattern analysis and machine
learning".
"""

import numpy as np
import torch
from torch import nn

SHIFT, AXES = 2, 192  # the farthest copy in taxels; principal components
NEARNESS, MOVED, RIDGE = 8.0, 0.3, 0.1  # of the kernel; weight of a copy; added to the diagonal
MIX = 0.5  # share of made presses that is moved, and that is mixed


def moved(maps, down, right):
    """Maps (..., rows, columns) moved by taxels; new values at the border are zero."""
    found, (rows, columns) = torch.zeros_like(maps), maps.shape[-2:]
    to, of = ((slice(max(0, s * a), n + min(0, s * a)) for a, n in ((down, rows), (right, columns))) for s in (1, -1))
    found[(..., *to)] = maps[(..., *of)]
    return found


class Machine:
    """A kernel ridge regression of classes. Presses are alike if one, or a moved one, is near the other."""

    def __init__(self, maps, label, classes):
        shifts = range(-SHIFT, SHIFT + 1)
        copies = [maps, *(moved(maps, down, right) for down in shifts for right in shifts)]
        flat, self.mean = torch.stack([copy.flatten(1) for copy in copies]), maps.flatten(1).mean(0)
        self.scale = (maps.flatten(1) - self.mean).square().sum(1).mean().sqrt()
        flat = (flat - self.mean) / self.scale
        self.axes = torch.linalg.eigh(sum(part.T @ part for part in flat).double()).eigenvectors[:, -AXES:].float()
        self.known, lost = flat @ self.axes, torch.stack([(maps.square() - copy.square()).sum((1, 2, 3)) for copy in copies])
        # Values that have left the skin count as a difference.
        self.size = self.known.square().sum(2) + lost / self.scale**2
        kernel = self.kernel(maps).double()
        kernel, self.level = (kernel + kernel.T) / 2, kernel.diagonal().mean()
        target = nn.functional.one_hot(label, classes).double()
        self.prior = target.mean(0)
        self.weight = torch.linalg.solve(kernel / self.level + RIDGE * torch.eye(len(label)), target - self.prior)

    def kernel(self, maps):
        found = []
        for part in maps.split(256):
            inside = (part.flatten(1) - self.mean) / self.scale @ self.axes
            apart = [(size + inside.square().sum(1)[:, None] - 2 * inside @ known.T).clamp(min=0) for size, known in zip(self.size, self.known)]
            near = [torch.exp(-NEARNESS * distance) for distance in apart]
            found.append(near[0] + MOVED * sum(near[1:]))
        return torch.cat(found)

    def __call__(self, maps):
        """Scores (maps, classes)."""
        return (self.kernel(maps).double() / self.level @ self.weight + self.prior).float()


def made(maps, count, random):
    """`count` maps: presses, some moved, some mixed with another."""
    found = maps[random.integers(len(maps), size=count)]
    for i in np.flatnonzero(random.random(count) < MIX):
        found[i] = moved(found[i], *random.integers(-SHIFT, SHIFT + 1, 2).tolist())
    share = torch.from_numpy(np.where(random.random(count) < MIX, random.uniform(0, 0.5, count), 0)).float()[:, None, None, None]
    return (1 - share) * found + share * found[random.permutation(count)]
