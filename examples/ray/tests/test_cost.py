"""The cost of many recordings is computed as the README says, from rows whose times are known."""

import json

import pyarrow as pa
import pytest

import meissner_ray
from meissner_ray.schema import schema


def results(runs):
    """Rows of runs: for each run its workers, and (worker, start, end) of each task."""
    rows, known = [], []
    for number, (workers, tasks) in enumerate(runs):
        base = 1_000.0 * number
        for i, (worker, start, end) in enumerate(tasks):
            row = {"recording": f"{number}/{i}", "run": str(number), "worker": worker, "cpu": "one", "cpu_s": 0.5}
            rows.append(row | {"started_s": base + start, "ended_s": base + end})
        times = {"begun_s": 0.0, "judged_s": 20.0, "stopped_s": 21.0, "ended_s": 21.0 + 0.1 * len(tasks)}
        times = {name: base + value for name, value in times.items()}
        known.append({"run": str(number), "workers": workers, "rows": len(tasks)} | times)
    table = pa.Table.from_pylist(rows, schema("eval", "digits"))
    return table.replace_schema_metadata({"meissner_ray.runs": json.dumps(known)})


def test_the_costs_are_those_of_the_rows():
    table = results([(2, [("a", 5, 6), ("a", 6.5, 8.5), ("b", 7, 8), ("b", 8.25, 12.25)])])
    measured = meissner_ray.measured(table)
    assert (measured.workers, measured.recordings, measured.cpu) == (2, 4, "one")
    assert measured.startup_s == 6 and measured.recording_s == 2 and measured.longest_s == 4
    assert measured.overhead_s == pytest.approx(0.375) and measured.shutdown_s == 1
    assert measured.write_s == pytest.approx(0.1) and measured.deviation_s == pytest.approx(2**0.5)
    cost = meissner_ray.cost(measured, 100, 2)
    assert cost.least_s == pytest.approx(6 + 100 * 2.375 / 2 + 1 + 10)
    assert cost.most_s == pytest.approx(cost.least_s + 2) and not cost.extrapolated
    assert cost.interval_s == pytest.approx(1.96 * 50 * 2**0.5 * (1 / 4 + 1 / 100) ** 0.5)
    assert meissner_ray.cost(measured, 100, 3).extrapolated
    # More cores than recordings do not help.
    assert meissner_ray.cost(measured, 2, 64).least_s == meissner_ray.cost(measured, 2, 2).least_s


def test_the_largest_run_counts_and_a_run_that_was_stopped_does_not():
    small, large = (1, [("a", 1, 2)]), (2, [("a", 1, 2), ("b", 1, 3), ("a", 2, 3)])
    assert meissner_ray.measured(results([small, large])).recordings == 3
    assert meissner_ray.measured(results([large, small])).recordings == 3
    stopped = results([small]).replace_schema_metadata({})
    with pytest.raises(meissner_ray.ResultsError, match="came to its end"):
        meissner_ray.measured(stopped)


def test_numbers_that_mean_nothing_are_refused():
    measured = meissner_ray.measured(results([(1, [("a", 1, 2)])]))
    for recordings, cores in ((0, 1), (1, 0)):
        with pytest.raises(ValueError, match="at least 1"):
            meissner_ray.cost(measured, recordings, cores)
