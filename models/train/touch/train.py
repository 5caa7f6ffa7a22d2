"""Trains the classifiers of touch from the recordings of NeuTouch and a seed.

    python models/train/touch/train.py ../shared/data/neutouch
    python models/train/touch/train.py ../shared/data/neutouch --folds --out runs

Writes NETWORK.SEED.safetensors, trained on the data set's own training recordings, and with --folds
NETWORK.SEED.K.safetensors for cross-validation over all recordings. What is there already is not trained again. Then
`meissner eval touch SET DATA --trainings FOLDER --folds 5` says what they are worth.
"""

import argparse
import datetime
import json
import sys
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
import torch

TRAIN = Path(__file__).resolve().parents[1]
# What all trainings share lies beside their folders; these two modules are those of the digits.
sys.path += [str(TRAIN), str(TRAIN / "digits")]
import export_weights
from augment import augment
from fit import classify, encode, lay_out
from graphs import Graphs, preparation
from network import Touch
from recordings import prepare

FOLDS = 5
PART = 60  # recordings whose graphs are held at a time
CELL_US = 40_000
WHOLE = 8  # times that a whole recording counts, against one of the same age that ends early
LONGEST_US = 5_000_000
RECIPES = {
    # All objects are held for 5 s: from the last age on, every recording is whole.
    "objects": {
        "lags": 1.0,
        "spikes": 0.3,
        "curve": "1 - exp(-x)",
        "code": 40,
        "ages": (25, 60, 94, 122),
        "ended": 0,
        "shrinkage": 0.1,
        "margin": 34_560,
    },
    "containers": {
        "lags": 0.25,
        "spikes": 1.0,
        "curve": "sqrt(x)",
        "code": 40,
        "ages": (25, 60, 94),
        "ended": 1,
        "shrinkage": 0.05,
        "margin": None,
    },
}
CURVES = {"1 - exp(-x)": lambda x: 1 - torch.exp(-x), "sqrt(x)": torch.sqrt}


def main():
    args = arguments()
    torch.set_num_threads(args.threads)
    args.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for task in args.set:
            recordings = prepare(args.meissner, args.data, FOLDS, folder, ("touch", task))
            network = f"models/networks/touch-{task}.toml"
            graphs = partial(Graphs, args.meissner, network, recordings.sensor, folder=folder)
            said = preparation(args.meissner, network)
            for seed in args.seed:
                for fold in args.fold if args.folds else [None]:
                    suffix = "" if fold is None else f".{fold}"
                    path = args.out / f"touch-{task}.{seed}{suffix}.safetensors"
                    if not path.exists():
                        train(task, seed, fold, recordings, args.copies, graphs, said, path)


def train(task, seed, fold, recordings, copies, graphs, said, path):
    """One training, and what it says about itself."""
    print(path.stem, flush=True)
    started = time.time()
    seen = np.flatnonzero(recordings.in_train if fold is None else recordings.fold != fold)
    network = Touch(recordings.label.max() + 1, RECIPES[task]["code"], RECIPES[task]["ages"])
    fit(network, RECIPES[task], recordings, seen, copies, np.random.default_rng(seed), graphs)
    remarks = {
        "network": f"touch-{task}",
        "seed": seed,
        "date": datetime.date.today().isoformat(),
        "recipe": f"linear classifiers, {json.dumps(RECIPES[task])}, {copies} augmented copies",
        "recordings": len(seen),
        "licence": "the data state none",
        "sensor": recordings.sensor,
        "preparation": said,
    }
    of = f"recordings of NeuTouch ({task}; the data state no licence)"
    if fold is None:
        remarks |= {"trained_on": "train", "about": f"trained on the training {of}, seed {seed}"}
    else:
        held_out = [recordings.names[i] for i in np.flatnonzero(recordings.fold == fold)]
        about = f"trained on all {of} but fold {fold} of {FOLDS}, seed {seed}"
        remarks |= {"fold": fold, "held_out": json.dumps(held_out), "about": about}
    export_weights.save(network.tensors, path, remarks)
    print(f"  {time.time() - started:.0f} s", flush=True)


def fit(network, recipe, recordings, seen, copies, random, graphs):
    """Fits `network` in place to the recordings `seen`; `graphs` builds the graphs of streams."""
    lay_out(network, recipe["lags"], recipe["spikes"])
    whole = [recordings.events[i] for i in seen]
    encode(network, CURVES[recipe["curve"]], (network.image(*part) for part in parts(whole, graphs)))
    label = torch.from_numpy(recordings.label[seen])
    bounds = [5 * CELL_US, *(CELL_US * age for age in network.ages), LONGEST_US]
    for group, ages in enumerate(zip(bounds, bounds[1:])):
        # The oldest contacts are whole, most of them: that is when an answer counts most.
        last = group == len(network.ages)
        streams = [augment(events, random, ages) for _ in range(recipe["ended"] if last else copies) for events in whole]
        share = torch.ones(len(streams))
        if last:
            streams += whole
            share = torch.cat([share, torch.full((len(whole),), float(WHOLE))])
        found, labels = features(network, streams, graphs), label.repeat(len(streams) // len(whole))
        classify(network, group, found, labels, share, recipe["shrinkage"], recipe["margin"] if last else None)


def features(network, streams, graphs):
    """What the classifiers read of `streams`."""
    return torch.cat([network.features(*part) for part in parts(streams, graphs)])


def parts(streams, graphs):
    """The graphs of `streams`, some streams at a time, and how many these are."""
    for first in range(0, len(streams), PART):
        part = streams[first : first + PART]
        yield graphs(part), len(part)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder with Ev-Objects.zip and Ev-Containers.zip")
    parser.add_argument("--set", nargs="+", choices=RECIPES, default=list(RECIPES), help="default: both")
    parser.add_argument("--seed", nargs="+", type=int, default=[0], help="default: 0")
    parser.add_argument("--folds", action="store_true", help=f"cross-validate instead, in {FOLDS} folds")
    parser.add_argument("--fold", nargs="+", type=int, default=range(FOLDS), help="of these the folds; default: all")
    parser.add_argument("--copies", type=int, default=2, help="augmented copies of a recording; default: 2")
    parser.add_argument("--out", type=Path, default=Path("models/weights/touch"), help="default: %(default)s")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    parser.add_argument("--threads", type=int, default=1, help="default: 1")
    return parser.parse_args()


if __name__ == "__main__":
    main()
