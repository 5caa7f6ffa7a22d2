//! The frames that a network reads.

use meissner::frames::FrameShape;
use meissner::models::FrameSource;
use meissner::models::description::frames::SignedTiming;
use meissner::representations::{Consecutive, ConsecutiveFrames, SlidingSigned};
use pyo3::prelude::*;

use super::consecutive::EventFrames;
use super::sliding::SlidingFrame;
use crate::arrays::Pixels;
use crate::description::Description;
use crate::error::{Failure, Outcome};

/// What makes the frames that a network over frames reads of events, as its description says: an `EventFrames` or a
/// `SlidingFrame`.
///
/// Raises `InputError` for a network whose frames are not made of events, or for a sensor that is smaller than a frame.
#[pyfunction]
pub(crate) fn frames_for(py: Python<'_>, network: &Bound<'_, PyAny>, sensor: Pixels) -> Outcome<Py<PyAny>> {
    let (description, sensor) = (Description::of(network)?, sensor.0);
    let frames = description.frames()?;
    let of_events = || {
        let name = frames.name();
        Failure::input(format!("network {name:?}: expected frames of events, found others"))
    };
    let FrameShape::Image { width, height, .. } = frames.input() else { return Err(of_events()) };
    let side = |side: usize| u16::try_from(side).map_err(|_| of_events());
    let (width, height) = (side(width)?, side(height)?);
    let consecutive = |frames: ConsecutiveFrames| Ok(Py::new(py, EventFrames { frames })?.into_any());
    match *frames.source() {
        FrameSource::EventCounts { period_us, place, maximum } => {
            let crop = place.crop(width, height, sensor);
            let options = Consecutive { period_us, ..Consecutive::new(crop) };
            consecutive(ConsecutiveFrames::counts(sensor, options, maximum)?)
        }
        FrameSource::Signed { timing: SignedTiming::Consecutive { period_us }, place, rule } => {
            let crop = place.crop(width, height, sensor);
            let options = Consecutive { period_us, ..Consecutive::new(crop) };
            consecutive(ConsecutiveFrames::signed(sensor, options, rule)?)
        }
        FrameSource::Signed { timing: SignedTiming::Sliding { span_us }, place, rule } => {
            let crop = place.crop(width, height, sensor);
            let window = SlidingSigned::new(sensor, crop, rule, span_us, SlidingSigned::DEFAULT_CAPACITY)?;
            Ok(Py::new(py, SlidingFrame { window })?.into_any())
        }
        _ => Err(of_events()),
    }
}
