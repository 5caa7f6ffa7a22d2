//! Frames, voxel grids and time surfaces of events, as arrays.

use meissner::frames::FrameShape;
use meissner::models::FrameSource;
use meissner::models::description::frames::SignedTiming;
use meissner::representations::{
    Completed, Consecutive, ConsecutiveFrames, Crop, Decay, EventFrame as Frame, SignedRule, SlidingSigned,
    TimeSurface as Surface, VoxelGrid as Grid, VoxelTime,
};
use meissner::{EventCounters, Sensor};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::{Pixels, as_numpy, counts};
use crate::description::Description;
use crate::error::{Failure, Outcome};
use crate::events::Events;
use crate::methods::{representation, sliding_representation};
use crate::threads::turn;

/// (x, y, width, height).
type Rectangle = (u16, u16, u16, u16);

/// An array of `shape`.
fn image<'py>(py: Python<'py>, values: &[f32], shape: [usize; 3]) -> PyResult<Bound<'py, PyAny>> {
    PyArray1::from_slice(py, values).call_method1("reshape", (shape.to_vec(),))
}

/// The part of a sensor that an argument `crop` names; None for the complete sensor.
fn crop_of(crop: Option<Rectangle>, sensor: Sensor) -> Crop {
    crop.map_or(Crop::whole(sensor), |(x, y, width, height)| Crop::new(x, y, width, height))
}

/// The rule of this name; None for counts.
fn rule_of(rule: &str) -> Outcome<Option<SignedRule>> {
    match rule {
        "counts" => Ok(None),
        "sum" => Ok(Some(SignedRule::Sum)),
        "latest" => Ok(Some(SignedRule::Latest)),
        found => {
            let expected = "\"counts\", \"sum\" or \"latest\"";
            Err(Failure::input(format!("rule: expected {expected}, found {found:?}")))
        }
    }
}

/// Counts of the events of a representation.
fn counted<'py>(py: Python<'py>, of: &EventCounters, outside_crop: u64) -> PyResult<Bound<'py, PyDict>> {
    let all = [
        ("pushed", of.pushed),
        ("accepted", of.accepted),
        ("outside_sensor", of.outside_sensor),
        ("outside_crop", outside_crop),
        ("late", of.late),
        ("time_out_of_range", of.time_out_of_range),
        ("filtered", of.filtered),
        ("expired", of.expired),
        ("evicted", of.evicted),
    ];
    counts(py, &all)
}

/// A frame of events, or a run of equal frames without any.
#[pyclass(module = "meissner", name = "EventFrame", frozen)]
pub(crate) struct EventFrame {
    /// The values: float32 (channels, height, width).
    #[pyo3(get)]
    pub(crate) values: Py<PyAny>,
    /// Begin of the frame's window in microseconds.
    #[pyo3(get)]
    start_us: i64,
    events: [u64; 2],
    /// Number of equal consecutive frames: 1, or the length of a run of frames without events.
    #[pyo3(get)]
    pub(crate) count: u64,
}

impl EventFrame {
    fn of(py: Python<'_>, frame: &Frame<'_>) -> PyResult<Self> {
        let values = image(py, frame.values, frame.shape)?.unbind();
        Ok(Self { values, start_us: frame.start_us, events: frame.events, count: 1 })
    }
}

#[pymethods]
impl EventFrame {
    /// Events inside by polarity: (OFF, ON).
    #[getter]
    fn events(&self) -> (u64, u64) {
        (self.events[0], self.events[1])
    }

    #[pyo3(signature = (dtype=None, copy=None))]
    fn __array__<'py>(
        &self,
        py: Python<'py>,
        dtype: Option<Bound<'py, PyAny>>,
        copy: Option<bool>,
    ) -> PyResult<Bound<'py, PyAny>> {
        as_numpy(self.values.bind(py), dtype, copy)
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let shape = self.values.bind(py).getattr("shape")?;
        let (start, [off, on], count) = (self.start_us, self.events, self.count);
        Ok(format!("<EventFrame {shape} from {start} us: {off} OFF, {on} ON, {count} of them>"))
    }
}

/// Frames over consecutive windows of equal length; events complete them.
///
/// - `rule`: "counts": two channels, the number of OFF and of ON events at a pixel divided by
///   `maximum`; "sum": the sum of polarities -1 and 1; "latest": the polarity of the latest event.
/// - `period_us`: length of a window; `start_us`: begin of the first one, by default the first
///   event.
/// - `crop`: (x, y, width, height) of the pixels; None for all.
///
/// Raises `InputError`.
#[pyclass(module = "meissner", name = "EventFrames")]
pub(crate) struct EventFrames {
    frames: ConsecutiveFrames,
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
        match completed {
            Completed::Frame(Frame { values, start_us, events, .. }) => {
                Self { values: values.to_vec(), start_us, events, count: 1 }
            }
            Completed::Empty(run) => {
                let values = vec![0.0; shape.iter().product()];
                Self { values, start_us: run.start_us, events: [0, 0], count: run.count }
            }
        }
    }
}

