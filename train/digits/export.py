"""Weights as the engine reads them: safetensors, large tensors in half precision, with what was done in the header."""

from safetensors.torch import save_file

# Of a tensor with fewer values, half precision saves nothing worth having; batch norm's are among them.
LEAST_HALVED = 256


def save(network, path, remarks):
    """Writes the tensors of `network` with `remarks`."""
    tensors = {name: tensor.detach() for name, tensor in network.exported().items()}
    halved = {n: (t.half() if t.numel() >= LEAST_HALVED else t).contiguous() for n, t in tensors.items()}
    save_file(halved, path, {key: str(value) for key, value in remarks.items()})
