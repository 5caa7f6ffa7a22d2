"""Writes streams of events that no sensor made, and what PyTorch makes of them with the shipped weights, for a test:

    python models/train/digits/golden.py tests/golden/digits.json

Shapes move over the sensor by fixed formulas; `meissner prepare graphs` makes the graphs.
"""

import json
import math
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
from export import load
from fit import logits
from graphs import Graphs

sys.path.append(str(Path(__file__).resolve().parents[1]))
import shared

SENSOR = [34, 34]
# Longer than a window, and shorter.
STREAMS = [(900, 550), (700, 290), (200, 310)]


def main():
    args = shared.parser(__doc__, "digits", out=None).parse_args()
    streams = [stream(number, *size) for number, size in enumerate(STREAMS)]
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in ("digits-all", "digits-past"):
            graphs = Graphs(args.meissner, name, json.dumps(SENSOR), [np.array(s) for s in streams], folder)
            network = load(args.weights / f"{name}.0.safetensors")
            found[name] = logits(network, graphs, len(streams)).tolist()
    shared.write(args.out, {"sensor": SENSOR, "streams": streams, "logits": found})


def stream(number, events, milliseconds):
    """Events (t in microseconds, x, y, on) along a turning bar, a ring or a hook, with noise of a linear congruence."""
    made = []
    for i, state in zip(range(events), shared.congruence(7 + number)):
        place, on = state // 2**8 % 64 / 64, state // 2**20 % 2
        x, y = SHAPES[number % len(SHAPES)](place, i / events)
        x += state // 2**13 % 3 - 1 + on
        y += state // 2**15 % 3 - 1
        made.append([i * milliseconds * 1000 // events, round(x), round(y), on])
    return made


def bar(place, time):
    along = 20 * place - 10
    return 17 + along * math.sin(0.5 * time), 17 + along * math.cos(0.5 * time)


def ring(place, time):
    angle = 2 * math.pi * place
    return 16 + 6 * math.cos(angle) + 2 * time, 16 + 9 * math.sin(angle)


def hook(place, time):
    return (10 + 24 * place, 8) if place < 0.5 else (22 - 12 * (place - 0.5) - 2 * time, 8 + 36 * (place - 0.5))


SHAPES = (bar, ring, hook)


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
