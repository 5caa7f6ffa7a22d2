"""From the rows of recordings to figures over all recordings.

Shares and counts of classes equal those of one evaluation over all recordings in every bit. Means are weighted with the presses
or pictures of each recording.
"""

from __future__ import annotations

from typing import Any

import meissner
import numpy as np
import pyarrow as pa

from .store import failures

Row = dict[str, Any]

_OF = ("network", "seed", "files", "of", "output", "setting")
_MEANS = {"presses": ("mae",), "pictures": ("iou", "force_mae_n")}


def summary(results: pa.Table) -> list[Row]:
    """A record for each training of each network, on each part of the data, for each output or setting.

    `recordings` is their number. Tasks with classes have `accuracy`, its 95 % interval `low_95` and `high_95`, and macro
    `precision`, `recall` and `f1`; "angle" and "area" the mean error over presses and the means over pictures; a study of run
    time the means of `us` (microseconds), `speed_up` and `error` over recordings.
    """
    rows = results.to_pylist()
    failed = {row["recording"] for row in failures(rows)}
    groups: dict[tuple[Any, ...], list[Row]] = {}
    for row in rows:
        if row["recording"] not in failed:
            groups.setdefault(tuple(row.get(name) for name in _OF), []).append(row)
    return [_head(of) | {"recordings": len(group)} | _figures(group) for of, group in groups.items()]


def _head(of: tuple[Any, ...]) -> Row:
    return {name: value for name, value in zip(_OF, of, strict=True) if value is not None and value != ""}


def _figures(group: list[Row]) -> Row:
    if "setting" in group[0]:
        return {name: float(np.mean([row[name] for row in group])) for name in ("us", "speed_up", "error")}
    if "answers" in group[0]:
        return _scores(group)
    weight = next(name for name in _MEANS if name in group[0])
    unit = {"unit": group[0]["unit"]} if "unit" in group[0] else {}
    return unit | {weight: sum(row[weight] for row in group)} | {name: _mean(group, name, weight) for name in _MEANS[weight]}


def _scores(group: list[Row]) -> Row:
    confusion = np.zeros((len(group[0]["answers"]),) * 2, np.int64)
    for row in group:
        confusion[row["class"]] += row["answers"]
    low, high = meissner.metrics.wilson_95(int(np.trace(confusion)), int(confusion.sum()))
    return {"low_95": low, "high_95": high} | meissner.metrics.scores(confusion)


def _mean(group: list[Row], name: str, weight: str) -> float | None:
    known = [row for row in group if row[name] is not None and row[weight]]
    return float(np.average([row[name] for row in known], weights=[row[weight] for row in known])) if known else None
