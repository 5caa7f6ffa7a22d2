"""Models of PyTorch Geometric become engines with the same outputs."""


import importlib

import numpy as np
import pytest
from conftest import SENSOR, make_events

import meissner
from meissner.export import Add, Pool, Readout, compare, export

torch = pytest.importorskip("torch")
GRAPH = {"kind": "knn", "k": 6, "candidates": "past", "lifetime": "frozen", "scale": 0.2}


def spline_basis(u, kernel_size, _open, _degree):
    """Weight and slot of each corner, as `pyg_lib.ops.spline_basis` gives them for open splines of degree 1."""
    weights, slots = [], []
    for corner in range(1 << len(kernel_size)):
        weight, slot, stride = torch.ones(len(u)), torch.zeros(len(u), dtype=torch.long), 1
        for axis, size in enumerate(kernel_size.tolist()):
            v, up = u[:, axis] * (size - 1), corner >> axis & 1
            low = v.floor().clamp(max=size - 2)
            weight = weight * ((v - low) if up else 1 - (v - low))
            slot, stride = slot + stride * (low.long() + up), stride * size
        weights.append(weight)
        slots.append(slot)
    return torch.stack(weights, 1), torch.stack(slots, 1)


def spline_weighting(x, weight, basis, slots):
    return torch.einsum("es,ec,esco->eo", basis, x, weight[slots])


class SplineConv(torch.nn.Module):
    """The equation of torch_geometric's SplineConv in plain torch, which runs without compiled extensions."""

    def __init__(self, inputs, outputs, kernel, root=True, bias=True):
        super().__init__()
        self.register_buffer("kernel_size", torch.tensor(kernel))
        self.register_buffer("is_open_spline", torch.ones(len(kernel), dtype=torch.uint8))
        self.degree, self.aggr = 1, "mean"
        self.weight = torch.nn.Parameter(torch.randn(int(np.prod(kernel)), inputs, outputs) / 3)
        self.lin = torch.nn.Linear(inputs, outputs, bias=False) if root else None
        self.bias = torch.nn.Parameter(torch.randn(outputs)) if bias else None

    def forward(self, x, edge_index, edge_attr):
        source, target = edge_index
        basis, slots = spline_basis(edge_attr, self.kernel_size, self.is_open_spline, self.degree)
        messages = spline_weighting(x[source], self.weight, basis, slots)
        sums = torch.zeros(len(x), messages.shape[1]).index_add_(0, target, messages)
        counts = torch.zeros(len(x)).index_add_(0, target, torch.ones(len(target)))
        out = sums / counts.clamp(min=1)[:, None]
        out = out if self.lin is None else out + self.lin(x)
        return out if self.bias is None else out + self.bias


def readout(x, pos, columns, rows):
    cell = (pos[:, 1] * rows).long() * columns + (pos[:, 0] * columns).long()
    found = [x[cell == i].amax(0) if (cell == i).any() else torch.zeros(x.shape[1]) for i in range(columns * rows)]
    return torch.cat(found)


def normalised(norm):
    """With its own statistics, as after a training."""
    norm.running_mean.normal_(0, 0.3)
    norm.running_var.uniform_(0.5, 2)
    torch.nn.init.normal_(norm.weight, 1, 0.2)
    torch.nn.init.normal_(norm.bias, 0, 0.2)
    return norm


@pytest.fixture
def splines():
    torch.manual_seed(1)
    model = torch.nn.Module()
    model.conv1, model.conv2 = SplineConv(1, 4, [2, 2, 2]), SplineConv(4, 4, [3, 2], bias=False)
    model.norm1 = normalised(torch.nn.BatchNorm1d(4))
    model.norm2 = normalised(torch.nn.BatchNorm1d(4, eps=1e-3))
    model.elu, model.fc1, model.fc2 = torch.nn.ELU(), torch.nn.Linear(24, 5), torch.nn.Linear(5, 2)
    model.relu = torch.nn.ReLU()
    return model.eval()


def test_a_model_of_splines_runs_in_ten_lines_and_predicts_what_torch_predicts(splines):
    model, events = splines, make_events(200)

    def forward(graph):
        first = model.norm1(model.elu(model.conv1(graph.x, graph.edge_index, graph.edge_attr)))
        second = model.norm2(model.elu(model.conv2(first, graph.edge_index, graph.edge_attr[:, :2]))) + first
        return model.fc2(model.relu(model.fc1(readout(second, graph.pos, 3, 2))))

    stages = [model.conv1, model.elu, model.norm1, model.conv2, model.elu, model.norm2, Add("conv1"), Readout(3, 2)]
    description, weights = export(
        [*stages, model.fc1, model.relu, torch.nn.Dropout(), model.fc2],
        graph=GRAPH,
        outputs=["roll", "pitch"],
        unit="rad",
    )
    engine = meissner.Engine(description, SENSOR, weights)
    assert compare(engine, forward, events) < 1e-5
    assert weights.card.trained is None, "nobody said so"
    assert [layer["name"] for layer in description.layers] == ["conv1", "conv2", "readout1", "dense1", "dense2"]
    # The comparison finds a difference: here of one weight.
    model.fc2.bias.data[0] += 0.01
    assert compare(engine, forward, events) > 1e-4
    batch = meissner.Batch(description, SENSOR, weights)
    batch.push(events)
    assert batch.predict().values.tobytes() == engine.predict().values.tobytes()


