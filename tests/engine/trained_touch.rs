//! The shipped, trained networks for touch give what `PyTorch` gives with the same weights, at any time what a batch gives, and
//! the right answers.
//!
//! `golden/touch.json` holds streams of spikes made by a formula, and `PyTorch`'s logits at their ends
//! (`models/train/touch/golden.py`).

use meissner_engine::{Batch, Engine, Event, Search, Stream};
use meissner_io::datasets::{EventDataset, NeutouchSet, Split};
use meissner_models::systems::touch::SENSOR;
use meissner_tests::shared::shared;
use meissner_verify::bits;

use crate::trained_digits::{Golden, agree, network, read};

const NETWORKS: [&str; 2] = ["touch-containers", "touch-objects"];

fn golden() -> Golden {
    read(include_str!("../golden/touch.json"))
}

#[test]
fn trained_networks_agree_with_pytorch_in_class_and_logits() {
    let golden = golden();
    assert!(golden.logits.iter().map(|(name, _)| name.as_str()).eq(NETWORKS));
    agree(&golden);
}

#[test]
fn incremental_equals_batch_at_any_time_also_when_spikes_have_left() {
    let Golden { sensor, streams, .. } = golden();
    for name in NETWORKS {
        let batch = Batch::new(network(name), sensor).expect("the sensor has pixels");
        let batch = batch.with_search(Search::Proposed(meissner_reference::PROPOSE));
        let mut engine = Engine::new(network(name), sensor).expect("an engine");
        for events in &streams {
            engine.reset();
            for (i, &event) in events.iter().enumerate() {
                engine.push(event);
                if i % 97 != 0 && i + 1 != events.len() {
                    continue;
                }
                for later_us in [0, 30_000, 4_000_000] {
                    let mut engine = engine.clone();
                    engine.advance(event.t_us + later_us);
                    let window = Stream { now_us: event.t_us + later_us, ..Stream::new(&events[..=i]) };
                    let expected = batch.forward(window).expect("numbers").prediction;
                    let found = engine.predict().expect("numbers").values;
                    assert_eq!(bits(found), bits(&expected), "{name}, spike {i}, {later_us} us later");
                }
            }
        }
        assert!(streams.iter().any(|events| events[events.len() - 1].t_us > 5_000_000));
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_shipped_networks_name_most_of_the_shared_test_recordings() {
    for (name, set, least) in
        [(NETWORKS[0], NeutouchSet::Containers, 10), (NETWORKS[1], NeutouchSet::Objects, 13)]
    {
        let found = EventDataset::neutouch(shared("data/neutouch"), set).expect("the data set");
        let test = found.recordings.iter().filter(|recording| recording.split == Split::Test);
        let mut engine = Engine::new(network(name), SENSOR).expect("an engine");
        let mut answers_right = |events: &[Event], class: usize| {
            engine.reset();
            engine.push_slice(events);
            let values = engine.predict().expect("numbers").values;
            (0..values.len()).all(|other| values[other] <= values[class])
        };
        let chosen: Vec<_> = test.step_by(set.classes() / 5).take(15).collect();
        let right =
            chosen.iter().filter(|recording| answers_right(&recording.events, recording.class)).count();
        assert!(right >= least, "{name}: {right} of {}", chosen.len());
    }
}
