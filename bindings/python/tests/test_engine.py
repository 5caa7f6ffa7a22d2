"""The engine over events: predictions, state, graph, and equality with the batch."""

import copy
import json
import pickle
from pathlib import Path

import numpy as np
import pytest
from conftest import SENSOR, SMALL, make_events
from hypothesis import given, settings
from hypothesis import strategies as st

import meissner

FROZEN = {**SMALL, "graph": {"kind": "knn", "k": 4, "candidates": "past", "lifetime": "frozen", "scale": 0.2}}
PAST = {**SMALL, "graph": {"kind": "radius", "r": 0.3, "max": 6, "candidates": "past", "lifetime": "window", "scale": 0.3}}
NETWORKS = {"all": SMALL, "past": PAST, "frozen": FROZEN}
WEIGHTS = {name: meissner.Weights.draw(network, 5) for name, network in NETWORKS.items()}


def both(name, **options):
    return [kind(NETWORKS[name], SENSOR, WEIGHTS[name], **options) for kind in (meissner.Engine, meissner.Batch)]


def bits(prediction):
    return prediction.values.tobytes()


@st.composite
def streams(draw):
    """Bursts at hot spots or anywhere, with equal stamps, and silences between them, around the span of the window."""
    t, events = draw(st.sampled_from([0, -5_000, 1_700_000_000_000_000])), []
    for _ in range(draw(st.integers(1, 6))):
        t += draw(st.sampled_from([0, 1, 900, 24_999, 25_000, 50_000, 50_001, 9_999_900]))
        hot = draw(st.booleans())
        x, y = draw(st.integers(0, SENSOR[0] - 1)), draw(st.integers(0, SENSOR[1] - 1))
        step = draw(st.sampled_from([0, 0, 1, 70]))
        for _ in range(draw(st.integers(1, 40))):
            t += step
            if not hot:
                x, y = draw(st.integers(0, SENSOR[0] - 1)), draw(st.integers(0, SENSOR[1] - 1))
            events.append((t, x, y, draw(st.booleans())))
    return np.array(events, meissner.EVENT_DTYPE)


def test_an_event_after_long_silence_that_the_next_one_does_not_confirm_is_dropped():
    engine, batch = both("all")
    events = np.array([(0, 0, 0, False), (10_000_001, 0, 0, False), (20_000_002, 0, 0, False)], meissner.EVENT_DTYPE)
    for of in (engine, batch):
        with pytest.warns(meissner.MeissnerWarning, match="far ahead"):
            of.push(events)
            of.advance(20_000_002)
        counts = of.counters["events"]
        assert (counts["accepted"], counts["outliers"]) == (2, 1)


@pytest.mark.parametrize("name", NETWORKS)
@settings(max_examples=60, deadline=None)
@given(events=streams(), cuts=st.lists(st.integers(0, 240), max_size=4), pause=st.integers(0, 60_000))
def test_incremental_equals_batch_bit_for_bit(name, events, cuts, pause):
    engine, batch = both(name)
    for part in np.split(events, sorted(cut for cut in cuts if cut < len(events))):
        assert engine.push(part) == batch.push(part)
        assert bits(engine.predict()) == bits(batch.predict())
    for of in (engine, batch):
        of.advance(int(events["t"][-1]) + pause)
        assert of.counters["events"]["accepted"] == len(events)
    assert bits(engine.predict()) == bits(batch.predict())
    assert len(engine) == len(batch)


def test_the_filters_of_a_network_do_what_filters_before_it_do():
    refractory = {**SMALL, "filter": [{"kind": "refractory", "time_us": 900}]}
    hot = {**SMALL, "filter": [{"kind": "hot_pixel", "period_us": 1_000, "burst": 8}]}
    weights = meissner.Weights.draw(SMALL, 5)
    events = make_events(900)
    events["x"][::3], events["y"][::3] = 5, 5
    before = meissner.Filters(SENSOR, refractory_us=900)
    passed = before.push(events)
    expected = meissner.Engine(SMALL, SENSOR, weights)
    expected.push(passed)
    for kind in (meissner.Engine, meissner.Batch):
        of = kind(refractory, SENSOR, weights)
        with pytest.warns(meissner.MeissnerWarning, match="filters"):
            assert of.push(events) == len(passed)
        assert of.counters["events"]["filtered"] == len(events) - len(passed) > 100
        assert bits(of.predict()) == bits(expected.predict())
        of = kind(hot, SENSOR, weights)
        with pytest.warns(meissner.MeissnerWarning, match="may fire all the time"):
            of.push(events)
        assert of.counters["events"]["filtered"] > 280
    batch = meissner.Batch(hot, SENSOR, weights)
    assert batch.predict_all([events])[0].tobytes() == bits(of.predict())


