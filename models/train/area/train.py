"""Trains `canf` or `canf-plain` on pictures of `meissner simulate gel`.

    python train.py TRAIN... --valid VALID --balls BALLS.npz --network canf --statistics --out FOLDER

The loss is the mean squared error of the pressure, in units of UNIT_MPA, plus 0.05 times the squared error of the force on the whole
picture, in N, plus CONTACT_SHARE times the cross entropy of the contact. Pictures enter as differences from the sensor at rest. The network
sees a part of each picture, which takes less time. With --balls, one picture in REAL_EVERY is one of the real pictures that the lights are
fitted to. A training that was cut off goes on.
"""

import argparse
import pathlib
import sys

import numpy as np
import torch
from lights import parts
from safetensors import safe_open
from torch.nn import functional

# What all trainings share lies beside their folders.
sys.path.append(str(pathlib.Path(__file__).resolve().parents[1]))
from meissner import Weights
from meissner.torch import Module, fit, gather_statistics, save

UNIT_MPA, PIXEL_MM, THRESHOLD_N, FORCE_SHARE = 0.1, 0.06, 1e-4, 0.05
UNIT_LEVELS = 25.5  # grey levels that become 1
# The cross entropy of contact: the share in the loss, and the pressure in UNIT_MPA that takes the odds from even to e.
CONTACT_SHARE, SOFTNESS = 0.2, 0.1
# Real pictures: how often they come, and the pressure in the middle of a contact in UNIT_MPA, that of the default gel under a ball
# whose radius is 1.25 times that of the contact.
REAL_EVERY, MIDDLE = 8, 1.2
CROP, BATCH, CHECK, PICTURES = (160, 120), 4, 250, 64
# Drift of the light that is added to a picture in training, in grey levels, for each term of a quadratic in the place, and the spread of
# each colour's gain.
DRIFT, GAIN = (12.0, 12.0, 12.0, 7.0, 7.0, 7.0), 0.1


class Pictures:
    """The pictures of files, read when they are needed, and real ones, turned and enlarged as the program does, with a pressure after Hertz
    in the circle that was marked by hand. An epoch has CHECK steps."""

    def __init__(self, paths, balls=None, crop=CROP, steps=CHECK):
        files = [safe_open(path, "np") for path in paths]
        self.slices = [{name: file.get_slice(name) for name in ("picture", "reference", "force")} for file in files]
        self.pictures, self.balls, self.crop, self.steps = [], [], crop, steps
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
        """A part of the picture, most often about a pixel in contact."""
        (height, width), (rows, columns) = pressure.shape, np.nonzero(pressure > 0.1)
        if len(rows) == 0 or random.random() < 0.15:
            row, column = random.integers(height - self.crop[1] + 1), random.integers(width - self.crop[0] + 1)
        else:
            chosen = random.integers(len(rows))
            row = rows[chosen] - self.crop[1] // 2 + random.integers(-self.crop[1] // 3, self.crop[1] // 3 + 1)
            column = columns[chosen] - self.crop[0] // 2 + random.integers(-self.crop[0] // 3, self.crop[0] // 3 + 1)
            row, column = np.clip(row, 0, height - self.crop[1]), np.clip(column, 0, width - self.crop[0])
        return np.s_[row : row + self.crop[1], column : column + self.crop[0]]

    def epoch(self, _, random):
        for step in range(self.steps):
            made = []
            for i in random.integers(len(self.pictures), size=BATCH):
                if self.balls and random.integers(REAL_EVERY) == 0:
                    difference, pressure, area = self.balls[random.integers(len(self.balls))]
                    flips = np.s_[:: random.choice((-1, 1)), :: random.choice((-1, 1))]
                    difference, pressure = difference[flips], pressure[flips]
                else:
                    difference, pressure, area = self.read(i)
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


