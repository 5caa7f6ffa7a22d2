#!/usr/bin/env python3
"""Frame networks compared with ONNX Runtime and PyTorch: the same weights, one thread, in one run.

    python3 benches/peers/frames.py [--json] [--python PATH] [--runs N] [--recording FILE] [NETWORK ...]

Makes a virtual environment in target/peers-venv (or uses the one that --python names), draws weights in PyTorch, writes
them with an input and PyTorch's answer to a safetensors file, and gives that file to `--example frames`, which compares
answers before it measures times. Ours is measured before and after theirs; the table has the mean of the two medians.

With --recording (again for each), event-frame-cnn also runs on the frames of a recording, skipping values that no event reaches.
"""
import argparse
import json
import os
import pathlib
import sys

from run import ROOT, environment, output, say

HERE = pathlib.Path(__file__).resolve().parent
MORE = ["onnx", "onnxruntime", "safetensors"]


def ours(file, name, runs, recordings):
    """Figures of the `frames` example: milliseconds by method."""
    command = ["cargo", "run", "--release", "--quiet", "-p", "meissner-benches", "--example", "frames", "--"]
    figures = json.loads(output([*command, name, file, "--runs", str(runs)], cwd=ROOT))
    if recordings and name == "event-frame-cnn":
        flags = [flag for path in recordings for flag in ("--recording", path.resolve())]
        figures["ms"] |= json.loads(output([*command, name, file, *flags], cwd=ROOT))["ms"]
    return figures


def main():
    names = ["canf", "canf-live", "canf-plain", "slip-tuned", "slip-regularised", "slip-lstm", "force-convlstm", "event-frame-cnn"]
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object a line instead of a table")
    parser.add_argument("--python", type=pathlib.Path, help="use an existing environment's interpreter")
    parser.add_argument("--runs", type=int, default=15, help="runs that a median is taken of")
    parser.add_argument("--recording", type=pathlib.Path, action="append", default=[], help="a recording of events")
    parser.add_argument("networks", nargs="*", metavar="NETWORK", help=f"some of {', '.join(names)}")
    args = parser.parse_args()

    python = args.python or environment(False, MORE)
    folder = ROOT / "target" / "peers"
    folder.mkdir(parents=True, exist_ok=True)
    single = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1"}
    if not args.json:
        print(f"{'network':<18}{'computed':<26}{'ours, ms':>10}{'onnxruntime':>13}{'ratio':>8}{'torch':>10}{'ratio':>8}{'error':>10}")
    for name in args.networks or names:
        file = folder / f"{name}.safetensors"
        measure = [python, HERE / "measure_frames.py", name, file, "--runs", str(args.runs)]
        output([*measure, "--export"], env=single)
        say(f"{name}: ours")
        before = ours(file, name, args.runs, args.recording)
        say(f"{name}: theirs")
        theirs = json.loads(output(measure, env=single))
        after = ours(file, name, args.runs, args.recording)
        for way, first in before["ms"].items():
            ms = (first + after["ms"][way]) / 2
            row = dict(network=name, computed=way, ours_ms=ms, onnxruntime_ms=theirs["onnxruntime"], torch_ms=theirs["torch"],
                       ratio=ms / theirs["onnxruntime"], error=before["error"].get(way), isa=before["isa"],
                       ours_runs_ms=[first, after["ms"][way]], versions=theirs["versions"])
            if args.json:
                print(json.dumps(row), flush=True)
            else:
                print(f"{name:<18}{way:<26}{ms:>10.3f}{row['onnxruntime_ms']:>13.3f}{row['ratio']:>8.2f}"
                      f"{row['torch_ms']:>10.3f}{ms / row['torch_ms']:>8.2f}"
                      + ("" if row["error"] is None else f"{row['error']:>10.1e}"), flush=True)


if __name__ == "__main__":
    sys.exit(main())
