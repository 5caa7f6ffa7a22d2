//! An engine that goes on from bytes has the bits of the one that wrote them: over random networks, streams and
//! interleavings, exactly and with a tolerance.
//!
//! `MEISSNER_CASES` sets the number of cases (1,000 without it).

use std::sync::Arc;

use meissner_engine::{Engine, EngineError, Event, LatePolicy, Options, Snapshot};
use meissner_tests::cases::cases;
use meissner_verify::networks::NetworkShape;
use meissner_verify::{Script, Step, bits, strategies};
use proptest::prelude::*;

fn options() -> impl Strategy<Value = Options> {
    (prop_oneof![Just(0.0f32), Just(0.02), Just(0.3)], any::<bool>()).prop_map(|(tolerance, clamps)| {
        Options::new().with_tolerance(tolerance).with_late(if clamps {
            LatePolicy::Clamp
        } else {
            LatePolicy::Drop
        })
    })
}

/// An engine of a network that is made anew.
fn engine(shape: &NetworkShape, script: &Script, options: Options) -> Engine {
    Engine::with_options(Arc::new(shape.build()), script.sensor, options).expect("admissible")
}

/// Performs a step, unless it reads a prediction.
fn act(engine: &mut Engine, step: &Step) {
    match *step {
        Step::Push(event) => {
            engine.push(event);
        }
        Step::Advance(t_us) => engine.advance(t_us),
        Step::Reset => engine.reset(),
        Step::Predict | Step::Snapshot | Step::Bytes => {}
    }
}

/// Everything that a prediction shows, but for what it cost.
#[derive(Debug, PartialEq)]
struct Shown {
    prediction: Result<(Vec<u32>, Option<i64>, usize), EngineError>,
    events: Vec<meissner_engine::Event>,
    counters: meissner_engine::EventCounters,
    neighbourhoods: Vec<Vec<meissner_kernels::Neighbour>>,
    features: Vec<Vec<Vec<Vec<u32>>>>,
}

fn show(engine: &mut Engine) -> Shown {
    let prediction = engine.predict().map(|p| (bits(p.values), p.t_us, p.nodes));
    let network = Arc::clone(engine.network());
    let rows = |level, feature| engine.feature(level, feature).iter().map(|row| bits(row)).collect();
    let level = |level| (0..network.channels(level).len()).map(|feature| rows(level, feature)).collect();
    Shown {
        prediction,
        events: engine.events(),
        counters: engine.counters().events,
        neighbourhoods: (0..engine.nodes()).map(|i| engine.neighbourhood(i)).collect(),
        features: (0..network.levels()).map(level).collect(),
    }
}

proptest! {
    #![proptest_config(cases(1_000))]

    #[test]
    fn an_engine_that_goes_on_from_bytes_has_the_same_bits(
        shape in strategies::network(),
        script in prop_oneof![7 => strategies::script(120), 1 => strategies::script(700)],
        options in options(),
        cut in 0.0f64..1.0,
    ) {
        let cut = (script.steps.len() as f64 * cut) as usize;
        let mut whole = engine(&shape, &script, options);
        for step in &script.steps[..cut] {
            act(&mut whole, step);
            if matches!(step, Step::Predict | Step::Snapshot) {
                let _ = whole.predict();
            }
        }
        let bytes = whole.to_bytes();
        let mut resumed = engine(&shape, &script, options);
        resumed.restore_bytes(&bytes).expect("its own bytes");
        prop_assert_eq!(&resumed.to_bytes(), &bytes, "what is restored is written as it was");
        for (i, step) in script.steps[cut..].iter().enumerate() {
            act(&mut whole, step);
            act(&mut resumed, step);
            match step {
                Step::Predict => prop_assert_eq!(show(&mut resumed), show(&mut whole), "step {}", cut + i),
                Step::Snapshot => {
                    // What has gone on for a while is written and read again.
                    let bytes = resumed.snapshot().to_bytes();
                    let snapshot = Snapshot::from_bytes(&bytes).expect("bytes of a snapshot");
                    prop_assert_eq!(&snapshot.to_bytes(), &bytes);
                    resumed = engine(&shape, &script, options);
                    resumed.push(Event::new(script.origin_us, 0, 0, true));
                    resumed.restore(&snapshot).expect("its own bytes");
                }
                _ => {}
            }
        }
        prop_assert_eq!(show(&mut resumed), show(&mut whole), "at the end");
    }
}
