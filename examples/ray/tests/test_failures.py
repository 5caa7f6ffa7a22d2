"""A recording that cannot be judged costs a row. Settings that cannot run at all are reported before anything starts."""

import shutil
import zipfile

import meissner
import pytest
from conftest import write_digit, write_digits, write_press, write_skin

import meissner_ray
from meissner_ray.cli import main


def test_broken_recordings_cost_a_row_each(cluster, tmp_path):
    data = write_digits(tmp_path / "data")
    broken = {"cut": data / "test/1/cut.bin", "empty": data / "test/2/empty.bin", "missing": data / "test/3/missing.bin"}
    broken["cut"].write_bytes(b"abc")
    broken["empty"].write_bytes(b"")
    results = meissner_ray.evaluate("digits", [data, broken["missing"]], tmp_path / "out", networks="digits-past")
    failed = {row["recording"]: row["failure"] for row in results.to_pylist() if row["failure"] is not None}
    assert results.num_rows == 13 and failed.keys() == {str(path) for path in broken.values()}
    for path in broken.values():
        # The message has the recording's own path, not the path of its staged copy.
        assert failed[str(path)].startswith(("RecordingError: ", "EvaluationError: "))
        assert "meissner-recording-" not in failed[str(path)]
    assert str(broken["cut"]) in failed[str(broken["cut"])]
    [total] = meissner_ray.summary(results)
    assert total["recordings"] == 10


def test_broken_files_of_presses_and_archives_cost_a_row(cluster, tmp_path):
    write_press(tmp_path / "data/good.safetensors", 1)
    (tmp_path / "data/noise.safetensors").write_bytes(bytes(range(256)))
    results = meissner_ray.evaluate("angle", tmp_path / "data", tmp_path / "out", networks="tactigraph-past")
    rows = results.to_pylist()
    assert [row["failure"] is None for row in rows] == [True] * (len(rows) - 1) + [False] and len(rows) > 1
    folder = tmp_path / "skin"
    folder.mkdir()
    write_skin(folder, "Ev-Objects.zip", 250)
    with zipfile.ZipFile(folder / "Ev-Objects.zip", "a") as archive:
        archive.writestr("test/sample_4_label_2.npy", b"no array")
    results = meissner_ray.evaluate("objects", folder, tmp_path / "grasps", networks="touch-objects")
    assert results["failure"].null_count == 3 and results.num_rows == 4
    (folder / "Ev-Objects.zip").write_bytes(b"no archive")
    [row] = meissner_ray.evaluate("objects", folder, tmp_path / "none", networks="touch-objects").to_pylist()
    assert row["failure"].startswith("BadZipFile")


def test_recordings_of_one_name_in_different_folders_are_different(cluster, tmp_path):
    data = [write_digits(tmp_path / name) for name in ("monday", "tuesday")]
    write_digit(data[1] / "test/0/00000.bin", seed=99)
    results = meissner_ray.evaluate("digits", data, tmp_path / "out", networks="digits-past")
    by_name = {row["recording"]: row["outputs_sha256"] for row in results.to_pylist()}
    assert len(by_name) == 20
    of = [{name[len(str(folder)) :]: by_name[name] for name in by_name if name.startswith(str(folder))} for folder in data]
    assert {name for name in of[0] if of[0][name] != of[1][name]} == {"/test/0/00000.bin"}


def test_a_recording_that_is_named_twice_is_judged_once(tmp_path):
    data = write_digits(tmp_path / "data")
    file = data / "test/3/00000.bin"
    assert len(meissner_ray.find("eval", "digits", [data, file, f"{data}/test/../test/3/00000.bin"])) == 10
    shutil.copytree(data / "test/3", data / "test/.hidden")
    assert len(meissner_ray.find("eval", "digits", data)) == 10


@pytest.mark.parametrize("task", ["digits", "objects", "slip", "angle", "area"])
def test_an_empty_folder_is_refused(tmp_path, task):
    with pytest.raises(meissner_ray.NoRecordingsError, match="found none"):
        meissner_ray.evaluate(task, tmp_path, tmp_path / "out", networks="digits-past")
    assert not (tmp_path / "out").exists()


def test_recordings_that_networks_were_trained_on_are_refused(tmp_path):
    data = write_digits(tmp_path / "data")
    with pytest.raises(meissner_ray.NoRecordingsError, match="expected a recording test/"):
        meissner_ray.evaluate("digits", data / "train/3/00000.bin", tmp_path / "out", networks="digits-past")


def test_settings_that_fit_no_recording_are_refused_before_ray_starts(digits, tmp_path):
    import ray

    running = ray.is_initialized()
    for error, task, asked in (
        (meissner.EvaluationError, "digits", {"networks": "slip-lstm"}),
        (meissner.Error, "digits", {"networks": "digits-pasta"}),
        (meissner.InputError, "digits", {"networks": "digits-past", "every_us": 1}),
        (meissner_ray.SettingsError, "digits", {"networks": []}),
        (meissner_ray.SettingsError, "letters", {"networks": "digits-past"}),
    ):
        with pytest.raises(error):
            meissner_ray.evaluate(task, digits, tmp_path / "out", **asked)
    with pytest.raises(meissner.InputError, match="repeats"):
        meissner_ray.pareto("digits", digits, tmp_path / "out", networks="digits-past", repeats=0)
    with pytest.raises(meissner_ray.NoRecordingsError):
        meissner_ray.evaluate("digits", [], tmp_path / "out", networks="digits-past")
    assert ray.is_initialized() == running and not (tmp_path / "out").exists()


def test_the_number_of_workers_is_that_of_a_ray_that_runs(cluster, digits, tmp_path):
    with pytest.raises(meissner_ray.SettingsError, match="workers: expected None"):
        meissner_ray.evaluate("digits", digits, tmp_path / "out", networks="digits-past", workers=1)


def test_the_program_says_what_failed_in_its_exit_status(cluster, tmp_path, capsys):
    data = write_digits(tmp_path / "data")
    names = tmp_path / "names.txt"
    names.write_text("\n".join(str(path) for path in sorted(data.glob("test/*/*.bin"))))
    asked = ["--networks", "digits-past", "--out", str(tmp_path / "out")]
    assert main(["eval", "digits", f"@{names}", *asked]) == 0
    assert "recordings 10" in capsys.readouterr().out
    (data / "test/1/cut.bin").write_bytes(b"abc")
    assert main(["eval", "digits", str(data), *asked]) == 1
    assert "cut.bin" in capsys.readouterr().err
    assert main(["eval", "digits", str(tmp_path / "nothing-here-is-a/test"), *asked]) == 2
    assert main(["eval", "digits", str(data), *asked, "--every-us", "20000"]) == 2
    assert "results of other settings" in capsys.readouterr().err
    assert main(["summary", str(tmp_path / "out"), "--json"]) == 0
    assert '"recordings": 10' in capsys.readouterr().out
    assert main(["cost", str(tmp_path / "out"), "--cores", "1", "4"]) == 0
    assert "arithmetic, not a measurement" in capsys.readouterr().out
    assert main(["cost", str(tmp_path / "empty")]) == 2
