"""Networks on labelled data sets, as records for a data frame."""

from __future__ import annotations

import json
import os
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from html import escape
from typing import Any

import numpy as np

from ._errors import InputError
from ._meissner import Weights, _evaluate, _pareto
from ._progress import Callback, ticks

Path = str | os.PathLike[str]
Record = dict[str, Any]

# Maximum number of rows of a table in a notebook.
_MOST_ROWS = 40


def _text(of: Any, count: str) -> str:
    """The task, the networks and the number of figures."""
    networks = ", ".join(dict.fromkeys(record["network"] for record in of.records)) or "no network"
    return f"<{type(of).__name__} of {of.task!r}: {networks}; {count}>"


def _table(title: str, records: list[Record]) -> str:
    """Records as HTML, at most the first `_MOST_ROWS`."""
    columns = list(dict.fromkeys(key for record in records for key in record))
    head = "".join(f"<th>{escape(column)}</th>" for column in columns)
    shown = ([_cell(record.get(column)) for column in columns] for record in records[:_MOST_ROWS])
    rows = "".join(f"<tr>{''.join(f'<td>{escape(cell)}</td>' for cell in row)}</tr>" for row in shown)
    rest = f"<p>{len(records) - _MOST_ROWS} more in <code>records</code></p>" if len(records) > _MOST_ROWS else ""
    return f"<table><caption>{escape(title)}</caption><thead><tr>{head}</tr></thead><tbody>{rows}</tbody></table>{rest}"


def _cell(value: Any) -> str:
    return "" if value is None else f"{value:.4g}" if isinstance(value, float) else str(value)


@dataclass(frozen=True, repr=False)
class Evaluation:
    """Figures of networks on a data set. `pandas.DataFrame(evaluation.records)` is a table of them.

    - `report`: what `meissner eval TASK --json` writes; `docs/json.md` explains its keys.
    - `records`: a dict for each training of each network (on each part of the data, or for each output).
    - `over_time`: a dict for each record and each time of a prediction; empty for slip, area and force.
    - `logits`: float32 outputs of the networks by the name NETWORK.SEED: (recordings, classes) or (presses, outputs); for force
      (frames, 1) in N; for area
      NETWORK.SEED.0: (pictures, H, W), the force on each pixel in N.
    """

    task: str
    report: Mapping[str, Any]
    logits: Mapping[str, np.ndarray]
    records: list[Record]
    over_time: list[Record]

    def __repr__(self) -> str:
        return _text(self, f"{len(self.records)} records, {len(self.over_time)} over time")

    def _repr_html_(self) -> str:
        return _table(repr(self), self.records)

    def confusion(self, network: str, of: str | None = None) -> np.ndarray:
        """Predictions of all trainings of a network: int64, true classes by row, predicted ones by column.

        `of` is the part of the data as in the records; None for the first part. Raises `InputError` if there is none.
        """
        found = [(part, judged) for name, part, judged in _parts(self.report) if name == network and of in (None, part)]
        if not found or "confusion" not in found[0][1]:
            raise InputError(f"expected a network of the records that predicts classes, found {network!r} on {of!r}")
        return np.array(found[0][1]["confusion"], np.int64)


@dataclass(frozen=True, repr=False)
class Pareto:
    """Run time against error. `pandas.DataFrame(pareto.records)` is a table of the settings.

    - `report`: what `meissner pareto TASK --json` writes.
    - `records`: a dict for each setting of each network, the exact one first: time, error, and whether no other setting beats it.
    """

    task: str
    report: Mapping[str, Any]
    records: list[Record]

    def __repr__(self) -> str:
        return _text(self, f"{len(self.records)} settings")

    def _repr_html_(self) -> str:
        return _table(repr(self), self.records)


