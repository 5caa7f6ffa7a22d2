"""Long pushes: other threads run, and Ctrl-C ends them between two events."""

import os
import signal
import threading
import time

import numpy as np
import pytest
from conftest import SENSOR, SMALL, interrupted, make_events

import meissner

LONG = """
import signal
import meissner
from conftest import SENSOR, SMALL, make_events

# A shell that starts the tests in the background has them ignore the signal.
signal.signal(signal.SIGINT, signal.default_int_handler)
network = {**SMALL, "network": {"name": "long", "capacity": 20_000, "span_us": 10**7}}
engine = meissner.Engine(network, SENSOR, meissner.Weights.draw(SMALL, 1))
events = make_events(2_000_000, every_us=5)
print("pushing", flush=True)
try:
    engine.push(events)
    print("done", flush=True)
except KeyboardInterrupt:
    counted = engine.counters["events"]["pushed"]
    print("interrupted", 0 < counted < len(events), engine.push(events[counted : counted + 10]), flush=True)
"""


@pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")
def test_ctrl_c_interrupts_a_long_push_and_the_engine_remains_usable():
    said, took = interrupted(LONG, after="pushing\n", seconds=0.3)
    assert said == "interrupted True 10\n"
    assert took < 5


def test_other_threads_run_during_a_push():
    description = {**SMALL, "network": {"name": "long", "capacity": 20_000, "span_us": 10**7}}
    engine = meissner.Engine(description, SENSOR, meissner.Weights.draw(SMALL, 1))
    events, ticks, done = make_events(20_000, every_us=5), [], threading.Event()

    def tick():
        while not done.is_set():
            ticks.append(time.monotonic())
            time.sleep(0.001)

    thread = threading.Thread(target=tick)
    thread.start()
    begin = time.monotonic()
    engine.push(events)
    end = time.monotonic()
    done.set()
    thread.join()
    # Without the release there is a tick at most every 5 ms, and none in a push that holds the interpreter lock.
    assert sum(begin < tick < end for tick in ticks) > (end - begin) / 0.05


def test_threads_that_share_an_engine_wait_for_each_other():
    description = {**SMALL, "network": {"name": "long", "capacity": 20_000, "span_us": 10**7}}
    engine = meissner.Engine(description, SENSOR, meissner.Weights.draw(SMALL, 1))
    blocks, counts, failed = np.split(make_events(4_000, every_us=5), 40), [], []

    def work():
        try:
            for block in blocks:
                counts.append(engine.push(block))
                engine.predict()
                len(engine), repr(engine), engine.snapshot()
        except BaseException as error:  # noqa: BLE001
            failed.append(error)

    threads = [threading.Thread(target=work) for _ in range(3)]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert not failed
    counted = engine.counters["events"]
    assert counted["pushed"] == 3 * 4_000
    assert counted["accepted"] == sum(counts) == len(engine)
    assert engine.counters["predictions"]["read"] == 120


@pytest.mark.skipif(os.name != "posix", reason="sends a signal to itself")
def test_a_signal_handler_that_uses_the_engine_at_work_is_refused_and_does_not_wait_for_ever():
    description = {**SMALL, "network": {"name": "long", "capacity": 20_000, "span_us": 10**7}}
    engine = meissner.Engine(description, SENSOR, meissner.Weights.draw(SMALL, 1))
    events = make_events(2_000_000, every_us=5)
    before = signal.signal(signal.SIGALRM, lambda *_: engine.predict())
    signal.setitimer(signal.ITIMER_REAL, 0.1)
    try:
        with pytest.raises(meissner.Error, match="from within another"):
            engine.push(events)
    finally:
        signal.setitimer(signal.ITIMER_REAL, 0)
        signal.signal(signal.SIGALRM, before)
    assert len(engine) > 0


def test_two_engines_work_in_two_threads_with_their_own_bits(events):
    weights = meissner.Weights.draw(SMALL, 1)
    engines = [meissner.Engine(SMALL, SENSOR, weights) for _ in range(2)]
    threads = [threading.Thread(target=engine.push, args=(events,)) for engine in engines]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert np.array_equal(*(engine.predict().values for engine in engines))
