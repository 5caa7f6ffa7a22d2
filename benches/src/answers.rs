//! Checks of answers. Every bench compares its answer before it times anything: the time of a wrong answer is no figure.

use std::sync::Arc;

use meissner_engine::{Engine, Event, Network, Options, Search, Sensor};
use meissner_kernels::FeatureMap;
use meissner_reference::Difference;
use meissner_verify::CheckedEngine;

/// Distance of values from those expected.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Deviation {
    /// Largest difference, relative to the largest expected magnitude.
    pub max: f64,
    /// Root of the mean squared difference, relative to that of the expected values.
    pub rms: f64,
    /// Largest difference, relative to the root of the mean of the squared expected values.
    pub max_by_rms: f64,
}

impl Deviation {
    /// Of `found` from `expected`, value by value. O(values).
    pub fn between<'a>(
        expected: impl IntoIterator<Item = &'a f32>,
        found: impl IntoIterator<Item = &'a f32>,
    ) -> Self {
        let (mut difference, mut from_zero) = (Difference::default(), Difference::default());
        for (&expected, &found) in expected.into_iter().zip(found) {
            difference.add(found, expected.into());
            from_zero.add(expected, 0.0);
        }
        let Difference { absolute, largest, .. } = difference;
        let rms = from_zero.rms();
        Self { max: absolute / largest, rms: difference.rms() / rms, max_by_rms: absolute / rms }
    }

    /// Of a map from the one expected.
    pub fn between_maps(expected: &FeatureMap, found: &FeatureMap) -> Self {
        let places = || (0..expected.height()).flat_map(|y| (0..expected.width()).map(move |x| (y, x)));
        let values = |map| places().flat_map(move |(y, x)| FeatureMap::pixel(map, y, x));
        Self::between(values(expected), values(found))
    }
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
