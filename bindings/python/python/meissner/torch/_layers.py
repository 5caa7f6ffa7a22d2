"""The computation of each kind of layer, with the equations of docs/weights-from-pytorch.md.

A function gets the module, the layer as in `Description.summary()`, and the values of the layers that it reads. Values of frame
networks are (frames, ...), those of layers with a memory (streams, steps, ...).
"""

from __future__ import annotations

import torch
import torch.nn.functional as F

from .._meissner import _spline_sums, _spline_sums_gradient

ACTIVATIONS = {"identity": lambda x: x, "elu": F.elu, "relu": F.relu, "tanh": torch.tanh, "sigmoid": torch.sigmoid}
# The part of the first tensor's name after the layer's prefix.
FIRST = {"spline": "conv.weight", "pointnet": "conv.weight", "conv_lstm": "gates.weight", "squeeze_excite": "down.weight"}
MEMORY = ("lstm", "conv_lstm", "delay")


def spline(module, layer, x, level):
    """Mean over the in-edges, root, bias, ELU, batch norm; without in-edges the mean is 0."""
    part = module.parts[layer["name"]]
    found = spline_sums(x, level, layer["kernel"]) @ module[part["conv.weight"]].flatten(0, 1) / level.in_edges
    if layer["root"]:
        found = found + x @ module[part["conv.lin.weight"]].mT
    if layer["bias"]:
        found = found + module[part["conv.bias"]]
    return norm(module, layer, F.elu(found) if layer["elu"] else found)


def spline_sums(x, level, kernel):
    """(rows, slots x channels): the values that the in-edges read, summed per slot of the kernel."""
    if x.device.type == "cpu" and x.dtype == torch.float32:
        return SplineSums.apply(x, level, kernel)
    read = x.index_select(0, level.source.flatten()).unflatten(0, level.source.shape)
    return torch.bmm(level.basis(kernel), read).flatten(1)


class SplineSums(torch.autograd.Function):
    """`spline_sums` in Rust, because PyTorch makes arrays of all in-edges for it."""

    @staticmethod
    def forward(ctx, x, level, kernel):
        ctx.rows, ctx.level, ctx.kernel = len(x), level, kernel
        return torch.from_numpy(_spline_sums(x.detach().contiguous().numpy(), *level.in_numpy(), kernel))

    @staticmethod
    @torch.autograd.function.once_differentiable
    def backward(ctx, gradient):
        gradient = gradient.contiguous().numpy()
        return torch.from_numpy(_spline_sums_gradient(gradient, *ctx.level.in_numpy(), ctx.kernel, ctx.rows)), None, None


def pointnet(module, layer, x, level):
    """Maximum of a linear layer over the in-edges and the row itself, ReLU, batch norm."""
    part = module.parts[layer["name"]]
    weight, channels = module[part["conv.weight"]], x.shape[1]
    own = x @ weight[:, :channels].mT
    read = own.index_select(0, level.source.flatten()).unflatten(0, level.source.shape)
    read = (read + level.offset @ weight[:, channels:].mT).masked_fill(~level.there[..., None], -torch.inf)
    found = torch.maximum(own, read.amax(1)) + module[part["conv.bias"]]
    return norm(module, layer, F.relu(found))


def maxima(x, place, places):
    """Maximum of each channel over the rows of each place, 0 where there are none."""
    empty = x.new_full((places, x.shape[1]), -torch.inf)
    found = empty.scatter_reduce(0, place[:, None].expand_as(x), x, "amax")
    return found.masked_fill(found == -torch.inf, 0)


def readout(module, layer, x, batch):
    """Maximum or sum over the cells of the grid: images if a head reads them, otherwise cell after cell."""
    cells = batch.readouts * layer["times"] * layer["columns"] * layer["rows"]
    x = x.index_select(0, batch.row)
    if layer["aggregation"] == "sum":
        x = x.new_zeros(cells, x.shape[1]).index_add(0, batch.place, x)
    else:
        x = maxima(x, batch.place, cells)
    x = x.view(batch.readouts, layer["times"], layer["rows"], layer["columns"], -1)
    return x.permute(0, 1, 4, 2, 3).flatten(1, 2) if module.is_image else x.flatten(1)


