"""Trains a network over events on labelled presses, from a seed.

    python train/angle/dome.py /tmp/dome
    python train/angle/train.py /tmp/dome/on /tmp/dome/off --mirrors columns rows

Each FOLDER has train.safetensors and valid.safetensors, the same presses filmed by different cameras. Writes
NETWORK.SEED.safetensors; a training that was cut off goes on. Then `meissner eval angle` says what it is worth.
"""

import argparse
import datetime
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import presses
import torch
from fit import errors, fit
from graphs import inspected
from head import refit
from network import Network

# What all trainings share lies beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import export_weights

ABOUT = "trained on presses of a simulated dome, whose camera is simulated too"


def main():
    args = arguments()
    torch.set_num_threads(1)
    args.said = inspected(args.meissner, args.network)
    args.outputs = args.said["outputs"]
    path = args.out / f"{args.said['name']}.{args.seed}.safetensors"
    args.out.mkdir(parents=True, exist_ok=True)
    data = [presses.read(folder / "train.safetensors") for folder in args.data]
    valid = {folder.name: presses.read(folder / "valid.safetensors") for folder in args.data}
    torch.manual_seed(args.seed)
    random = np.random.default_rng(args.seed)
    network = Network(args.said, args.unit, args.dropout)
    with tempfile.TemporaryDirectory() as folder:
        args.folder = folder

        def error(network):
            found = {name: errors(network, each, args, args.stride, (0.5, 1.0)) for name, each in valid.items()}
            return {f"{name} {share}": in_degrees(args, found[name][:, i]) for name in found for i, share in enumerate(("half", "end"))}

        def log(line):
            print(line, flush=True)

        loss = fit(network, data, args, error, random, path.with_suffix(".state"), log)
        if args.head_epochs > 0:
            refit(network, data, args, random, args.head_epochs, log)
        found = error(network)
    remarks = {
        "network": args.said["name"],
        "seed": args.seed,
        "date": datetime.date.today().isoformat(),
        "about": args.about,
        "recipe": f"{args.epochs} epochs of 4 passes, batch 16, AdamW {args.rate} on a cosine, decay 0.001, smooth L1; then the "
        f"dense layers alone, {args.head_epochs} epochs in principal components",
        "presses": len(data[0]),
        "trained_on": "train",
        "stride": args.stride,
        "sensor": json.dumps(data[0].sensor),
        "preparation": args.said["preparation"],
        "loss": f"{loss:.5f}",
        "valid": json.dumps({name: round(float(value), 4) for name, value in found.items()}),
    }
    export_weights.save(network.exported(), path, remarks)
    print(path, remarks["valid"])


def in_degrees(args, found):
    """Mean absolute error over all outputs, in degrees where the outputs are angles in radians."""
    scale = 180 / np.pi if args.said["unit"] == "rad" else 1.0
    return scale * np.abs(found).mean()


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--network", default="tactigraph-lean", help="name or description; default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="default: 0")
    parser.add_argument("--epochs", type=int, default=12, help="default: 12")
    parser.add_argument("--rate", type=float, default=0.003, help="default: 0.003")
    parser.add_argument("--beta", type=float, default=0.1, help="error at which the loss becomes linear, in units; default: 0.1")
    parser.add_argument("--dropout", type=float, default=0.0, help="of the readout; default: 0")
    parser.add_argument("--unit", type=float, default=0.1, help="of the outputs during training; default: 0.1")
    parser.add_argument("--strides", type=int, nargs=2, default=[2, 4], help="range of the thinning; default: 2 4")
    parser.add_argument("--stride", type=int, default=2, help="thinning that the weights are meant for; default: 2")
    parser.add_argument("--presses", type=int, help="presses of an epoch; default: all")
    parser.add_argument("--youngest", type=float, default=0.1, help="least age as a share of the press; default: 0.1")
    parser.add_argument("--mirrors", nargs="*", default=[], choices=["columns", "rows"], help="axes of symmetry; default: none")
    parser.add_argument("--head-epochs", type=int, default=10, help="of the dense layers alone; default: 10")
    parser.add_argument("--check", type=int, default=5, help="epochs from one validation to the next; default: 5")
    parser.add_argument("--about", default=ABOUT, help="remark about the data")
    parser.add_argument("--out", type=Path, default=Path("models/weights/angle"), help="default: %(default)s")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    return parser.parse_args()


if __name__ == "__main__":
    main()
