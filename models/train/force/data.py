"""Simulates the grasps for training, validation and test.

    python models/train/force/data.py /tmp/force

Writes train.safetensors (900 recordings) and valid.safetensors (100), which are the parts of one run, test.safetensors (92 of another
seed), and few.safetensors (35 of a third), as many as in the force paper. All are as `meissner simulate grasp` writes them.
"""

import sys
from pathlib import Path

from safetensors import safe_open
from safetensors.numpy import save_file

# The code that all trainings share is beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
from shared import meissner

PARTS = {"train": range(900), "valid": range(900, 1000)}


def main(folder):
    folder.mkdir(parents=True, exist_ok=True)
    for name, recordings, seed in ("all", 1000, 1), ("test", 92, 2), ("few", 35, 3):
        if not (folder / f"{name}.safetensors").exists():
            meissner("simulate", "grasp", "--recordings", recordings, "--seed", seed, "--out", folder / f"{name}.safetensors")
    for part, chosen in PARTS.items():
        with safe_open(folder / "all.safetensors", "np") as file:
            metadata, tensors = file.metadata(), {}
            for prefix in ("", "truth."):
                start = file.get_tensor(f"{prefix}start")[chosen.start : chosen.stop + 1]
                own = [name for name in file.keys() if name.startswith("truth.") == bool(prefix) and name != f"{prefix}start"]
                tensors |= {name: file.get_slice(name)[start[0] : start[-1]] for name in own}
                tensors[f"{prefix}start"] = start - start[0]
        save_file(tensors, folder / f"{part}.safetensors", metadata)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
