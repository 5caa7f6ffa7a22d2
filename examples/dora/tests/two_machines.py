#!/usr/bin/env python3
"""Two machines, a link that is cut and healed, and an inference node that is killed: every event is accounted for.

The machines are two network namespaces, which this test makes and removes, joined by a pair of virtual interfaces. Each has its own
memory for sharing between processes, so only the link joins them. Needs root, iproute2, and the programs in the arguments.

    python3 tests/two_machines.py --dora DORA --nodes target/debug/meissner-dora [--times 10]
"""

import argparse
import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

FOLDER = Path(__file__).resolve().parent.parent
ADDRESSES = {"sensors": "10.83.7.1", "computer": "10.83.7.2"}
# Runs of the embedded recording, and stream seconds per second: about 30 seconds in all.
RUNS, SPEED = 24, 0.25
EVENTS = 32_330
# Longer than the lease of zenoh.json5, so that links are closed and dialled again.
CUT_SECONDS = 4.0


def run(*command):
    subprocess.run(command, check=True, stdout=subprocess.DEVNULL)


class Machines:
    """Two namespaces with a link, a coordinator, and a daemon in each."""

    def __init__(self, dora, folder):
        self.dora, self.folder = dora, folder
        self.names = {name: f"meissner-{os.getpid()}-{name}" for name in ADDRESSES}
        self.links = {name: f"md{os.getpid() % 10**7}{name[0]}" for name in ADDRESSES}
        self.processes, self.made = {}, []

    def __enter__(self):
        try:
            for name in self.names.values():
                run("ip", "netns", "add", name)
                self.made.append(name)
            sensors, computer = self.links.values()
            run("ip", "-n", self.names["sensors"], "link", "add", sensors, "type", "veth",
                "peer", "name", computer, "netns", self.names["computer"])
            for name, address in ADDRESSES.items():
                run("ip", "-n", self.names[name], "address", "add", f"{address}/24", "dev", self.links[name])
                for device in ["lo", self.links[name]]:
                    run("ip", "-n", self.names[name], "link", "set", device, "up")
            self.start("coordinator", "sensors", "coordinator", "--interface", ADDRESSES["sensors"], "--store", "memory")
            time.sleep(0.5)
            for name in ADDRESSES:
                self.start(name, name, "daemon", "--machine-id", name, "--coordinator-addr", ADDRESSES["sensors"],
                           "--zenoh-no-multicast", "--zenoh-config-overlay", str(FOLDER / "zenoh.json5"))
            return self
        except BaseException:
            self.__exit__()
            raise

    def start(self, label, machine, *command):
        # `ip netns exec` also makes a mount namespace, so the other machine's memory is not visible.
        script = 'mount -t tmpfs tmpfs /dev/shm && exec "$@"'
        inside = ["ip", "netns", "exec", self.names[machine], "sh", "-c", script, "sh", self.dora, *command]
        log = open(self.folder / f"{label}.log", "ab")
        # A separate session: signals of the terminal are for this script, which ends it.
        self.processes[label] = subprocess.Popen(
            inside, cwd=self.folder, stdout=log, stderr=log, stdin=subprocess.DEVNULL, start_new_session=True)

    def tell(self, *command, timeout=60):
        inside = ["ip", "netns", "exec", self.names["sensors"], self.dora, *command]
        told = subprocess.run(inside, cwd=self.folder, timeout=timeout, capture_output=True, text=True,
                              stdin=subprocess.DEVNULL)
        if told.returncode != 0:
            raise RuntimeError(f"dora {' '.join(command)}: {told.stdout}{told.stderr}")
        return told.stdout

    def log(self, label):
        return (self.folder / f"{label}.log").read_text(errors="replace")

    def link(self, state):
        run("ip", "-n", self.names["sensors"], "link", "set", self.links["sensors"], state)

    def members(self):
        """The processes of both machines, with their command lines."""
        found = {}
        for name in self.made:
            pids = subprocess.run(["ip", "netns", "pids", name], capture_output=True, text=True).stdout.split()
            for pid in map(int, pids):
                try:
                    found[pid] = Path(f"/proc/{pid}/cmdline").read_bytes().split(b"\0")
                except OSError:
                    pass  # It has ended.
        return found

    def nodes(self, kind=None):
        """The running nodes, or only those of a kind."""
        named = {pid: line for pid, line in self.members().items() if line[0].endswith(b"meissner-dora")}
        return [pid for pid, line in named.items() if kind is None or line[1] == kind.encode()]

    def __exit__(self, *_):
        # Only processes in the namespaces of this test, which nobody else has.
        for signal_number in [signal.SIGTERM, signal.SIGKILL]:
            for pid in self.members():
                try:
                    os.kill(pid, signal_number)
                except ProcessLookupError:
                    pass
            until = time.monotonic() + 3
            while self.members() and time.monotonic() < until:
                time.sleep(0.05)
        for process in self.processes.values():
            process.wait(timeout=5)
        for name in self.made:
            subprocess.run(["ip", "netns", "del", name], check=False)


