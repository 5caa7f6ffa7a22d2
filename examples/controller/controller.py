"""The controller in Python: 1 kHz, events from UDP or a recording, predictions by a deadline, targets for a wrist.

    pip install ./bindings/python
    cargo run --release -p meissner-controller --bin fingertip &
    python examples/controller/controller.py udp://127.0.0.1:5000

The README next to this file describes the datagrams and the law of levelling.
"""

import argparse
import ctypes
import gc
import math
import os
import socket
import struct
import sys
import threading
import time

import numpy as np

import meissner

NETWORK, SENSOR, GAIN, HOLD = "tactigraph-past", (346, 260), 0.8, 2
# Layout of events in a datagram, 16 bytes each.
RECORD = np.dtype({"names": ["t", "x", "y", "p"], "formats": ["<i8", "<u2", "<u2", "i1"], "itemsize": 16})
# Cycle, roll, pitch of the wrist; and time, depth, roll, pitch, phase, tap.
TARGET, STATE = struct.Struct("<Qdd"), struct.Struct("<qdddII")
ROWS_US = (5, 10, 20, 50, 100, 200, 500, 800, 1000, 10_000, math.inf)
LOCK_CURRENT_AND_FUTURE = 3


def main():
    arguments = parse()
    sensor, play = opened(arguments.source)
    engine = meissner.Engine(NETWORK, sensor)
    report("locked memory", lock_memory)
    # A thread inherits the priority of the thread that starts it.
    report("priority of the engine's thread", lambda: raise_to(60))
    live = meissner.Live(engine, capacity=arguments.queue)
    report("priority of the feed", lambda: raise_to(70))
    # Threads take turns in the interpreter: a cycle must not wait for the feed for long.
    sys.setswitchinterval(50e-6)
    start, ended = time.monotonic() + 0.2, threading.Event()
    feed = threading.Thread(target=play, args=(live, start, ended))
    feed.start()
    report("priority of the loop", lambda: raise_to(80))
    robot = Remote(arguments.fingertip) if arguments.source.startswith("udp://") else Alone()
    late_us, answer_us, late, stale = run(live, robot, start, ended, arguments)
    ended.set()
    feed.join()
    live.predict()
    counters, engine = live.counters, live.close()
    print(f"{len(late_us)} cycles, deadlines missed: {late} woken late, {stale} without a fresh prediction in time")
    histogram(late_us, answer_us)
    print(f"{counters['offered']} events, {counters['dropped_oldest']} dropped, {len(engine)} in the window at the end")


def run(live, robot, start, ended, arguments):
    """Cycles until the feed has ended; returns their times in microseconds, and the number of missed deadlines."""
    period, deadline = arguments.period / 1e6, arguments.deadline / 1e6
    late_us, answer_us, late, stale, cycle, due = [], [], 0, 0, 0, start
    roll = pitch = 0.0
    # A collection would be a pause in the loop.
    gc.freeze()
    gc.disable()
    try:
        while not ended.is_set() and (arguments.cycles is None or cycle < arguments.cycles):
            time.sleep(max(0.0, due - time.monotonic()))
            woke = time.monotonic()
            phase, wrist_roll, wrist_pitch = robot.state()
            left_us = max(0.0, due + deadline - time.monotonic()) * 1e6
            prediction = live.predict(left_us)
            answered = time.monotonic()
            # While a press is held, the angle of the contact is what the wrist must still turn.
            if phase == HOLD:
                values = prediction.values
                roll, pitch = wrist_roll + GAIN * float(values[0]), wrist_pitch + GAIN * float(values[1])
            robot.aim(cycle, roll, pitch)
            late_us.append((woke - due) * 1e6)
            answer_us.append((answered - woke) * 1e6)
            if woke > due + deadline / 2:
                late += 1
            elif not prediction.fresh or answered > due + deadline:
                stale += 1
            cycle, due = cycle + 1, due + period
    finally:
        gc.enable()
    return late_us, answer_us, late, stale


