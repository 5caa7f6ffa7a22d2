"""Trains the classifiers of digits from the recordings of N-MNIST and a seed, in the parts that the shipped weights had.

    python models/train/digits/train.py ../shared/data/nmnist
    python models/train/digits/train.py ../shared/data/nmnist --folds

Writes NETWORK.SEED.safetensors, trained on the data set's own training recordings, and with --folds NETWORK.SEED.K.safetensors for
cross-validation over all recordings. Existing files are not trained again. Then `meissner eval digits DATA --trainings FOLDER` prints
their accuracies. Every recording is different in every epoch: turned, sheared, stretched, moved, thinned, cut short.
"""

import math
import sys
from functools import partial
from pathlib import Path

import numpy as np
import torch.nn.functional as F

# The code that all trainings share is beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import shared
from meissner import Weights
from meissner.torch import Film, Module, Presses, fit, save

# For each part: epochs, rate, and the share of the recordings that end early, at so many ms or later. digits-frozen runs with the
# weights of digits-past.
FIRST, SECOND = (80, 0.003, 0.1, 100), (24, 0.0015, 0.5, 20)
PARTS = {"digits-all": [FIRST, SECOND], "digits-past": [FIRST, SECOND, (40, 0.0015, 0.2, 20), (60, 0.0015, 0.2, 20)]}
FOLDS, BATCH, SMOOTHING, DROPOUT = 5, 32, 0.05, 0.3
# Epochs in which the rate rises, the share of all epochs at which it has fallen, and the share to which it falls.
RISE, FALLEN, LEAST = 4, 0.4, 0.33
# The networks are meant for every second event of a recording (README.md has accuracies at other strides).
STRIDE = 2
TURN, SHEAR = 0.2, 0.2  # radians
STRETCH = 0.12  # of the logarithm, for each axis
SHIFT = 2.0  # pixels
MAX_STRIDE = 6  # thinning, uniform in the logarithm


def augment(events, random, side, share, shortest_ms):
    """Another recording like `events` (events, 4). A `share` ends early. Pixels stay integers, so that a sensor could have sent the
    result."""
    # Every nth event from a random one on for whole n, or each with a chance, so that the network sees any density.
    stride = np.exp(random.uniform(0, np.log(MAX_STRIDE)))
    if random.random() < 0.5:
        events = events[random.integers(round(stride)) :: round(stride)]
    else:
        events = events[random.random(len(events)) < 1 / stride]
    if random.random() < share:
        end = events[0, 0] + random.uniform(1000 * shortest_ms, events[-1, 0] - events[0, 0])
        events = events[events[:, 0] <= end]
    turn, shear = random.uniform(-TURN, TURN), random.uniform(-SHEAR, SHEAR)
    stretch = np.exp(random.uniform(-STRETCH, STRETCH, 2))
    rotation = np.array([[np.cos(turn), -np.sin(turn)], [np.sin(turn), np.cos(turn)]])
    matrix, centre = rotation @ np.array([[stretch[0], shear], [0, stretch[1]]]), (side - 1) / 2
    pixels = np.rint((events[:, 1:3] - centre) @ matrix.T + centre + random.uniform(-SHIFT, SHIFT, 2)).astype(np.int64)
    return np.concatenate([events[:, :1], pixels, events[:, 3:]], axis=1)[((pixels >= 0) & (pixels < side)).all(axis=1)]


def schedule(epochs, done):
    """The rate rises, falls and then stays constant: at a constant rate the weights of an epoch are a sample from the region of low
    loss."""
    epoch = done * epochs
    if epoch < RISE:
        return 0.1 + 0.9 * epoch / RISE
    fallen = min(1.0, (epoch - RISE) / max(FALLEN * epochs - RISE, 1))
    return LEAST + (1 - LEAST) * (1 + math.cos(math.pi * fallen)) / 2


def loss(module, given, target):
    return F.cross_entropy(module(given), target, label_smoothing=SMOOTHING)


def main():
    args = shared.arguments(__doc__, PARTS, "digits", "folder with train/DIGIT/*.bin and test/DIGIT/*.bin", folds=False)
    recordings = shared.Recordings.read(args.data, FOLDS, "digits")
    for network in args.network:
        for fold, path in shared.missing(args, network, args.seed, args.folds and range(FOLDS)):
            seen, parts = recordings.seen(fold), PARTS[network]
            film = Film.of_classes(recordings.sensor, [recordings.events[i] for i in seen], recordings.label[seen])
            module = Module.from_description(network, seed=args.seed, dropout={"hidden": DROPOUT, "out": DROPOUT})
            for number, (epochs, rate, *cut) in enumerate(parts):
                part = path if number + 1 == len(parts) else path.with_suffix(f".part{number}")
                if not part.exists():
                    changed = partial(augment, side=recordings.sensor[0], share=cut[0], shortest_ms=cut[1])
                    presses = Presses(film, batch=BATCH, augment=changed, limit=args.quick)
                    epochs = min(epochs, 2) if args.quick else epochs
                    rates = {"rate": rate, "schedule": partial(schedule, epochs), "clip": None}
                    settings = rates | {"epochs": epochs, "keep": "mean", "seed": args.seed, "checkpoint": part.with_suffix(".state")}
                    history = fit(module, presses, loss=loss, **settings)
                    recipe = {"parts": parts[: number + 1], "batch": BATCH, "smoothing": SMOOTHING, "dropout": DROPOUT}
                    said = {"recipe": recipe, "stride": STRIDE, "loss": f"{history.losses[-1]:.4f}"}
                    said |= recordings.remarks(fold, FOLDS, args.seed, network, "recordings of N-MNIST")
                    save(module, part, said, half=True)
                    part.with_suffix(".state").unlink()
                module.load(Weights(part))


if __name__ == "__main__":
    main()
