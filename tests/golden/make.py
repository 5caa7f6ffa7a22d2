"""Writes the small golden files of operators and networks, layer by layer, for `tests/engine/golden_networks.rs` and `golden_frames.rs`:

    python tests/golden/make.py tests/golden

Events, pictures and weights are drawn. Graphs, splines and poolings are written by hand from their equations, in plain PyTorch, and share
no code with the engine; pictures go through `meissner.torch`. A file has the same names as the larger golden files from real recordings:
integers are I64, everything else F32, and weights are below `w.` unless they are the shipped ones. Edges are (sources, readers).
"""

import re
import sys
from fractions import Fraction
from pathlib import Path

import numpy as np
import torch
import torch.nn.functional as F
from meissner import Description, Weights
from meissner.torch import Module
from safetensors.torch import save_file

SENSOR, SPAN_US, EVENTS, K = (240, 180), 150_000, 56, 16
# On a sensor of 346 x 260 a cell of `graphres` has 16 columns. From this column on, float32 puts some events on the edge of a cell into
# the previous cell.
WIDE_SENSOR, FIRST = (346, 260), 99
# Frame networks, the steps of a sequence (0: single images), and smaller sides of images.
FRAMES = {name: (5, {}) for name in ("slip-best", "slip-regularised", "slip-tuned", "slip-lstm")}
FRAMES |= {name: (3, {}) for name in ("force-cnnlstm", "force-convlstm", "force-lstm", "force-tdnn")}
FRAMES |= {"event-frame-cnn": (0, {})} | {name: (0, {"height": 48, "width": 64}) for name in ("canf", "canf-plain", "canf-live")}
# Networks over events, and the names of their layers' tensors in the larger files; None if these files leave them out.
POOL = {"pool1": None, "fc": None, "grid": "readout"}
POOL |= {f"pool1_{part}": f"pool_{part}" for part in ("x", "pos", "edge_index", "cell")}
LEVELS = {f"conv{i}": None for i in range(1, 11)} | {"conv4": "level0", "conv7": "level1", "conv10": "level2"}
LEVELS |= {"pool1": None, "pool2": None, "hidden": None, "fc": None, "edge_attr": None, "grid": "readout"}
NETWORKS = {"graphres": POOL, "graphres-published": POOL, "tactigraph": LEVELS, "pointnet": POOL | {"edge_attr": None}}


def spline(x, edges, attributes, weight, sizes, root=None, bias=None):
    """Mean over the in-edges of B-spline kernels of degree 1 (SplineCNN, Fey et al. 2018, Eq. 2 to 4), root and bias."""
    source, reader = edges
    found = x.new_zeros(len(x), weight.shape[2])
    place = attributes * (torch.tensor(sizes) - 1)
    low = torch.minimum(place.floor(), torch.tensor(sizes) - 2.0)
    for corner in range(2 ** len(sizes)):
        basis, slot, stride = torch.ones(len(source)), torch.zeros(len(source), dtype=torch.long), 1
        for axis, size in enumerate(sizes):
            if size == 1:
                basis, high = basis * (corner >> axis & 1 == 0), 0
            else:
                high, part = corner >> axis & 1, place[:, axis] - low[:, axis]
                basis, slot = basis * (part if high else 1 - part), slot + stride * (low[:, axis].long() + high)
            stride *= size
        message = basis[:, None] * torch.einsum("ei,eio->eo", x[source], weight[slot])
        found.index_add_(0, reader, message)
    found /= torch.bincount(reader, minlength=len(x)).clamp(min=1)[:, None]
    found = found if root is None else found + x @ root.T
    return found if bias is None else found + bias


def pointnet(x, positions, edges, scale, weight, bias):
    """Maximum over in-edges and the row itself of a linear layer on features and offsets (PointNet++, Qi et al. 2017, section 3.2)."""
    own = torch.arange(len(x))
    source, reader = torch.cat([edges[0], own]), torch.cat([edges[1], own])
    message = torch.cat([x[source], (positions[source] - positions[reader]) / scale], 1) @ weight.T + bias
    return maxima(message, reader, len(x))


def maxima(x, place, places):
    found = torch.full((places, x.shape[1]), -torch.inf)
    for row, at in zip(x, place.tolist()):
        found[at] = torch.maximum(found[at], row)
    return torch.where(found == -torch.inf, 0.0, found)


