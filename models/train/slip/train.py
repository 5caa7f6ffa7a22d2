"""Trains the networks for the direction of slip from a folder of CSV recordings and a seed.

    python models/train/slip/train.py ../shared/data/biotac_dos

Writes a file of weights for each training: NETWORK.SEED.safetensors on all Basic objects, and with `--folds recordings,windows`
NETWORK.SEED.SCHEME.K.safetensors for cross-validation. Existing files are not trained again. Then `meissner eval slip DATA
--trainings FOLDER` prints their accuracies.

The slip paper's three networks have the paper's settings. `slip-best` was chosen by cross-validation grouped by recording: a committee of
small networks as one. Three members read the shape of a reading (scaled by its own range) through an LSTM; three read the sensor's counts,
all five readings at once, through dense layers. Each has its own loss; the prediction is the mean of their logits. The members are side by
side in wide layers whose weights between members are zero: they start as zero, and no gradient reaches them.
"""

import json
import math
import sys
from copy import copy
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F

# The code that all trainings share is beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import shared
from meissner.torch import Module, constant, fit, save

FOLDS, ELECTRODES, STEPS, DROPOUT = 4, 24, 5, 0.3
# Members of each kind, and their widths. Counts that become 1 in the first dense layers: about the spread of an electrode.
MEMBERS, LSTM, LSTM_DENSE, DENSE, SPREAD = 3, 64, 32, 64, 100.0
# `l2` is the factor of the sum of squares of the weights in the loss, as in the framework of the paper.
PAPER = {"epochs": 30, "batch": 32, "rate": 0.001, "l2": 0.0, "smoothing": 0.0}
RECIPES = {
    "slip-tuned": PAPER,
    "slip-regularised": PAPER | {"l2": 0.001},
    "slip-lstm": PAPER | {"l2": 0.001},
    "slip-best": {"epochs": 40, "batch": 64, "rate": 0.002, "l2": 0.0005, "smoothing": 0.05},
}
DROPOUTS = {"slip-tuned": (), "slip-best": ("shape2", "counts2")}


class Windows:
    """All windows of a data set as the engine makes them, and those that a training sees."""

    def __init__(self, data, network):
        found, said = shared.prepared("slip", data, "--network", network)
        objects, sets, self.names = (json.loads(said[name]) for name in ("objects", "sets", "recordings"))
        self.frames, self.label = (torch.from_numpy(found[name]) for name in ("frames", "label"))
        self.recording, self.object = found["recording"], np.array(objects)[found["object"]]
        self.seen, self.batch, self.shuffles = [], 1, True
        self.basic = np.flatnonzero([sets[name] == "Basic" for name in self.object])

    def fold(self, scheme):
        """The fold of each window of the Basic objects: the k-th, (k + 4)-th ... recording of each class and object, or drawn as in the
        paper, where the training contains neighbours of nearly every held-out window."""
        if scheme == "windows":
            return torch.randperm(len(self.basic), generator=torch.Generator().manual_seed(0)).numpy() % FOLDS
        met, folds = {}, {}
        for i in self.basic:
            if self.recording[i] not in folds:
                kind = int(self.label[i]), self.object[i]
                met[kind] = met.get(kind, -1) + 1
                folds[self.recording[i]] = met[kind] % FOLDS
        return np.array([folds[self.recording[i]] for i in self.basic])

    def part(self, scheme, fold):
        """The windows that a training sees, and the metadata of its weights about the others."""
        held = self.fold(scheme) == int(fold)
        out, said = self.basic[held], {"scheme": scheme, "fold": fold}
        if scheme == "recordings":
            return self.basic[~held], said | {"held_out": [self.names[i] for i in np.unique(self.recording[out])]}
        # A recording's windows are consecutive: its first one is where its number occurs first.
        places = [[self.names[self.recording[i]], int(i - np.argmax(self.recording == self.recording[i]))] for i in out]
        return self.basic[~held], said | {"held_out_windows": places}

    def epoch(self, _, random):
        order = random.permutation(self.seen) if self.shuffles else self.seen
        for first in range(0, len(order), self.batch):
            chosen = order[first : first + self.batch]
            yield first / len(order), self.frames[chosen], self.label[chosen]


