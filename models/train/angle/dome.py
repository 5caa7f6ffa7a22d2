"""Simulates presses of the dome, with the lamp on and off, and divides them into parts.

    python models/train/angle/dome.py FOLDER

Writes CAMERA/PART.safetensors. The cameras `on` and `off`, by their lamp, begin with the press. The cameras `on-used` and `off-used` have
seen another press of the part and its release before, in half of the cases with the same tilt and direction. Their pixels wait for a
change in the direction of the last one, and send a sixth fewer events. They film the last 150 ms of the pause before the press, the press,
and a hold after it. The parts are

    train, valid   the published plan of 12 presses for each tilt and direction, 10 to learn from and 2 to choose by, without the
                   directions UNSEEN
    test           4 other presses for each tilt and direction
    unseen         those of `test` in the directions UNSEEN
    jitter         those of `test`, every event moved by up to a pixel along each axis

The cameras `on-planes` and `off-planes` film other presses to learn from: on planes of any tilt up to 9 degrees and any direction that is no
nearer to one of UNSEEN than to others of the plan. The dome looks the same after a turn by 60 degrees, so that each computed plane gives
six.

Used cameras film the first three parts. With `--cameras N`, further cameras of each kind, CAMERA-2 to CAMERA-N, film `train`. All files
are as `meissner simulate markers` writes them: events, and roll, pitch, depth and force along time.
"""

import argparse
import json
import sys
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save_file

# The code that all trainings share is beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
from shared import meissner

SENSOR = 346, 260
DIRECTIONS, EACH = 20, 16  # presses of each of 10 tilts and 20 directions
PARTS = {"train": range(10), "valid": range(10, 12), "test": range(12, 16), "unseen": range(12, 16)}
# Planes at random that are computed for `planes`, and presses of each.
PLANES, EACH_PLANE = 150, 16
# 72, 108, 252 and 288 degrees: mirror images of each other, so that mirrored presses do not show them either.
UNSEEN = 4, 6, 14, 16
# The settings that were chosen to agree with a real stream (docs/simulated-touch.md).
CAMERA = "--marker 0.5 --ground 0.25 --threshold-on 0.2 --threshold-off 0.35 --threshold-spread 0.03 --leak-hz 0.003".split()
# With the lamp off, a tenth of the light is left: pixels are ten times slower, and shot noise is 12 % of the events.
LAMPS = {"on": 300, "off": 30}
# For a used camera, in microseconds: the pauses before a press, the last part of which is filmed, and holds after it.
PAUSES, FILMED, HOLDS = (150_000, 300_000), 150_000, (1, 40_000)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--cameras", type=int, default=1, help="cameras of each kind that film the presses for training")
    args = parser.parse_args()
    args.folder.mkdir(parents=True, exist_ok=True)
    tracks = args.folder / "tracks.safetensors"
    if not tracks.exists():
        meissner("simulate", "dome", "--each", EACH, "--seed", 1, "--out", tracks)
    film_planes(args.folder)
    for camera in range(args.cameras):
        for part in PARTS if camera == 0 else ["train"]:
            film_part(args.folder, load_file(tracks), part, camera)
    for lamp in LAMPS:
        moved = args.folder / lamp / "jitter.safetensors"
        if not moved.exists():
            save(jittered(load_file(args.folder / lamp / "test.safetensors")), moved)


def film_part(data, tracks, part, camera):
    """Films the presses of a part by the cameras of each kind with the number `camera`, which counts from 0."""
    number, presses = list(PARTS).index(part), chosen(tracks, part)
    seen = {"": presses}
    if part != "unseen":
        seen["-used"] = after_others(presses, len(PARTS[part]), np.random.default_rng(number + 10 * camera))
    for lamp, name in enumerate(LAMPS):
        for first, (kind, shown) in zip((1, 11), seen.items()):
            folder = f"{name}{kind}-{camera + 1}" if camera else f"{name}{kind}"
            # Only the first cameras have the same seed with the lamp on and off.
            seed = 100_000 * (number + first + 20 * camera) + 10_000 * camera * lamp
            film(shown, name, data / folder / f"{part}.safetensors", seed)


def film_planes(data):
    """Films presses on planes at random, each press turned by a multiple of 60 degrees."""
    path = data / "planes.safetensors"
    if not path.exists():
        meissner("simulate", "dome", "--planes", PLANES, "--each", EACH_PLANE, "--seed", 2, "--out", path)
    tracks, random = load_file(path), np.random.default_rng(2)
    start = tracks["start"]
    tilts = tracks["pitch"] - 1j * tracks["roll"]  # tilt, in the direction of the lean
    places = tracks["position"] - (np.array(SENSOR, np.float32) - 1) / 2
    places = places[..., 0] + 1j * places[..., 1]
    for first, end in zip(start[:-1], start[1:]):
        turns = np.exp(1j * np.pi / 3 * random.permutation(6))
        near = np.angle(tilts[first] * turns) % (2 * np.pi) * DIRECTIONS / (2 * np.pi)
        turn = turns[~np.isin(np.round(near) % DIRECTIONS, UNSEEN)][0]
        tilts[first:end] *= turn
        places[first:end] *= turn
    tracks["roll"], tracks["pitch"] = -tilts.imag.astype(np.float32), tilts.real.astype(np.float32)
    tracks["position"] = (np.stack([places.real, places.imag], -1) + (np.array(SENSOR) - 1) / 2).astype(np.float32)
    for lamp in LAMPS:
        film(tracks, lamp, data / f"{lamp}-planes" / "train.safetensors", 90_000_000)


