"""Data sets, evaluation and run time against error: the figures equal those of engines that the test runs itself."""

import io
import json
import os
import sys

import numpy as np
import pytest
from conftest import interrupted, make_events
from test_simulate import tensors

import meissner
from meissner import _progress

RECORDING = __file__[: __file__.index("bindings")] + "run/assets/dome_press.evt3"
SKIN = (34, 34)


def write_digit(path, events):
    """Five bytes an event: x, y, polarity and 23 bits of time."""
    t, p = events["t"].astype(np.int64), events["p"].astype(np.int64)
    rows = np.stack([events["x"], events["y"], (p << 7) | (t >> 16), (t >> 8) & 255, t & 255], axis=1)
    path.parent.mkdir(parents=True, exist_ok=True)
    path.write_bytes(rows.astype(np.uint8).tobytes())


@pytest.fixture(scope="module")
def digits(tmp_path_factory):
    folder = tmp_path_factory.mktemp("nmnist")
    for split, count in (("train", 1), ("test", 3)):
        for digit in range(10):
            for number in range(count):
                events = make_events(150, seed=100 * digit + number, sensor=SKIN, every_us=100)
                write_digit(folder / split / str(digit) / f"{number:05}.bin", events)
    (folder / "notes.txt").write_text("no recording")
    return folder


@pytest.fixture(scope="module")
def slips(tmp_path_factory):
    folder, random = tmp_path_factory.mktemp("slip"), np.random.default_rng(1)
    for name in ("n/pen1", "n/pen2", "s/pen1", "e/sponge3"):
        (folder / name).parent.mkdir(exist_ok=True)
        readings = random.integers(2000, 3600, (12, 24))
        header = ",".join(f"ff_e{e}" for e in range(1, 25))
        rows = "\n".join(",".join(map(str, row)) for row in readings)
        (folder / f"{name}.csv").write_text(f"{header}\n{rows}\n")
    return folder


@pytest.fixture(scope="module")
def presses(tmp_path_factory):
    """Two presses of a few markers, with labels along time."""
    sensor, streams = (346, 260), []
    for seed in (0, 1):
        positions = np.cumsum(np.random.default_rng(seed).uniform(-3, 3, (3, 20, 2)), axis=0) + 100
        streams.append(meissner.film_markers([0, 10_000, 20_000], positions, sensor, seed=seed))
    events = np.concatenate(streams)
    path = tmp_path_factory.mktemp("presses") / "presses.safetensors"
    arrays = {
        **{name: events[field].astype("i8") for name, field in (("t_us", "t"), ("x", "x"), ("y", "y"), ("on", "p"))},
        "start": np.cumsum([0, *map(len, streams)]),
        "truth.t_us": np.array([0, 20_000, 0, 20_000]),
        "truth.start": np.array([0, 2, 4]),
        "truth.depth": np.array([0, 1, 0, 1], "f4"),
        "truth.roll": np.array([0.1, 0.1, -0.05, -0.05], "f4"),
        "truth.pitch": np.array([0, 0, 0.1, 0.1], "f4"),
    }
    tensors(path, arrays, {"sensor": "[346, 260]"})
    return path, streams


