"""Compares the engine's logits with PyTorch's on every window of a data set.

    target/release/meissner eval slip DATA --trainings models/weights/slip --logits logits.safetensors
    python train/slip/compare.py DATA logits.safetensors

Fails where a class differs, or a logit by more than 1e-4 of the largest magnitude of its window's logits (at least 1).
"""

import argparse
import sys
import tempfile
from pathlib import Path

import torch
from export import load
from fit import logits
from prepared import prepare
from recipes import RECIPES
from safetensors import safe_open
from safetensors.torch import load_file

MOST = 1e-4


def main():
    args = arguments()
    agreed = True
    with safe_open(args.logits, "pt") as engine, tempfile.TemporaryDirectory() as folder:
        windows = {}
        for key in sorted(engine.keys()):
            name, seed = key.rsplit(".", 1)
            if name not in windows:
                windows[name] = prepare(args.meissner, args.data, name, folder)
            tensors = load_file(args.weights / f"{key}.safetensors")
            network = load(RECIPES[name].network(None), tensors)
            agreed &= agree(key, engine.get_tensor(key), logits(network, windows[name].frames))
    sys.exit(0 if agreed else 1)


def agree(key, engine, torch_logits):
    """Whether both give the same, and a line that says so."""
    scale = torch_logits.abs().amax(1, keepdim=True).clamp(min=1)
    difference = ((engine - torch_logits).abs() / scale).max().item()
    differ = int((engine.argmax(1) != torch_logits.argmax(1)).sum())
    print(f"{key}: {len(engine)} windows, {differ} classes differ, largest difference {difference:.1e}")
    return differ == 0 and difference <= MOST


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder of CLASS/OBJECTn.csv")
    parser.add_argument("logits", type=Path, help="what meissner eval slip --logits wrote")
    parser.add_argument("--weights", type=Path, default=Path("models/weights/slip"), help="default: %(default)s")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    return parser.parse_args()


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
