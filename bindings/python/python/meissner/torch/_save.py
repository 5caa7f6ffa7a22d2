"""Weights as the engine reads them: safetensors, with remarks on the training in the metadata."""

from __future__ import annotations

import datetime
import json
import os
from pathlib import Path

import torch
from safetensors import torch as tensors

from .. import Description, Engine, FrameEngine, Weights, WeightsError

# For smaller tensors, such as those of batch norm, half precision saves almost nothing.
_MIN_HALVED = 256


def save(source, path, remarks=(), *, network=None, names=None, half=False):
    """Writes the weights of `source`, a module or any input of `meissner.Weights`, for `network`, by default that of the `Module`.

    `remarks` are metadata (texts, or values for JSON) besides the network's name, its preparation, `trained` and the date. `names`
    are those of `Weights.renamed`. With `half`, large tensors are in half precision. The file is replaced as a whole, and only by weights
    that an engine accepts.

    Returns the names of the tensors that are left out because the network does not read them. Raises `WeightsError`."""
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
    # Weights that an engine refuses are not written. Any sensor works, because `bare` has no metadata of a sensor.
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
