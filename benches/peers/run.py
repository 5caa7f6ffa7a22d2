#!/usr/bin/env python3
"""Our figures compared with other people's, on one window, one thread, in one run.

    python3 benches/peers/run.py [--json] [--python PATH] [--with-pyg] [--runs N]

Makes a virtual environment in target/peers-venv with NumPy, SciPy and PyTorch (or uses the one that --python names),
builds and runs `--example window`, which writes the window with its graph and weights, and gives that file to
`measure.py`. Answers are compared before anything is timed. --with-pyg adds PyTorch Geometric's whole forward pass;
installing it compiles for about 15 minutes.

Ours is measured before and after theirs, and the table has the mean of the two medians, so that a machine that slows
down meanwhile slows both sides.
"""
import argparse
import json
import os
import pathlib
import subprocess
import sys
import venv

ROOT = pathlib.Path(__file__).resolve().parents[2]
HERE = pathlib.Path(__file__).resolve().parent
ENVIRONMENT = ROOT / "target" / "peers-venv"
PACKAGES = ["numpy", "scipy", "torch"]
# Extensions that are built against the installed PyTorch.
PYG = [["torch_geometric==2.6.1"], ["--no-build-isolation", "torch_spline_conv"]]


def say(text):
    print(text, file=sys.stderr, flush=True)


def output(command, **options):
    """Standard output of a command; its standard error goes to ours."""
    return subprocess.run([str(c) for c in command], check=True, stdout=subprocess.PIPE, text=True, **options).stdout


def environment(with_pyg, more=()):
    """The interpreter of a virtual environment with the packages of the peers."""
    python = ENVIRONMENT / "bin" / "python"
    if not python.exists():
        say(f"making {ENVIRONMENT.relative_to(ROOT)}")
        venv.create(ENVIRONMENT, with_pip=True)
    install = [python, "-m", "pip", "install", "--quiet", "--disable-pip-version-check"]
    output([*install, *PACKAGES, *more])
    if with_pyg:
        say("installing PyTorch Geometric; this compiles")
        output([*install, "setuptools", "wheel"])
        for packages in PYG:
            output([*install, *packages])
    return python


def ours(arguments):
    """Figures of the `window` example."""
    command = ["cargo", "run", "--release", "--quiet", "-p", "meissner-benches", "--example", "window", "--"]
    return json.loads(output([*command, *arguments], cwd=ROOT))


def rows(before, after, peers):
    """(what, our ms, peer, their ms), ours being the mean of the medians measured before and after the peer."""
    for peer in peers:
        figure = peer["ours"]
        mean = (before[figure] + after[figure]) / 2
        yield dict(what=peer["what"], ours_ms=mean, peer=peer["peer"], peer_ms=peer["ms"],
                   ratio=peer["ms"] / mean, ours_runs_ms=[before[figure], after[figure]])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--json", action="store_true", help="print one JSON object instead of a table")
    parser.add_argument("--python", type=pathlib.Path, help="use an existing environment's interpreter")
    parser.add_argument("--with-pyg", action="store_true", help="run PyTorch Geometric too")
    parser.add_argument("--runs", type=int, default=15, help="runs that a median is taken of")
    args = parser.parse_args()

    python = args.python or environment(args.with_pyg)
    folder = ROOT / "target" / "peers"
    folder.mkdir(parents=True, exist_ok=True)
    window = folder / "window.safetensors"
    say("building and checking ours")
    before = ours(["--export", window, "--runs", str(args.runs)])
    say("running theirs")
    flags = ["--runs", str(args.runs), *(["--with-pyg"] if args.with_pyg else [])]
    single = {**os.environ, "PYTHONDONTWRITEBYTECODE": "1", "OMP_NUM_THREADS": "1", "MKL_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
    theirs = [json.loads(line) for line in
              output([python, HERE / "measure.py", window, *flags], env=single).splitlines()]
    after = ours(["--runs", str(args.runs)])

    table = list(rows(before, after, theirs))
    about = {key: before[key] for key in ("window", "weights", "isa", "runs")}
    if args.json:
        whole = [before["forward_ms"], after["forward_ms"]]
        print(json.dumps(dict(about, threads=1, rows=table, ours_whole_forward_ms=whole), indent=2))
        return
    print(f"7,006 events of {about['window']}, weights: {about['weights']}, one thread, "
          f"medians of {about['runs']}, ours with {about['isa']}\n")
    print(f"{'what':<42} {'ours, ms':>9} {'theirs, ms':>11} {'ratio':>7}  peer")
    for row in table:
        print(f"{row['what']:<42} {row['ours_ms']:>9.2f} {row['peer_ms']:>11.2f} {row['ratio']:>6.1f}x  {row['peer']}")
    if not args.with_pyg:
        whole = (before["forward_ms"] + after["forward_ms"]) / 2
        print(f"{'whole forward':<42} {whole:>9.2f} {'':>11} {'':>7}  --with-pyg runs PyTorch Geometric")


if __name__ == "__main__":
    main()
