"""`meissner.torch` against the engine, and the promises of a training. Needs torch and safetensors; `.ci/python` states where it runs."""

import copy
import importlib.util
import inspect
import pickle
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from conftest import SENSOR, make_events

import meissner

torch = pytest.importorskip("torch")
pytest.importorskip("safetensors")

from meissner.torch import Film, Module, Presses, Readouts, errors, fit, moved, save  # noqa: E402
from meissner.torch import _layers  # noqa: E402
from meissner.torch._graphs import Level, columns_of  # noqa: E402
from safetensors.numpy import load_file, save_file  # noqa: E402

torch.set_num_threads(1)
SKIN = (241, 357)
OWN = {
    "network": {"name": "own", "span_us": 40_000, "capacity": 150, "place": ["1/8", "1/6"]},
    "graph": {"kind": "knn", "k": 6, "candidates": "past", "lifetime": "frozen", "scale": 0.2},
    "layer": [
        {"name": "train", "kind": "spline", "channels": 4, "kernel": [2, 3, 4], "bias": True, "root": True, "elu": False},
        {"name": "half", "kind": "pointnet", "channels": 4, "skip": "train"},
        {"name": "pool", "kind": "pool", "cell": ["1/8", "1/6"], "time": "1/2", "position": "mean", "scale": 0.4},
        {"name": "up", "kind": "pointnet", "channels": 5},
        {"name": "down", "kind": "spline", "channels": 5, "kernel": [2, 2], "skip": "up", "norm": False},
        {"name": "grid", "kind": "readout", "grid": [4, 3], "by_time": True},
        {"name": "out", "kind": "dense", "outputs": 2},
    ],
    "output": {"names": ["a", "b"], "unit": "rad"},
}
PRESSES = {
    "network": {"name": "presses", "span_us": 50_000, "place": ["1/6", "1/4"]},
    "graph": {"kind": "knn", "k": 4, "candidates": "past", "lifetime": "frozen", "scale": 0.2},
    "layer": [
        {"name": "block", "kind": "spline", "channels": 6, "kernel": 2, "root": True},
        {"name": "grid", "kind": "readout", "grid": [6, 4], "aggregation": "sum"},
        {"name": "hidden", "kind": "dense", "outputs": 8, "activation": "relu"},
        {"name": "out", "kind": "dense", "outputs": 2},
    ],
    "output": {"names": ["depth", "pitch"], "unit": ["mm", "rad"]},
}


def streams_for(network, sensor):
    """A stream that ends within a window, a longer one, a short one and a silent one."""
    span = meissner.Description(network).span_us
    plans = enumerate([(300, 0.8), (400, 1.7), (20, 0.1)])
    streams = [make_events(count, seed, sensor, every_us=int(share * span / count)) for seed, (count, share) in plans]
    return [*streams, streams[0][:0]]


def near(found, expected):
    assert found.shape == expected.shape and np.isfinite(expected).all()
    assert np.abs(found - expected).max() <= 1e-5 * max(1, np.abs(expected).max())


@pytest.mark.parametrize("name", meissner.networks("events"))
@pytest.mark.filterwarnings("ignore::meissner.MeissnerWarning")
def test_shipped_networks_over_events_give_the_values_of_the_engine(name):
    sensor = SKIN if name.startswith("touch") else SENSOR
    streams = streams_for(name, sensor)
    module = Module.from_description(name, meissner.Weights.shipped(name)).eval()
    with torch.no_grad():
        found = module(module.graphs(sensor, streams).batch(range(len(streams)))).numpy()
    near(found, meissner.Batch(name, sensor, search="grid", check_preparation=False).predict_all(streams))


