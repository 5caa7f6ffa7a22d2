"""Runs that start Ray themselves: numbers of workers, kills, leftovers of Ray, the cost of a run."""

import os
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import pytest
from conftest import descendants, determined, in_a_loop, processes, workers_at_work, write_digits, write_press

import meissner_ray
from meissner_ray.cluster import started


@pytest.fixture(scope="module")
def long_digits(tmp_path_factory):
    """Recordings that take long enough for a stop during one of them."""
    return write_digits(tmp_path_factory.mktemp("long"), count=4_000)


def until(found, seconds=60):
    """The first true result of `found`."""
    end = time.monotonic() + seconds
    while time.monotonic() < end:
        if result := found():
            return result
        time.sleep(0.01)
    raise AssertionError("expected something to happen, found nothing")


def test_one_and_two_workers_have_the_same_bits_and_leave_nothing(digits, tmp_path):
    def left():
        return {path.name for path in Path(tempfile.gettempdir()).glob("meissner-r*")}

    def ours():
        return {name: value for name, value in os.environ.items() if name.startswith(("RAY_A", "RAY_E", "RAY_U"))}

    before, variables = left(), ours()
    one, two = (
        meissner_ray.evaluate("digits", digits, tmp_path / str(workers), networks="digits-past", workers=workers)
        for workers in (1, 2)
    )
    assert len(set(one["worker"].to_pylist())) == 1 and one.num_rows == 20
    assert determined(one) == determined(two) == determined(in_a_loop("eval", "digits", digits, "digits-past"))
    assert left() <= before and ours() == variables
    # With one worker the formula describes the run itself, except the time between the tasks and the program.
    measured = meissner_ray.measured(one)
    cost = meissner_ray.cost(measured, 20, 1)
    assert measured.recordings == 20 and measured.workers == 1
    assert cost.least_s == pytest.approx(measured.wall_s, abs=2)
    assert cost.most_s == cost.least_s and not cost.extrapolated


def test_a_killed_worker_loses_nothing(long_digits, tmp_path):
    out, killed = tmp_path / "out", []

    def progress(done, total, name):
        if done == 2:
            # The worker is in the middle of a recording, or about to begin one.
            [worker] = until(workers_at_work)
            os.kill(worker, signal.SIGKILL)
            killed.append(worker)

    results = meissner_ray.evaluate(
        "digits", long_digits, out, networks="digits-past", every_us=100, workers=1, progress=progress
    )
    workers = {int(worker.rpartition(":")[2]) for worker in results["worker"].to_pylist()}
    assert len(killed) == 1 and len(workers) == 2 and killed[0] in workers
    assert results.num_rows == 10 and results["failure"].null_count == 10
    assert determined(results) == determined(in_a_loop("eval", "digits", long_digits, "digits-past", every_us=100))


def test_a_recording_that_kills_every_worker_costs_a_row(tmp_path):
    good, endless = tmp_path / "1-good.safetensors", tmp_path / "2-endless.safetensors"
    write_press(good, 1)
    # Its readers wait for a writer that never comes.
    os.mkfifo(endless)
    over, killed = threading.Event(), set()

    def kill():
        before = set()
        while not over.wait(0.5):
            now = workers_at_work() - killed
            # A worker that was here before has begun to read.
            for worker in now & before:
                killed.add(worker)
                os.kill(worker, signal.SIGKILL)
            before = now

    thread = threading.Thread(target=kill)
    try:
        results = meissner_ray.evaluate(
            "angle",
            [good, endless],
            tmp_path / "out",
            networks="tactigraph-past",
            workers=1,
            progress=lambda done, total, name: thread.start() if done == 1 else None,
        )
    finally:
        over.set()
        thread.join()
    failed = {row["recording"]: row["failure"] for row in results.to_pylist() if row["failure"]}
    assert failed.keys() == {str(endless)} and "its worker died 4 times" in failed[str(endless)]
    assert len(killed) == 4 and str(good) in results["recording"].to_pylist()


def test_a_killed_program_goes_on_where_it_stopped(long_digits, tmp_path):
    out = tmp_path / "out"
    command = [sys.executable, "-m", "meissner_ray", "eval", "digits", str(long_digits), "--networks", "digits-past"]
    command += ["--every-us", "100", "--workers", "1", "--out", str(out)]
    first = subprocess.Popen(command, stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL)
    try:
        until(lambda: len(list((out / "rows").glob("*.parquet"))) >= 2)
        own = descendants(first.pid)
        folders = set(Path(tempfile.gettempdir()).glob(f"meissner-ray-{first.pid}-*"))
    finally:
        first.kill()
        first.wait()
    # Workers and schedulers end with the program; two agents of Ray check for it from time to time.
    until(lambda: not {title for process, title in processes("").items() if process in own and "Agent" not in title and title})
    assert len(folders) == 1
    finished = {path.name for path in (out / "rows").glob("*.parquet")}
    assert 2 <= len(finished) < 10
    assert subprocess.run(command, stdout=subprocess.DEVNULL, check=False).returncode == 0
    results = meissner_ray.read(out)
    assert len(set(results["run"].to_pylist())) == 2 and not any(folder.exists() for folder in folders)
    assert {path.name for path in out.iterdir()} == {"results.parquet", "settings.json", ".lock"}
    assert determined(results) == determined(in_a_loop("eval", "digits", long_digits, "digits-past", every_us=100))


def listening(ids):
    """The addresses in hexadecimal on which processes listen."""
    sockets = set()
    for process in ids:
        for place in Path(f"/proc/{process}/fd").glob("*"):
            try:
                sockets.add(os.readlink(place))
            except OSError:
                continue
    found = set()
    for table in ("tcp", "tcp6"):
        for line in Path(f"/proc/net/{table}").read_text().splitlines()[1:]:
            fields = line.split()
            if fields[3] == "0A" and f"socket:[{fields[9]}]" in sockets:
                found.add(fields[1].partition(":")[0])
    return found


def test_ray_listens_on_loopback_alone_and_reports_nothing():
    import ray

    with started(1):
        inside = ray.remote(lambda: os.environ.get("RAY_USAGE_STATS_ENABLED"))
        assert ray.get(inside.remote()) == "0"
        # 127.0.0.1, ::1, and 127.0.0.1 as an address of IPv6.
        loopback = {"0100007F", "00000000000000000000000001000000", "0000000000000000FFFF00000100007F"}
        addresses = listening(descendants(os.getpid()))
        assert addresses and addresses <= loopback
