"""The exceptions of Meissner. Each keeps the text of the engine: what was expected, and what was found."""

from __future__ import annotations


class Error(Exception):
    """Base of all exceptions of this module."""


class InputError(Error, ValueError):
    """Events, frames or options are out of range or of a wrong shape."""


class DtypeError(Error, TypeError):
    """An array has a type that events or frames cannot have."""


class DescriptionError(Error, ValueError):
    """A description is inconsistent, or names no network.

    `problems` has a tuple (line, layer or None, text) for each inconsistency of a description file.
    """

    def __init__(self, message: str, problems: list[tuple[int, str | None, str]] | None = None) -> None:
        super().__init__(message)
        self.problems = problems or []


class WeightsError(Error, ValueError):
    """Weights cannot be read, or do not fit their network."""


class SnapshotError(Error, ValueError):
    """A snapshot is damaged, or belongs to another network, sensor or set of options."""


class NotIncrementalError(Error, ValueError):
    """The network has no incremental form: `Batch` runs it."""


class NotANumberError(Error, ArithmeticError):
    """A layer computed NaN: there is no prediction."""


class MemoryLimitError(Error, MemoryError):
    """An engine would need more memory than its limit."""


class LiveError(Error, RuntimeError):
    """A live engine has ended, or another thread is in the same method."""


class EvaluationError(Error, ValueError):
    """Networks, trainings and a data set do not fit together, or one of their files cannot be read."""


class RecordingError(Error, ValueError):
    """A recording cannot be read or written in a format."""


class FileError(Error, OSError):
    """The operating system refused a file."""


class MeissnerWarning(UserWarning):
    """Weights were trained on another sensor, window or preparation, or many events are lost."""


for _class in list(globals().values()):
    if isinstance(_class, type) and issubclass(_class, Error | MeissnerWarning):
        _class.__module__ = "meissner"
