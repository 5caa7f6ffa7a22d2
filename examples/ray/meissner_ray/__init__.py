"""Evaluations of event networks over many recordings, as tasks of Ray.

    results = meissner_ray.evaluate("digits", "NMNIST", "results", networks="digits-past")
    for record in meissner_ray.summary(results):
        print(record["network"], record["accuracy"])

Each recording is judged by `meissner.evaluate` or measured by `meissner.pareto`, with the bits of a single process.
"""

from .cost import Cost, Measured, cost, measured
from .errors import ClusterError, NoRecordingsError, RayError, ResultsError, SettingsError
from .recordings import Recording, find
from .run import evaluate, pareto
from .schema import MEASURED
from .store import read, runs
from .summary import summary

__all__ = [
    "MEASURED",
    "ClusterError",
    "Cost",
    "Measured",
    "NoRecordingsError",
    "RayError",
    "Recording",
    "ResultsError",
    "SettingsError",
    "cost",
    "evaluate",
    "find",
    "measured",
    "pareto",
    "read",
    "runs",
    "summary",
]
