"""Writes a press as the program embeds it: events as EVT3, and the truth along time as text.

    python train/angle/embed.py /tmp/dome/on/unseen.safetensors 107 pipeline/assets/dome_press

Press 107 of that file has a tilt of 6 degrees towards 252 degrees, a direction that no training has seen. Of the presses with this tilt
its depth is nearest to 10 mm, the middle of the plan's.
"""

import argparse
import subprocess
import tempfile
from pathlib import Path

import numpy as np
import presses


def main():
    args = arguments()
    data = presses.read(args.events)
    events, t_us = data.events[args.press], data.times[args.press]
    width, height = data.sensor
    with tempfile.TemporaryDirectory() as folder:
        text = Path(folder) / "press.csv"
        with text.open("w") as file:
            file.write(f"# sensor {width}x{height}\n")
            np.savetxt(file, events, fmt="%d", delimiter=",")
        command = [args.meissner, "convert", text, args.out.with_suffix(".evt3"), "--force"]
        subprocess.run([str(word) for word in command], check=True)
    columns = [t_us] + [data.labels[name][args.press] for name in ("depth", "roll", "pitch")]
    header = "t_us,depth_mm,roll_rad,pitch_rad"
    np.savetxt(args.out.with_suffix(".csv"), np.stack(columns, 1), "%d,%.6f,%.7f,%.7f", header=header, comments="")
    print(f"{len(events)} events, {t_us[-1] / 1000:.1f} ms")


def arguments():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("events", type=Path)
    parser.add_argument("press", type=int)
    parser.add_argument("out", type=Path, help="without extension")
    parser.add_argument("--meissner", default="target/release/meissner", help="default: %(default)s")
    return parser.parse_args()


if __name__ == "__main__":
    main()