STREAMS = json.loads((Path(__file__).parents[3] / "tests/golden/streams.json").read_text())


@pytest.mark.filterwarnings("ignore::meissner.MeissnerWarning")
@pytest.mark.parametrize("kind", [meissner.Engine, meissner.Batch])
@pytest.mark.parametrize("case", STREAMS, ids=[case["name"] for case in STREAMS])
def test_a_stream_has_the_bits_that_the_crates_have(case, kind):
    engine = kind(case["network"], case["sensor"], meissner.Weights.draw(case["network"], case["seed"]))
    for step in case["steps"]:
        match step:
            case ["advance", t_us]:
                engine.advance(t_us)
            case ["reset"]:
                engine.reset()
            case ["bytes"] if kind is meissner.Engine:
                state = engine.snapshot()
                engine.reset()
                engine.restore(state)
            case ["predict", expected, t_us, nodes]:
                prediction = engine.predict()
                assert prediction.values.view(np.uint32).tolist() == expected
                assert (prediction.t_us, prediction.nodes) == (t_us, nodes)
            case [int(t_us), x, y, on]:
                engine.push(np.array([(t_us, x, y, on)], meissner.EVENT_DTYPE))
    counts = engine.counters["events"]
    assert {key: counts[key] for key in case["counts"]} == case["counts"]


@pytest.mark.parametrize("name", NETWORKS)
def test_more_events_than_the_window_holds_evict_the_oldest_in_engine_and_batch(name):
    engine, batch = both(name, capacity=50)
    events = make_events(400, every_us=10)
    for part in np.array_split(events, 7):
        engine.push(part), batch.push(part)
        assert bits(engine.predict()) == bits(batch.predict())
    assert len(engine) == 50
    assert engine.counters["events"]["evicted"] > 300


def test_a_prediction_says_how_unlike_its_window_is_to_those_of_the_training(events):
    engine = meissner.Engine("tactigraph-past", SENSOR)
    engine.push(events)
    prediction = engine.predict()
    assert prediction.unlike > 1  # random events are not a press
    assert "unlike the training" in repr(prediction)


def test_a_prediction_over_frames_says_it_too():
    engine = meissner.FrameEngine("force-tdnn")
    engine.push(np.full(engine.input_shape, 5, np.float32))
    prediction = engine.predict()
    assert prediction.unlike > 1  # five events in every pixel
    assert "unlike the training" in repr(prediction)
    engine = meissner.FrameEngine("force-tdnn", meissner.Weights.draw("force-tdnn", 1))
    assert engine.predict().unlike is None


def test_a_prediction_has_names_units_time_and_cost(engine, events):
    before = engine.predict()
    assert before.t_us is None
    assert before.nodes == 0
    engine.push(events)
    prediction = engine.predict()
    assert prediction.values.dtype == np.float32
    assert prediction.values.shape == (2,)
    assert (prediction.names, prediction.units) == (("a", "b"), ("rad", "rad"))
    assert prediction.t_us == events["t"][-1]
    assert prediction.unlike is None
    assert prediction.nodes == len(engine)
    assert list(prediction.rows) == ["block1", "pool1", "block2"]
    assert prediction.rows["block1"] >= len(engine)
    assert prediction["b"] == prediction[1] == prediction.as_dict()["b"] == prediction.values[1]
    assert np.array_equal(np.asarray(prediction), prediction.values)
    assert [*prediction] == [*prediction.values]
    assert repr(prediction).startswith("<Prediction: a ")
    assert prediction.label is prediction.probabilities is None
    assert engine.predict().rows == dict.fromkeys(prediction.rows, 0)
    with pytest.raises(KeyError, match="expected one of a, b"):
        prediction["c"]


def test_classes_have_probabilities_and_a_label():
    engine = meissner.Engine("digits-past", (34, 34))
    engine.push(make_events(300, sensor=(34, 34)))
    prediction = engine.predict()
    assert prediction.names[int(prediction.values.argmax())] == prediction.label
    assert prediction.probabilities.sum() == pytest.approx(1, abs=1e-6)
    assert prediction.label in engine.description.classes


