"""Trains the networks for the direction of slip from a folder of CSV recordings and a seed.

    python models/train/slip/train.py ../shared/data/biotac_dos

Writes a file of weights a training: NETWORK.SEED.safetensors on all Basic objects, and with --folds
NETWORK.SEED.SCHEME.K.safetensors for cross-validation. What is there already is not trained again. Then
`meissner eval slip DATA --trainings FOLDER` says what they are worth.
"""

import argparse
import datetime
import tempfile
import time
from pathlib import Path

import torch
from export import file_tensors, save
from fit import fit
from folds import SCHEMES, split, whole
from prepared import prepare
from recipes import RECIPES


def main():
    args = arguments()
    torch.set_num_threads(args.threads)
    args.out.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        for name in args.network:
            prepared = prepare(args.meissner, args.data, name, folder)
            schemes = args.folds or []
            parts = [part for scheme in schemes for part in split(prepared, scheme)] or [whole(prepared)]
            for seed in args.seed:
                for part in parts:
                    path = args.out / f"{name}.{seed}{part.suffix}.safetensors"
                    if not path.exists():
                        train(name, seed, prepared, part, path)


def train(name, seed, prepared, part, path):
    """One training, and what it says about itself."""
    print(path.stem, flush=True)
    started = time.time()
    torch.manual_seed(seed)
    recipe = RECIPES[name]
    frames = prepared.frames[part.seen]
    network = recipe.network(frames)
    losses = fit(network, recipe, frames, prepared.label[part.seen], seed)
    tensors = file_tensors(network)
    remarks = {
        "about": f"trained on the Basic objects of biotac_dos, seed {seed}",
        "network": name,
        "seed": seed,
        "trained_on": "Basic",
        "preparation": prepared.preparation,
        "date": datetime.date.today().isoformat(),
        "recipe": f"{recipe.epochs} epochs, batch {recipe.batch}, Adam {recipe.rate}, L2 {recipe.l2}, "
        f"label smoothing {recipe.smoothing}, mean of the weights of the second half",
        "windows": len(part.seen),
        "loss": f"{losses[-1]:.4f}",
    }
    save(tensors, path, remarks | part.remarks)
    print(f"  {time.time() - started:.0f} s", flush=True)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder of CLASS/OBJECTn.csv")
    parser.add_argument("--network", nargs="+", choices=RECIPES, default=list(RECIPES), help="default: all")
    parser.add_argument("--seed", nargs="+", type=int, default=[0, 1, 2, 3, 4], help="default: 0 1 2 3 4")
    parser.add_argument("--folds", nargs="+", choices=SCHEMES, help="cross-validate instead, in these ways")
    parser.add_argument("--out", type=Path, default=Path("models/weights/slip"), help="default: %(default)s")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    parser.add_argument("--threads", type=int, default=1, help="default: 1")
    return parser.parse_args()


if __name__ == "__main__":
    main()
