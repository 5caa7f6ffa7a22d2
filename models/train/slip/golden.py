"""Writes readings that no sensor made, and what PyTorch makes of them with the shipped weights of seed 0, for a test:

    python models/train/slip/golden.py tests/golden/slip.json

The readings wander like a press does, by a fixed formula; `meissner prepare slip` makes the windows.
"""

import sys
import tempfile
from pathlib import Path

import torch
from export import load
from fit import logits
from networks import ELECTRODES
from prepared import prepare
from recipes import RECIPES
from safetensors.torch import load_file

sys.path.append(str(Path(__file__).resolve().parents[1]))
import shared

READINGS = 40
# Any object of Basic, since the layout of a data set asks for one.
RECORDING = Path("n/pen0.csv")


def main():
    args = shared.parser(__doc__, "slip", out=None).parse_args()
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
    shared.write(args.out, {"readings": readings, "logits": found})


def reading(time, electrode):
    """Counts of an electrode: a level of its own, a slow drift, and noise of a linear congruence."""
    noise = next(shared.congruence(time * ELECTRODES + electrode)) % 15
    return 3000 + 29 * ((7 * electrode) % 24) + (time * (electrode % 5 - 2)) // 2 + noise


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
