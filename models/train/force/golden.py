"""Writes what PyTorch makes of streams of events that no sensor made, with the shipped weights, for a test:

    python models/train/force/golden.py tests/golden/force.json

The streams are those of tests/golden/angles.json, which stand in no set of recordings.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
from networks import NETWORKS, SIDE
from safetensors.torch import load_file
from train import MAXIMUM

FOLDER = Path(__file__).resolve().parents[1]
sys.path.append(str(FOLDER))
import shared

PERIOD_US = 10_000
GRAPH = "force-graph"


@torch.no_grad()
def main():
    args = arguments()
    given = json.loads(args.streams.read_text())
    sensor, streams = given["sensor"], [np.array(stream) for stream in given["streams"]]
    forces = {}
    for name, network in NETWORKS.items():
        network = network()
        network.load_exported({name: tensor.float() for name, tensor in load_file(args.weights / f"{name}.0.safetensors").items()})
        forces[name] = [network(frames(stream, sensor)[None])[0].tolist() for stream in streams]
    forces[GRAPH] = of_graph(args, sensor, streams)
    shared.write(args.out, {"forces": forces})


def frames(stream, sensor):
    """Counts of the events of each window of 10 ms from the first event on, in the middle of the sensor."""
    t_us, x, y, on = stream.T
    frame = (t_us - t_us[0]) // PERIOD_US
    x, y = (place - (side - SIDE) // 2 for place, side in zip((x, y), sensor))
    inside = (x >= 0) & (x < SIDE) & (y >= 0) & (y < SIDE)
    counts = np.zeros((frame[-1] + 1, 2, SIDE, SIDE), np.float32)
    np.add.at(counts, tuple(column[inside] for column in (frame, on, y, x)), 1)
    return torch.from_numpy(counts / np.float32(MAXIMUM))


def of_graph(args, sensor, streams):
    """The force at the end of each stream."""
    # That of the angles has modules with the names of this folder's.
    sys.path.insert(0, str(FOLDER / "angle"))
    from graphs import Graphs, inspected
    from network import load

    said = inspected(args.meissner, args.description)
    ends = np.array([[stream[-1][0]] for stream in streams])
    with tempfile.TemporaryDirectory() as folder:
        graphs = Graphs(args.meissner, args.description, said, sensor, streams, folder)
        network = load(args.weights / f"{GRAPH}.0.safetensors", said)
        return network(graphs.part(range(len(streams))).read(ends)).tolist()


def arguments():
    parser = shared.parser(__doc__, "force", out=None)
    parser.add_argument("--streams", type=Path, default=Path("tests/golden/angles.json"), help="default: %(default)s")
    parser.add_argument("--description", default=f"models/networks/{GRAPH}.toml", help="default: %(default)s")
    return parser.parse_args()


if __name__ == "__main__":
    torch.set_num_threads(1)
    main()
