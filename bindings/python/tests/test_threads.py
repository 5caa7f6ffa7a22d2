"""Long pushes: other threads run, and Ctrl-C ends them between two events."""

import os
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
    # Without the release there is a tick at most every 5 ms, and none in a push that holds the interpreter.
    assert sum(begin < tick < end for tick in ticks) > (end - begin) / 0.05


def test_an_engine_that_is_at_work_in_another_thread_refuses_a_second_one():
    description = {**SMALL, "network": {"name": "long", "capacity": 20_000, "span_us": 10**7}}
    engine = meissner.Engine(description, SENSOR, meissner.Weights.draw(SMALL, 1))
    events, refused = make_events(20_000, every_us=5), []
    thread = threading.Thread(target=engine.push, args=(events,))
    thread.start()
    while thread.is_alive() and not refused:
        try:
            engine.advance(0)
        except RuntimeError as error:
            refused.append(error)
    thread.join()
    assert refused
    assert len(engine) == len(events)


def test_two_engines_work_in_two_threads_with_their_own_bits(events):
    weights = meissner.Weights.draw(SMALL, 1)
    engines = [meissner.Engine(SMALL, SENSOR, weights) for _ in range(2)]
    threads = [threading.Thread(target=engine.push, args=(events,)) for engine in engines]
    [thread.start() for thread in threads]
    [thread.join() for thread in threads]
    assert np.array_equal(*(engine.predict().values for engine in engines))
