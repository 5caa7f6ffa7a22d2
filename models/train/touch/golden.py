"""Writes streams of spikes that no skin felt, and what PyTorch makes of them with the shipped weights, for a test:

    python models/train/touch/golden.py tests/golden/touch.json

Taxels spike by fixed formulas; `meissner prepare graphs` makes the graphs.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
from safetensors.torch import load_file

TRAIN = Path(__file__).resolve().parents[1]
sys.path += [str(TRAIN), str(TRAIN / "digits")]
import shared
from graphs import Graphs
from network import Touch

SENSOR = [241, 357]
# Spikes and bins: longer than a window, and of every age that has a classifier of its own.
STREAMS = [(900, 320), (700, 200), (400, 150), (300, 80), (120, 30)]


def main():
    args = shared.parser(__doc__, "touch", out=None).parse_args()
    streams = [stream(number, *size) for number, size in enumerate(STREAMS)]
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in ("touch-containers", "touch-objects"):
            graphs = Graphs(args.meissner, f"models/networks/{name}.toml", json.dumps(SENSOR), [np.array(s) for s in streams], folder)
            network = load(args.weights / f"{name}.0.safetensors")
            found[name] = network(network.features(graphs, len(streams))).tolist()
    shared.write(args.out, {"sensor": SENSOR, "streams": streams, "logits": found})


def load(path):
    """The network with the tensors of the file at `path`."""
    tensors = load_file(path)
    network = Touch(len(tensors["out.bias"]), len(tensors["code.weight"]), range(len(tensors["age.weight"])))
    network.tensors = {name: tensors[name].float() for name in network.tensors}
    return network


def stream(number, spikes, bins):
    """Spikes (t in microseconds, x, y, on) of 30 places that wake one after the other, by a linear congruence."""
    made = []
    for i, state in zip(range(spikes), shared.congruence(11 + number)):
        place = min(state // 2**8 % 30, 29 * (i + 60) // spikes)
        made.append([i * bins // spikes * 20_000, 40 * (place % 6) + 7, 70 * (place // 6) + 20, state // 2**20 % 3 // 2])
    return made


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
