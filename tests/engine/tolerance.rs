//! Every stored row is within the tolerance of the result from its stored inputs, after any stream.
//!
//! `MEISSNER_CASES` sets the number of cases (1,000 without it).

use meissner_engine::{
    Candidates, Engine, EngineError, Event, GraphRule, Lifetime, Options, Reach, Search, Sensor,
};
use meissner_models::{Description, Weights};
use meissner_tests::cases;
use meissner_tests::within_tolerance;
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape};
use meissner_verify::{CheckedEngine, Random, bits, strategies};
use proptest::prelude::*;

proptest! {
    #![proptest_config(cases(1_000))]

    #[test]
    fn a_stored_row_is_within_the_tolerance_of_what_its_stored_inputs_give(
        shape in strategies::network(),
        script in prop_oneof![7 => strategies::script(120), 1 => strategies::script(500)],
        tolerance in prop_oneof![Just(0.0f32), Just(1e-6), Just(1e-3), Just(0.05), Just(1.0), Just(f32::MAX)],
        poison in any::<bool>(),
    ) {
        let options = Options::new().with_tolerance(tolerance).with_poison(poison);
        let mut checked = CheckedEngine::with_options(shape.build(), script.sensor, Search::Exhaustive, options);
        prop_assert_eq!(checked.run_with(&script, within_tolerance::check), Ok(()));
    }

}

const SENSOR: Sensor = Sensor { width: 100, height: 100 };

/// Two blocks over neighbours within 11 pixels.
fn chain(candidates: Candidates, capacity: usize) -> NetworkShape {
    let block = |input| BlockShape {
        channels: 2,
        conv: ConvolutionShape::Spline([2, 2, 2]),
        input,
        skip: None,
        extras: [false, true, true, true],
    };
    NetworkShape {
        graph: GraphRule { reach: Reach::Radius { r: 0.115, max: 8 }, candidates },
        span_us: 1_000,
        capacity,
        place: Some([(1, 5), (2, 7)]),
        blocks: vec![block(0), block(1)],
        pooled: vec![],
        from: 2,
        grid: [2, 2],
        dense: vec![2],
        head: None,
        seed: 5,
    }
}

fn engine(shape: &NetworkShape, tolerance: f32) -> Engine {
    let options = Options::new().with_tolerance(tolerance).with_record_rows(true);
    Engine::with_options(shape.build(), SENSOR, options).expect("the network is exact")
}

#[test]
fn a_huge_tolerance_keeps_every_row_but_those_that_enter() {
    let mut engine = engine(&chain(Candidates::All, 64), f32::MAX);
    for i in 0..5 {
        engine.push(Event::new(0, 10 * i, 50, true));
    }
    engine.predict().expect("finite");
    assert!(engine.counters().layers.iter().all(|layer| layer.within_tolerance == 0), "all rows were new");
    let before = engine.feature(0, 1);
    engine.push(Event::new(0, 50, 50, false));
    engine.predict().expect("finite");
    // The fourth event gained a neighbour; its row of the first layer does not reach the second.
    assert_eq!(engine.recomputed(), [[4, 5], [4, 5]]);
    assert!(engine.counters().layers.iter().all(|layer| layer.within_tolerance == 1));
    assert_eq!(engine.feature(0, 1)[..5], before);
}

#[test]
fn a_row_that_changes_by_the_tolerance_is_kept_and_one_that_changes_by_more_is_not() {
    let shape = chain(Candidates::All, 64);
    let run = |tolerance| {
        let mut engine = engine(&shape, tolerance);
        for i in 0..5 {
            engine.push(Event::new(0, 10 * i, 50, true));
        }
        engine.predict().expect("finite");
        let before = engine.feature(0, 1);
        engine.push(Event::new(0, 50, 50, false));
        engine.predict().expect("finite");
        let after = engine.feature(0, 1);
        let change = before[4].iter().zip(&after[4]).map(|(a, b)| (a - b).abs()).fold(0.0, f32::max);
        (engine.counters().layers[0].within_tolerance, change)
    };
    let (within, change) = run(0.0);
    assert!(within == 0 && change > 0.0 && change < 1.0, "{within}, {change}");
    assert_eq!(run(change), (1, 0.0));
    assert_eq!(run(change * 0.999), (0, change));
}

#[test]
fn a_row_that_enters_is_stored_whatever_its_slot_held() {
    for capacity in [2, 3] {
        let shape = chain(Candidates::Past(Lifetime::Window), capacity);
        let (mut kept, mut exact) = (engine(&shape, f32::MAX), engine(&shape, 0.0));
        for i in 0..20u16 {
            // Every event evicts one, takes its slot and reads only its predecessor.
            let event = Event::new(i64::from(i), 10 * (i % 8), 50, i % 3 == 0);
            for engine in [&mut kept, &mut exact] {
                engine.push(event);
                engine.predict().expect("finite");
            }
            let newest = |engine: &Engine| engine.feature(0, 1).pop().map(|row| bits(&row));
            assert_eq!(newest(&kept), newest(&exact), "event {i}");
        }
    }
}

