//! Frames over consecutive windows.

use meissner::representations::{Completed, Consecutive, ConsecutiveFrames};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use super::event_frame::EventFrame;
use super::shared::{Rectangle, counted, crop_of, image, rule_of};
use crate::arrays::Pixels;
use crate::error::Outcome;
use crate::events::Events;
use crate::methods::representation;
use crate::turn::turn;

/// Frames over consecutive windows of equal length, as events complete them.
///
/// - `rule`: "counts": two channels, the number of OFF and of ON events at a pixel divided by `maximum`; "sum": one channel,
///   the sum of polarities -1 and 1; "latest": one channel, the polarity of the latest event.
/// - `period_us`: length of a window; `start_us`: begin of the first one, by default the first event.
/// - `crop`: (x, y, width, height) of the pixels; None for all.
///
/// Raises `InputError`.
#[pyclass(module = "meissner", name = "EventFrames")]
pub(crate) struct EventFrames {
    pub(super) frames: ConsecutiveFrames,
}

/// A completed frame, before it is an object.
struct Done {
    values: Vec<f32>,
    start_us: i64,
    events: [u64; 2],
    count: u64,
}

impl Done {
    fn new(completed: Completed<'_>, shape: [usize; 3]) -> Self {
        let (start_us, events, count) = match completed {
            Completed::Frame(frame) => (frame.start_us, frame.events, 1),
            Completed::Empty(run) => (run.start_us, [0, 0], run.count),
        };
        let values = match completed {
            Completed::Frame(frame) => frame.values.to_vec(),
            Completed::Empty(_) => vec![0.0; shape.iter().product()],
        };
        Self { values, start_us, events, count }
    }

    fn into_object(self, py: Python<'_>, shape: [usize; 3]) -> PyResult<EventFrame> {
        let Self { values, start_us, events, count } = self;
        Ok(EventFrame { values: image(py, &values, shape)?.unbind(), start_us, events, count })
    }
}

/// Frames as objects.
fn objects(py: Python<'_>, found: Vec<Done>, shape: [usize; 3]) -> PyResult<Vec<EventFrame>> {
    found.into_iter().map(|done| done.into_object(py, shape)).collect()
}

representation!(EventFrames, frames);

#[pymethods]
impl EventFrames {
    #[new]
    #[pyo3(signature = (sensor, *, rule="counts", period_us=10_000, maximum=1.0, crop=None, start_us=None))]
    fn new(
        sensor: Pixels,
        rule: &str,
        period_us: i64,
        maximum: f32,
        crop: Option<Rectangle>,
        start_us: Option<i64>,
    ) -> Outcome<Self> {
        let options = Consecutive { crop: crop_of(crop, sensor.0), period_us, start_us };
        let frames = match rule_of(rule)? {
            None => ConsecutiveFrames::counts(sensor.0, options, maximum)?,
            Some(rule) => ConsecutiveFrames::signed(sensor.0, options, rule)?,
        };
        Ok(Self { frames })
    }

    /// Takes events, as `Engine.push`; returns the frames that they complete, in order. A silence is one `EventFrame` of zeros
    /// with the number of its frames as `count`.
    #[pyo3(signature = (*args, **keywords), text_signature = "($self, events=None, *, t=None, x=None, y=None, p=None)")]
    fn push<'py>(
        slf: &Bound<'_, Self>,
        py: Python<'py>,
        args: &Bound<'py, PyTuple>,
        keywords: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<Vec<EventFrame>> {
        let mut this = turn(slf)?;
        let (shape, frames, mut found) = (this.frames.shape(), &mut this.frames, Vec::new());
        Events::of_call(args, keywords)?.each(py, |event| {
            frames.push(event, |completed| found.push(Done::new(completed, shape)));
        })?;
        Ok(objects(py, found, shape)?)
    }

    /// Advances time to `t_us`; returns the frames that this completes.
    fn advance(slf: &Bound<'_, Self>, py: Python<'_>, t_us: i64) -> PyResult<Vec<EventFrame>> {
        let mut this = turn(slf)?;
        let (shape, mut found) = (this.frames.shape(), Vec::new());
        this.frames.advance(t_us, |completed| found.push(Done::new(completed, shape)));
        objects(py, found, shape)
    }

    /// The window that is still open, with its events so far; None if there is no time yet.
    fn open(slf: &Bound<'_, Self>, py: Python<'_>) -> PyResult<Option<EventFrame>> {
        let mut this = turn(slf)?;
        let frame = this.frames.open().map(|frame| {
            let values = image(py, frame.values, frame.shape)?.unbind();
            Ok(EventFrame { values, start_us: frame.start_us, events: frame.events, count: 1 })
        });
        frame.transpose()
    }
}
