"""Labelled data sets as sequences. A recording is read when it is requested.

    digits = meissner.datasets.nmnist("nmnist/")
    sample = digits[0]                                   # sample.events, sample.label, sample.split, sample.name
    few = digits.of("test")[::100]                       # slices are sequences too, and read nothing

`torch.utils.data.DataLoader` takes such a sequence as a map-style data set.
"""

from __future__ import annotations

import os
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, overload

import numpy as np

from ._meissner import _Recordings

__all__ = ["Dataset", "Sample", "letters", "neutouch", "nmnist", "presses", "slip"]

Path = str | os.PathLike[str]


@dataclass(frozen=True)
class Sample:
    """A recording with its label.

    - `data`: a structured array of events (t in microseconds, x, y, p), or float32 (readings, 24) of electrodes.
    - `label`, `name`, `split`: index of the class, name within the data set, "train" or "test"; None if there is none.
    - `more`: for a slip the object; for a press the labels along time, float32, and their times `t_us`, int64 in microseconds; for a
      letter the times `contact_us` (0.2 N), `held_us` (2.5 N) and `lifted_us`.
    """

    data: np.ndarray = field(repr=False)
    label: int | None
    name: str
    split: str | None
    more: Mapping[str, Any] = field(repr=False, default_factory=dict)

    @property
    def events(self) -> np.ndarray:
        """`data`, for recordings of events."""
        return self.data


class Dataset(Sequence[Sample]):
    """A labelled data set: a sequence of `Sample`, in an order that is the same on every machine."""

    def __init__(self, recordings: _Recordings, indices: Iterable[int] | None = None) -> None:
        self._recordings, self._labels = recordings, recordings.labels
        self._indices = range(len(self._labels)) if indices is None else list(indices)

    @property
    def classes(self) -> list[str]:
        """Names of the classes, in the order of the labels."""
        return self._recordings.classes

    @property
    def sensor(self) -> tuple[int, int] | None:
        """(width, height) of all recordings; None without events."""
        return self._recordings.sensor

    @property
    def labels(self) -> np.ndarray:
        """The label of each recording, int64; -1 where there is none."""
        labels = [self._labels[i][1] for i in self._indices]
        return np.array([-1 if label is None else label for label in labels], np.int64)

    @property
    def names(self) -> list[str]:
        """The name of each recording."""
        return [self._labels[i][0] for i in self._indices]

    @property
    def passed_over(self) -> list[os.PathLike[str]]:
        """Files in the folder that are not recordings."""
        return self._recordings.passed_over

    def of(self, split: str) -> Dataset:
        """The recordings of a split, "train" or "test"."""
        return Dataset(self._recordings, [i for i in self._indices if self._labels[i][2] == split])

    def __len__(self) -> int:
        return len(self._indices)

    @overload
    def __getitem__(self, index: int) -> Sample: ...
    @overload
    def __getitem__(self, index: slice) -> Dataset: ...
    def __getitem__(self, index: int | slice) -> Sample | Dataset:
        if isinstance(index, slice):
            return Dataset(self._recordings, self._indices[index])
        place = self._indices[index]
        name, label, split = self._labels[place]
        data, more = self._recordings.read(place)
        return Sample(data, label, name, split, more)

    def __repr__(self) -> str:
        kinds = f" of {len(self.classes)} classes" if self.classes else ""
        return f"<Dataset: {len(self)} recordings{kinds}>"


def nmnist(folder: Path) -> Dataset:
    """Digits in front of a moving event camera, 34 x 34 pixels: `<train|test>/<digit>/<number>.bin` in `folder`."""
    return Dataset(_Recordings("nmnist", folder))


def neutouch(folder: Path, which: str = "objects") -> Dataset:
    """Events of a tactile skin: "objects" (36 classes) or "containers" (20), from the archive of that set in `folder`.

    The archive is read as a whole.
    """
    if which not in ("objects", "containers"):
        raise ValueError(f"which: expected 'objects' or 'containers', found {which!r}")
    return Dataset(_Recordings(which, folder))


def letters(path: Path) -> Dataset:
    """Presses on letters of braille under a skin of 10 x 8 taxels: `letters.npz` in the folder, or the path of such an archive.

    Readings of a batch are spread over its time: only their order is exact. Columns 0 to 4 are columns 5 to 9 of the archive, which
    swaps the halves of the skin. The archive is read as a whole.
    """
    return Dataset(_Recordings("letters", path))


def slip(folder: Path) -> Dataset:
    """Slips under 24 electrodes: `<class>/<object><number>.csv` in `folder`. `data` is float32 (readings, 24)."""
    return Dataset(_Recordings("slip", folder))


def presses(path: Path) -> Dataset:
    """Presses with labels along time, in a safetensors file as `meissner simulate markers` writes them. It is read as a whole."""
    return Dataset(_Recordings("presses", path))
