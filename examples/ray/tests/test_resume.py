"""A stopped run continues, and computes nothing twice. Results of other settings are refused."""

import json

import meissner
import pytest
from conftest import determined, write_digit, write_digits

import meissner_ray
from meissner_ray.store import locked

ASKED = {"networks": "digits-past"}


def started(results):
    """The time when each recording was begun."""
    return dict(zip(results["recording"].to_pylist(), results["started_s"].to_pylist(), strict=True))


class StopError(Exception):
    """Ends a run from outside."""


def stop_after(count):
    def progress(done, total, name):
        if done == count:
            raise StopError

    return progress


def test_a_stopped_run_goes_on_and_computes_nothing_twice(cluster, digits, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(StopError):
        meissner_ray.evaluate("digits", digits, out, **ASKED, progress=stop_after(4))
    assert not (out / "results.parquet").exists()
    first = {path.name for path in (out / "rows").glob("*.parquet")}
    # Tasks that were queued may have ended, too.
    assert 4 <= len(first) < 20
    seen = []
    results = meissner_ray.evaluate("digits", digits, out, **ASKED, progress=lambda *now: seen.append(now))
    assert len({row["run"] for row in results.to_pylist()}) == 2 and results.num_rows == 20
    # Recordings that were finished are counted, and not computed.
    assert seen[0][0] > 4 and seen[-1][:2] == (20, 20) and len(seen) == 21 - seen[0][0]
    whole = meissner_ray.evaluate("digits", digits, tmp_path / "whole", **ASKED)
    assert determined(results) == determined(whole)


def test_a_run_of_finished_recordings_starts_nothing(digits, cluster, tmp_path):
    first = meissner_ray.evaluate("digits", digits, tmp_path / "out", **ASKED)
    seen = []
    again = meissner_ray.evaluate("digits", digits, tmp_path / "out", **ASKED, progress=lambda *now: seen.append(now))
    assert again.equals(first) and started(again) == started(first) and seen == []
    assert {path.name for path in (tmp_path / "out").iterdir()} == {"results.parquet", "settings.json", ".lock"}


def test_new_and_changed_recordings_are_computed_and_no_others(cluster, tmp_path):
    data, out = write_digits(tmp_path / "data"), tmp_path / "out"
    before = started(meissner_ray.evaluate("digits", data, out, **ASKED))
    write_digit(data / "test/3/00001.bin", seed=77)
    write_digit(data / "test/4/00000.bin", seed=78, count=120)
    (data / "test/5/00000.bin").unlink()
    after = started(meissner_ray.evaluate("digits", data, out, **ASKED))
    computed = {name for name, at in after.items() if before.get(name) != at}
    assert computed == {str(data / "test/3/00001.bin"), str(data / "test/4/00000.bin")}
    # Computed results stay, although their recording no longer exists.
    assert str(data / "test/5/00000.bin") in after and len(after) == 11


def test_a_recording_that_failed_is_tried_again(cluster, tmp_path):
    data, out = write_digits(tmp_path / "data"), tmp_path / "out"
    broken = data / "test/2/00000.bin"
    whole = broken.read_bytes()
    broken.write_bytes(whole[:-2])
    first = meissner_ray.evaluate("digits", data, out, **ASKED)
    assert first["failure"].null_count == 9
    broken.write_bytes(whole)
    second = meissner_ray.evaluate("digits", data, out, **ASKED)
    assert second["failure"].null_count == 10
    assert {name for name, at in started(second).items() if started(first)[name] != at} == {str(broken)}


def test_rows_that_cannot_be_read_are_computed_again(cluster, digits, tmp_path):
    out = tmp_path / "out"
    with pytest.raises(StopError):
        meissner_ray.evaluate("digits", digits, out, **ASKED, progress=stop_after(2))
    next((out / "rows").glob("*.parquet")).write_bytes(b"PAR1 and nothing more")
    (out / "rows/.half.parquet.1").write_bytes(b"a file whose writer was killed")
    assert meissner_ray.evaluate("digits", digits, out, **ASKED).num_rows == 20
    assert not (out / "rows").exists()


def test_other_settings_are_refused_and_change_nothing(cluster, digits, tmp_path):
    out = tmp_path / "out"
    meissner_ray.evaluate("digits", digits, out, **ASKED)
    before = (out / "results.parquet").read_bytes()
    for other in (
        {"every_us": 20_000},
        {"stride": 3},
        {"networks": "digits-frozen"},
        {"networks": ["digits-past", "digits-all"]},
    ):
        with pytest.raises(meissner_ray.SettingsError, match=f"other settings.*{next(iter(other))}: expected"):
            meissner_ray.evaluate("digits", digits, out, **ASKED | other)
    with pytest.raises(meissner_ray.SettingsError, match="command: expected eval, found pareto"):
        meissner_ray.pareto("digits", digits, out, networks="digits-past")
    assert (out / "results.parquet").read_bytes() == before
    # Results of another version are not mixed with those of this one.
    settings = json.loads((out / "settings.json").read_text())
    (out / "settings.json").write_text(json.dumps(settings | {"meissner": "0.0.1"}))
    with pytest.raises(meissner_ray.SettingsError, match=r"meissner: expected 0\.0\.1, found"):
        meissner_ray.evaluate("digits", digits, out, **ASKED)


def test_weights_that_changed_under_their_name_are_refused(cluster, digits, tmp_path):
    path, out = tmp_path / "weights.safetensors", tmp_path / "out"
    shipped = meissner.Weights.shipped("digits-past")
    shipped.save(path, shipped.metadata | {"seed": "5"})
    results = meissner_ray.evaluate("digits", digits, out, **ASKED, weights=path)
    assert set(results["seed"].to_pylist()) == {5} and set(results["files"].to_pylist()) == {str(path)}
    drawn = meissner.Weights.draw("digits-past", seed=1)
    drawn.save(path, shipped.metadata | {"seed": "5"})
    with pytest.raises(meissner_ray.SettingsError, match=r"other settings.*networks: expected"):
        meissner_ray.evaluate("digits", digits, out, **ASKED, weights=path)


def test_trainings_have_a_row_each_and_folds_are_refused(cluster, digits, tmp_path):
    folder, shipped = tmp_path / "trainings", meissner.Weights.shipped("digits-past")
    folder.mkdir()
    for seed in ("0", "1"):
        tensors = shipped if seed == "0" else meissner.Weights.draw("digits-past", seed=1)
        about = shipped.metadata | {"network": "digits-past", "seed": seed, "trained_on": "train"}
        tensors.save(folder / f"{seed}.safetensors", about)
    data = [digits / "test/3/00000.bin"]
    rows = meissner_ray.evaluate("digits", data, tmp_path / "out", **ASKED, trainings=folder).to_pylist()
    assert [row["seed"] for row in rows] == [0, 1] and len({row["weights"] for row in rows}) == 2
    assert [row["files"] for row in rows] == [str(folder / f"{seed}.safetensors") for seed in "01"]
    shipped.save(folder / "2.safetensors", shipped.metadata | {"network": "digits-past", "seed": "2", "held_out": "[]"})
    with pytest.raises(meissner_ray.SettingsError, match="expected a whole training"):
        meissner_ray.evaluate("digits", data, tmp_path / "other", **ASKED, trainings=folder)


def test_two_runs_do_not_write_to_one_folder(digits, tmp_path):
    with locked(tmp_path / "out"), pytest.raises(meissner_ray.ResultsError, match="no run writes to"):
        meissner_ray.evaluate("digits", digits, tmp_path / "out", **ASKED)
