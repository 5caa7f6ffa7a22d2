"""Compares the engine's logits with PyTorch's at the end of every recording of the split test.

    target/release/meissner eval digits DATA --network digits-all --network digits-past --logits logits.safetensors
    python models/train/digits/compare.py DATA logits.safetensors

Fails where a digit differs, or a logit by more than 1e-4 of the largest magnitude of its recording's logits (at least 1).
"""

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

sys.path.append(str(Path(__file__).resolve().parents[1]))
import shared

DATA = "folder with train/DIGIT/*.bin and test/DIGIT/*.bin"
LOGITS = "what meissner eval digits --logits wrote"


def main():
    args = shared.parser(__doc__, "digits", data=DATA, logits=LOGITS).parse_args()
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
            found = logits(load(path), graphs, len(streams))
            agreed &= shared.agree(name, engine.get_tensor(f"{name}.0"), found, "recordings", "digits")
    sys.exit(0 if agreed else 1)


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
