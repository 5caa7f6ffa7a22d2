"""Recordings: lazily read files as structured arrays, and written files that are read again."""

import os
import pathlib
import subprocess
import sys

import numpy as np
import pytest
from conftest import SENSOR, SMALL, make_events

import meissner


@pytest.fixture
def path(tmp_path, events):
    meissner.write(tmp_path / "events.raw", events, SENSOR)
    return tmp_path / "events.raw"


@pytest.mark.parametrize("name", ["events.csv", "events.npy", "events.dat", "events.raw"])
def test_what_is_written_is_read_again(tmp_path, events, name):
    meissner.write(tmp_path / name, events, SENSOR)
    recording = meissner.open(tmp_path / name)
    assert np.array_equal(recording.read(), events)
    assert recording.sensor == (None if name.endswith("npy") else SENSOR)
    assert recording.times_us == (events["t"][0], events["t"][-1])
    assert recording.is_ordered


def test_a_file_is_read_when_something_is_asked_for(path, events):
    recording = meissner.open(path)
    assert "not read yet" in repr(recording)
    assert len(recording) == len(events)
    assert repr(recording).endswith(f"EVT3, {len(events)} events on 64x48>")
    assert recording.path == path
    assert (recording.other_streams, recording.salvaged) == ([], None)


def test_blocks_slices_and_times_are_parts_of_the_events(path, events):
    recording = meissner.open(path)
    assert np.array_equal(np.concatenate(list(recording)), events)
    assert [len(block) for block in recording.blocks(250)] == [250, 250, 100]
    assert np.array_equal(recording[10:-5], events[10:-5])
    assert np.array_equal(recording[::-7], events[::-7])
    assert np.array_equal(recording[5:2], events[5:2])
    assert (recording[0], recording[-1]) == (events[0], events[-1])
    assert np.array_equal(np.asarray(recording), events)
    with pytest.raises(IndexError, match="below 600, found 600"):
        recording[600]
    t = events["t"]
    for start, end in [(None, None), (20_000, 30_000), (None, 5_000), (50_000, None), (9, 8), (-5, 10**9)]:
        inside = (t >= (start or -1)) & (t < (end or 10**9))
        assert np.array_equal(recording.between(start, end), events[inside])


def test_events_whose_times_step_back_are_found_by_time(tmp_path):
    events = make_events(50)[::-1].copy()
    meissner.write(tmp_path / "back.csv", events)
    recording = meissner.open(tmp_path / "back.csv")
    assert not recording.is_ordered
    assert np.array_equal(recording.between(1000, 2000), events[(events["t"] >= 1000) & (events["t"] < 2000)])


def test_predictions_of_a_recording_an_array_and_by_hand_are_the_same(path, events):
    weights = meissner.Weights.draw(SMALL, 3)

    def of(source):
        engine = meissner.Engine(SMALL, SENSOR, weights)
        return [(t, p.values.tobytes()) for t, p in meissner.predictions(engine, source, 7_000)]

    expected, start = [], int(events["t"][0])
    batch = meissner.Batch(SMALL, SENSOR, weights)
    for due in range(start + 7_000, int(events["t"][-1]) + 7_000, 7_000):
        batch.reset()
        batch.push(events[events["t"] <= due])
        batch.advance(due)
        expected.append((due, batch.predict().values.tobytes()))
    assert of(path) == of(events) == of(meissner.open(path)) == expected
    with pytest.raises(meissner.InputError, match="every_us: expected at least 1 us, found 0"):
        next(meissner.predictions(meissner.Engine(SMALL, SENSOR, weights), events, 0))


def test_an_engine_takes_a_recording_as_it_takes_its_events(path, events, engine):
    assert engine.push(meissner.open(path)) == len(events)


def test_faults_have_their_type_and_text(tmp_path, events):
    with pytest.raises(meissner.FileError, match="cannot read .*missing.raw"):
        meissner.open(tmp_path / "missing.raw")
    (tmp_path / "noise.raw").write_bytes(bytes(range(200, 256)))
    with pytest.raises(meissner.RecordingError, match="unknown format"):
        len(meissner.open(tmp_path / "noise.raw"))
    with pytest.raises(meissner.InputError, match="format: expected aedat4"):
        meissner.open(tmp_path / "noise.raw", format="mp4")
    with pytest.raises(meissner.RecordingError, match="expected AEDAT4, CSV, npy, DAT, EVT3, ES or MCAP"):
        meissner.write(tmp_path / "events.evt2", events)
    with pytest.raises(meissner.InputError, match="file extension"):
        meissner.write(tmp_path / "events.txt", events)
    with pytest.raises(meissner.RecordingError, match="the sensor's"):
        meissner.write(tmp_path / "events.csv", events, (10, 10))
    wide = np.zeros(3, [("t", "i8"), ("x", "i4"), ("y", "i4"), ("p", "?")])
    wide["x"][1] = 70_000
    with pytest.raises(meissner.InputError, match="x: expected 0 to 65535, found 70000 as event 1"):
        meissner.write(tmp_path / "events.csv", wide)


def test_a_file_that_was_cut_short_is_read_up_to_the_cut(tmp_path, events):
    meissner.write(tmp_path / "cut.npy", events)
    whole = (tmp_path / "cut.npy").read_bytes()
    (tmp_path / "cut.npy").write_bytes(whole[:-5])
    with pytest.raises(meissner.RecordingError, match="cut short"):
        len(meissner.open(tmp_path / "cut.npy"))
    recording = meissner.open(tmp_path / "cut.npy", salvage=True)
    assert len(recording) == len(events) - 1
    assert recording.salvaged[1] > 0


