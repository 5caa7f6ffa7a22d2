"""Pins of TacTip images after a sideways move: their positions, and their path.

The robot pressed the sensor on the plane, then moved it sideways by up to 5 mm along x and y and turned it by up to 5 degrees about x, y
and z, and then took the image. Pins in contact stick to the plane at first and slip when the move is large. The field of `pins.fit` gets
terms in the move, in which sideways moves saturate; each has a factor of depth and of the move.

The deviation of an image from the field is alike in neighbouring pins: a pin is searched at the position that its neighbours suggest,
and the matching is repeated with this position. Two pins never take the same blob.
"""

from dataclasses import dataclass
from itertools import combinations_with_replacement

import numpy as np
import pins
from scipy.spatial import cKDTree

# Deep presses spread the pins, and the outermost look small.
RADIUS, AREA = 57.0, (2, 60)  # pixels
SLIP = 3.0  # mm, of the sideways move at which pins slip rather than stick
STAGES = (400, 1), (1500, 2), (None, 2), (None, 3), (None, 3)  # images of a fit, from the smallest move outwards, and degree of its terms
WIDTHS = 20, 20, 10, 10, 6, 6, 6  # pixels, of the Gaussian weights of neighbours, from one match to the next


@dataclass
class Field:
    """The positions of all pins as a function of pose and move."""

    rest: np.ndarray  # (pin, 2), column and row in pixels
    coefficients: np.ndarray  # (term, pin, 2)
    degree: int

    def __call__(self, pose, move):
        """Positions (press, pin, 2) for poses (press, 3) and moves (press, 5): x and y in mm, three turns in degrees."""
        return self.rest + np.einsum("it,tpc->ipc", terms(pose, move, self.degree), self.coefficients)


def terms(pose, move, degree):
    """Terms of the motion, (press, term): those of `pins.terms`, and products of tilts and moves, each with a factor of depth."""
    depth = pose[:, 0] / pins.MIDDLE
    stuck = move[:, :2] / SLIP / np.sqrt(1 + (np.hypot(*move[:, :2].T) / SLIP) ** 2)[:, None]
    factors = np.column_stack([pose[:, 1:] / 10, stuck, move[:, 2:] / 5]).T
    found = [pins.terms(pose)]
    for n in range(1, degree + 1):
        for chosen in combinations_with_replacement(range(len(factors)), n):
            if chosen[-1] < 2:
                continue  # no move
            product = np.prod(factors[list(chosen)], axis=0)
            powers = 3 if n == 1 else 2 if n < degree else 1
            found += [depth**power * product for power in range(1, powers + 1)]
    return np.column_stack(found)


def read(path):
    """Blobs of each image, poses (press, 3) and moves (press, 5) of a file such as shear_train.npz."""
    images, pose = pins.read(path)
    with np.load(path) as file:
        return [pins.blobs(image, RADIUS, AREA) for image in images], pose, file["move"]


def followed(found, expected):
    """The blob of each pin (press, pin, 2), searched around `expected` and at the position that its neighbours suggest; NaN if none is
    near."""
    mean = expected.mean(0)
    away = ((mean[:, None] - mean) ** 2).sum(-1)
    weights = {width: np.exp(-away / (2 * width**2)) - np.eye(len(mean)) for width in set(WIDTHS)}
    seen = np.full(expected.shape, np.nan)
    for positions, there, where in zip(seen, found, expected):
        tree = cKDTree(there)
        taken, blob = matched(tree, where)
        for width in WIDTHS:
            weight = weights[width][:, taken]
            missed = weight @ (there[blob] - where)[taken] / (weight.sum(1, keepdims=True) + 1e-9)
            taken, blob = matched(tree, where + missed)
        positions[taken] = there[blob[taken]]
    return seen


def matched(tree, where):
    """Whether each pin has a blob near, and its nearest blob. If several pins have the same blob, only the nearest pin keeps it."""
    away, blob = tree.query(where)
    order = np.lexsort((away, blob))
    taken = np.zeros(len(where), bool)
    taken[order] = np.diff(blob[order], prepend=-1) > 0
    return taken & (away < pins.NEAR), blob


def fit(tap, shear):
    """The field of presses with and without a move, and the pins (press, pin, 2) of those with one. `tap` has poses, the pins that were
    followed, and their field; `shear` has the result of `read`."""
    pose, seen, field = tap
    found, pose_after, move = shear
    far = np.hypot(*move[:, :2].T) + np.abs(move[:, 2:]).sum(1) / 5
    far += np.abs(pose_after[:, 1:]).sum(1) / 20 + np.abs(pose_after[:, 0] - pins.MIDDLE) / 2
    order = np.argsort(far)
    poses, moves = np.concatenate([pose, pose_after]), np.concatenate([np.zeros((len(pose), move.shape[1])), move])
    expected = field(pose_after)
    for count, degree in STAGES:
        part = order[:count]
        after = np.full(expected.shape, np.nan)
        after[part] = followed([found[i] for i in part], expected[part])
        motion = np.concatenate([seen, after]) - field.rest
        fitted = Field(field.rest, pins.regressed(terms(poses, moves, degree), motion), degree)
        expected = fitted(pose_after, move)
    return fitted, after
