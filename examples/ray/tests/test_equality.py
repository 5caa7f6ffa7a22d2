"""The rows have the bits of Meissner in this process, whatever the number of workers."""

import hashlib

import meissner
import numpy as np
import pytest
from conftest import (
    DAVIS,
    determined,
    in_a_loop,
    make_events,
    write_digits,
    write_gel,
    write_grasp,
    write_press,
    write_skin,
    write_slips,
)

import meissner_ray
from meissner_ray import MEASURED


def write_set(task, folder):
    """Recordings of a task."""
    folder = folder / "data"
    folder.mkdir()
    if task == "digits":
        return write_digits(folder)
    if task == "slip":
        return write_slips(folder)
    if task in ("objects", "containers"):
        return write_skin(folder, *{"objects": ("Ev-Objects.zip", 250), "containers": ("Ev-Containers.zip", 325)}[task])
    write = {"angle": write_press, "area": write_gel}[task]
    for seed in range(3):
        write(folder / f"{seed % 2}/same.safetensors" if seed < 2 else folder / "other.safetensors", seed)
    return folder


def known(row, record):
    """The values of `row` for the determined names of a record."""
    return {name: row[name] for name in record if name not in MEASURED}


NETWORKS = {
    "digits": "digits-past",
    "objects": "touch-objects",
    "containers": "touch-containers",
    "slip": "slip-lstm",
    "angle": "tactigraph-past",
    "area": "canf-plain",
}


@pytest.mark.parametrize("task", NETWORKS)
def test_the_rows_of_every_task_are_those_of_a_loop_bit_for_bit(cluster, tmp_path, task):
    data = write_set(task, tmp_path)
    results = meissner_ray.evaluate(task, data, tmp_path / "out", networks=NETWORKS[task])
    assert results.num_rows >= 3 and results["failure"].null_count == results.num_rows
    assert determined(results) == determined(in_a_loop("eval", task, data, NETWORKS[task]))
    # The returned results equal the written ones.
    assert meissner_ray.read(tmp_path / "out").equals(results, check_metadata=True)


def test_recordings_of_events_have_the_outputs_and_figures_of_the_whole_data_set(cluster, digits, tmp_path):
    whole = meissner.evaluate("digits", digits, networks="digits-past", threads=1)
    results = meissner_ray.evaluate("digits", digits, tmp_path / "out", networks="digits-past")
    [logits] = whole.logits.values()
    found = np.array([row["outputs"] for row in results.to_pylist()], "f4")
    assert found.tobytes() == logits.tobytes()
    [record], [total] = whole.records, meissner_ray.summary(results)
    assert total["recordings"] == record["recordings"] == 20
    assert {name: total[name] for name in ("accuracy", "low_95", "high_95")} == {
        name: record[name] for name in ("accuracy", "low_95", "high_95")
    }
    assert total["f1"] == meissner.metrics.scores(whole.confusion("digits-past"))["f1"]


def test_slips_have_the_outputs_and_figures_of_the_whole_data_set(cluster, tmp_path):
    data = write_slips(tmp_path / "slips")
    whole = meissner.evaluate("slip", data, networks="slip-lstm", threads=1)
    results = meissner_ray.evaluate("slip", data, tmp_path / "out", networks="slip-lstm")
    [logits] = whole.logits.values()
    # Meissner orders classes by their indices, results are ordered by paths.
    names = [sample.name for sample in meissner.datasets.slip(data)]
    by_name = {row["recording"][len(str(data)) + 1 : -4]: row["outputs"] for row in results.to_pylist()}
    assert np.concatenate([by_name[name] for name in names]).astype("f4").tobytes() == logits.tobytes()
    totals = {total["of"]: total for total in meissner_ray.summary(results)}
    assert totals.keys() == {record["of"] for record in whole.records}
    for record in whole.records:
        assert {name: totals[record["of"]][name] for name in ("accuracy", "precision", "recall", "f1")} == {
            name: record[name] for name in ("accuracy", "precision", "recall", "f1")
        }


