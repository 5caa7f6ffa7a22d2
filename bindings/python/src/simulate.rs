//! The simulator: a membrane, markers and a camera; each event has its cause.

mod camera;
mod press;
mod settings;

use meissner_simulator::{CameraSettings, Cause, MarkerScene, MarkerTracks, SimulatedEvent};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Pixels, float32, put};
use crate::error::{Failure, Outcome};
pub(crate) use camera::Camera;
pub(crate) use press::Press;

/// Names of the causes, in the order of their numbers.
pub(crate) fn causes() -> Vec<&'static str> {
    Cause::ALL.iter().map(|cause| cause.name()).collect()
}

/// The dtype of simulated events: t, x, y, p, and the number of the cause.
pub(crate) fn dtype(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    let fields = vec![("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "?"), ("cause", "u1")];
    py.import("numpy")?.getattr("dtype")?.call1((fields,))
}

/// A structured array of simulated events.
fn to_array<'py>(py: Python<'py>, events: &[SimulatedEvent]) -> PyResult<Bound<'py, PyAny>> {
    let mut bytes = Vec::new();
    for simulated in events {
        put(&simulated.event, &mut bytes);
        bytes.push(simulated.cause as u8);
    }
    PyArray1::from_vec(py, bytes).call_method1("view", (dtype(py)?,))
}

/// Events of a camera that sees markers move: `SIMULATED_DTYPE`, in order of time.
///
/// - `t_us`: times in microseconds, ascending: int64 (times,).
/// - `positions`: column and row of each marker in pixels, (times, markers, 2). Markers move along straight lines between the
///   times; (0, 0) is the centre of the pixel in the corner.
/// - `radius`, `edge`: of a marker, in pixels; `marker`, `ground`: shares of the light of a white surface.
/// - the other arguments are those of `Camera`. Thresholds and leak have the values of the scene that the networks for the angle of
///   contact were trained on: `threshold_off` 0.35, `threshold_spread` 0.03, `leak_hz` 0.003.
///
/// Equal arguments give equal events on every machine, those of `meissner simulate markers`. Other threads run meanwhile, and
/// Ctrl-C ends it. Raises `InputError`, `DtypeError`.
#[pyfunction]
#[pyo3(
    signature = (t_us, positions, sensor, *, radius=None, edge=None, marker=None, ground=None, seed=0, ideal=false, **settings),
    text_signature = "(t_us, positions, sensor, *, radius=1.5, edge=1.0, marker=0.5, ground=0.25, seed=0, ideal=False, **settings)"
)]
#[expect(clippy::too_many_arguments, reason = "keywords in Python")]
pub(crate) fn film_markers<'py>(
    py: Python<'py>,
    t_us: Vec<i64>,
    positions: &Bound<'py, PyAny>,
    sensor: Pixels,
    radius: Option<f32>,
    edge: Option<f32>,
    marker: Option<f32>,
    ground: Option<f32>,
    seed: u64,
    ideal: bool,
    settings: Option<&Bound<'py, PyDict>>,
) -> Outcome<Bound<'py, PyAny>> {
    let base = MarkerScene::default();
    let scene = MarkerScene {
        radius: radius.unwrap_or(base.radius),
        edge: edge.unwrap_or(base.edge),
        marker: marker.unwrap_or(base.marker),
        ground: ground.unwrap_or(base.ground),
    };
    let (values, shape) = float32("positions", positions)?;
    let &[times, markers, 2] = &shape[..] else {
        return Err(Failure::input(format!(
            "positions: expected shape (times, markers, 2), found {shape:?}"
        )));
    };
    if times != t_us.len() {
        let found = t_us.len();
        return Err(Failure::input(format!(
            "t_us: expected {times} times, as many as positions, found {found}"
        )));
    }
    let positions = values.chunks_exact(2).map(|place| [place[0], place[1]]).collect();
    let tracks = MarkerTracks::new(t_us, markers, positions)?;
    let settings = settings::of(CameraSettings::tactile(), ideal, settings)?;
    let mut camera = meissner_simulator::Camera::new(sensor.0, settings, seed)?;
    let mut events = Vec::new();
    for interval in 0..tracks.intervals() {
        py.detach(|| tracks.film_interval(interval, &scene, &mut camera, &mut events))?;
        py.check_signals()?;
    }
    camera.finish(&mut events);
    Ok(to_array(py, &events)?)
}
