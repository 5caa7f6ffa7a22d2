"""The window that `--example window` exports: a safetensors file of f32 tensors."""
import json
import struct

import numpy as np


class Window:
    """Events, graph, weights and the expected answers.

    near        (n, k) int64, in-edges in neighbourhood order
    positions   (n, 3) f32, in shares of sensor and span
    polarity    (n, 1) f32, -1 or +1
    attributes  (n, k, 3) f32, in [0, 1]
    conv5       (n, 32) f32, what the fifth block must give
    prediction  what the whole network must give
    """

    def __init__(self, path):
        with open(path, "rb") as file:
            (length,) = struct.unpack("<Q", file.read(8))
            header = json.loads(file.read(length))
            data = file.read()
        self.about = header.pop("__metadata__", {})
        self.tensors = {}
        for name, entry in header.items():
            assert entry["dtype"] in ("F32", "I64"), (name, entry["dtype"])
            kind = np.float32 if entry["dtype"] == "F32" else np.int64
            start, end = entry["data_offsets"]
            self.tensors[name] = np.frombuffer(data[start:end], kind).reshape(entry["shape"]).copy()
        part = {name[7:]: t for name, t in self.tensors.items() if name.startswith("window.")}
        self.near = part["near"].astype(np.int64)
        self.positions, self.polarity = part["positions"], part["polarity"]
        self.attributes, self.conv5, self.prediction = part["attributes"], part["conv5"], part["prediction"]
        self.scale, self.pooled_scale = float(self.about["scale"]), float(self.about["pooled_scale"])


def agree(what, got, expected, tolerance=1e-5):
    """Stops if `got` differs from `expected` by more than `tolerance` of its largest magnitude."""
    error = np.abs(got - expected).max() / np.abs(expected).max()
    if not error <= tolerance:
        raise SystemExit(f"{what}: differs by {error:.1e} of the largest magnitude, {tolerance:.0e} is allowed")
