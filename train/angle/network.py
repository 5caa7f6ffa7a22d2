"""A network over events, as `meissner inspect --json` describes it, over batches of graphs.

Sums of a row run in another order than the engine's: values agree to some 1e-5 of the largest.
"""

import torch
import torch.nn.functional as F
from safetensors.torch import load_file
from torch import nn

ACTIVATIONS = {"identity": lambda x: x, "elu": F.elu, "relu": F.relu}


class Network(nn.Module):
    """Spline blocks, a readout, perhaps poolings of it, and dense layers.

    The last layer gives values in units of `unit`: small outputs of large weights train slowly.
    """

    def __init__(self, said, unit, dropout):
        super().__init__()
        self.layers, self.unit = said["layers"] + said["head"], unit
        self.is_image = bool(said["head"])
        self.dropout = nn.Dropout(dropout)
        self.names = {tensor["layer"]: tensor["name"] for tensor in said["tensors"] if tensor["name"].endswith("weight")}
        self.part = nn.ModuleDict()
        for layer in self.layers:
            if layer["kind"] == "spline":
                assert layer["kernel"] == [2, 2, 2] and not layer["bias"], layer
                self.part[layer["name"]] = Spline(layer["inputs"], layer["outputs"], layer["root"])
            elif layer["kind"] == "dense":
                inputs = layer["input"][0] if "input" in layer else layer["inputs"]
                self.part[layer["name"]] = nn.Linear(inputs, layer["outputs"], bias=layer["bias"])
            else:
                assert layer["kind"] in ("readout", "average_pool", "max_pool", "flatten"), layer

    def forward(self, batch):
        """Values (readouts, outputs) in units of `unit`."""
        return self.dense(self.features(batch))

    def features(self, batch):
        """What the first dense layer reads (readouts, features)."""
        x, done = batch.input, {}
        for layer in self.layers:
            kind, name = layer["kind"], layer["name"]
            if kind == "spline":
                x = self.part[name](x, batch)
                if layer["skip"]:
                    x = x + done[layer["skip"]]
            elif kind == "readout":
                x = maxima(x.index_select(0, batch.row), batch.place, batch.readouts * layer["columns"] * layer["rows"])
                x = x.view(batch.readouts, layer["rows"], layer["columns"], -1)
                x = x.permute(0, 3, 1, 2) if self.is_image else x.flatten(1)
            elif kind == "average_pool":
                x = F.avg_pool2d(x, layer["size"])
            elif kind == "max_pool":
                x = F.max_pool2d(x, 2)
            elif kind == "flatten":
                x = x.flatten(1)
            done[name] = x
        return self.dropout(x)

    def dense(self, x):
        """Values of features."""
        for layer in self.layers:
            if layer["kind"] == "dense":
                x = ACTIVATIONS[layer["activation"]](self.part[layer["name"]](x))
        return x

    def exported(self):
        """Tensors by the names of the description."""
        tensors, last = {}, self.layers[-1]["name"]
        for layer in self.layers:
            if layer["name"] not in self.part:
                continue
            part, weight = self.part[layer["name"]], self.names[layer["name"]]
            if layer["kind"] == "spline":
                block = weight.removesuffix(".norm.weight")
                tensors[f"{block}.conv.weight"] = part.weight
                if layer["root"]:
                    tensors[f"{block}.conv.lin.weight"] = part.root
                for name in ("weight", "bias", "running_mean", "running_var"):
                    tensors[f"{block}.norm.{name}"] = getattr(part.norm, name)
            else:
                scale = self.unit if layer["name"] == last else 1.0
                tensors[weight] = part.weight if scale == 1.0 else part.weight * scale
                if layer["bias"]:
                    tensors[weight.removesuffix("weight") + "bias"] = part.bias if scale == 1.0 else part.bias * scale
        return {name: tensor.detach() for name, tensor in tensors.items()}


def load(path, said):
    """The network of a description with the tensors of the file at `path`, in evaluation."""
    network, tensors = Network(said, 1.0, 0.0), load_file(path)
    for name, tensor in network.exported().items():
        tensor.copy_(tensors[name])
    return network.eval()


class Spline(nn.Module):
    """A spline convolution, ELU and batch norm."""

    def __init__(self, inputs, outputs, root):
        super().__init__()
        # Normal values of variance 2 / inputs (He et al. 2015).
        self.weight = nn.Parameter(torch.randn(8, inputs, outputs) * (2 / inputs) ** 0.5)
        self.root = nn.Parameter(torch.randn(outputs, inputs) * (2 / inputs) ** 0.5) if root else None
        self.norm = nn.BatchNorm1d(outputs)

    def forward(self, x, batch):
        read = x.index_select(0, batch.source.flatten()).unflatten(0, batch.source.shape)
        sums = torch.bmm(batch.basis, read).flatten(1)
        found = sums @ self.weight.flatten(0, 1) / batch.in_edges
        return self.norm(F.elu(found if self.root is None else found + x @ self.root.T))


def maxima(x, place, places):
    """Channel-wise maximum of the rows of each place, 0 where there are none."""
    empty = x.new_full((places, x.shape[1]), -torch.inf)
    found = empty.scatter_reduce(0, place[:, None].expand_as(x), x, "amax")
    return torch.where(torch.isinf(found), 0, found)
