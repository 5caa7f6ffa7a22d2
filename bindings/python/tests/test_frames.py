"""The engine over frames, and frames, voxel grids and time surfaces of events."""

import copy

import numpy as np
import pytest
from conftest import SENSOR, make_events

import meissner

NETWORK = {
    "network": {"name": "two-frames"},
    "input": {
        "kind": "image", "channels": 2, "height": 6, "width": 8,
        "frames": "event-counts", "period_us": 1000, "maximum": 4,
    },
    "layer": [
        {"name": "conv", "kind": "conv", "channels": 3, "kernel": 3, "activation": "relu"},
        {"name": "memory", "kind": "conv_lstm", "hidden": 2},
        {"name": "flat", "kind": "flatten"},
        {"name": "out", "kind": "dense", "outputs": 1},
    ],
    "output": {"names": ["force"], "unit": "N"},
}  # fmt: skip


def make(**options):
    return meissner.FrameEngine(NETWORK, meissner.Weights.draw(NETWORK, 1), **options)


@pytest.fixture
def frames():
    random = np.random.default_rng(0)
    return (random.random((12, 2, 6, 8)) < 0.1).astype(np.float32)


def test_frames_one_by_one_and_together_give_the_bits_of_computing_everything(frames):
    together, oracle = make(sparse=True, two_threads=True), make(skip="nothing")
    together.push(frames)
    for frame in frames:
        oracle.push(frame)
    assert together.predict().values.tobytes() == oracle.predict().values.tobytes()
    assert len(together) == together.predict().nodes == 12
    assert together.counters["frames"] == 12
    assert sum(layer["computed"] for layer in together.counters["layers"].values()) > 0


def test_frames_of_other_types_and_layouts_are_converted(frames):
    expected = make()
    expected.push(frames)
    for other in (frames.astype("f8"), frames.astype("u1"), frames.astype(bool), np.asfortranarray(frames), frames.tolist()):
        engine = make()
        engine.push(other)
        assert engine.predict().values.tobytes() == expected.predict().values.tobytes()


def test_what_is_no_frame_is_refused_before_the_first_one(frames):
    engine = make()
    for bad, error, text in [
        (frames[0, 0], meissner.InputError, r"expected shape \[2, 6, 8\], .*found \[6, 8\]"),
        (np.where(frames == 0, np.nan, frames), meissner.InputError, "finite values, found NaN as value"),
        (np.full((2, 6, 8), "x"), meissner.DtypeError, "expected numbers"),
        (np.zeros((2, 6, 8), complex), meissner.DtypeError, "expected numbers"),
    ]:
        with pytest.raises(error, match=text):
            engine.push(bad)
    assert len(engine) == 0


def test_a_copy_and_a_restored_snapshot_continue_with_the_same_bits(frames):
    engine = make()
    engine.push(frames[:5])
    state, twin, other = engine.snapshot(), copy.copy(engine), make()
    other.restore(state)
    out = np.zeros((1,), np.float32)
    for of in (engine, twin, other):
        of.push(frames[5:])
        of.predict_into(out)
        assert out.tobytes() == engine.predict().values.tobytes()
        assert len(of) == 12
    with pytest.raises(meissner.SnapshotError, match="expected skip nothing"):
        make(skip="nothing").restore(state)
    engine.reset()
    assert len(engine) == 0 and engine.has_state


def test_a_tolerance_is_a_number_and_other_words_are_refused():
    assert make(skip=0.1).predict().names == ("force",)
    with pytest.raises(meissner.InputError, match='skip: expected "exact", "nothing" or a number'):
        make(skip="some")
    with pytest.raises(meissner.InputError, match="tolerance"):
        make(skip=-1.0)


def test_a_network_that_predicts_images_has_their_shape():
    engine = meissner.FrameEngine("canf-plain")
    assert engine.output_shape == [1, 240, 320] == list(engine.predict().values.shape)


def test_frames_for_a_network_are_those_of_its_description():
    makes = meissner.frames_for(NETWORK, (8, 6))
    events = make_events(200, sensor=(8, 6), every_us=50)
    done = makes.push(events)
    counts, starts = meissner.event_frames(events, (8, 6), period_us=1000, maximum=4)
    assert makes.shape == (2, 6, 8)
    for frame, values, start in zip(done, counts, starts, strict=False):
        assert np.array_equal(frame, values) and frame.start_us == start
    engine = make()
    for frame in done:
        engine.push(frame)
    assert len(engine) == sum(frame.count for frame in done)
    with pytest.raises(meissner.InputError, match="crop"):
        meissner.frames_for(NETWORK, (4, 4))
    with pytest.raises(meissner.InputError, match="frames of events, found others"):
        meissner.frames_for("slip-lstm", (8, 6))
    assert type(meissner.frames_for("event-frame-cnn", (346, 260))) in (meissner.EventFrames, meissner.SlidingFrame)


def test_counts_are_those_of_numpy(events):
    frames, starts = meissner.event_frames(events, SENSOR, period_us=5000)
    expected = np.zeros_like(frames)
    window = (events["t"] - events["t"][0]) // 5000
    np.add.at(expected, (window, events["p"].astype(int), events["y"], events["x"]), 1)
    assert np.array_equal(frames, expected)
    assert np.array_equal(starts, events["t"][0] + 5000 * np.arange(len(frames)))


