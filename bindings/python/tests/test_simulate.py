"""The simulator: equal arguments give equal events, the same as the program, each with its cause."""

import json
import os
import shutil
import subprocess
from pathlib import Path

import numpy as np
import pytest
from conftest import SENSOR, SMALL
from hypothesis import given, settings
from hypothesis import strategies as st

import meissner

TIMES = np.array([0, 4_000, 9_000])
NOISE_FREE = {"ideal": True, "initial_phase": False}


def tracks(seed=0, markers=5):
    """Markers that move by some pixels between the times."""
    random = np.random.default_rng(seed)
    steps = random.uniform(-4, 4, (len(TIMES), markers, 2))
    steps[0] = random.uniform([10, 10], [50, 38], (markers, 2))
    return np.cumsum(steps, axis=0).astype("f4")


@settings(deadline=None, max_examples=10)
@given(seed=st.integers(0, 2**32))
def test_equal_arguments_give_equal_events_and_another_seed_gives_others(seed):
    first, again, other = (meissner.film_markers(TIMES, tracks(), SENSOR, seed=s) for s in (seed, seed, seed + 1))
    assert first.tobytes() == again.tobytes() != other.tobytes()
    assert first.dtype == meissner.SIMULATED_DTYPE and (np.diff(first["t"]) >= 0).all()
    assert first["x"].max() < SENSOR[0] and first["y"].max() < SENSOR[1]


def test_one_pixel_that_becomes_twice_as_bright_gives_an_event_a_threshold():
    images = np.array([[[0.4]], [[0.8]]])
    events = meissner.film_images(images, [0, 10_000], **NOISE_FREE)
    # ln 2 / 0.2 is 3.47, and the logarithm rises linearly.
    assert events["t"].tolist() == [int(np.ceil(10_000 * k * 0.2 / np.log(2))) for k in (1, 2, 3)]
    assert events["p"].all() and (events["cause"] == meissner.CAUSES.index("signal")).all()
    assert len(meissner.film_images(images, [0, 10_000], threshold_on=0.1, **NOISE_FREE)) == 6


def test_a_still_scene_has_noise_alone_and_an_ideal_camera_nothing():
    still = np.full((2, 48, 64), 0.01)
    quiet = {"shot_hz": 0, "hot_share": 0, "initial_phase": False}
    leaks = meissner.film_images(still, [0, 30_000_000], **quiet)
    assert (leaks["cause"] == meissner.CAUSES.index("leak")).mean() > 0.9 and leaks["p"].all()
    shots = meissner.film_images(still, [0, 1_000_000], lux=10)
    assert (shots["cause"] == meissner.CAUSES.index("shot noise")).mean() > 0.9
    assert len(meissner.film_images(still, [0, 1_000_000], ideal=True)) == 0
    assert meissner.CAUSES == ("signal", "leak", "shot noise", "hot pixel")


def test_a_camera_gives_the_events_of_a_film_and_an_engine_takes_them():
    random = np.random.default_rng(3)
    images, times = random.uniform(0.1, 1, (6, *SENSOR[::-1])), np.arange(6) * 2_000
    camera = meissner.Camera(SENSOR, seed=7)
    parts = [camera.push(t, image) for t, image in zip(times, images, strict=True)] + [camera.finish()]
    film = meissner.film_images(images, times, seed=7)
    assert np.concatenate(parts).tobytes() == film.tobytes() and len(film) > 1000
    engine = meissner.Engine(SMALL, SENSOR, meissner.Weights.draw(SMALL, 1))
    assert engine.push(film) == len(film)


def test_a_press_moves_its_markers_outwards_and_its_camera_sees_them():
    press = meissner.Press(tilt=0.1, azimuth=0.7)
    rest, seen = press.markers, press.positions((346, 260))
    assert rest.shape == (169, 3) and seen.shape == (169, 2)
    assert np.allclose(seen[0], [172.5, 129.5]) and press.force_n == 0
    press.press_to(3.0)
    assert press.depth_mm == 3.0 and 0 < press.force_n < 50
    assert press.markers[0, 2] < rest[0, 2]
    moved = press.positions((346, 260))
    events = meissner.film_markers([0, 30_000], np.stack([seen, moved]), (346, 260), ideal=True)
    assert len(events) > 500
    assert repr(press).startswith("<Press: 169 markers, 3.00 mm deep, ")


