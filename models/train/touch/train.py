"""Makes the classifiers of touch from the recordings of NeuTouch and a seed.

    python models/train/touch/train.py ../shared/data/neutouch
    python models/train/touch/train.py ../shared/data/neutouch --folds --out runs

Writes NETWORK.SEED.safetensors, from the data set's own training recordings, and with --folds NETWORK.SEED.K.safetensors for
cross-validation over all recordings. Existing files are not made again. Then `meissner eval touch SET DATA --trainings FOLDER --folds 5`
prints their accuracies.

All layers except the last two follow from the quantities that they measure; the last two are linear classifiers, one for each age of the
contact.
"""

import sys
from pathlib import Path

import numpy as np
import torch
from classifiers import classify

# The code that all trainings share is beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import shared
from meissner.torch import Module, save

FOLDS, COPIES, PART = 5, 2, 60  # changed copies of recordings, and recordings whose graphs are in memory at a time
BIN_US, CELL_US, LONGEST_US = 20_000, 40_000, 5_000_000
LATER, NOISE, LOST = 12, 3, 0.1  # bins by which a recording can begin later, maximum number of spikes without a cause, largest lost share
WHOLE = 8  # weight of a complete recording, relative to one of the same age that ends early
LAGS, CHANNELS, TIMES, WINDOWS = 5, 12, 126, 12  # slots of the past; channels and cells in time of the readout; sums over times
KNOTS = (0.0, 0.05, 0.3, 1.0, 3.0)  # sums at which a bent sum changes its slope
# All objects are held for 5 s: from the last age on, every recording is complete.
OBJECTS = {"lags": 1.0, "spikes": 0.3, "curve": "1 - exp(-x)", "ages": (25, 60, 94, 122), "ended": 0, "shrinkage": 0.1, "margin": 34_560}
CONTAINERS = {"lags": 0.25, "spikes": 1.0, "curve": "sqrt(x)", "ages": (25, 60, 94), "ended": 1, "shrinkage": 0.05, "margin": None}
RECIPES = {"touch-objects": OBJECTS, "touch-containers": CONTAINERS}
CURVES = {"1 - exp(-x)": lambda x: 1 - torch.exp(-x), "sqrt(x)": torch.sqrt}


