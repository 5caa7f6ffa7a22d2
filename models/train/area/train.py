"""Trains `canf` or `canf-plain` on pictures of `meissner simulate gel`.

    python train.py TRAIN... --valid VALID --balls BALLS.npz --network canf --crop 160 120 --statistics --out FOLDER

The loss is the mean squared error of the pressure, in units of UNIT_MPA, plus 0.05 times the squared error of the force on the whole
picture, in N, plus CONTACT_SHARE times the cross entropy of the contact. Pictures enter as differences from the sensor at rest. With --crop,
the network sees a part of each picture, which takes less time; whole pictures may come after that, with --frozen batch norm. With
--balls, one picture in REAL_EVERY is one of the real pictures that the lights are fitted to.
"""

import argparse
import json
import math
import pathlib
import sys
import time

import numpy as np
import torch
from safetensors import safe_open
from safetensors.torch import load_file
from torch.nn import functional

from lights import parts
from network import Network, squeezing

sys.path.insert(0, str(pathlib.Path(__file__).resolve().parents[1]))
from export_weights import save  # noqa: E402

UNIT_MPA = 0.1
# Grey levels that become 1.
UNIT_LEVELS = 25.5
PIXEL_MM = 0.06
THRESHOLD_N = 1e-4
FORCE_SHARE = 0.05
# The cross entropy of contact: the share in the loss, and the pressure in UNIT_MPA that takes the odds from even to e.
CONTACT_SHARE = 0.2
SOFTNESS = 0.1
# Real pictures: how often they come, and the pressure in the middle of a contact in UNIT_MPA, that of the default gel under a ball
# whose radius is 1.25 times that of the contact.
REAL_EVERY = 8
MIDDLE = 1.2
DECAY = 1e-4
RISE = 0.05
# Drift of the light that is added to a picture in training, in grey levels, for each term of a quadratic in the place, and the spread of
# each colour's gain.
DRIFT = (12.0, 12.0, 12.0, 7.0, 7.0, 7.0)
GAIN = 0.1


class Presses:
    """The pictures of files, read when they are needed."""

    def __init__(self, paths):
        self.files = [safe_open(path, "np") for path in paths]
        self.pictures = []
        for file, opened in enumerate(self.files):
            start = opened.get_tensor("start")
            press = np.repeat(np.arange(len(start) - 1), np.diff(start))
            pixel = opened.get_tensor("pixel_mm")
            self.pictures += [(file, i, int(press[i]), float(pixel[press[i]])) for i in range(len(press))]
        self.slices = [{name: file.get_slice(name) for name in ("picture", "reference", "force")} for file in self.files]

    def __len__(self):
        return len(self.pictures)

    def __getitem__(self, i):
        """The difference (H, W, 3) in grey levels, the pressure (H, W) in UNIT_MPA, and the area of a pixel in mm^2."""
        file, picture, press, pixel_mm = self.pictures[i]
        slices = self.slices[file]
        difference = slices["picture"][picture : picture + 1][0].astype("f4") - slices["reference"][press : press + 1][0]
        area = pixel_mm * pixel_mm
        return difference, slices["force"][picture : picture + 1][0] / (area * UNIT_MPA), area


class Balls:
    """The real pictures that the lights are fitted to, turned and enlarged as the program does, with a pressure after Hertz in the
    circle that was marked by hand."""

    def __init__(self, path):
        with np.load(path) as file:
            chosen = parts(len(file["circle"]))[0]
            differences, circles = file["difference"][chosen].astype("f4"), file["circle"][chosen]
        height, width = differences.shape[1:3]
        row, column = np.mgrid[: 2 * width, : 2 * height] / 2 - 0.25
        x, y = width - 1 - row, column
        self.pictures = []
        for difference, circle in zip(differences, circles):
            share = 1 - ((x - circle[0]) ** 2 + (y - circle[1]) ** 2) / circle[2] ** 2
            pressure = (MIDDLE * np.sqrt(np.maximum(share, 0))).astype("f4")
            turned = torch.tensor(np.rot90(difference).transpose(2, 0, 1).copy())[None]
            enlarged = functional.interpolate(turned, scale_factor=2, mode="bilinear")
            self.pictures.append((enlarged[0].numpy().transpose(1, 2, 0), pressure, PIXEL_MM**2))

    def draw(self, random):
        difference, pressure, area = self.pictures[random.integers(len(self.pictures))]
        flips = np.s_[:: random.choice((-1, 1)), :: random.choice((-1, 1))]
        return difference[flips], pressure[flips], area


