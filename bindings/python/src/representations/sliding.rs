//! A frame over a sliding window.

use meissner::representations::SlidingSigned;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use super::event_frame::EventFrame;
use super::shared::{Rectangle, counted, crop_of, image, rule_of};
use crate::arrays::Pixels;
use crate::error::{Failure, Outcome};
use crate::events::Events;
use crate::methods::{representation, sliding_representation};
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

sliding_representation!(SlidingFrame, window);

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

    /// The current frame.
    fn frame(slf: &Bound<'_, Self>, py: Python<'_>) -> PyResult<EventFrame> {
        let mut this = turn(slf)?;
        let frame = this.window.frame();
        let values = image(py, frame.values, frame.shape)?.unbind();
        Ok(EventFrame { values, start_us: frame.start_us, events: frame.events, count: 1 })
    }
}
