"""Live engines: predictions over accepted events have an engine's own bits, independent of the threads, and other events are counted."""

import os
import threading
import time

import numpy as np
import pytest
from conftest import SENSOR, SMALL, interrupted, make_events
from hypothesis import given, settings
from hypothesis import strategies as st
from test_frames import make

import meissner

WIDE = {**SMALL, "network": {"name": "wide", "capacity": 20_000, "span_us": 10**7}}

def wide():
    """An engine that takes about 20 us per event, so that a queue fills."""
    return meissner.Engine(WIDE, SENSOR, meissner.Weights.draw(SMALL, 1))


@settings(deadline=None, max_examples=25)
@given(
    seed=st.integers(0, 1000),
    cuts=st.lists(st.integers(0, 300), max_size=4),
    overload=st.sampled_from(["block", "drop_oldest", "drop_newest"]),
    batch=st.sampled_from([1, 7, 64]),
    ahead=st.booleans(),
)
def test_what_enters_is_predicted_with_the_bits_of_an_engine(seed, cuts, overload, batch, ahead):
    events, weights = make_events(300, seed), meissner.Weights.draw(SMALL, 3)
    alone = meissner.Engine(SMALL, SENSOR, weights)
    engine = meissner.Engine(SMALL, SENSOR, weights)
    with meissner.Live(engine, overload=overload, batch=batch, ahead=ahead) as live:
        for part in np.split(events, sorted(cuts)):
            live.push(t=part["t"], x=part["x"], y=part["y"], p=part["p"])
            alone.push(part)
            timely, expected = live.predict(), alone.predict()
            assert timely.fresh and timely.own and timely.behind_events == 0
            assert timely.values.tobytes() == expected.values.tobytes()
            assert (timely.t_us, timely.nodes) == (expected.t_us, expected.nodes)
        live.advance(int(events["t"][-1]) + 30_000)
        alone.advance(int(events["t"][-1]) + 30_000)
        assert live.predict().values.tobytes() == alone.predict().values.tobytes()


def test_after_a_restart_of_the_clock_predictions_cover_the_new_one_and_say_so():
    before, after = make_events(300, start_us=60_000_000), make_events(600)
    alone = meissner.Engine(SMALL, SENSOR, meissner.Weights.draw(SMALL, 1))
    with meissner.Live(alone) as live:
        live.push(before)
        assert (live.predict().restarts, live.counters["events"]["accepted"]) == (0, 300)
        live.push(after[:5])                      # held: a few late events look the same
        held = live.predict()
        assert (held.fresh, held.behind_events, held.lost_events) == (False, 0, 5)
        assert "5 events lost" in repr(held)
        live.push(after[5:])
        timely = live.predict()
        alone.push(after)
        assert timely.t_us == after["t"][-1] and timely.values.tobytes() == alone.predict().values.tobytes()
        assert (timely.fresh, timely.restarts, timely.lost_events, timely.dropped_events) == (True, 1, 0, 0)
        assert live.predict().restarts == 0
        with pytest.warns(meissner.MeissnerWarning, match="clock of the sensor has restarted"):
            live.close()
        events = live.counters["events"]
        assert (events["pushed"], events["accepted"], events["restarts"], events["late"]) == (900, 900, 1, 0)


def test_an_engine_that_keeps_its_clock_loses_the_events_of_the_new_one_and_says_so():
    engine = meissner.Engine(SMALL, SENSOR, meissner.Weights.draw(SMALL, 1), restart="keep")
    with meissner.Live(engine, overload="drop_oldest") as live:
        live.push(make_events(300, start_us=60_000_000))
        t_us = live.predict().t_us
        live.push(make_events(300))
        timely = live.predict()
        assert (timely.t_us, timely.fresh, timely.restarts, timely.lost_events) == (t_us, False, 0, 300)
        assert live.counters["events"]["late"] == 300
        with pytest.warns(meissner.MeissnerWarning, match="300 of 600"):
            live.close()


def test_the_engine_that_was_given_stays_as_it_is_and_close_returns_the_other(engine, events):
    engine.push(events[:100])
    live = meissner.Live(engine)
    live.push(events[100:200])
    live.predict()
    closed = live.close()
    assert (len(engine), closed.counters["events"]["accepted"]) == (100, 200)
    engine.push(events[100:200])
    assert closed.predict().values.tobytes() == engine.predict().values.tobytes()
    assert live.close() is None and live.is_closed
    assert live.counters["delivered"] == 100


def test_a_prediction_has_names_an_age_and_what_it_covers(engine, events):
    with meissner.Live(engine) as live:
        live.push(events)
        timely = live.predict(deadline_us=5e6)
        assert isinstance(timely, meissner.Prediction)
        assert timely["a"] == timely.values[0] and timely.units == ("rad", "rad")
        assert 0 <= timely.age_us <= timely.waited_us < 5e6
        assert repr(timely).startswith("<Timely: a ") and "fresh" in repr(timely)
        assert repr(live) == f'<Live "small": {len(events)} of {len(events)} taken, 0 dropped>'
        assert live.description.name == "small"


def test_a_deadline_is_kept_and_an_older_prediction_says_how_far_behind_it_is():
    events = make_events(20_000, every_us=5)
    with meissner.Live(wide()) as live:
        live.push(events)
        begin = time.perf_counter()
        timely = live.predict(deadline_us=2_000)
        # The deadline, plus the delay of the scheduler on a busy machine.
        assert time.perf_counter() - begin < 0.5
        assert not timely.fresh and timely.behind_events > 0 and timely.behind_us > 0
        assert "behind" in repr(timely)
        last = live.predict()
        assert last.fresh and last.t_us == events["t"][-1]