@pytest.mark.parametrize("name", meissner.networks("frames"))
def test_shipped_networks_over_frames_give_the_values_of_the_engine(name):
    module, engine = Module.from_description(name, meissner.Weights.shipped(name)).eval(), meissner.FrameEngine(name)
    steps = module.said["source"].get("steps", 4) if module.remembers else 1
    frames = np.random.default_rng(1).random((steps, *module.said["input"])).astype(np.float32)
    frames = {"signed": np.rint(6 * frames - 3), "event-counts": (frames < 0.02) / np.float32(8)}.get(module.said["source"]["frames"], frames)
    expected = []
    for frame in frames.astype(np.float32):
        engine.push(frame)
        expected.append(engine.predict().values)
    given = torch.from_numpy(frames.astype(np.float32))
    with torch.no_grad():
        near(module(given[None] if module.remembers else given).numpy().reshape(steps, -1), np.stack(expected).reshape(steps, -1))
        if module.remembers:
            near(module(given[None], last=True).numpy()[0], expected[-1])


def test_of_the_last_step_alone_is_computed_what_no_memory_reads():
    module, rows = Module.from_description("slip-best").train(), {}
    layer = module._layer
    module._layer = lambda said, read, *more: rows.setdefault(said["name"], len(read[0])) and layer(said, read, *more)
    module(torch.rand(3, 5, 48), last=True)
    # Batch norm gets the same input as in a prediction.
    assert rows.pop("lstm") == rows.pop("readings") == 15 and set(rows.values()) == {3}


@pytest.mark.parametrize("lifetime", ["frozen", "window"])
def test_blocks_of_all_kinds_agree_and_layers_may_have_the_names_of_methods(lifetime):
    own = OWN | {"graph": OWN["graph"] | {"lifetime": lifetime}}
    weights, streams = meissner.Weights.draw(own, 5), streams_for(own, SENSOR)
    module = Module.from_description(own, weights).eval()
    with torch.no_grad():
        found = module(module.graphs(SENSOR, streams).batch(range(4))).numpy()
    near(found, meissner.Batch(own, SENSOR, weights).predict_all(streams))


@pytest.mark.parametrize("channels", [1, 3, 8, 13, 24, 40])
@pytest.mark.parametrize("kernel", [(2, 2, 2), (3, 1, 4)])
def test_sums_over_in_edges_and_their_gradient_are_those_in_double_precision(kernel, channels):
    torch.manual_seed(channels)
    rows, k = 9000, 5
    level = Level(source=torch.randint(rows, (rows, k)), there=torch.rand(rows, k) < 0.7, attribute=torch.rand(rows, k, 3))
    level.attribute[:100].round_()
    x, gradient = torch.randn(rows, channels, requires_grad=True), torch.randn(rows, np.prod(kernel) * channels)
    found = _layers.spline_sums(x, level, kernel)
    # PyTorch's gather, product and scatter.
    doubled = replace(level, attribute=level.attribute.double())
    expected = _layers.spline_sums(x.double(), doubled, kernel)
    near(found.detach().numpy(), expected.detach().numpy())
    near(*(torch.autograd.grad(sums, x, gradient.to(sums.dtype))[0].numpy() for sums in (found, expected)))
    with pytest.raises(meissner.InputError, match=r"source: expected 0 to 9000, found 9000"):
        _layers.spline_sums(x, replace(level, source=level.source + 1), kernel)


@pytest.mark.filterwarnings("ignore::meissner.MeissnerWarning")
def test_a_network_trained_in_other_units_has_the_engines_tensors():
    module = Module.from_description(PRESSES, seed=3, unit=[2.0, 0.1], gain={"hidden": 0.01}).eval()
    stream = make_events(300)
    engine = meissner.Engine(PRESSES, SENSOR, module)
    engine.push(stream)
    given = module.graphs(SENSOR, [stream]).batch(range(1))
    with torch.no_grad():
        near(module(given).numpy()[0], engine.predict().values)
        again = Module.from_description(PRESSES, meissner.Weights(module), unit=[1.0, 5.0]).eval()
        near(again(given).numpy()[0], engine.predict().values)
    assert torch.allclose(module.state_dict()["out.bias"], module["out.bias"] * torch.tensor([2.0, 0.1]))
    # Copies and modules around it also have the engine's tensors.
    other = copy.deepcopy(module)
    other.gain["hidden"] = 1.0
    around = torch.nn.Sequential(other)
    around.load_state_dict({f"0.{name}": tensor for name, tensor in module.state_dict().items()})
    with torch.no_grad():
        near(pickle.loads(pickle.dumps(around))[0](given).numpy()[0], engine.predict().values)
    assert all(torch.allclose(tensor, around.state_dict()[f"0.{name}"]) for name, tensor in module.state_dict().items())
    with pytest.raises(meissner.WeightsError, match=r"hidden\.weight: expected shape"):
        module.load({"hidden.weight": torch.zeros(2, 2)}, ["hidden"])


