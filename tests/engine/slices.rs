//! A slice of events has the effect of its events one by one: predictions, rows, counts and whole states, bit for bit.

use meissner_engine::{
    Candidates, Engine, Event, GraphRule, Lifetime, Options, Outcome, Predictor, Reach, Sensor,
};
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape};
use meissner_verify::{Step, strategies};
use proptest::prelude::*;

/// An engine that fills expired rows with NaN, so that a row that is computed too late shows.
fn engine(shape: &NetworkShape, sensor: Sensor) -> Engine {
    let options = Options::new().with_poison(true).with_record_rows(true);
    Engine::with_options(shape.build(), sensor, options).expect("the network is exact")
}

/// The bits of a prediction, or why there is none.
fn predict(engine: &mut Engine) -> Result<Vec<u32>, String> {
    match engine.predict() {
        Ok(prediction) => Ok(prediction.values.iter().map(|value| value.to_bits()).collect()),
        Err(error) => Err(error.to_string()),
    }
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 500, ..ProptestConfig::default() })]

    #[test]
    fn a_stream_may_be_cut_into_slices_anywhere(
        shape in strategies::network(),
        script in prop_oneof![strategies::script(120), strategies::script(700)],
        cuts in prop::collection::vec(1_usize..100, 1..30),
    ) {
        let [mut singly, mut sliced] = [(); 2].map(|()| engine(&shape, script.sensor));
        let (mut waiting, mut cuts, mut pushed) = (Vec::new(), cuts.into_iter().cycle(), 0);
        let mut cut = cuts.next();
        for step in script.steps.iter().chain([&Step::Predict]) {
            if let &Step::Push(event) = step {
                pushed += u64::from(singly.push(event) == Outcome::Accepted);
                waiting.push(event);
                if cut.is_some_and(|cut| waiting.len() < cut) {
                    continue;
                }
                cut = cuts.next();
            }
            // By each way in turn.
            match cut.unwrap_or(0) % 3 {
                0 => {
                    Predictor::push_slice(&mut sliced, &waiting).expect("events are never refused");
                    waiting.clear();
                }
                1 => drop(sliced.push_all(waiting.drain(..))),
                _ => {
                    sliced.push_slice(&waiting);
                    waiting.clear();
                }
            }
            prop_assert_eq!(sliced.counters().events.accepted, pushed);
            match step {
                Step::Push(_) => {}
                &Step::Advance(t_us) => [&mut singly, &mut sliced].into_iter().for_each(|e| e.advance(t_us)),
                Step::Reset => [&mut singly, &mut sliced].into_iter().for_each(Engine::reset),
                Step::Predict | Step::Snapshot | Step::Bytes => {
                    prop_assert_eq!(predict(&mut sliced), predict(&mut singly));
                    prop_assert_eq!(sliced.recomputed(), singly.recomputed());
                }
            }
            prop_assert_eq!(sliced.to_bytes(), singly.to_bytes());
        }
        prop_assert_eq!(sliced.counters(), singly.counters());
    }
}

/// Frozen rows over a window of few events.
fn frozen(capacity: usize, k: usize, blocks: usize) -> NetworkShape {
    let block = |input| BlockShape {
        channels: 3,
        conv: ConvolutionShape::Spline([2; 3]),
        input,
        skip: None,
        extras: [true; 4],
    };
    NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k }, candidates: Candidates::Past(Lifetime::Frozen) },
        span_us: 1_000,
        capacity,
        place: None,
        blocks: (0..blocks).map(block).collect(),
        from: blocks,
        pooled: vec![],
        grid: [2, 2],
        dense: vec![2],
        head: None,
        seed: 5,
    }
}

/// Every event of the slice evicts one that another of the slice reads.
#[test]
fn rows_are_computed_before_what_they_read_is_evicted_or_expires() {
    let sensor = Sensor::new(16, 16);
    for (capacity, k) in [(1, 1), (2, 1), (3, 8), (8, 4), (200, 8)] {
        for apart_us in [0, 40, 400, 5_000] {
            let shape = frozen(capacity, k, 3);
            let [mut singly, mut sliced] = [(); 2].map(|()| engine(&shape, sensor));
            let event =
                |i: i64| Event::new(i * apart_us, (i * 7 % 16) as u16, (i * 5 % 16) as u16, i % 3 == 0);
            let events: Vec<_> = (0..300).map(event).collect();
            for &event in &events {
                singly.push(event);
            }
            assert_eq!(sliced.push_slice(&events), 300);
            assert_eq!(predict(&mut sliced), predict(&mut singly), "{capacity} events, {apart_us} us apart");
            assert!(sliced.to_bytes() == singly.to_bytes(), "{capacity} events, {apart_us} us apart");
        }
    }
}

#[test]
fn an_empty_slice_and_one_of_refused_events_change_nothing_but_counts() {
    let mut engine = engine(&frozen(8, 2, 1), Sensor::new(4, 4));
    engine.push(Event::new(10, 1, 1, true));
    let before = predict(&mut engine);
    assert_eq!(engine.push_slice(&[]), 0);
    assert_eq!(engine.push_slice(&[Event::new(9, 1, 1, true), Event::new(20, 4, 0, true)]), 0);
    assert_eq!(predict(&mut engine), before);
    assert_eq!((engine.counters().events.late, engine.counters().events.outside_sensor), (1, 1));
}
