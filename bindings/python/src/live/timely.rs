//! Predictions with their age.

use std::sync::Arc;
use std::time::Duration;

use meissner::live;
use pyo3::prelude::*;

use crate::error::Outcome;
use crate::prediction::{Outputs, Prediction};

/// A prediction that was there by its deadline, with what it covers and how old it is.
#[pyclass(module = "meissner", name = "Timely", extends = Prediction, frozen)]
pub(crate) struct Timely {
    taken: Taken,
}

/// What a live engine answered.
pub(super) struct Taken {
    values: Vec<f32>,
    t_us: Option<i64>,
    nodes: usize,
    fresh: bool,
    own: bool,
    behind_events: u64,
    behind_us: u64,
    lost_events: u64,
    dropped_events: u64,
    restarts: u64,
    age: Duration,
    waited: Duration,
}

impl Taken {
    pub(super) fn new(found: &live::Timely<'_>) -> Self {
        Self {
            values: found.values.to_vec(),
            t_us: found.t_us,
            nodes: found.nodes,
            fresh: found.fresh,
            own: found.own,
            behind_events: found.behind_events,
            behind_us: found.behind_us,
            lost_events: found.lost_events,
            dropped_events: found.dropped_events,
            restarts: found.restarts,
            age: found.age,
            waited: found.waited,
        }
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
    Ok(Py::new(py, PyClassInitializer::from(prediction).add_subclass(Timely { taken }))?)
}

#[pymethods]
impl Timely {
    /// Whether it covers every event that had been offered before the call, except those that the queue dropped: none waits, and the
    /// engine has lost none.
    #[getter]
    fn fresh(&self) -> bool {
        self.taken.fresh
    }

    /// Whether it was computed for this call; otherwise it is the newest that was finished by the deadline.
    #[getter]
    fn own(&self) -> bool {
        self.taken.own
    }

    /// Events or frames that had entered the queue before the call and are not covered.
    #[getter]
    fn behind_events(&self) -> u64 {
        self.taken.behind_events
    }

    /// Microseconds of the stream from the last covered event to the last one that had entered the queue.
    #[getter]
    fn behind_us(&self) -> u64 {
        self.taken.behind_us
    }

    /// Events or frames since the prediction before that the engine was given and that are not in this one: late, outside the sensor, far
    /// ahead, or held until it is clear whether the sensor's clock has restarted.
    #[getter]
    fn lost_events(&self) -> u64 {
        self.taken.lost_events
    }

    /// Events or frames that the queue dropped since the prediction before.
    #[getter]
    fn dropped_events(&self) -> u64 {
        self.taken.dropped_events
    }

    /// Restarts of the sensor's clock since the prediction before, each of which reset the engine.
    #[getter]
    fn restarts(&self) -> u64 {
        self.taken.restarts
    }

    /// Microseconds from the begin of its computation to the answer.
    #[getter]
    fn age_us(&self) -> f64 {
        self.taken.age.as_secs_f64() * 1e6
    }

    /// Microseconds from the call to the answer.
    #[getter]
    fn waited_us(&self) -> f64 {
        self.taken.waited.as_secs_f64() * 1e6
    }

    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let text = slf.as_super().get().text(slf.py())?;
        let of = &slf.get().taken;
        let age = of.age.as_micros();
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
