//! Unlikeness of a window to those of a training.

use std::sync::Arc;
use std::time::Duration;

use meissner_engine::{
    BatchEngine, Engine, Event, Network, Sensor, StaleReadout, Staleness, TrainingWindows, WindowStatistics,
};
use meissner_kernels::random::Random;
use meissner_live::{Live, QueueOptions};
use meissner_models::{Description, Weights};

const SENSOR: Sensor = Sensor { width: 346, height: 260 };
const SPAN_US: i64 = 150_000;

fn network() -> Network {
    let (description, weights) =
        (Description::shipped("tactigraph-past"), Weights::shipped("tactigraph-past"));
    description.expect("shipped").network(&weights.expect("shipped")).expect("they fit")
}

/// `count` events within a span, around the middle of the sensor; the part `on` of them is on.
fn window(count: usize, on: f64, seed: u64) -> Vec<Event> {
    let mut random = Random::new(seed);
    let mut times: Vec<i64> = (0..count).map(|_| (random.uniform() * SPAN_US as f64) as i64).collect();
    times.sort_unstable();
    let place = |random: &mut Random, size: u16| {
        (f64::midpoint(random.uniform(), random.uniform()) * f64::from(size)) as u16
    };
    let event = |t_us| {
        let (x, y) = (place(&mut random, SENSOR.width), place(&mut random, SENSOR.height));
        Event::new(t_us, x, y, random.uniform() < on)
    };
    times.into_iter().map(event).collect()
}

/// Windows of 400 to 800 events, half of them on.
fn trained() -> TrainingWindows {
    let features = |seed: u64| {
        let events = window(400 + 2 * seed as usize, 0.5, seed);
        WindowStatistics::of(&events, SENSOR, SPAN_US).features(SENSOR, SPAN_US)
    };
    TrainingWindows::of(&(0..200).map(features).collect::<Vec<_>>()).expect("many windows")
}

fn unlike(events: &[Event]) -> f32 {
    trained().unlikeness(WindowStatistics::of(events, SENSOR, SPAN_US).features(SENSOR, SPAN_US))
}

#[test]
fn windows_of_the_trainings_kind_are_below_one_and_others_far_above() {
    let own: Vec<f32> = (0..40).map(|seed| unlike(&window(600, 0.5, 1_000 + seed))).collect();
    assert!(own.iter().filter(|unlike| **unlike > 1.0).count() <= 1, "{own:?}");
    let hot = |mut events: Vec<Event>| {
        events.extend((0..480).map(|i| Event::new(i * SPAN_US / 480, 170, 130, i % 2 == 0)));
        events.sort_by_key(|event| event.t_us);
        events
    };
    let corner =
        window(600, 0.5, 7).into_iter().map(|event| Event { x: event.x / 4, y: event.y / 4, ..event });
    let late = window(600, 0.5, 7).into_iter().map(|event| Event { t_us: event.t_us / 10, ..event });
    for (what, events) in [
        ("a hot pixel", hot(window(600, 0.5, 7))),
        ("few events", window(60, 0.5, 7)),
        ("many events", window(6_000, 0.5, 7)),
        ("another polarity", window(600, 0.9, 7)),
        ("another place", corner.collect()),
        ("another time", late.collect()),
        ("one event", vec![Event::new(1, 2, 3, true)]),
        ("nothing", Vec::new()),
    ] {
        let unlike = unlike(&events);
        assert!(unlike > 1.5 && unlike.is_finite(), "{what}: {unlike}");
    }
}

#[test]
fn predictions_say_it_and_keep_their_bits() {
    let [known, unknown] = [Some(trained()), None]
        .map(|windows| Engine::new(network().with_training_windows(windows), SENSOR).expect("a sensor"));
    let [mut known, mut unknown] = [known, unknown];
    let mut batch = BatchEngine::new(network().with_training_windows(trained()), SENSOR).expect("a sensor");
    // Longer than the span, so that events expire.
    let events: Vec<Event> = (0..3)
        .flat_map(|part| {
            let later = move |event: Event| Event { t_us: event.t_us + part * SPAN_US, ..event };
            window(300, 0.5, part as u64).into_iter().map(later)
        })
        .collect();
    for part in events.chunks(200) {
        known.push_slice(part);
        unknown.push_slice(part);
        batch.push_slice(part);
        let (found, silent) =
            (known.predict().expect("it predicts"), unknown.predict().expect("it predicts"));
        assert_eq!(found.values, silent.values);
        assert_eq!(silent.unlike, None);
        assert_eq!(found.unlike, batch.unlikeness());
        assert!(found.unlike.is_some_and(|unlike| unlike > 0.0));
    }
    assert_eq!(unknown.window_statistics(), known.window_statistics());
}

