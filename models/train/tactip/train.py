"""Trains the networks for depth and tilts on presses of `presses.py`, in the stages that the shipped weights had.

    python models/train/tactip/presses.py DATA /tmp/tactip --drawn 4
    python models/train/tactip/train.py /tmp/tactip --network tactip-past
    python models/train/tactip/presses.py DATA /tmp/shear --set shear --drawn 5
    python models/train/tactip/train.py /tmp/shear --network tactip-shear

The first layer `pins` of `tactip-shear` learns the motion of the pins, in principal modes, which only the training knows. The layers behind
it learn from the true motion first, with noise. An interrupted training continues. Then `meissner eval angle` prints its errors.
"""

import sys
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from safetensors.numpy import load_file

# The code that all trainings share is beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import shared
import stages
from meissner.torch import cosine

UNIT = [1.0, 10.0, 10.0]
MODES, PIXELS = 40, 10.0  # modes of the motion of the pins, and the unit of a mode
# For the motion: its weight in the loss, the initial noise for the last layers, in modes, and their steps.
PINS, NOISE, STEPS, PRESSES = 0.05, 0.04, 6000, 64


def stage(epochs, rate=0.003, start=(), films=("0", "1"), stride=1, blocks=False, **presses):
    said = {"films": films, "valid": ["0"], "unit": UNIT, "dropout": 0.1, "stride": stride, "start": list(start), "blocks": blocks}
    return said | {"presses": {"strides": [stride, stride]} | presses, "fit": {"epochs": epochs, "rate": rate}}


def head(epochs, start, films="01", rate=0.003, decay=0.001, dropout=0.1, unit=UNIT, **more):
    """The layers behind the readout, on stored readouts, of the films with some numbers."""
    said = {"films": list(films), "valid": ["0"], "unit": unit, "dropout": dropout, "start": start, "readouts": {}}
    return said | {"fit": {"epochs": epochs, "rate": rate, "decay": decay, "check": 3}} | more


def all_layers(epochs, start, seed):
    presses = {"shift": 0, "times": 1, "youngest": 0.2, "batch": 8}
    return stage(epochs, 0.001, start, list("012345"), **presses) | {"seed": seed}


DEPTH = [0.5, 10.0, 10.0]
STAGES = {
    "tactip-past": {
        "first": stage(8, stride=2, passes=2),
        "second": stage(6, 0.0015, ["first"]),
        "third": stage(5, 0.0015, ["second"]),
        "fourth": stage(10, 0.002, ["third"]),
        "fifth": stage(8, 0.0012, ["fourth"]),
        "sixth": stage(16, 0.002, ["fifth"], list("2345")),
        "head": head(45, ["sixth"], "012345", dropout=0.0),
        "way": head(24, ["head"], "02", 0.002, dropout=0.0),
    },
    "tactip": {"first": stage(4, 0.001, ["/tactip-past.fifth"])},
    "tactip-frames": {"first": stage(24, 0.001)},
    "tactip-shear": {
        "1st": head(24, ["/tactip-past.fifth"], dropout=0.0, blocks=True),
        "2nd": head(72, ["1st"]),
        "3rd": head(24, ["2nd"], "23"),
        "4th": head(20, ["3rd"], "023", 0.002),
        "5th": head(44, ["3rd"], "023"),
        "6th": head(0, ["4th", "5th"], "0"),
        "7th": head(32, ["6th"], "012345", seed=2),
        "8th": head(28, ["7th"], "012345", seed=4),
        "9th": head(0, ["7th", "8th"], "0"),
        "10th": all_layers(2, ["9th"], 0),
        "11th": all_layers(5, ["10th"], 1),
        "12th": head(24, ["11th"], "012345", 0.002, unit=DEPTH, seed=3),
        "13th": head(30, ["12th"], "012345", 0.003, 0.05, unit=DEPTH, cells=0.05, seed=6),
        "14th": head(24, ["13th"], "012345", 0.002, 0.02, unit=DEPTH, cells=0.05, seed=7),
        "15th": head(20, ["14th"], "0123456", 0.001, unit=DEPTH, seed=9),
        "16th": head(21, ["14th"], "0123456", 0.002, 0.02, unit=DEPTH, cells=0.05, seed=10),
        "17th": head(15, ["15th", "16th"], "0123456", 0.001, 0.02, unit=DEPTH, seed=12),
        "mean": head(0, ["15th", "17th"], "0", unit=DEPTH, centre=True),
    },
}
REMARKS = {
    "about": "trained on presses of a real TacTip, whose camera is modelled (data of no stated licence)",
    "licence": "the data of the training states none",
    "ranges": "[[2,5],[-15,15],[-15,15]]",
}
SHEAR = REMARKS | {
    "about": "trained on presses of a real TacTip with a sideways move, whose camera is modelled (data of no stated licence)",
    "ranges": "[[2.5,5.5],[-15,15],[-15,15]]",
}