def pooled(x, positions, edges, cell, origin, columns=None):
    """Cells of the image plane with members: maxima, mean positions, merged edges, numbers row by row."""
    index = ((positions[:, :2] - origin) / torch.tensor(cell)).floor().long()
    columns = columns or int(index[:, 0].max()) + 1
    numbers, member = torch.unique(index[:, 1] * columns + index[:, 0], return_inverse=True)
    means = torch.stack([positions[member == i].mean(0) for i in range(len(numbers))])
    merged = sorted({(int(a), int(b)) for a, b in member[edges].T if a != b})
    merged = torch.tensor(merged, dtype=torch.long).reshape(-1, 2).T
    return maxima(x, member, len(numbers)), means, merged, numbers


def readout(x, positions, origin):
    """Maxima over 4 x 4 parts of the image, part by part."""
    index = ((positions[:, :2] - origin) * 4).floor().long().clamp(0, 3)
    return maxima(x, index[:, 1] * 4 + index[:, 0], 16).flatten()


def graph(events, sensor):
    """The K nearest others of each event, nearest first, a tie to the later one; positions from 0 to 1."""
    raw, scale = events[:, [1, 2, 0]] - [0, 0, events[0, 0]], np.array([*sensor, SPAN_US], np.float64)
    edges = []
    for i, at in enumerate(raw):
        squared = (((raw - at) / scale) ** 2).sum(1)
        edges += [(j, i) for j in sorted(set(range(len(raw))) - {i}, key=lambda j: (squared[j], -j))[:K]]
    return torch.tensor(edges).T, torch.tensor(raw / scale, dtype=torch.float32)