def norm(module, layer, x):
    """Batch norm of channels, if the layer has it."""
    if not layer.get("norm"):
        return x
    part = module.parts[layer["name"]]
    weight, bias, mean, variance = (module[part[f"norm.{name}"]] for name in ("weight", "bias", "running_mean", "running_var"))
    learns = module.training and not module.frozen_norms
    # For the plain mean over n batches, the newest batch has a share of 1 / n.
    momentum = 0.1 if module.batches is None else 1 / max(module.batches, 1)
    return F.batch_norm(x, mean, variance, weight, bias, learns, momentum, 1e-5)


def dense(module, layer, x):
    name, part = layer["name"], module.parts[layer["name"]]
    if module.dropout.get(name):
        x = F.dropout(x, module.dropout[name], module.training)
    bias = module[part["bias"]] if layer["bias"] else None
    x = F.linear(x * module.gain.get(name, 1.0), module[part["weight"]], bias)
    return ACTIVATIONS[layer["activation"]](norm(module, layer, x))


def conv(module, layer, x):
    part = module.parts[layer["name"]]
    bias = module[part["bias"]] if layer["bias"] else None
    x = F.conv2d(x * module.gain.get(layer["name"], 1.0), module[part["weight"]], bias, padding=layer["kernel"] // 2)
    return ACTIVATIONS[layer["activation"]](norm(module, layer, x))


def upconv(module, layer, x):
    part = module.parts[layer["name"]]
    return F.conv_transpose2d(x, module[part["weight"]], module[part["bias"]] if layer["bias"] else None, stride=2)


def squeeze_excite(module, layer, x):
    part = module.parts[layer["name"]]
    factors = F.linear(F.relu(F.linear(x.mean((2, 3)), module[part["down.weight"]])), module[part["up.weight"]])
    return x * torch.sigmoid(factors)[:, :, None, None]


def lstm(module, layer, x):
    part, n = module.parts[layer["name"]], layer["layer"]
    tensors = [module[part[f"{name}_l{n}"]] for name in ("weight_ih", "weight_hh", "bias_ih", "bias_hh")]
    state = x.new_zeros(1, len(x), layer["hidden"])
    return torch.lstm(x, (state, state), tensors, True, 1, 0.0, module.training, False, True)[0]


def conv_lstm(module, layer, x):
    """Gates in the order i, f, g, o; the peephole of o reads the cell before the step. Parts without a state are computed
    for all steps at once."""
    part, hidden = module.parts[layer["name"]], layer["hidden"]
    (streams, steps), act = x.shape[:2], ACTIVATIONS[layer["activation"]]
    of_input, of_hidden = module[part["gates.weight"]].split([x.shape[2], hidden], 1)
    given = F.conv2d(x.flatten(0, 1), of_input, module[part["gates.bias"]], padding=1).unflatten(0, (streams, steps))
    # Gates and state stay in f32 even if convolutions are in half precision.
    peephole = module[part["peephole"]] if layer["peepholes"] else [0.0, 0.0, 0.0]
    cell, found = x.new_zeros(streams, hidden, *x.shape[3:], dtype=torch.float32), []
    # Unbound once, because the gradient of an index is as large as all steps.
    for gates in given.unbind(1):
        if found:
            gates = gates + F.conv2d(found[-1], of_hidden, padding=1)
        i, f, g, o = gates.float().chunk(4, 1)
        i, f, o = (torch.sigmoid(gate + own * cell) for gate, own in zip((i, f, o), peephole))
        cell = f * cell + i * act(g)
        found.append(o * act(cell))
    return torch.stack(found, 1)


def delay(_, layer, x):
    """The last frames of each value, oldest first; frames before the first one are 0."""
    return F.pad(x, (0, 0, layer["frames"] - 1, 0)).unfold(1, layer["frames"], 1).flatten(2)


def concat(_, __, x, other):
    return torch.cat([x, other], 1)


OF_FRAMES = {
    "conv": conv,
    "upconv": upconv,
    "dense": dense,
    "squeeze_excite": squeeze_excite,
    "lstm": lstm,
    "conv_lstm": conv_lstm,
    "delay": delay,
    "concat": concat,
    "max_pool": lambda _, __, x: F.max_pool2d(x, 2),
    "average_pool": lambda _, layer, x: F.avg_pool2d(x, layer["size"]),
    "global_average": lambda _, __, x: x.mean((2, 3)),
    "sum": lambda _, __, x: x.sum((2, 3)),
    "flatten": lambda _, __, x: x.flatten(1),
}
