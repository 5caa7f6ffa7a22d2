"""Presses of a TacTip as events with labels: real mechanics, real labels, a simulated camera.

usage: presses.py DATA --part test --out test.safetensors [--meissner PATH] [--seed N]

DATA has tap_train.npz and tap_test.npz. Each real image becomes a press: every pin moves from rest, along the field that was fitted to
the training images, to where the image has it. The camera of `meissner simulate markers` sees the pins move.

The result has the events of all presses as `prepare graphs` reads them, and for each press `pose` F32 (presses, 3), depth in mm and two
tilts in degrees as the robot had them, and `duration_us` I64 (presses): depth rises from 0 to that of the pose from 10 ms on for this
long, as 3 t^2 - 2 t^3; then the press is held for 20 ms.
"""

import argparse
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import pins
from safetensors.numpy import load_file, save_file

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
    """Times (press, time) in microseconds and positions (press, time, pin, 2) of presses."""
    shares = np.linspace(0, 1, STEPS + 1)
    times = REST_US + np.rint(shares * duration[:, None]).astype(np.int64)
    # Whatever the field misses of a real image grows with the depth. A pin that was not seen ends where the field says.
    residual = np.nan_to_num(seen - field(pose))
    positions = []
    for rise in risen(shares):
        shallower = np.column_stack([rise * pose[:, 0], pose[:, 1:]])
        positions.append(field(shallower) + rise * residual)
    times = np.column_stack([np.zeros_like(duration), times, times[:, -1] + HOLD_US])
    return times, np.stack([positions[0], *positions, positions[-1]], 1).astype(np.float32)


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
    times, positions = tracks(field, pose, seen, duration)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "tracks.safetensors"
        start = np.arange(len(pose) + 1) * times.shape[1]
        flat = positions.reshape(-1, *positions.shape[2:])
        save_file({"t_us": times.ravel(), "start": start, "position": flat}, path)
        sensor = f"{pins.SIDE}x{pins.SIDE}"
        command = [args.meissner, "simulate", "markers", path, "--sensor", sensor, "--out", args.out, "--seed", args.seed, *SCENE]
        subprocess.run([str(word) for word in command], check=True)
    tensors = load_file(args.out) | {"pose": pose.astype(np.float32), "duration_us": duration}
    save_file(tensors, args.out, {"sensor": f"[{pins.SIDE}, {pins.SIDE}]"})


if __name__ == "__main__":
    main()