def wait(what, seconds, condition):
    until = time.monotonic() + seconds
    while time.monotonic() < until:
        if condition():
            return
        time.sleep(0.05)
    raise RuntimeError(f"not in {seconds} s: {what}")


class Record:
    """The record as it grows, in the working folder that the daemon makes for the dataflow."""

    def __init__(self, folder):
        self.folder = folder

    def path(self):
        return next(self.folder.glob("_work/*/out/two_machines.jsonl"), None)

    def lines(self, kind):
        text = self.path().read_text() if self.path() else ""
        whole = text[: text.rfind("\n") + 1].splitlines()
        return [json.loads(line) for line in whole if line.startswith(f'{{"kind":"{kind}"')]

    def predictions(self):
        return self.lines("prediction")


def scrape(machines):
    """The metrics, requested on the machine that serves them."""
    script = "import urllib.request as r; print(r.urlopen('http://127.0.0.1:9464/metrics', timeout=5).read().decode())"
    inside = ["ip", "netns", "exec", machines.names["computer"], sys.executable, "-c", script]
    return subprocess.run(inside, check=True, capture_output=True, text=True, timeout=20).stdout


def once(dora, nodes, keep):
    folder = Path(tempfile.mkdtemp(prefix="meissner-dora-"))
    try:
        # The dataflow as it is, with another program behind its path and a longer stream.
        (folder / "target/release").mkdir(parents=True)
        (folder / "target/release/meissner-dora").symlink_to(nodes)
        flow = (FOLDER / "two_machines.yml").read_text()
        own = "source --runs 20\n"
        assert own in flow, flow
        # After its end, the source repeats the number of its events until no event can be in transit.
        flow = flow.replace(own, f"source --runs {RUNS} --speed {SPEED} --linger-ms 4000\n")
        (folder / "flow.yml").write_text(flow)
        record = Record(folder)
        with Machines(dora, folder) as machines:
            address = ["--coordinator-addr", ADDRESSES["sensors"]]
            wait("both daemons are known", 20, lambda: machines.log("coordinator").count("reports 0 running") == 2)
            machines.tell("start", "flow.yml", "--detach", "--name", "touch", *address)
            wait("predictions", 30, lambda: len(record.predictions()) > 50)

            machines.link("down")
            time.sleep(CUT_SECONDS)
            machines.link("up")
            wait("a loss on the link", 30, lambda: any(loss["reason"] == "link" for loss in record.lines("loss")))
            seen = len(record.predictions())
            wait("predictions after the cut", 20, lambda: len(record.predictions()) > seen + 50)

            [inference] = machines.nodes("infer")
            os.kill(inference, signal.SIGKILL)
            wait("the inference node is back", 20, lambda: machines.nodes("infer") not in ([], [inference]))
            wait("a loss of the restart", 30, lambda: any(loss["reason"] == "down" for loss in record.lines("loss")))
            seen = len(record.predictions())
            wait("predictions after the restart", 20, lambda: len(record.predictions()) > seen + 50)
            metrics = scrape(machines)

            wait("the end of the dataflow", 90, lambda: not machines.nodes())
        checked = subprocess.run([nodes, "check", record.path(), "--runs", str(RUNS)], capture_output=True, text=True)
        if checked.returncode != 0:
            raise RuntimeError(checked.stderr)
        found = json.loads(checked.stdout)
        assert found["sent"] == RUNS * EVENTS, found
        assert found["sent"] == found["accepted"] + sum(found["dropped"].values()), found
        assert found["dropped"]["link"] > 0 and found["dropped"]["down"] > 0, found
        assert found["lives"] == 2 and found["predictions"] > 150, found
        for name in ["events_sent_total", "predictions_total", 'events_dropped_total{sensor="finger",reason="link"}',
                     "latency_seconds_bucket"]:
            assert f"meissner_{name}" in metrics, metrics
        latency = subprocess.run([nodes, "latency", record.path()], check=True, capture_output=True, text=True).stdout
        return found, latency
    except BaseException:
        keep = True
        print(f"kept: {folder}", file=sys.stderr)
        raise
    finally:
        if not keep:
            shutil.rmtree(folder, ignore_errors=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--dora", required=True, type=Path, help="the command line program of dora 1.1.0")
    parser.add_argument("--nodes", required=True, type=Path, help="the program meissner-dora")
    parser.add_argument("--times", type=int, default=1)
    parser.add_argument("--keep", action="store_true", help="keep records and logs")
    arguments = parser.parse_args()
    # A request to end removes what was made.
    signal.signal(signal.SIGTERM, lambda *_: sys.exit(130))
    for number in range(1, arguments.times + 1):
        began = time.monotonic()
        found, latency = once(str(arguments.dora.resolve()), arguments.nodes.resolve(), arguments.keep)
        print(f"{number}: {time.monotonic() - began:.1f} s, {json.dumps(found)}", flush=True)
    print(latency, end="")


if __name__ == "__main__":
    main()
