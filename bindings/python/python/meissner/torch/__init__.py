"""Described networks as modules of PyTorch, on graphs of the engine: `pip install meissner-events[torch]`.

    from meissner.torch import Module, Presses, fit, save

    module = Module.from_description("mine.toml", unit=0.1)
    presses = Presses("train.safetensors", mirrors=["columns", "rows"])
    fit(module, presses, epochs=12, valid=Presses("valid.safetensors"), checkpoint="mine.state")
    save(module, "mine.safetensors", {"about": "trained on my recordings"})

The equations and the names of tensors are those of docs/weights-from-pytorch.md. models/train/ has the recipes of the shipped weights.
"""

from ._fit import History, constant, cosine, fit, gather_statistics, loss_of
from ._graphs import Batch, Graphs, Level, SlidingFrames, moved
from ._module import Module
from ._presses import Film, Presses, Readouts, errors
from ._save import save

__all__ = [
    "Batch",
    "Film",
    "Graphs",
    "History",
    "Level",
    "Module",
    "Presses",
    "Readouts",
    "SlidingFrames",
    "constant",
    "cosine",
    "errors",
    "fit",
    "gather_statistics",
    "loss_of",
    "moved",
    "save",
]
