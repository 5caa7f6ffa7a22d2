"""Trains the networks for contact force on simulated grasps, from a seed.

    python models/train/force/data.py /tmp/force
    python models/train/force/train.py /tmp/force --network force-graph force-tdnn force-lstm force-cnnlstm force-convlstm

FOLDER has train.safetensors and valid.safetensors. Writes NETWORK.SEED.safetensors; what is there already is not trained again, and a
training that was cut off goes on. Then `meissner eval force` says what it is worth.

    python models/train/force/train.py /tmp/force --network force-tdnn --folds 92 --share 0.1 --out /tmp/folds

learns from the 92 recordings of test.safetensors instead of train.safetensors, and leaves one of them out each time: NETWORK.SEED.K.safetensors.
"""

import math
import sys
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from torch import nn

# What all trainings share lies beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import stages
from meissner.torch import Film, Module, fit, save

SIDE, PLACES, FRAMES, PERIOD_US = 115, 23, 41, 10_000
MAXIMUM = 8.0  # what counts are divided by: `maximum` of the descriptions
# A forget gate that begins almost open keeps what came before (Jozefowicz et al. 2015, section 3.2).
FORGET = 2.0
# Sums of thousands of counts are learned in units of a hundred.
GAIN = {"force-tdnn": {"fc1": 0.01}}
# The layer whose values are computed once: what is in front of it does not learn.
FIRST = {"force-tdnn": "total", "force-lstm": "pool", "force-cnnlstm": "flat"}
# Of each frame network: stages of (every so many pixels, recordings, rate, recordings of a step, validations).
RECIPES = {
    "force-tdnn": [(1, 180_000, 0.003, 16, 10)],
    "force-lstm": [(1, 45_000, 0.002, 16, 10)],
    "force-cnnlstm": [(1, 45_000, 0.002, 16, 10)],
    "force-convlstm": [(5, 5_400, 0.01, 8, 10), (5, 21_600, 0.01, 8, 10), (1, 64, 0.002, 1, 2), (1, 256, 0.002, 1, 2)],
}
GRAPH = {"mirrors": {"columns": [], "rows": []}, "passes": 4, "batch": 8, "strides": [3, 3], "times": 8, "youngest": 0.0}
GRAPH = {"films": ["."], "unit": 1.0, "stride": 3, "presses": GRAPH}
STAGES = {"first": GRAPH | {"fit": {"epochs": 3}}, "second": GRAPH | {"fit": {"epochs": 14, "rate": 0.002}, "start": ["first"]}}
REMARKS = {
    "about": "trained on grasps of simulated bolts, whose camera is simulated too",
    "licence": "data and weights are this project's own",
    "ranges": "[[0,3.12]]",
}


