"""Weights as the engine reads them: safetensors, with what was done in the metadata."""

from __future__ import annotations

import datetime
import json
import os
from collections.abc import Mapping
from pathlib import Path

import torch
from safetensors import torch as tensors

from .. import Description, Engine, FrameEngine, Weights, WeightsError

# Of a tensor with fewer values, half precision saves nothing worth having; batch norm's are among them.
_MIN_HALVED = 256


def save(source, path, remarks=(), *, network=None, names=None, half=False):
    """Writes the weights of `source`, a module or a state dict, for `network`, by default that of a `Module`.

    `remarks` are metadata (texts, or what JSON can say) beside the network's name, its preparation, `trained` and the date. `names`
    renames tensors by prefix, the longest first. With `half`, large tensors are in half precision. The file is replaced whole, and only
    by weights that an engine takes.

    Returns the names of tensors that the network does not read. Raises `WeightsError` with every tensor that does not fit."""
    description = Description(source.description if network is None else network)
    state = source.state_dict() if hasattr(source, "state_dict") else source
    found, spare = fitting(renamed(state, names or {}), description)
    if half:
        found = {name: tensor.half() if tensor.numel() >= _MIN_HALVED else tensor for name, tensor in found.items()}
        # What half precision cannot hold is infinite now.
        fitting(found, description)
    metadata, preparation = {"network": description.name, "trained": "true"}, description.summary().get("preparation")
    metadata |= {"date": datetime.date.today().isoformat()} | ({"preparation": preparation} if preparation else {})
    metadata |= {key: value if isinstance(value, str) else json.dumps(value) for key, value in dict(remarks).items()}
    found = {name: tensor.contiguous() for name, tensor in found.items()}
    # What an engine refuses is not written. Any sensor does: the one of the metadata is no part of this.
    bare, made = Weights(tensors.save(found, {"preparation": preparation} if preparation else None)), tensors.save(found, metadata)
    if description.kind == "frames":
        FrameEngine(description, bare)
    else:
        Engine(description, (64, 64), bare)
    _ = Weights(made).card  # refuses metadata of another form
    _write(path, made)
    return spare


def renamed(state: Mapping, names: Mapping[str, str]):
    """`state` with the prefixes of `names` replaced, the longest that a name has."""
    result = {}
    for name, tensor in state.items():
        prefix = max((p for p in names if name.startswith(p)), key=len, default="")
        new = names.get(prefix, "") + name[len(prefix) :]
        if new in result:
            raise WeightsError(f"{new}: two tensors are renamed to it, the second is {name}")
        result[new] = tensor
    return result


def fitting(state, description):
    """The tensors that a network needs, and the names of those that are left over. Raises `WeightsError` with all that do not fit."""
    needed = description.tensors
    spare = {name: tuple(tensor.shape) for name, tensor in state.items() if name not in needed}
    found, problems = {}, []
    for name, shape in needed.items():
        tensor = state.get(name)
        if tensor is None:
            same = [other for other, spare_shape in spare.items() if spare_shape == shape]
            hint = f"; left over with this shape: {', '.join(same)}" if same else ""
            problems.append(f"{name}: missing, expected shape {shape}{hint}")
        elif tuple(tensor.shape) != shape:
            problems.append(f"{name}: expected shape {shape}, found {tuple(tensor.shape)}")
        elif not tensor.is_floating_point():
            problems.append(f"{name}: expected floating-point values, found {tensor.dtype}")
        elif not torch.isfinite(tensor.float()).all():
            problems.append(f"{name}: expected finite F32 values")
        else:
            found[name] = tensor.detach().cpu() if tensor.dtype == torch.float16 else tensor.detach().cpu().float()
    if problems:
        left = [f"left over: {name} {shape}" for name, shape in spare.items()]
        raise WeightsError("\n".join([f"the weights do not fit network {description.name!r}:", *problems, *left]))
    return found, list(spare)


def _write(path, content):
    """Replaces the file at `path` whole."""
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(content)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
