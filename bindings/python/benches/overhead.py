"""The cost of Python: a million events in blocks of 4,096, with a prediction after each block, alternately here and in Rust.

    cargo build --release -p meissner-benches --example c_interface
    python bindings/python/benches/overhead.py target/release/examples/c_interface
"""

import re
import statistics
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import meissner
import numpy as np

EVENTS, BLOCK, TURNS = 1_000_000, 4_096, 7


def main():
    program = sys.argv[1]
    events = stream()
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "events.npy"
        np.save(path, events)
        ratios, times = [], []
        for _ in range(TURNS):
            said = subprocess.run([program, str(BLOCK), str(path)], check=True, capture_output=True, text=True).stdout
            rust = float(re.search(r"(\d+) ns an event", said)[1])
            here = through_python(events)
            ratios.append(here / rust)
            times.append(here)
    print(f"{EVENTS:,} events in blocks of {BLOCK:,}: {statistics.median(times):.0f} ns an event through Python,")
    print(f"{statistics.median(ratios):.3f} times as long as through Rust (median of {TURNS} turns: {sorted(round(r, 3) for r in ratios)})")


def through_python(events):
    """Nanoseconds per event, the median over turns of 24,576 events as in the Rust program."""
    engine = meissner.Engine("tactigraph-past", sensor=(240, 180))
    out = np.empty(2, np.float32)
    found = []
    for first in range(0, len(events), 6 * BLOCK):
        turn = events[first : first + 6 * BLOCK]
        started = time.perf_counter()
        for block in range(0, len(turn), BLOCK):
            engine.push(turn[block : block + BLOCK])
            engine.predict_into(out)
        found.append((time.perf_counter() - started) * 1e9 / len(turn))
    return statistics.median(found)


def stream():
    """A blob that moves over the sensor, with noise: 20,000 events in the window."""
    random, i = np.random.default_rng(5), np.arange(EVENTS)
    spread = np.where(random.integers(10, size=EVENTS) == 0, 170, 40)
    events = np.zeros(EVENTS, meissner.EVENT_DTYPE)
    events["t"] = i * 8
    events["x"] = (i // 4_000 + random.integers(spread)) % 240
    events["y"] = (20 + i // 9_000 + random.integers(spread)) % 180
    events["p"] = i % 3 == 0
    return events


if __name__ == "__main__":
    main()