class Remote:
    """A fingertip at the other end of a socket."""

    def __init__(self, address):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.connect(address_of(address))
        self.socket.setblocking(False)
        self.newest = (0, 0.0, 0.0)

    def state(self):
        """Phase, roll and pitch of the wrist in radians, as far as they are known."""
        while True:
            try:
                datagram = self.socket.recv(STATE.size + 1)
            except (BlockingIOError, ConnectionRefusedError):
                return self.newest
            if len(datagram) == STATE.size:
                _, _, roll, pitch, phase, _ = STATE.unpack(datagram)
                self.newest = (phase, roll, pitch)

    def aim(self, cycle, roll, pitch):
        try:
            self.socket.send(TARGET.pack(cycle, roll, pitch))
        except (BlockingIOError, ConnectionRefusedError):
            pass  # nobody may listen


class Alone:
    """A wrist for a recording, on which it has no effect: always in a hold, at rest."""

    def state(self):
        return HOLD, 0.0, 0.0

    def aim(self, cycle, roll, pitch):
        pass


def opened(source):
    """The sensor of a source, and a function that feeds a live engine from it, for a separate thread."""
    if source.startswith("udp://"):
        receiver = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        receiver.bind(address_of(source.removeprefix("udp://")))
        receiver.settimeout(0.02)
        return SENSOR, lambda live, _, ended: listen(receiver, live, ended)
    recording = meissner.open(source)
    batches = [(t_us, events) for t_us, events in recording.windows(500) if len(events)]
    return recording.sensor or SENSOR, lambda live, start, ended: replay(batches, live, start, ended)


def listen(receiver, live, ended):
    """Events from datagrams, until an empty one."""
    buffer = bytearray(1 << 16)
    records = np.frombuffer(buffer, RECORD)
    while not ended.is_set():
        try:
            length = receiver.recv_into(buffer)
        except TimeoutError:
            continue
        if length == 0:
            break
        if length % RECORD.itemsize == 0:
            live.push(records[: length // RECORD.itemsize])
    ended.set()


def replay(batches, live, start, ended):
    """Events of a recording at real speed."""
    first_us = batches[0][1]["t"][0] if batches else 0
    for _, events in batches:
        wait = start + (int(events["t"][-1]) - int(first_us)) / 1e6 - time.monotonic()
        if wait > 0 and ended.wait(wait):
            return
        live.push(events)
    ended.set()


def histogram(late_us, answer_us):
    print(f"{'up to us':>14} {'woken late':>12} {'answer':>12}")
    above = -math.inf
    for bound in ROWS_US:
        counts = (sum(above < us <= bound for us in times) for times in (late_us, answer_us))
        print(f"{'more' if math.isinf(bound) else bound:>14} {next(counts):>12} {next(counts):>12}")
        above = bound
    for name, share in (("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999), ("most", 1)):
        late, answer = (np.quantile(times, share) if times else math.nan for times in (late_us, answer_us))
        print(f"{name:>14} {late:>12.1f} {answer:>12.1f}")


def report(what, ask):
    """Prints whether the operating system granted a request."""
    try:
        ask()
    except (OSError, AttributeError) as error:
        print(f"{what}: refused ({error})")
    else:
        print(f"{what}: granted")


def lock_memory():
    if ctypes.CDLL(None, use_errno=True).mlockall(LOCK_CURRENT_AND_FUTURE) != 0:
        raise OSError(os.strerror(ctypes.get_errno()))


def raise_to(priority):
    os.sched_setscheduler(0, os.SCHED_FIFO, os.sched_param(priority))


def address_of(text):
    host, _, port = text.rpartition(":")
    return host, int(port)


def parse():
    parser = argparse.ArgumentParser(description="A loop at a fixed rate that levels a fingertip by its predicted contact angle.")
    parser.add_argument("source", help="a recording, played at real speed; or udp://HOST:PORT, where records of 16 bytes arrive")
    for name, kind, default, text in (
        ("--fingertip", str, "127.0.0.1:5001", "HOST:PORT where the fingertip takes targets"),
        ("--period", int, 1000, "microseconds between two cycles"),
        ("--deadline", int, 800, "microseconds from when a cycle is due until its prediction must be at hand"),
        ("--queue", int, 1 << 16, "most events that wait; the oldest make room"),
        ("--cycles", int, None, "cycles before the end, at most"),
    ):
        parser.add_argument(name, type=kind, default=default, help=text)
    return parser.parse_args()


if __name__ == "__main__":
    main()
