//! Filters of events, in front of an engine.

use meissner::filters::{BackgroundActivity, Chain, EventFilter, Filter, RateLimit, Refractory, Stride};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{Pixels, counts, to_array};
use crate::error::Outcome;
use crate::events::Events;
use crate::threads::turn;

/// Filters in series; each gets the events that the filters before it passed. A filter that is None
/// is left out.
///
/// - `stride`: passes the first of every `stride` events.
/// - `rate`: passes at most so many events a second.
/// - `background_us`: passes an event with a neighbouring pixel's event within this time.
/// - `refractory_us`: silences a pixel for this time after each event that passed.
///
/// They run in this order. Raises `InputError`.
#[pyclass(module = "meissner", name = "Filters")]
pub(crate) struct Filters {
    pub(crate) chain: Chain,
}

#[pymethods]
impl Filters {
    #[new]
    #[pyo3(signature = (sensor, *, stride=None, rate=None, background_us=None, refractory_us=None))]
    fn new(
        sensor: Pixels,
        stride: Option<u32>,
        rate: Option<u64>,
        background_us: Option<i64>,
        refractory_us: Option<i64>,
    ) -> Outcome<Self> {
        let mut filters = Vec::new();
        if let Some(n) = stride {
            filters.push(Filter::Stride(Stride::new(n)?));
        }
        if let Some(rate) = rate {
            filters.push(Filter::RateLimit(RateLimit::new(rate)?));
        }
        if let Some(us) = background_us {
            filters.push(Filter::BackgroundActivity(BackgroundActivity::new(sensor.0, us)?));
        }
        if let Some(us) = refractory_us {
            filters.push(Filter::Refractory(Refractory::new(sensor.0, us)?));
        }
        Ok(Self { chain: Chain::new(filters) })
    }

    /// Takes events, as `Engine.push`; returns those that pass, as a structured array. An event
    /// outside the sensor passes the last two; a coordinate beyond 16 bits comes back as 65535.
    #[pyo3(signature = (*args, **keywords), text_signature = "($self, events=None, *, t=None, x=None, y=None, p=None)")]
    fn push<'py>(
        slf: &Bound<'_, Self>,
        py: Python<'py>,
        args: &Bound<'py, PyTuple>,
        keywords: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let mut this = turn(slf)?;
        let (chain, mut passed) = (&mut this.chain, Vec::new());
        Events::of_call(args, keywords)?
            .each(py, |event| passed.extend(Some(event).filter(|_| chain.admit(event))))?;
        Ok(to_array(py, &passed)?)
    }

    /// Forgets all events. Counters are kept.
    fn reset(slf: &Bound<'_, Self>) -> Outcome<()> {
        let mut this = turn(slf)?;
        this.chain.reset();
        Ok(())
    }

    /// Events that passed and that were dropped, by filter.
    #[getter]
    fn counters<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let this = turn(slf)?;
        let dict = PyDict::new(py);
        for filter in this.chain.filters() {
            let of = filter.counters();
            dict.set_item(filter.name(), counts(py, &[("passed", of.passed), ("dropped", of.dropped)])?)?;
        }
        Ok(dict)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> Outcome<String> {
        let this = turn(slf)?;
        let names: Vec<&str> = this.chain.filters().iter().map(EventFilter::name).collect();
        Ok(format!("<Filters {names:?}>"))
    }
}
