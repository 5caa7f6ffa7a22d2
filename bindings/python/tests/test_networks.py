"""Descriptions and weights, from all forms that a user may have."""

import numpy as np
import pytest
from conftest import SENSOR, SMALL, make_events

import meissner


def test_every_network_by_name_has_a_description_a_card_and_its_text():
    names = meissner.networks()
    assert names == meissner.networks("events") + meissner.networks("frames")
    assert "tactigraph-past" in names
    for name in names:
        description = meissner.Description(name)
        assert (description.name, description.kind in ("events", "frames")) == (name, True)
        assert meissner.Description(description.to_toml()) == description
        assert isinstance(meissner.Card.shipped(name).trained, bool)
    with pytest.raises(meissner.InputError, match='kind: expected "events", "frames" or None'):
        meissner.networks("both")


def test_a_description_is_the_same_from_a_dict_a_text_a_file_and_a_path(tmp_path):
    from_dict = meissner.Description(SMALL)
    path = tmp_path / "own.toml"
    path.write_text(from_dict.to_toml())
    for source in (from_dict, from_dict.to_toml(), path, str(path)):
        assert meissner.Description(source) == from_dict
    unset = {**SMALL, "network": {**SMALL["network"], "normalisation": None}}
    assert meissner.Description(unset) == from_dict


def test_a_description_tells_what_it_is():
    description = meissner.Description(SMALL)
    assert (description.span_us, description.capacity, description.input_shape) == (50_000, 256, None)
    assert (description.outputs, description.units, description.classes) == (("a", "b"), ("rad", "rad"), None)
    assert [layer["name"] for layer in description.layers] == ["block1", "pool1", "block2", "readout", "out"]
    assert description.tensors["block1.conv.weight"] == (8, 1, 4)
    assert description.parameters == sum(
        int(np.prod(shape)) for name, shape in description.tensors.items() if "running" not in name
    )
    assert description.summary()["graph"]["kind"] == "knn"
    assert description._repr_svg_().startswith("<svg")
    assert "digraph" in description.to_dot()
    assert "block2" in str(description)
    assert repr(description) == f'<Description "small": events to a, b (rad), {description.parameters} parameters>'
    assert meissner.Description("digits-past").classes == tuple("0123456789")


def test_an_inconsistent_description_names_every_problem_with_its_line():
    with pytest.raises(meissner.DescriptionError) as raised:
        meissner.Description('[network]\nname = "mine"\nspan = 5\n')
    assert (3, None, 'unknown key "span": expected one of capacity, name, normalisation, place, span_us') in (
        raised.value.problems
    )
    assert "line 3" in str(raised.value)
    wrong = {**SMALL, "graph": {**SMALL["graph"], "k": "four"}}
    with pytest.raises(meissner.DescriptionError, match="k: expected .*found"):
        meissner.Description(wrong)
    with pytest.raises(meissner.DescriptionError, match='or the path of a .toml file, found "tactigraf"'):
        meissner.Description("tactigraf")
    with pytest.raises(meissner.FileError, match="cannot read") as missing:
        meissner.Description("missing.toml")
    assert isinstance(missing.value, OSError)
    with pytest.raises(TypeError, match="network: expected a name, a path, a text of TOML, a dict"):
        meissner.Description(3)
    with pytest.raises(TypeError, match="network.graph: expected a table, a list"):
        meissner.Description({"graph": object()})


def test_networks_over_frames_and_over_events_have_their_own_engines():
    with pytest.raises(meissner.DescriptionError, match="FrameEngine runs it"):
        meissner.Engine("slip-lstm", SENSOR)
    with pytest.raises(meissner.DescriptionError, match="Engine runs it"):
        meissner.FrameEngine("tactigraph-past")


def test_weights_are_the_same_from_a_file_bytes_and_arrays(tmp_path):
    weights = meissner.Weights.draw(SMALL, 3)
    path = tmp_path / "weights.safetensors"
    weights.save(path, {"about": "drawn"})
    events = make_events(100)
    expected = None
    for source in (weights, path, str(path), weights.to_bytes(), dict(weights.items()), weights):
        engine = meissner.Engine(SMALL, SENSOR, source)
        engine.push(events)
        bits = engine.predict().values.tobytes()
        assert bits == (expected or bits)
        expected = bits
    assert meissner.Weights(path).metadata == {"about": "drawn"}
    assert meissner.Weights(weights, {"trained": "true"}).card.trained is True