def evaluate(
    task: str,
    data: Path,
    *,
    networks: str | Path | Iterable[Path] = (),
    weights: Path | None = None,
    trainings: Path | None = None,
    folds: int | None = None,
    stride: int | None = None,
    every_us: int | None = None,
    mode: str = "incremental",
    threads: int | None = None,
    progress: bool | Callback | None = None,
) -> Evaluation:
    """Judges networks on a labelled data set, as `meissner eval TASK` does.

    - `task`, `data`: "digits" and a folder of N-MNIST; "objects" or "containers" and a folder of NeuTouch; "letters" and a folder of
      letters of braille; "slip" and a folder of the slip data set; "angle" and a safetensors file of presses; "area" and a file of
      pictures of a gel; "force" and a safetensors file of grasps.
    - `networks`: names of shipped networks or description files; none for every shipped one of the task ("tactigraph-past" for
      "angle").
    - `weights`, `trainings`, `folds`: a file of weights for the only network, or a folder of trainings and the number of folds of
      its cross-validation.
    - `stride`: one of every `stride` events is pushed; `every_us`: microseconds between predictions, by default 10,000 (1,000 for
      "angle" and "force"); `mode`: "incremental" or "batch", which give the same figures.
    - `threads`: by default the number of cores. It changes no figure.
    - `progress`: a callback (done, total, training), True or False; None for a bar on a terminal and in a notebook.

    Ctrl-C ends it. Raises `EvaluationError`, `RecordingError`, `InputError`.
    """
    asked = _asked(task, networks, weights, trainings, folds, stride, every_us, mode, threads)
    with ticks(progress, "presses" if task in ("angle", "area") else "recordings") as tick:
        text, logits = _evaluate(task, data, asked, tick)
    report = json.loads(text)
    records, over_time = [], []
    if task == "area":
        records = list(_of_pictures(report))
        return Evaluation(task, report, dict(Weights(logits).items()), records, over_time)
    for network, part, judged in _parts(report):
        for one in judged["each"]:
            head = {"network": network, "of": part, "seed": one["seed"], "files": ", ".join(one["files"])}
            if task == "angle":
                _of_presses(report, head, one, records, over_time)
            elif task == "force":
                records.extend(head | {"of": part["part"]} | {key: part[key] for key in ("frames", "mse", "mae")} for part in one["parts"])
            elif task == "slip":
                records.append(head | {key: one[key] for key in ("windows", "accuracy", "precision", "recall", "f1")})
            else:
                _of_recordings(report, head, one, records, over_time)
    return Evaluation(task, report, dict(Weights(logits).items()), records, over_time)


def pareto(
    task: str,
    data: Path,
    *,
    networks: str | Path | Iterable[Path] = (),
    weights: Path | None = None,
    trainings: Path | None = None,
    folds: int | None = None,
    only: str | Iterable[str] = (),
    timed: int | None = None,
    repeats: int = 3,
    state: Path | None = None,
    sensor: tuple[int, int] | None = None,
    from_us: int = 0,
    threads: int | None = None,
    progress: bool | Callback | None = None,
) -> Pareto:
    """Measures run time against error of networks, exact and with each approximation, as `meissner pareto TASK` does.

    - `task`, `data`, `networks`, `weights`, `trainings`, `folds`, `threads`: as for `evaluate`; for "angle" `data` is a recording,
      and errors are measured against the exact network; "force" and a safetensors file of grasps.
    - `only`: parts of "NETWORK, SETTING"; other settings are left out, except the exact ones.
    - `timed`: number of events (windows for "slip", pictures for "area", recordings for "force") that are timed in each of `repeats`
      repeats; about 20,000 events, 400 windows, 40 pictures or 20 recordings by default.
    - `state`: a file that keeps the measurements, so that a stopped study continues from there.
    - `sensor`, `from_us`: for "angle", the sensor instead of the recording's, and the microseconds that are left out at its beginning.
    - `progress`: a callback (done, total, setting), True or False; None for a bar on a terminal and in a notebook.

    Ctrl-C ends it after the setting that is being measured. Raises `EvaluationError`, `RecordingError`, `InputError`.
    """
    asked = _asked(task, networks, weights, trainings, folds, None, None, "incremental", threads)
    only = [only] if isinstance(only, str) else list(only)
    measured = {"only": only, "timed": timed, "repeats": repeats, "state": state, "sensor": sensor, "from_us": from_us}
    with ticks(progress, "settings") as tick:
        report = json.loads(_pareto(task, data, asked, measured, tick))
    records = []
    for network in report["networks"]:
        for setting in network["settings"]:
            low, high = setting["interval_95"] or (None, None)
            keys = ("setting", "us", "speed_up", "error", "on_front", "timed", "entered", "rows", "multiply_adds")
            push, predict = setting["push_us"], setting["push_predict_us"]
            records.append(
                {"network": network["network"]}
                | {key: setting[key] for key in keys}
                | {"error_low": low, "error_high": high, "push_p50_us": push["p50"], "push_p99_us": push["p99"]}
                | {"p50_us": predict["p50"], "p99_us": predict["p99"], "largest_difference": setting["numerical"]["max"]}
            )
    return Pareto(task, report, records)