def test_predict_into_writes_the_same_bits_and_refuses_other_arrays(engine, events):
    engine.push(events)
    out = np.zeros(2, np.float32)
    engine.predict_into(out)
    assert out.tobytes() == bits(engine.predict())
    before = engine.counters
    for bad, error in [
        (np.zeros(3, np.float32), meissner.InputError),
        (np.zeros(4, np.float32)[::2], meissner.InputError),
        (np.zeros(2), meissner.DtypeError),
        ([0.0, 0.0], meissner.DtypeError),
        (np.frombuffer(bytes(8), np.float32), meissner.InputError),
    ]:
        with pytest.raises(error, match="out: expected a writable contiguous array of 2 float32"):
            engine.predict_into(bad)
    assert engine.counters == before, "a refused call counts nothing"
    with pytest.raises(meissner.InputError, match=str(2**64 - 1)):
        meissner.Engine(SMALL, SENSOR, meissner.Weights.draw(SMALL, 3), capacity=2**64 - 1)


def test_a_copy_and_a_restored_snapshot_continue_with_the_same_bits(engine, events):
    engine.push(events[:300])
    state, twin, deep = engine.snapshot(), copy.copy(engine), copy.deepcopy(engine)
    engine.push(events[300:])
    expected = bits(engine.predict())
    other = meissner.Engine(SMALL, SENSOR, meissner.Weights.draw(SMALL, 3))
    other.restore(state)
    for of in (other, twin, deep):
        of.push(events[300:])
        assert bits(of.predict()) == expected
        assert len(of) == len(engine)


def test_a_snapshot_of_another_network_or_with_damage_leaves_the_state(engine, events):
    engine.push(events)
    before, state = bits(engine.predict()), engine.snapshot()
    other = meissner.Engine(SMALL, SENSOR, meissner.Weights.draw(SMALL, 4))
    for bad, text in [(other.snapshot(), "expected network"), (state[:-1], "snapshot"), (b"", "snapshot")]:
        with pytest.raises(meissner.SnapshotError, match=text):
            engine.restore(bad)
    assert bits(engine.predict()) == before


def test_a_reset_forgets_events_and_keeps_counters(engine, events):
    empty = bits(engine.predict())
    engine.push(events)
    engine.reset()
    assert (len(engine), engine.now_us, bits(engine.predict())) == (0, None, empty)
    assert engine.counters["events"]["pushed"] == len(events)


def test_time_moves_and_events_expire(engine, events):
    engine.push(events)
    assert engine.now_us == events["t"][-1]
    assert engine.epoch_us == events["t"][0]
    window = engine.events
    assert window.dtype == meissner.EVENT_DTYPE
    assert np.array_equal(window, events[-len(engine) :])
    engine.advance(int(events["t"][-1]) + 50_001)
    assert len(engine) == 0
    assert bool(engine)


def test_a_clock_that_restarts_resets_engine_and_batch_or_keeps_its_time():
    before, after = make_events(200, start_us=60_000_000), make_events(200, seed=1)
    ahead = after[:1].copy()
    ahead["t"] = 10**15
    events = np.concatenate([before, after[:100], ahead, after[100:]])
    weights = meissner.Weights.draw(SMALL, 1)
    for restart, late, outliers, restarts in [("reset", False, 1, 1), ("keep", True, 0, 0)]:
        engine = meissner.Engine(SMALL, SENSOR, weights, restart=restart)
        batch = meissner.Batch(SMALL, SENSOR, weights, restart=restart)
        for runs in (engine, batch):
            with pytest.warns(meissner.MeissnerWarning, match="restarted" if restarts else "earlier"):
                runs.push(events)
            counts = runs.counters["events"]
            assert (counts["outliers"], counts["restarts"]) == (outliers, restarts)
            assert counts["pushed"] == len(events) and (counts["late"] > 0) == late
        assert engine.predict().values.tobytes() == batch.predict().values.tobytes()
        assert engine.now_us == batch.now_us == (after["t"][-1] if restarts else 10**15)
    for runs in (meissner.Engine, meissner.Batch):
        with pytest.raises(meissner.InputError, match='restart: expected "reset" or "keep", found "no"'):
            runs(SMALL, SENSOR, weights, restart="no")


