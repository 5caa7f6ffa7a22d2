"""Trains the classifiers of digits from the recordings of N-MNIST and a seed.

    python models/train/digits/train.py ../shared/data/nmnist
    python models/train/digits/train.py ../shared/data/nmnist --folds

Writes NETWORK.SEED.safetensors, trained on the data set's own training recordings, and with --folds
NETWORK.SEED.K.safetensors for cross-validation over all recordings. What is there already is not trained again. Then
`meissner eval digits DATA --trainings FOLDER` says what they are worth.
"""

import argparse
import datetime
import json
import tempfile
import time
from functools import partial
from pathlib import Path

import numpy as np
import torch
from export import load, save
from fit import fit
from graphs import Graphs, preparation
from network import Digits
from recordings import prepare

# digits-frozen runs with the weights of digits-past.
NETWORKS = ("models/networks/digits-all.toml", "models/networks/digits-past.toml")
FOLDS = 5
# Of the events of a recording every second one is what the networks are meant for (README.md has accuracies at others).
STRIDE = 2


def main():
    args = arguments()
    torch.set_num_threads(args.threads)
    args.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        recordings = prepare(args.meissner, args.data, FOLDS, folder)
        for seed in args.seed:
            for fold in args.fold if args.folds else [None]:
                for network in args.network:
                    name = Path(network).stem
                    suffix = "" if fold is None else f".{fold}"
                    path = args.out / f"{name}.{seed}{suffix}.safetensors"
                    if not path.exists():
                        graphs = partial(Graphs, args.meissner, network, recordings.sensor, folder=folder)
                        said = preparation(args.meissner, network)
                        train(args, path, recordings, fold, seed, graphs, said)


def train(args, path, recordings, fold, seed, graphs, said):
    """One training, and what it says about itself."""
    print(path.stem, flush=True)
    started = time.time()
    torch.manual_seed(seed)
    random = np.random.default_rng(seed)
    seen = np.flatnonzero(recordings.in_train if fold is None else recordings.fold != fold)
    network = Digits()
    if args.start:
        network.load_state_dict(load(args.start / path.name).state_dict())
    loss = fit(network, recordings, seen, args, random, graphs)
    remarks = {
        "network": path.name.split(".")[0],
        "seed": seed,
        "date": datetime.date.today().isoformat(),
        "recipe": f"{'weights of an earlier training, ' if args.start else ''}{args.epochs} epochs, batch 32, AdamW {args.rate} "
        f"falling to a third, decay 0.001, label smoothing 0.05, a share of {args.cut[0]} cut off at random ages from "
        f"{args.cut[1]:.0f} ms on, mean of the weights of the second half",
        "recordings": len(seen),
        "stride": STRIDE,
        "sensor": recordings.sensor,
        "preparation": said,
        "loss": f"{loss:.4f}",
    }
    if fold is None:
        remarks |= {"trained_on": "train", "about": f"trained on the training recordings of N-MNIST, seed {seed}"}
    else:
        held_out = [recordings.names[i] for i in np.flatnonzero(recordings.fold == fold)]
        about = f"trained on all recordings of N-MNIST but fold {fold} of {FOLDS}, seed {seed}"
        remarks |= {"fold": fold, "held_out": json.dumps(held_out), "about": about}
    save(network, path, remarks)
    print(f"  {time.time() - started:.0f} s", flush=True)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder with train/DIGIT/*.bin and test/DIGIT/*.bin")
    parser.add_argument("--network", nargs="+", default=list(NETWORKS), help="names or descriptions; default: all")
    parser.add_argument("--seed", nargs="+", type=int, default=[0], help="default: 0")
    parser.add_argument("--folds", action="store_true", help=f"cross-validate instead, in {FOLDS} folds")
    parser.add_argument("--fold", nargs="+", type=int, default=range(FOLDS), help="of these the folds; default: all")
    parser.add_argument("--epochs", type=int, default=80, help="default: 80")
    parser.add_argument("--rate", type=float, default=0.003, help="default: 0.003")
    parser.add_argument("--cut", nargs=2, type=float, default=(0.5, 20), metavar=("SHARE", "MS"),
                        help="share of the recordings that end early, and the least age in ms; default: 0.5 20")
    parser.add_argument("--start", type=Path, help="folder of weights to start from, of the same names; default: drawn")
    parser.add_argument("--out", type=Path, default=Path("models/weights/digits"), help="default: %(default)s")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    parser.add_argument("--threads", type=int, default=1, help="default: 1")
    return parser.parse_args()


if __name__ == "__main__":
    main()