def cut(pressure, crop, random):
    """The upper left corner of a part of the picture, most often about a pixel in contact."""
    height, width = pressure.shape
    rows, columns = np.nonzero(pressure > 0.1)
    if len(rows) == 0 or random.random() < 0.15:
        return random.integers(height - crop[1] + 1), random.integers(width - crop[0] + 1)
    chosen = random.integers(len(rows))
    row = rows[chosen] - crop[1] // 2 + random.integers(-crop[1] // 3, crop[1] // 3 + 1)
    column = columns[chosen] - crop[0] // 2 + random.integers(-crop[0] // 3, crop[0] // 3 + 1)
    return np.clip(row, 0, height - crop[1]), np.clip(column, 0, width - crop[0])


def batch(presses, balls, size, crop, random):
    """Images (size, 3, H, W) and pressures (size, 1, H, W) for training, and areas (size)."""
    images, pressures, areas = [], [], []
    for i in random.integers(len(presses), size=size):
        is_real = balls and random.integers(REAL_EVERY) == 0
        difference, pressure, area = balls.draw(random) if is_real else presses[i]
        if crop:
            row, column = cut(pressure, crop, random)
            part = np.s_[row : row + crop[1], column : column + crop[0]]
            difference, pressure = difference[part], pressure[part]
        v, u = (axis[..., None] for axis in np.meshgrid(*(np.linspace(-1, 1, side) for side in pressure.shape), indexing="ij"))
        terms = (np.ones_like(u), u, v, u * u, u * v, v * v)
        drift = sum(spread * random.normal(size=3) * term for spread, term in zip(DRIFT, terms))
        images.append(difference * (1 + GAIN * random.normal(size=3)) + drift)
        pressures.append(pressure)
        areas.append(area)
    return tensors(images, pressures, areas)


def tensors(images, pressures, areas):
    images = torch.tensor(np.stack(images).transpose(0, 3, 1, 2) / UNIT_LEVELS, dtype=torch.float32)
    pressures = torch.tensor(np.stack(pressures)[:, None], dtype=torch.float32)
    return images.contiguous(memory_format=torch.channels_last), pressures, torch.tensor(areas)


def output(network, images):
    with torch.autocast("cpu", torch.bfloat16):
        return network(images).float()


