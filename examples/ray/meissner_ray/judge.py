"""One recording to its rows: the records of `meissner.evaluate` or `meissner.pareto`, with their origin.

A recording that Meissner refuses, or that makes it fail, has one row with the failure. The rows depend on the recording and the
settings alone, except the columns of `schema.MEASURED`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import meissner
import numpy as np

from .recordings import ARCHIVES, Recording
from .settings import Settings
from .staging import staged

Row = dict[str, Any]
Cards = list[dict[str, Any]]


def rows_of(recording: Recording, settings: Settings, cards: Cards, scratch: Path | None = None) -> list[Row]:
    """The rows of a recording; `cards` are those of the settings, and `scratch` is a folder for temporary files."""
    stamp = recording.stamp() or (None, None)
    head = {"recording": recording.name, "bytes": stamp[0], "modified_ns": stamp[1], "failure": None}
    try:
        with staged(settings.task, recording, scratch) as data:
            try:
                judged = _evaluated if settings.command == "eval" else _measured
                return [head | row for row in judged(data, settings, cards)]
            except meissner.Error as error:
                message = str(error).replace(str(data), str(_root(settings.task, recording)))
                return [head | {"failure": f"{type(error).__name__}: {message}"}]
    except (KeyboardInterrupt, SystemExit):
        raise
    except BaseException as error:
        # A panic of the extension is no Exception. It costs this recording, too.
        return [head | {"failure": f"{type(error).__name__}: {error}"}]


def _root(task: str, recording: Recording) -> Path:
    """The path that replaces the path of the staged data in messages."""
    path = Path(recording.path)
    if task in ARCHIVES:
        return path.parent
    return path.parents[{"digits": 2, "slip": 1}.get(task, 0)] if task in ("digits", "slip") else path


def _evaluated(data: Path, settings: Settings, cards: Cards) -> Iterator[Row]:
    evaluation = meissner.evaluate(settings.task, data, **settings.arguments())
    figures = dict(_figures(evaluation.report))
    for record in evaluation.records:
        of = (record["network"], record["of"], record["seed"])
        row = _origin(cards, record["network"], record["files"]) | record | _outputs(evaluation, record)
        if of in figures and "confusion" in figures[of]:
            row |= _answers(evaluation.report["classes"], figures[of]["confusion"])
        over = [then for then in evaluation.over_time if all(then.get(key) == record[key] for key in _KEYS if key in then)]
        if over:
            measure = "mae" if settings.task == "angle" else "accuracy"
            row |= {"times_us": [then["t_us"] for then in over], "at_times": [then[measure] for then in over]}
        yield row


_KEYS = ("network", "of", "seed", "files", "output")


def _measured(data: Path, settings: Settings, cards: Cards) -> Iterator[Row]:
    pareto = meissner.pareto(settings.task, data, **settings.arguments())
    for record in pareto.records:
        yield _origin(cards, record["network"], None) | record


def _figures(report: Mapping[str, Any]) -> Iterator[tuple[tuple[str, str | None, int | None], Mapping[str, Any]]]:
    """The figures of each training on each part of the data, for tasks with classes."""
    for network in report["networks"]:
        parts = [(part["set"], part) for part in network.get("sets", ())] + [("test", network.get("test"))]
        for of, judged in parts:
            for one in judged["each"] if judged else ():
                yield (network["network"]["name"], of, one["seed"]), one


def _answers(classes: list[str], confusion: list[list[int]]) -> Row:
    """The class of the recording, and how often each class was predicted. All of a recording is of one class."""
    counts = np.array(confusion, np.int64)
    truth = int(counts.sum(axis=1).argmax())
    return {"label": classes[truth], "class": truth, "answers": counts[truth].tolist()}


def _outputs(evaluation: meissner.Evaluation, record: Row) -> Row:
    """The outputs that a record is computed from, and the fingerprint of their bits; those of pictures are too many to keep."""
    seed = "shipped" if record["seed"] is None else record["seed"]
    area = evaluation.task == "area"
    outputs = evaluation.logits[f"{record['network']}.{seed}{'.0' if area else ''}"]
    print_of = {"outputs_shape": list(outputs.shape), "outputs_sha256": hashlib.sha256(outputs.tobytes()).hexdigest()}
    return print_of | {"outputs": None if area else outputs.ravel().tolist()}


def _origin(cards: Cards, network: str, files: str | None) -> Row:
    """Seed and fingerprint of the weights; one fingerprint for all trainings if `files` does not name one."""
    own = [card for card in cards if card["network"] == network and files in (None, "", card["file"])]
    if files and not own:
        own = [card for card in cards if card["network"] == network]
    prints = [card["weights"] for card in own]
    seed = own[0]["seed"] if len(own) == 1 else None
    return {"seed": seed, "weights": prints[0] if len(prints) == 1 else hashlib.sha256("".join(prints).encode()).hexdigest()}