@pytest.mark.parametrize(
    ("overload", "stride", "dropped"),
    [
        ("drop_oldest", None, "dropped_oldest"),
        ("drop_newest", None, "dropped_newest"),
        ("thin", 4, "thinned"),
        (meissner.Filters(SENSOR, stride=4), None, "filtered"),
    ],
    ids=["drop_oldest", "drop_newest", "thin", "filter"],
)
def test_events_that_find_no_room_are_counted_by_the_rule(overload, stride, dropped):
    with meissner.Live(wide(), overload=overload, stride=stride, capacity=512) as live:
        live.push(make_events(20_000, every_us=5))
        live.predict()
        counters = live.counters
        assert counters[dropped] > 0
        reasons = ("dropped_oldest", "dropped_newest", "thinned", "filtered")
        assert counters["offered"] == counters["delivered"] + sum(counters[reason] for reason in reasons) == 20_000


def test_block_drops_nothing_and_has_the_thread_wait():
    with meissner.Live(wide(), overload="block", capacity=256) as live:
        live.push(make_events(5_000, every_us=5))
        assert live.predict().nodes == 5_000
        counters = live.counters
        assert counters["delivered"] == counters["offered"] == 5_000
        assert counters["blocked_us"] > 0 and counters["high_water"] <= 256


def test_a_thread_pushes_while_another_predicts():
    events, seen = make_events(6_000, every_us=5), []
    with meissner.Live(wide(), overload="block") as live:
        thread = threading.Thread(target=lambda: [live.push(part) for part in np.split(events, 60)])
        thread.start()
        while thread.is_alive():
            seen.append(live.predict(deadline_us=1_000).nodes)
        thread.join()
        last = live.predict()
    assert seen == sorted(seen) and last.nodes == 6_000
    alone = wide()
    alone.push(events)
    assert last.values.tobytes() == alone.predict().values.tobytes()


def test_frames_live_have_the_bits_of_a_frame_engine():
    frames = np.random.default_rng(0).normal(size=(20, 2, 6, 8)).astype("f4")
    alone = make()
    with meissner.Live(make(), overload="block", capacity=4) as live:
        live.push_frames(frames[0], 5)
        live.push_frames(frames[1:], 10 * np.arange(1, 20))
        alone.push(frames)
        timely = live.predict()
        assert timely.values.tobytes() == alone.predict().values.tobytes()
        assert (timely.t_us, timely.nodes) == (190, 20)
        with pytest.raises(meissner.InputError, match="expected 2 times"):
            live.push_frames(frames[:2], [1, 2, 3])
        with pytest.raises(meissner.InputError, match="over events"):
            live.push(make_events(3))
        assert len(live.close()) == 20


def test_faults_have_their_type_and_text(engine, events):
    with pytest.raises(meissner.InputError, match="overload: expected .* found 'wait'"):
        meissner.Live(engine, overload="wait")
    with pytest.raises(meissner.InputError, match="thin"):
        meissner.Live(engine, overload="thin")
    with pytest.raises(meissner.InputError, match="capacity of the queue in events: expected 1 to"):
        meissner.Live(engine, capacity=0)
    with pytest.raises(TypeError, match="expected an Engine or a FrameEngine, found int"):
        meissner.Live(3)
    live = meissner.Live(engine)
    with pytest.raises(meissner.InputError, match="deadline_us: expected at least 0 us, found -1"):
        live.predict(deadline_us=-1)
    with pytest.raises(meissner.InputError, match="over frames"):
        live.push_frames(np.zeros((4, 4)), 0)
    with pytest.raises(meissner.DtypeError):
        live.push(np.zeros(3))
    live.close()
    for call in (lambda: live.push(events), live.predict, lambda: live.advance(3)):
        with pytest.raises(meissner.LiveError, match="closed"):
            call()


def test_close_ends_a_push_and_a_prediction_that_wait():
    live, ended = meissner.Live(wide(), overload="block", capacity=256), []

    def end(call):
        try:
            call()
        except meissner.LiveError as error:
            ended.append(str(error))

    events = make_events(200_000, every_us=5)
    threads = [threading.Thread(target=end, args=(call,)) for call in (lambda: live.push(events), lambda: [live.predict() for _ in range(10**6)])]
    [thread.start() for thread in threads]
    time.sleep(0.2)
    live.close()
    [thread.join(timeout=10) for thread in threads]
    assert len(ended) == 2 and any("were taken" in text or "closed" in text for text in ended)


WAITING = """
import signal
import meissner
from conftest import make_events
from test_live import wide

signal.signal(signal.SIGINT, signal.default_int_handler)
live = meissner.Live(wide(), capacity=1 << 20)
live.push(make_events(400_000, every_us=5))
print("waiting", flush=True)
try:
    live.predict()
    print("done", flush=True)
except KeyboardInterrupt:
    print("interrupted", live.predict(deadline_us=0).fresh, flush=True)
"""


@pytest.mark.skipif(os.name != "posix", reason="sends SIGINT")
def test_ctrl_c_ends_the_wait_for_a_prediction():
    said, _ = interrupted(WAITING, after="waiting\n", seconds=0.1)
    assert said == "interrupted False\n"