def test_a_file_has_the_records_of_an_evaluation_of_it(cluster, tmp_path):
    for seed in range(2):
        write_press(tmp_path / f"data/{seed}.safetensors", seed)
    results = meissner_ray.evaluate("angle", tmp_path / "data", tmp_path / "out", networks="tactigraph-past")
    rows = results.to_pylist()
    for seed in range(2):
        path = tmp_path / f"data/{seed}.safetensors"
        alone = meissner.evaluate("angle", path, networks="tactigraph-past", threads=1)
        own = [row for row in rows if row["recording"] == str(path)]
        for row, record in zip(own, alone.records, strict=True):
            assert known(row, record) == known(record, record)
        [outputs] = alone.logits.values()
        assert {row["outputs_sha256"] for row in own} == {hashlib.sha256(outputs.tobytes()).hexdigest()}
        assert own[0]["at_times"] == [then["mae"] for then in alone.over_time if then["output"] == own[0]["output"]]
    [roll] = [total for total in meissner_ray.summary(results) if total["output"] == "roll"]
    assert roll["presses"] == 2 and roll["mae"] == pytest.approx(np.mean([row["mae"] for row in rows if row["output"] == "roll"]))


def test_every_row_says_where_it_comes_from(cluster, digits, tmp_path):
    results = meissner_ray.evaluate("digits", digits, tmp_path / "out", networks=["digits-past", "digits-frozen"])
    rows = results.to_pylist()
    assert len(rows) == 40
    for row in rows:
        assert row["meissner"] and row["meissner_ray"] and row["ray"] and row["cpu"] and row["seed"] is not None
        assert row["ended_s"] > row["started_s"] and row["cpu_s"] > 0
    # The two networks share their weights; the descriptions differ.
    assert len({row["weights"] for row in rows}) == 2


def test_run_time_against_error_is_determined_but_for_times(cluster, tmp_path):
    data = tmp_path / "data"
    data.mkdir()
    for seed, name in enumerate(("a.npy", "b.csv")):
        meissner.write(data / name, make_events(400, seed, DAVIS), DAVIS)
    asked = {"only": ("stride 2", "stale 5"), "timed": 200, "repeats": 1, "sensor": DAVIS}
    results = meissner_ray.pareto("angle", data, tmp_path / "out", networks="tactigraph-past", **asked)
    assert results["failure"].null_count == results.num_rows and results.num_rows >= 6
    assert determined(results) == determined(in_a_loop("pareto", "angle", data, "tactigraph-past", **asked))
    alone = meissner.pareto("angle", data / "a.npy", networks="tactigraph-past", threads=1, **asked)
    rows = [row for row in results.to_pylist() if row["recording"].endswith("a.npy")]
    for row, record in zip(rows, alone.records, strict=True):
        assert known(row, record) == known(record, record) and row["us"] > 0
    totals = {total["setting"]: total for total in meissner_ray.summary(results)}
    assert totals["exact"]["recordings"] == 2 and totals["exact"]["error"] == 0


@pytest.mark.parametrize(
    ("task", "network", "only"),
    [
        ("force", "force-tdnn", "exact"),
        ("digits", "digits-past", "exact"),
        ("slip", "slip-lstm", "exact"),
        ("area", "canf-plain", "exact"),
    ],
)
def test_run_time_against_error_of_labelled_recordings(cluster, tmp_path, task, network, only):
    if task == "force":
        for newton in (1, 2):
            write_grasp(tmp_path / f"data/{newton}.safetensors", newton)
        data = tmp_path / "data"
    elif task == "digits":
        data = [write_digits(tmp_path / "data") / f"test/{digit}/00000.bin" for digit in (3, 7)]
    elif task == "slip":
        data = [write_slips(tmp_path / "data") / name for name in ("e/screw3.csv", "w/screw1.csv")]
    else:
        write_gel(tmp_path / "data/1.safetensors", 1)
        data = tmp_path / "data"
    asked = {"only": (only,), "timed": 1, "repeats": 1}
    results = meissner_ray.pareto(task, data, tmp_path / "out", networks=network, **asked)
    assert results["failure"].to_pylist() == [None] * results.num_rows and "exact" in results["setting"].to_pylist()
    assert determined(results) == determined(in_a_loop("pareto", task, data, network, **asked))
