"""A run: recordings to tasks of Ray, rows to a folder.

A task judges one recording with one thread, writes its rows and returns them. A task whose worker dies is started again; a
task whose worker dies each time has failed. So no finished recording is lost, whatever is killed.
"""

from __future__ import annotations

import os
import time
import uuid
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import Any

import pyarrow as pa

from .cluster import started
from .errors import SettingsError
from .judge import Cards, Row, rows_of
from .recordings import PathLike, Recording, find
from .schema import schema
from .settings import VERSIONS, Settings
from .store import Results, keep, locked

Progress = Callable[[int, int, str], None]

_RETRIES = 3
_QUEUED = 4
"""Tasks that wait for each worker, so that none is idle while results are fetched."""


@dataclass(frozen=True)
class Job:
    """The data that all tasks of a run share."""

    settings: Settings
    cards: Cards
    files: dict[str, tuple[int, int]]
    folder: Path
    columns: pa.Schema
    run: str


def evaluate(
    task: str,
    data: PathLike | Iterable[PathLike],
    out: PathLike,
    *,
    networks: str | PathLike | Iterable[PathLike],
    weights: PathLike | None = None,
    trainings: PathLike | None = None,
    stride: int | None = None,
    every_us: int | None = None,
    workers: int | None = None,
    progress: Progress | None = None,
) -> pa.Table:
    """Judges networks on each of many recordings, as `meissner.evaluate` does on one, and returns a row for each record.

    - `task`: "digits", "objects", "containers", "slip", "angle" or "area"; `data`: folders or recordings, as `recordings` says.
    - `out`: a folder for the results. A run in it continues where an earlier one stopped: recordings that are finished and have
      not changed are not computed again, but failed ones are.
    - `networks`, `weights`, `trainings`, `stride`, `every_us`: as for `meissner.evaluate`; trainings must be whole ones, because
      the folds of a cross-validation belong to a data set as a whole.
    - `workers`: processes, by default the number of cores; None if the caller has started Ray.
    - `progress`: a callback (done, total, recording).

    A recording that cannot be judged has one row, with its failure. Ctrl-C ends the run; finished recordings stay. Raises
    `SettingsError` if `out` has results of other settings, `NoRecordingsError`, `ResultsError`, and the exceptions of Meissner
    about networks and weights.
    """
    settings = Settings.of("eval", task, networks, weights, trainings, stride=stride, every_us=every_us)
    return _run(settings, find("eval", task, data), out, workers, progress)


def pareto(
    task: str,
    data: PathLike | Iterable[PathLike],
    out: PathLike,
    *,
    networks: str | PathLike | Iterable[PathLike],
    weights: PathLike | None = None,
    trainings: PathLike | None = None,
    only: str | Iterable[str] = (),
    timed: int | None = None,
    repeats: int = 3,
    sensor: tuple[int, int] | None = None,
    from_us: int = 0,
    workers: int | None = None,
    progress: Progress | None = None,
) -> pa.Table:
    """Measures run time against error on each of many recordings, as `meissner.pareto` does on one: a row for each setting.

    - `task`: "digits", "objects", "containers", "slip", "angle", "area" or "force".
    - `only`, `timed`, `repeats`, `sensor`, `from_us`: as for `meissner.pareto`.
    - the rest: as for `evaluate`.

    Times are those of a machine that runs as many recordings at once as there are workers: `workers=1` measures one alone.
    """
    only = (only,) if isinstance(only, str) else tuple(only)
    more = {"only": only, "timed": timed, "repeats": repeats, "sensor": sensor, "from_us": from_us}
    settings = Settings.of("pareto", task, networks, weights, trainings, **more)
    return _run(settings, find("pareto", task, data), out, workers, progress)


def _run(
    settings: Settings, recordings: list[Recording], out: PathLike, workers: int | None, progress: Progress | None
) -> pa.Table:
    begun_s = time.time()
    settings.check()
    files = settings.files()
    cards = settings.cards()
    folder, columns = Path(os.path.abspath(out)), schema(settings.command, settings.task)
    with locked(folder):
        results = Results(folder, settings.identity(), columns)
        missing = [recording for recording in recordings if not results.finished(recording)]
        if not missing:
            return results.finish(None)
        name = uuid.uuid4().hex[:12]
        job = Job(settings, cards, files, folder, columns, name)
        done = len(recordings) - len(missing)
        with started(workers) as count:
            for recording, rows in _judged(job, missing, count):
                results.add(recording, rows)
                done += 1
                if progress is not None:
                    progress(done, len(recordings), recording.name)
            run = {"run": name, "workers": count, "begun_s": begun_s, "judged_s": time.time()}
        return results.finish(run | {"stopped_s": time.time()})


def _judged(job: Job, recordings: list[Recording], workers: int) -> Iterable[tuple[Recording, list[Row]]]:
    """Each recording with its rows, in the order in which tasks end."""
    import ray

    task = ray.remote(num_cpus=1, max_retries=_RETRIES)(judge)
    shared = ray.put(job)
    waiting: dict[Any, Recording] = {}
    left = iter(recordings)
    while True:
        while len(waiting) < workers * (1 + _QUEUED) and (recording := next(left, None)) is not None:
            waiting[task.remote(recording, shared)] = recording
        if not waiting:
            return
        [ready], _ = ray.wait(list(waiting), num_returns=1)
        recording = waiting.pop(ready)
        try:
            rows = ray.get(ready)
        except (ray.exceptions.WorkerCrashedError, ray.exceptions.OutOfMemoryError, ray.exceptions.NodeDiedError) as error:
            rows = _lost(recording, job, error)
        yield recording, rows


def judge(recording: Recording, job: Job) -> list[Row]:
    """The task: judges a recording, and returns its rows when they are on disk."""
    started_s, cpu_s = time.time(), time.process_time()
    if job.settings.files() != job.files:
        raise SettingsError(f"networks: expected files that stay as they are, found a change in {sorted(job.files)}")
    rows = rows_of(recording, job.settings, job.cards, job.folder / "work")
    return _kept(recording, rows, job, started_s, time.process_time() - cpu_s)


def _lost(recording: Recording, job: Job, error: Exception) -> list[Row]:
    """The row of a recording whose workers died."""
    stamp = recording.stamp() or (None, None)
    row = {"recording": recording.name, "bytes": stamp[0], "modified_ns": stamp[1]}
    failure = f"{type(error).__name__}: its worker died {1 + _RETRIES} times"
    return _kept(recording, [row | {"failure": failure}], job, time.time(), 0.0)


def _kept(recording: Recording, rows: list[Row], job: Job, started_s: float, cpu_s: float) -> list[Row]:
    times = {"run": job.run, "worker": f"{os.uname().nodename}:{os.getpid()}", "started_s": started_s, "cpu_s": cpu_s}
    # The time of the write is not in its own row.
    rows = [row | _origin() | times | {"ended_s": time.time()} for row in rows]
    keep(job.folder, recording, rows, job.columns)
    return rows


@cache
def _origin() -> dict[str, Any]:
    import ray

    return VERSIONS | {"ray": ray.__version__, "cpu": _cpu()}


def _cpu() -> str:
    """The name of the processor, as Linux gives it."""
    try:
        lines = Path("/proc/cpuinfo").read_text().splitlines()
    except OSError:
        lines = []
    names = [line.partition(":")[2].strip() for line in lines if line.startswith("model name")]
    return names[0] if names else os.uname().machine
