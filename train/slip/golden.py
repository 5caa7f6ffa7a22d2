"""Writes readings that no sensor made, and what PyTorch makes of them with the shipped weights of seed 0, for a test:

    python train/slip/golden.py tests/golden/slip.json

The readings wander like a press does, by a fixed formula; `meissner prepare slip` makes the windows.
"""

import argparse
import json
import tempfile
from pathlib import Path

import torch
from export import load
from fit import logits
from networks import ELECTRODES
from prepared import prepare
from recipes import RECIPES
from safetensors.torch import load_file

READINGS = 40
# Any object of Basic, since the layout of a data set asks for one.
RECORDING = Path("n/pen0.csv")


def main():
    args = arguments()
    readings = [[reading(time, electrode) for electrode in range(ELECTRODES)] for time in range(READINGS)]
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        csv = Path(folder) / "data" / RECORDING
        csv.parent.mkdir(parents=True)
        header = ",".join(f"e{electrode + 1}" for electrode in range(ELECTRODES))
        csv.write_text("\n".join([header, *(",".join(map(str, row)) for row in readings)]) + "\n")
        for name, recipe in RECIPES.items():
            prepared = prepare(args.meissner, Path(folder) / "data", name, folder)
            network = load(recipe.network(None), load_file(args.weights / f"{name}.0.safetensors"))
            found[name] = logits(network, prepared.frames).tolist()
    args.out.parent.mkdir(parents=True, exist_ok=True)
    args.out.write_text(json.dumps({"readings": readings, "logits": found}) + "\n")


def reading(time, electrode):
    """Counts of an electrode: a level of its own, a slow drift, and noise of a linear congruence."""
    noise = (1103515245 * (time * ELECTRODES + electrode) + 12345) % 2**31 % 15
    return 3000 + 29 * ((7 * electrode) % 24) + (time * (electrode % 5 - 2)) // 2 + noise


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("out", type=Path)
    parser.add_argument("--weights", type=Path, default=Path("models/weights/slip"), help="default: %(default)s")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    return parser.parse_args()


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
