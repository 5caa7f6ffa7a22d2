"""Presses of a TacTip as events with labels: real mechanics, real labels, a simulated camera.

usage: presses.py DATA --part test --out test.safetensors [--meissner PATH] [--seed N]

DATA has tap_train.npz and tap_test.npz. Each real image becomes a press: every pin moves from rest, along the field that was fitted to
the training images, to where the image has it. The camera of `meissner simulate markers` sees the pins move.

The result has the events of all presses as `prepare graphs` reads them, and along the time of each press `truth.depth` in mm, and
`truth.tilt_x` and `truth.tilt_y` in degrees, as the robot had them. The tilts are constant. From 10 ms on, depth rises from 0 to that of
the pose within 100 to 200 ms, as 3 t^2 - 2 t^3; then the press is held for 20 ms.
"""

import argparse
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pins
from safetensors.numpy import save_file

REST_US, HOLD_US = 10_000, 20_000
DURATION_US = 100_000, 200_000
STEPS = 12  # of the motion; markers move along straight lines between them
# Grey pins on dark ground, and thresholds that give some thousand events a press, as the real stream of a tactile sensor with
# markers has (docs/simulated-touch.md).
SCENE = ["--radius", "1.5", "--marker", "0.5", "--ground", "0.2", "--threshold-on", "0.3", "--threshold-off", "0.3"]


def risen(share):
    """Depth at a share of the duration, as a share of its end."""
    return share * share * (3 - 2 * share)


def tracks(field, pose, seen, duration):
    """Of presses: times (press, time) in microseconds, positions (press, time, pin, 2) and depths (press, time)."""
    shares = np.linspace(0, 1, STEPS + 1)
    times = REST_US + np.rint(shares * duration[:, None]).astype(np.int64)
    # Whatever the field misses of a real image grows with the depth. A pin that was not seen ends where the field says.
    residual = np.nan_to_num(seen - field(pose))
    positions, depths = [], []
    for rise in risen(shares):
        depths.append(rise * pose[:, 0])
        positions.append(field(np.column_stack([depths[-1], pose[:, 1:]])) + rise * residual)
    times = np.column_stack([np.zeros_like(duration), times, times[:, -1] + HOLD_US])
    held = [np.stack([values[0], *values, values[-1]], 1).astype(np.float32) for values in (positions, depths)]
    return times, *held


def main():
    parser = argparse.ArgumentParser(description=__doc__.split("\n")[0])
    parser.add_argument("data", type=Path)
    parser.add_argument("--part", choices=["train", "test"], required=True)
    parser.add_argument("--out", type=Path, required=True)
    parser.add_argument("--meissner", default="target/release/meissner")
    parser.add_argument("--seed", type=int, default=0)
    args = parser.parse_args()

    images, pose = pins.read(args.data / "tap_train.npz")
    field, seen = pins.fit(images, pose)
    off = np.hypot(*(seen - field(pose)).transpose(2, 0, 1))
    print(f"train: {100 * np.mean(~np.isnan(off)):.2f} % of the pins followed, {np.nanmean(off):.3f} pixels off the field")
    if args.part == "test":
        images, pose = pins.read(args.data / "tap_test.npz")
        seen = pins.followed([pins.blobs(image) for image in images], field(pose))
        print(f"test: {100 * np.mean(~np.isnan(seen)):.2f} % of the pins followed")

    duration = np.random.default_rng(args.seed).integers(*DURATION_US, len(pose), endpoint=True)
    times, positions, depth = tracks(field, pose, seen, duration)
    tilts = {name: np.repeat(pose[:, i].astype(np.float32), times.shape[1]) for i, name in ((1, "tilt_x"), (2, "tilt_y"))}
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tracks.safetensors"
        start = np.arange(len(pose) + 1) * times.shape[1]
        flat = positions.reshape(-1, *positions.shape[2:])
        save_file({"t_us": times.ravel(), "start": start, "position": flat, "depth": depth.ravel(), **tilts}, path)
        sensor = f"{pins.SIDE}x{pins.SIDE}"
        command = [args.meissner, "simulate", "markers", path, "--sensor", sensor, "--out", args.out, "--seed", args.seed, *SCENE]
        subprocess.run([str(word) for word in command], check=True)


if __name__ == "__main__":
    main()