class Grasps:
    """Frames of event counts, or what a layer of `module` makes of them, with the force at the end of each frame."""

    def __init__(self, path, module, first, chosen):
        film = Film(path)
        ends, size, read = np.arange(1, FRAMES + 1) * PERIOD_US, FRAMES * 2 * SIDE * SIDE, []
        presses = np.arange(len(film))[chosen]
        for press in presses:
            t_us, x, y, on = film.events[press].T.astype(np.int64)
            value = ((2 * (t_us // PERIOD_US) + on) * SIDE + y) * SIDE + x
            counts = torch.from_numpy(np.bincount(value, minlength=size).astype(np.uint8).reshape(FRAMES, 2, SIDE, SIDE))
            with torch.no_grad():
                read.append(counts if first == "frame" else module.values(counts[None] / MAXIMUM, first)[0])
        self.values, self.first = torch.stack(read), first
        self.force = torch.from_numpy(np.stack([film.at(["force"], press, ends)[:, 0] for press in presses]).astype(np.float32))

    def of(self, chosen, every, random=None):
        """Frames of some recordings, of every so many pixels from a random one on, mirrored at random."""
        frames = self.values[chosen]
        if frames.dim() == 5:
            row, column = (0, 0) if random is None or every == 1 else random.integers(every, size=2)
            frames = frames[..., row::every, column::every]
            axes = [axis for axis in (3, 4) if random is not None and random.random() < 0.5]
            frames = torch.flip(frames, axes) if axes else frames
        return {self.first: frames.float() / (MAXIMUM if self.first == "frame" else 1.0)}

    def stage(self, *settings):
        """What `fit` learns from: every so many pixels, recordings of an epoch, recordings of a step."""
        self.settings = settings
        return self

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
        return float(torch.cat([(force(module, self.of(part, every)) - self.force[part]).square().flatten() for part in parts]).mean())


def force(module, given):
    return module(given)[..., 0]


def loss(module, given, target):
    return F.mse_loss(force(module, given), target)


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
        """A mean over pixels times the number of places."""
        grown = F.interpolate(self.map, (height, width), mode="bilinear", align_corners=False)
        return grown.flatten(1) * (PLACES * PLACES / (height * width))


@torch.no_grad()
def begun(network, seed):
    """The network with what is drawn in another way: open forget gates, and kernels that blur."""
    module = Module.from_description(network, seed=seed, gain=GAIN.get(network))
    for name in module.description.tensors:
        if "bias_ih" in name or "gates.bias" in name:
            module[name][len(module[name]) // 4 : len(module[name]) // 2] = FORGET
        elif name.startswith("convs") and name.endswith("weight"):
            # A positive blur, mostly of one channel: no rectifier is closed, and polarities stay apart.
            module[name].uniform_(0.0, 0.1)
            for channel in range(2):
                module[name][channel, channel].uniform_(0.2, 0.4)
        elif name.startswith("convs"):
            module[name].zero_()
    return module


def schedule(done):
    return min(1.0, 20 * done + 0.05) * (0.02 + 0.98 * (1 + math.cos(math.pi * done)) / 2)


def train(network, args, fold, path):
    module, first = begun(network, args.seed), FIRST.get(network, "frame")
    trained = Coarse(module) if network == "force-convlstm" else module
    held_out = [] if fold is None else list(range(fold, 92, args.folds))
    seen = np.setdiff1d(np.arange(92), held_out) if held_out else slice(args.quick)
    train = Grasps(args.data / ("test.safetensors" if held_out else "train.safetensors"), module, first, seen)
    valid = Grasps(args.data / "valid.safetensors", module, first, slice(args.quick))
    for number, (every, recordings, rate, batch, checks) in enumerate(RECIPES[network]):
        recordings = max(int(recordings * args.share) // checks, batch)
        most = 12 if first == "frame" and every == 1 else 100
        settings = {"epochs": checks, "rate": rate, "schedule": schedule, "loss": loss, "keep": "best", "check": 1}
        settings |= {"seed": args.seed + number, "learn": None if first == "frame" else ["lstm", "fc"]}
        settings |= {"valid": lambda each: valid.error(each, every, most), "checkpoint": path.with_suffix(f".state{number}")}
        fit(trained, train.stage(every, recordings, batch), **settings)
    if network == "force-convlstm":
        module.load({"fc.weight": trained.grown(SIDE, SIDE), "fc.bias": module["fc.bias"]}, ["fc"])
    said = {"seed": args.seed, "recipe": RECIPES[network], "recordings": len(train.force), "sensor": [SIDE, SIDE], "maximum": str(MAXIMUM)}
    said |= {"trained_on": "test, without those held out" if held_out else "train", "source": f"simulate grasp --seed {2 if held_out else 1}"}
    said |= REMARKS | {"valid_mse": f"{valid.error(trained, 1, 100):.4f}"}
    held_out = {"held_out": [str(each) for each in held_out]} if held_out else {}
    save(module, path, said | held_out, half=network != "force-tdnn")


def main():
    args = stages.arguments(__doc__, ["force-graph", *RECIPES], "force", folds=0, share=1.0)
    for network in args.network:
        if network == "force-graph":
            stages.run(network, STAGES, args, REMARKS)
        for fold in (range(args.folds) if args.folds else [None]) if network in RECIPES else []:
            path = args.out / f"{network}.{args.seed}{'' if fold is None else f'.{fold}'}.safetensors"
            if not path.exists():
                print(path.stem, flush=True)
                train(network, args, fold, path)


if __name__ == "__main__":
    main()
