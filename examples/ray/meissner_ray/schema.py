"""The columns of results: those that every row has, and the figures of each command and task."""

from __future__ import annotations

import pyarrow as pa

_TEXT, _INT, _REAL = pa.string(), pa.int64(), pa.float64()

_RECORDING = {"recording": _TEXT, "bytes": _INT, "modified_ns": _INT, "failure": _TEXT}
_NETWORK = {"network": _TEXT, "seed": _INT, "files": _TEXT, "weights": _TEXT}
_ORIGIN = {"meissner": _TEXT, "meissner_ray": _TEXT, "ray": _TEXT, "cpu": _TEXT}
_TIMES = {"run": _TEXT, "worker": _TEXT, "started_s": _REAL, "ended_s": _REAL, "cpu_s": _REAL}

_SPEEDS = ("us", "speed_up", "on_front", "push_p50_us", "push_p99_us", "p50_us", "p99_us")

MEASURED = frozenset({*_ORIGIN, *_TIMES, *_SPEEDS, "newest_mae"})
"""Columns that differ from run to run: origins, times, and what depends on times. `newest_mae` is the error of the newest
prediction that there is while the next one is computed. All other columns are determined by recording and settings."""

_LABEL = {"label": _TEXT, "class": _INT, "answers": pa.list_(_INT)}
_OUTPUTS = {"outputs": pa.list_(pa.float32()), "outputs_shape": pa.list_(_INT), "outputs_sha256": _TEXT}
_OVER_TIME = {"times_us": pa.list_(_INT), "at_times": pa.list_(_REAL)}
_CLASSES = (
    {"of": _TEXT, "recordings": _INT, "accuracy": _REAL, "low_95": _REAL, "high_95": _REAL, "settled_us": _INT}
    | _LABEL
    | _OVER_TIME
    | _OUTPUTS
)
_SLIP = {"of": _TEXT, "windows": _INT, "accuracy": _REAL, "precision": _REAL, "recall": _REAL, "f1": _REAL} | _LABEL | _OUTPUTS
_ANGLE = (
    {"of": _TEXT, "output": _TEXT, "unit": _TEXT, "presses": _INT, "mae": _REAL, "sd": _REAL, "newest_mae": _REAL}
    | {"settled_share": _REAL}
    | _OVER_TIME
    | _OUTPUTS
)
_AREA = {"of": _TEXT, "pictures": _INT, "iou": _REAL, "force_mae_n": _REAL} | _OUTPUTS
_PARETO = (
    {"setting": _TEXT, "us": _REAL, "speed_up": _REAL, "error": _REAL, "on_front": pa.bool_(), "timed": _INT, "entered": _REAL}
    | {"rows": _REAL, "multiply_adds": _REAL, "error_low": _REAL, "error_high": _REAL, "push_p50_us": _REAL}
    | {"push_p99_us": _REAL, "p50_us": _REAL, "p99_us": _REAL, "largest_difference": _REAL}
)
_EVAL = {"digits": _CLASSES, "objects": _CLASSES, "containers": _CLASSES, "slip": _SLIP, "angle": _ANGLE, "area": _AREA}


def schema(command: str, task: str) -> pa.Schema:
    """The columns of a command and a task; all can be null, and the figures are null if a recording fails."""
    figures = _PARETO if command == "pareto" else _EVAL[task]
    return pa.schema(list((_RECORDING | _NETWORK | figures | _ORIGIN | _TIMES).items()))