def test_a_graph_is_read_at_any_time_and_mirrored():
    module, stream = Module.from_description(PRESSES, seed=1).eval(), columns_of(make_events(600, every_us=200))
    stream[:, 1:3] = np.clip(stream[:, 1:3], 3, (60, 44))
    graphs, times = module.graphs(SENSOR, [stream]), stream[[120, 300, 599], 0]
    with torch.no_grad():
        found = module(graphs.batch(range(1), times[None])).numpy()
        cut = module.graphs(SENSOR, [stream[stream[:, 0] <= end] for end in times])
        near(found, module(cut.batch(range(3))).numpy())
        mirrored = module(graphs.batch(range(1), times[None], ["columns", "rows"], (1, -2))).numpy()
        other = module.graphs(SENSOR, [moved(stream, SENSOR, ["columns", "rows"], (1, -2))])
        near(mirrored, module(other.batch(range(1), times[None])).numpy())


@pytest.fixture(scope="module")
def film(tmp_path_factory):
    """Presses with a number of events in proportion to their depth, more of them rising if pitch is positive."""
    random, folder = np.random.default_rng(0), tmp_path_factory.mktemp("film")
    tensors, start = {name: [] for name in ("t_us", "x", "y", "on")}, [0]
    depths, pitches = random.uniform(1, 4, 48), random.uniform(-1, 1, 48)
    for depth, pitch in zip(depths, pitches):
        count = int(60 * depth)
        tensors["t_us"].append(np.sort(random.integers(0, 40_000, count)))
        tensors["x"].append(np.clip(random.normal(32 + 16 * pitch, 6, count), 0, 63).astype(int))
        tensors["y"].append(random.integers(0, 48, count))
        tensors["on"].append(random.integers(0, 2, count))
        start.append(start[-1] + count)
    file = {name: np.concatenate(values).astype(np.int64) for name, values in tensors.items()} | {"start": np.array(start)}
    truth = {"t_us": np.tile([0, 40_000], 48), "start": 2 * np.arange(49)}
    truth |= {"depth": np.stack([0 * depths, depths], 1).ravel(), "pitch": np.stack([0 * pitches, pitches], 1).ravel()}
    truth = {f"truth.{name}": values.astype(np.int64 if name in ("t_us", "start") else np.float32) for name, values in truth.items()}
    save_file(file | truth, folder / "train.safetensors", {"sensor": "[64, 48]"})
    return folder / "train.safetensors"


def test_labels_are_taken_in_the_units_of_the_network(film, tmp_path):
    tensors = load_file(film)
    for unit, factor in ("rad", 1), ("deg", np.pi / 180):
        save_file(tensors, tmp_path / "a.safetensors", {"sensor": "[64, 48]", "units": f'{{"depth": "mm", "pitch": "{unit}"}}'})
        found = Film(tmp_path / "a.safetensors").at(["depth", "pitch"], 3, [0, 40_000], ["mm", "rad"])
        assert np.allclose(found[1], [tensors["truth.depth"][7], tensors["truth.pitch"][7] * factor])
    save_file(tensors, tmp_path / "a.safetensors", {"sensor": "[64, 48]", "units": '{"pitch": "N"}'})
    with pytest.raises(meissner.InputError, match="pitch in rad, found N"):
        errors(Module.from_description(PRESSES), Presses(tmp_path / "a.safetensors"))
    with pytest.raises(meissner.InputError, match="expected labels force, found"):
        Film(film).at(["force"], 0, [0])


def trained(film, epochs, **settings):
    module = Module.from_description(PRESSES, seed=1, unit=[1.0, 0.5], gain={"hidden": 0.05})
    lines = []
    history = fit(module, Presses(film, mirrors=["columns"], batch=8), epochs=epochs, rate=0.01, seed=4, log=lines.append, **settings)
    return module, history, lines