def _asked(task: str, networks: Any, *rest: Any) -> dict[str, Any]:
    networks = [networks] if isinstance(networks, str | os.PathLike) else list(networks)
    if task == "angle" and not networks:
        networks = ["tactigraph-past"]
    names = ("weights", "trainings", "folds", "stride", "every_us", "mode", "threads")
    return {"networks": [os.fspath(name) for name in networks]} | dict(zip(names, rest, strict=True))


def _parts(report: Mapping[str, Any]) -> Iterable[tuple[str, str | None, Mapping[str, Any]]]:
    """Each network with each part of the data that it is judged on, and the figures there."""
    for network in report["networks"]:
        name = network["network"]["name"]
        for part in network.get("sets", ()):
            yield name, part["set"], part
        for part in network["cross_validation"] or () if "sets" in network else ():
            yield name, f"cross-validation by {part['scheme']}", part
        if "sets" not in network:
            for key, part in (("test", "test"), ("cross_validation", "cross-validation"), ("figures", None)):
                if network.get(key):
                    yield name, part, network[key]


def _of_recordings(report: Mapping[str, Any], head: Record, one: Mapping[str, Any], records: list, over_time: list) -> None:
    low, high = one["interval_95"]
    figures = {"recordings": one["recordings"], "accuracy": one["accuracy"], "low_95": low, "high_95": high}
    records.append(head | figures | {"settled_us": one["settled_us"]})
    for t_us, accuracy, (low, high) in zip(report["times_us"], one["accuracy_at"], one["interval_95_at"], strict=True):
        over_time.append(head | {"t_us": t_us, "accuracy": accuracy, "low_95": low, "high_95": high})


def _of_pictures(report: Mapping[str, Any]) -> Iterator[Record]:
    """A record for each training on all pictures and for each kind of indenter."""
    for network in report["networks"]:
        for training in network["trainings"]:
            head = {"network": network["network"]["name"], "seed": training["seed"], "files": ", ".join(training["files"])}
            for judged in training["sets"]:
                for of, figures in ((None, judged), *judged["kinds"].items()):
                    force = figures["force_n"] or {"mean": None}
                    found = {"pictures": figures["pictures"], "iou": figures["iou"]["mean"], "force_mae_n": force["mean"]}
                    yield head | {"of": of} | found


def _of_presses(report: Mapping[str, Any], head: Record, one: Mapping[str, Any], records: list, over_time: list) -> None:
    for output in [*one["outputs"], *([one["angles"]] if one["angles"] else [])]:
        of = head | {"output": output["name"], "unit": output["unit"]}
        figures = {"presses": one["presses"], "mae": output["mean_absolute"], "sd": output["std"], "newest_mae": output["newest"]}
        records.append(of | figures | {"settled_share": one["settled_share"]})
        for t_us, mae in zip(report["times_us"], output["mean_absolute_at"], strict=True):
            over_time.append(of | {"t_us": t_us, "mae": mae})