#[test]
fn a_live_engine_and_a_stale_readout_say_what_their_engine_says() {
    let engine = || Engine::new(network().with_training_windows(trained()), SENSOR).expect("a sensor");
    let (mut alone, events) = (engine(), window(500, 0.5, 5));
    alone.push_slice(&events);
    let expected = alone.predict().expect("it predicts").unlike;
    assert!(expected.is_some());
    let (mut input, mut live) = Live::spawn(engine(), QueueOptions::new()).expect("in range");
    input.push_slice(&events).expect("the worker lives");
    assert_eq!(live.predict(Duration::MAX).expect("it predicts").unlike, expected);
    let mut stale = StaleReadout::new(engine(), Staleness::new().with_events(1_000)).expect("in range");
    stale.push_slice(&events);
    assert_eq!(stale.predict().expect("it predicts").unlike, expected);
    stale.push(Event::new(SPAN_US, 1, 1, true));
    assert_eq!(stale.predict().expect("it is reused").unlike, expected, "of the prediction that is reused");
}

#[test]
fn states_of_networks_that_do_not_know_their_training_are_restored() {
    let engine = |windows: Option<TrainingWindows>| {
        Engine::new(Arc::new(network().with_training_windows(windows)), SENSOR).expect("a sensor")
    };
    let (mut known, mut unknown) = (engine(Some(trained())), engine(None));
    unknown.push_slice(&window(500, 0.5, 3));
    let expected = unlike(&window(500, 0.5, 3));
    for snapshot in [unknown.snapshot(), known.snapshot()] {
        known.restore(&snapshot).expect("an equal network");
        assert_eq!(
            known.window_statistics(),
            WindowStatistics::of(&known.events(), SENSOR, known.now_us().unwrap_or(0))
        );
    }
    known.restore(&unknown.snapshot()).expect("an equal network");
    known.advance(SPAN_US);
    assert_eq!(known.predict().expect("it predicts").unlike, Some(expected));
    let bytes = unknown.to_bytes();
    known.restore_bytes(&bytes).expect("an equal network");
    known.advance(SPAN_US);
    assert_eq!(known.predict().expect("it predicts").unlike, Some(expected));
    known.reset();
    assert_eq!(known.window_statistics(), WindowStatistics::default());
}

#[test]
fn parts_that_are_no_windows_of_a_training_are_refused() {
    let windows = trained();
    let (mean, factor) = windows.parts();
    assert_eq!(TrainingWindows::from_parts(mean, factor.to_vec()).as_ref(), Some(&windows));
    assert_eq!(TrainingWindows::from_parts(&mean[1..], factor.to_vec()), None);
    assert_eq!(TrainingWindows::from_parts(mean, factor[1..].to_vec()), None);
    for value in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        let mut other = factor.to_vec();
        other[3][3] = value;
        assert_eq!(TrainingWindows::from_parts(mean, other), None);
    }
    let tiny = factor.iter().map(|row| row.iter().map(|value| value * 1e-300).collect()).collect();
    let tiny = TrainingWindows::from_parts(mean, tiny).expect("finite parts");
    assert_eq!(tiny.unlikeness([Some(1e9); 9]), f32::MAX);
    assert_eq!(TrainingWindows::of(&[]), None);
    // Equal windows are like each other, and nothing is divided by zero.
    let same = WindowStatistics::of(&window(100, 0.5, 1), SENSOR, SPAN_US).features(SENSOR, SPAN_US);
    let windows = TrainingWindows::of(&[same; 20]).expect("many windows");
    assert!(windows.unlikeness(same) < 1e-6);
}
