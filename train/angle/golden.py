"""Prints what PyTorch makes of a press with the shipped weights, at its end, for a test of `pipeline/src/press.rs`:

    python train/angle/golden.py /tmp/dome/on/unseen.safetensors 107
"""

import argparse
import tempfile
from pathlib import Path

import presses
import torch
from graphs import Graphs, inspected
from network import load
from safetensors import safe_open


@torch.no_grad()
def main():
    args = arguments()
    with safe_open(args.weights, "pt") as file:
        metadata = file.metadata()
    said = inspected(args.meissner, metadata["network"])
    data = presses.read(args.events)
    stream = data.events[args.press][:: int(metadata["stride"])]
    with tempfile.TemporaryDirectory() as folder:
        graphs = Graphs(args.meissner, metadata["network"], said, data.sensor, [stream], folder)
        print(load(args.weights, said)(graphs.part(range(1)).read(data.end_us[[args.press]][:, None])).tolist())


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("events", type=Path)
    parser.add_argument("press", type=int)
    path = Path("models/weights/angle/tactigraph-lean.0.safetensors")
    parser.add_argument("--weights", type=Path, default=path, help="default: %(default)s")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    return parser.parse_args()


if __name__ == "__main__":
    main()
