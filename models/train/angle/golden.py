"""Writes streams of events that no sensor made, and what PyTorch makes of them with the shipped weights, for a test:

    python models/train/angle/golden.py tests/golden/angles.json

Dots move over the sensor by fixed formulas; `meissner prepare graphs` makes the graphs.
"""

import math
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
from frames import Frames
from graphs import Graphs, inspected
from network import load

sys.path.append(str(Path(__file__).resolve().parents[1]))
import shared

NETWORKS = [
    *("graphres", "graphres-published", "tactigraph", "tactigraph-frozen", "tactigraph-past"),
    *("tactip", "tactip-frames", "tactip-past", "tactip-shear"),
]
# The smaller sensor: a description fits any.
SENSOR = [128, 128]
# Events and milliseconds; the last stream is shorter than any cell in time.
STREAMS = [(900, 140), (500, 110), (200, 30)]


@torch.no_grad()
def main():
    args = shared.parser(__doc__, "angle", out=None).parse_args()
    streams = [stream(number, *size) for number, size in enumerate(STREAMS)]
    ends = np.array([[made[-1][0]] for made in streams])
    found = {}
    with tempfile.TemporaryDirectory() as folder:
        for name in NETWORKS:
            said = inspected(args.meissner, name)
            events = [np.array(made) for made in streams]
            frames = "graph" not in said
            graphs = Frames(said, SENSOR, events) if frames else Graphs(args.meissner, name, said, SENSOR, events, folder)
            network = load(args.weights / f"{name}.0.safetensors", said)
            found[name] = network(graphs.part(range(len(streams))).read(ends)).tolist()
    shared.write(args.out, {"sensor": SENSOR, "streams": streams, "logits": found})


def stream(number, events, milliseconds):
    """Events (t in microseconds, x, y, on) of 36 dots that move away from the middle, with noise of a linear congruence."""
    made = []
    for i, state in zip(range(events), shared.congruence(11 + number)):
        dot, on = state // 2**8 % 36, state // 2**20 % 2
        x, y = 14 + 20 * (dot % 6), 14 + 20 * (dot // 6)
        moved = (number + 1) * 4 * i / events
        angle = math.atan2(y - 64, x - 60)
        x += moved * math.cos(angle) + state // 2**13 % 3 - 1 + 2 * on
        y += moved * math.sin(angle) + state // 2**15 % 3 - 1
        made.append([i * milliseconds * 1000 // events, round(x), round(y), on])
    return made


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