def committee(module):
    """Draws `slip-best` member by member, and keeps the weights between members at zero."""
    eye, (shape, counts) = torch.eye(MEMBERS), torch.eye(2).repeat_interleave(ELECTRODES, 1)
    masks = {
        "lstm.weight_ih_l0": (shape.expand(4 * MEMBERS * LSTM, -1), LSTM),
        "lstm.weight_hh_l0": (torch.kron(eye, torch.ones(LSTM, LSTM)).repeat(4, 1), LSTM),
        "shape1.weight": (torch.kron(eye, torch.ones(LSTM_DENSE, LSTM)), LSTM),
        "shape2.weight": (torch.kron(eye, torch.ones(LSTM_DENSE, LSTM_DENSE)), LSTM_DENSE),
        # The delay contains one value after the other, each over time.
        "counts1.weight": (counts.repeat_interleave(STEPS).expand(MEMBERS * DENSE, -1), STEPS * ELECTRODES),
        "counts2.weight": (torch.kron(eye, torch.ones(DENSE, DENSE)), DENSE),
        "out.weight": (torch.ones_like(module["out.weight"]), DENSE),
    }
    for name, (mask, inputs) in masks.items():
        with torch.no_grad():
            module[name].uniform_(-1 / math.sqrt(inputs), 1 / math.sqrt(inputs)).mul_(mask)
        module[name].register_hook(lambda gradient, mask=mask: gradient * mask)


def loss(module, frames, label, smoothing):
    """Cross-entropy; for a committee, the sum over its members."""
    if "members" not in module.layers:
        return F.cross_entropy(module(frames, last=True).float(), label, label_smoothing=smoothing)
    hidden = F.dropout(module.values(frames, "members", last=True), DROPOUT)
    widths = [DENSE] * MEMBERS + [LSTM_DENSE] * MEMBERS
    members = zip(hidden.split(widths, 1), module["out.weight"].split(widths, 1))
    logits = (F.linear(x, weight, module["out.bias"]).float() for x, weight in members)
    return sum(F.cross_entropy(each, label, label_smoothing=smoothing) for each in logits)


def train(network, seed, windows, seen, said, path, quick):
    recipe = RECIPES[network]
    torch.manual_seed(seed)
    module = Module.from_description(network, seed=seed, dropout=dict.fromkeys(DROPOUTS.get(network, ("fc2", "fc3")), DROPOUT))
    if network == "slip-best":
        low, high = module.said["source"]["scaling"][1]
        module.gain = {"counts1": (high - low) / SPREAD, "out": 1 / (2 * MEMBERS)}
        committee(module)
    # bfloat16 with f32 sums where the processor has tiles for it: half of the time. Counts of a committee need more bits.
    tiles = network != "slip-best" and getattr(torch.cpu, "_is_amx_tile_supported", bool)()
    settings = {"rate": recipe["rate"], "schedule": constant, "clip": None, "optimiser": torch.optim.Adam, "keep": "mean", "seed": seed}
    # The gradient of the penalty l2 * w^2 is 2 l2 w.
    settings |= {"epochs": 2 if quick else recipe["epochs"], "decay": 2 * recipe["l2"], "precision": torch.bfloat16 if tiles else None}
    settings |= {"loss": lambda *given: loss(*given, recipe["smoothing"]), "checkpoint": path.with_suffix(".state")}
    windows.seen, windows.batch = seen, recipe["batch"]
    # Statistics over the windows in their order: the windows of a batch are alike, and vary less than all windows (README.md).
    in_order = copy(windows)
    in_order.batch, in_order.shuffles = 256, False
    history = fit(module, windows, statistics=in_order, **settings)
    said = {"seed": seed, "recipe": recipe, "trained_on": "Basic", "windows": len(seen), "loss": f"{history.losses[-1]:.4f}"} | said
    save(module, path, said | {"about": f"trained on the Basic objects of biotac_dos, seed {seed}"}, half=True)


def main():
    args = shared.arguments(__doc__, RECIPES, "slip", "folder of CLASS/OBJECTn.csv", seeds=5, folds="")
    parts = [f"{scheme}.{fold}" for scheme in args.folds.split(",") if scheme for fold in range(FOLDS)]
    for network in args.network:
        windows = Windows(args.data, network)
        for seed in range(args.seed, args.seed + args.seeds):
            for part, path in shared.missing(args, network, seed, parts):
                seen, said = windows.part(*part.rsplit(".", 1)) if part else (windows.basic, {})
                train(network, seed, windows, shared.some(seen, args.quick), said, path, args.quick)


if __name__ == "__main__":
    main()
