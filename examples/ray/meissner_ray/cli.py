"""`python -m meissner_ray`: evaluations over many recordings, and what they cost.

Exit status: 0, 1 where a recording failed, 2 where nothing could be computed, 130 after Ctrl-C.
"""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from dataclasses import asdict
from typing import Any

import meissner
import pyarrow as pa

from .cost import cost, measured
from .errors import RayError
from .recordings import tasks
from .run import evaluate, pareto
from .store import failures, read
from .summary import summary


def main(arguments: Sequence[str] | None = None) -> int:
    """Runs a command and returns its exit status."""
    asked = _parser().parse_args(arguments)
    try:
        status: int = asked.run(asked)
    except (RayError, meissner.Error, OSError, ValueError) as error:
        print(f"error: {error}", file=sys.stderr)
        return 2
    except KeyboardInterrupt:
        print("stopped; the same command goes on", file=sys.stderr)
        return 130
    return status


def _parser() -> argparse.ArgumentParser:
    parser = argparse.ArgumentParser("meissner_ray", description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    commands = parser.add_subparsers(required=True, metavar="COMMAND")
    for name, about in (("eval", "judge networks on labelled recordings"), ("pareto", "measure run time against error")):
        # A list of recordings is longer than a command line can be: @FILE has one argument a line.
        command = commands.add_parser(name, help=about, description=about, fromfile_prefix_chars="@")
        command.add_argument("task", choices=tasks(name))
        command.add_argument("data", nargs="+", help="folders or recordings; @FILE has one a line")
        command.add_argument("--out", required=True, help="folder of the results; a run goes on where it stopped")
        command.add_argument("--networks", nargs="+", required=True, help="names of networks or description files")
        command.add_argument("--weights", help="weights of the only network")
        command.add_argument("--trainings", help="folder of whole trainings")
        command.add_argument("--workers", type=int, help="processes; as many as there are cores")
        command.set_defaults(run=_run, command=name)
        if name == "eval":
            command.add_argument("--stride", type=int, help="every so many events one is pushed; that of the weights")
            command.add_argument("--every-us", type=int, help="microseconds between predictions")
        else:
            command.add_argument("--only", nargs="+", default=[], help='parts of "NETWORK, SETTING"; others are left out')
            command.add_argument("--timed", type=int, help="events (windows, pictures, recordings) timed in each repeat")
            command.add_argument("--repeats", type=int, default=3)
            command.add_argument("--sensor", type=_sides, help="WIDTHxHEIGHT in pixels, instead of the recording's")
            command.add_argument("--from-us", type=int, default=0, help="microseconds left out at the beginning")
    command = commands.add_parser("summary", help="figures over all recordings of a folder of results")
    command.add_argument("results")
    command.add_argument("--json", action="store_true")
    command.set_defaults(run=_summary)
    command = commands.add_parser("cost", help="compute what many recordings take from what a run has measured")
    command.add_argument("results")
    command.add_argument("--recordings", type=int, default=10_000)
    command.add_argument("--cores", type=int, nargs="+", default=[1, 2])
    command.add_argument("--json", action="store_true")
    command.set_defaults(run=_cost)
    return parser


def _run(asked: argparse.Namespace) -> int:
    names = {"eval": ("stride", "every_us"), "pareto": ("only", "timed", "repeats", "sensor", "from_us")}[asked.command]
    common = {name: getattr(asked, name) for name in ("networks", "weights", "trainings", "workers")}
    own = {name: getattr(asked, name) for name in names}
    function = evaluate if asked.command == "eval" else pareto
    results = function(asked.task, asked.data, asked.out, **common, **own, progress=_progress if sys.stderr.isatty() else None)
    _print_summary(results)
    failed = failures(results.to_pylist())
    for row in failed:
        print(f"{row['recording']}: {row['failure']}", file=sys.stderr)
    return 1 if failed else 0


def _progress(done: int, total: int, _: str) -> None:
    print(f"\r{done} of {total} recordings", end="\n" if done == total else "", file=sys.stderr, flush=True)


def _summary(asked: argparse.Namespace) -> int:
    results = read(asked.results)
    if asked.json:
        print(json.dumps(summary(results)))
    else:
        _print_summary(results)
    return 0


def _print_summary(results: pa.Table) -> None:
    for record in summary(results):
        print("  ".join(f"{name} {_text(value)}" for name, value in record.items()))


def _cost(asked: argparse.Namespace) -> int:
    found = measured(read(asked.results))
    costs = [cost(found, asked.recordings, cores) for cores in asked.cores]
    if asked.json:
        print(json.dumps({"measured": asdict(found), "computed": [asdict(one) for one in costs]}))
        return 0
    print(f"measured: {found.recordings} recordings, workers {found.workers}, {found.cpu}, {found.wall_s:.1f} s in all")
    print(f"  startup   {found.startup_s:9.3f} s    shutdown {found.shutdown_s:9.3f} s")
    print(f"  recording {1e3 * found.recording_s:9.3f} ms   longest  {1e3 * found.longest_s:9.3f} ms")
    print(f"  its CPU   {1e3 * found.cpu_s:9.3f} ms")
    print(f"  overhead  {1e3 * found.overhead_s:9.3f} ms   write    {1e3 * found.write_s:9.3f} ms")
    print(f"computed: {asked.recordings} such recordings")
    for one in costs:
        note = f"; more cores than the {found.workers} measured: arithmetic, not a measurement" if one.extrapolated else ""
        print(f"  {one.cores} cores: {one.least_s:.1f} to {one.most_s:.1f} s, +-{one.interval_s:.1f} s{note}")
    return 0


def _sides(text: str) -> tuple[int, int]:
    width, by, height = text.partition("x")
    if not (by and width.isdigit() and height.isdigit()):
        raise argparse.ArgumentTypeError(f"expected WIDTHxHEIGHT, found {text!r}")
    return int(width), int(height)


def _text(value: Any) -> str:
    return f"{value:.4g}" if isinstance(value, float) else str(value)
