#!/usr/bin/env python3
"""The dataflows of one machine, as they are and with sources that are too fast: every event is accounted for.

    python3 tests/one_machine.py --dora DORA --nodes target/debug/meissner-dora
"""

import argparse
import json
import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

FOLDER = Path(__file__).resolve().parent.parent


def kill_source(folder, dora):
    """Kills the source once there are predictions."""
    record = folder / "out/one_fingertip.jsonl"
    until = time.monotonic() + 60
    while time.monotonic() < until:
        if record.exists() and record.read_text().count('{"kind":"prediction"') > 50:
            break
        time.sleep(0.1)
    for status in Path("/proc").glob("[0-9]*/status"):
        try:
            parents = f"\nPPid:\t{dora}\n" in status.read_text()
            if parents and b"meissner-dora\0source\0" in (status.parent / "cmdline").read_bytes():
                os.kill(int(status.parent.name), signal.SIGKILL)
        except (OSError, ProcessLookupError):
            pass  # It has ended.


def run(dora, nodes, name, folder, *changes, meanwhile=None):
    """Runs the dataflow of this name with some of its text changed, and returns its output."""
    (folder / "target/release").mkdir(parents=True)
    (folder / "target/release/meissner-dora").symlink_to(nodes)
    (folder / "python").symlink_to(FOLDER / "python")
    text = (FOLDER / f"{name}.yml").read_text()
    for before, after in changes:
        assert before in text, before
        text = text.replace(before, after)
    (folder / "flow.yml").write_text(text)
    # The Python of dora runs the nodes in Python.
    paths = os.pathsep.join([str(Path(dora).parent), os.environ["PATH"]])
    environment = {**os.environ, "DORA_ZENOH_CONFIG_OVERLAY": str(FOLDER / "zenoh.json5"), "DORA_ZENOH_MULTICAST": "off",
                   "PATH": paths}
    # A separate session, so that signals of a terminal reach it through this script only.
    dataflow = subprocess.Popen([dora, "run", "flow.yml"], cwd=folder, env=environment, stdin=subprocess.DEVNULL,
                                stdout=subprocess.PIPE, stderr=subprocess.STDOUT, text=True, start_new_session=True)
    if meanwhile:
        threading.Thread(target=meanwhile, args=(folder, dataflow.pid), daemon=True).start()
    try:
        log = dataflow.communicate(timeout=180)[0]
    except BaseException:
        # The nodes notice that their parent process has ended.
        dataflow.send_signal(signal.SIGKILL)
        dataflow.wait()
        raise
    if dataflow.returncode != 0:
        raise RuntimeError(log)
    return log


def flow(dora, nodes, name, runs, *changes, meanwhile=None):
    """Runs a dataflow with a record; returns the findings of the record's check, and the latencies."""
    with tempfile.TemporaryDirectory(prefix="meissner-dora-") as folder:
        folder = Path(folder)
        # Any free port, because another user of the usual port would stop the metrics.
        run(dora, nodes, name, folder, ("127.0.0.1:9464", "127.0.0.1:0"), *changes, meanwhile=meanwhile)
        record = folder / "out" / f"{name}.jsonl"
        checked = subprocess.run([nodes, "check", record, "--runs", str(runs)], capture_output=True, text=True)
        if checked.returncode != 0:
            raise RuntimeError(checked.stderr)
        latency = subprocess.run([nodes, "latency", record], check=True, capture_output=True, text=True).stdout
        return json.loads(checked.stdout), latency


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dora", required=True, type=Path, help="the command line program of dora 1.1.0")
    parser.add_argument("--nodes", required=True, type=Path, help="the program meissner-dora")
    arguments = parser.parse_args()
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(130))
    dora, nodes = str(arguments.dora.resolve()), arguments.nodes.resolve()

    def show(what, runs, name, *changes, meanwhile=None):
        began = time.monotonic()
        found, latency = flow(dora, nodes, name, runs, *changes, meanwhile=meanwhile)
        print(f"{what}: {time.monotonic() - began:.1f} s, {json.dumps(found)}\n{latency}", flush=True)
        assert found["sent"] == found["accepted"] + sum(found["dropped"].values()), found
        assert found["lives"] == 1 and found["predictions"] > 0, found
        return found

    slow = ("source --runs 20\n", "source --runs 4 --speed 0.25\n")
    found = show("one fingertip", 4, "one_fingertip", slow)
    assert found["sent"] == 4 * 32_330 and found["sensors"] == 1, found
    slow = ("source --runs 20\n", "source --runs 4 --speed 0.25\n")
    found = show("the source is killed and restarted", 4, "one_fingertip", slow, meanwhile=kill_source)
    assert found["sent"] == 4 * 32_330 and found["streams"] == 2, found
    # As fast as the source can, into queues that are too short.
    fast = ("source --runs 20\n", "source --runs 20 --speed 0 --most 64\n")
    found = show("too fast", 20, "one_fingertip", fast, ("finger/events, queue_size: 1024", "finger/events, queue_size: 2"))
    assert found["dropped"].get("queue", 0) + found["dropped"].get("queue_or_link", 0) > 0, found
    short = ("source --runs 20 --speed 0.02", "source --runs 1 --speed 0.02")
    found = show("twenty fingertips", 1, "twenty_fingertips", short)
    assert found["sent"] == 20 * 32_330 and found["sensors"] == 20, found
    with tempfile.TemporaryDirectory(prefix="meissner-dora-") as folder:
        log = run(dora, nodes, "python_nodes", Path(folder))
        # The number of the event after the newest that a prediction covers.
        assert " show: 2000 " in log, log
        print("nodes in Python: their last prediction is of all events")


if __name__ == "__main__":
    main()
