"""What can go wrong before a recording is judged. The text says what was expected and what came."""

from __future__ import annotations


class RayError(Exception):
    """Base of the exceptions of this package."""


class NoRecordingsError(RayError, ValueError):
    """Nothing that was named is a recording of the task."""


class SettingsError(RayError, ValueError):
    """Settings are out of range, or not those of the results in the folder."""


class ResultsError(RayError, OSError):
    """A folder holds no results, or another run is writing to it."""


class ClusterError(RayError, RuntimeError):
    """Ray runs in another way than was asked for."""