def test_what_is_odd_in_a_recording_is_left_out_and_counted(tmp_path):
    (tmp_path / "own.csv").write_text("# sensor 8x8\n1,2,3,1\noops\n2,9,3,1\n3,2,3,0\n4,2,3,0\n")
    recording = meissner.open(tmp_path / "own.csv")
    assert recording.read()["t"].tolist() == [1, 3, 4]
    (kind, count, first), = recording.left_out
    assert (kind, count, recording.assumed) == ("lines", 2, [])
    assert "line 3" in first
    with pytest.raises(meissner.RecordingError, match="line 3"):
        len(meissner.open(tmp_path / "own.csv", strict=True))


def test_the_chip_of_a_recording_that_names_none_can_be_given(tmp_path):
    addresses = [(259 - y) << 22 | (345 - x) << 12 | 1 << 11 for x, y in [(3, 4), (300, 200)]]
    records = np.array([[address, 10] for address in addresses], ">u4").tobytes()
    (tmp_path / "v2e.aedat").write_bytes(b"#!AER-DAT2.0\n# Creation time: now\n" + records)
    with pytest.raises(meissner.RecordingError, match="names the chip"):
        len(meissner.open(tmp_path / "v2e.aedat"))
    for named in [{"chip": "DAVIS346"}, {"sensor": (346, 260)}]:
        recording = meissner.open(tmp_path / "v2e.aedat", **named)
        assert (recording.sensor, recording.read().tolist()) == (
            (346, 260), [(10, 3, 4, True), (10, 300, 200, True)])
    with pytest.raises(meissner.InputError, match="DAVIS346"):
        meissner.open(tmp_path / "v2e.aedat", chip="CAT9")
    with pytest.raises(meissner.RecordingError, match="stream 2"):
        len(meissner.open(tmp_path / "v2e.aedat", chip="DAVIS346", stream=2))


def test_a_text_has_the_columns_and_the_unit_that_are_named(tmp_path):
    (tmp_path / "own.txt").write_text("1 3 4 0.5\n0 5 6 0.75\n")
    recording = meissner.open(tmp_path / "own.txt", columns="pxyt", time_unit="s")
    assert recording.read().tolist() == [(500_000, 3, 4, True), (750_000, 5, 6, False)]


@pytest.mark.parametrize("name", ["events.npy", "events.dat", "events.raw"])
def test_blocks_windows_and_parts_of_a_file_are_those_of_the_whole(tmp_path, name):
    """npy and DAT are read part by part, EVT3 completely."""
    events = make_events(150_000, every_us=20)
    events["t"][5_000:100_000:7] -= 3
    if name.endswith("raw"):
        events.sort(order="t")
    meissner.write(tmp_path / name, events, SENSOR)
    recording = meissner.open(tmp_path / name)
    assert np.array_equal(np.concatenate(list(recording.blocks(7_001))), events)
    assert [len(block) for block in recording] == [65_536, 65_536, 18_928]
    windows = list(recording.windows(100_000))
    assert np.array_equal(np.concatenate([window for _, window in windows]), events)
    t = events["t"]
    for start, end in [(None, 1_000), (700_000, 900_000), (2_000_000, None)]:
        inside = (t >= (start or -1)) & (t < (end or 10**9))
        assert np.array_equal(recording.between(start, end), events[inside])
    assert recording.sensor == (None if name.endswith("npy") else SENSOR)
    assert ("not read yet" in repr(recording)) == (not name.endswith("raw"))
    assert len(recording) == len(events)
    held = list(recording.windows(100_000))
    assert all(a[0] == b[0] and np.array_equal(a[1], b[1]) for a, b in zip(windows, held, strict=True))


HDF5 = pathlib.Path(__file__).parents[3] / "io/tests/codecs/hdf5"


def test_hdf5_of_dsec_and_of_prophesee_is_read():
    dsec = meissner.open(HDF5 / "dsec.h5")
    assert (dsec.format, dsec.sensor, len(dsec)) == ("HDF5", None, 1500)
    start = 49_599_300_523
    assert dsec.read()[[0, 1, 999, 1000]].tolist() == [
        (start, 0, 0, False), (start + 7, 1, 0, False), (start + 6993, 359, 1, False), (start + 47_000, 360, 1, False)
    ]
    prophesee = meissner.open(HDF5 / "prophesee.h5")
    assert (prophesee.format, prophesee.sensor, len(prophesee)) == ("HDF5", (640, 480), 600)
    assert prophesee.between(7, 21)["t"].tolist() == [7, 14]


MEMORY = """
import sys

import meissner

# VmHWM: the most memory so far, in KiB.
most = lambda: next(int(line.split()[1]) for line in open("/proc/self/status") if line.startswith("VmHWM"))
recording = meissner.open(sys.argv[1])
before = most()
part, blocks = len(recording.between(10_000_000, 10_001_000)), sum(map(len, recording))
parts = most()
whole = len(recording)
print(part, blocks, whole, parts - before, most() - before)
"""


@pytest.mark.skipif(sys.platform != "linux", reason="reads /proc")
def test_parts_of_a_long_file_take_the_memory_of_a_part(tmp_path):
    events = np.zeros(4_000_000, meissner.EVENT_DTYPE)
    events["t"] = np.arange(len(events)) * 10
    meissner.write(tmp_path / "long.npy", events)
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(sys.path)}
    command = [sys.executable, "-c", MEMORY, tmp_path / "long.npy"]
    text = subprocess.run(command, check=True, capture_output=True, text=True, env=environment).stdout
    part, blocks, whole, parts_kib, whole_kib = map(int, text.split())
    assert (part, blocks, whole) == (100, len(events), len(events))
    # 16 bytes an event are 62,500 KiB.
    assert parts_kib < 20_000 and whole_kib > 60_000
