//! Time surfaces.

use meissner::representations::{Decay, TimeSurface as Surface};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use super::shared::{Rectangle, counted, crop_of, image};
use crate::arrays::Pixels;
use crate::error::{Failure, Outcome};
use crate::events::Events;
use crate::methods::{representation, sliding_representation};
use crate::turn::turn;

/// A time surface (2, height, width), OFF and ON: how long ago each pixel last saw an event, as a value from 1 down to 0.
///
/// Give `tau_us` for exp(-age / tau), or `span_us` for max(0, 1 - age / span).
///
/// Raises `InputError`.
#[pyclass(module = "meissner", name = "TimeSurface")]
pub(crate) struct TimeSurface {
    surface: Surface,
}

sliding_representation!(TimeSurface, surface);

#[pymethods]
impl TimeSurface {
    #[new]
    #[pyo3(signature = (sensor, *, tau_us=None, span_us=None, crop=None))]
    fn new(
        sensor: Pixels,
        tau_us: Option<f32>,
        span_us: Option<f32>,
        crop: Option<Rectangle>,
    ) -> Outcome<Self> {
        let decay = match (tau_us, span_us) {
            (Some(tau_us), None) => Decay::Exponential { tau_us },
            (None, Some(span_us)) => Decay::Linear { span_us },
            _ => return Err(Failure::input("decay: expected tau_us or span_us, found both or none")),
        };
        Ok(Self { surface: Surface::new(sensor.0, crop_of(crop, sensor.0), decay)? })
    }

    /// The surface at the current time: float32 (2, height, width).
    fn frame<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut this = turn(slf)?;
        let surface = this.surface.surface();
        image(py, surface.values, surface.shape)
    }
}
