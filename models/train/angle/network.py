"""A network over events or over frames of events, as `meissner inspect --json` describes it, over batches of either.

Sums of a row run in another order than the engine's: values agree to some 1e-5 of the largest.
"""

import torch
import torch.nn.functional as F
from safetensors.torch import load_file
from torch import nn

ACTIVATIONS = {"identity": lambda x: x, "elu": F.elu, "relu": F.relu}


class Network(nn.Module):
    """Spline blocks, poolings and a readout, or frames; then perhaps convolutions and poolings, and dense layers.

    The last layer gives values in units of `unit` (outputs,): small outputs of large weights train slowly. A readout that sums
    gives sums times `share`, for the same reason.
    """

    def __init__(self, said, unit, dropout, share=1.0):
        super().__init__()
        self.layers, self.unit = said["layers"] + said.get("head", []), torch.as_tensor(unit, dtype=torch.float32)
        # Up to the readout, and behind it; a frame network has no readout.
        behind = 1 + max((i for i, layer in enumerate(self.layers) if layer["kind"] == "readout"), default=-1)
        self.events, self.head = self.layers[:behind], self.layers[behind:]
        self.dense = next(layer["name"] for layer in self.layers if layer["kind"] == "dense")
        self.is_image = bool(said.get("head"))
        self.dropout = nn.Dropout(dropout)
        self.tensors = {}
        for tensor in said["tensors"]:
            self.tensors.setdefault(tensor["layer"], []).append(tensor["name"])
        # The factor of the sums, and the tensor that they meet first.
        self.share, self.first = 1.0, None
        for i, layer in enumerate(self.layers):
            if layer.get("aggregation") == "sum":
                reader = next(later for later in self.layers[i:] if later["kind"] in ("dense", "conv"))
                self.share, self.first = share, self.tensors[reader["name"]][0]
        self.part = nn.ModuleDict()
        for layer in self.layers:
            if layer["kind"] == "spline":
                assert layer["kernel"] == [2, 2, 2] and not layer["bias"], layer
                self.part[layer["name"]] = Spline(layer["inputs"], layer["outputs"], layer["root"])
            elif layer["kind"] == "dense":
                inputs = layer["input"][0] if "input" in layer else layer["inputs"]
                self.part[layer["name"]] = nn.Linear(inputs, layer["outputs"], bias=layer["bias"])
            elif layer["kind"] == "conv":
                self.part[layer["name"]] = Convolution(layer)
            else:
                assert layer["kind"] in ("pool", "readout", "average_pool", "max_pool", "flatten"), layer
        if "graph" not in said:
            # A frame network is deep and has no norms: with smaller weights an image is hardly seen at the end (He et al. 2015).
            for part in self.part.values():
                nn.init.kaiming_normal_(part.conv.weight if hasattr(part, "conv") else part.weight, nonlinearity="relu")

    def forward(self, batch):
        """Values (readouts, outputs) in units of `unit`."""
        return self.values(self.readout(batch))

    def readout(self, batch):
        """What the layers behind the readout read: frames as they are, sums times `share`."""
        x, done = batch.input.to(next(self.parameters()).device), {}
        for layer in self.events:
            kind, name = layer["kind"], layer["name"]
            if kind == "spline":
                x = self.part[name](x, batch.levels[layer["level"]])
                if layer["skip"]:
                    x = x + done[layer["skip"]]
            elif kind == "pool" and layer["level"] < len(batch.levels):
                level = batch.levels[layer["level"]]
                x = maxima(x.index_select(0, level.row), level.place, len(level.source))
            elif kind == "readout":
                grids = batch.readouts * layer["times"]
                rows, cells = x.index_select(0, batch.row), grids * layer["columns"] * layer["rows"]
                if layer["aggregation"] == "sum":
                    x = x.new_zeros(cells, rows.shape[1]).index_add(0, batch.place, rows) * self.share
                else:
                    x = maxima(rows, batch.place, cells)
                x = x.view(batch.readouts, layer["times"], layer["rows"], layer["columns"], -1)
                x = x.permute(0, 1, 4, 2, 3).flatten(1, 2) if self.is_image else x.flatten(1)
            done[name] = x
        return x

    def values(self, x, layers=None):
        """What `layers`, all behind the readout by default, make of `x`."""
        for layer in self.head if layers is None else layers:
            kind, name = layer["kind"], layer["name"]
            if kind == "conv":
                x = ACTIVATIONS[layer["activation"]](self.part[name](x))
            elif kind == "average_pool":
                x = F.avg_pool2d(x, layer["size"])
            elif kind == "max_pool":
                x = F.max_pool2d(x, 2)
            elif kind == "flatten":
                x = x.flatten(1)
            elif kind == "dense":
                x = ACTIVATIONS[layer["activation"]](self.part[name](self.dropout(x) if name == self.dense else x))
        return x

    @torch.no_grad()
    def load(self, tensors, thinner=1.0):
        """Copies what `exported` gave; sums are of `thinner` times fewer events than they were."""
        for name, tensor in self.parameters_by_name().items():
            more = thinner if name == self.first else 1.0
            tensor.copy_(tensors[name] * more / self.scale(name, tensor))

    def exported(self):
        """Tensors by the names of the description."""
        return {name: tensor.detach().cpu() * self.scale(name, tensor) for name, tensor in self.parameters_by_name().items()}

    def names(self, layers):
        """The names of the tensors of some layers, in their order."""
        return [name for layer in layers for name in self.tensors.get(layer["name"], [])]

    def parameters_by_name(self):
        found = {}
        for name, part in self.part.items():
            tensors = part.tensors() if hasattr(part, "tensors") else [part.weight] + ([] if part.bias is None else [part.bias])
            found |= dict(zip(self.tensors[name], tensors, strict=True))
        return found

    def scale(self, name, tensor):
        """What the engine's tensor is larger by than that of this network."""
        last = name in self.tensors[self.layers[-1]["name"]]
        return (self.unit.view(-1, *[1] * (tensor.dim() - 1)) if last else 1.0) * (self.share if name == self.first else 1.0)


