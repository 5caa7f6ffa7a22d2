"""Results in a folder, so that a run that is stopped at any moment continues from there.

    settings.json      identity of the settings, written before anything is computed
    rows/KEY.parquet   the rows of one finished recording
    work/              temporary files of tasks, removed at the end of a run
    results.parquet    the rows of all recordings, written at the end of a run; their files in rows/ are then removed

A file appears completely or not at all: it is written under another name and renamed. Files that stay are synchronised with the
disk. Files in rows/ are not: a recording whose file cannot be read after a loss of power is computed again.
"""

from __future__ import annotations

import fcntl
import json
import os
import shutil
import time
from collections.abc import Callable, Iterable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any, BinaryIO

import pyarrow as pa
import pyarrow.parquet as pq

from .errors import ResultsError, SettingsError
from .judge import Row
from .recordings import PathLike, Recording

_RUNS = b"meissner_ray.runs"
_SETTINGS = b"meissner_ray.settings"


def atomically(path: Path, write: Callable[[BinaryIO], object], synchronised: bool = True) -> None:
    """Lets `write` fill the file at `path`, which changes only after everything is written."""
    beside = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with beside.open("wb") as file:
            write(file)
            file.flush()
            if synchronised:
                os.fsync(file.fileno())
        beside.replace(path)
    finally:
        beside.unlink(missing_ok=True)


def keep(folder: Path, recording: Recording, rows: list[Row], columns: pa.Schema) -> None:
    """Writes the rows of a finished recording."""
    table = pa.Table.from_pylist(rows, columns)
    atomically(folder / "rows" / f"{recording.key}.parquet", lambda file: pq.write_table(table, file), synchronised=False)


def read(folder: PathLike) -> pa.Table:
    """The results in a folder after a whole run: a row for each record, in the order of the recordings."""
    path = Path(folder) / "results.parquet"
    if not path.is_file():
        raise ResultsError(f"{folder}: expected a folder with results.parquet, found none")
    with pq.ParquetFile(path) as file:
        # Metadata that is known only after the rows are written is beside the schema, not in it.
        metadata = {name: text for name, text in file.metadata.metadata.items() if name in (_RUNS, _SETTINGS)}
        return file.read().replace_schema_metadata(metadata)


def runs(results: pa.Table) -> list[dict[str, Any]]:
    """The complete runs that results come from, in order of time.

    `workers`; times in seconds since the epoch: `begun_s`, `judged_s` when the last recording was judged, `stopped_s` when Ray
    was down, `ended_s` when the rows were written; `rows` is their number.
    """
    found: list[dict[str, Any]] = json.loads((results.schema.metadata or {}).get(_RUNS, b"[]"))
    return found


class Results:
    """The results in a folder, open for one run."""

    def __init__(self, folder: Path, identity: dict[str, Any], columns: pa.Schema) -> None:
        """Results of the settings with this identity. Raises `SettingsError` if the folder has results of other settings."""
        self.folder, self.columns = folder, columns
        self._identity = json.dumps(identity, indent=1, sort_keys=True)
        self._check(folder / "settings.json")
        (folder / "rows").mkdir(exist_ok=True)
        # Removes the files of tasks that were killed.
        shutil.rmtree(folder / "work", ignore_errors=True)
        (folder / "work").mkdir()
        self._runs: list[dict[str, Any]] = []
        self.rows: dict[str, list[Row]] = {}
        if (folder / "results.parquet").exists():
            table = read(folder)
            self._runs = runs(table)
            self._take(table)
        for path in sorted((folder / "rows").glob("[!.]*.parquet")):
            try:
                self._take(pq.read_table(path))
            except (OSError, pa.ArrowInvalid):
                # Damaged by a loss of power, or by another program. The recording is computed again.
                path.unlink()

    def _check(self, path: Path) -> None:
        if not path.exists():
            atomically(path, lambda file: file.write(self._identity.encode()))
            return
        before, now = json.loads(path.read_text()), json.loads(self._identity)
        other = [name for name in sorted(before.keys() | now.keys()) if before.get(name) != now.get(name)]
        if other:
            differences = "; ".join(f"{name}: expected {before.get(name)}, found {now.get(name)}" for name in other)
            raise SettingsError(f"{path.parent}: results of other settings, choose another folder ({differences})")

    def _take(self, table: pa.Table) -> None:
        """Takes rows instead of earlier rows for the same recordings."""
        found: dict[str, list[Row]] = {}
        for row in table.to_pylist():
            found.setdefault(row["recording"], []).append(row)
        self.rows |= found

    def finished(self, recording: Recording) -> bool:
        """Whether the recording was judged, without a failure, and has not changed since."""
        rows = self.rows.get(recording.name)
        if not rows or rows[0]["failure"] is not None:
            return False
        return (rows[0]["bytes"], rows[0]["modified_ns"]) == recording.stamp()

    def add(self, recording: Recording, rows: list[Row]) -> None:
        """The rows of a recording, which are on disk."""
        self.rows[recording.name] = rows

    def finish(self, run: dict[str, Any] | None) -> pa.Table:
        """Writes the rows of all recordings, and the times of a run."""
        ordered = [row for name in sorted(self.rows) for row in self.rows[name]]
        table = pa.Table.from_pylist(ordered, self.columns)
        metadata = {_SETTINGS: self._identity.encode(), _RUNS: json.dumps(self._runs).encode()}

        def write(file: BinaryIO) -> None:
            # The names of list items are those of Arrow, so that a table has the same schema after it is read.
            with pq.ParquetWriter(file, self.columns, use_compliant_nested_type=False) as writer:
                writer.write_table(table)
                if run is not None:
                    self._runs.append(run | {"ended_s": time.time(), "rows": len(ordered)})
                metadata[_RUNS] = json.dumps(self._runs).encode()
                writer.add_key_value_metadata(metadata)

        atomically(self.folder / "results.parquet", write)
        shutil.rmtree(self.folder / "rows")
        shutil.rmtree(self.folder / "work")
        return table.replace_schema_metadata(metadata)


@contextmanager
def locked(folder: Path) -> Iterator[None]:
    """Holds a folder for one run; the lock ends with the process. Raises `ResultsError` if another run has it."""
    folder.mkdir(parents=True, exist_ok=True)
    with (folder / ".lock").open("w") as lock:
        try:
            fcntl.flock(lock, fcntl.LOCK_EX | fcntl.LOCK_NB)
        except BlockingIOError:
            raise ResultsError(f"{folder}: expected a folder that no run writes to, found a running one") from None
        yield


def failures(rows: Iterable[Row]) -> list[Row]:
    """The rows of recordings that failed."""
    return [row for row in rows if row["failure"] is not None]
