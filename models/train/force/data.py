"""Simulates the grasps to learn from, to choose by and to test on.

    python models/train/force/data.py /tmp/force

Writes train.safetensors (900 recordings) and valid.safetensors (100), which are the parts of one run, and test.safetensors (92 of another
seed). All are as `meissner simulate grasp` writes them.
"""

import argparse
import subprocess
from pathlib import Path

from safetensors import safe_open
from safetensors.numpy import save_file

ALL, TRAIN, TEST = 1000, 900, 92


def main():
    args = arguments()
    args.folder.mkdir(parents=True, exist_ok=True)
    whole, test = args.folder / "all.safetensors", args.folder / "test.safetensors"
    if not whole.exists():
        simulate(args, ALL, 1, whole)
    if not test.exists():
        simulate(args, TEST, 2, test)
    for part, chosen in {"train": range(TRAIN), "valid": range(TRAIN, ALL)}.items():
        write(whole, chosen, args.folder / f"{part}.safetensors")


def simulate(args, recordings, seed, out):
    command = [args.meissner, "simulate", "grasp", "--recordings", recordings, "--seed", seed, "--out", out]
    subprocess.run([str(word) for word in command], check=True)


def write(whole, chosen, out):
    """Writes the recordings `chosen`, a range, of the file `whole`."""
    with safe_open(whole, "np") as file:
        metadata, tensors = file.metadata(), {}
        for prefix in ("", "truth."):
            start = file.get_tensor(f"{prefix}start")[chosen.start : chosen.stop + 1]
            own = [name for name in file.keys() if name.startswith("truth.") == bool(prefix) and name != f"{prefix}start"]
            tensors |= {name: file.get_slice(name)[start[0] : start[-1]] for name in own}
            tensors[f"{prefix}start"] = start - start[0]
    save_file(tensors, out, metadata)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    return parser.parse_args()


if __name__ == "__main__":
    main()