def load(path, said):
    """The network of a description with the tensors of the file at `path`, in evaluation."""
    network = Network(said, [1.0] * len(said["outputs"]), 0.0)
    network.load(load_file(path))
    return network.eval()


class Spline(nn.Module):
    """A spline convolution, ELU and batch norm."""

    def __init__(self, inputs, outputs, root):
        super().__init__()
        # Normal values of variance 2 / inputs (He et al. 2015).
        self.weight = nn.Parameter(torch.randn(8, inputs, outputs) * (2 / inputs) ** 0.5)
        self.root = nn.Parameter(torch.randn(outputs, inputs) * (2 / inputs) ** 0.5) if root else None
        self.norm = nn.BatchNorm1d(outputs)

    def forward(self, x, level):
        read = x.index_select(0, level.source.flatten()).unflatten(0, level.source.shape)
        sums = torch.bmm(level.basis, read).flatten(1)
        found = sums @ self.weight.flatten(0, 1) / level.in_edges
        return self.norm(F.elu(found if self.root is None else found + x @ self.root.T))

    def tensors(self):
        """In the order of the description."""
        return [self.weight, *([] if self.root is None else [self.root]), *statistics(self.norm)]


class Convolution(nn.Module):
    """A convolution of images, with batch norm where its layer has one."""

    def __init__(self, layer):
        super().__init__()
        inputs, outputs, kernel = layer["input"][0], layer["channels"], layer["kernel"]
        self.conv = nn.Conv2d(inputs, outputs, kernel, padding=kernel // 2, bias=layer["bias"])
        self.norm = nn.BatchNorm2d(outputs) if layer["norm"] else None

    def forward(self, x):
        x = self.conv(x)
        return x if self.norm is None else self.norm(x)

    def tensors(self):
        """In the order of the description."""
        bias = [] if self.conv.bias is None else [self.conv.bias]
        return [self.conv.weight, *bias, *([] if self.norm is None else statistics(self.norm))]


def statistics(norm):
    return [norm.weight, norm.bias, norm.running_mean, norm.running_var]


def maxima(x, place, places):
    """Channel-wise maximum of the rows of each place, 0 where there are none."""
    empty = x.new_full((places, x.shape[1]), -torch.inf)
    found = empty.scatter_reduce(0, place[:, None].expand_as(x), x, "amax")
    return torch.where(torch.isinf(found), 0, found)
