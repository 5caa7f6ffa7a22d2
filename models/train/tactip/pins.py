"""Pins of TacTip images: their positions, and their motion with the pose of a press.

A pin is a white blob. A model of their motion, fitted pin by pin from the middle of all poses outwards, distinguishes the pins:
position = rest + motion, where every term of the motion has a factor of depth. At depth 0 the pins are at rest for any tilts.
"""

from dataclasses import dataclass

import numpy as np
from scipy import ndimage
from scipy.spatial import cKDTree

SIDE = 128  # pixels of an image
CENTRE, RADIUS = (SIDE - 1) / 2, 52.0  # of the field of pins, in pixels
AREA = 3, 60  # of a pin, in pixels
PINS = 331
NEAR = 2.5  # maximum distance in pixels between a pin of the model and its blob
MIDDLE = 3.5  # mm, of all depths
STAGES = 300, 1000, 2500  # images of the first fits, from the middle of all poses; then all, three times
RIDGE = 1e-3
REST_DEGREE = 5  # of the polynomial in the image that smooths the motion from rest to SHALLOW
SHALLOW = 2.0  # mm, the least depth of the images


@dataclass
class Field:
    """The positions of all pins as a function of the pose."""

    rest: np.ndarray  # (pin, 2), column and row in pixels
    coefficients: np.ndarray  # (term, pin, 2)

    def __call__(self, pose):
        """Positions (press, pin, 2) for poses (press, 3): depth in mm, two tilts in degrees."""
        return self.rest + np.einsum("it,tpc->ipc", terms(pose), self.coefficients)


def terms(pose):
    """Terms of the motion, (press, term), for poses (press, 3)."""
    d, a, b = pose[:, 0] / MIDDLE, pose[:, 1] / 10, pose[:, 2] / 10
    tilts = [np.ones_like(d), a, b, a * a, a * b, b * b, a**3, a * a * b, a * b * b, b**3]
    return np.column_stack([d * t for t in tilts] + [d * d * t for t in tilts[:6]] + [d**3 * t for t in tilts[:3]])


def read(path):
    """Images (press, 128, 128) of 0 and 1, and poses (press, 3), of a file such as tap_train.npz."""
    with np.load(path) as file:
        return np.unpackbits(file["images"], axis=-1), file["pose"]


def blobs(image, radius=RADIUS, area_range=AREA):
    """Column and row of the pins of an image, (pin, 2), without the frame around them."""
    labels, count = ndimage.label(image)
    index = np.arange(1, count + 1)
    centre = np.array(ndimage.center_of_mass(image, labels, index))[:, ::-1]
    area = ndimage.sum(image, labels, index)
    inside = np.hypot(*(centre - CENTRE).T) < radius
    return centre[inside & (area >= area_range[0]) & (area <= area_range[1])]


def followed(found, expected):
    """The blob nearest to each expected pin (press, pin, 2); NaN where none is near."""
    seen = np.full(expected.shape, np.nan)
    for pins, there, where in zip(seen, found, expected):
        away, nearest = cKDTree(there).query(where)
        pins[away < NEAR] = there[nearest[away < NEAR]]
    return seen


def fit(images, pose, follow=followed):
    """The field of images (press, 128, 128) with poses (press, 3), and the pins (press, pin, 2) that it follows."""
    found = [blobs(image) for image in images]
    far = np.abs(pose[:, 1]) + np.abs(pose[:, 2]) + 3 * np.abs(pose[:, 0] - MIDDLE)
    order = np.argsort(far)
    first = next(found[i] for i in order if len(found[i]) == PINS)
    design = np.column_stack([np.ones(len(pose)), terms(pose)])
    expected = np.repeat(first[None], len(pose), 0)
    for count in (*STAGES, len(pose), len(pose), len(pose)):
        part = order[:count]
        seen = np.full(expected.shape, np.nan)
        seen[part] = follow([found[i] for i in part], expected[part])
        coefficients = regressed(design, seen)
        expected = np.einsum("it,tpc->ipc", design, coefficients)
    rest = smooth_rest(Field(coefficients[0], coefficients[1:]))
    return Field(rest, regressed(terms(pose), seen - rest)), seen


def regressed(design, seen):
    """Coefficients (term, pin, 2) of a ridge regression of each pin on the presses in which it was seen."""
    coefficients = np.zeros((design.shape[1], *seen.shape[1:]))
    for pin in range(seen.shape[1]):
        there = ~np.isnan(seen[:, pin, 0])
        x = design[there]
        coefficients[:, pin] = np.linalg.solve(x.T @ x + RIDGE * np.eye(x.shape[1]), x.T @ seen[there, pin])
    return coefficients


def smooth_rest(field):
    """Positions at rest (pin, 2). No image is shallower than SHALLOW: the motion from there to rest is extrapolated, and a single
    pin extrapolates badly. All pins together follow a polynomial of their position, fitted so that outliers count little."""
    shallow = field(np.array([[SHALLOW, 0.0, 0.0]]))[0]
    x, y = ((shallow - CENTRE) / RADIUS).T
    degrees = range(REST_DEGREE + 1)
    design = np.column_stack([x**i * y**j for i in degrees for j in degrees if i + j <= REST_DEGREE])
    motion, weight = field.rest - shallow, np.ones(len(shallow))
    for _ in range(20):
        weighted = design * weight[:, None]
        smooth = design @ np.linalg.solve(weighted.T @ design + 1e-2 * np.eye(design.shape[1]), weighted.T @ motion)
        weight = 1 / (np.hypot(*(motion - smooth).T) + 0.3)
    return shallow + smooth
