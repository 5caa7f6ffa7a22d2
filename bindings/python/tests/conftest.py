"""Streams and networks that the tests share."""

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