def test_a_training_is_repeated_and_goes_on_where_it_was_cut_off(film, tmp_path):
    valid = Presses(film)
    module, history, lines = trained(film, 6, valid=valid, check=2)
    assert history.losses[-1] < 0.7 * history.losses[0] and list(history.valid) == [2, 4, 6] and "pitch" in lines[1]
    assert abs(errors(module, valid)).mean() < abs(errors(trained(film, 1)[0], valid)).mean()

    class Cut(Exception):
        pass

    def cut(line):
        if line.startswith("epoch   4"):
            raise Cut

    settings = {"valid": valid, "check": 2, "checkpoint": tmp_path / "a.state"}
    with pytest.raises(Cut):
        again = Module.from_description(PRESSES, seed=1, unit=[1.0, 0.5], gain={"hidden": 0.05})
        fit(again, Presses(film, mirrors=["columns"], batch=8), epochs=6, rate=0.01, seed=4, log=cut, **settings)
    resumed, same, lines = trained(film, 6, **settings)
    assert same == history and len(lines) == 3
    assert all(torch.equal(a, b) for a, b in zip(module.state_dict().values(), resumed.state_dict().values()))
    with pytest.raises(meissner.InputError, match="another module"):
        fit(Module.from_description(OWN), valid, epochs=6, checkpoint=tmp_path / "a.state")


def test_the_best_or_the_mean_of_the_weights_stays_and_a_training_ends_early(film):
    said = iter([3.0, 1.0, 2.0, 2.5, 4.0])
    kept = []

    def valid(module):
        kept.append(module.state_dict()["out.bias"].clone())
        return next(said)

    module, history, _ = trained(film, 9, valid=valid, check=1, keep="best", patience=3)
    assert history.best == 2 and len(history.losses) == 5 and torch.equal(module.state_dict()["out.bias"], kept[1])
    module, _, _ = trained(film, 4, keep="mean")
    assert all(torch.isfinite(tensor).all() for tensor in module.state_dict().values())
    with pytest.raises(meissner.InputError, match="keep"):
        trained(film, 1, keep="best")


def test_what_is_behind_the_readout_learns_from_kept_readouts(film, tmp_path):
    module, _, _ = trained(film, 1)
    before = {name: tensor.clone() for name, tensor in module.state_dict().items()}
    readouts = Readouts(module, film, folder=tmp_path, ages=3, mirrors=["columns"], batch=8)
    wrong = abs(errors(module, readouts)).mean()
    assert wrong == pytest.approx(abs(errors(module, Presses(film))).mean(), rel=1e-2)
    fit(module, readouts, epochs=20, rate=0.01, learn=["hidden", "out"], valid=readouts, check=10, log=lambda _: None)
    assert abs(errors(module, readouts)).mean() < wrong
    after = module.state_dict()
    assert all(torch.equal(after[name], before[name]) == name.startswith("block") for name in after)


def test_recordings_of_classes(tmp_path):
    streams = [make_events(80, seed)[: 40 + 40 * (seed % 2)] for seed in range(24)]
    network = PRESSES | {"output": {"classes": ["few", "many"]}}
    module, film = Module.from_description(network, gain={"hidden": 0.05}), Film.of_classes(SENSOR, streams, np.arange(24) % 2)
    history = fit(module, Presses(film, batch=6), epochs=20, rate=0.02, valid=Presses(film), check=20, log=lambda _: None)
    assert history.losses[-1] < history.losses[0] and history.valid[20] < 0.2
    assert save(module, tmp_path / "classes.safetensors", {"sensor": [64, 48]}) == []
    engine = meissner.Engine(network, SENSOR, tmp_path / "classes.safetensors")
    engine.push(streams[1])
    assert engine.predict().label == "many"


