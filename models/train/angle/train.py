"""Trains a network over events on labelled presses, from a seed.

    python models/train/angle/dome.py /tmp/dome
    python models/train/angle/train.py /tmp/dome/on /tmp/dome/off --mirrors columns rows

Each FOLDER has train.safetensors, the same presses filmed by different cameras, and perhaps valid.safetensors. Writes
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
from graphs import has_pooled_blocks, inspected
from network import Network
from safetensors import safe_open
from safetensors.torch import load_file

# What all trainings share lies beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import export_weights

# A sum over the events of a cell, one of `stride` of them, times this and the stride, is of the size of an event's features.
SHARE = 0.01
KEEP = "build the graphs of each press once, whole and cut off CUTS times, 80 bytes an event; default: build new ones in every epoch"
ABOUT = "trained on presses of a simulated dome, whose camera is simulated too"


def main():
    args = arguments()
    torch.set_num_threads(1)
    args.said = inspected(args.meissner, args.network)
    args.outputs = args.said["outputs"]
    if args.keep and (not has_pooled_blocks(args.said) or [*args.strides, args.passes, args.times] != [1, 1, 1, 1]):
        raise SystemExit("--keep is for networks with blocks over cells, and reads all events once a press")
    if args.device != "cpu" and "graph" in args.said and not args.keep:
        raise SystemExit("--device needs graphs that are kept there: add --keep")
    path = args.out / f"{args.said['name']}.{args.seed}.safetensors"
    args.out.mkdir(parents=True, exist_ok=True)
    data = [presses.read(folder / "train.safetensors") for folder in args.data]
    valid = {f.name: presses.read(f / "valid.safetensors") for f in args.data if (f / "valid.safetensors").exists()}
    args.unit = np.broadcast_to(args.unit, len(args.outputs)).astype(np.float64)
    torch.manual_seed(args.seed)
    random = np.random.default_rng(args.seed)
    network = Network(args.said, args.unit, args.dropout, SHARE * args.stride)
    started = remarks_of(args.start) if args.start else {}
    if args.start:
        tensors = load_file(args.start)
        if args.blocks:
            drawn = network.exported()
            tensors |= {name: drawn[name] for name in network.names(network.head)}
        network.load(tensors, args.stride / int(started["stride"]))
    network.to(args.device)
    with tempfile.TemporaryDirectory() as folder:
        args.folder = folder

        def error(network):
            found = {name: errors(network, each, args, args.stride, (0.5, 1.0)) for name, each in valid.items()}
            return {name: [mean_errors(args, each[:, i]) for i in range(each.shape[1])] for name, each in found.items()}

        def log(line):
            print(line, flush=True)

        loss = fit(network, data, args, error, random, path.with_suffix(".state"), log)
        found = error(network)
    remarks = written(args, recipe(args), data[0], args.stride, loss, found, started)
    export_weights.save(network.exported(), path, remarks)
    print(path, remarks["valid"])


def written(args, recipe, presses, stride, loss, valid, started):
    """The remarks of weights that were trained as `recipe` says, from weights with the remarks `started`."""
    remarks = {
        "network": args.said["name"],
        "seed": args.seed,
        "date": datetime.date.today().isoformat(),
        "about": args.about or started.get("about", ABOUT),
        "recipe": recipe,
        "presses": len(presses),
        "trained_on": "train",
        "stride": stride,
        "sensor": json.dumps(presses.sensor),
        "valid": json.dumps(valid),
    }
    if args.epochs:
        remarks["loss"] = f"{loss:.5f}"
    if args.said["preparation"]:
        remarks["preparation"] = args.said["preparation"]
    if "licence" in started:
        remarks["licence"] = started["licence"]
    ranges = args.ranges or started.get("ranges")
    if ranges:
        remarks["ranges"] = ranges
    return remarks


def remarks_of(path):
    """The remarks in the weights at `path`."""
    with safe_open(path, "pt") as file:
        return file.metadata()


def recipe(args):
    """What was done, in one line."""
    begin = f"{'layers of events ' if args.blocks else ''}from {args.start.name}: " if args.start else ""
    line = f"{begin}{args.epochs} epochs of {args.passes} passes, one event of {args.strides[0]} to {args.strides[1]}, batch {args.batch}, "
    return f"{line}AdamW {args.rate} on a cosine, decay 0.001, dropout {args.dropout}, smooth L1"


def mean_errors(args, found):
    """Mean absolute error of each output, in degrees where it is an angle in radians."""
    scale = [180 / np.pi if unit == "rad" else 1.0 for unit in args.said["units"]]
    return [round(float(value), 3) for value in np.abs(found).mean(axis=0) * scale]


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path, nargs="+", metavar="FOLDER")
    parser.add_argument("--network", default="tactigraph-past", help="name or description; default: %(default)s")
    parser.add_argument("--seed", type=int, default=0, help="default: 0")
    parser.add_argument("--epochs", type=int, default=12, help="default: 12")
    parser.add_argument("--rate", type=float, default=0.003, help="default: 0.003")
    parser.add_argument("--batch", type=int, default=16, help="presses of a step; default: 16")
    parser.add_argument("--beta", type=float, default=0.1, help="error at which the loss becomes linear, in units; default: 0.1")
    parser.add_argument("--dropout", type=float, default=0.0, help="of the readout; default: 0")
    parser.add_argument("--unit", type=float, nargs="+", default=[0.1], help="of each output during training; default: 0.1")
    parser.add_argument("--start", type=Path, help="weights to start from; default: drawn from the seed")
    parser.add_argument("--blocks", action="store_true", help="start from its layers of events alone, with another readout or head")
    parser.add_argument("--passes", type=int, default=1, help="times that a graph is used before others are built; default: 1")
    parser.add_argument("--strides", type=int, nargs=2, default=[1, 1], help="range of the thinning; default: 1 1")
    parser.add_argument("--stride", type=int, default=1, help="thinning that the weights are meant for; default: 1")
    parser.add_argument("--presses", type=int, help="presses of an epoch; default: all")
    parser.add_argument("--youngest", type=float, default=0.1, help="least age as a share of the press; default: 0.1")
    parser.add_argument("--times", type=int, default=1, help="random times at which a press is read, beside its end; default: 1")
    parser.add_argument("--mirrors", nargs="*", default=[], choices=["columns", "rows"], help="axes of symmetry; default: none")
    parser.add_argument("--keep", type=int, default=0, metavar="CUTS", help=KEEP)
    parser.add_argument("--device", default="cpu", help="device of PyTorch; default: %(default)s")
    parser.add_argument("--check", type=int, default=5, help="epochs from one validation to the next; default: 5")
    parser.add_argument("--ranges", help="JSON: [low, high] of the labels of each output, in its unit; default: those of the weights to start from")
    parser.add_argument("--about", help="remark about the data; default: that of the weights to start from, or the dome's")
    parser.add_argument("--out", type=Path, default=Path("models/weights/angle"), help="default: %(default)s")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    return parser.parse_args()


if __name__ == "__main__":
    main()
