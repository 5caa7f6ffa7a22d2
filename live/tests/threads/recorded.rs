//! Real networks: the last prediction has the bits of a batch over the accepted events.

use std::sync::Arc;
use std::time::Duration;

use meissner_engine::filters::{BackgroundActivity, Chain, Filter};
use meissner_engine::{
    BatchEngine, Engine, Event, LatePolicy, Network, Options, Outcome, Places, Search, Sensor,
};
use meissner_live::{Live, Overload, QueueOptions};
use meissner_models::{Description, Weights};

use crate::fake::PATIENCE;

const SENSOR: Sensor = Sensor { width: 64, height: 48 };

fn network(name: &str, capacity: usize) -> Arc<Network> {
    let description = Description::shipped(name).expect("it is shipped");
    let weights = Weights::shipped(name).expect("weights come with it");
    let network = description.network(&weights).expect("they fit");
    Arc::new(network.with_capacity(capacity).expect("the capacity is in range"))
}

/// An engine, and a batch that receives the same events.
fn recorded(network: &Arc<Network>, late: LatePolicy) -> (Engine, BatchEngine) {
    let options = Options::new().with_late(late);
    let engine = Engine::with_options(Arc::clone(network), SENSOR, options).expect("the sensor has pixels");
    let batch = BatchEngine::new(Arc::clone(network), SENSOR).expect("the sensor has pixels");
    (engine, batch.with_late(late).with_bounded_memory())
}

/// `count` events around a moving position, some of them late or outside the sensor.
fn stream(count: u32, seed: u32) -> Vec<Event> {
    let mut state = seed;
    let mut random = |most: u32| {
        state = state.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (state >> 8) % most
    };
    let event = |i: u32| {
        let t_us = 1_000_000 + i64::from(i) * 60 + i64::from(random(200));
        let (x, y) = (i / 50 % 40 + random(25), 10 + random(20));
        Event::new(t_us, x as u16, y as u16, random(2) == 1)
    };
    (0..count).map(event).collect()
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn under_every_policy_the_last_prediction_equals_batch_over_the_accepted_events() {
    let activity = BackgroundActivity::new(SENSOR, 500).expect("500 us is in range");
    let policies = [
        Overload::Block,
        Overload::DropOldest,
        Overload::DropNewest,
        Overload::Thin { stride: 3 },
        Overload::Filter(Chain::new(vec![Filter::BackgroundActivity(activity)])),
    ];
    let network = network("tactigraph-past", 300);
    let events = stream(6000, 1);
    for (overload, ahead) in
        policies.iter().flat_map(|policy| [(policy.clone(), false), (policy.clone(), true)])
    {
        let name = overload.name();
        let options = QueueOptions::new().with_capacity(256).with_overload(overload).with_batch(16);
        let options = options.with_ahead(ahead);
        let (mut input, mut live) =
            Live::spawn(recorded(&network, LatePolicy::Drop), options).expect("options are fine");
        for events in events.chunks(500) {
            input.push_slice(events).expect("the worker lives");
            live.predict(Duration::from_micros(300)).expect("nothing is NaN");
        }
        input.advance(events.iter().map(|event| event.t_us).max().unwrap_or(0) + 7_000);
        let last = live.predict(PATIENCE).expect("nothing is NaN");
        // The stamps jitter, so the engine has dropped some that were late.
        assert!(last.own && last.behind_events == 0, "{name}");
        let (last, nodes) = (bits(last.values), last.nodes);
        let counters = live.counters();
        assert_eq!(counters.delivered, 6000 - counters.dropped(), "{name}");
        let (engine, mut batch) = live.close().expect("the worker lives");
        assert_eq!(engine.counters().events.pushed, counters.delivered, "{name}");
        assert_eq!(engine.nodes(), nodes, "{name}");
        assert_eq!(last, bits(batch.predict().expect("nothing is NaN").values), "{name}");
    }
}

#[test]
fn after_a_restart_of_the_clock_predictions_are_of_the_new_clock_and_say_so() {
    let network = network("tactigraph-past", 300);
    let options = QueueOptions::new().with_capacity(8192);
    let (mut input, mut live) =
        Live::spawn(recorded(&network, LatePolicy::Drop), options).expect("options are fine");
    let block = |start_us: i64| -> Vec<Event> {
        (0..300i64).map(|i| Event::new(start_us + 100 * i, (i % 40) as u16, 12, i % 2 == 0)).collect()
    };
    input.push_slice(&block(60_000_000)).expect("the worker lives");
    assert!(live.predict(PATIENCE).expect("nothing is NaN").fresh);
    // The first events after a restart wait until it is confirmed.
    input.push_slice(&block(0)[..5]).expect("the worker lives");
    input.advance(400);
    let timely = live.predict(PATIENCE).expect("nothing is NaN");
    assert_eq!((timely.fresh, timely.lost_events, timely.restarts), (false, 5, 0));
    input.push_slice(&block(0)[5..]).expect("the worker lives");
    input.advance(29_950);
    let timely = live.predict(PATIENCE).expect("nothing is NaN");
    assert_eq!((timely.fresh, timely.lost_events, timely.restarts), (true, 0, 1));
    assert_eq!((timely.t_us, timely.nodes), (Some(29_900), 300));
    assert_eq!((live.event_counters().restarts, live.event_counters().late), (1, 0));
    // Losses are reported even if held events enter meanwhile.
    let held = Event::new(100_000_000, 5, 5, true);
    input.push_slice(&[held]).expect("the worker lives");
    assert_eq!(live.predict(PATIENCE).expect("nothing is NaN").lost_events, 1);
    input.push_slice(&[held, Event::new(500_000_000, 5, 5, true), held]).expect("the worker lives");
    let timely = live.predict(PATIENCE).expect("nothing is NaN");
    assert_eq!((timely.fresh, timely.lost_events, timely.nodes), (false, 1, 3));
    let values = bits(timely.values);
    let (_, mut batch) = live.close().expect("the worker lives");
    assert_eq!(values, bits(batch.predict().expect("nothing is NaN").values));
}

fn no_neighbours(places: &Places<'_>, tell: &mut dyn FnMut(&[u32])) {
    places.positions.iter().for_each(|_| tell(&[]));
}

#[test]
fn a_batch_never_searches_by_the_engines_grid_unless_asked_to() {
    let new = || BatchEngine::new(network("tactigraph-past", 300), SENSOR).expect("it has pixels");
    assert!(matches!(new().batch().search(), Search::Exhaustive));
    // The proposals alone decide: without neighbours the prediction is another one.
    let predict = |mut batch: BatchEngine| {
        (0..9)
            .for_each(|i| assert_eq!(batch.push(Event::new(i, i as u16, 3, i % 2 == 0)), Outcome::Accepted));
        bits(batch.predict().expect("finite").values)
    };
    assert_ne!(predict(new()), predict(new().with_search(Search::Proposed(no_neighbours))));
}
