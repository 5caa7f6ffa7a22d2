"""Figures of merit of arrays, as the program reports them."""

from __future__ import annotations

import numpy as np
from numpy.typing import ArrayLike

from ._errors import InputError
from ._meissner import _confusion, _iou, _mean_std, _pareto_front, _scores, _wilson_95

__all__ = ["confusion", "iou", "mean_absolute_error", "mean_std", "pareto_front", "scores", "wilson_95"]


def confusion(truth: ArrayLike, predicted: ArrayLike, classes: int) -> np.ndarray:
    """Counts of predictions, int64 (classes, classes): true classes by row, predicted ones by column."""
    rows = _confusion(np.asarray(truth).ravel().tolist(), np.asarray(predicted).ravel().tolist(), classes)
    return np.array(rows, np.int64).reshape(classes, classes)


def scores(confusion: ArrayLike) -> dict[str, float]:
    """Accuracy, and precision, recall and F1 as means over the classes that are true or predicted at least once, from 0 to 1.

    A class that is never predicted has precision and F1 0. Raises `InputError` for a matrix without counts.
    """
    found = _scores(np.asarray(confusion).tolist())
    if found is None:
        raise InputError("confusion: expected predictions, found none")
    return dict(zip(("accuracy", "precision", "recall", "f1"), found, strict=True))


def wilson_95(hits: int, trials: int) -> tuple[float, float]:
    """The 95 % score interval of a probability after `hits` in `trials`. Raises `InputError` without trials."""
    found = _wilson_95(hits, trials)
    if found is None:
        raise InputError("trials: expected at least 1, found 0")
    return found


def mean_std(values: ArrayLike) -> tuple[float, float | None]:
    """Mean and sample standard deviation (n - 1); None for the deviation of a single value. Raises `InputError` without values."""
    found = _mean_std(np.asarray(values, np.float64).ravel().tolist())
    if found is None:
        raise InputError("values: expected at least one, found none")
    return found


def mean_absolute_error(found: ArrayLike, truth: ArrayLike) -> tuple[float, float | None]:
    """Mean of the absolute errors and their sample standard deviation, in the unit of the values. Both have the same shape."""
    found, truth = np.asarray(found, np.float64), np.asarray(truth, np.float64)
    if found.shape != truth.shape:
        raise InputError(f"found: expected shape {truth.shape}, that of the truth, found {found.shape}")
    return mean_std(np.abs(found - truth))


def iou(found: ArrayLike, truth: ArrayLike) -> float:
    """Intersection over union of two masks of bool; 1 where both are empty, since they agree."""
    found, truth = np.asarray(found, bool), np.asarray(truth, bool)
    if found.shape != truth.shape:
        raise InputError(f"found: expected shape {truth.shape}, that of the truth, found {found.shape}")
    return _iou(found.ravel().tolist(), truth.ravel().tolist())


def pareto_front(points: ArrayLike) -> np.ndarray:
    """Indices of the points (time, error), float (points, 2), that no other point beats, by ascending time."""
    return np.array(_pareto_front(np.asarray(points, np.float64).tolist()), np.int64)
