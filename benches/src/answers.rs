//! Checks of answers. Every bench compares its answer before it times anything: the time of a wrong answer is no figure.

use std::sync::Arc;

use meissner_engine::{Engine, Event, Network, Options, Search, Sensor};
use meissner_reference::Difference;
use meissner_verify::CheckedEngine;

/// The largest difference of `found` from `expected`, relative to the largest expected magnitude.
pub fn relative_error<'a>(
    expected: impl IntoIterator<Item = &'a f32>,
    found: impl IntoIterator<Item = &'a f32>,
) -> f64 {
    let mut difference = Difference::default();
    for (&expected, &found) in expected.into_iter().zip(found) {
        difference.add(found, expected.into());
    }
    difference.relative()
}

/// An engine that took `events`. Its neighbourhoods, its rows and its prediction have the bits of the batch, which compares
/// all pairs of events.
///
/// # Panics
/// If they do not, or no engine can run `network`.
pub fn checked_engine(network: &Arc<Network>, sensor: Sensor, events: &[Event]) -> Engine {
    let mut checked =
        CheckedEngine::with_options(network.clone(), sensor, Search::Exhaustive, Options::new());
    for &event in events {
        checked.push(event);
    }
    assert_eq!(checked.compare(), Ok(()), "{}: engine and batch differ", network.name());
    checked.engine
}
