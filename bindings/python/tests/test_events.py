"""Input of `push`: layouts, types and polarities of other libraries, without copies."""

import numpy as np
import pytest
from conftest import SENSOR, SMALL

import meissner

LAYOUTS = {
    "meissner": meissner.EVENT_DTYPE,
    "tonic": [("x", np.int16), ("y", np.int16), ("t", np.int64), ("p", bool)],
    "aedat": [("t", "<u8"), ("x", "<u2"), ("y", "<u2"), ("on", "?")],
    "faery": [("t", "<u8"), ("x", "<u2"), ("y", "<u2"), (("p", "on"), "?")],
    "expelliarmus": [("t", "<i8"), ("x", "<i2"), ("y", "<i2"), ("p", "u1")],
    "metavision": {
        "names": ["x", "y", "p", "t"],
        "formats": ["<u2", "<u2", "<i2", "<i8"],
        "offsets": [0, 2, 4, 8],
        "itemsize": 16,
    },
    "dv-processing": [("timestamp", "<i8"), ("x", "<i2"), ("y", "<i2"), ("polarity", "u1")],
    "evlib": [("time", "m8[us]"), ("x", "<i2"), ("y", "<i2"), ("pol", "i1")],
    "evlib in ns": [("TIMESTAMP_US", "m8[ns]"), ("X", "<i2"), ("Y", "<i2"), ("Polarity", "i1")],
    "durations from big-endian": [("ts", ">m8[us]"), ("x", "<i2"), ("y", "<i2"), ("on", "?")],
    "big-endian": [("y", ">u4"), ("t", ">i4"), ("p", ">i2"), ("x", ">i8")],
    "with gaps and more fields": [("frame", "S7"), ("p", "i1"), ("x", "u1"), ("w", "f8"), ("y", "u1"), ("t", "u4")],
}


def in_layout(events, layout):
    out = np.zeros(len(events), layout)
    names = {"t": ("t", "timestamp", "time", "ts", "timestamp_us"), "x": ("x",), "y": ("y",), "p": ("p", "on", "polarity", "pol")}
    for field, candidates in names.items():
        name = next(name for name in out.dtype.fields if name.lower() in candidates)
        is_duration = out[name].dtype.kind == "m"
        out[name] = events[field].astype("m8[us]") if is_duration else events[field]
    return out


def predicted(engine, *args, **kwargs):
    engine.push(*args, **kwargs)
    return engine.predict().values.tobytes()


@pytest.mark.parametrize("layout", LAYOUTS.values(), ids=LAYOUTS)
def test_every_layout_of_events_gives_the_same_bits(engine, events, layout):
    expected = predicted(meissner.Engine(SMALL, SENSOR, meissner.Weights.draw(SMALL, 3)), events)
    assert predicted(engine, in_layout(events, layout)) == expected
    assert engine.counters["events"]["accepted"] == len(events)


@pytest.mark.parametrize("p", ["bool", "int8", "uint8", "int64", "-1/+1"])
def test_four_arrays_of_any_integers_give_the_same_bits(engine, events, p):
    expected = predicted(meissner.Engine(SMALL, SENSOR, meissner.Weights.draw(SMALL, 3)), events)
    signs = np.where(events["p"], 1, -1) if p == "-1/+1" else events["p"].astype(p)
    x, y = events["x"].astype("i4"), events["y"].astype("u8")
    assert predicted(engine, t=events["t"].astype("u8"), x=x, y=y.tolist(), p=signs) == expected


def test_views_with_strides_read_only_memory_and_subclasses_are_taken_as_they_are(events, tmp_path):
    def fresh():
        return meissner.Engine(SMALL, SENSOR, meissner.Weights.draw(SMALL, 3))

    doubled = np.repeat(events, 2)
    backwards = events[::-1].copy()
    frozen = np.frombuffer(events.tobytes(), events.dtype)
    assert not frozen.flags.writeable
    events.tofile(tmp_path / "events")
    mapped = np.memmap(tmp_path / "events", events.dtype, mode="r")
    memory = np.asarray(memoryview(events.view("u1"))).view(events.dtype)
    expected = predicted(fresh(), events)
    for view in (doubled[::2], backwards[::-1], frozen, mapped, events.view(np.recarray), memory):
        assert predicted(fresh(), view) == expected
    # Like a field of a structured array: strides of 13 bytes, no alignment.
    assert predicted(fresh(), t=doubled["t"][::2], x=events["x"], y=events["y"], p=events["p"]) == expected


