"""One recording as the data that Meissner reads: a file as it is, or a data set with this recording alone.

Data sets with folders for classes are judged as a whole. To judge one file, the data set is a folder with a
link to this file, in its class; to judge one array, it is an archive with this array.
"""

from __future__ import annotations

import tempfile
import zipfile
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from .recordings import ARCHIVES, Recording


@contextmanager
def staged(task: str, recording: Recording, scratch: Path | None) -> Iterator[Path]:
    """The path that `meissner.evaluate` and `meissner.pareto` take.

    Files that are written for it are in the folder `scratch` (or in that of the system), and removed at the end.
    """
    path = Path(recording.path)
    if task not in ("digits", "slip", *ARCHIVES):
        yield path
        return
    with tempfile.TemporaryDirectory(prefix="meissner-recording-", dir=scratch) as name:
        folder = Path(name)
        if task in ARCHIVES:
            _copy_array(recording, folder / ARCHIVES[task])
        else:
            split = "test" if task == "digits" else ""
            place = folder / split / path.parent.name / path.name
            place.parent.mkdir(parents=True)
            place.symlink_to(path)
        yield folder


def _copy_array(recording: Recording, to: Path) -> None:
    """Writes an archive with the one array."""
    with zipfile.ZipFile(recording.path) as whole, zipfile.ZipFile(to, "w") as alone:
        alone.writestr(recording.member, whole.read(recording.member))