def augment(events, random, ages):
    """Another recording like `events` (events, 4), whose end lies between two ages in microseconds. Times stay multiples of a bin."""
    places = np.unique(events[:, 1:3], axis=0)
    events = events[random.random(len(events)) >= random.uniform(0, LOST)]
    events = events[events[:, 0] >= events[0, 0] + BIN_US * random.integers(LATER + 1)]
    first = events[0, 0]
    events = events[events[:, 0] <= first + random.uniform(*ages)]
    count = random.integers(NOISE + 1)
    times = BIN_US * random.integers(first // BIN_US, events[-1, 0] // BIN_US + 1, count)
    noise = np.column_stack([times, places[random.integers(len(places), size=count)], random.integers(2, size=count)])
    events = np.concatenate([events, noise])
    return events[np.argsort(events[:, 0], kind="stable")]


def lay_out(module, recipe):
    """Fills in every layer up to the sums and their bending, and the gates of the classifiers."""
    for name in module.description.tensors:
        module[name].zero_()
    # Rising spikes are (1, 0), falling ones (0, 1).
    module["sides.conv.lin.weight"][:, 0] = torch.tensor([0.5, -0.5])
    module["sides.conv.bias"].fill_(0.5)
    for sign in range(2):
        for lag in range(LAGS):
            module["lags.conv.weight"][lag, sign, sign * LAGS + lag] = 1
        module["lags.conv.lin.weight"][2 * LAGS + sign, sign] = 1
    centres = torch.linspace(0, TIMES - 1, WINDOWS)
    hats = (1 - (torch.arange(TIMES) - centres[:, None]).abs() / (centres[1] - centres[0])).clamp(min=0)
    weight = torch.tensor([recipe["lags"]] * 2 * LAGS + [recipe["spikes"]] * 2)
    # A cell lasts two bins.
    sums = 2 * hats[:, None, :, None] * torch.diag(weight)[None, :, None, :]
    module["sums.weight"].copy_(sums.reshape(module["sums.weight"].shape))
    count = WINDOWS * CHANNELS
    for i, knot in enumerate(KNOTS):
        module["steps.weight"][i * count : (i + 1) * count, :, 0, 0] = torch.eye(count)
        module["steps.bias"][i * count : (i + 1) * count] = -knot
    # Whether there is a spike as old as each of the ages: min(number, 1) = relu(number) - relu(number - 1).
    for i, age in enumerate(recipe["ages"]):
        old = torch.zeros(TIMES, CHANNELS)
        old[age:, 2 * LAGS :] = 1
        module["old.weight"][i, :, 0, 0] = old.flatten()
        module["past.weight"][2 * i : 2 * i + 2, i] = 1
        module["past.bias"][2 * i + 1] = -1
        module["age.weight"][i, 2 * i : 2 * i + 2] = torch.tensor([1.0, -1.0])


def values(module, sensor, streams, layer):
    """Values of a layer for streams, in parts."""
    for first in range(0, len(streams), PART):
        part = streams[first : first + PART]
        yield module.values(module.graphs(sensor, part).batch(range(len(part))), layer)


def encode(module, curve, bent):
    """The code of a cell: the principal components of its bent sums over the cells with a spike."""
    ends = torch.tensor([*KNOTS, 8.0])
    slope = curve(ends).diff() / ends.diff()
    slopes, square = torch.cat([slope[:1], slope.diff()]), 0.0
    for sums in bent:
        cells = torch.einsum("k,bkcp->bpc", slopes, sums.flatten(2).unflatten(1, (len(KNOTS), -1))).flatten(0, 1).double()
        square += cells.T @ cells
    axes = torch.linalg.eigh(square).eigenvectors[:, -len(module["code.weight"]) :].T.float()
    module["code.weight"].copy_((slopes[None, :, None] * axes[:, None, :]).reshape(module["code.weight"].shape))


@torch.no_grad()
def fitted(network, recipe, recordings, seen, random):
    """The network for the recordings `seen`."""
    module, whole, ages = Module(network), [recordings.events[i] for i in seen], recipe["ages"]
    lay_out(module, recipe)
    encode(module, CURVES[recipe["curve"]], values(module, recordings.sensor, whole, "steps"))
    label, bounds = torch.from_numpy(recordings.label[seen]), [5 * CELL_US, *(CELL_US * age for age in ages), LONGEST_US]
    for group, between in enumerate(zip(bounds, bounds[1:])):
        # Most of the oldest contacts are complete: an answer counts most then.
        last = group == len(ages)
        streams = [augment(events, random, between) for _ in range(recipe["ended"] if last else COPIES) for events in whole]
        share = torch.cat([torch.ones(len(streams)), torch.full((len(whole) * last,), float(WHOLE))])
        streams += whole * last
        found, labels = torch.cat(list(values(module, recordings.sensor, streams, "aged"))), label.repeat(len(streams) // len(whole))
        classify(module, group, len(ages), found, labels, share, recipe, recipe["margin"] if last else None)
    return module


def main():
    args = shared.arguments(__doc__, RECIPES, "touch", "folder with Ev-Objects.zip and Ev-Containers.zip", folds=False)
    for network in args.network:
        task, recipe = network.removeprefix("touch-"), RECIPES[network]
        recordings = shared.Recordings.read(args.data, FOLDS, "touch", task)
        for fold, path in shared.missing(args, network, args.seed, args.folds and range(FOLDS)):
            module = fitted(network, recipe, recordings, shared.some(recordings.seen(fold), args.quick), np.random.default_rng(args.seed))
            said = recordings.remarks(fold, FOLDS, args.seed, network, f"recordings of NeuTouch ({task}; the data state no licence)")
            save(module, path, said | {"recipe": recipe, "licence": "the data state none"}, half=True)


if __name__ == "__main__":
    main()
