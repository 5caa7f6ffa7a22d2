"""Processes from os.fork: nothing waits for threads that stayed in the parent."""

import multiprocessing
import os

import numpy as np
import pytest
from conftest import SENSOR, SMALL, make_events

import meissner

pytestmark = pytest.mark.skipif(not hasattr(os, "fork"), reason="no fork")
pytestmark = [pytestmark, pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")]


def in_a_child(work):
    """What `work` returns or raises in a forked child, as the type's name and a text."""
    context = multiprocessing.get_context("fork")
    receives, sends = context.Pipe(duplex=False)

    def run():
        try:
            sends.send(("", work()))
        except BaseException as error:  # noqa: BLE001
            sends.send((type(error).__name__, str(error)))

    child = context.Process(target=run)
    child.start()
    try:
        assert receives.poll(60), "the child waits for ever"
        found = receives.recv()
        child.join(60)
        assert child.exitcode == 0
        return found
    finally:
        child.kill()
        child.join()


def batch():
    return meissner.Batch(SMALL, SENSOR, meissner.Weights.draw(SMALL, 3))


def test_a_child_computes_all_streams_although_the_parent_has_used_its_threads():
    streams = [make_events(100, seed) for seed in range(8)]
    of = batch()
    expected = of.predict_all(streams)
    for _ in range(2):
        raised, found = in_a_child(lambda: of.predict_all(streams))
        assert raised == ""
        assert np.array_equal(found, expected)
    assert np.array_equal(of.predict_all(streams), expected)


def test_a_child_of_a_child_computes_too():
    streams = [make_events(100, seed) for seed in range(8)]
    of = batch()
    expected = of.predict_all(streams)

    def child():
        of.predict_all(streams)
        return in_a_child(lambda: of.predict_all(streams))

    raised, (raised_inside, found) = in_a_child(child)
    assert (raised, raised_inside) == ("", "")
    assert np.array_equal(found, expected)


def test_a_child_goes_on_with_an_engine_of_two_threads():
    engine = meissner.FrameEngine("event-frame-cnn", two_threads=True)
    frame = np.random.default_rng(0).random(engine.input_shape).astype("f4")
    engine.push(frame)
    engine.predict()

    def goes_on():
        engine.push(0.5 * frame)
        return engine.predict().values

    raised, found = in_a_child(goes_on)
    assert raised == ""
    assert np.array_equal(found, goes_on())


@pytest.fixture
def live(engine):
    with meissner.Live(engine) as live:
        live.push(make_events(50))
        live.predict()
        yield live


@pytest.mark.parametrize(
    "call",
    [
        lambda live: live.predict(),
        lambda live: live.predict(1000),
        lambda live: live.push(make_events(5)),
        lambda live: live.advance(10**6),
        lambda live: live.counters,
        lambda live: live.close(),
    ],
    ids=["predict", "by a deadline", "push", "advance", "counters", "close"],
)
def test_a_child_is_told_that_the_thread_of_a_live_engine_is_in_the_parent(live, call):
    raised, said = in_a_child(lambda: call(live))
    assert raised == "LiveError"
    assert "fork" in said and "spawn" in said
    assert live.predict().fresh


def test_a_child_shows_leaves_and_drops_a_live_engine_of_the_parent(engine):
    lives = [meissner.Live(engine)]

    def drops():
        with lives[0] as live:
            shown = repr(live)
        del live
        lives.clear()
        return shown

    assert in_a_child(drops) == ("", '<Live "small" of another process>')
    lives[0].close()


def test_a_child_makes_a_live_engine_of_its_own(engine):
    events = make_events(50)
    engine.push(events)
    expected = engine.predict().values

    def lives():
        with meissner.Live(engine) as live:
            return live.predict().values

    raised, found = in_a_child(lives)
    assert raised == ""
    assert np.array_equal(found, expected)
