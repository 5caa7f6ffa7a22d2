"""Recordings that the tests write, and one Ray for the tests of a file that need no other."""

import io
import json
import os
import zipfile
from pathlib import Path

import meissner
import numpy as np
import pyarrow as pa
import pytest

from meissner_ray import MEASURED, find
from meissner_ray.cluster import started
from meissner_ray.judge import rows_of
from meissner_ray.schema import schema
from meissner_ray.settings import Settings

SKIN, DAVIS = (34, 34), (346, 260)


def make_events(count, seed, sensor=SKIN, every_us=100):
    """Events at random pixels, in order of time."""
    random = np.random.default_rng(seed)
    events = np.zeros(count, meissner.EVENT_DTYPE)
    events["t"] = np.cumsum(random.integers(0, 2 * every_us, count))
    events["x"], events["y"] = (random.integers(0, side, count) for side in sensor)
    events["p"] = random.integers(0, 2, count)
    return events


def write_digit(path, seed, count=150):
    """Five bytes an event: x, y, polarity and 23 bits of time."""
    events = make_events(count, seed)
    t, p = events["t"].astype(np.int64), events["p"].astype(np.int64)
    rows = np.stack([events["x"], events["y"], (p << 7) | (t >> 16), (t >> 8) & 255, t & 255], axis=1)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(rows.astype(np.uint8).tobytes())


def write_digits(folder, each=1, count=150):
    """N-MNIST with `each` tests of each digit, and files that are not judged."""
    for digit in range(10):
        write_digit(folder / f"train/{digit}/00000.bin", seed=1000 + digit)
        for number in range(each):
            write_digit(folder / f"test/{digit}/{number:05}.bin", seed=10 * number + digit, count=count)
    (folder / "test/0/notes.txt").write_text("no recording")
    return folder


def write_tensors(path, arrays, metadata):
    """A safetensors file."""
    kinds = {"f4": "F32", "i8": "I64", "u1": "U8"}
    header, at, data = {"__metadata__": metadata}, 0, b""
    for name, values in arrays.items():
        end = at + values.nbytes
        header[name] = {"dtype": kinds[values.dtype.str[1:]], "shape": list(values.shape), "data_offsets": [at, end]}
        at, data = end, data + values.tobytes()
    text = json.dumps(header).encode()
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(len(text).to_bytes(8, "little") + text + data)


def write_press(path, seed):
    """One press of the simulated dome with its angles."""
    tilt, azimuth = 0.05 + 0.02 * seed, 0.3 * seed
    press = meissner.Press(tilt=tilt, azimuth=azimuth)
    positions = [press.positions(DAVIS)]
    for depth_mm in (0.5, 1.0):
        press.press_to(depth_mm)
        positions.append(press.positions(DAVIS))
    events = meissner.film_markers(np.arange(3) * 5_000, positions, DAVIS, seed=seed, ideal=True)
    fields = {"t_us": "t", "x": "x", "y": "y", "on": "p"}
    arrays = {name: events[field].astype("i8") for name, field in fields.items()} | {
        "start": np.array([0, len(events)], "i8"),
        "truth.t_us": np.array([0, 10_000], "i8"),
        "truth.start": np.array([0, 2], "i8"),
        "truth.depth": np.array([0, 1], "f4"),
        "truth.roll": np.full(2, tilt * np.cos(azimuth), "f4"),
        "truth.pitch": np.full(2, tilt * np.sin(azimuth), "f4"),
    }
    write_tensors(path, arrays, {"sensor": json.dumps(DAVIS)})


def write_slips(folder):
    """Readings of 24 electrodes under objects of two sets."""
    for seed, name in enumerate(("n/pen1", "n/pen2", "s/pen1", "e/screw3", "w/screw1")):
        readings = np.random.default_rng(seed).integers(2000, 3600, (22, 24))
        rows = [",".join(f"ff_e{e}" for e in range(1, 25)), *(",".join(map(str, row)) for row in readings)]
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / f"{name}.csv").write_text("\n".join(rows) + "\n")
    return folder