def network(events, sensor, description, tensors):
    """Outputs of all layers of a network over events, by name, with poolings and a readout of 4 x 4 maxima; tensors of a pooling as
    NAME_x, NAME_pos, NAME_edge_index, NAME_cell."""
    said, per_graph = description.summary(), description.summary()["normalisation"] == "per-graph"
    edges, positions = graph(events, sensor)
    origin = positions[:, :2].min(0).values if per_graph else torch.zeros(2)
    scale, x, found = said["graph"]["scale"], torch.tensor(2.0 * events[:, 3:4] - 1, dtype=torch.float32), {"edge_index": edges}
    for layer in said["layers"]:
        name, kind = layer["name"], layer["kind"]
        own = {tensor["name"].removeprefix(f"{name}."): tensors[tensor["name"]] for tensor in said["tensors"] if tensor["layer"] == name}
        own = {full.split(".", 2)[-1] if full.startswith("blocks.") else full: value for full, value in own.items()}
        if kind in ("spline", "pointnet"):
            if kind == "spline":
                offsets = positions[edges[0]] - positions[edges[1]]
                largest = offsets.abs().max() if per_graph else scale
                attributes = (offsets / (2 * largest) + 0.5).clamp(0, 1)
                found.setdefault("edge_attr", attributes)
                value = F.elu(spline(x, edges, attributes, own["conv.weight"], layer["kernel"]))
            else:
                value = F.relu(pointnet(x, positions, edges, scale, own["conv.weight"], own["conv.bias"]))
            norm = [own[f"norm.{part}"] for part in ("running_mean", "running_var", "weight", "bias")]
            x = F.batch_norm(value, *norm, False, 0.0, 1e-5)
            x = x + found[f"{layer['skip']}_x" if layer["skip"].startswith("pool") else layer["skip"]] if layer["skip"] else x
        elif kind == "pool":
            cell = [Fraction(side) for side in layer["cell"]]
            columns = None if per_graph else -(-1 // cell[0])
            x, positions, edges, numbers = pooled(x, positions, edges, [float(side) for side in cell], origin, columns)
            scale = layer["scale"]
            found |= {f"{name}_x": x, f"{name}_pos": positions, f"{name}_edge_index": edges, f"{name}_cell": numbers}
        elif kind == "readout":
            x = readout(x, positions, origin)
        else:
            x = F.linear(x, own["weight"], own.get("bias"))
            x = F.elu(x) if layer["activation"] == "elu" else x
        found[name] = x
    return found | {"events": torch.tensor(events), "y": x}


def drawn(description, random):
    """Weights of the size of trained ones, and batch norms that are not the identity."""
    tensors = {}
    for tensor in description.summary()["tensors"]:
        name, shape = tensor["name"], tensor["shape"]
        part = name.split(".")[-1] if ".norm." in name else ""
        low, high = {"weight": (0.5, 1.5), "bias": (-0.3, 0.3), "running_mean": (-0.5, 0.5), "running_var": (0.3, 2)}.get(part, (-1, 1))
        size = 1.0 if part else (shape[1] if len(shape) > 1 else 8) ** -0.5
        tensors[name] = torch.tensor(random.uniform(low, high, shape) * size, dtype=torch.float32)
    return tensors


def shipped(name):
    (path,) = Path("models/weights").glob(f"*/{name}.0.safetensors")
    return path


def main(folder):
    random = np.random.default_rng(1)

    def save(name, tensors):
        save_file({key: value.detach().clone().contiguous() for key, value in tensors.items()}, folder / f"{name}.safetensors")

    for i, (kernel, inputs, outputs, has_root) in enumerate([([2, 2, 2], 1, 8, 0), ([2, 2, 2], 8, 16, 0), ([5, 5], 4, 6, 0), ([2, 3, 4], 5, 7, 1)]):
        edges = torch.from_numpy(random.integers(0, 12, (2, 70)))
        edges[:, edges[1] == 11] = 0  # row 11 has no in-edge
        attributes = torch.tensor(random.random((70, len(kernel))), dtype=torch.float32)
        attributes[:6] = torch.tensor([0.0, 1.0, 0.5, 1e-7, 1 - 1e-7, 0.25])[:, None]
        normal = lambda *shape: torch.tensor(random.normal(size=shape), dtype=torch.float32)
        given = {"x": normal(12, inputs), "weight": normal(int(np.prod(kernel)), inputs, outputs)}
        extra = {"root": normal(outputs, inputs), "bias": normal(outputs)} if has_root else {}
        found = spline(given["x"], edges, attributes, given["weight"], kernel, **extra)
        save(f"spline_conv_{i}_small", given | extra | {"edge_index": edges, "edge_attr": attributes, "y": found})
    positions, x = torch.tensor(random.random((60, 3)), dtype=torch.float32), normal(60, 12)
    edges = torch.from_numpy(random.integers(0, 60, (2, 300)))
    found = dict(zip(("pool_x", "pool_pos", "pool_edge_index", "cell"), pooled(x, positions, edges, (1 / 8, 1 / 6), torch.zeros(2), 8)))
    save("voxel_pool_small", {"x": x, "pos": positions, "edge_index": edges} | found)

    # Time, position and polarity of each event: a bar that moves, and some noise.
    t_us = np.sort(random.integers(0, SPAN_US * 3 // 4, EVENTS)) + 5_000_000
    bar = 40 + (t_us - t_us[0]) // 1000 + random.integers(-6, 7, EVENTS)
    columns = np.where(random.random(EVENTS) < 0.8, bar, random.integers(0, 240, EVENTS))
    events = np.stack([t_us, columns, random.integers(20, 160, EVENTS), random.integers(0, 2, EVENTS)], 1)
    for name, layers in NETWORKS.items():
        has_own = name == "pointnet"
        description = Description("tests/pointnet.toml" if has_own else f"models/networks/{name}.toml")
        tensors = drawn(description, random) if has_own else {key: torch.from_numpy(np.array(value)) for key, value in Weights(shipped(name)).items()}
        found = network(events, SENSOR, description, tensors)
        kept = {layers.get(key, key): value for key, value in found.items() if layers.get(key, key)}
        save(f"{name.replace('-', '_')}_small", kept | ({f"w.{key}": value for key, value in tensors.items()} if has_own else {}))
        if name == "graphres-published":
            events_on_edges = events.copy()
            events_on_edges[:, 1] = FIRST + 16 * (events[:, 1] // 17) + random.integers(0, 2, EVENTS)
            events_on_edges[0, 1] = FIRST
            found = network(events_on_edges, WIDE_SENSOR, description, tensors)
            save("graphres_published_offgrid_small", {layers.get(key, key): value for key, value in found.items() if layers.get(key, key)})

    for name, (steps, sides) in FRAMES.items():
        text = Path(f"models/networks/{name}.toml").read_text()
        for key, side in sides.items():
            text = re.sub(rf"^{key} = \d+$", f"{key} = {side}", text, flags=re.M)
        module = Module.from_description(Description(text), shipped(name)).eval()
        shape = (1, *[steps] * (steps > 0), *module.said["input"])
        # Counts, as most of these networks read; fractions for readings and pictures.
        x = random.poisson(0.3, shape).astype("u1") if name.startswith(("force", "event")) else random.normal(size=shape).astype("f4")
        found = module(torch.tensor(x, dtype=torch.float32), last=name.startswith("slip"))
        save(f"{name.replace('-', '_')}_small", {"x": torch.tensor(x), "y": found})


if __name__ == "__main__":
    torch.set_num_threads(1)
    with torch.no_grad():
        main(Path(sys.argv[1]))