def test_a_silence_is_one_run_of_empty_frames():
    makes = meissner.EventFrames((4, 4), period_us=10)
    done = makes.push(t=[0, 10**12], x=[1, 2], y=[1, 2], p=[1, 0])
    assert [(frame.start_us, frame.count, frame.events) for frame in done] == [
        (0, 1, (0, 1)),
        (10, 10**11 - 1, (0, 0)),
    ]
    assert not done[1].values.any()
    assert makes.open().events == (1, 0)
    assert [frame.start_us for frame in makes.advance(10**12 + 10)] == [10**12]
    with pytest.raises(meissner.InputError, match="at most 100000 frames of 10 us, found 100000000001"):
        events = np.array([(0, 1, 1, True), (10**12, 2, 2, False)], meissner.EVENT_DTYPE)
        meissner.event_frames(events, (4, 4), period_us=10)


@pytest.mark.parametrize("rule", ["sum", "latest"])
def test_signed_frames_and_sliding_frames_are_those_of_numpy(events, rule):
    makes = meissner.SlidingFrame(SENSOR, 20_000, rule=rule)
    makes.push(events)
    now = int(events["t"][-1])
    inside = events[events["t"] >= now - 20_000]
    expected = np.zeros((1, SENSOR[1], SENSOR[0]), np.float32)
    for event in inside:
        sign = 1 if event["p"] else -1
        before = expected[0, event["y"], event["x"]] if rule == "sum" else 0
        expected[0, event["y"], event["x"]] = before + sign
    assert np.array_equal(makes.frame(), expected)
    assert sum(makes.frame().events) == len(inside)
    makes.advance(now + 20_001)
    assert not makes.frame().values.any()


@pytest.mark.parametrize(("time", "steps"), [("bins", 5), ("centres", 4)])
def test_a_voxel_grid_is_that_of_the_equation(events, time, steps):
    grid = meissner.voxel_grid(events, SENSOR, 5, time=time)
    t = events["t"]
    tau = steps * (t - t[0]) / (t[-1] - t[0])
    expected = np.zeros((5, SENSOR[1], SENSOR[0]))
    for b in range(5):
        weight = np.maximum(0, 1 - np.abs(b - tau)) * np.where(events["p"], 1, -1)
        np.add.at(expected[b], (events["y"], events["x"]), weight)
    assert grid.shape == (5, 48, 64)
    assert np.allclose(grid, expected, atol=1e-5)


def test_a_time_surface_is_that_of_the_equation(events):
    now = int(events["t"][-1]) + 500
    latest = np.full((2, SENSOR[1], SENSOR[0]), -np.inf)
    np.maximum.at(latest, (events["p"].astype(int), events["y"], events["x"]), events["t"])
    found = meissner.time_surface(events, SENSOR, tau_us=3000.0, at_us=now)
    assert np.allclose(found, np.exp((latest - now) / 3000), atol=1e-6)
    linear = meissner.time_surface(events, SENSOR, span_us=9000.0, at_us=now)
    assert np.allclose(linear, np.maximum(0, 1 + (latest - now) / 9000), atol=1e-6)
    with pytest.raises(meissner.InputError, match="tau_us or span_us"):
        meissner.TimeSurface(SENSOR)


def test_filters_pass_what_their_rules_say(events):
    assert np.array_equal(meissner.Filters(SENSOR).push(events), events)
    assert np.array_equal(meissner.Filters(SENSOR, stride=3).push(events), events[::3])
    silenced = meissner.Filters(SENSOR, refractory_us=10_000)
    expected, last = [], {}
    for event in events:
        pixel, t = (event["x"], event["y"]), int(event["t"])
        if t - last.get(pixel, -10_000) >= 10_000:
            expected.append(event)
            last[pixel] = t
    # In two parts: the filter continues from its state.
    passed = np.concatenate([silenced.push(events[:200]), silenced.push(events[200:])])
    assert np.array_equal(passed, np.array(expected))
    both = meissner.Filters(SENSOR, stride=2, background_us=30_000)
    both.push(events)
    dropped = {name: of["dropped"] for name, of in both.counters.items()}
    assert list(dropped.values())[0] == 300 and len(dropped) == 2
    with pytest.raises(meissner.InputError, match="found 0"):
        meissner.Filters(SENSOR, stride=0)


def test_a_crop_shows_its_pixels_and_counts_the_others(events):
    crop = (10, 5, 20, 30)
    makes = meissner.EventFrames(SENSOR, crop=crop, period_us=10**9)
    makes.push(events)
    whole = meissner.EventFrames(SENSOR, period_us=10**9)
    whole.push(events)
    assert np.array_equal(makes.open().values, whole.open().values[:, 5:35, 10:30])
    assert makes.counters["outside_crop"] == len(events) - sum(makes.open().events)
    for bad in [(0, 0, 65, 48), (0, 0, 0, 1)]:
        with pytest.raises(meissner.InputError, match="crop: expected a rectangle"):
            meissner.EventFrames(SENSOR, crop=bad)


def test_frames_for_a_network_are_those_behind_its_filters():
    filtered = {**NETWORK, "filter": [{"kind": "refractory", "time_us": 700}]}
    events = make_events(300, sensor=(8, 6), every_us=50)
    makes, before = meissner.frames_for(filtered, (8, 6)), meissner.Filters((8, 6), refractory_us=700)
    done, passed = makes.push(events), before.push(events)
    counts, starts = meissner.event_frames(passed, (8, 6), period_us=1000, maximum=4)
    for frame, values, start in zip(done, counts, starts, strict=False):
        assert np.array_equal(frame, values) and frame.start_us == start
    assert makes.counters["filtered"] == len(events) - len(passed) > 20
    sliding = {**NETWORK["input"], "channels": 1, "frames": "signed", "span_us": 5_000}
    del sliding["period_us"], sliding["maximum"]
    window = meissner.frames_for({**filtered, "input": sliding}, (8, 6))
    window.push(events)
    assert window.counters["filtered"] == len(events) - len(passed)
