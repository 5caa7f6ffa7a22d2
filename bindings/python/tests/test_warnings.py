"""Warnings of the program, and short representations: warnings, and the output in a notebook."""

import warnings

import numpy as np
import pytest
from conftest import SENSOR, SMALL, make_events

import meissner


def warned(work):
    """The texts of the warnings of `work`, each of which is Meissner's and names this file."""
    with warnings.catch_warnings(record=True) as found:
        warnings.simplefilter("always")
        work()
    assert all(each.category is meissner.MeissnerWarning and each.filename == __file__ for each in found)
    return [str(each.message) for each in found]


def make(kind, sensor=SENSOR):
    return kind(SMALL, sensor, meissner.Weights.draw(SMALL, 3))


@pytest.mark.parametrize("kind", [meissner.Engine, meissner.Batch])
def test_a_sensor_that_is_not_that_of_the_weights_is_warned_of(kind):
    (said,) = warned(lambda: kind("tactigraph-past", (640, 480)))
    assert "346x260" in said and "640x480" in said
    assert warned(lambda: kind("tactigraph-past", (346, 260))) == []
    (said,) = warned(lambda: kind("tactigraph-past", (346, 260), span_us=50_000))
    assert "window" in said and "50000 us" in said


def test_weights_of_another_preparation_are_warned_of():
    network = meissner.Description("tactip-past")
    tensors = dict(meissner.Weights.draw(network, 1))
    unstated = meissner.Weights(tensors, metadata={"trained": "true"})
    (said,) = warned(lambda: meissner.Engine(network, SENSOR, unstated))
    assert "do not say how they were prepared" in said
    other = meissner.Weights(tensors, metadata={"trained": "true", "preparation": '{"span_us": 1}'})
    with pytest.raises(meissner.WeightsError):
        meissner.Engine(network, SENSOR, other)
    (said,) = warned(lambda: meissner.Engine(network, SENSOR, other, check_preparation=False))
    assert "another preparation" in said
    frames = meissner.Description("slip-lstm")
    unstated = meissner.Weights(dict(meissner.Weights.draw(frames, 1)), metadata={"trained": "true"})
    (said,) = warned(lambda: meissner.FrameEngine(frames, unstated))
    assert "do not say how they were prepared" in said


@pytest.mark.parametrize("kind", [meissner.Engine, meissner.Batch])
def test_each_reason_for_a_loss_is_warned_of_once(kind):
    engine = make(kind)
    outside, late, good = make_events(100), make_events(100, start_us=10**6), make_events(100, start_us=1_030_000)
    outside["x"][:30] = 5000
    assert warned(lambda: engine.push(good)) == []
    (said,) = warned(lambda: engine.push(late))
    assert "100 of 200 (50.0 %) events are earlier" in said
    assert warned(lambda: engine.push(late)) == []
    outside["t"] += 2 * 10**6
    (said,) = warned(lambda: engine.push(outside))
    assert "30 of 400 (7.5 %) events are outside the sensor of 64x48 pixels" in said
    assert warned(lambda: engine.push(outside)) == []


def test_a_hundredth_is_lost_without_a_word():
    engine, events = make(meissner.Engine), make_events(1000)
    events["y"][500:510] = 48
    assert warned(lambda: engine.push(events)) == []
    assert engine.counters["events"]["outside_sensor"] == 10


def test_the_losses_of_a_live_engine_are_told_when_it_gives_its_engine_back():
    live = meissner.Live(make(meissner.Engine))
    live.push(make_events(100, start_us=1_030_000))
    live.push(make_events(100, start_us=10**6))
    live.predict()
    (said,) = warned(live.close)
    assert "100 of 200 (50.0 %) events are earlier" in said


def test_warnings_as_errors_come_after_the_events():
    engine = make(meissner.Engine)
    engine.push(make_events(100, start_us=1_030_000))
    with warnings.catch_warnings():
        warnings.simplefilter("error", meissner.MeissnerWarning)
        with pytest.raises(meissner.MeissnerWarning, match="earlier"):
            engine.push(make_events(100, start_us=10**6))
        with pytest.raises(meissner.MeissnerWarning, match="sensor"):
            meissner.Engine("tactigraph-past", (640, 480))
    assert engine.counters["events"]["pushed"] == 200


def test_an_evaluation_is_shown_in_a_line_and_as_a_table():
    record = {"network": "digits-past", "of": None, "accuracy": 1 / 3}
    logits = {"digits-past.1": np.zeros((10_000, 10), np.float32)}
    report = {"networks": [{"long": list(range(10_000))}]}
    evaluation = meissner.Evaluation("digits", report, logits, [record] * 50, [record])
    assert repr(evaluation) == "<Evaluation of 'digits': digits-past; 50 records, 1 over time>"
    html = evaluation._repr_html_()
    assert html.count("<tr>") == 41 and "10 more" in html and "<td>0.3333</td>" in html
    pareto = meissner.Pareto("angle", report, [record | {"setting": "<exact>"}])
    assert repr(pareto) == "<Pareto of 'angle': digits-past; 1 settings>"
    assert "<td>&lt;exact&gt;</td>" in pareto._repr_html_()


def test_a_notebook_shows_engines_predictions_and_recordings_as_tables(tmp_path):
    engine, events = make(meissner.Engine), make_events(200)
    events["x"][0] = 600
    engine.push(events)
    html = engine._repr_html_()
    assert html.startswith("<table><caption>Engine &quot;small&quot; on 64x48")
    assert ">199<" in html and "outside the sensor, dropped" in html and "late" not in html
    assert "Batch" in make(meissner.Batch)._repr_html_()
    prediction = engine.predict()
    html = prediction._repr_html_()
    assert all(text in html for text in ("a</th>", "rad</td>", f"{events['t'][-1]} us"))
    with meissner.Live(engine) as live:
        assert "us old" in live.predict()._repr_html_()
        assert "offered" in live._repr_html_()
    np.save(tmp_path / "events.npy", events)
    recording = meissner.open(tmp_path / "events.npy")
    assert "not read yet" in recording._repr_html_()
    assert len(recording) == 200
    assert ">200<" in recording._repr_html_() and "events.npy" in recording._repr_html_()
    frames = meissner.FrameEngine("force-lstm")
    assert "force-lstm" in frames._repr_html_() and "frames since the last reset" in frames._repr_html_()


def test_a_notebook_shows_the_largest_values_of_many():
    names = [f"class {i}" for i in range(30)]
    layers = [*SMALL["layer"][:-1], {"name": "out", "kind": "dense", "outputs": 30}]
    network = {**SMALL, "layer": layers, "output": {"names": names, "unit": "logit"}}
    engine = meissner.Engine(network, SENSOR, meissner.Weights.draw(network, 3))
    prediction = engine.predict()
    html = prediction._repr_html_()
    assert html.count("<tr>") == 21 and "10 more" in html
    assert html.index(names[int(prediction.values.argmax())]) < html.index("10 more")