class Modes:
    """The principal modes of the motion of all pins, over the ends of the presses and of the moves in the tracks of the first film."""

    def __init__(self, data):
        self.tracks = {}
        tracks = self.of("0", data / "0" / "train.safetensors")
        start, position = tracks["start"], tracks["position"].reshape(len(tracks["t_us"]), -1)
        self.rest = position[start[:-1]].mean(0)
        # The press ends at the knot in the middle, the move at the last one.
        ends = np.concatenate([position[start[1:] - 1], position[start[:-1] + np.diff(start) // 2]]) - self.rest
        self.mean = ends.mean(0)
        moments = (ends - self.mean).T.astype(np.float64) @ (ends - self.mean)
        self.modes = np.linalg.eigh(moments)[1][:, ::-1][:, :MODES].astype(np.float32)

    def of(self, name, path):
        if name not in self.tracks:
            self.tracks[name] = load_file(path.with_suffix(".tracks.safetensors"))
        return self.tracks[name]

    def __call__(self, film, press, t_us):
        """The modes (time, mode) of a press at some times, in units of PIXELS."""
        tracks = self.of(str(film.path), film.path)
        knots = slice(*tracks["start"][press : press + 2])
        motion = tracks["position"][knots].reshape(len(tracks["t_us"][knots]), -1) - self.rest - self.mean
        modes = motion @ self.modes / PIXELS
        return np.stack([np.interp(t_us, tracks["t_us"][knots], mode) for mode in modes.T], 1)


def loss(module, given, target):
    """The loss of the outputs, and of the motion of the pins."""
    pins = module.values(given, "pins")
    moved = F.smooth_l1_loss(pins[:, :MODES] * PIXELS, target[:, 3:] * PIXELS)
    return F.smooth_l1_loss(module({"pins": pins}) / module.unit, target[:, :3] / module.unit, beta=0.1) + PINS * moved


def warm_up(module, readouts):
    """The layers behind `pins` learn from the motion of the pins, with noise."""
    known = torch.from_numpy(np.concatenate([each.reshape(-1, 3 + MODES) for each in readouts.targets]))
    learnt = [module[name] for name in module.names("hidden", "turned", "out")]
    optimiser = torch.optim.AdamW(learnt, 0.003, weight_decay=0.001)
    for step in range(STEPS):
        optimiser.param_groups[0]["lr"] = 0.003 * cosine(step / STEPS)
        some = known[torch.randint(len(known), (PRESSES,))]
        pins = F.pad(some[:, 3:], (0, module.layers["pins"]["outputs"] - MODES))
        found = module({"pins": pins + NOISE * torch.randn(pins.shape)})
        optimiser.zero_grad()
        F.smooth_l1_loss(found / module.unit, some[:, :3] / module.unit, beta=0.1).backward()
        torch.nn.utils.clip_grad_norm_(learnt, 1.0)
        optimiser.step()


if __name__ == "__main__":
    args = shared.arguments(__doc__, STAGES, "angle", "folder of folders of films", work=Path("/tmp/stages"), device="cpu")
    for network in args.network:
        told = {"told": Modes, "loss": loss, "warm_up": warm_up} if network == "tactip-shear" else {}
        stages.run(network, STAGES[network], args, SHEAR if told else REMARKS, **told)
