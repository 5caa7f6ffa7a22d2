//! The simulator: a membrane, markers and a camera; each event has its cause.

use meissner_simulator::{
    Camera as CameraModel, CameraSettings, Cause, Dome, DomeView, MarkerScene, MarkerTracks,
    Press as PressModel, SimulatedEvent,
};
use numpy::PyArray1;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{Pixels, float32, put, sides};
use crate::error::{Failure, Outcome};
use crate::threads::turn;

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
/// - `positions`: column and row of each marker in pixels, (times, markers, 2), with straight lines
///   between the times; (0, 0) is the centre of the pixel in the corner.
/// - `radius`, `edge`: of a marker, in pixels; `marker`, `ground`: shares of the light of white.
/// - the others are those of `Camera`, but with `threshold_off` 0.35, `threshold_spread` 0.03 and
///   `leak_hz` 0.003, as in the training of the networks for the angle of contact.
///
/// Equal arguments give equal events on every machine, those of `meissner simulate markers`. Other
/// threads run meanwhile, and Ctrl-C ends it. Raises `InputError`, `DtypeError`.
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
    let settings = settings_of(CameraSettings::tactile(), ideal, settings)?;
    let mut camera = CameraModel::new(sensor.0, settings, seed)?;
    let mut events = Vec::new();
    for interval in 0..tracks.intervals() {
        py.detach(|| tracks.film_interval(interval, &scene, &mut camera, &mut events))?;
        py.check_signals()?;
    }
    camera.finish(&mut events);
    Ok(to_array(py, &events)?)
}

/// The settings `base` or the `ideal` ones, replaced by those of `given`.
fn settings_of(
    base: CameraSettings,
    ideal: bool,
    given: Option<&Bound<'_, PyDict>>,
) -> Outcome<CameraSettings> {
    let mut settings = if ideal { CameraSettings::ideal() } else { base };
    for (name, value) in given.into_iter().flatten() {
        let name: String = name.extract()?;
        let number: &mut f64 = match &*name {
            "lux" => &mut settings.lux,
            "dark_lux" => &mut settings.dark_lux,
            "threshold_on" => &mut settings.threshold_on,
            "threshold_off" => &mut settings.threshold_off,
            "threshold_spread" => &mut settings.threshold_spread,
            "cutoff_hz_per_lux" => &mut settings.cutoff_hz_per_lux,
            "cutoff_max_hz" => &mut settings.cutoff_max_hz,
            "leak_hz" => &mut settings.leak_hz,
            "leak_hz_per_klux" => &mut settings.leak_hz_per_klux,
            "shot_hz" => &mut settings.shot_hz,
            "shot_corner_lux" => &mut settings.shot_corner_lux,
            "hot_share" => &mut settings.hot_share,
            "hot_hz" => &mut settings.hot_hz,
            "refractory_us" => &mut settings.refractory_us,
            "latency_us" => &mut settings.latency_us,
            "jitter_us" => &mut settings.jitter_us,
            "initial_phase" => {
                settings.initial_phase = value.extract()?;
                continue;
            }
            _ => {
                let message =
                    format!("expected a setting of the camera, found {name}: see help(meissner.Camera)");
                return Err(PyTypeError::new_err(message).into());
            }
        };
        *number = value.extract()?;
    }
    Ok(settings)
}

/// A simulated event camera: grey images in, events with their causes out.
///
/// - `sensor`: (width, height) in pixels.
/// - `seed`: of thresholds, phases and noise. Equal arguments give equal events on every machine.
/// - `ideal`: a camera without noise, spread, delay and limit of bandwidth, instead of one in lamp
///   light.
/// - `settings`: `lux` (light of a white surface), `dark_lux`; `threshold_on`, `threshold_off`,
///   `threshold_spread` in units of the natural logarithm; `cutoff_hz_per_lux`, `cutoff_max_hz`;
///   `leak_hz`, `leak_hz_per_klux`; `shot_hz`, `shot_corner_lux`; `hot_share`, `hot_hz`;
///   `refractory_us`, `latency_us`, `jitter_us`; `initial_phase` (bool).
///
/// Raises `InputError`.
#[pyclass(module = "meissner", name = "Camera")]
pub(crate) struct Camera {
    camera: CameraModel,
}

#[pymethods]
impl Camera {
    #[new]
    #[pyo3(signature = (sensor, *, seed=0, ideal=false, **settings))]
    fn new(sensor: Pixels, seed: u64, ideal: bool, settings: Option<&Bound<'_, PyDict>>) -> Outcome<Self> {
        Ok(Self {
            camera: CameraModel::new(
                sensor.0,
                settings_of(CameraSettings::default(), ideal, settings)?,
                seed,
            )?,
        })
    }

    /// Takes the image at `t_us` microseconds; returns the events that are then certain, in order.
    ///
    /// `image` has shape (height, width): shares of the light of a white surface, at least 0.
    /// Between two images the logarithm of the light changes linearly. The first image causes no
    /// events.
    ///
    /// Raises `InputError`, `DtypeError`; the camera is then unchanged.
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

