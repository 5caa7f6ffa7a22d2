"""Recordings, the units of work: from the paths that a user names to files, each judged by itself.

Input: folders, files, archives. Output: a list of `Recording` without duplicates, in the order of their paths. Only folders and
the tables of contents of archives are read, so that a broken recording is found by the task that judges it.

    task                  a folder has                            a recording is
    digits                test/<digit>/<number>.bin               a file
    slip                  <class>/<object><number>.csv            a file
    objects, containers   Ev-Objects.zip, Ev-Containers.zip       an array test/*.npy of the archive
    angle, force          *.safetensors at any depth              a file of presses, of grasps
    area                  *.safetensors and *.npz at any depth    a file of pictures
    pareto angle          recordings of events at any depth       a file
"""

from __future__ import annotations

import hashlib
import os
import zipfile
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from pathlib import Path, PurePosixPath

from .errors import NoRecordingsError, SettingsError

PathLike = str | os.PathLike[str]

ARCHIVES = {"objects": "Ev-Objects.zip", "containers": "Ev-Containers.zip"}
"""The archive of each task on arrays."""

_EVENTS = frozenset([".aedat", ".aedat4", ".bin", ".csv", ".dat", ".es", ".evt2", ".evt3", ".h5", ".hdf5", ".npy", ".raw"])
_SUFFIXES = {
    ("eval", "angle"): frozenset({".safetensors"}),
    ("eval", "area"): frozenset({".safetensors", ".npz"}),
    ("pareto", "angle"): _EVENTS,
    ("pareto", "area"): frozenset({".safetensors", ".npz"}),
    ("pareto", "force"): frozenset({".safetensors"}),
}
_LABELLED = {"digits": ("test/*/*", ".bin"), "slip": ("*/*", ".csv")}


@dataclass(frozen=True, order=True)
class Recording:
    """A file, or an array of an archive.

    - `path`: the absolute path of the file, as it was named: links are not followed.
    - `member`: the name of the array in an archive; empty for a file.
    """

    path: str
    member: str = ""

    @property
    def name(self) -> str:
        """Path and member. Two recordings of one file name in different folders differ here."""
        return f"{self.path}/{self.member}" if self.member else self.path

    @property
    def key(self) -> str:
        """A unique name for a file of results."""
        return hashlib.sha256(os.fsencode(self.name)).hexdigest()[:32]

    def stamp(self) -> tuple[int, int] | None:
        """Size in bytes and time of the last change in nanoseconds; None if there is no file."""
        try:
            found = Path(self.path).stat()
        except OSError:
            return None
        return found.st_size, found.st_mtime_ns


def tasks(command: str) -> list[str]:
    """The tasks of "eval" or "pareto"."""
    return [*_LABELLED, *ARCHIVES, *(task for known, task in _SUFFIXES if known == command)]


def find(command: str, task: str, data: PathLike | Iterable[PathLike]) -> list[Recording]:
    """The recordings that `data` names: files as they are, and the recordings in folders.

    A file that does not exist is a recording, too: judging it fails. Raises `SettingsError` for an unknown task, and
    `NoRecordingsError` if a folder has none.
    """
    if task not in tasks(command):
        raise SettingsError(f"task: expected one of {', '.join(tasks(command))} for {command}, found {task!r}")
    data = [data] if isinstance(data, str | os.PathLike) else list(data)
    if not data:
        raise NoRecordingsError("data: expected folders or recordings, found none")
    found: set[Recording] = set()
    for named in data:
        path = Path(os.path.abspath(named))
        own = list(_of_folder(command, task, path) if path.is_dir() else _of_file(task, path))
        if not own:
            raise NoRecordingsError(f"{named}: expected {_expected(command, task)}, found none")
        found.update(own)
    return sorted(found)


def _expected(command: str, task: str) -> str:
    if task in _LABELLED:
        pattern, suffix = _LABELLED[task]
        return f"recordings {pattern}{suffix}"
    if task in ARCHIVES:
        return f"arrays test/*.npy in {ARCHIVES[task]}"
    return f"files {' '.join(f'*{suffix}' for suffix in sorted(_SUFFIXES[command, task]))}"


def _of_folder(command: str, task: str, folder: Path) -> Iterator[Recording]:
    if task in ARCHIVES:
        archive = folder / ARCHIVES[task]
        return _of_file(task, archive) if archive.exists() else iter(())
    pattern, suffixes = ("**/*", _SUFFIXES[command, task]) if task not in _LABELLED else _labelled(task)
    files = (path for path in folder.glob(pattern) if path.suffix.lower() in suffixes and path.is_file())
    return (Recording(str(path)) for path in files if not _hidden(path.relative_to(folder).parts))


def _labelled(task: str) -> tuple[str, frozenset[str]]:
    pattern, suffix = _LABELLED[task]
    return pattern, frozenset({suffix})


def _of_file(task: str, path: Path) -> Iterator[Recording]:
    if task == "digits" and path.parent.parent.name != "test":
        # The networks were trained on the other split.
        raise NoRecordingsError(f"{path}: expected a recording test/<digit>/<number>.bin, found another folder")
    if task not in ARCHIVES:
        yield Recording(str(path))
        return
    try:
        with zipfile.ZipFile(path) as archive:
            names = [PurePosixPath(name) for name in archive.namelist()]
    except (OSError, zipfile.BadZipFile):
        yield Recording(str(path))
        return
    for name in names:
        if name.suffix == ".npy" and name.parent.name == "test" and not _hidden(name.parts):
            yield Recording(str(path), str(name))


def _hidden(parts: Iterable[str]) -> bool:
    return any(part.startswith(".") or part == "__MACOSX" for part in parts)
