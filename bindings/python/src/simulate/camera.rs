//! An event camera that takes images.

use meissner_simulator::{Camera as Model, CameraSettings};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use super::{settings, to_array};
use crate::arrays::{Pixels, float32, sides};
use crate::error::{Failure, Outcome};
use crate::turn::turn;

/// A simulated event camera: grey images in, events with their causes out.
///
/// - `sensor`: (width, height) in pixels.
/// - `seed`: of thresholds, phases and noise. Equal images, settings and seeds give equal events on every machine.
/// - `ideal`: a camera without noise, spread, delay and limit of bandwidth, instead of one in lamp light.
/// - `settings`: `lux` (light of a white surface), `dark_lux`; `threshold_on`, `threshold_off`, `threshold_spread` in units of the
///   natural logarithm; `cutoff_hz_per_lux`, `cutoff_max_hz`; `leak_hz`, `leak_hz_per_klux`; `shot_hz`, `shot_corner_lux`;
///   `hot_share`, `hot_hz`; `refractory_us`, `latency_us`, `jitter_us`; `initial_phase` (bool).
///
/// Raises `InputError`.
#[pyclass(module = "meissner", name = "Camera")]
pub(crate) struct Camera {
    camera: Model,
}

#[pymethods]
impl Camera {
    #[new]
    #[pyo3(signature = (sensor, *, seed=0, ideal=false, **settings))]
    fn new(sensor: Pixels, seed: u64, ideal: bool, settings: Option<&Bound<'_, PyDict>>) -> Outcome<Self> {
        Ok(Self {
            camera: Model::new(sensor.0, settings::of(CameraSettings::default(), ideal, settings)?, seed)?,
        })
    }

    /// Takes the image at `t_us` microseconds; returns the events that are certain by then, in order of time.
    ///
    /// `image` has shape (height, width): shares of the light of a white surface, at least 0. Between two images the logarithm
    /// of the light changes linearly, so that fast motion needs many images. The first image causes no events.
    ///
    /// Raises `InputError`, `DtypeError`; the camera is then as it was.
    fn push<'py>(
        slf: &Bound<'_, Self>,
        py: Python<'py>,
        t_us: i64,
        image: &Bound<'py, PyAny>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let mut this = turn(slf)?;
        let (values, shape) = float32("image", image)?;
        let sensor = this.camera.sensor();
        let expected = [usize::from(sensor.height), usize::from(sensor.width)];
        if shape != expected {
            return Err(Failure::input(format!("image: expected shape {expected:?}, found {shape:?}")));
        }
        let (camera, mut events) = (&mut this.camera, Vec::new());
        py.detach(|| camera.push(t_us, &values, &mut events))?;
        Ok(to_array(py, &events)?)
    }

    /// The events that wait for their latency. The camera goes on after it, but a later event can then precede these.
    fn finish<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut this = turn(slf)?;
        let mut events = Vec::new();
        this.camera.finish(&mut events);
        to_array(py, &events)
    }

    /// (width, height) of the sensor.
    #[getter]
    fn sensor(slf: &Bound<'_, Self>) -> Outcome<(u16, u16)> {
        let this = turn(slf)?;
        Ok(sides(this.camera.sensor()))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> Outcome<String> {
        let this = turn(slf)?;
        Ok(format!("<Camera of {}>", this.camera.sensor()))
    }
}