NAMES = {
    "t": ("t", "t_us", "ts", "ts_us", "time", "time_us", "timestamp", "timestamp_us"),
    "p": ("p", "pol", "polarity", "on"),
}


@pytest.mark.parametrize("t", NAMES["t"])
@pytest.mark.parametrize("p", NAMES["p"])
def test_a_name_that_a_file_may_have_an_array_and_a_keyword_may_have_too(events, tmp_path, t, p):
    array = events.astype([(t, "<i8"), ("x", "<u2"), ("y", "<u2"), (p, "u1")])
    np.save(tmp_path / "events.npy", array)
    read = meissner.open(tmp_path / "events.npy").read()
    weights = meissner.Weights.draw(SMALL, 3)
    expected = predicted(meissner.Engine(SMALL, SENSOR, weights), read)
    assert predicted(meissner.Engine(SMALL, SENSOR, weights), array) == expected
    columns = {name: array[name] for name in array.dtype.names}
    assert predicted(meissner.Engine(SMALL, SENSOR, weights), **columns) == expected
    (once,) = {pair[0] for pair in meissner.predictions(meissner.Engine(SMALL, SENSOR, weights), array[:1], 10**6)}
    assert once == array[t][0] + 10**6


@pytest.mark.parametrize("empty", [[], (), np.array([]), np.array([], "i4"), np.zeros(0, "m8[us]"), np.zeros((0, 4))])
def test_a_block_without_an_event_is_no_event_whatever_its_type(engine, empty):
    assert engine.push(t=empty, x=[], y=np.array([]), p=[]) == 0
    assert engine.push(np.zeros(0, meissner.EVENT_DTYPE)) == 0
    if not np.asarray(empty).dtype.kind == "m":
        assert engine.push(empty) == 0
    assert engine.counters["events"]["pushed"] == 0
    with pytest.raises(meissner.InputError, match="equal lengths"):
        engine.push(t=empty, x=[1], y=[1], p=[1])
    with meissner.Live(engine) as live:
        live.push(t=[], x=[], y=[], p=[])
        assert live.counters["offered"] == 0


@pytest.mark.parametrize(
    ("unit", "values", "microseconds"),
    [
        ("us", [-3, 0, 7], [-3, 0, 7]),
        ("ms", [-3, 0, 7], [-3000, 0, 7000]),
        ("10us", [-3, 0, 7], [-30, 0, 70]),
        ("s", [0, 1, 2], [0, 10**6, 2 * 10**6]),
        ("3s", [0, 1, 2], [0, 3 * 10**6, 6 * 10**6]),
        ("ns", [-1500, -1499, 499], [-2, -1, 0]),
        ("ns", [500, 501, 1499], [1, 1, 1]),
        ("100ns", [-15, 4, 5], [-2, 0, 1]),
        ("ps", [499_999, 500_000, 1_499_999], [0, 1, 1]),
    ],
)
def test_durations_become_microseconds_rounded_to_the_nearest(unit, values, microseconds):
    times = np.array(values, f"m8[{unit}]")
    # An hour's jump of the clock would be held until a second event confirms it.
    network = {**SMALL, "network": {"name": "long", "capacity": 9, "span_us": 2**40}}
    engine = meissner.Engine(network, SENSOR, meissner.Weights.draw(SMALL, 3), restart="keep")
    assert engine.push(t=times, x=[1, 2, 3], y=[1, 2, 3], p=[1, 0, 1]) == 3
    assert engine.events["t"].tolist() == microseconds


@pytest.mark.parametrize(
    ("times", "said"),
    [
        (np.array([1, "NaT"], "m8[us]"), "found NaT as event 1"),
        (np.array([1, 2], "m8"), "timedelta64 of a unit"),
        (np.array([1, 2], "m8[M]"), "timedelta64 of a unit"),
        (np.array([1, 2**62], "m8[s]"), "63 - 1 us"),
    ],
)
def test_durations_that_are_no_microseconds_are_refused(engine, times, said):
    with pytest.raises(meissner.Error, match=said):
        engine.push(t=times, x=[1, 1], y=[1, 1], p=[1, 1])
    assert engine.counters["events"]["pushed"] == 0


