"""Makes `touch-letters` from presses on letters of braille and a seed.

    python models/train/touch/letters.py ../shared/data/braille
    python models/train/touch/letters.py ../shared/data/braille --folds --out runs

Writes touch-letters.SEED.safetensors, and with --folds touch-letters.SEED.K.safetensors for cross-validation over all presses. Existing
files are not made again. Then `meissner eval touch letters DATA --trainings FOLDER --folds 5` prints their accuracies.

The layers of events and the sums follow from the quantities that they measure. Behind them, two kernel machines, for complete presses and
for presses that still last, know that a letter can be pressed elsewhere. The dense layers learn the scores of these machines for presses,
and for moved and mixed presses.
"""

import sys
from pathlib import Path

import numpy as np
import torch
from machine import Machine, made
from torch import nn

# The code that all trainings share is beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import shared
from meissner.torch import Module, fit, save

NETWORK, FOLDS, PART = "touch-letters", 5, 60  # presses whose graphs are in memory at a time
TIMES, WINDOWS, STEP, CENTRE = 101, 6, 15, 13  # cells in time, sums and cells from one to the next, the slot of a kernel for no distance
KNOTS = (0.0, 0.25, 1.0, 4.0, 16.0, 64.0, 256.0)  # sums at which a bent sum changes its slope, and the largest
BLUR = 0.8  # of maps, in taxels
EARLIER = 3  # earlier ends of each press
WHOLE, EARLY = (16_000, 6), (4_000, 1)  # presses made from presses, and the weight of the original presses
EPOCHS, BATCH, RATE, SHARPNESS = 40, 128, 0.002, 8.0  # SHARPNESS: logits of a score of 1


def lay_out(module):
    """Fills in all layers up to `blur`."""
    for name in module.description.tensors:
        module[name].zero_()
    # Rising pressure is (1, 0), falling (0, 1).
    module["sides.conv.lin.weight"][:, 0] = torch.tensor([0.5, -0.5])
    module["sides.conv.bias"].fill_(0.5)
    # A spline is a mean over 16 in-edges; all near ones are counted.
    module["rate.conv.weight"][CENTRE] = 16 * torch.eye(2)
    module["rate.conv.lin.weight"].copy_(torch.eye(2))
    centres = STEP * torch.arange(WINDOWS)
    hats = (1 - (torch.arange(TIMES) - centres[:, None]).abs() / STEP).clamp(min=0)
    hats[-1, centres[-1] :] = 1
    module["sums.weight"].copy_((hats[:, None, :, None] * torch.eye(2)[None, :, None, :]).flatten(2).reshape(module["sums.weight"].shape))
    knots, count = torch.tensor(KNOTS), 2 * WINDOWS
    slopes = (knots.sqrt().diff() / knots.diff()).diff(prepend=torch.zeros(1))
    module["steps.weight"].copy_(torch.eye(count).repeat(len(slopes), 1)[:, :, None, None])
    module["steps.bias"].copy_(-knots[:-1].repeat_interleave(count))
    module["code.weight"].copy_((torch.eye(count)[:, None] * slopes[:, None]).reshape(module["code.weight"].shape))
    near = torch.exp(-0.5 * (torch.arange(-1, 2) / BLUR) ** 2)
    module["blur.weight"].copy_(torch.eye(count)[:, :, None, None] * (near[:, None] * near / near.sum() ** 2))


class Taught:
    """Maps and the scores of machines for them, in the form in which `fit` reads presses."""

    def __init__(self, maps, scores):
        self.maps, self.scores = maps, scores

    def epoch(self, _, random):
        order = torch.from_numpy(random.permutation(len(self.maps)))
        for first in range(0, len(order), BATCH):
            yield first / len(order), self.maps[order[first : first + BATCH]], self.scores[order[first : first + BATCH]]


def apart(net, given, target):
    return 10 * (net(given) - target).square().sum(1).mean()


@torch.no_grad()
def maps_of(module, sensor, streams):
    """Maps (streams, channels, rows, columns): the input of the dense layers."""
    parts = [streams[first : first + PART] for first in range(0, len(streams), PART)]
    return torch.cat([module.values(module.graphs(sensor, part).batch(range(len(part))), "blur") for part in parts])


def teach(module, groups, random, seed):
    """Fits the dense layers to groups of maps with their labels; each group has its own machine."""
    scale, inputs, scores = groups[0][0].std(), [], []
    for maps, label, count, times in groups:
        maps = maps / scale
        inputs.append(torch.cat([*[maps] * times, made(maps, count, random)]))
        scores.append(Machine(maps, label, len(module["out.bias"]))(inputs[-1]))
    mean = (groups[0][0] / scale).flatten(1).mean(0)
    torch.manual_seed(seed)
    names = ("hidden", "second", "out")
    shapes = [module[f"{name}.weight"].shape for name in names]
    net = nn.Sequential(*[layer for shape in shapes for layer in (nn.Linear(shape[1], shape[0]), nn.ReLU())][:-1])
    taught = Taught(torch.cat(inputs).flatten(1) - mean, torch.cat(scores))
    fit(net, taught, epochs=EPOCHS, rate=RATE, decay=0.01, clip=None, seed=seed, loss=apart)
    with torch.no_grad():
        for name, layer in zip(names, net[::2]):
            module[f"{name}.weight"].copy_(layer.weight)
            module[f"{name}.bias"].copy_(layer.bias)
        # It was trained on maps of that scale and mean.
        module["hidden.weight"].div_(scale)
        module["hidden.bias"].sub_(net[0].weight @ mean)
        module["out.weight"].mul_(SHARPNESS)
        module["out.bias"].mul_(SHARPNESS)


def fitted(recordings, seen, seed):
    """The network for the recordings `seen`."""
    module, random = Module(NETWORK), np.random.default_rng(seed)
    felt = [i for i in seen if len(recordings.events[i])]
    streams, label = [recordings.events[i] for i in felt], torch.from_numpy(recordings.label[felt])
    earlier = [stream[: 1 + int(random.uniform(0.03, 1) * len(stream))] for _ in range(EARLIER) for stream in streams]
    with torch.no_grad():
        lay_out(module)
    maps = maps_of(module, recordings.sensor, streams + earlier)
    whole, early = maps.split([len(streams), len(earlier)])
    teach(module, [(whole, label, *WHOLE), (early, label.repeat(EARLIER), *EARLY)], random, seed)
    return module


def main():
    args = shared.arguments(__doc__, [NETWORK], "touch", "folder with letters.npz", folds=False)
    recordings = shared.Recordings.read(args.data, FOLDS, "touch", "letters")
    for fold, path in shared.missing(args, NETWORK, args.seed, args.folds and range(FOLDS)):
        module = fitted(recordings, shared.some(recordings.seen(fold), args.quick), args.seed)
        said = recordings.remarks(fold, FOLDS, args.seed, NETWORK, "presses on letters of braille (NUSkin; the data state no licence)")
        save(module, path, said | {"licence": "the data state none"}, half=True)


if __name__ == "__main__":
    main()