def film(tracks, lamp, out, seed):
    """Writes the film of `tracks` from their time 0 on, unless `out` exists."""
    if out.exists():
        return
    out.parent.mkdir(exist_ok=True)
    # The file is written completely or not at all, because an existing file is not filmed again.
    own, filmed = out.with_suffix(".tracks"), out.with_suffix(".filmed.safetensors")
    begin = tracks["t_us"][tracks["start"][:-1]]
    save(tracks | {"t_us": tracks["t_us"] - np.repeat(begin, np.diff(tracks["start"]))}, own)
    sensor, lux = "{}x{}".format(*SENSOR), LAMPS[lamp]
    meissner("simulate", "markers", own, "--sensor", sensor, "--lux", lux, *CAMERA, "--seed", seed, "--out", filmed)
    own.unlink()
    if begin.any():
        tensors = load_file(filmed)
        events = {name: tensors.pop(name) for name in ("t_us", "x", "y", "on", "cause", "start")}
        labels = {name.removeprefix("truth."): tensor for name, tensor in tensors.items()}
        truth = {f"truth.{name}": tensor for name, tensor in from_zero(labels, begin).items()}
        save(from_zero(events, begin) | truth, filmed)
    filmed.rename(out)


def from_zero(tensors, begin):
    """The entries at time 0 or later, if the streams begin at the times `begin`."""
    start = tensors.pop("start")
    t_us = tensors["t_us"] + np.repeat(begin, np.diff(start))
    later = t_us >= 0
    bounds = np.concatenate([[0], np.cumsum(later)])[start]
    return {name: tensor[later] for name, tensor in (tensors | {"t_us": t_us}).items()} | {"start": bounds}


def after_others(tracks, each, random):
    """Each press after the release of another and a pause, and held. The filmed part of the pause begins at time 0. Half of the other
    presses have the same tilt and direction (`each` presses of a kind), because consecutive touches are often alike."""
    start, presses = tracks["start"], []
    for press, (first, end) in enumerate(zip(start[:-1], start[1:])):
        alike = press - press % each + random.integers(each)
        other = alike if random.random() < 0.5 else random.integers(len(start) - 1)
        back = np.arange(*start[[other, other + 1]])[::-1]
        released = tracks["t_us"][back[0]] - tracks["t_us"][back]
        pause, hold = random.integers(*PAUSES), random.integers(*HOLDS)
        times = np.arange(first, end)
        t_us = [released - released[-1] - pause, tracks["t_us"][times], tracks["t_us"][times[-1:]] + hold]
        presses.append((np.concatenate(t_us) + FILMED, np.concatenate([back, times, times[-1:]])))
    places = np.concatenate([place for _, place in presses])
    continued = {name: tensor[places] for name, tensor in tracks.items() if name not in ("start", "t_us")}
    bounds = np.cumsum([0] + [len(place) for _, place in presses])
    return continued | {"t_us": np.concatenate([t_us for t_us, _ in presses]), "start": bounds}


def jittered(tensors):
    """The presses with every event moved by -1, 0 or 1 pixel along each axis, to the edge of the sensor at most."""
    random = np.random.default_rng(0)
    for name, side in zip("xy", SENSOR):
        tensors[name] = np.clip(tensors[name] + random.integers(-1, 2, len(tensors[name])), 0, side - 1)
    return tensors


def chosen(tracks, part):
    """The tracks of the presses of a part."""
    start = tracks.pop("start")
    unseen = [press // EACH % DIRECTIONS in UNSEEN for press in range(len(start) - 1)]
    presses = [press for press in range(len(start) - 1) if press % EACH in PARTS[part]]
    presses = [press for press in presses if part == "test" or unseen[press] == (part == "unseen")]
    times = np.concatenate([np.arange(*start[[press, press + 1]]) for press in presses])
    bounds = np.cumsum([0] + [start[press + 1] - start[press] for press in presses])
    return {name: np.ascontiguousarray(tensor[times]) for name, tensor in tracks.items()} | {"start": bounds}


def save(tensors, path):
    save_file(tensors, path, {"sensor": json.dumps(SENSOR)})


if __name__ == "__main__":
    main()