def statistics(network, presses, balls, random, pictures=64):
    """Takes the statistics of batch norm anew from whole pictures."""
    norms = [layer for layer in network.modules() if isinstance(layer, torch.nn.BatchNorm2d)]
    for layer in norms:
        layer.reset_running_stats()
        layer.momentum = None
    network.train()
    with torch.no_grad():
        for _ in range(pictures // 4):
            output(network, batch(presses, balls, 4, None, random)[0])


def validate(network, presses, most):
    """Mean IoU of the contact and mean absolute error of the force in N, over up to `most` pictures."""
    network.eval()
    found = []
    for i in np.linspace(0, len(presses) - 1, min(most, len(presses))).astype(int):
        images, pressure, _ = tensors(*([part] for part in presses[i]))
        with torch.no_grad():
            predicted = output(network, images)[0, 0]
        # As the program does: forces on pixels of the network's own size.
        force = PIXEL_MM**2 * UNIT_MPA
        touched, true = predicted * force > THRESHOLD_N, pressure[0, 0] * force > THRESHOLD_N
        union = (touched | true).sum().item()
        total = [(map_[mask].sum() * force).item() for map_, mask in ((predicted, touched), (pressure[0, 0], true))]
        found.append([(touched & true).sum().item() / union if union else 1.0, abs(total[0] - total[1])])
    return np.mean(found, 0)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("train", type=pathlib.Path, nargs="+")
    parser.add_argument("--valid", type=pathlib.Path, required=True)
    parser.add_argument("--balls", type=pathlib.Path, help="real pictures, as lights.py reads them")
    parser.add_argument("--network", choices=("canf", "canf-plain"), default="canf")
    parser.add_argument("--out", type=pathlib.Path, required=True)
    parser.add_argument("--steps", type=int, default=10_000)
    parser.add_argument("--batch", type=int, default=4)
    parser.add_argument("--rate", type=float, default=1e-3)
    parser.add_argument("--crop", type=int, nargs=2, metavar=("WIDTH", "HEIGHT"))
    parser.add_argument("--start", type=pathlib.Path, help="weights to start from, of the same network or of canf-plain")
    parser.add_argument("--frozen", action="store_true", help="batch norm keeps its statistics")
    parser.add_argument("--statistics", action="store_true", help="batch norm gets its statistics from whole pictures at the end")
    parser.add_argument("--check", type=int, default=250, help="steps from one validation to the next")
    parser.add_argument("--seed", type=int, default=0)
    arguments = parser.parse_args()
    arguments.out.mkdir(parents=True, exist_ok=True)
    torch.manual_seed(arguments.seed)
    random = np.random.default_rng(arguments.seed)
    train, valid = Presses(arguments.train), Presses([arguments.valid])
    balls = Balls(arguments.balls) if arguments.balls else None

    network = Network(arguments.network == "canf")
    if arguments.start:
        started = {name: tensor.float() for name, tensor in load_file(arguments.start).items()}
        if arguments.network == "canf" and not any("squeeze" in name for name in started):
            plain = Network(False)
            plain.load_state_dict(started, strict=False)
            network = squeezing(plain)
        else:
            network.load_state_dict(started, strict=False)
    network = network.to(memory_format=torch.channels_last)
    optimiser = torch.optim.AdamW(network.parameters(), arguments.rate, weight_decay=DECAY, foreach=True)
    resume, first = arguments.out / f"{arguments.network}.{arguments.seed}.pt", 0
    if resume.exists():
        state = torch.load(resume, weights_only=False)
        network.load_state_dict(state["network"])
        optimiser.load_state_dict(state["optimiser"])
        random.bit_generator.state, first = state["random"], state["step"]

    def train_mode():
        network.train()
        if arguments.frozen:
            for layer in network.modules():
                if isinstance(layer, torch.nn.BatchNorm2d):
                    layer.eval()

    train_mode()
    began, total = time.time(), 0.0
    for step in range(first, arguments.steps):
        done = step / arguments.steps
        share = done / RISE if done < RISE else 0.01 + 0.99 * (1 + math.cos(math.pi * (done - RISE) / (1 - RISE))) / 2
        for group in optimiser.param_groups:
            group["lr"] = arguments.rate * max(share, 0.01)
        images, pressures, areas = batch(train, balls, arguments.batch, arguments.crop, random)
        predicted = output(network, images)
        error = predicted - pressures
        force = error.sum((1, 2, 3)) * areas * UNIT_MPA
        touch = THRESHOLD_N / (PIXEL_MM**2 * UNIT_MPA)
        contact = functional.binary_cross_entropy_with_logits((predicted - touch) / SOFTNESS, (pressures > touch).float())
        loss = (error**2).mean() + FORCE_SHARE * (force**2).mean() + CONTACT_SHARE * contact
        optimiser.zero_grad()
        loss.backward()
        torch.nn.utils.clip_grad_norm_(network.parameters(), 1.0)
        optimiser.step()
        total += loss.item()
        if (step + 1) % 50 == 0:
            print(f"step {step + 1}  loss {total / 50:.4f}  {time.time() - began:.0f} s", flush=True)
            total = 0.0
        if (step + 1) % arguments.check == 0 or step + 1 == arguments.steps:
            iou, force_n = validate(network, valid, 24 if step + 1 < arguments.steps else 10**6)
            print(f"step {step + 1}  valid IoU {iou:.3f}  force {force_n:.3f} N", flush=True)
            train_mode()
            state = {"network": network.state_dict(), "optimiser": optimiser.state_dict()}
            torch.save(state | {"random": random.bit_generator.state, "step": step + 1}, resume)
    if arguments.statistics:
        statistics(network, train, balls, random)
    iou, force_n = validate(network, valid, 10**6)
    print(f"valid IoU {iou:.3f}  force {force_n:.3f} N")
    remarks = {
        "network": arguments.network,
        "seed": arguments.seed,
        "trained_on": "pictures of meissner simulate gel, sensors drawn, indenters seen; lights fitted to 20 real pictures"
        + (", which are learned from too" if balls else ""),
        "about": f"trained on simulated pictures; validation IoU {iou:.3f}, force {force_n:.2f} N",
        "sensor": json.dumps([320, 240]),
    }
    save(network.state_dict(), arguments.out / f"{arguments.network}.{arguments.seed}.safetensors", remarks)


if __name__ == "__main__":
    main()