@pytest.fixture(scope="module")
def letters(tmp_path_factory):
    """Two presses of each letter of braille, on a separate taxel; the second one is for the test."""
    count = 2 * 27
    letter, number = np.divmod(np.arange(count), 2)
    press = np.repeat(np.arange(count), 6)
    step = np.tile(np.arange(6), count)
    arrays = {
        "t_us": 1_000_000 + 50_000 * step,
        "taxel": (letter[press] + 1).astype("u1"),
        "adc": (1000 - 10 * step).astype("u2"),
        "start": 6 * np.arange(count + 1),
        "letter": letter,
        "number": number,
        "stamps_us": np.tile([1_010_000, 1_150_000, 1_200_000], (count, 1)),
        "test": number == 1,
        "place": np.stack([(np.arange(81) + 9) % 10, (np.arange(81) + 9) // 10 - 1], axis=1).astype("i2"),
        "letters": np.array(list(" ABCDEFGHIJKLMNOPQRSTUVWXYZ")),
    }
    folder = tmp_path_factory.mktemp("braille")
    np.savez_compressed(folder / "letters.npz", **arrays)
    return folder


def test_letters_are_presses_with_their_times_of_contact(letters):
    found = meissner.datasets.letters(letters)
    assert (len(found), found.sensor, found.classes[:3]) == (54, (10, 8), ["A", "B", "C"])
    assert list(found.of("test").labels) == list(range(27)) and list(found.passed_over) == []
    sample = meissner.datasets.letters(letters / "letters.npz").of("train")[3]
    assert (sample.name, sample.label, sample.split) == ("train/D/0", 3, "train")
    assert sample.more == {"contact_us": 1_010_000, "held_us": 1_150_000, "lifted_us": 1_200_000}
    # A batch ends at its arrival, so that its only reading keeps its time.
    assert sample.events["t"].tolist() == [1_000_000 + 50_000 * step for step in range(6)]
    assert set(zip(sample.events["x"].tolist(), sample.events["y"].tolist(), sample.events["p"].tolist())) == {(9, 0, 1)}
    with pytest.raises(meissner.FileError, match="none"):
        meissner.datasets.letters(letters / "none")


def test_letters_are_judged_since_contact(letters, tmp_path):
    classes = meissner.datasets.letters(letters).classes
    path = tmp_path / "own.toml"
    path.write_text(
        '[network]\nname = "own"\nspan_us = 1000000\ncapacity = 64\n[graph]\nkind = "knn"\nk = 2\ncandidates = "past"\n'
        'lifetime = "window"\nscale = 0.3\n[[layer]]\nname = "conv1"\nkind = "spline"\nchannels = 4\nkernel = 2\nroot = true\n'
        '[[layer]]\nname = "grid"\nkind = "readout"\ngrid = [5, 4]\n[[layer]]\nname = "fc"\nkind = "dense"\noutputs = 27\n'
        f"[output]\nclasses = {json.dumps(classes)}\n"
    )
    weights = tmp_path / "own.safetensors"
    meissner.Weights.draw(path, 3).save(weights, {"trained_on": "train"})
    evaluation = meissner.evaluate("letters", letters, networks=path, weights=weights, every_us=50_000)
    assert evaluation.report["since"] == "contact"
    # From contact, 10 ms after the first reading, to the last one after 240 ms.
    assert evaluation.report["times_us"] == [50_000, 100_000, 150_000, 200_000, 250_000]
    [record] = evaluation.records
    assert record["recordings"] == 27


def test_a_data_set_is_a_sequence_whose_recordings_are_read_one_by_one(digits):
    found = meissner.datasets.nmnist(digits)
    assert (len(found), found.sensor, found.classes) == (40, SKIN, [str(digit) for digit in range(10)])
    assert [path.name for path in found.passed_over] == ["notes.txt"]
    sample = found[0]
    assert (sample.name, sample.label, sample.split) == ("train/0/00000", 0, "train")
    assert sample.events.tobytes() == make_events(150, seed=0, sensor=SKIN, every_us=100).tobytes()
    tests = found.of("test")
    assert len(tests) == 30 and tests.labels.tolist() == [digit for digit in range(10) for _ in range(3)]
    assert [sample.label for sample in tests[::10]] == [0, 3, 6]
    with pytest.raises(IndexError):
        tests[30]
    # The listing reads no recording: a broken one is found when it is requested.
    (digits / "test/9/00009.bin").write_bytes(b"abc")
    try:
        with pytest.raises(meissner.RecordingError, match="00009.bin"):
            meissner.datasets.nmnist(digits)[-1]
    finally:
        (digits / "test/9/00009.bin").unlink()
    with pytest.raises(meissner.RecordingError, match="expected a folder"):
        meissner.datasets.nmnist(digits / "nothing")


def test_slips_and_presses_are_sequences_too(slips, presses):
    found = meissner.datasets.slip(slips)
    assert [sample.name for sample in found] == ["e/sponge3", "n/pen1", "n/pen2", "s/pen1"]
    assert found[1].data.shape == (12, 24) and found[1].data.dtype == np.float32
    assert (found[1].more, found.classes[found[1].label]) == ({"object": "pen"}, "n")
    path, streams = presses
    found = meissner.datasets.presses(path)
    assert len(found) == 2 and found.sensor == (346, 260)
    for sample, stream in zip(found, streams, strict=True):
        assert np.array_equal(sample.events["t"], stream["t"]) and sample.label is None
    assert found[1].more["roll"].tolist() == [np.float32(-0.05)] * 2
    assert found[1].more["t_us"].tolist() == [0, 20_000]


def test_the_accuracy_over_digits_is_that_of_an_engine(digits):
    evaluation = meissner.evaluate("digits", digits, networks="digits-past", threads=2)
    weights = meissner.Weights.shipped("digits-past")
    engine, truths, answers, logits = meissner.Engine("digits-past", SKIN), [], [], []
    for sample in meissner.datasets.nmnist(digits).of("test"):
        engine.reset()
        engine.push(sample.events[:: weights.card.stride])
        prediction = engine.predict()
        logits.append(prediction.values)
        answers.append(int(prediction.values.argmax()))
        truths.append(sample.label)
    confusion = meissner.metrics.confusion(truths, answers, 10)
    [record] = evaluation.records
    assert record["accuracy"] == meissner.metrics.scores(confusion)["accuracy"]
    hits = int(np.trace(confusion))
    assert (record["low_95"], record["high_95"]) == meissner.metrics.wilson_95(hits, 30)
    assert np.array_equal(evaluation.confusion("digits-past"), confusion)
    [found] = evaluation.logits.values()
    assert found.tobytes() == np.stack(logits).tobytes()
    assert evaluation.over_time[-1]["accuracy"] == record["accuracy"]
    assert {row["t_us"] for row in evaluation.over_time} == set(evaluation.report["times_us"])
    with pytest.raises(meissner.InputError, match="expected a network of the records"):
        evaluation.confusion("digits-frozen")


def test_the_figures_do_not_depend_on_threads_and_mode(digits):
    few = {"networks": ["digits-past"], "every_us": 20_000}
    runs = [meissner.evaluate("digits", digits, **few, **how) for how in ({"threads": 1}, {"threads": 3}, {"mode": "batch"})]
    assert runs[0].records == runs[1].records == runs[2].records
    assert runs[0].over_time == runs[1].over_time == runs[2].over_time


def test_slips_are_judged_by_set(slips):
    evaluation = meissner.evaluate("slip", slips, networks="slip-lstm")
    assert {record["of"] for record in evaluation.records} <= {"Basic", "Shape", "Texture", "Stiffness"} | set(
        found["set"] for found in evaluation.report["networks"][0]["sets"]
    )
    for record in evaluation.records:
        scores = meissner.metrics.scores(evaluation.confusion("slip-lstm", record["of"]))
        assert {key: record[key] for key in scores} == scores and record["windows"] > 0


def test_presses_have_the_errors_of_an_engine(presses):
    path, streams = presses
    evaluation = meissner.evaluate("angle", path)
    truth, found = [(0.1, 0), (-0.05, 0.1)], []
    for stream in streams:
        engine = meissner.Engine("tactigraph-past", (346, 260))
        engine.push(stream[stream["t"] <= 20_000])
        engine.advance(20_000)
        found.append(engine.predict().values[:2])
    [logits] = evaluation.logits.values()
    assert np.array_equal(logits[:, :2], np.stack(found))
    by_output = {record["output"]: record for record in evaluation.records}
    for i, name in enumerate(("roll", "pitch")):
        mae, _ = meissner.metrics.mean_absolute_error(np.degrees(np.array(found, "f8")[:, i]), np.degrees(truth)[:, i])
        assert by_output[name]["unit"] == "deg" and by_output[name]["mae"] == pytest.approx(mae, rel=1e-4)
    assert {row["output"] for row in evaluation.over_time} >= {"roll", "pitch"}


def test_run_time_against_error_has_a_record_for_each_setting_and_goes_on_from_its_state(tmp_path):
    seen, state = [], tmp_path / "state.jsonl"
    asked = {"networks": "tactigraph-past", "only": ["stride 2", "stale 5"], "timed": 300, "repeats": 1, "state": state}
    found = meissner.pareto("angle", RECORDING, **asked, progress=lambda *now: seen.append(now))
    first = found.records[0]
    assert (first["setting"], first["error"], first["speed_up"]) == ("exact", 0, 1) and first["us"] > 0
    assert len(found.records) > 1 and {"stride 2", "stale 5 ms"} < {record["setting"] for record in found.records}
    front = meissner.metrics.pareto_front([(record["us"], record["error"]) for record in found.records])
    assert sorted(front) == [i for i, record in enumerate(found.records) if record["on_front"]]
    again = meissner.pareto("angle", RECORDING, **asked)
    assert again.records == found.records
    assert all(done <= total for done, total, _ in seen)


def test_a_callback_sees_the_work_and_an_exception_of_it_stops_the_work(digits):
    seen = []
    meissner.evaluate("digits", digits, networks="digits-past", every_us=100, progress=lambda *now: seen.append(now))
    assert seen and all(total in (0, 30) and done <= 30 for done, total, _ in seen)

    def stop(done, total, name):
        raise KeyboardInterrupt

    with pytest.raises(KeyboardInterrupt):
        meissner.evaluate("digits", digits, networks="digits-past", every_us=100, progress=stop)


LONG = """
import signal
import sys

import meissner

signal.signal(signal.SIGINT, signal.default_int_handler)
print("judging", flush=True)
try:
    meissner.evaluate("digits", sys.argv[1], networks="digits-past", every_us=100, mode="batch", threads=1)
    print("done", flush=True)
except KeyboardInterrupt:
    print("interrupted", flush=True)
"""


@pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")
def test_ctrl_c_ends_an_evaluation_before_its_next_recording(digits):
    said, _ = interrupted(LONG, digits, after="judging\n", seconds=0.3)
    assert said == "interrupted\n"


@pytest.mark.parametrize("installed", [False, True], ids=["alone", "tqdm"])
def test_a_bar_is_drawn_on_a_terminal_and_nowhere_else(monkeypatch, installed):
    class Terminal(io.StringIO):
        def isatty(self):
            return True

    if installed:
        pytest.importorskip("tqdm")
    else:
        monkeypatch.setitem(sys.modules, "tqdm.auto", None)
    monkeypatch.setattr(_progress, "_PATIENCE_S", -1.0)
    for stream, draws in ((Terminal(), True), (io.StringIO(), False)):
        monkeypatch.setattr(sys, "stderr", stream)
        with _progress.ticks(None, "recordings") as tick:
            tick(0, 0, "")
            tick(15, 30, "digits-past")
        assert ("30" in stream.getvalue()) == draws


def test_faults_have_their_type_and_text(digits, slips):
    with pytest.raises(meissner.InputError, match='task: expected one of "digits", .* found "words"'):
        meissner.evaluate("words", digits)
    with pytest.raises(meissner.InputError, match="mode: expected"):
        meissner.evaluate("digits", digits, mode="fast")
    with pytest.raises(meissner.InputError, match="every_us: expected 100 us to 10 s, found 1 us"):
        meissner.evaluate("digits", digits, every_us=1)
    with pytest.raises(meissner.EvaluationError, match="slip-lstm"):
        meissner.evaluate("digits", digits, networks="slip-lstm")
    with pytest.raises(meissner.RecordingError, match="expected a folder"):
        meissner.evaluate("digits", slips, networks="digits-past")
    with pytest.raises(meissner.InputError, match="repeats"):
        meissner.pareto("angle", RECORDING, repeats=0)
    with pytest.raises(meissner.InputError, match="below 3, found 3"):
        meissner.metrics.confusion([0, 3], [0, 1], 3)


def test_metrics_are_those_of_their_definitions():
    assert meissner.metrics.confusion([0, 0, 1], [0, 1, 1], 2).tolist() == [[1, 1], [0, 1]]
    assert meissner.metrics.scores([[1, 1], [0, 1]])["f1"] == pytest.approx(2 / 3)
    assert meissner.metrics.mean_std([1, 3]) == (2, pytest.approx(np.sqrt(2)))
    assert meissner.metrics.mean_std([4]) == (4, None)
    assert meissner.metrics.mean_absolute_error([[1, 2]], [[2, 4]])[0] == 1.5
    assert meissner.metrics.iou([[True, True, False]], [[True, False, False]]) == 0.5
    assert meissner.metrics.pareto_front([(10, 0.1), (12, 0.1), (20, 0.05)]).tolist() == [0, 2]


def test_pictures_are_judged_by_the_maps_of_forces(tmp_path):
    """Two pictures of a sensor, flat and pressed: the forces are those of a frame engine on the differences."""
    random = np.random.default_rng(0)
    rest = random.integers(60, 200, (240, 320, 3))
    pressed = rest.copy()
    pressed[80:140, 120:200] += random.integers(-40, 40, (60, 80, 3))
    arrays = {
        "picture": np.stack([rest, pressed]).astype("u1"),
        "reference": rest[None].astype("u1"),
        "force": np.zeros((2, 240, 320), "f4"),
        "pixel_mm": np.array([0.06], "f4"),
        "start": np.array([0, 2], "i8"),
    }
    arrays["force"][1, 80:140, 120:200] = 4e-4
    path = tmp_path / "gel.safetensors"
    tensors(path, arrays, {"indenters": '["block"]'})
    evaluation = meissner.evaluate("area", path, networks="canf-plain")
    [maps] = evaluation.logits.values()
    engine = meissner.FrameEngine("canf-plain")
    differences = (arrays["picture"] - arrays["reference"].astype("f4")) / np.float32(255) / np.float32(0.1)
    for difference, found in zip(differences.transpose(0, 3, 1, 2), maps, strict=True):
        engine.push(np.ascontiguousarray(difference))
        assert np.allclose(np.reshape(engine.predict().values, (240, 320)) * 3.6e-4, found, atol=1e-7)
    records = {record["of"]: record for record in evaluation.records}
    assert records[None]["pictures"] == records["block"]["pictures"] == 2
    expected = []
    for found, true in zip(maps, arrays["force"], strict=True):
        touched, contact = found > 1e-4, true > 1e-4
        expected.append((touched & contact).sum() / (touched | contact).sum() if (touched | contact).any() else 1)
    assert records[None]["iou"] == pytest.approx(np.mean(expected))
    with pytest.raises(meissner.InputError):
        evaluation.confusion("canf-plain")
    found = meissner.pareto("area", path, networks="canf-plain", only="every 2nd", timed=2, repeats=1)
    settings = ["exact", "every 2nd frame", "winograd 4x4 + every 2nd frame"]
    assert [record["setting"] for record in found.records] == settings
    assert found.records[0]["error"] == pytest.approx(1 - records[None]["iou"])
    # A single press says nothing about others.
    assert found.records[0]["error_low"] is None


def test_run_time_against_error_of_the_force_is_over_recordings(tmp_path):
    """Two recordings of 30 ms without events, under a force that rises to 1 N."""
    path = tmp_path / "grasps.safetensors"
    arrays = {name: np.zeros(0, "i8") for name in ("t_us", "x", "y", "on")}
    arrays |= {"start": np.zeros(3, "i8"), "truth.start": np.array([0, 2, 4], "i8")}
    arrays |= {"truth.t_us": np.array([0, 30_000] * 2, "i8"), "truth.force": np.array([0, 1, 0, 1], "f4")}
    tensors(path, arrays, {"sensor": "[115, 115]"})
    judged = meissner.evaluate("force", path, networks=["force-graph", "force-tdnn"])
    assert [(record["network"], record["of"], record["frames"]) for record in judged.records] == [
        ("force-graph", "all", 6), ("force-tdnn", "all", 6)
    ]
    assert judged.logits["force-graph.0"].shape == (6, 1)
    found = meissner.pareto("force", path, networks=["force-graph", "force-tdnn"], only="exact", timed=1, repeats=1)
    assert found.report["unit"] == "recording" and [record["network"] for record in found.records] == ["force-graph", "force-tdnn"]
    for record, network in zip(found.records, found.report["networks"], strict=True):
        squared, absolute = network["settings"][0]["task"]
        assert (squared["kind"], absolute["kind"], squared["trials"]) == ("squared_force", "absolute_force", 6)
        assert record["error"] == squared["error"]
        # Both recordings are equal, so the mean over them is known.
        assert record["error_low"] == pytest.approx(squared["error"]) == record["error_high"]