def loss(network, images, target):
    (pressures, areas), predicted = (target[:, :1], target[:, 1, 0, 0]), network(images).float()
    error, touch = predicted - pressures, THRESHOLD_N / (PIXEL_MM**2 * UNIT_MPA)
    force = error.sum((1, 2, 3)) * areas * UNIT_MPA
    contact = functional.binary_cross_entropy_with_logits((predicted - touch) / SOFTNESS, (pressures > touch).float())
    return (error**2).mean() + FORCE_SHARE * (force**2).mean() + CONTACT_SHARE * contact


@torch.no_grad()
def validated(network, presses, most):
    """1 - IoU of the contact and a line with the mean absolute error of the force in N too, over up to `most` pictures."""
    network.eval()
    # As the program does: forces on pixels of the network's own size.
    force, found = PIXEL_MM**2 * UNIT_MPA, []
    for i in np.linspace(0, len(presses.pictures) - 1, min(most, len(presses.pictures))).astype(int):
        images, target = tensors(*([part] for part in presses.read(i)))
        predicted, true = network(images)[0, 0] * force, target[0, 0] * force
        touched, known = predicted > THRESHOLD_N, true > THRESHOLD_N
        union = (touched | known).sum().item()
        iou = (touched & known).sum().item() / union if union else 1.0
        found.append([iou, abs(predicted[touched].sum().item() - true[known].sum().item())])
    iou, force_n = np.mean(found, 0)
    return 1 - iou, f"IoU {iou:.3f}, force {force_n:.2f} N"


def begun(network, seed, start):
    """The network, perhaps with weights to start from: those of `canf-plain` for `canf` too, whose factors of squeeze-and-excitation begin at
    a half, and whose batch norm at twice as much."""
    module = Module.from_description(network, seed=seed)
    if start:
        begin, state = Weights(start), module.state_dict()
        grown = any("squeeze" in name for name in state) and not any("squeeze" in name for name in begin)
        for name in begin:
            doubled = grown and name.endswith(("bn2.weight", "bn2.bias"))
            state[name] = torch.from_numpy(begin[name]) * (2 if doubled else 1)
        module.load({name: 0 * tensor if grown and name.endswith("squeeze.up.weight") else tensor for name, tensor in state.items()})
    return module.to(memory_format=torch.channels_last)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("train", type=pathlib.Path, nargs="+")
    parser.add_argument("--valid", type=pathlib.Path, required=True)
    parser.add_argument("--balls", type=pathlib.Path, help="real pictures, as lights.py reads them")
    parser.add_argument("--network", choices=("canf", "canf-plain"), default="canf")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--steps", type=int, default=4500)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--start", type=pathlib.Path, help="weights to start from, of the same network or of canf-plain")
    parser.add_argument("--statistics", action="store_true", help="batch norm gets its statistics from whole pictures at the end")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()
    path, check = args.out / f"{args.network}.{args.seed}.safetensors", min(CHECK, args.steps)
    module, train, valid = begun(args.network, args.seed, args.start), Pictures(args.train, args.balls, CROP, check), Pictures([args.valid])
    settings = {"epochs": args.steps // check, "rate": args.rate, "decay": 1e-4, "check": 1, "seed": args.seed, "precision": torch.bfloat16}
    fit(module, train, loss=loss, valid=lambda each: validated(each, valid, 24), checkpoint=path.with_suffix(".state"), **settings)
    if args.statistics:
        whole = Pictures(args.train, args.balls, None, PICTURES // BATCH)
        gather_statistics(module, whole, np.random.default_rng(args.seed), loss=loss)
    recipe = {"steps": args.steps, "rate": args.rate, "start": args.start and args.start.name, "crop": CROP, "batch": BATCH}
    pictures = "pictures of meissner simulate gel, sensors drawn, indenters seen; lights fitted to 20 real pictures"
    said = {"seed": args.seed, "recipe": recipe, "sensor": [320, 240], "trained_on": pictures + (", which are learned from too" if args.balls else "")}
    save(module, path, said | {"about": f"trained on simulated pictures; validation {validated(module, valid, 10**6)[1]}"}, half=True)


if __name__ == "__main__":
    main()
