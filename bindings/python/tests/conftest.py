"""Streams and networks that the tests share."""

import os
import signal
import subprocess
import sys
import time

import numpy as np
import pytest

import meissner

SENSOR = (64, 48)

SMALL = {
    "network": {"name": "small", "span_us": 50_000, "capacity": 256},
    "graph": {"kind": "knn", "k": 4, "candidates": "all", "scale": 0.2},
    "layer": [
        {"name": "block1", "kind": "spline", "channels": 4, "kernel": 2},
        {"name": "pool1", "kind": "pool", "cell": ["1/8", "1/6"], "time": "1/2", "scale": 0.4},
        {"name": "block2", "kind": "spline", "channels": 6, "kernel": 2},
        {"name": "readout", "kind": "readout", "grid": [2, 2]},
        {"name": "out", "kind": "dense", "outputs": 2},
    ],
    "output": {"names": ["a", "b"], "unit": "rad"},
}


def interrupted(program, *arguments, after, seconds):
    """The next output of `program`, and the time until it, if Ctrl-C comes `seconds` after the output `after`."""
    paths = os.pathsep.join([os.path.dirname(__file__), *sys.path])
    child = subprocess.Popen(
        [sys.executable, "-c", program, *arguments],
        stdout=subprocess.PIPE,
        text=True,
        env={**os.environ, "PYTHONPATH": paths},
    )
    try:
        assert child.stdout.readline() == after
        time.sleep(seconds)
        child.send_signal(signal.SIGINT)
        sent = time.monotonic()
        return child.stdout.readline(), time.monotonic() - sent
    finally:
        child.kill()
        child.wait()


def make_events(count, seed=0, sensor=SENSOR, start_us=0, every_us=100):
    """Events at random pixels, in order of time."""
    random = np.random.default_rng(seed)
    events = np.zeros(count, meissner.EVENT_DTYPE)
    events["t"] = start_us + np.cumsum(random.integers(0, 2 * every_us, count))
    events["x"] = random.integers(0, sensor[0], count)
    events["y"] = random.integers(0, sensor[1], count)
    events["p"] = random.integers(0, 2, count)
    return events


@pytest.fixture
def events():
    return make_events(600)


@pytest.fixture
def engine():
    return meissner.Engine(SMALL, SENSOR, meissner.Weights.draw(SMALL, 3))
