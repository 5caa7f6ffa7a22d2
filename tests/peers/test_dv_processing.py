"""iniVation's dv-processing: files, and network streams in both directions."""
import json
import multiprocessing
import os
import time

import numpy as np
import pytest
from conftest import SENSOR, as_csv, events, free_port, predicted, program, started

dv = pytest.importorskip("dv_processing")

EVENTS = int(os.environ.get("MEISSNER_PEER_EVENTS", "200000"))


def stored(rows):
    store = dv.EventStore()
    for t, x, y, p in rows.tolist():
        store.push_back(t, x, y, bool(p))
    return store


def columns(store):
    found = store.numpy()
    return np.stack([found[name].astype(np.int64) for name in ("timestamp", "x", "y", "polarity")], 1)


def read_by_dv(path):
    reader = dv.io.MonoCameraRecording(str(path))
    assert tuple(reader.getEventResolution()) == SENSOR
    batches = []
    while (batch := reader.getNextEventBatch()) is not None:
        batches.append(columns(batch))
    return np.concatenate(batches)


def address(where):
    """A port, or a local socket, in the form for dv."""
    return ("127.0.0.1", where) if isinstance(where, int) else (dv.Path(str(where)),)


def wait(condition, seconds=30):
    until = time.monotonic() + seconds
    while not condition():
        assert time.monotonic() < until
        time.sleep(0.01)


def serve(where, rows, size=5_000):
    """A camera that sends batches to the first client, and lives until it is killed."""
    stream = dv.io.Stream.EventStream(0, "events", "CAMERA", SENSOR)
    server = dv.io.NetworkWriter(*address(where), stream)
    wait(lambda: server.getClientCount() == 1)
    for start in range(0, len(rows), size):
        server.writeEvents(stored(rows[start : start + size]))
        wait(lambda: server.getQueuedPacketCount() < 50)
    time.sleep(600)


class Camera:
    """A separate process: a kill also ends its connection."""

    def __init__(self, where, rows):
        self.process = multiprocessing.get_context("spawn").Process(target=serve, args=(where, rows), daemon=True)
        self.process.start()
        self.where = where

    def is_there(self):
        if not isinstance(self.where, int):
            return self.where.exists()
        with open("/proc/net/tcp") as table:
            return any(f":{self.where:04X} 00000000:0000 0A" in line for line in table)

    def kill(self):
        self.process.kill()
        self.process.join()


def test_files_that_we_write_are_read_by_dv(recording, tmp_path):
    rows, path = recording
    assert np.array_equal(read_by_dv(path), rows)
    recorded = tmp_path / "recorded.aedat4"
    assert program("record", path, "--out", recorded).returncode == 0
    assert np.array_equal(read_by_dv(recorded), rows)


def test_files_that_we_write_are_read_by_faery(recording):
    faery = pytest.importorskip("faery")
    rows, path = recording
    found = np.concatenate([array.copy() for array in faery.events_stream_from_file(path)])
    found = np.stack([found[name].astype(np.int64) for name in ("t", "x", "y", "on" if "on" in found.dtype.names else "p")], 1)
    assert np.array_equal(found, rows)


@pytest.mark.parametrize("local", [False, True])
def test_a_stream_of_dv_gives_the_predictions_of_the_file(local, tmp_path):
    rows = events(EVENTS, 1)
    path = tmp_path / "file.aedat4"
    file = dv.io.MonoCameraWriter(str(path), dv.io.MonoCameraWriter.EventOnlyConfig("CAMERA", SENSOR))
    file.writeEvents(stored(rows))
    del file
    where = tmp_path / "camera.sock" if local else free_port()
    camera = Camera(where, rows)
    wait(camera.is_there)
    source = f"dv://{where}" if local else f"dv://127.0.0.1:{where}"
    run = started("run", source, "--every", "10ms", "--json", "--reconnect", "0s", "--limit", len(rows))
    found, summary = predicted(run.communicate(timeout=300)[0])
    camera.kill()
    expected, of_file = predicted(program("run", path, "--every", "10ms", "--json").stdout)
    assert len(found) >= 40 and found == expected
    assert summary["events"] == of_file["events"] == len(rows)
    assert summary["lines_refused"] == 0


def test_a_camera_that_is_started_again_is_found_again(tmp_path):
    rows, port = events(40_000, 2), free_port()
    camera = Camera(port, rows[:20_000])
    wait(camera.is_there)
    run = started("run", f"dv://127.0.0.1:{port}", "--every", "10ms", "--json", "--reconnect", "20s", "--limit", len(rows))
    first = b""
    # The newest prediction covers the last event that was sent.
    last = rows[19_999][0] // 10_000 * 10_000 - 10_000
    while not first.endswith(b"\n") or json.loads(first.splitlines()[-1]).get("t_us", -1) < last:
        first += run.stdout.readline()
    camera.kill()
    time.sleep(1)
    camera = Camera(port, rows[20_000:])
    rest, told = run.communicate(timeout=60)
    camera.kill()
    found, summary = predicted(first + rest)
    assert (summary["events"], summary["lines_refused"]) == (40_000, 1), told.decode()
    csv = as_csv(tmp_path / "file.csv", rows)
    expected, _ = predicted(program("run", csv, "--every", "10ms", "--json").stdout)
    assert found == expected


@pytest.mark.parametrize("local", [False, True])
def test_what_we_send_is_read_by_dv(recording, local, tmp_path):
    rows, path = recording
    where = tmp_path / "sender.sock" if local else free_port()
    receiver = f"dv-listen://{where}" if local else f"dv-listen://127.0.0.1:{where}"
    sender = started("send", path, receiver, "--speed", "4")
    reader, until = None, time.monotonic() + 30
    while reader is None:
        assert time.monotonic() < until
        try:
            reader = dv.io.NetworkReader(*address(where))
        except RuntimeError:
            time.sleep(0.02)
    assert tuple(reader.getEventResolution()) == SENSOR
    batches, count = [], 0
    while count < len(rows) and time.monotonic() < until + 30:
        batch = reader.getNextEventBatch()
        if batch is None:
            time.sleep(0.001)
            continue
        batches.append(columns(batch))
        count += len(batches[-1])
    assert np.array_equal(np.concatenate(batches), rows)
    assert sender.wait(30) == 0