@pytest.mark.parametrize("name", NETWORKS)
def test_the_graph_is_that_of_the_batch_in_the_layout_of_pytorch_geometric(name, events):
    engine, batch = both(name)
    engine.push(events), batch.push(events)
    found, expected = engine.graph(), batch.graph()
    nodes = len(engine)
    assert found.edge_index.dtype == np.int64
    assert found.edge_index.shape == (2, found.num_edges)
    assert found.edge_attr.shape == (found.num_edges, 3)
    assert found.x.shape == (nodes, 1)
    assert found.pos.shape == (nodes, 3)
    for field in ("edge_index", "edge_attr", "x", "pos"):
        assert np.array_equal(getattr(found, field), getattr(expected, field)), field
    scale = np.float32(0.3 if name == "past" else 0.2)
    source, target = found.edge_index
    u = (found.pos[source] - found.pos[target]) / (2 * scale) + 0.5
    assert np.allclose(found.edge_attr, u.clip(0, 1), atol=1e-5)
    assert np.array_equal(found.x[:, 0], np.where(engine.events["p"], 1, -1))
    levels = batch.graphs()
    assert [len(level) for level in levels] == [nodes, len(batch.activations()["pool1"])]


@pytest.mark.parametrize("name", NETWORKS)
def test_every_layer_has_the_bits_of_the_batch(name, events):
    engine, batch = both(name)
    engine.push(events), batch.push(events)
    engine.predict()
    found, expected = engine.activations(), batch.activations()
    assert list(found) == ["block1", "pool1", "block2"]
    for layer, values in found.items():
        assert values.tobytes() == expected[layer].tobytes(), layer


def test_a_batch_of_streams_is_the_batch_of_each():
    streams = [make_events(100, seed) for seed in range(20)]
    together = meissner.Batch(SMALL, SENSOR, WEIGHTS["all"], search="grid").predict_all(streams)
    assert together.shape == (20, 2)
    for stream, row in zip(streams, together, strict=True):
        batch = meissner.Batch(SMALL, SENSOR, WEIGHTS["all"])
        batch.push(stream)
        assert bits(batch.predict()) == row.tobytes()
    with pytest.raises(meissner.InputError, match="times: expected none to descend"):
        meissner.Batch(SMALL, SENSOR, WEIGHTS["all"]).predict_all([streams[0][::-1]])


def test_a_network_without_an_incremental_form_runs_as_a_batch(events):
    with pytest.raises(meissner.NotIncrementalError, match="run it in batch mode") as raised:
        meissner.Engine("graphres-published", SENSOR)
    assert isinstance(raised.value, ValueError)
    batch = meissner.Batch("graphres-published", SENSOR)
    batch.push(events[:50])
    assert np.isfinite(batch.predict().values).all()


def test_arguments_out_of_range_are_refused_with_what_was_expected():
    weights = WEIGHTS["all"]
    for sensor in [(0, 5), (70_000, 5), (5,), (1, 2, 3, 4)]:
        with pytest.raises(meissner.InputError, match="sensor: expected"):
            meissner.Engine(SMALL, sensor, weights)
    with pytest.raises(meissner.DtypeError, match="sensor: expected .width, height."):
        meissner.Engine(SMALL, "large", weights)
    with pytest.raises(meissner.MemoryLimitError, match="at most 1000 bytes") as raised:
        meissner.Engine(SMALL, SENSOR, weights, memory_limit=1000)
    assert isinstance(raised.value, MemoryError)
    with pytest.raises(meissner.InputError, match="tolerance"):
        meissner.Engine(SMALL, SENSOR, weights, tolerance=-1)
    for sensor in [(34, 34, 2), np.array([34, 34]), [np.uint16(34), 34]]:  # the first in the form of tonic
        assert meissner.Engine(SMALL, sensor, weights).sensor == (34, 34)


def test_a_tolerance_is_an_approximation_that_is_counted(events):
    engine = meissner.Engine(SMALL, SENSOR, WEIGHTS["all"], tolerance=0.5)
    for part in np.array_split(events, 50):
        engine.push(part)
        engine.predict()
    assert engine.counters["layers"]["block1"]["within_tolerance"] > 0


def test_descriptions_and_weights_can_be_pickled_and_engines_can_be_sent_as_their_state(engine, events):
    engine.push(events)
    description, weights, state = pickle.loads(
        pickle.dumps((engine.description, meissner.Weights.draw(SMALL, 3), engine.snapshot()))
    )
    other = meissner.Engine(description, engine.sensor, weights)
    other.restore(state)
    assert bits(other.predict()) == bits(engine.predict())
