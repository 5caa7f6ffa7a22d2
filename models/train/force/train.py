"""Trains the networks for contact force on simulated grasps, from a seed.

    python models/train/force/data.py /tmp/force
    python models/train/force/train.py /tmp/force --network force-graph force-tdnn force-lstm force-cnnlstm force-convlstm

FOLDER has train.safetensors and valid.safetensors. Writes NETWORK.SEED.safetensors. An existing file is not trained again, and an
interrupted training continues. Then `meissner eval force` prints its errors.

`--folds one` learns from the 35 recordings of few.safetensors as in the force paper, and leaves each out once: NETWORK.SEED.K.safetensors.
Three of the others, one of each bolt, decide when to stop, and 31 are for training. `--folds medium` learns from small and large bolts.
"""

import math
import sys
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from grasps import MAXIMUM, SIDE, Grasps, Streams
from torch import nn

# The code that all trainings share is beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import shared
import stages
from meissner.torch import Module, fit, save

PLACES = 23
FORGET = 2.0  # a forget gate that begins almost open keeps earlier values (Jozefowicz et al. 2015, section 3.2)
GAIN = {"force-tdnn": {"fc1": 0.01}}  # sums of thousands of counts are learned in units of a hundred
# The layer whose values are computed once: the layers in front of it do not learn.
FIRST = {"force-tdnn": "total", "force-lstm": "pool", "force-cnnlstm": "pool4"}
# For each frame network: stages of (step in pixels, recordings, rate, recordings of a step, validations).
RECIPES = {
    "force-tdnn": [(1, 180_000, 0.003, 16, 10)],
    "force-lstm": [(1, 45_000, 0.002, 16, 10)],
    "force-cnnlstm": [(1, 45_000, 0.002, 16, 10)],
    "force-convlstm": [(5, 5_400, 0.01, 8, 10), (5, 21_600, 0.01, 8, 10), (1, 64, 0.002, 1, 2), (1, 256, 0.002, 1, 2)],
}
# For folds: the maximum number of epochs, each of so many passes over the recordings; epochs without a better validation until the end;
# rate; recordings of a step; decay.
FOLDS = {
    "force-tdnn": (200, 4, 20, 0.003, 4, 0.001),
    "force-lstm": (200, 4, 20, 0.002, 4, 0.001),
    "force-cnnlstm": (200, 4, 20, 0.002, 4, 0.001),
    "force-graph": (200, 4, 20, 0.002, 4, 0.001),
}
SIZES = 8, 12, 16  # mm, of the bolts
GRAPH = {"mirrors": {"columns": [], "rows": []}, "passes": 4, "batch": 8, "strides": [3, 3], "times": 8, "youngest": 0.0}
GRAPH = {"films": ["."], "unit": 1.0, "stride": 3, "presses": GRAPH}
STAGES = {"first": GRAPH | {"fit": {"epochs": 3}}, "second": GRAPH | {"fit": {"epochs": 14, "rate": 0.002}, "start": ["first"]}}
REMARKS = {
    "about": "trained on grasps of simulated bolts, whose camera is simulated too",
    "licence": "data and weights are this project's own",
    "ranges": "[[0,3.12]]",
}


def loss(module, given, target):
    """Squared error of the force at the end of each frame."""
    return F.mse_loss(module(given)[..., 0], target)


class Coarse(nn.Module):
    """`force-convlstm`, whose dense layer reads all 39,675 values of the last cell: its weights are a coarse picture, linear between 23 x 23
    places, since 900 recordings cannot teach each of them alone. They fit pictures of other sizes too."""

    def __init__(self, module):
        super().__init__()
        self.module, self.map = module, nn.Parameter(torch.randn(1, 3, PLACES, PLACES) * 0.05)

    def forward(self, given):
        cells = self.module.values(given, "cell4")
        return cells.flatten(2) @ self.grown(*cells.shape[3:]).mT + self.module["fc.bias"]

    def grown(self, height, width):
        """A mean over pixels times the number of positions."""
        grown = F.interpolate(self.map, (height, width), mode="bilinear", align_corners=False)
        return grown.flatten(1) * (PLACES * PLACES / (height * width))


