"""The time of many recordings, computed from the measurements of a run.

With n recordings on c cores, one worker a core:

    least = startup + n (recording + overhead) / c + shutdown + n write
    most  = least + (1 - 1 / c) longest

`recording` is the mean time of judging in a task, and `overhead` the mean time from its end to the start of the next task of the
same worker: the file of its rows, and scheduling. `startup` is the time from the call to the first task of a worker (median of
the workers), `shutdown` that of Ray, and `write` the time of the last file for the rows of a recording.
`most` is the bound of a list schedule: no core is idle before the last task begins, at worst the longest task (Graham, 1969).
"""

from __future__ import annotations

import math
import statistics
from dataclasses import dataclass
from itertools import pairwise
from typing import Any

import pyarrow as pa

from .errors import ResultsError
from .store import runs


@dataclass(frozen=True)
class Measured:
    """The measurements of a run. All times are in seconds."""

    cpu: str
    workers: int
    recordings: int
    startup_s: float
    recording_s: float
    deviation_s: float
    longest_s: float
    cpu_s: float
    overhead_s: float
    shutdown_s: float
    write_s: float
    wall_s: float


@dataclass(frozen=True)
class Cost:
    """Computed times in seconds; `interval_s` is half of the 95 % interval of `least_s`, from the spread of the recordings."""

    recordings: int
    cores: int
    least_s: float
    most_s: float
    interval_s: float
    extrapolated: bool


def measured(results: pa.Table) -> Measured:
    """The costs of the run with the most recordings; among equal runs, the last. Raises `ResultsError` if there is none."""
    tasks: dict[str, dict[str, dict[str, Any]]] = {}
    records = results.to_pylist()
    for row in records:
        tasks.setdefault(row["run"], {})[row["recording"]] = row
    known = [run for run in runs(results) if run["run"] in tasks]
    if not known:
        raise ResultsError("results: expected rows of a run that came to its end, found none")
    run = max(reversed(known), key=lambda run: len(tasks[run["run"]]))
    rows = sorted(tasks[run["run"]].values(), key=lambda row: row["started_s"])
    spans = [row["ended_s"] - row["started_s"] for row in rows]
    workers: dict[str, list[dict[str, Any]]] = {}
    for row in rows:
        workers.setdefault(row["worker"], []).append(row)
    gaps = [after["started_s"] - before["ended_s"] for own in workers.values() for before, after in pairwise(own)]
    return Measured(
        cpu=", ".join(sorted({row["cpu"] for row in rows})),
        workers=run["workers"],
        recordings=len(rows),
        startup_s=statistics.median(own[0]["started_s"] - run["begun_s"] for own in workers.values()),
        recording_s=statistics.fmean(spans),
        deviation_s=statistics.stdev(spans) if len(spans) > 1 else 0.0,
        longest_s=max(spans),
        cpu_s=statistics.fmean(row["cpu_s"] for row in rows),
        overhead_s=statistics.fmean(gaps) if gaps else 0.0,
        shutdown_s=run["stopped_s"] - run["judged_s"],
        # The file has the rows of all runs.
        write_s=(run["ended_s"] - run["stopped_s"]) / run["rows"] * sum(row["run"] == run["run"] for row in records) / len(rows),
        wall_s=run["ended_s"] - run["begun_s"],
    )


def cost(costs: Measured, recordings: int, cores: int) -> Cost:
    """The time of `recordings` recordings like those of the run, on `cores` cores like those of the run."""
    if recordings < 1 or cores < 1:
        raise ValueError(f"recordings and cores: expected at least 1, found {recordings} and {cores}")
    cores_used = min(cores, recordings)
    share = recordings / cores_used
    least = costs.startup_s + share * (costs.recording_s + costs.overhead_s) + costs.shutdown_s + recordings * costs.write_s
    # The mean of the run and the mean of the recordings to come both deviate from that of all recordings.
    interval = 1.96 * share * costs.deviation_s * math.sqrt(1 / costs.recordings + 1 / recordings)
    most = least + (1 - 1 / cores_used) * costs.longest_s
    return Cost(recordings, cores, least, most, interval, cores > costs.workers)