def test_faults_have_their_type_and_text():
    with pytest.raises(meissner.InputError, match=r"expected shape \(times, markers, 2\), found \[3, 5\]"):
        meissner.film_markers(TIMES, np.zeros((3, 5)), SENSOR)
    with pytest.raises(meissner.InputError, match="expected 3 times, as many as positions, found 2"):
        meissner.film_markers(TIMES[:2], tracks(), SENSOR)
    with pytest.raises(meissner.InputError, match="times must ascend"):
        meissner.film_markers(TIMES[::-1], tracks(), SENSOR)
    with pytest.raises(TypeError, match="expected a setting of the camera, found speed"):
        meissner.Camera(SENSOR, speed=3)
    with pytest.raises(meissner.InputError, match="lux is -1, expected a finite number above 0"):
        meissner.Camera(SENSOR, lux=-1)
    with pytest.raises(meissner.InputError, match=r"image: expected shape \[48, 64\], found \[64, 48\]"):
        meissner.Camera(SENSOR).push(0, np.ones(SENSOR))
    with pytest.raises(meissner.DtypeError, match="image: expected numbers"):
        meissner.Camera(SENSOR).push(0, np.full(SENSOR[::-1], "a"))
    with pytest.raises(meissner.InputError, match="depth_mm: expected 0 to 20 mm, found 21"):
        meissner.Press().press_to(21)
    with pytest.raises(meissner.InputError, match="rings_mm"):
        meissner.Press(rings_mm=50)


def program():
    """The program, if it was built, or the one that MEISSNER names."""
    built = [Path(__file__).parents[3] / "target" / profile / "meissner" for profile in ("release", "debug")]
    found = [os.environ.get("MEISSNER"), *(path for path in built if path.exists()), shutil.which("meissner")]
    return next((str(path) for path in found if path), None)


def tensors(path, arrays, metadata=None):
    """Writes a safetensors file."""
    header, at = {"__metadata__": metadata} if metadata else {}, 0
    for name, array in arrays.items():
        kind = {"i": "I64", "f": "F32", "u": "U8"}[array.dtype.kind]
        header[name] = {"dtype": kind, "shape": array.shape, "data_offsets": [at, at + array.nbytes]}
        at += array.nbytes
    text = json.dumps(header).encode()
    path.write_bytes(len(text).to_bytes(8, "little") + text + b"".join(array.tobytes() for array in arrays.values()))


@pytest.mark.skipif(program() is None, reason="the program is not built")
def test_the_events_are_those_of_the_program(tmp_path):
    positions = tracks()
    arrays = {"t_us": TIMES, "start": np.array([0, len(TIMES)]), "position": positions}
    tensors(tmp_path / "tracks.safetensors", arrays)
    out = tmp_path / "events.safetensors"
    command = [program(), "simulate", "markers", tmp_path / "tracks.safetensors", "--sensor", "64x48", "--seed", "11", "--out", out]
    subprocess.run(command, check=True, capture_output=True)
    whole = out.read_bytes()
    length = int.from_bytes(whole[:8], "little")
    header, body = json.loads(whole[8 : 8 + length]), whole[8 + length :]
    expected = {name: np.frombuffer(body[slice(*header[name]["data_offsets"])], "<i8") for name in ("t_us", "x", "y", "on", "cause")}
    events = meissner.film_markers(TIMES, positions, SENSOR, seed=11)
    assert len(events) == len(expected["t_us"]) > 0
    for field, name in [("t", "t_us"), ("x", "x"), ("y", "y"), ("p", "on"), ("cause", "cause")]:
        assert np.array_equal(events[field], expected[name]), field