#[test]
fn a_tolerance_that_is_negative_or_not_finite_is_refused() {
    for tolerance in [-1e-9, f32::NAN, f32::INFINITY] {
        let options = Options::new().with_tolerance(tolerance);
        let refused = Engine::with_options(chain(Candidates::All, 8).build(), SENSOR, options);
        assert!(matches!(refused, Err(EngineError::Option { what: "tolerance", .. })), "{tolerance}");
    }
    let options = Options::new().with_tolerance(-0.0);
    assert!(Engine::with_options(chain(Candidates::All, 8).build(), SENSOR, options).is_ok());
}

#[test]
fn a_snapshot_of_another_tolerance_is_refused() {
    let network = std::sync::Arc::new(chain(Candidates::All, 8).build());
    let with = |tolerance| {
        let options = Options::new().with_tolerance(tolerance);
        Engine::with_options(std::sync::Arc::clone(&network), SENSOR, options).expect("admissible")
    };
    let (mut engine, other) = (with(0.0), with(0.5));
    let refused = engine.restore(&other.snapshot());
    assert!(matches!(refused, Err(EngineError::Snapshot { what: "tolerance", .. })), "{refused:?}");
    assert_eq!(engine.tolerance(), 0.0);
}

/// Discs that move over the sensor, each event at the edge of one: as steady as a stream can be.
fn discs(events: usize) -> Vec<Event> {
    let mut random = Random::new(11);
    let edge = |i: usize| {
        let t = 40 * i as i64;
        let (disc, phase) = (random.below(12), t as f64 / 1.2e6 + f64::from(random.symmetric()) * 0.01);
        let wave = |x: f64| (x - x.floor() - 0.5).abs() * 4.0 - 1.0;
        let (cx, cy) = (40.0 + 55.0 * (disc % 4) as f64, 35.0 + 55.0 * (disc / 4) as f64);
        let (dx, dy) = (12.0 * wave(phase * 3.0 + 0.1 * disc as f64), 9.0 * wave(phase * 5.0));
        let (a, b) = (f64::from(random.symmetric()) * 7.0, f64::from(random.symmetric()) * 7.0);
        Event::new(t, (cx + dx + a) as u16, (cy + dy + b) as u16, random.below(2) == 0)
    };
    (0..events).map(edge).collect()
}

/// Largest and root mean square difference in each tenth of the stream, and rows kept.
fn drift(network: &str, tolerance: f32) -> ([[f64; 2]; 10], f64) {
    const EVENTS: usize = 50_000;
    const EVERY: usize = 50;
    let description = Description::shipped(network).expect("a shipped network");
    let weights = Weights::shipped(network).expect("shipped weights");
    let network = std::sync::Arc::new(description.network(&weights).expect("the weights fit"));
    let with = |tolerance| {
        let options = Options::new().with_tolerance(tolerance);
        Engine::with_options(std::sync::Arc::clone(&network), Sensor::new(240, 180), options).expect("exact")
    };
    let (mut exact, mut kept) = (with(0.0), with(tolerance));
    let mut tenths = [[0.0f64; 2]; 10];
    for (i, event) in discs(EVENTS).into_iter().enumerate() {
        exact.push(event);
        kept.push(event);
        if i % EVERY == EVERY - 1 {
            let exact = exact.predict().expect("finite").values.to_vec();
            let kept = kept.predict().expect("finite").values;
            let [largest, squares] = &mut tenths[i * 10 / EVENTS];
            for (a, b) in exact.iter().zip(kept) {
                let difference = f64::from((a - b).abs());
                *largest = largest.max(difference);
                *squares += difference * difference;
            }
        }
    }
    let count = (EVENTS / 10 / EVERY * network.outputs()) as f64;
    let layers = kept.counters().layers;
    let sum =
        |count: fn(&meissner_engine::LayerCounters) -> u64| layers.iter().map(count).sum::<u64>() as f64;
    (
        tenths.map(|[largest, squares]| [largest, (squares / count).sqrt()]),
        sum(|layer| layer.within_tolerance) / sum(|layer| layer.recomputed),
    )
}

#[test]
fn the_drift_over_50000_events_does_not_grow() {
    for (network, tolerance) in [("graphres", 1e-3), ("graphres", 1e-2), ("tactigraph-frozen", 1e-2)] {
        let (tenths, share) = drift(network, tolerance);
        println!("{network}, tolerance {tolerance}: {:.1} % of rows kept", share * 100.0);
        for [largest, rms] in tenths {
            println!("  largest {largest:.2e}, rms {rms:.2e}");
        }
        // The first tenth fills the window. A sum of errors would grow sixfold.
        let mean = |tenths: &[[f64; 2]], which: usize| {
            tenths.iter().map(|tenth| tenth[which]).sum::<f64>() / tenths.len() as f64
        };
        for which in [0, 1] {
            let (early, late) = (mean(&tenths[1..4], which), mean(&tenths[7..], which));
            assert!(late <= 2.0 * early, "{network} {tolerance}: {early:e}, then {late:e}");
        }
        assert!(share > 0.0, "{network}");
    }
}