    /// The events that wait for their latency. Events of later images can have earlier stamps.
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

/// Depth of a part of a press in millimetres; signals are handled after each part.
const STEP_MM: f64 = 0.25;

/// A soft dome with markers inside that is pressed on a plane: a thin, quasi-static Yeoh shell.
///
/// - `tilt`, `azimuth`: of the plane, in radians; its normal leans towards `azimuth`, from x to y.
/// - `radius_mm`, `wall_mm`: of the hemisphere; `rings_mm`: diameter of the outermost of the
///   `rings` of markers around the top one; ring k has 6 k markers.
/// - `yeoh_kpa`: the coefficients C10, C20, C30. The default dome is the published one.
///
/// Raises `InputError`.
#[pyclass(module = "meissner", name = "Press")]
pub(crate) struct Press {
    dome: Dome,
    press: PressModel,
}

#[pymethods]
impl Press {
    #[new]
    #[pyo3(signature = (tilt=0.0, azimuth=0.0, *, radius_mm=20.0, wall_mm=4.0, rings_mm=35.0, rings=7, yeoh_kpa=[17.0, -0.2, 0.023]))]
    fn new(
        tilt: f64,
        azimuth: f64,
        radius_mm: f64,
        wall_mm: f64,
        rings_mm: f64,
        rings: usize,
        yeoh_kpa: [f64; 3],
    ) -> Outcome<Self> {
        let refuse = |what: &str, expected: &str, found: f64| {
            Err(Failure::input(format!("{what}: expected {expected}, found {found}")))
        };
        for (what, found) in [("tilt", tilt), ("azimuth", azimuth)] {
            if !found.is_finite() {
                return refuse(what, "a finite angle in radians", found);
            }
        }
        for (what, found) in [("radius_mm", radius_mm), ("wall_mm", wall_mm), ("rings_mm", rings_mm)] {
            if !(found.is_finite() && found > 0.0) {
                return refuse(what, "a finite length above 0 mm", found);
            }
        }
        if rings_mm >= 2.0 * radius_mm {
            return refuse(
                "rings_mm",
                &format!("less than the diameter of {} mm", 2.0 * radius_mm),
                rings_mm,
            );
        }
        if !(1..=30).contains(&rings) {
            return refuse("rings", "1 to 30", rings as f64);
        }
        if !(yeoh_kpa.iter().all(|c| c.is_finite()) && yeoh_kpa[0] > 0.0) {
            return refuse("yeoh_kpa", "finite coefficients, the first above 0", yeoh_kpa[0]);
        }
        let dome = Dome { radius_mm, wall_mm, rings_mm, rings, yeoh_kpa };
        Ok(Self { press: PressModel::new(&dome, tilt, azimuth), dome })
    }

    /// Presses on to `depth_mm` along the axis of the dome; a smaller depth changes nothing. 15 mm
    /// of the default dome take about a second. Other threads run meanwhile, and Ctrl-C ends it
    /// earlier.
    fn press_to(slf: &Bound<'_, Self>, py: Python<'_>, depth_mm: f64) -> Outcome<()> {
        let mut this = turn(slf)?;
        let most = this.dome.radius_mm;
        if !(0.0..=most).contains(&depth_mm) {
            return Err(Failure::input(format!("depth_mm: expected 0 to {most} mm, found {depth_mm}")));
        }
        while this.press.depth_mm() < depth_mm {
            let press = &mut this.press;
            py.detach(|| press.press_to(depth_mm.min(press.depth_mm() + STEP_MM)));
            py.check_signals()?;
        }
        Ok(())
    }

    /// Depth to which the dome is pressed, in millimetres.
    #[getter]
    fn depth_mm(slf: &Bound<'_, Self>) -> Outcome<f64> {
        let this = turn(slf)?;
        Ok(this.press.depth_mm())
    }

    /// The force with which the plane presses the dome along its axis, in newtons.
    #[getter]
    fn force_n(slf: &Bound<'_, Self>) -> Outcome<f64> {
        let this = turn(slf)?;
        Ok(this.press.force_n())
    }

    /// The markers, from the top outwards: float64 (markers, 3), x, y, z in mm above the base.
    #[getter]
    fn markers<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let this = turn(slf)?;
        let markers = this.press.markers();
        PyArray1::from_iter(py, markers.iter().flatten().copied()).call_method1("reshape", (markers.len(), 3))
    }

    /// Positions of the markers for the camera below the base: float32 (markers, 2), column and row
    /// in pixels, for `film_markers`.
    fn positions<'py>(slf: &Bound<'_, Self>, py: Python<'py>, sensor: Pixels) -> PyResult<Bound<'py, PyAny>> {
        let this = turn(slf)?;
        let (view, markers) = (DomeView::new(&this.dome, sensor.0), this.press.markers());
        let seen = markers.iter().flat_map(|&marker| view.place(marker));
        PyArray1::from_iter(py, seen).call_method1("reshape", (markers.len(), 2))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> Outcome<String> {
        let this = turn(slf)?;
        let (depth, force) = (this.press.depth_mm(), this.press.force_n());
        Ok(format!("<Press: {} markers, {depth:.2} mm deep, {force:.2} N>", this.press.markers().len()))
    }
}
