"""Compares the engine's logits with PyTorch's on every window of a data set.

    target/release/meissner eval slip DATA --trainings models/weights/slip --logits logits.safetensors
    python models/train/slip/compare.py DATA logits.safetensors

Fails where a class differs, or a logit by more than 1e-4 of the largest magnitude of its window's logits (at least 1).
"""

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

sys.path.append(str(Path(__file__).resolve().parents[1]))
import shared

DATA = "folder of CLASS/OBJECTn.csv"
LOGITS = "what meissner eval slip --logits wrote"


def main():
    args = shared.parser(__doc__, "slip", data=DATA, logits=LOGITS).parse_args()
    agreed = True
    with safe_open(args.logits, "pt") as engine, tempfile.TemporaryDirectory() as folder:
        windows = {}
        for key in sorted(engine.keys()):
            name, seed = key.rsplit(".", 1)
            if name not in windows:
                windows[name] = prepare(args.meissner, args.data, name, folder)
            tensors = load_file(args.weights / f"{key}.safetensors")
            network = load(RECIPES[name].network(None), tensors)
            found = logits(network, windows[name].frames)
            agreed &= shared.agree(key, engine.get_tensor(key), found, "windows", "classes")
    sys.exit(0 if agreed else 1)


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
