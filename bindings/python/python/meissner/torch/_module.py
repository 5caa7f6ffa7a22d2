"""A described network as a module of PyTorch."""

from __future__ import annotations

from collections.abc import Mapping

import torch
from torch import nn

from .. import Description, InputError, Weights, WeightsError
from . import _layers
from ._graphs import Batch, Graphs, SlidingFrames


class _Tensors(nn.Module):
    """Tensors, and other `_Tensors` below a prefix. Names are looked up in dicts, because a layer may be called `train`."""


class Module(nn.Module):
    """The network of a description, over a `Batch` of graphs or over frames, with the engine's names in its state dict.

    Sums run in another order than the engine's, so values agree to about 1e-6 of the largest. The parameters may have other units
    than the engine's tensors, because small outputs of large weights train slowly: outputs are in units of `unit`, and the input of
    a layer is multiplied by its `gain`. The state dict always has the engine's tensors.
    """

    def __init__(self, network, *, unit=1.0, gain=None, dropout=None):
        super().__init__()
        self.description = network if isinstance(network, Description) else Description(network)
        self.said = said = self.description.summary()
        self.over_events, self.is_image = "graph" in said, bool(said.get("head"))
        self.layers = {layer["name"]: layer for layer in said["layers"] + (said.get("head") or [])}
        self.first, self.last = ("events" if self.over_events else "frame"), list(self.layers)[-1]
        self.parts = {name: {} for name in self.layers}
        for tensor in said["tensors"]:
            self._add(tensor)
        self.gain, self.dropout, self.frozen_norms, self.batches = dict(gain or {}), dict(dropout or {}), False, None
        self.register_buffer("_unit", torch.as_tensor(unit, dtype=torch.float32).expand(len(said["outputs"])).clone(), False)
        self._has_unit, end = bool((self._unit != 1).any()), self.layers[self.last]
        if self._has_unit and (end.get("norm") or end.get("activation") == "elu"):
            raise InputError(f"unit: expected a last layer without batch norm and ELU, found that of {said['name']!r}")
        blocks = [layer for layer in self.layers.values() if layer["kind"] in ("spline", "pointnet")]
        self.levels = 1 + sum(layer["kind"] == "pool" for layer in self.layers.values())
        self.levels_read = {layer["level"] for layer in blocks}
        memory = [i for i, layer in enumerate(self.layers.values()) if layer["kind"] in _layers.MEMORY]
        self.remembers = list(self.layers)[memory[-1]] if memory else None

    @classmethod
    def from_description(cls, network, weights=None, *, seed=0, unit=1.0, gain=None, dropout=None):
        """The network that `network` names or describes, any input of `meissner.Description`.

        `weights` is any input of `meissner.Weights`; without it, the tensors are drawn from `seed`. `unit` is the size of the outputs in
        training, one number or one for each output; `gain` is a factor of a layer's input, and `dropout` a share of it, both by the name
        of the layer.

        Raises `DescriptionError`, `WeightsError`."""
        module = cls(network, unit=unit, gain=gain, dropout=dropout)
        return module.draw(seed) if weights is None else module.load(weights)

    def _add(self, tensor):
        name, layer = tensor["name"], self.layers[tensor["layer"]]
        *path, last = name.split(".")
        node = self
        for part in path:
            node = node._modules.setdefault(part, _Tensors())
        values = torch.zeros(tensor["shape"])
        if last in ("running_mean", "running_var"):
            node._buffers[last] = values
        else:
            node._parameters[last] = nn.Parameter(values)
        part, kind = self.parts[layer["name"]], layer["kind"]
        if not part:
            first = _layers.FIRST.get(kind, f"weight_ih_l{layer['layer']}" if kind == "lstm" else "weight")
            self._prefix = name.removesuffix(first)
        normed = f"{layer['norm']}." if isinstance(layer.get("norm"), str) else None
        if normed and name.startswith(normed) and name != f"{self._prefix}weight":
            part[f"norm.{name.removeprefix(normed)}"] = name
        else:
            part[name.removeprefix(self._prefix)] = name

    def __getitem__(self, name):
        """The parameter or the statistics with one of the engine's names, in the units of the training."""
        *path, last = name.split(".")
        node = self
        for part in path:
            node = node._modules[part]
        found = node._parameters.get(last)
        return node._buffers[last] if found is None else found

    @property
    def unit(self):
        """(outputs,), the units of the outputs during training."""
        return self._unit

    @property
    def reads_any_time(self):
        """Whether one graph of a stream can be read at any of its times: its rows always read only earlier rows, never cells."""
        return not self.over_events or (self.levels == 1 and self.said["graph"]["lifetime"] == "frozen")

    def names(self, *layers):
        """The names of the tensors of some layers."""
        return [name for layer in layers for name in self.parts[layer].values()]

    def up_to(self, name):
        """The names of all layers up to one, in the order of evaluation: `up_to("grid")` are the layers of events."""
        names = list(self.layers)
        return names[: names.index(name) + 1]

    def state_dict(self, *args, prefix="", **settings):
        """The engine's tensors by their names."""
        return self._scale(super().state_dict(*args, prefix=prefix, **settings), prefix, 1)

    def _load_from_state_dict(self, state_dict, prefix, *others):
        super()._load_from_state_dict(self._scale(state_dict, prefix, -1), prefix, *others)

    def _scale(self, state, prefix, power):
        """Converts the tensors of a state dict to the engine's units (`power` 1) or from them (-1)."""
        factors = {self.parts[name]["weight"]: factor for name, factor in self.gain.items()}
        unit = self._unit.to("cpu") if power < 0 else self._unit
        if self._has_unit:
            factors |= {name: factors.get(name, 1.0) * unit for name in self.parts[self.last].values()}
        for name, factor in factors.items():
            if prefix + name in state:
                tensor = state[prefix + name]
                factor = torch.as_tensor(factor).to(tensor)
                factor = factor.view(-1, *[1] * (tensor.dim() - 1)) if factor.dim() else factor
                state[prefix + name] = tensor * factor if power > 0 else tensor / factor
        return state

    @torch.no_grad()
    def load(self, weights, layers=None):
        """Copies `weights`, any input of `meissner.Weights`, or only those of some layers. Raises `WeightsError`."""
        given = weights if isinstance(weights, (Weights, Mapping)) else Weights(weights)
        needed = self.names(*(self.layers if layers is None else layers))
        state, problems = {}, []
        for name in needed:
            shape, tensor = tuple(self[name].shape), given[name] if name in given else None
            if tensor is None or tuple(tensor.shape) != shape:
                problems.append(f"{name}: expected shape {shape}, found {'no such tensor' if tensor is None else tuple(tensor.shape)}")
            else:
                state[name] = torch.as_tensor(tensor).detach().float()
        if problems:
            raise WeightsError("\n".join([f"weights of network {self.said['name']!r}:", *problems]))
        self.load_state_dict(state, strict=False)
        return self

    @torch.no_grad()
    def draw(self, seed=0, he=False):
        """Draws tensors from a seed: splines with the variance of He et al. (2015), everything else as in PyTorch. With `he`, all
        convolutions and dense layers have that variance, and biases are 0."""
        generator = torch.Generator().manual_seed(seed)
        for name, layer in self.layers.items():
            bound = None
            for part, full in self.parts[name].items():
                tensor, last = self[full].cpu(), part.split(".")[-1]
                if layer["kind"] == "spline" and part in ("conv.weight", "conv.lin.weight"):
                    tensor.normal_(0, (2 / layer["inputs"]) ** 0.5, generator=generator)
                elif part == "peephole" or part in ("norm.bias", "norm.running_mean") or (he and last == "bias"):
                    tensor.zero_()
                elif part in ("norm.weight", "norm.running_var"):
                    tensor.fill_(1)
                else:
                    if tensor.dim() > 1:
                        inputs = tensor[0].numel() if layer["kind"] != "upconv" else tensor.shape[1] * 4
                        bound = (layer["hidden"] if layer["kind"] == "lstm" else inputs) ** -0.5
                    if he and tensor.dim() > 1:
                        tensor.normal_(0, 2**0.5 * bound, generator=generator)
                    else:
                        tensor.uniform_(-bound, bound, generator=generator) if bound else tensor.zero_()
                self[full].copy_(tensor)
        return self

    def graphs(self, sensor, streams):
        """The network's input from `streams` on a sensor (width, height): `Graphs`, or `SlidingFrames` for a frame network."""
        return (Graphs if self.over_events else SlidingFrames)(self, sensor, streams)

    def forward(self, given, last=False):
        """Values of the last layer for a `Batch` (readouts, outputs), or for frames (n, ...) or (streams, steps, ...), which begin
        without memory: (n, outputs) or (streams, steps, outputs). With `last`, only the last step: (streams, outputs)."""
        return self.values(given, last=last)

    def values(self, given, wanted=None, last=False):
        """Like `forward`, for the layer `wanted`, from a batch, frames, or a dict with the values of other layers by name."""
        wanted = wanted or self.last
        batch = given if isinstance(given, Batch) else None
        done = {"events": batch.input} if batch else dict(given) if isinstance(given, Mapping) else {self.first: given}
        steps = None
        if not self.over_events:
            ranks = {self.first: len(self.said["input"])} | {name: len(layer["output"]) for name, layer in self.layers.items()}
            for name, value in done.items():
                if value.dim() == ranks[name] + 2:
                    steps, done[name] = tuple(value.shape[:2]), value.flatten(0, 1)
        order, before = self._needed(done, wanted), set()
        # Only layers with a memory, and the layers that they depend on, are computed for all steps.
        for name in reversed(order if last and steps else []):
            if name in before or self.layers[name]["kind"] in _layers.MEMORY:
                before |= {name, *_reads(self.layers[name])}
        for name in sorted(order, key=lambda name: name not in before):
            if last and steps and name not in before:
                done, steps = {key: value.unflatten(0, steps)[:, -1] for key, value in done.items()}, None
            layer = self.layers[name]
            done[name] = self._layer(layer, [done[read] for read in _reads(layer)], batch, steps)
        found = done[wanted].unflatten(0, steps) if steps else done[wanted]
        return found[:, -1] if last and steps else found

    def _needed(self, done, wanted):
        """The layers that `wanted` depends on, except those already computed."""
        needed = {wanted} - done.keys()
        for name in reversed(list(self.layers)):
            if name in needed:
                needed |= {read for read in _reads(self.layers[name]) if read not in done}
        unknown = needed - self.layers.keys()
        if unknown:
            raise InputError(f"expected values of {sorted(unknown)}, or of layers behind them, found those of {sorted(done)}")
        return [name for name in self.layers if name in needed]

    def _layer(self, layer, read, batch, steps):
        kind, x = layer["kind"], read[0]
        if kind in ("spline", "pointnet"):
            x = getattr(_layers, kind)(self, layer, x, batch.levels[layer["level"]])
            return x + read[1] if layer["skip"] else x
        if kind == "pool":
            level = batch.levels[layer["level"]]
            return _layers.maxima(x.index_select(0, level.row), level.place, len(level.source))
        if kind == "readout":
            return _layers.readout(self, layer, x, batch)
        if kind in _layers.MEMORY:
            x = x.unflatten(0, steps) if steps else x[:, None]
            return _layers.OF_FRAMES[kind](self, layer, x).flatten(0, 1)
        x = _layers.OF_FRAMES[kind](self, layer, *read)
        return x * (self._unit.view(-1, *[1] * (x.dim() - 2)) if kind == "conv" else self._unit) if layer["name"] == self.last else x


def _reads(layer):
    """The names of the layers that a layer reads."""
    return [name for name in (layer["from"], layer.get("skip"), layer.get("with")) if isinstance(name, str)]
