"""Weights as the engine reads them: safetensors, large tensors in half precision, with what was done in the header."""

import sys
from pathlib import Path

import torch
from network import Digits
from safetensors.torch import load_file

# What all trainings share lies beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
import export_weights


def save(network, path, remarks):
    """Writes the tensors of `network` with `remarks`."""
    export_weights.save(network.exported(), path, remarks)


def load(path):
    """A network with the tensors of the file at `path`, in evaluation."""
    network = Digits()
    tensors = load_file(path)
    with torch.no_grad():
        for name, tensor in network.exported().items():
            tensor.copy_(tensors[name])
    return network.eval()
