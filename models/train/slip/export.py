"""Weights as the engine reads them: safetensors, large tensors in half precision, with what was done in the header."""

import sys
from pathlib import Path

# What all trainings share lies beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
from export_weights import halved, save, weights

__all__ = ["file_tensors", "load", "save"]


def file_tensors(network):
    """The tensors of the file."""
    return {name: halved(tensor) for name, tensor in weights(network.exported()).items()}


def load(network, tensors):
    """`network` with the tensors of a file, for evaluation; every one of them must be there."""
    expected, found = file_tensors(network), {name: tensor.float() for name, tensor in tensors.items()}
    if expected.keys() != found.keys():
        raise ValueError(f"expected the tensors {sorted(expected)}, found {sorted(found)}")
    network.load_exported(found)
    return network.eval()
