"""Compares the engine's logits with PyTorch's at the end of every recording of the split test.

    target/release/meissner eval digits DATA --network digits-all --network digits-past --logits logits.safetensors
    python train/digits/compare.py DATA logits.safetensors

Fails where a digit differs, or a logit by more than 1e-4 of the largest magnitude of its recording's logits (at least 1).
"""

import argparse
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
from export import load
from fit import logits
from graphs import Graphs
from recordings import prepare
from safetensors import safe_open

MOST = 1e-4


def main():
    args = arguments()
    agreed = True
    with safe_open(args.logits, "pt") as engine, tempfile.TemporaryDirectory() as folder:
        recordings = prepare(args.meissner, args.data, 2, folder)
        test = np.flatnonzero(~recordings.in_train)
        for name in ("digits-all", "digits-past"):
            path = args.weights / f"{name}.0.safetensors"
            with safe_open(path, "pt") as file:
                stride = int(file.metadata().get("stride", 1))
            streams = [recordings.events[i][::stride] for i in test]
            graphs = Graphs(args.meissner, name, recordings.sensor, streams, folder)
            agreed &= agree(name, engine.get_tensor(f"{name}.0"), logits(load(path), graphs, len(streams)))
    sys.exit(0 if agreed else 1)


def agree(name, engine, torch_logits):
    """Whether both give the same, and a line that says so."""
    scale = torch_logits.abs().amax(1, keepdim=True).clamp(min=1)
    difference = ((engine - torch_logits).abs() / scale).max().item()
    differ = int((engine.argmax(1) != torch_logits.argmax(1)).sum())
    print(f"{name}: {len(engine)} recordings, {differ} digits differ, largest difference {difference:.1e}")
    return differ == 0 and difference <= MOST


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, help="folder with train/DIGIT/*.bin and test/DIGIT/*.bin")
    parser.add_argument("logits", type=Path, help="what meissner eval digits --logits wrote")
    parser.add_argument("--weights", type=Path, default=Path("models/weights/digits"), help="default: %(default)s")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    return parser.parse_args()


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