def test_an_array_is_not_copied_as_a_whole():
    resource = pytest.importorskip("resource")
    # One event in memory, five million in the view: 65 MB if it were copied.
    one = np.zeros(1, meissner.EVENT_DTYPE)
    view = np.lib.stride_tricks.as_strided(one, (5_000_000,), (0,), writeable=False)
    voxels = meissner.VoxelGrid((4, 4), 1, (0, 1), crop=(1, 1, 1, 1))
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    voxels.push(view)
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - before < 20_000  # KiB
    assert voxels.counters["pushed"] == len(view)


def test_one_event_and_no_event_are_arrays_too(engine, events):
    assert engine.push(events[0]) == 1
    assert engine.push(events[:0]) == 0
    none = np.zeros(0, int)
    assert engine.push(t=none, x=none, y=none, p=none) == 0
    assert len(engine) == 1


def test_pixels_beyond_16_bits_are_outside_the_sensor(engine):
    x = np.array([-1, 70_000, 1 << 40, 65_535, 3])
    assert engine.push(t=np.arange(5), x=x, y=np.zeros(5, int), p=np.ones(5, int)) == 1
    assert engine.counters["events"]["outside_sensor"] == 4


def test_late_events_are_dropped_or_clamped(events):
    late = events.copy()
    late["t"][300] = 0
    weights = meissner.Weights.draw(SMALL, 3)
    drop, clamp = (meissner.Engine(SMALL, SENSOR, weights, late=late) for late in ("drop", "clamp"))
    assert (drop.push(late), clamp.push(late)) == (599, 600)
    assert (drop.counters["events"]["late"], clamp.counters["events"]["clamped"]) == (1, 1)
    with pytest.raises(meissner.InputError, match='expected "drop" or "clamp", found "keep"'):
        meissner.Engine(SMALL, SENSOR, weights, late="keep")


@pytest.mark.parametrize(
    ("given", "error", "text"),
    [
        ({"events": np.zeros(3)}, meissner.DtypeError, "fields t, x, y, p, found an array of float64 and shape"),
        ({"events": np.zeros((3, 4), "i8")}, meissner.InputError, "expected one dimension, found shape"),
        ({"events": np.zeros(3, [("t", "i8"), ("x", "i2"), ("y", "i2")])}, TypeError, 'field "p" or "pol"'),
        ({"events": np.zeros(3, [("t", "f8"), ("x", "i2"), ("y", "i2"), ("p", "?")])}, TypeError, "t: expected integers"),
        ({"events": np.zeros(3, [("t", "i8", 2), ("x", "i2"), ("y", "i2"), ("p", "?")])}, TypeError, "t: expected int"),
        ({"t": [1], "x": [1], "y": [1]}, meissner.InputError, "all of t, x, y and p"),
        ({}, meissner.InputError, "expected one array of events"),
        ({"t": [1, 2], "x": [1], "y": [1], "p": [1]}, ValueError, "equal lengths, found 2, 1, 1 and 1"),
        ({"t": [1], "x": [1.5], "y": [1], "p": [1]}, TypeError, "x: expected integers .pixels., found float64"),
        ({"t": [1, 2], "x": [1, 1], "y": [1, 1], "p": [1, 2]}, ValueError, "polarities -1, 0 or 1, found 2 as event 1"),
        (
            {"t": np.array([1 << 63], "u8"), "x": [1], "y": [1], "p": [1]},
            ValueError,
            "at most 2.63 - 1 us, found 9223372036854775808 as event 0",
        ),
    ],
)
def test_what_is_no_event_is_refused_before_the_first_one_enters(engine, given, error, text):
    with pytest.raises(error, match=text) as raised:
        engine.push(**given)
    assert isinstance(raised.value, meissner.Error)
    assert engine.counters["events"]["pushed"] == 0


def test_a_fault_late_in_an_array_leaves_the_engine_as_it_was(engine):
    long = np.zeros(20_000, [("t", "i8"), ("x", "i2"), ("y", "i2"), ("p", "i1")])
    long["p"][-1] = 3
    with pytest.raises(meissner.InputError, match="found 3 as event 19999"):
        engine.push(long)
    assert len(engine) == 0
