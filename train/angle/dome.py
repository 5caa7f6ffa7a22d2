"""Simulates presses of the dome, with the lamp on and off, and divides them.

    python train/angle/dome.py FOLDER

Writes LAMP/PART.safetensors for the lamps `on` and `off` and the parts

    train, valid   the published plan of 12 presses for each tilt and direction, 10 to learn from and 2 to choose by, without the
                   directions UNSEEN
    test           4 other presses for each tilt and direction
    unseen         those of `test` in the directions UNSEEN
    jitter         those of `test`, every event moved by up to a pixel along each axis

all as `meissner simulate markers` writes them: events, and roll, pitch, depth and force along time.
"""

import argparse
import json
import subprocess
from pathlib import Path

import numpy as np
from safetensors.numpy import load_file, save_file

SENSOR = 346, 260
TILTS, DIRECTIONS, EACH = 10, 20, 16
PARTS = {"train": range(10), "valid": range(10, 12), "test": range(12, 16), "unseen": range(12, 16)}
# 72, 108, 252 and 288 degrees: mirror images of each other, so that mirrored presses do not show them either.
UNSEEN = 4, 6, 14, 16
# The settings that were chosen to agree with a real stream (docs/simulated-touch.md).
CAMERA = "--marker 0.5 --ground 0.25 --threshold-on 0.2 --threshold-off 0.35 --threshold-spread 0.03 --leak-hz 0.003".split()
# Off, a tenth of the light is left: pixels are ten times slower, and shot noise is 12 % of the events.
LAMPS = {"on": 300, "off": 30}


def main():
    args = arguments()
    args.folder.mkdir(parents=True, exist_ok=True)
    tracks = args.folder / "tracks.safetensors"
    if not tracks.exists():
        meissner(args, "simulate", "dome", "--presses", EACH, "--seed", 1, "--out", tracks)
    for number, part in enumerate(PARTS):
        own = args.folder / f"tracks.{part}.safetensors"
        save_file(chosen(load_file(tracks), part), own, {"sensor": json.dumps(SENSOR)})
    for lamp, lux in LAMPS.items():
        for number, part in enumerate(PARTS):
            own, out = args.folder / f"tracks.{part}.safetensors", args.folder / lamp / f"{part}.safetensors"
            if not out.exists():
                out.parent.mkdir(exist_ok=True)
                seed = ["--seed", 100_000 * (number + 1)]
                meissner(args, "simulate", "markers", own, "--sensor", "{}x{}".format(*SENSOR), "--lux", lux, *CAMERA, *seed, "--out", out)
        moved = args.folder / lamp / "jitter.safetensors"
        if not moved.exists():
            save_file(jittered(load_file(args.folder / lamp / "test.safetensors")), moved, {"sensor": json.dumps(SENSOR)})


def jittered(tensors):
    """The presses with every event moved by -1, 0 or 1 pixel along each axis, to the edge of the sensor at most."""
    random = np.random.default_rng(0)
    for name, side in zip("xy", SENSOR):
        tensors[name] = np.clip(tensors[name] + random.integers(-1, 2, len(tensors[name])), 0, side - 1)
    return tensors


def chosen(tracks, part):
    """The tracks of the presses of a part."""
    start = tracks.pop("start")
    presses = []
    for press in range(len(start) - 1):
        kind, sample = divmod(press, EACH)
        unseen = kind % DIRECTIONS in UNSEEN
        if sample in PARTS[part] and (part == "test" or unseen == (part == "unseen")):
            presses.append(press)
    times = np.concatenate([np.arange(*start[[press, press + 1]]) for press in presses])
    bounds = np.cumsum([0] + [start[press + 1] - start[press] for press in presses])
    return {name: np.ascontiguousarray(tensor[times]) for name, tensor in tracks.items()} | {"start": bounds}


def meissner(args, *words):
    subprocess.run([str(word) for word in (args.meissner, *words)], check=True)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    return parser.parse_args()


if __name__ == "__main__":
    main()
