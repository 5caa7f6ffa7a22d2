//! Answers are checked before anything is timed: a fast wrong answer is no figure.

use meissner_engine::{Batch, Engine, Event, Stream};
use meissner_kernels::Neighbour;

/// Asserts that `engine`, which took all of `accepted` since its reset, predicts what the batch does, bit for bit.
///
/// # Panics
/// If it does not.
pub fn engine_equals_batch(engine: &mut Engine, accepted: &[Event]) {
    let batch = Batch::new(engine.network().clone(), engine.sensor()).expect("the sensor has pixels");
    let expected = batch.forward(Stream::new(accepted)).expect("finite").prediction;
    let got = engine.predict().expect("finite").values;
    assert_eq!(bits(got), bits(&expected), "{}: engine and batch differ", engine.network().name());
}

/// Bit patterns of `values`.
pub fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|v| v.to_bits()).collect()
}

/// Asserts that the neighbourhoods of `engine`, which took all of `accepted` since its reset, are the batch's.
///
/// # Panics
/// If one is not.
pub fn neighbourhoods_equal_batch(engine: &Engine, accepted: &[Event]) {
    let batch = Batch::new(engine.network().clone(), engine.sensor()).expect("the sensor has pixels");
    let trace = batch.forward(Stream::new(accepted)).expect("finite");
    let events = &trace.levels[0];
    let first = events.first as u32;
    assert_eq!(engine.nodes(), events.edges.rows() - events.first, "events in the window");
    for index in 0..engine.nodes() {
        // A frozen in-edge outlives its source, which the engine then no longer tells.
        let present = events.edges.row(events.first + index).iter().filter(|n| n.row >= first);
        let expected: Vec<Neighbour> = present.map(|n| Neighbour { row: n.row - first, u: n.u }).collect();
        let got = engine.neighbourhood(index);
        assert_eq!(got, expected, "neighbourhood of event {index}");
    }
}
