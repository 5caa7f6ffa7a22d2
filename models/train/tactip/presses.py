"""Presses of a TacTip as events with labels: real mechanics, real labels, a simulated camera.

    python models/train/tactip/presses.py DATA FOLDER
    python models/train/tactip/presses.py DATA FOLDER --set shear

DATA has tap_train.npz and tap_test.npz, and for `--set shear` also shear_train.npz and shear_test.npz. Each real image becomes a press:
every pin moves from rest, along the field that was fitted to the training images, to its position in the image. The camera of `meissner
simulate markers` sees the pins move. Writes

    FILM/train.safetensors   all training images but the last 500, once for each of the cameras FILM = 0, 1, ...
    0/valid.safetensors      these 500, to choose by
    0/test.safetensors       the test images
    FILM/train.safetensors   with `--drawn N`, for the N cameras after these: as many presses, at poses and after moves that the robot did
                             not take

with the events of all presses as `prepare graphs` reads them, and along the time of each press `truth.depth` in mm, and `truth.tilt_x`
and `truth.tilt_y` in degrees, as recorded by the robot. Beside each are the tracks of the pins, PART.tracks.safetensors.

After a rest of 10 to 60 ms, depth rises from 0 to that of the pose within 100 to 200 ms, as 3 t^2 - 2 t^3; then the press is held for
20 ms. The tilts are constant. No image shows the path: there the pins deviate from the field by as much as in another image of the
same set, drawn at random, so that no state of a press is more exact than an image.

The robot made an image with shear in two steps: it pressed at the pose minus the move, then moved and turned to the pose, at constant
depth. Here the press takes 60 to 130 ms, and so does the move, as 3 t^2 - 2 t^3 each. Within a move, the field knows each state: it is the
state of an image with a smaller move. The tilts are those of the press until the move begins, and then turn to those of the pose. The
deviation of an image from the field grows with the move. No image shows the end of the press: there the pins deviate from the field by as
much as in another image of the same set, drawn at random, so that a press is not more exact than an image. A drawn press has the depth,
the tilts and the move of training images, each drawn at random separately, and deviates from the field by as much as another one.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
import pins
import shear
from safetensors.numpy import save_file

# The code that all trainings share is beside their folders.
sys.path.append(str(Path(__file__).resolve().parents[1]))
from shared import meissner
from tracks import shears, taps

VALID = 500
# No film of the training has one of these numbers.
VALID_CAMERA, TEST_CAMERA = 8, 9
# Grey pins on dark ground, and thresholds that give some thousand events per press, as in the real stream of a tactile sensor
# with markers (docs/simulated-touch.md).
SCENE = ["--radius", "1.5", "--marker", "0.5", "--ground", "0.2", "--threshold-on", "0.3", "--threshold-off", "0.3"]
SCENE += ["--threshold-spread", "0.02", "--leak-hz", "0.061"]


def film(args, number, part, seed, tracks):
    """Films `tracks` with the camera `number`."""
    out = args.folder / str(number) / f"{part}.safetensors"
    path = out.with_suffix(".tracks.safetensors")
    out.parent.mkdir(parents=True, exist_ok=True)
    save_file(tracks, path)
    sensor = ["--sensor", f"{pins.SIDE}x{pins.SIDE}", "--seed", seed]
    meissner("simulate", "markers", path, *sensor, "--out", out, *SCENE)


def main():
    args = arguments()
    train, test, drawn = (tapped if args.set == "tap" else sheared)(args.data)
    random = np.random.default_rng(args.seed)
    # Every press of every film has its own camera.
    seed = 1_000_000 * args.seed
    numbers = [number for number in range(args.films + args.drawn + 2) if number not in (VALID_CAMERA, TEST_CAMERA)]
    for number in numbers[: args.films]:
        film(args, number, "train", seed + 100_000 * number, train(slice(None, -VALID), random))
    film(args, 0, "valid", seed + 100_000 * VALID_CAMERA, train(slice(-VALID, None), random))
    film(args, 0, "test", seed + 100_000 * TEST_CAMERA, test(slice(None), random))
    for number in numbers[args.films :][: args.drawn]:
        random = np.random.default_rng((args.seed, number))
        film(args, number, "train", seed + 100_000 * number, drawn(slice(None, -VALID), random))


def tapped(data):
    """The functions that make tracks of some training images of taps, with a random generator, and of the test images."""
    images, pose = pins.read(data / "tap_train.npz")
    field, seen = pins.fit(images, pose)
    said("train", seen, field(pose))
    images, test = pins.read(data / "tap_test.npz")
    there = pins.followed([pins.blobs(image) for image in images], field(test))
    said("test", there, field(test))
    # A pin that was not seen ends at its position in the field.
    residual = np.nan_to_num(seen - field(pose))
    missed = np.nan_to_num(there - field(test))

    def drawn(part, random):
        depth, tilts, other = (random.permutation(len(pose[part])) for _ in range(3))
        chosen = np.column_stack([pose[part][depth, :1], pose[part][tilts, 1:]])
        return taps(field, chosen, residual[part][other], random)

    return (
        lambda part, random: taps(field, pose[part], residual[part], random),
        lambda part, random: taps(field, test[part], missed[part], random),
        drawn,
    )


def sheared(data):
    """The same for presses with a move."""
    images, tap = pins.read(data / "tap_train.npz")
    field, seen = pins.fit(images, tap, shear.followed)
    blobs, pose, move = shear.read(data / "shear_train.npz")
    field, seen = shear.fit((tap, seen, field), (blobs, pose, move))
    said("train", seen, field(pose, move))
    blobs, test, after = shear.read(data / "shear_test.npz")
    there = shear.followed(blobs, field(test, after))
    said("test", there, field(test, after))
    residual = np.nan_to_num(seen - field(pose, move))
    missed = np.nan_to_num(there - field(test, after))

    def drawn(part, random):
        other = [random.permutation(len(pose[part])) for _ in range(4)]
        chosen = np.column_stack([pose[part][other[0], :1], pose[part][other[1], 1:]])
        return shears(field, chosen, move[part][other[2]], residual[part][other[3]], random)

    return (
        lambda part, random: shears(field, pose[part], move[part], residual[part], random),
        lambda part, random: shears(field, test[part], after[part], missed[part], random),
        drawn,
    )


def said(name, seen, expected):
    """Prints how well the field follows the pins of some images."""
    off = np.hypot(*(seen - expected).transpose(2, 0, 1))
    print(f"{name}: {100 * np.mean(~np.isnan(off)):.2f} % of the pins followed, {np.nanmean(off):.3f} pixels off the field", flush=True)


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("data", type=Path)
    parser.add_argument("folder", type=Path)
    parser.add_argument("--set", choices=["tap", "shear"], default="tap", help="default: %(default)s")
    parser.add_argument("--films", type=int, default=2, help="times that the training presses are filmed; default: 2")
    parser.add_argument("--drawn", type=int, default=0, help="films of presses at drawn poses; default: 0")
    parser.add_argument("--seed", type=int, default=0, help="default: 0")
    return parser.parse_args()


if __name__ == "__main__":
    main()