def test_weights_are_a_mapping_to_arrays_with_a_card():
    weights = meissner.Weights.draw(SMALL, 3)
    assert list(weights) == weights.keys() == sorted(meissner.Description(SMALL).tensors)
    assert {name: array.shape for name, array in weights.items()} == meissner.Description(SMALL).tensors
    assert "block1.conv.weight" in weights and len(weights) == len(weights.keys()) == len(weights.values())
    assert weights["block1.conv.weight"].dtype == np.float32
    with pytest.raises(KeyError):
        weights["none"]
    assert weights.card.trained is False
    shipped = meissner.Weights.shipped("tactigraph-past").card
    assert (shipped.trained, shipped.sensor, shipped.stride) == (True, (346, 260), 1)
    assert meissner.Weights({**weights, "more": np.zeros(3)}).unused(SMALL) == ["more"]


def test_arrays_of_other_floats_become_float32_and_integers_no_network_reads_are_ignored():
    weights = meissner.Weights.draw(SMALL, 3)
    doubles = {name: np.asfortranarray(array.astype(np.float64)) for name, array in weights.items()}
    doubles["block1.norm.num_batches_tracked"] = np.array(7)
    assert meissner.Weights(doubles)["block1.conv.weight"].tobytes() == weights["block1.conv.weight"].tobytes()
    meissner.Engine(SMALL, SENSOR, doubles)
    prefixed = {f"module.{name}": array for name, array in weights.items()}
    meissner.Engine(SMALL, SENSOR, prefixed)


def test_weights_that_do_not_fit_name_every_tensor():
    tensors = dict(meissner.Weights.draw(SMALL, 3).items())
    tensors["out.bias"] = np.array([np.nan, 0], np.float32)
    tensors["block1.conv.weight"] = np.zeros((8, 1, 5))
    del tensors["block2.norm.bias"]
    with pytest.raises(meissner.WeightsError) as raised:
        meissner.Engine(SMALL, SENSOR, tensors)
    for text in ["expected shape [8, 1, 4], found [8, 1, 5]", "found NaN at index 0", '"block2.norm.bias"']:
        assert text in str(raised.value)
    with pytest.raises(meissner.WeightsError, match="Weights.draw.network, seed."):
        meissner.Engine(SMALL, SENSOR)
    with pytest.raises(meissner.WeightsError, match="neither"):
        meissner.Weights(b"no weights")
    with pytest.raises(meissner.DtypeError, match='tensor "a": expected numbers'):
        meissner.Weights({"a": np.array(["text"])})
    with pytest.raises(meissner.FileError):
        meissner.Weights("missing.safetensors")
    with pytest.raises(TypeError, match="weights: expected a path, bytes"):
        meissner.Weights(3)


def test_weights_under_other_names_are_taken_by_habits_or_renamed():
    weights = meissner.Weights.draw(SMALL, 3)
    compiled = {"model._orig_mod." + name.replace(".norm.", ".norm.module."): array for name, array in weights.items()}
    meissner.Engine(SMALL, SENSOR, compiled)
    others = meissner.Weights({name.replace("out.", "head."): array for name, array in weights.items()})
    with pytest.raises(meissner.WeightsError, match='left over of this shape: "head.weight"'):
        meissner.Engine(SMALL, SENSOR, others)
    meissner.Engine(SMALL, SENSOR, others.renamed({"head.": "out."}))
    with pytest.raises(meissner.WeightsError, match="map of names.*expected a tensor of the file"):
        weights.renamed({"none": "out.weight"})


def test_a_state_dict_of_torch_is_taken_as_it_is():
    torch = pytest.importorskip("torch")
    weights = meissner.Weights.draw(SMALL, 3)
    tensors = {name: torch.nn.Parameter(torch.from_numpy(array)) for name, array in weights.items()}
    tensors["out.bias"] = tensors["out.bias"].to(torch.bfloat16)
    taken = meissner.Weights(tensors)
    assert np.array_equal(taken["out.weight"], weights["out.weight"])
    assert np.array_equal(taken["out.bias"], tensors["out.bias"].detach().float().numpy())
    module = torch.nn.Linear(2, 3)
    assert np.array_equal(meissner.Weights(module)["bias"], module.bias.detach().numpy())


def test_tensors_of_torch_are_events_without_a_copy():
    torch = pytest.importorskip("torch")
    events = make_events(100)
    columns = {name: torch.from_numpy(events[name].astype(np.int64)) for name in "txyp"}
    weights = meissner.Weights.draw(SMALL, 3)
    one, other = (meissner.Engine(SMALL, SENSOR, weights) for _ in range(2))
    one.push(**columns), other.push(events)
    assert one.predict().values.tobytes() == other.predict().values.tobytes()
