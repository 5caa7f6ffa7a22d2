//! A frame over a sliding window.

use meissner::representations::SlidingSigned;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use super::event_frame::EventFrame;
use super::shared::{Rectangle, counted, crop_of, image, rule_of};
use crate::arrays::Pixels;
use crate::error::{Failure, Outcome};
use crate::events::Events;

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
        &mut self,
        py: Python<'py>,
        args: &Bound<'py, PyTuple>,
        keywords: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<()> {
        let window = &mut self.window;
        Events::of_call(args, keywords)?.each(py, |event| {
            window.push(event);
        })
    }

    /// Advances time to `t_us`: older events leave.
    fn advance(&mut self, t_us: i64) {
        self.window.advance(t_us);
    }

    /// The current frame.
    fn frame(&mut self, py: Python<'_>) -> PyResult<EventFrame> {
        let frame = self.window.frame();
        let values = image(py, frame.values, frame.shape)?.unbind();
        Ok(EventFrame { values, start_us: frame.start_us, events: frame.events, count: 1 })
    }

    /// Forgets time and all events. Counters go on.
    fn reset(&mut self) {
        self.window.reset();
    }

    /// (channels, height, width) of every frame.
    #[getter]
    fn shape(&self) -> (usize, usize, usize) {
        self.window.shape().into()
    }

    /// Counts of the events so far.
    #[getter]
    fn counters<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        counted(py, self.window.counters(), self.window.outside_crop())
    }

    fn __repr__(&self) -> String {
        format!("<SlidingFrame {:?}: {} events>", self.window.shape(), self.window.counters().accepted)
    }
}