def write_skin(folder, archive, bins):
    """Grasps of the tactile skin in an archive."""
    random = np.random.default_rng(7)
    with zipfile.ZipFile(folder / archive, "w") as file:
        for split, number, label in (("train", 0, 1), ("test", 1, 0), ("test", 2, 3), ("test", 10, 3)):
            array = io.BytesIO()
            np.save(array, (random.random((39, 2, bins)) < 0.02).astype("f4"))
            file.writestr(f"{split}/sample_{number}_label_{label}.npy", array.getvalue())
    return folder


def write_gel(path, seed):
    """Two pictures of a gel, at rest and pressed."""
    random = np.random.default_rng(seed)
    rest = random.integers(60, 200, (240, 320, 3))
    pressed = rest.copy()
    pressed[80:140, 120:200] += random.integers(-40, 40, (60, 80, 3))
    arrays = {
        "picture": np.stack([rest, pressed]).astype("u1"),
        "reference": rest[None].astype("u1"),
        "force": np.zeros((2, 240, 320), "f4"),
        "pixel_mm": np.array([0.06], "f4"),
        "start": np.array([0, 2], "i8"),
    }
    arrays["force"][1, 80:140, 120:200] = 4e-4
    write_tensors(path, arrays, {"indenters": '["block"]'})


def write_grasp(path, newton):
    """A recording of 30 ms without events, under a force that rises."""
    arrays = {name: np.zeros(0, "i8") for name in ("t_us", "x", "y", "on")}
    arrays |= {"start": np.zeros(2, "i8"), "truth.start": np.array([0, 2], "i8")}
    arrays |= {"truth.t_us": np.array([0, 30_000], "i8"), "truth.force": np.array([0, newton], "f4")}
    write_tensors(path, arrays, {"sensor": "[115, 115]"})


def in_a_loop(command, task, data, network, **more):
    """The rows without Ray: one recording after another, in this process."""
    settings = Settings.of(command, task, network, None, None, **more)
    rows = [row for recording in find(command, task, data) for row in rows_of(recording, settings, settings.cards())]
    return pa.Table.from_pylist(rows, schema(command, task))


def determined(table: pa.Table) -> bytes:
    """The bits of all columns that recording and settings determine."""
    columns = table.drop_columns([name for name in table.column_names if name in MEASURED]).replace_schema_metadata(None)
    # The same values have the same buffers, whether they were read or computed.
    columns = pa.Table.from_pylist(columns.to_pylist(), columns.schema)
    out = pa.BufferOutputStream()
    with pa.ipc.new_stream(out, columns.schema) as writer:
        writer.write_table(columns.combine_chunks())
    return out.getvalue().to_pybytes()


def processes(begins):
    """The processes of this machine whose titles begin with `begins`, by id."""
    found = {}
    for place in Path("/proc").glob("[0-9]*"):
        try:
            title = (place / "cmdline").read_bytes().decode(errors="replace")
        except OSError:
            continue
        if title.startswith(begins):
            found[int(place.name)] = title
    return found


def descendants(of):
    """The ids of a process and of all processes that it started."""
    parents = {}
    for place in Path("/proc").glob("[0-9]*"):
        try:
            parents[int(place.name)] = int((place / "stat").read_text().rpartition(")")[2].split()[1])
        except OSError:
            continue
    found = {of}
    while more := {child for child, parent in parents.items() if parent in found} - found:
        found |= more
    return found


def workers_at_work():
    """The ids of workers of this process that judge a recording."""
    return set(processes("ray::judge")) & descendants(os.getpid())


@pytest.fixture(scope="module")
def cluster():
    """A running Ray with two workers for the runs of a test."""
    with started(2) as count:
        yield count


@pytest.fixture(scope="session")
def digits(tmp_path_factory):
    return write_digits(tmp_path_factory.mktemp("nmnist"), each=2)