/// Frames as objects.
fn objects(py: Python<'_>, found: Vec<Done>, shape: [usize; 3]) -> PyResult<Vec<EventFrame>> {
    let object = |Done { values, start_us, events, count }: Done| {
        Ok(EventFrame { values: image(py, &values, shape)?.unbind(), start_us, events, count })
    };
    found.into_iter().map(object).collect()
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

    /// Takes events, as `Engine.push`; returns the frames that they complete. A silence is one
    /// `EventFrame` of zeros with the number of its frames as `count`.
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
        this.frames.open().map(|frame| EventFrame::of(py, &frame)).transpose()
    }
}

/// A frame (1, height, width) over the events of the last `span_us`, which can be read at any time.
///
/// `rule` is "sum" or "latest". Beyond `capacity` events the oldest leave first.
///
/// Raises `InputError`.
#[pyclass(module = "meissner", name = "SlidingFrame")]
pub(crate) struct SlidingFrame {
    window: SlidingSigned,
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
        EventFrame::of(py, &this.window.frame())
    }
}

/// A time surface (2, height, width), OFF and ON: the age of each pixel's latest event, 1 to 0.
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

/// A voxel grid (bins, height, width): polarities spread over two bins of time each.
///
/// `window_us` is (start, end), both included. `time` maps it to the bins: "bins" as in tonic,
/// where the end is one bin after the last, or "centres", where the end is on the last one. The
/// order of events does not matter.
///
/// Raises `InputError`.
#[pyclass(module = "meissner", name = "VoxelGrid")]
pub(crate) struct VoxelGrid {
    grid: Grid,
}

#[pymethods]
impl VoxelGrid {
    #[new]
    #[pyo3(signature = (sensor, bins, window_us, *, time="bins", crop=None))]
    fn new(
        sensor: Pixels,
        bins: usize,
        window_us: (i64, i64),
        time: &str,
        crop: Option<Rectangle>,
    ) -> Outcome<Self> {
        let time = match time {
            "bins" => VoxelTime::Bins,
            "centres" => VoxelTime::Centres,
            found => {
                return Err(Failure::input(format!(
                    "time: expected \"bins\" or \"centres\", found {found:?}"
                )));
            }
        };
        let crop = crop_of(crop, sensor.0);
        Ok(Self { grid: Grid::new(sensor.0, crop, bins, time, window_us.0..=window_us.1)? })
    }

    /// Adds events, as `Engine.push`; returns the number of events within sensor, crop and window.
    #[pyo3(signature = (*args, **keywords), text_signature = "($self, events=None, *, t=None, x=None, y=None, p=None)")]
    fn push<'py>(
        slf: &Bound<'_, Self>,
        py: Python<'py>,
        args: &Bound<'py, PyTuple>,
        keywords: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<usize> {
        let mut this = turn(slf)?;
        let (grid, mut accepted) = (&mut this.grid, 0);
        Events::of_call(args, keywords)?.each(py, |event| accepted += usize::from(grid.push(event)))?;
        Ok(accepted)
    }

    /// The grid over the events so far: float32 (bins, height, width).
    fn frame<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut this = turn(slf)?;
        let frame = this.grid.frame();
        image(py, frame.values, frame.shape)
    }

    /// Empties the grid and begins another window. Counters are kept.
    fn restart(slf: &Bound<'_, Self>, window_us: (i64, i64)) -> Outcome<()> {
        let mut this = turn(slf)?;
        Ok(this.grid.restart(window_us.0..=window_us.1)?)
    }

    /// Counts of the events so far.
    #[getter]
    fn counters<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let this = turn(slf)?;
        let of = this.grid.counters();
        let all = [
            ("pushed", of.pushed),
            ("accepted", of.accepted),
            ("outside_sensor", of.outside_sensor),
            ("outside_crop", of.outside_crop),
            ("outside_window", of.outside_window),
        ];
        counts(py, &all)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> Outcome<String> {
        let mut this = turn(slf)?;
        let frame = this.grid.frame();
        Ok(format!("<VoxelGrid {:?}: {} events>", frame.shape, frame.events))
    }
}

/// The maker of the frames of events that a network reads: an `EventFrames` or a `SlidingFrame`.
///
/// Raises `InputError` for a network whose frames are not of events, or too small a sensor.
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
    let consecutive = |made: ConsecutiveFrames| {
        let frames = made.with_filters(frames.filters())?;
        Ok(Py::new(py, EventFrames { frames })?.into_any())
    };
    let (FrameSource::EventCounts { place, .. } | FrameSource::Signed { place, .. }) = *frames.source()
    else {
        return Err(of_events());
    };
    let crop = place.crop(width, height, sensor);
    let every = |period_us| Consecutive { period_us, ..Consecutive::new(crop) };
    match *frames.source() {
        FrameSource::EventCounts { period_us, maximum, .. } => {
            consecutive(ConsecutiveFrames::counts(sensor, every(period_us), maximum)?)
        }
        FrameSource::Signed { timing: SignedTiming::Consecutive { period_us }, rule, .. } => {
            consecutive(ConsecutiveFrames::signed(sensor, every(period_us), rule)?)
        }
        FrameSource::Signed { timing: SignedTiming::Sliding { span_us }, rule, .. } => {
            let window = SlidingSigned::new(sensor, crop, rule, span_us, SlidingSigned::DEFAULT_CAPACITY)?;
            let window = window.with_filters(frames.filters())?;
            Ok(Py::new(py, SlidingFrame { window })?.into_any())
        }
        _ => Err(of_events()),
    }
}
