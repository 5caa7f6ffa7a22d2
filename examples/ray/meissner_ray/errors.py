"""What can go wrong before a recording is judged. The text states what was expected and what was found."""

from __future__ import annotations


class RayError(Exception):
    """Base of the exceptions of this package."""


class NoRecordingsError(RayError, ValueError):
    """None of the named files is a recording of the task."""


class SettingsError(RayError, ValueError):
    """Settings are out of range, or differ from those of the results in the folder."""


class ResultsError(RayError, OSError):
    """A folder holds no results, or another run is writing to it."""


class ClusterError(RayError, RuntimeError):
    """Ray runs in another way than requested."""
