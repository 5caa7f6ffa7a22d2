"""Weights as the engine reads them: safetensors, large tensors in half precision, with what was done in the header."""

from safetensors.torch import save_file

# Of a tensor with fewer values, half precision saves nothing worth having; batch norm's are among them.
LEAST_HALVED = 256


def file_tensors(network):
    """The tensors of the file."""
    tensors = {name: tensor.detach() for name, tensor in network.exported().items()}
    return {
        name: (tensor.half() if tensor.numel() >= LEAST_HALVED else tensor).contiguous()
        for name, tensor in tensors.items()
        if not name.endswith("num_batches_tracked")
    }


def save(tensors, path, remarks):
    """Writes `tensors` with `remarks`."""
    save_file(tensors, path, {key: str(value) for key, value in remarks.items()})


def load(network, tensors):
    """`network` with the tensors of a file, for evaluation; every one of them must be there."""
    expected, found = file_tensors(network), {name: tensor.float() for name, tensor in tensors.items()}
    if expected.keys() != found.keys():
        raise ValueError(f"expected the tensors {sorted(expected)}, found {sorted(found)}")
    network.load_exported(found)
    return network.eval()
