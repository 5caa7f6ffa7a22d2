"""Weights as the engine reads them: safetensors, with what was done in the metadata."""

from __future__ import annotations

import datetime
import json
import os
from pathlib import Path

import torch
from safetensors import torch as tensors

from .. import Description, Engine, FrameEngine, Weights, WeightsError

# Of a tensor with fewer values, half precision saves nothing worth having; batch norm's are among them.
_MIN_HALVED = 256


def save(source, path, remarks=(), *, network=None, names=None, half=False):
    """Writes the weights of `source`, a module or whatever `meissner.Weights` takes, for `network`, by default that of a `Module`.

    `remarks` are metadata (texts, or what JSON can say) beside the network's name, its preparation, `trained` and the date. `names`
    are those of `Weights.renamed`. With `half`, large tensors are in half precision. The file is replaced whole, and only by weights that an
    engine takes.

    Returns the names of tensors that the network does not read, which are left out. Raises `WeightsError`."""
    description = Description(source.description if network is None else network)
    given = Weights(source).renamed(names or {})
    spare = given.unused(description)
    found = {name: torch.from_numpy(given[name]) for name in given if name not in spare}
    if half:
        found = {name: tensor.half() if tensor.numel() >= _MIN_HALVED else tensor for name, tensor in found.items()}
    endless = [name for name, tensor in found.items() if not torch.isfinite(tensor).all()]
    if endless:
        raise WeightsError(f"weights of {description.name!r}: expected finite values{' in half precision' if half else ''}, not in {endless}")
    metadata, preparation = {"network": description.name, "trained": "true"}, description.summary().get("preparation")
    metadata |= {"date": datetime.date.today().isoformat()} | ({"preparation": preparation} if preparation else {})
    # What an engine refuses is not written. Any sensor does: the one of the metadata is no part of this.
    bare = Weights(tensors.save(found, {"preparation": preparation} if preparation else None))
    if description.kind == "frames":
        FrameEngine(description, bare)
    else:
        Engine(description, (64, 64), bare)
    metadata |= {key: value if isinstance(value, str) else json.dumps(value) for key, value in dict(remarks).items()}
    made = tensors.save(found, metadata)
    _ = Weights(made).card  # refuses metadata of another form
    path = Path(path)
    path.parent.mkdir(parents=True, exist_ok=True)
    part = path.with_name(f"{path.name}.{os.getpid()}.part")
    try:
        part.write_bytes(made)
        os.replace(part, path)
    finally:
        part.unlink(missing_ok=True)
    return spare
