"""Films the press and release that the program embeds: events as EVT3, and the truth over time as text.

    python models/train/angle/embed.py /tmp/dome/tracks.unseen.safetensors 107 run/assets/dome_press

Press 107 of that file has a tilt of 6 degrees towards 252 degrees, a direction that no training has seen. Among the presses with this
tilt its depth is nearest to 10 mm, the middle of the plan. The dome is then held for 60 ms, and lifted along the path of the press.
"""

import argparse
import json
import tempfile
from pathlib import Path

import numpy as np
from dome import CAMERA, LAMPS, SENSOR, meissner
from safetensors.numpy import load_file, save_file

HOLD_US = 60_000
# The camera that filmed this press for `dome.py`.
SEED = 400_000


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("tracks", type=Path)
    parser.add_argument("press", type=int)
    parser.add_argument("out", type=Path, help="without extension")
    args = parser.parse_args()
    tracks = pressed_and_lifted(load_file(args.tracks), args.press)
    with tempfile.TemporaryDirectory() as folder:
        own, filmed, text = (Path(folder) / name for name in ("tracks.safetensors", "events.safetensors", "press.csv"))
        save_file(tracks | {"start": np.array([0, len(tracks["t_us"])])}, own, {"sensor": json.dumps(SENSOR)})
        size = "{}x{}".format(*SENSOR)
        seed = SEED + args.press
        meissner("simulate", "markers", own, "--sensor", size, "--lux", LAMPS["on"], *CAMERA, "--seed", seed, "--out", filmed)
        events = load_file(filmed)
        with text.open("w") as file:
            file.write(f"# sensor {size}\n")
            np.savetxt(file, np.stack([events[name] for name in ("t_us", "x", "y", "on")], 1), fmt="%d", delimiter=",")
        meissner("convert", text, args.out.with_suffix(".evt3"), "--force")
    columns = np.stack([tracks[name] for name in ("t_us", "depth", "roll", "pitch")], 1)
    header = "t_us,depth_mm,roll_rad,pitch_rad"
    np.savetxt(args.out.with_suffix(".csv"), columns, "%d,%.6f,%.7f,%.7f", header=header, comments="")
    print(f"{len(events['t_us'])} events, {tracks['t_us'][-1] / 1000:.1f} ms")


def pressed_and_lifted(tracks, press):
    """The tracks of a press, then the same back in time after a hold."""
    start = tracks.pop("start")
    tracks = {name: tensor[start[press] : start[press + 1]] for name, tensor in tracks.items()}
    t_us = tracks.pop("t_us")
    back = 2 * t_us[-1] + HOLD_US - t_us[::-1]
    return {name: np.concatenate([tensor, tensor[::-1]]) for name, tensor in tracks.items()} | {"t_us": np.concatenate([t_us, back])}


if __name__ == "__main__":
    main()
