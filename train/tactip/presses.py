"""Presses of a TacTip as events with labels: real mechanics, real labels, a simulated camera.

    python train/tactip/presses.py DATA FOLDER

DATA has tap_train.npz and tap_test.npz. Each real image becomes a press: every pin moves from rest, along the field that was fitted to
the training images, to where the image has it. The camera of `meissner simulate markers` sees the pins move. Writes

    FILM/train.safetensors   all training images but the last 500, once for each of the cameras FILM = 0, 1, ...
    0/valid.safetensors      these 500, to choose by
    0/test.safetensors       the test images

with the events of all presses as `prepare graphs` reads them, and along the time of each press `truth.depth` in mm, and `truth.tilt_x`
and `truth.tilt_y` in degrees, as the robot had them. The tilts are constant. After a rest of 10 to 60 ms, depth rises from 0 to that of
the pose within 100 to 200 ms, as 3 t^2 - 2 t^3; then the press is held for 20 ms.
"""

import argparse
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pins
from safetensors.numpy import save_file

# The rest differs, so that a press begins anywhere within a cell in time.
REST_US, HOLD_US = (10_000, 60_000), 20_000
DURATION_US = 100_000, 200_000
STEPS = 12  # of the motion; markers move along straight lines between them
VALID = 500
# Grey pins on dark ground, and thresholds that give some thousand events a press, as the real stream of a tactile sensor with
# markers has (docs/simulated-touch.md).
SCENE = ["--radius", "1.5", "--marker", "0.5", "--ground", "0.2", "--threshold-on", "0.3", "--threshold-off", "0.3"]


def risen(share):
    """Depth at a share of the duration, as a share of its end."""
    return share * share * (3 - 2 * share)


def tracks(field, pose, seen, random):
    """The tracks of presses as `meissner simulate markers` reads them, with the labels along time."""
    rest, duration = (random.integers(*limits, len(pose), endpoint=True) for limits in (REST_US, DURATION_US))
    shares = np.linspace(0, 1, STEPS + 1)
    times = rest[:, None] + np.rint(shares * duration[:, None]).astype(np.int64)
    times = np.column_stack([np.zeros_like(rest), times, times[:, -1] + HOLD_US])
    # Whatever the field misses of a real image grows with the depth. A pin that was not seen ends where the field says.
    residual = np.nan_to_num(seen - field(pose))
    positions, depths = [], []
    for rise in risen(shares):
        depths.append(rise * pose[:, 0])
        positions.append(field(np.column_stack([depths[-1], pose[:, 1:]])) + rise * residual)
    held = [np.stack([values[0], *values, values[-1]], 1).astype(np.float32) for values in (positions, depths)]
    tilts = {name: np.repeat(pose[:, i].astype(np.float32), times.shape[1]) for i, name in ((1, "tilt_x"), (2, "tilt_y"))}
    start = np.arange(len(pose) + 1) * times.shape[1]
    flat = held[0].reshape(-1, *held[0].shape[2:])
    return {"t_us": times.ravel(), "start": start, "position": flat, "depth": held[1].ravel(), **tilts}


def film(args, number, part, seed, tracks):
    """Films `tracks` with the camera `number`."""
    out = args.folder / str(number) / f"{part}.safetensors"
    out.parent.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tracks.safetensors"
        save_file(tracks, path)
        sensor = ["--sensor", f"{pins.SIDE}x{pins.SIDE}", "--seed", seed]
        command = [args.meissner, "simulate", "markers", path, *sensor, "--out", out, *SCENE]
        subprocess.run([str(word) for word in command], check=True)


def main():
    args = arguments()
    images, pose = pins.read(args.data / "tap_train.npz")
    field, seen = pins.fit(images, pose)
    off = np.hypot(*(seen - field(pose)).transpose(2, 0, 1))
    print(f"train: {100 * np.mean(~np.isnan(off)):.2f} % of the pins followed, {np.nanmean(off):.3f} pixels off the field")
    random = np.random.default_rng(args.seed)
    # Every press of every film has a camera of its own.
    seed = 1_000_000 * args.seed
    for number in range(args.films):
        film(args, number, "train", seed + 100_000 * number, tracks(field, pose[:-VALID], seen[:-VALID], random))
    film(args, 0, "valid", seed + 800_000, tracks(field, pose[-VALID:], seen[-VALID:], random))
    images, pose = pins.read(args.data / "tap_test.npz")
    seen = pins.followed([pins.blobs(image) for image in images], field(pose))
    print(f"test: {100 * np.mean(~np.isnan(seen)):.2f} % of the pins followed")
    film(args, 0, "test", seed + 900_000, tracks(field, pose, seen, random))


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--films", type=int, default=2, help="times that the training presses are filmed; default: 2")
    parser.add_argument("--seed", type=int, default=0, help="default: 0")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    return parser.parse_args()


if __name__ == "__main__":
    main()
