"""Writes the results of PyTorch for the streams and readings in the golden files again, with the shipped weights, for
`tests/engine/trained.rs`:

    python models/train/golden.py tests/golden

Each of digits.json, angles.json, touch.json, force.json and slip.json keeps its streams and the names of its networks. These are not from a
sensor: they were made once, by formulas. The streams of force.json are those of angles.json.
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import torch
from meissner import frames_for
from meissner.torch import Module
from shared import prepared

# Any object of Basic, because the layout of a data set requires one.
RECORDING = Path("n/pen0.csv")


def shipped(name):
    (path,) = Path("models/weights").glob(f"*/{name}.0.safetensors")
    return Module.from_description(name, path).eval()


def of_streams(name, sensor, streams):
    """Values at the end of each stream."""
    module, streams = shipped(name), [np.array(stream) for stream in streams]
    return module(module.graphs(sensor, streams).batch(range(len(streams)))).tolist()


def of_counts(name, sensor, stream):
    """Forces at the end of each frame of a stream, the last of which has only begun."""
    frames, (t, x, y, p) = frames_for(name, sensor), np.array(stream).T
    counts = [frame.values for frame in frames.push(t=t, x=x, y=y, p=p) for _ in range(frame.count)]
    counts.append(frames.open().values)
    return shipped(name)(torch.from_numpy(np.stack(counts))[None])[0, :, 0].tolist()


def of_readings(name, readings):
    """Logits of each window of readings of electrodes."""
    with tempfile.TemporaryDirectory() as folder:
        csv = Path(folder) / RECORDING
        csv.parent.mkdir()
        header = ",".join(f"e{electrode + 1}" for electrode in range(24))
        csv.write_text("\n".join([header, *(",".join(map(str, row)) for row in readings)]) + "\n")
        found, _ = prepared("slip", folder, "--network", name)
    return shipped(name)(torch.from_numpy(found["frames"]), last=True).tolist()


@torch.no_grad()
def main(folder):
    known = {name: json.loads((folder / f"{name}.json").read_text()) for name in ("digits", "angles", "touch", "force", "slip")}
    sensor, streams = known["angles"]["sensor"], known["angles"]["streams"]
    for name in "digits", "angles", "touch":
        own = known[name]
        own["logits"] = {network: of_streams(network, own["sensor"], own["streams"]) for network in own["logits"]}
    for network in known["force"]["forces"]:
        is_graph = network == "force-graph"
        found = of_streams(network, sensor, streams) if is_graph else [of_counts(network, sensor, stream) for stream in streams]
        known["force"]["forces"][network] = found
    known["slip"]["logits"] = {network: of_readings(network, known["slip"]["readings"]) for network in known["slip"]["logits"]}
    for name, found in known.items():
        (folder / f"{name}.json").write_text(json.dumps(found) + "\n")


if __name__ == "__main__":
    torch.set_num_threads(1)
    main(Path(sys.argv[1]))
