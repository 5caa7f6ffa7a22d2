"""From a trained model of PyTorch Geometric to a running engine.

    from meissner.export import Add, Pool, Readout, compare, export

    model.eval()
    description, weights = export(
        [model.conv1, model.elu, model.norm1, model.conv2, model.elu, model.norm2, Add("conv1"), Readout(4, 4), model.fc],
        graph={"kind": "knn", "k": 8, "candidates": "past", "lifetime": "frozen", "scale": 0.2},
        span_us=50_000, capacity=2048, outputs=["roll", "pitch"], unit="rad",
    )
    engine = meissner.Engine(description, sensor, weights)
    assert compare(engine, lambda graph: model(graph.x, graph.edge_index, graph.edge_attr), events) < 1e-4

The list contains the modules in the order of computation: `SplineConv` or `PointNetConv`, its `ELU` or `ReLU`, its batch
norm; `Linear` with its activation at the end. Steps that are not modules have a class here: `Pool` for voxel pooling, `Readout` for the
maximum over a grid of the image, `Add` for a skip connection. Modules are recognised by the names of their classes, so neither torch
nor torch_geometric is imported until values are read.

An order or an option that an engine does not compute raises `meissner.DescriptionError` with the index in the list.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from fractions import Fraction
from typing import Any

import numpy as np

from ._errors import DescriptionError, InputError
from ._meissner import Description, Engine, Weights

__all__ = ["Add", "Pool", "Readout", "compare", "export"]

# An engine adds this value to a variance.
_EPSILON = 1e-5
# Modules that change nothing in a trained model.
_IGNORED = ("Dropout", "Identity", "Flatten")


@dataclass(frozen=True)
class Pool:
    """Maximum over the voxels of a grid with origin 0.

    `cell` is the size along x and y as a share of the sensor, "16/346" or a `Fraction`; `time` is the size along t as a share of
    the span, None for one cell. `position` is "mean" (of the members) or "centre". `scale` is the scale of the edge attributes after it.
    """

    cell: tuple[str | Fraction, str | Fraction]
    scale: float
    time: str | Fraction | None = None
    position: str = "mean"


@dataclass(frozen=True)
class Readout:
    """Maximum, or sum, over `columns` x `rows` cells of the image; an empty cell is 0. The linear layers read cell after cell."""

    columns: int
    rows: int
    aggregation: str = "max"


@dataclass(frozen=True)
class Add:
    """Adds the output of the layer `layer` to the output of the previous block: a skip connection."""

    layer: str


def export(
    stages: Iterable[Any],
    *,
    graph: Mapping[str, Any],
    outputs: Sequence[str] | None = None,
    unit: str | Sequence[str] = "1",
    classes: Sequence[str] | None = None,
    name: str = "exported",
    span_us: int = 150_000,
    capacity: int = 32_768,
    metadata: Mapping[str, str] | None = None,
) -> tuple[Description, Weights]:
    """The description and the weights of a model, for `meissner.Engine`.

    - `stages`: modules and `Pool`, `Readout`, `Add`, in the order of evaluation; a pair (name, module) names a layer. Other
      layers are called conv1, conv2, pool1, dense1 and so on.
    - `graph`: the table `[graph]` of a description, with the `scale` of the edge attributes of the training.
    - `outputs` with `unit`, or `classes` for logits.
    - `metadata` of the weights, such as `{"trained": "true", "about": "..."}`: without `trained` they do not state whether they are.

    Raises `DescriptionError` for modules and options that an engine does not compute, `WeightsError` for values that are not finite.
    """
    builder = _Builder()
    for place, stage in enumerate(stages):
        given, module = stage if isinstance(stage, tuple) and isinstance(stage[0], str) else (None, stage)
        builder.place = f"stage {place} ({type(module).__name__})"
        builder.add(given, module)
    predicted = {"classes": list(classes)} if classes is not None else {"names": list(outputs or []), "unit": _unit(unit)}
    description = Description(
        {
            "network": {"name": name, "span_us": span_us, "capacity": capacity},
            "graph": dict(graph),
            "layer": builder.layers,
            "output": predicted,
        }
    )
    # The modules do not show whether they were ever trained.
    texts = {"network": name, **(metadata or {})}
    preparation = description.summary().get("preparation")
    if preparation is not None:
        texts.setdefault("preparation", preparation)
    return description, Weights(builder.tensors, texts)


def compare(engine: Engine, forward: Callable[[Any], Any], events: Any) -> float:
    """The largest difference between the predictions of `engine` and of `forward` after `events`, relative to the largest value.

    `forward` gets an object with the torch tensors x, edge_index, edge_attr and pos of the window, and returns the outputs. The
    engine is reset first, and contains the events afterwards. With frozen in-edges the events must not be longer than the window:
    a model does not see events that have left the window. A difference of about 1e-6 is the rounding of float32; more than 1e-4 means a
    different computation.
    """
    import torch

    engine.reset()
    accepted = engine.push(events)
    if len(engine) < accepted:
        raise InputError(f"events: expected at most one window, found {accepted} events of which {len(engine)} are in it")
    found = engine.predict().values
    graph = engine.graph()
    fields = {field: torch.from_numpy(getattr(graph, field)) for field in ("x", "edge_index", "edge_attr", "pos")}
    with torch.no_grad():
        expected = forward(type("Graph", (), fields)()).detach().cpu().double().numpy().reshape(-1)
    if expected.shape != found.shape:
        raise InputError(f"forward: expected {found.size} outputs, found {expected.size}")
    return float(np.abs(expected - found).max() / max(np.abs(expected).max(), np.finfo(np.float32).tiny))


class _Builder:
    """Collects layers and tensors."""

    def __init__(self) -> None:
        self.layers: list[dict[str, Any]] = []
        self.tensors: dict[str, np.ndarray] = {}
        self.place = ""
        self.counts: dict[str, int] = {}
        # Modules that may follow the last layer: the activation and the batch norm of its block, in this order.
        self.open: list[str] = []

    def refuse(self, expected: str, found: Any) -> DescriptionError:
        return DescriptionError(f"{self.place}: expected {expected}, found {found}")

    def layer(self, given: str | None, stem: str, **keys: Any) -> str:
        self.close()
        self.counts[stem] = self.counts.get(stem, 0) + 1
        name = given or f"{stem}{self.counts[stem]}"
        self.layers.append({"name": name, **keys})
        return name

    def close(self) -> None:
        """Marks a last block without an activation or a batch norm as such."""
        if self.layers and self.layers[-1]["kind"] == "block":
            block = self.layers[-1]
            if "relu" in self.open:
                raise self.refuse("a ReLU after the PointNetConv before", "none")
            if "elu" in self.open:
                block["elu"] = False
            if "norm" in self.open:
                block["norm"] = False
        self.open = []

    def last(self, *kinds: str) -> dict[str, Any]:
        if not self.layers or self.layers[-1]["kind"] not in kinds:
            before = self.layers[-1]["kind"] if self.layers else "nothing"
            raise self.refuse(f"it after a layer of kind {' or '.join(kinds)}", f"{before} before it")
        return self.layers[-1]

    def add(self, given: str | None, module: Any) -> None:
        if isinstance(module, Pool):
            cell, time = [str(side) for side in module.cell], None if module.time is None else str(module.time)
            self.layer(given, "pool", kind="pool", cell=cell, time=time, position=module.position, scale=module.scale)
            return
        if isinstance(module, Readout):
            grid = [module.columns, module.rows]
            self.layer(given, "readout", kind="readout", grid=grid, aggregation=module.aggregation)
            return
        if isinstance(module, Add):
            block = self.last("block")
            if "skip" in block:
                raise self.refuse("one skip connection a block", f"{block['skip']!r} before it")
            self.close()
            block["skip"] = module.layer
            return
        kinds = {kind.__name__ for kind in type(module).__mro__}
        if "SplineConv" in kinds:
            self.spline(given, module)
        elif kinds & {"PointNetConv", "PointConv"}:
            self.pointnet(given, module)
        elif kinds & {"BatchNorm1d", "BatchNorm"}:
            self.norm(getattr(module, "module", module))
        elif kinds & {"ELU", "ReLU"}:
            self.activation("elu" if "ELU" in kinds else "relu", module)
        elif "Linear" in kinds:
            self.dense(given, module)
        elif not kinds.intersection(_IGNORED):
            expected = "SplineConv, PointNetConv, BatchNorm, ELU, ReLU, Linear, Pool, Readout or Add"
            raise self.refuse(expected, type(module).__name__)

    def spline(self, given: str | None, conv: Any) -> None:
        if getattr(conv, "degree", 1) != 1:
            raise self.refuse("splines of degree 1", conv.degree)
        if not bool(np.all(_array(getattr(conv, "is_open_spline", 1)))):
            raise self.refuse("open splines", conv.is_open_spline)
        self.aggregation(conv, "mean")
        kernel = [int(size) for size in np.atleast_1d(_array(conv.kernel_size))]
        if len(kernel) not in (2, 3):
            raise self.refuse("pseudo-coordinates (x, y) or (x, y, t)", f"{len(kernel)} of them")
        root, bias = getattr(conv, "lin", None), getattr(conv, "bias", None)
        keys = {"channels": int(conv.weight.shape[-1]), "kernel": kernel}
        name = self.layer(
            given, "conv", kind="block", conv="spline", root=root is not None, bias=bias is not None, **keys
        )
        self.tensors[f"{name}.conv.weight"] = _array(conv.weight)
        if root is not None:
            self.tensors[f"{name}.conv.lin.weight"] = _array(root.weight)
        if bias is not None:
            self.tensors[f"{name}.conv.bias"] = _array(bias)
        self.open = ["elu", "norm"]

    def pointnet(self, given: str | None, conv: Any) -> None:
        self.aggregation(conv, "max")
        if getattr(conv, "global_nn", None) is not None:
            raise self.refuse("a PointNetConv without a global_nn", "one")
        if not getattr(conv, "add_self_loops", True):
            raise self.refuse("a PointNetConv with add_self_loops", "one without")
        linear = conv.local_nn
        if type(linear).__name__ == "Sequential" and len(linear) == 1:
            linear = linear[0]
        if type(linear).__name__ != "Linear":
            raise self.refuse("one Linear as the local_nn", type(linear).__name__)
        name = self.layer(given, "conv", kind="block", conv="pointnet", channels=int(linear.weight.shape[0]))
        self.tensors[f"{name}.conv.weight"] = _array(linear.weight)
        outputs = linear.weight.shape[0]
        self.tensors[f"{name}.conv.bias"] = np.zeros(outputs, "f4") if linear.bias is None else _array(linear.bias)
        self.open = ["relu", "norm"]

    def aggregation(self, conv: Any, expected: str) -> None:
        found = getattr(conv, "aggr", expected)
        if isinstance(found, str) and found != expected:
            raise self.refuse(f"aggregation {expected!r}", repr(found))

    def activation(self, word: str, module: Any) -> None:
        layer = self.last("block", "dense")
        if word == "elu" and getattr(module, "alpha", 1.0) != 1.0:
            raise self.refuse("an ELU with alpha 1", module.alpha)
        if layer["kind"] == "dense":
            if "activation" not in self.open:
                raise self.refuse("one activation a Linear", "another one")
            layer["activation"], self.open = word, []
        elif self.open[:1] == [word]:
            self.open = self.open[1:]
        else:
            convolution, expected = layer["conv"], "ELU" if layer["conv"] == "spline" else "ReLU"
            raise self.refuse(f"{expected} right after the {convolution} convolution, and once", word.upper())

    def norm(self, norm: Any) -> None:
        block = self.last("block")
        if "norm" not in self.open:
            raise self.refuse("one batch norm a block", "another one")
        if norm.running_var is None:
            raise self.refuse("a batch norm with running statistics", "one without")
        if "relu" in self.open:
            raise self.refuse("a ReLU before the batch norm of a PointNetConv", "none")
        if "elu" in self.open:
            block["elu"] = False
        self.open = []
        name, channels = block["name"], norm.running_mean.shape[0]
        ones, zeros = np.ones(channels, "f4"), np.zeros(channels, "f4")
        self.tensors[f"{name}.norm.weight"] = ones if norm.weight is None else _array(norm.weight)
        self.tensors[f"{name}.norm.bias"] = zeros if norm.bias is None else _array(norm.bias)
        self.tensors[f"{name}.norm.running_mean"] = _array(norm.running_mean)
        # An engine adds its own epsilon to the variance.
        variance = _array(norm.running_var).astype("f8") + (norm.eps - _EPSILON)
        if (variance < 0).any():
            raise self.refuse(f"variances of at least {_EPSILON} with epsilon", variance.min() + _EPSILON)
        self.tensors[f"{name}.norm.running_var"] = variance if norm.eps != _EPSILON else _array(norm.running_var)

    def dense(self, given: str | None, linear: Any) -> None:
        self.last("readout", "dense")
        bias = getattr(linear, "bias", None)
        outputs = int(linear.weight.shape[0])
        name = self.layer(given, "dense", kind="dense", outputs=outputs, bias=bias is not None)
        self.tensors[f"{name}.weight"] = _array(linear.weight)
        if bias is not None:
            self.tensors[f"{name}.bias"] = _array(bias)
        self.open = ["activation"]


def _array(values: Any) -> np.ndarray:
    """A tensor, or any input of NumPy, as an array."""
    if hasattr(values, "detach"):
        values = values.detach().cpu()
        return (values.float() if values.is_floating_point() else values).numpy()
    return np.asarray(values)


def _unit(unit: str | Sequence[str]) -> str | list[str]:
    return unit if isinstance(unit, str) else list(unit)
