"""Trains `canf`, `canf-plain` or `canf-live` on pictures of `meissner simulate gel`.

    python train.py TRAIN... --valid VALID --balls BALLS.npz --network canf --statistics --out FOLDER

The loss is the mean squared error of the pressure, in UNIT_MPA, linear from an error of 1 on, plus FORCE_SHARE times the squared error of the
force on the picture, in N, plus CONTACT_SHARE times the cross entropy of the contact. Pictures enter as differences from the sensor at rest, in UNIT_LEVELS grey levels,
and in parts, which takes less time. With --balls, one in REAL_EVERY is one of the real pictures to which the lights are fitted.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import torch
from pictures import BATCH, CROP, PIXEL_MM, THRESHOLD_N, UNIT_MPA, Pictures, tensors
from torch.nn import functional

# The code that all trainings share is beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
from meissner import Weights
from meissner.torch import Module, fit, gather_statistics, save

# The published share of the force is 0.05: at 20 N, it leaves no weight for the contact.
FORCE_SHARE = 0.02
# The cross entropy of contact: the share in the loss, and the pressure in UNIT_MPA that changes the odds from even to e.
CONTACT_SHARE, SOFTNESS = 0.5, 0.1
CHECK, PICTURES = 250, 64
DATA = "pictures of meissner simulate gel, sensors drawn or the optics of one GelSight, indenters seen; lights fitted to 20 real pictures"
LEARNED = ", which are learned from too"


def loss(network, images, target):
    (pressures, areas), predicted = (target[:, :1], target[:, 1, 0, 0]), network(images).float()
    error, touch = predicted - pressures, THRESHOLD_N / (PIXEL_MM**2 * UNIT_MPA)
    force = error.sum((1, 2, 3)) * areas * UNIT_MPA
    contact = functional.binary_cross_entropy_with_logits((predicted - touch) / SOFTNESS, (pressures > touch).float())
    return 2 * functional.smooth_l1_loss(predicted, pressures) + FORCE_SHARE * (force**2).mean() + CONTACT_SHARE * contact


@torch.no_grad()
def validated(network, presses, most):
    """1 - IoU of the contact, and a line that also has the mean absolute error of the force in N, over up to `most` pictures."""
    network.eval()
    # As in the program: forces on pixels of the network's own size.
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
    """The network, perhaps with weights to start from. Those of `canf-plain` also fit `canf`; its factors of squeeze-and-excitation then
    begin at a half, and its batch norm at twice as much."""
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
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("train", type=Path, nargs="+")
    parser.add_argument("--network", choices=("canf", "canf-plain", "canf-live"), default="canf")
    parser.add_argument("--balls", type=Path, help="real pictures, as lights.py reads them")
    parser.add_argument("--start", type=Path, help="weights to start from, of the same network or of canf-plain")
    parser.add_argument("--whole", action="store_true", help="learn from whole pictures instead of parts of them")
    parser.add_argument("--others", action="store_true", help="half of the pictures in a mirror and under other lights")
    parser.add_argument("--statistics", action="store_true", help="batch norm gets its statistics from whole pictures at the end")
    parser.add_argument("--valid", type=Path, nargs="+", required=True)
    for name, default in {"out": None, "steps": 4500, "batch": BATCH, "rate": 1e-3, "seed": 0}.items():
        parser.add_argument(f"--{name}", type=Path if default is None else type(default), default=default, required=default is None)
    args = parser.parse_args()
    path, check = args.out / f"{args.network}.{args.seed}.safetensors", min(CHECK, args.steps)
    crop = None if args.whole else CROP
    module, valid = begun(args.network, args.seed, args.start), Pictures(args.valid)
    train = Pictures(args.train, args.balls, crop, check, args.batch, args.others)
    settings = {"epochs": args.steps // check, "rate": args.rate, "decay": 1e-4, "check": 1, "seed": args.seed, "precision": torch.bfloat16}
    fit(module, train, loss=loss, valid=lambda each: validated(each, valid, 36), checkpoint=path.with_suffix(".state"), **settings)
    if args.statistics:
        whole = Pictures(args.train, args.balls, None, PICTURES // BATCH)
        gather_statistics(module, whole, np.random.default_rng(args.seed), loss=loss)
    recipe = {"steps": args.steps, "rate": args.rate, "start": args.start and args.start.name, "crop": crop, "batch": args.batch}
    recipe |= {"others": True} if args.others else {}
    about = f"trained on simulated pictures; validation {validated(module, valid, 10**6)[1]}"
    said = {"seed": args.seed, "recipe": recipe, "sensor": [320, 240], "trained_on": DATA + (LEARNED if args.balls else ""), "about": about}
    save(module, path, said, half=True)


if __name__ == "__main__":
    main()
