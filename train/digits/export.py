"""Weights as the engine reads them: safetensors, large tensors in half precision, with what was done in the header."""

import torch
from network import Digits
from safetensors.torch import load_file, save_file

# Of a tensor with fewer values, half precision saves nothing worth having; batch norm's are among them.
LEAST_HALVED = 256


def save(network, path, remarks):
    """Writes the tensors of `network` with `remarks`."""
    tensors = {name: tensor.detach() for name, tensor in network.exported().items()}
    halved = {n: (t.half() if t.numel() >= LEAST_HALVED else t).contiguous() for n, t in tensors.items()}
    save_file(halved, path, {key: str(value) for key, value in remarks.items()})


def load(path):
    """A network with the tensors of the file at `path`, in evaluation."""
    network = Digits()
    tensors = load_file(path)
    with torch.no_grad():
        for name, tensor in network.exported().items():
            tensor.copy_(tensors[name])
    return network.eval()
