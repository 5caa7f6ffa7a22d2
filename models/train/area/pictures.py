"""Pictures of `meissner simulate gel`, and real ones, as differences from the sensor at rest with the pressure on each pixel."""

import numpy as np
import torch
from lights import parts
from safetensors import safe_open
from torch.nn import functional

UNIT_MPA, UNIT_LEVELS, PIXEL_MM, THRESHOLD_N = 0.1, 25.5, 0.06, 1e-4
# Real pictures: their frequency, and the pressure in the middle of a contact in UNIT_MPA, that of the default gel under a ball
# whose radius is 1.25 times that of the contact.
REAL_EVERY, MIDDLE = 8, 1.2
CROP, BATCH = (160, 128), 4
# Drift of the light that is added to a picture in training, in grey levels, for each term of a quadratic in the position, and the spread
# of each colour's gain.
DRIFT, GAIN = (12.0, 12.0, 12.0, 7.0, 7.0, 7.0), 0.1
# Other sensors' lights: the part of each colour that goes into the others, and the logarithm of a colour's strength (standard deviations).
MIX, STRENGTH = 0.4, 0.3


class Pictures:
    """The pictures of files, read on demand, and real ones, turned and enlarged like in the program, with a pressure after Hertz in the
    circle that was marked by hand. An epoch has `steps` steps. With `others`, half of the pictures look like another sensor's: mirrored
    along either axis, with the colours in another order and mixed, as if the lights came from other sides."""

    def __init__(self, paths, balls=None, crop=CROP, steps=1, batch=BATCH, others=False):
        files = [safe_open(path, "np") for path in paths]
        self.slices = [{name: file.get_slice(name) for name in ("picture", "reference", "force")} for file in files]
        self.pictures, self.balls, self.crop, self.steps, self.batch, self.others = [], [], crop, steps, batch, others
        for number, file in enumerate(files):
            start, pixel = file.get_tensor("start"), file.get_tensor("pixel_mm")
            press = np.repeat(np.arange(len(start) - 1), np.diff(start))
            self.pictures += [(number, i, int(press[i]), float(pixel[press[i]])) for i in range(len(press))]
        if balls:
            with np.load(balls) as file:
                chosen = parts(len(file["circle"]))[0]
                differences, circles = file["difference"][chosen].astype("f4"), file["circle"][chosen]
            height, width = differences.shape[1:3]
            row, column = np.mgrid[: 2 * width, : 2 * height] / 2 - 0.25
            for difference, (x, y, radius) in zip(differences, circles):
                share = 1 - ((width - 1 - row - x) ** 2 + (column - y) ** 2) / radius**2
                turned = torch.tensor(np.rot90(difference).transpose(2, 0, 1).copy())[None]
                enlarged = functional.interpolate(turned, scale_factor=2, mode="bilinear")[0].numpy().transpose(1, 2, 0)
                self.balls.append((enlarged, (MIDDLE * np.sqrt(np.maximum(share, 0))).astype("f4"), PIXEL_MM**2))

    def read(self, i):
        """The difference (H, W, 3) in grey levels, the pressure (H, W) in UNIT_MPA, and the area of a pixel in mm^2."""
        number, picture, press, pixel_mm = self.pictures[i]
        slices = self.slices[number]
        difference = slices["picture"][picture : picture + 1][0].astype("f4") - slices["reference"][press : press + 1][0]
        return difference, slices["force"][picture : picture + 1][0] / (pixel_mm**2 * UNIT_MPA), pixel_mm**2

    def cut(self, pressure, random):
        """A part of the picture, most often around a pixel in contact."""
        (height, width), (rows, columns) = pressure.shape, np.nonzero(pressure > 0.1)
        if len(rows) == 0 or random.random() < 0.15:
            place = [random.integers(side - part + 1) for side, part in zip((height, width), self.crop[::-1])]
        else:
            chosen, place = random.integers(len(rows)), []
            for pixel, side, part in zip((rows[chosen], columns[chosen]), (height, width), self.crop[::-1]):
                place.append(np.clip(pixel - part // 2 + random.integers(-part // 3, part // 3 + 1), 0, side - part))
        return tuple(slice(first, first + part) for first, part in zip(place, self.crop[::-1]))

    def epoch(self, _, random):
        for step in range(self.steps):
            made = []
            for i in random.integers(len(self.pictures), size=self.batch):
                if self.balls and random.integers(REAL_EVERY) == 0:
                    difference, pressure, area = self.balls[random.integers(len(self.balls))]
                    flips = np.s_[:: random.choice((-1, 1)), :: random.choice((-1, 1))]
                    difference, pressure = difference[flips], pressure[flips]
                else:
                    difference, pressure, area = self.read(i)
                if self.others and random.random() < 0.5:
                    flips = np.s_[:: random.choice((-1, 1)), :: random.choice((-1, 1))]
                    mixed = np.eye(3)[random.permutation(3)] + MIX * random.normal(size=(3, 3))
                    strength = np.exp(STRENGTH * random.normal(size=(3, 1)))
                    difference, pressure = difference[flips] @ (strength * mixed).T.astype("f4"), pressure[flips]
                if self.crop:
                    part = self.cut(pressure, random)
                    difference, pressure = difference[part], pressure[part]
                v, u = (axis[..., None] for axis in np.meshgrid(*(np.linspace(-1, 1, side) for side in pressure.shape), indexing="ij"))
                terms = (np.ones_like(u), u, v, u * u, u * v, v * v)
                drift = sum(spread * random.normal(size=3) * term for spread, term in zip(DRIFT, terms))
                made.append((difference * (1 + GAIN * random.normal(size=3)) + drift, pressure, area))
            yield step / self.steps, *tensors(*zip(*made))


def tensors(images, pressures, areas):
    """Images (n, 3, H, W), and pressures (n, 2, H, W) with the areas of the pixels."""
    images = torch.tensor(np.stack(images).transpose(0, 3, 1, 2) / UNIT_LEVELS, dtype=torch.float32)
    pressures = np.stack([np.stack([pressure, np.full_like(pressure, area)]) for pressure, area in zip(pressures, areas)])
    return images.contiguous(memory_format=torch.channels_last), torch.tensor(pressures, dtype=torch.float32)
