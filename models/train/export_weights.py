"""Weights for the program from a PyTorch checkpoint: names and shapes checked, metadata written beside the tensors.

    meissner inspect own.toml --json > own.json
    python models/train/export_weights.py checkpoint.pth own.json own.safetensors --about "trained on my recordings"

docs/weights-from-pytorch.md says what each tensor holds. In a training script:

    export(module, json.load(open("own.json")), "own.safetensors", {"about": "trained on my recordings"})
"""

import argparse
import json
import sys
from pathlib import Path

import torch
from safetensors.torch import load_file, save_file

# Of a tensor with fewer values, half precision saves nothing worth having; batch norm's are among them.
LEAST_HALVED = 256
# Where a checkpoint keeps its state dict, as the program looks for it.
STATE_DICTS = ("state_dict", "model_state_dict", "model", "net", "module")
# What modules keep beside weights: batch norm's count of batches, the settings of torch_geometric's SplineConv.
BOOKKEEPING = ("num_batches_tracked", "kernel_size", "is_open_spline")


class Misfit(ValueError):
    """Tensors that do not fit a network, one a line."""


def halved(tensor):
    """`tensor` in half precision where that saves something."""
    return tensor.half() if tensor.numel() >= LEAST_HALVED else tensor


def weights(tensors):
    """`tensors` without what modules keep beside weights."""
    return {name: tensor.detach().cpu() for name, tensor in tensors.items() if not name.endswith(BOOKKEEPING)}


def save(tensors, path, remarks, half=True):
    """Writes `tensors` with `remarks`."""
    file = {name: (halved(tensor) if half else tensor).contiguous() for name, tensor in weights(tensors).items()}
    save_file(file, path, {key: str(value) for key, value in remarks.items()})


def renamed(tensors, names):
    """`tensors` with the prefixes of `names` replaced, the longest that a name has."""
    result = {}
    for name, tensor in tensors.items():
        prefix = max((p for p in names if name.startswith(p)), key=len, default="")
        new = names.get(prefix, "") + name[len(prefix):]
        if new in result:
            raise Misfit(f"{new}: two tensors are renamed to it, the second is {name}")
        result[new] = tensor
    return result


def fitting(tensors, network):
    """The tensors that `network` (the JSON object of `meissner inspect --json`) needs, as F32, and the names of those that
    are left over. Raises `Misfit` with every tensor that is missing, has another shape, or values that are not finite."""
    needed = {tensor["name"]: tuple(tensor["shape"]) for tensor in network["tensors"]}
    spare = {name: tuple(tensor.shape) for name, tensor in weights(tensors).items() if name not in needed}
    found, problems = {}, []
    for name, shape in needed.items():
        tensor = tensors.get(name)
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
            found[name] = tensor.float()
    if problems:
        left = [f"left over: {name} {shape}" for name, shape in spare.items()]
        raise Misfit("\n".join([f"the weights do not fit network {network['name']!r}:", *problems, *left]))
    return found, list(spare)


def export(source, network, path, remarks=(), names=None, half=False):
    """Writes the weights of `source`, a module or a state dict, for `network`, the JSON object of `meissner inspect --json`.

    `remarks` are metadata beside those that the network asks for; `names` renames by prefix. Returns the names of tensors
    that the network does not read. Raises `Misfit` where a tensor does not fit, and writes nothing then."""
    tensors = source.state_dict() if hasattr(source, "state_dict") else source
    tensors, spare = fitting(renamed(tensors, names or {}), network)
    if half:
        # What half precision cannot hold becomes infinite, which the program refuses.
        tensors, _ = fitting({name: halved(tensor) for name, tensor in tensors.items()}, network)
    metadata = {"network": network["name"], "trained": "true"}
    if network.get("preparation"):
        metadata["preparation"] = network["preparation"]
    save(tensors, path, metadata | dict(remarks), half)
    return spare


def read(path):
    """The state dict in a checkpoint (.pt, .pth) or a safetensors file; nothing in it is executed."""
    if path.suffix == ".safetensors":
        return load_file(path)
    checkpoint = torch.load(path, map_location="cpu", weights_only=True)
    for key in STATE_DICTS:
        if isinstance(checkpoint.get(key), dict):
            checkpoint = checkpoint[key]
            break
    return {name: value for name, value in checkpoint.items() if isinstance(value, torch.Tensor)}


def main():
    args = arguments()
    network = json.loads(args.network.read_text())
    names = json.loads(args.map.read_text()) if args.map else {}
    remarks = dict(remark.split("=", 1) for remark in args.remark) | ({"about": args.about} if args.about else {})
    try:
        spare = export(read(args.checkpoint), network, args.out, remarks, names, args.half)
    except Misfit as misfit:
        sys.exit(str(misfit))
    for name in spare:
        print(f"not read by the network: {name}", file=sys.stderr)
    print(f"{args.out}: {len(network['tensors'])} tensors for {network['name']}", file=sys.stderr)


def remark(text):
    """KEY=VALUE as it is."""
    if "=" not in text:
        raise argparse.ArgumentTypeError(f"expected KEY=VALUE, found {text!r}")
    return text


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("checkpoint", type=Path, help="state dict (.pt, .pth, .safetensors)")
    parser.add_argument("network", type=Path, help="what `meissner inspect NETWORK --json` printed")
    parser.add_argument("out", type=Path, help="safetensors file to write")
    parser.add_argument("--map", type=Path, help='JSON object that renames by prefix, such as {"module.": ""}')
    parser.add_argument("--about", help="one line that reports show beside the weights")
    parser.add_argument("--remark", type=remark, action="append", default=[], help="KEY=VALUE, more metadata; repeatable")
    parser.add_argument("--half", action="store_true", help="large tensors in half precision")
    return parser.parse_args()


if __name__ == "__main__":
    main()
