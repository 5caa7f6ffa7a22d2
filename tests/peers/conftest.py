"""Tests of the program against other people's programs. `.ci/peers` installs these and runs them."""
import json
import os
import pathlib
import socket
import subprocess

import numpy as np
import pytest

ROOT = pathlib.Path(__file__).resolve().parents[2]
PROGRAM = os.environ.get("MEISSNER", ROOT / "target/release/meissner")
SENSOR = (346, 260)


def events(number, seed=0):
    """Events of a finger that moves over the sensor: columns t, x, y and p; times ascend, 10 us apart on average."""
    draw = np.random.default_rng(seed)
    t = np.cumsum(draw.integers(1, 20, number)).astype(np.int64)
    phase = t / 3e5
    x = 173 + 90 * np.sin(phase) + draw.normal(0, 12, number)
    y = 130 + 70 * np.cos(phase) + draw.normal(0, 12, number)
    x, y = np.clip(x, 0, SENSOR[0] - 1).astype(np.int64), np.clip(y, 0, SENSOR[1] - 1).astype(np.int64)
    return np.stack([t, x, y, draw.integers(0, 2, number)], 1)


def as_csv(path, rows):
    header = f"# sensor {SENSOR[0]}x{SENSOR[1]}\nt,x,y,p\n"
    path.write_text(header + "\n".join(",".join(map(str, row)) for row in rows.tolist()) + "\n")
    return path


def program(*arguments, **options):
    return subprocess.run([PROGRAM, *map(str, arguments)], capture_output=True, check=False, **options)


def started(*arguments):
    return subprocess.Popen([PROGRAM, *map(str, arguments)], stdout=subprocess.PIPE, stderr=subprocess.PIPE)


def predicted(output):
    """Times and values of the predictions, and the summary."""
    lines = [json.loads(line) for line in output.decode().splitlines()]
    predictions = [(line["t_us"], line["value"]) for line in lines if "value" in line]
    return predictions, lines[-1]["summary"]


def free_port():
    with socket.socket() as found:
        found.bind(("127.0.0.1", 0))
        return found.getsockname()[1]


@pytest.fixture(scope="session")
def recording(tmp_path_factory):
    """Events, and a file of them in AEDAT4 that the program wrote."""
    folder = tmp_path_factory.mktemp("recording")
    rows = events(200_000)
    path = folder / "finger.aedat4"
    converted = program("convert", as_csv(folder / "finger.csv", rows), path)
    assert converted.returncode == 0, converted.stderr.decode()
    return rows, path
