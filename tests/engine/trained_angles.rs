//! The shipped, trained networks for contact angles give what `PyTorch` gives with the same weights, and what a batch gives
//! at any time.
//!
//! `golden/angles.json` holds streams of events made by a formula, and `PyTorch`'s values at their ends
//! (`models/train/angle/golden.py`).

use meissner_engine::{Batch, Engine, Search, Stream};
use meissner_verify::bits;

use crate::trained_digits::{Golden, agree, network, read};

/// Event graphs.
const NETWORKS: [&str; 8] = [
    "force-graph",
    "graphres",
    "tactigraph",
    "tactigraph-frozen",
    "tactigraph-past",
    "tactip",
    "tactip-past",
    "tactip-shear",
];
/// These, one that is computed from scratch alone, and a baseline over frames.
const GOLDEN: [&str; 9] = [
    "graphres",
    "graphres-published",
    "tactigraph",
    "tactigraph-frozen",
    "tactigraph-past",
    "tactip",
    "tactip-frames",
    "tactip-past",
    "tactip-shear",
];

fn golden() -> Golden {
    read(include_str!("../golden/angles.json"))
}

#[test]
fn trained_networks_agree_with_pytorch_in_every_value() {
    let golden = golden();
    assert!(golden.logits.iter().map(|(name, _)| name.as_str()).eq(GOLDEN));
    agree(&golden);
}

#[test]
fn places_ages_and_heads_equal_batch_while_events_enter_and_leave() {
    let Golden { sensor, streams, .. } = golden();
    let events = &streams[1];
    for name in NETWORKS {
        let batch = Batch::new(network(name), sensor).expect("the sensor has pixels");
        let batch = batch.with_search(Search::Proposed(meissner_reference::PROPOSE));
        let mut engine = Engine::new(network(name), sensor).expect("an engine");
        for (i, &event) in events.iter().enumerate() {
            engine.push(event);
            if i % 83 != 0 && i + 1 != events.len() {
                continue;
            }
            // Within a cell in time, in the next one, and after most or all of the events have left.
            for later_us in [0, 51_000, 120_000, 230_000, 400_000] {
                let mut engine = engine.clone();
                engine.advance(event.t_us + later_us);
                let window = Stream { now_us: event.t_us + later_us, ..Stream::new(&events[..=i]) };
                let expected = batch.forward(window).expect("numbers").prediction;
                let found = engine.predict().expect("numbers").values;
                assert_eq!(bits(found), bits(&expected), "{name}, event {i}, {later_us} us later");
            }
        }
    }
}
