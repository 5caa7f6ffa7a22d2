"""Judges recordings with one and two workers and in a plain loop, in turn; prints medians of the ratios of neighbouring runs.

    python benches/scaling.py TASK DATA NETWORK [--rounds 5]

A round has a loop, one worker and two workers, in an order that rotates from round to round. `judging` is the time from the first
task to the last one, without the start of Ray. Ray gives its workers a niceness of 15; here they have the niceness of the loop.
"""

from __future__ import annotations

import argparse
import os
import statistics
import tempfile
import time
from pathlib import Path

import meissner_ray
from meissner_ray.judge import rows_of
from meissner_ray.settings import Settings


def main() -> None:
    """Prints the times of each round, and the medians."""
    parser = argparse.ArgumentParser()
    parser.add_argument("task")
    parser.add_argument("data")
    parser.add_argument("network")
    parser.add_argument("--rounds", type=int, default=5)
    asked = parser.parse_args()
    os.environ["RAY_worker_niceness"] = "0"  # noqa: SIM112
    recordings = meissner_ray.find("eval", asked.task, asked.data)
    settings = Settings.of("eval", asked.task, asked.network, None, None)
    cards = settings.cards()
    rounds: list[dict[str, float]] = []
    with tempfile.TemporaryDirectory() as folder:
        for number in range(asked.rounds):
            found: dict[str, float] = {}
            for step in range(3):
                which = (number + step) % 3
                if which == 0:
                    start = time.perf_counter()
                    for recording in recordings:
                        rows_of(recording, settings, cards)
                    found["loop"] = time.perf_counter() - start
                    continue
                out = Path(folder, f"{number}-{which}")
                results = meissner_ray.evaluate(asked.task, asked.data, out, networks=asked.network, workers=which)
                measured = meissner_ray.measured(results)
                rows = results.to_pylist()
                found[f"judging {which}"] = max(row["ended_s"] for row in rows) - min(row["started_s"] for row in rows)
                found[f"whole {which}"] = measured.wall_s
                found[f"overhead {which}"] = measured.overhead_s
                found[f"startup {which}"] = measured.startup_s
                if which == 1:
                    # The prediction for two workers from a run with one.
                    found["computed 2"] = meissner_ray.cost(measured, len(recordings), 2).least_s
            rounds.append(found)
            print("  ".join(f"{name} {value:.3f} s" for name, value in sorted(found.items())), flush=True)
    for name, top, bottom in (
        ("judging, one worker over two", "judging 1", "judging 2"),
        ("whole runs, one worker over two", "whole 1", "whole 2"),
        ("judging with one worker over a loop", "judging 1", "loop"),
        ("computed over measured whole run with two", "computed 2", "whole 2"),
    ):
        ratios = [found[top] / found[bottom] for found in rounds]
        print(f"{name}: median {statistics.median(ratios):.2f} ({min(ratios):.2f} to {max(ratios):.2f})")


if __name__ == "__main__":
    main()
