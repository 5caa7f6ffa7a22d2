//! A frame over a sliding window.

use meissner::representations::SlidingSigned;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use super::event_frame::EventFrame;
use super::shared::{Rectangle, counted, crop_of, image, rule_of};
use crate::arrays::Pixels;
use crate::error::{Failure, Outcome};
use crate::events::Events;
use crate::turn::turn;

/// A frame (1, height, width) over the events of the last `span_us`, which can be read at any time.
///
/// `rule` is "sum" or "latest", as for `EventFrames`. Beyond `capacity` events the oldest leave first.
///
/// Raises `InputError`.
#[pyclass(module = "meissner", name = "SlidingFrame")]
pub(crate) struct SlidingFrame {
    pub(super) window: SlidingSigned,
}

#[pymethods]
impl SlidingFrame {
    #[new]
    #[pyo3(signature = (sensor, span_us, *, rule="sum", crop=None, capacity=SlidingSigned::DEFAULT_CAPACITY))]
    fn new(
        sensor: Pixels,
        span_us: i64,
        rule: &str,
        crop: Option<Rectangle>,
        capacity: usize,
    ) -> Outcome<Self> {
        let rule = rule_of(rule)?
            .ok_or_else(|| Failure::input("rule: expected \"sum\" or \"latest\", found \"counts\""))?;
        let crop = crop_of(crop, sensor.0);
        Ok(Self { window: SlidingSigned::new(sensor.0, crop, rule, span_us, capacity)? })
    }

    /// Takes events, as `Engine.push`.
    #[pyo3(signature = (*args, **keywords), text_signature = "($self, events=None, *, t=None, x=None, y=None, p=None)")]
    fn push<'py>(
        slf: &Bound<'_, Self>,
        py: Python<'py>,
        args: &Bound<'py, PyTuple>,
        keywords: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<()> {
        let mut this = turn(slf)?;
        let window = &mut this.window;
        Events::of_call(args, keywords)?.each(py, |event| {
            window.push(event);
        })
    }

    /// Advances time to `t_us`: older events leave.
    fn advance(slf: &Bound<'_, Self>, t_us: i64) -> Outcome<()> {
        let mut this = turn(slf)?;
        this.window.advance(t_us);
        Ok(())
    }

    /// The current frame.
    fn frame(slf: &Bound<'_, Self>, py: Python<'_>) -> PyResult<EventFrame> {
        let mut this = turn(slf)?;
        let frame = this.window.frame();
        let values = image(py, frame.values, frame.shape)?.unbind();
        Ok(EventFrame { values, start_us: frame.start_us, events: frame.events, count: 1 })
    }

    /// Forgets time and all events. Counters go on.
    fn reset(slf: &Bound<'_, Self>) -> Outcome<()> {
        let mut this = turn(slf)?;
        this.window.reset();
        Ok(())
    }

    /// (channels, height, width) of every frame.
    #[getter]
    fn shape(slf: &Bound<'_, Self>) -> Outcome<(usize, usize, usize)> {
        let this = turn(slf)?;
        Ok(this.window.shape().into())
    }

    /// Counts of the events so far.
    #[getter]
    fn counters<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let this = turn(slf)?;
        counted(py, this.window.counters(), this.window.outside_crop())
    }

    fn __repr__(slf: &Bound<'_, Self>) -> Outcome<String> {
        let this = turn(slf)?;
        Ok(format!("<SlidingFrame {:?}: {} events>", this.window.shape(), this.window.counters().accepted))
    }
}