def test_frames_of_presses(film):
    network = {
        "network": {"name": "signed"},
        "input": {"kind": "image", "channels": 1, "height": 48, "width": 64, "frames": "signed", "span_us": 50_000},
        "layer": [
            {"name": "mean", "kind": "average_pool", "size": 8},
            {"name": "flat", "kind": "flatten"},
            {"name": "out", "kind": "dense", "outputs": 2},
        ],
        "output": PRESSES["output"],
    }
    module, presses = Module.from_description(network), Presses(film, batch=8)
    events = presses.films[0].events[0]
    frame = meissner.frames_for(network, SENSOR)
    frame.push(t=events[:, 0], x=events[:, 1], y=events[:, 2], p=events[:, 3])
    assert np.array_equal(module.graphs(SENSOR, [events]).batch(range(1)).numpy()[0], frame.frame().values)
    assert fit(module, presses, epochs=2, log=lambda _: None).losses[0] > 0


def test_saved_weights_have_a_card_and_half_precision(film, tmp_path):
    module, path = trained(film, 1)[0], tmp_path / "own.safetensors"
    assert save(module, path, {"about": "a test", "stride": 2, "sensor": [64, 48]}, half=True) == []
    weights = meissner.Weights(path)
    assert weights.card.trained and weights.card.about == "a test" and weights.card.stride == 2 and weights.card.sensor == SENSOR
    assert weights.card.preparation == meissner.Description(PRESSES).summary()["preparation"]
    assert load_file(path)["hidden.weight"].dtype == np.float16 and load_file(path)["out.bias"].dtype == np.float32


def test_tensors_that_do_not_fit_are_refused_by_name_and_nothing_is_written(tmp_path):
    state, path = Module.from_description(PRESSES).state_dict(), tmp_path / "own.safetensors"
    for changed, message in [
        ({"out.weight": torch.zeros(8, 2)}, r"out\.weight.*\[2, 8\]"),
        ({"out.bias": torch.tensor([0.0, torch.nan])}, "out.bias"),
        ({"out.bias": torch.tensor([0.0, 1e300], dtype=torch.float64)}, "out.bias"),
    ]:
        with pytest.raises(meissner.WeightsError, match=message):
            save(state | changed, path, network=PRESSES)
    with pytest.raises(meissner.WeightsError, match=r"out\.weight.*\[2, 8\], found no such tensor"):
        save({name: tensor for name, tensor in state.items() if name != "out.weight"}, path, network=PRESSES)
    with pytest.raises(meissner.WeightsError, match="half precision.*hidden.weight"):
        save(state | {"hidden.weight": torch.full((8, 144), 1e5)}, path, network=PRESSES, half=True)
    with pytest.raises(meissner.WeightsError, match="stride"):
        save(state, path, {"stride": "many"}, network=PRESSES)
    assert list(tmp_path.iterdir()) == []
    other = {f"net.{name}".replace("out", "last"): tensor for name, tensor in state.items()} | {"spare": torch.zeros(3)}
    assert save(other, path, network=PRESSES, names={"net.": "", "net.last.": "out."}) == ["spare"]
    assert set(meissner.Weights(path)) == set(state)


@pytest.mark.parametrize("task", ["angle", "digits", "force", "slip", "tactip", "touch"])
def test_recipes_train_shipped_networks_with_settings_that_exist(task, monkeypatch):
    folder = Path(__file__).parents[3] / "models" / "train"
    monkeypatch.setattr(sys, "path", [str(folder), str(folder / task), *sys.path])
    spec = importlib.util.spec_from_file_location(f"recipe_{task}", folder / task / "train.py")
    recipe = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(recipe)
    plans = {task: getattr(recipe, "STAGES", {})} if task == "force" else getattr(recipe, "STAGES", {})
    networks = [*getattr(recipe, "RECIPES", {}), *getattr(recipe, "PARTS", {}), *(plans if task != "force" else ["force-graph"])]
    assert networks and set(networks) <= set(meissner.networks())
    for stages in plans.values():
        for place, (name, stage) in enumerate(stages.items()):
            assert set(stage) <= {*recipe.stages.DEFAULT, "films", "valid", "unit", "readouts"}, name
            assert {start for start in stage.get("start", []) if start[0] != "/"} <= set(list(stages)[:place]), name
            assert set(stage.get("presses", {})) <= set(inspect.signature(Presses).parameters), name
            assert set(stage.get("readouts", {})) <= set(inspect.signature(Readouts).parameters), name
            assert set(stage["fit"]) <= set(inspect.signature(fit).parameters), name
