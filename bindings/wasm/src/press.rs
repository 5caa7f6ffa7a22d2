//! The recording that comes with the module: a simulated press of a dome on a tilted plane.

use std::hash::Hasher;

use fnv::FnvHasher;
use meissner_engine::Event;
use meissner_models::{Description, Weights};
use meissner_view::Truth;
use wasm_bindgen::prelude::*;

use crate::recording::Recording;

const EVENTS: &[u8] = include_bytes!("../../../run/assets/dome_press.evt3");
const TRUTH: &str = include_str!("../../../run/assets/dome_press.csv");
/// Its name.
pub(crate) const NAME: &str = "dome_press.evt3 (embedded; simulated, not a real sensor)";

/// The press.
///
/// # Panics
/// Never: the tests read it.
#[wasm_bindgen]
pub fn press() -> Recording {
    Recording::of(EVENTS).expect("the embedded press is readable")
}

/// The truth about it, with times from its first event.
pub(crate) fn truth() -> Truth {
    let mut lines = TRUTH.lines();
    let names = lines.next().unwrap_or_default().split(',').skip(1).map(str::to_owned).collect();
    let row = |line: &str| {
        let mut values = line.split(',').map(|value| value.parse().unwrap_or(f64::NAN));
        (values.next().unwrap_or_default() as i64, values.collect())
    };
    Truth { names, rows: lines.map(row).collect() }
}

/// A hash of the bits of the prediction after each event of the press, of tactigraph-past, in 16
/// hexadecimal digits. It equals `of_press` of the fixed run in every build.
///
/// # Panics
/// Never: the tests run it.
#[wasm_bindgen(js_name = pressHash)]
pub fn press_hash() -> String {
    let (name, recording) = ("tactigraph-past", press());
    let weights = Weights::shipped(name).expect("its weights");
    let network = Description::shipped(name).expect("a shipped network").network(&weights).expect("they fit");
    let mut engine = meissner_engine::Engine::new(network, recording.sensor()).expect("it runs");
    let mut hash = FnvHasher::default();
    let mut take = |event: Event| {
        engine.push(event);
        let prediction = engine.predict().expect("finite values");
        prediction.values.iter().for_each(|value| hash.write(&value.to_bits().to_le_bytes()));
    };
    recording.into_events().into_iter().for_each(&mut take);
    format!("{:016x}", hash.finish())
}