@torch.no_grad()
def begun(network, seed):
    """The network with some weights drawn in another way: open forget gates, and kernels that blur."""
    module = Module.from_description(network, seed=seed, gain=GAIN.get(network))
    for name in module.description.tensors:
        if "bias_ih" in name or "gates.bias" in name:
            module[name][len(module[name]) // 4 : len(module[name]) // 2] = FORGET
        elif name.startswith("convs") and name.endswith("weight"):
            # A positive blur, mostly of one channel, so that no rectifier is closed and polarities stay separate.
            module[name].uniform_(0.0, 0.1)
            for channel in range(2):
                module[name][channel, channel].uniform_(0.2, 0.4)
        elif name.startswith("convs"):
            module[name].zero_()
    return module


def schedule(done):
    return min(1.0, 20 * done + 0.05) * (0.02 + 0.98 * (1 + math.cos(math.pi * done)) / 2)


def train(network, args, path):
    torch.manual_seed(args.seed)
    module, first = begun(network, args.seed), FIRST.get(network, "frame")
    trained = Coarse(module) if network == "force-convlstm" else module
    train, valid = (Grasps(args.data / f"{part}.safetensors", module, first, slice(args.quick)) for part in ("train", "valid"))
    for number, (every, recordings, rate, batch, checks) in enumerate(RECIPES[network]):
        recordings = max(recordings // checks, batch)
        most = 12 if first == "frame" and every == 1 else 100
        settings = {"epochs": checks, "rate": rate, "schedule": schedule, "loss": loss, "keep": "best", "check": 1}
        settings |= {"seed": args.seed + number, "learn": None if first == "frame" else ["lstm", "fc"]}
        settings |= {"valid": lambda each: valid.error(each, every, most), "checkpoint": path.with_suffix(f".state{number}")}
        train.settings = every, recordings, batch
        fit(trained, train, **settings)
    if network == "force-convlstm":
        module.load({"fc.weight": trained.grown(SIDE, SIDE), "fc.bias": module["fc.bias"]}, ["fc"])
    said = {"recipe": RECIPES[network], "recordings": len(train.force), "trained_on": "train", "source": "simulate grasp --seed 1"}
    keep(network, module, path, args.seed, said | {"valid_mse": f"{valid.error(trained, 1, 100):.4f}"})


def train_fold(network, args, grasps, fold, path):
    """Learns from some of the few recordings, until the errors on the others that are not held out no longer improve."""
    torch.manual_seed(args.seed)
    epochs, passes, patience, rate, batch, decay = FOLDS[network]
    held_out = grasps.bolt == 12 if fold == "medium" else grasps.presses == fold
    left = np.random.default_rng(0 if fold == "medium" else fold).permutation(np.flatnonzero(~held_out))
    by_size = [left[grasps.bolt[left] == size] for size in SIZES]
    judged = np.concatenate([those[:1] for those in by_size])
    train, valid = grasps.part(np.setdiff1d(left, judged)), grasps.part(judged)
    settings = {"epochs": epochs, "patience": patience, "rate": rate, "decay": decay}
    settings |= {"keep": "best", "check": 1, "seed": args.seed, "valid": lambda each: valid.error(each, 1, 100)}
    if network == "force-graph":
        module, train = stages.begun(network, stages.DEFAULT | GRAPH, args)[0], train.presses_of(passes=passes, batch=batch)
    else:
        module, train.settings = begun(network, args.seed), (1, passes * len(train), batch)
        settings |= {"schedule": schedule, "loss": loss, "learn": ["lstm", "fc"]}
    fit(module, train, **settings, log=lambda _: None)
    said = {"recipe": FOLDS[network], "recordings": len(train), "held_out": [str(each) for each in grasps.presses[held_out]]}
    said |= {"trained_on": "few, without those held out", "source": "simulate grasp --seed 3"}
    said |= {"stride": GRAPH["stride"]} if network == "force-graph" else {}
    keep(network, module, path, args.seed, said | {"valid_mse": f"{valid.error(module, 1, 100):.4f}"})


def keep(network, module, path, seed, said):
    said = {"seed": seed, "sensor": [SIDE, SIDE], "maximum": str(MAXIMUM)} | said | REMARKS
    save(module, path, said, half=network != "force-tdnn")


def main():
    more = {"work": Path("/tmp/stages"), "device": "cpu", "folds": ""}
    args = shared.arguments(__doc__, ["force-graph", *RECIPES], "force", "folder of data.py", **more)
    for network in args.network:
        if args.folds and network in FOLDS:
            few = args.data / "few.safetensors"
            is_graph = network == "force-graph"
            grasps = Streams(few, GRAPH["presses"]) if is_graph else Grasps(few, begun(network, args.seed), FIRST[network], slice(None))
            folds = ["medium"] if args.folds == "medium" else range(len(grasps))
            for fold, path in shared.missing(args, network, args.seed, folds):
                train_fold(network, args, grasps, fold, path)
        elif args.folds:
            print(f"{network}: no settings for folds")
        elif network == "force-graph":
            stages.run(network, STAGES, args, REMARKS)
        else:
            for _, path in shared.missing(args, network, args.seed, []):
                train(network, args, path)


if __name__ == "__main__":
    main()
