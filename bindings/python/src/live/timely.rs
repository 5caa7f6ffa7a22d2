//! Predictions with their age.

use std::sync::Arc;

use meissner::live;
use pyo3::prelude::*;

use crate::error::Outcome;
use crate::prediction::{Outputs, Prediction};

/// A prediction that was there by its deadline, with what it covers and how old it is.
#[pyclass(module = "meissner", name = "Timely", extends = Prediction, frozen)]
pub(crate) struct Timely {
    /// Whether it covers every event that had been offered before the call, except those that the queue
    /// dropped: none waits, and the engine has lost none.
    #[pyo3(get)]
    fresh: bool,
    /// Whether it was computed for this call; otherwise it is the newest that was finished by the deadline.
    #[pyo3(get)]
    own: bool,
    /// Events or frames that had entered the queue before the call and are not covered.
    #[pyo3(get)]
    behind_events: u64,
    /// Microseconds of the stream from the last covered event to the last one that had entered the queue.
    #[pyo3(get)]
    behind_us: u64,
    /// Events or frames since the prediction before that the engine was given and that are not in this
    /// one: late, outside the sensor, far ahead, or held until it is clear whether the sensor's clock has
    /// restarted.
    #[pyo3(get)]
    lost_events: u64,
    /// Events or frames that the queue dropped since the prediction before.
    #[pyo3(get)]
    dropped_events: u64,
    /// Restarts of the sensor's clock since the prediction before, each of which reset the engine.
    #[pyo3(get)]
    restarts: u64,
    /// Microseconds from the begin of its computation to the answer.
    #[pyo3(get)]
    age_us: f64,
    /// Microseconds from the call to the answer.
    #[pyo3(get)]
    waited_us: f64,
}

/// What a live engine answered.
pub(super) struct Taken {
    values: Vec<f32>,
    t_us: Option<i64>,
    nodes: usize,
    timely: Timely,
}

impl Taken {
    pub(super) fn new(found: &live::TimedAnswer<'_>) -> Self {
        let timely = Timely {
            fresh: found.fresh,
            own: found.own,
            behind_events: found.behind_events,
            behind_us: found.behind_us,
            lost_events: found.lost_events,
            dropped_events: found.dropped_events,
            restarts: found.restarts,
            age_us: found.age.as_secs_f64() * 1e6,
            waited_us: found.waited.as_secs_f64() * 1e6,
        };
        Self { values: found.values.to_vec(), t_us: found.t_us, nodes: found.nodes, timely }
    }
}

/// The object of `taken`, with values of this shape.
pub(super) fn object(
    py: Python<'_>,
    taken: Taken,
    shape: Option<&[usize]>,
    outputs: &Arc<Outputs>,
) -> Outcome<Py<Timely>> {
    let of = (taken.t_us, taken.nodes as u64);
    let prediction = Prediction::new(py, &taken.values, shape, of, &[], outputs)?;
    Ok(Py::new(py, PyClassInitializer::from(prediction).add_subclass(taken.timely))?)
}

#[pymethods]
impl Timely {
    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let text = slf.as_super().get().text(slf.py())?;
        let of = slf.get();
        let age = of.age_us as u64;
        let covers = if of.fresh {
            "fresh".to_owned()
        } else if of.behind_events == 0 && of.lost_events > 0 {
            format!("{} events lost", of.lost_events)
        } else {
            format!("{} events ({} us) behind", of.behind_events, of.behind_us)
        };
        Ok(format!("<Timely: {text}, {covers}, {age} us old>"))
    }
}