def test_a_model_with_pooling_has_the_levels_that_its_list_says(splines):
    model = splines
    head = torch.nn.Linear(16, 3)
    description, weights = export(
        [("first", model.conv1), model.norm1, Pool(("1/8", "1/6"), 0.4, time="1/2"), model.conv2, model.elu, Readout(2, 2), head],
        graph=GRAPH,
        classes=["left", "right", "none"],
        name="pooled",
    )
    assert description.classes == ("left", "right", "none")
    layers = {layer["name"]: layer for layer in description.layers}
    assert (layers["first"]["elu"], layers["first"]["norm"]) == (False, True)
    assert (layers["conv2"]["elu"], layers["conv2"]["norm"], layers["conv2"]["level"]) == (True, False, 1)
    engine = meissner.Engine(description, SENSOR, weights)
    events = make_events(300)
    engine.push(events)
    prediction = engine.predict()
    # The first block is on the event level: the values of torch for it are available.
    graph = engine.graph()
    with torch.no_grad():
        expected = model.norm1(model.conv1(*(torch.from_numpy(a) for a in (graph.x, graph.edge_index, graph.edge_attr))))
    assert np.allclose(engine.activations()["first"], expected.numpy(), atol=1e-5)
    assert prediction.label in description.classes


def test_a_spline_convolution_of_torch_geometric_is_taken_as_it_is(monkeypatch):
    nn = pytest.importorskip("torch_geometric.nn")
    module = importlib.import_module("torch_geometric.nn.conv.spline_conv")
    # Its two functions are compiled ones, which are not available everywhere.
    monkeypatch.setattr(module, "spline_basis", spline_basis)
    monkeypatch.setattr(module, "spline_weighting", spline_weighting)
    torch.manual_seed(3)
    conv, elu, fc = nn.SplineConv(1, 4, dim=3, kernel_size=[3, 2, 2]), torch.nn.ELU(), nn.Linear(16, 2)
    torch.nn.init.normal_(conv.bias)

    def forward(graph):
        return fc(readout(elu(conv(graph.x, graph.edge_index, graph.edge_attr)), graph.pos, 2, 2))

    description, weights = export([conv, elu, Readout(2, 2), fc], graph=GRAPH, outputs=["a", "b"])
    assert compare(meissner.Engine(description, SENSOR, weights), forward, make_events(200)) < 1e-5
    closed = nn.SplineConv(1, 4, dim=3, kernel_size=3, is_open_spline=False)
    with pytest.raises(meissner.DescriptionError, match="open splines"):
        export([closed, elu, Readout(2, 2), fc], graph=GRAPH, outputs=["a", "b"])


def test_pointnet_convolutions_and_batch_norms_of_torch_geometric_are_taken_as_they_are():
    nn = pytest.importorskip("torch_geometric.nn")
    torch.manual_seed(2)
    conv1, conv2 = nn.PointNetConv(torch.nn.Linear(4, 6)), nn.PointNetConv(torch.nn.Linear(9, 5, bias=False))
    norm, relu, fc = nn.BatchNorm(6).eval(), torch.nn.ReLU(), torch.nn.Linear(20, 2)
    normalised(norm.module)

    def forward(graph):
        # An engine divides the offset of an edge by the scale.
        pos = graph.pos / GRAPH["scale"]
        first = norm(relu(conv1(graph.x, pos, graph.edge_index)))
        second = relu(conv2(first, pos, graph.edge_index))
        return fc(readout(second, graph.pos, 2, 2))

    description, weights = export(
        [conv1, relu, norm, conv2, relu, Readout(2, 2), fc], graph=GRAPH, outputs=["a", "b"]
    )
    engine = meissner.Engine(description, SENSOR, weights)
    assert compare(engine, forward, make_events(200)) < 1e-5


def test_what_an_engine_does_not_compute_is_refused_with_its_place(splines):
    model = splines
    conv, elu, relu, norm = model.conv1, model.elu, model.relu, model.norm1
    weighted = SplineConv(1, 4, [2, 2, 2])
    weighted.aggr = "add"
    square = SplineConv(1, 4, [2, 2, 2])
    square.degree = 2
    for stages, text in [
        ([conv, relu], r"stage 1 \(ReLU\): expected ELU right after the spline convolution"),
        ([conv, norm, elu], r"stage 2 \(ELU\): expected ELU right after"),
        ([conv, elu, norm, norm], r"stage 3 .*expected one batch norm a block"),
        ([norm], r"stage 0 .*after a layer of kind block, found nothing before it"),
        ([conv, torch.nn.Linear(4, 2)], r"after a layer of kind readout or dense, found block before it"),
        ([weighted], r"aggregation 'mean', found 'add'"),
        ([square], r"splines of degree 1, found 2"),
        ([torch.nn.Conv2d(1, 1, 1)], r"stage 0 \(Conv2d\): expected SplineConv, PointNetConv, .* found Conv2d"),
        ([conv, elu, Add("events"), Add("events")], r"one skip connection a block"),
    ]:
        with pytest.raises(meissner.DescriptionError, match=text):
            export(stages, graph=GRAPH, outputs=["a", "b"])


def test_a_comparison_refuses_more_than_a_window(splines):
    description, weights = export(
        [splines.conv1, Readout(1, 1), torch.nn.Linear(4, 1)], graph=GRAPH, outputs=["a"], capacity=10
    )
    engine = meissner.Engine(description, SENSOR, weights)
    with pytest.raises(meissner.InputError, match="at most one window, found 20 events of which 10 are in it"):
        compare(engine, lambda graph: graph.x[0], make_events(20))
    with pytest.raises(meissner.InputError, match="expected 1 outputs, found 2"):
        compare(engine, lambda graph: torch.zeros(2), make_events(5))
