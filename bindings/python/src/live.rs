//! Live engines: a bounded queue, a thread that owns the engine, and predictions by a deadline.
//!
//! Input: an engine, events from arrays. Output: predictions with their age. Invariant: no thread
//! waits for a lock while it holds the interpreter lock, except for a lock held for a copy.

mod ends;

use std::sync::Arc;
use std::time::{Duration, Instant};

use meissner::EventCounters;
use meissner::filters::Chain;
use meissner::frames::{Frame, TimedFrames};
use meissner::live::{Overload, QueueCounters, QueueOptions};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use crate::arrays::counts;
use crate::description::Description;
use crate::engine::{Engine, event_counters};
use crate::error::{Failure, Outcome, wrong_type};
use crate::events::{Events, QUEUED};
use crate::filters::Filters;
use crate::frames::{FrameEngine, checked};
use crate::methods::html_table;
use crate::prediction::{Outputs, Timely, timely};
use crate::representations::EventFrame;
use crate::threads::{fork_refused, has_common_threads, turn};
use ends::Ends;

/// An engine in a separate thread, behind a bounded queue: one thread pushes the data of a sensor,
/// another one reads predictions by a deadline.
///
/// - `engine`: an `Engine` or a `FrameEngine`, which stays unchanged.
/// - `overload`: "drop_oldest" makes room for new events, "drop_newest" drops these, and with
///   "block" `push` waits. "thin" accepts one event of `stride`, and `Filters` accept the events
///   that pass them, from when the queue is half full until it is a quarter full.
/// - `capacity`: maximum number of waiting events (16 bytes each) or frames.
/// - `batch`: maximum number of events that the engine takes before it checks whether a prediction
///   is due.
/// - `ahead`: whether the engine computes while it would wait: answers come sooner, but it computes
///   more in total.
///
/// `with Live(engine) as live:` closes it. Predictions have the bits of an engine without threads.
///
/// Raises `InputError`, `LiveError` if no thread can be started.
#[pyclass(module = "meissner", name = "Live", frozen, weakref)]
pub(crate) struct Live {
    ends: Kind,
    outputs: Arc<Outputs>,
    /// The description of the network.
    #[pyo3(get)]
    description: Description,
    /// Shapes of a frame and of a prediction, for frames.
    shapes: Option<[Vec<usize>; 2]>,
    /// Whether its engine shares layers between two threads.
    two_threads: bool,
}

/// The input of the engine.
enum Kind {
    Events(Ends<meissner::Engine>),
    Frames(Ends<TimedFrames>),
}

/// The rule with this name, or these filters.
fn overload_of(overload: &Bound<'_, PyAny>, stride: Option<u32>) -> Outcome<Overload> {
    if let (Ok(filters), None) = (overload.cast::<Filters>(), stride) {
        let chain: Chain = turn(filters)?.chain.clone();
        return Ok(Overload::Filter(chain));
    }
    match (overload.extract::<String>().as_deref(), stride) {
        (Ok("block"), None) => Ok(Overload::Block),
        (Ok("drop_oldest"), None) => Ok(Overload::DropOldest),
        (Ok("drop_newest"), None) => Ok(Overload::DropNewest),
        (Ok("thin"), Some(stride)) => Ok(Overload::Thin { stride }),
        _ => {
            let expected = "\"drop_oldest\", \"drop_newest\", \"block\", Filters, or \"thin\" with a stride";
            let found = overload.repr()?;
            let with = stride.map(|stride| format!(" with stride {stride}")).unwrap_or_default();
            Err(Failure::input(format!("overload: expected {expected}, found {found}{with}")))
        }
    }
}

/// A time to wait; `None` waits without a limit.
fn deadline_of(deadline_us: Option<f64>) -> Outcome<Duration> {
    let Some(us) = deadline_us else { return Ok(Duration::MAX) };
    Duration::try_from_secs_f64(us / 1e6)
        .map_err(|_| Failure::input(format!("deadline_us: expected at least 0 us, found {us}")))
}

impl Live {
    fn counts(&self, py: Python<'_>) -> Outcome<(QueueCounters, EventCounters)> {
        match &self.ends {
            Kind::Events(ends) => ends.counters(py),
            Kind::Frames(ends) => ends.counters(py),
        }
    }

    fn is_here(&self) -> bool {
        match &self.ends {
            Kind::Events(ends) => ends.is_here(),
            Kind::Frames(ends) => ends.is_here(),
        }
    }
}

/// An engine over frames refuses events, and the reverse.
fn other_kind(method: &str, expected: &str) -> Failure {
    Failure::input(format!("{method}: expected an engine over {expected}, found one over the other kind"))
}

#[pymethods]
impl Live {
    #[new]
    #[pyo3(signature = (engine, *, overload=None, capacity=1 << 16, batch=64, stride=None, ahead=false))]
    fn new(
        engine: &Bound<'_, PyAny>,
        overload: Option<&Bound<'_, PyAny>>,
        capacity: usize,
        batch: usize,
        stride: Option<u32>,
        ahead: bool,
    ) -> Outcome<Self> {
        let options = QueueOptions::new().with_capacity(capacity).with_batch(batch).with_ahead(ahead);
        let options = match overload {
            Some(overload) => options.with_overload(overload_of(overload, stride)?),
            None if stride.is_none() => options,
            None => return Err(Failure::input("stride: expected overload=\"thin\" with it")),
        };
        if let Ok(engine) = engine.cast::<Engine>() {
            let engine = turn(engine)?;
            let (outputs, description) = (Arc::clone(&engine.outputs), engine.description.clone());
            let ends = Kind::Events(Ends::new(engine.engine.clone(), options)?);
            return Ok(Self { ends, outputs, description, shapes: None, two_threads: false });
        }
        let Ok(engine) = engine.cast::<FrameEngine>() else {
            return Err(wrong_type("engine", "an Engine or a FrameEngine", engine));
        };
        let engine = turn(engine)?;
        let two_threads = engine.two_threads;
        // Its thread would pass work to the threads of the parent.
        if two_threads && !has_common_threads() {
            return Err(fork_refused("Live of a FrameEngine with two_threads"));
        }
        let shapes = Some(engine.shapes());
        let (outputs, description) = (Arc::clone(&engine.outputs), engine.description.clone());
        let ends = Kind::Frames(Ends::new(TimedFrames::new(engine.engine.clone()), options)?);
        Ok(Self { ends, outputs, description, shapes, two_threads })
    }

    /// Offers events in order, as `Engine.push`: each enters the queue, or is dropped and counted.
    /// Waits only with overload "block". Other threads run meanwhile. One thread at a time.
    ///
    /// Raises `InputError` or `DtypeError` before the first event, `LiveError` if it has ended.
    #[pyo3(signature = (*args, **keywords), text_signature = "($self, events=None, *, t=None, x=None, y=None, p=None)")]
    fn push<'py>(
        &self,
        py: Python<'py>,
        args: &Bound<'py, PyTuple>,
        keywords: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<()> {
        let Kind::Events(ends) = &self.ends else { return Err(other_kind("push", "events")) };
        let events = Events::of_call(args, keywords)?;
        let mut input = ends.input()?;
        let input = &mut *input;
        events.work_in(py, QUEUED, |part| Ok(input.push_slice(part)?))
    }

    /// Offers frames of shape `input_shape`, one with its time in microseconds or several with
    /// their times. A frame earlier than the one before is dropped.
    ///
    /// Raises as `push`.
    fn push_frames(&self, py: Python<'_>, frames: &Bound<'_, PyAny>, t_us: &Bound<'_, PyAny>) -> Outcome<()> {
        let (Kind::Frames(ends), Some([shape, _])) = (&self.ends, &self.shapes) else {
            return Err(other_kind("push_frames", "frames"));
        };
        let times: Vec<i64> = match t_us.extract::<i64>() {
            Ok(t_us) => vec![t_us],
            Err(_) => t_us.try_iter()?.map(|t_us| t_us?.extract()).collect::<PyResult<_>>()?,
        };
        let run = frames.cast::<EventFrame>().map_or(1, |frame| frame.get().count);
        let values = checked(frames, shape)?;
        let values = values.as_slice().map_err(PyErr::from)?;
        let frames = values.chunks_exact(shape.iter().product::<usize>().max(1));
        if frames.len() != times.len() {
            let found = times.len();
            return Err(Failure::input(format!(
                "t_us: expected {} times, one a frame, found {found}",
                frames.len()
            )));
        }
        let mut input = ends.input()?;
        let input = &mut *input;
        for (values, t_us) in frames.zip(times) {
            let frame = Frame { t_us, values: values.to_vec() };
            for _ in 0..run {
                py.detach(|| input.push_slice(std::slice::from_ref(&frame)))?;
                py.check_signals()?;
            }
        }
        Ok(())
    }

    /// Advances the clock to `t_us` after everything offered so far: earlier events will be late.
    fn advance(&self, py: Python<'_>, t_us: i64) -> Outcome<()> {
        match &self.ends {
            Kind::Events(ends) => ends.advance(py, t_us),
            Kind::Frames(ends) => ends.advance(py, t_us),
        }
    }

    /// The prediction for everything offered by now or, `deadline_us` microseconds from now, the
    /// newest finished one, with its age. None waits for everything. Other threads run meanwhile,
    /// and Ctrl-C ends the wait. One thread at a time.
    ///
    /// Raises `NotANumberError` if the newest computation failed, `LiveError` if the live engine
    /// has ended or this process was forked from the process with its thread.
    #[pyo3(signature = (deadline_us=None))]
    fn predict(&self, py: Python<'_>, deadline_us: Option<f64>) -> Outcome<Py<Timely>> {
        // Before the arguments are checked, because the deadline counts from the call.
        let start = Instant::now();
        let deadline = deadline_of(deadline_us)?.saturating_sub(start.elapsed());
        let taken = match &self.ends {
            Kind::Events(ends) => ends.predict(py, deadline),
            Kind::Frames(ends) => ends.predict(py, deadline),
        }?;
        let shape = self.shapes.as_ref().map(|[_, output]| &output[..]);
        timely(py, taken, shape, &self.outputs)
    }

    /// Counts: "offered" is the sum of "delivered", "waiting" and the dropped ones, "high_water" is
    /// the maximum number that has been waiting, and "blocked_us" the time that `push` has waited.
    /// "events" is as in `Engine.counters`, as of the newest prediction or of a later batch.
    #[getter]
    fn counters<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyDict>> {
        let (of, events) = self.counts(py)?;
        let blocked_us = u64::try_from(of.blocked.as_micros()).unwrap_or(u64::MAX);
        let all = [
            ("offered", of.offered),
            ("delivered", of.delivered),
            ("waiting", of.waiting),
            ("dropped_oldest", of.dropped_oldest),
            ("dropped_newest", of.dropped_newest),
            ("thinned", of.thinned),
            ("filtered", of.filtered),
            ("high_water", of.high_water),
            ("blocked_us", blocked_us),
        ];
        let all = counts(py, &all)?;
        all.set_item("events", event_counters(py, events)?)?;
        Ok(all)
    }

    /// Whether `close` was called.
    #[getter]
    fn is_closed(&self) -> bool {
        match &self.ends {
            Kind::Events(ends) => ends.is_closed(),
            Kind::Frames(ends) => ends.is_closed(),
        }
    }

    /// Ends the thread and returns its engine; None if it was closed before. Waiting input is
    /// discarded: call `predict()` first. A `push` or `predict` that waits in another thread raises
    /// `LiveError`. So does `close` in a forked child.
    fn close(&self, py: Python<'_>) -> Outcome<Option<Py<PyAny>>> {
        let Self { outputs, description, two_threads, .. } = self;
        Ok(match &self.ends {
            Kind::Events(ends) => match ends.close(py)? {
                Some(engine) => {
                    let mut engine = Engine::new_from(engine, outputs, description);
                    engine.warn_of_losses(py)?;
                    Some(Py::new(py, engine)?.into_any())
                }
                None => None,
            },
            Kind::Frames(ends) => match ends.close(py)? {
                Some(frames) => {
                    let engine =
                        FrameEngine::new_from(frames.into_engine(), outputs, description, *two_threads)?;
                    Some(Py::new(py, engine)?.into_any())
                }
                None => None,
            },
        })
    }

    fn __enter__(slf: Py<Self>) -> Py<Self> {
        slf
    }

    fn __exit__(
        &self,
        py: Python<'_>,
        _kind: &Bound<'_, PyAny>,
        _value: &Bound<'_, PyAny>,
        _trace: &Bound<'_, PyAny>,
    ) -> Outcome<()> {
        // A forked child that leaves the block has nothing to end.
        if self.is_here() { self.close(py).map(drop) } else { Ok(()) }
    }

    fn _repr_html_(&self, py: Python<'_>) -> Outcome<String> {
        let (of, _) = self.counts(py)?;
        let mut rows = vec![("offered", of.offered), ("delivered", of.delivered), ("waiting", of.waiting)];
        rows.extend(of.dropped_by_reason().into_iter().filter(|(_, count)| *count > 0));
        let rows: Vec<_> =
            rows.into_iter().map(|(name, count)| [name.to_owned(), count.to_string()]).collect();
        Ok(html_table(&format!("Live {:?}", self.description.any.name()), &rows))
    }

    fn __repr__(&self, py: Python<'_>) -> String {
        let name = self.description.any.name();
        let Ok((of, _)) = self.counts(py) else { return format!("<Live {name:?} of another process>") };
        let state = if self.is_closed() { ", closed" } else { "" };
        format!("<Live {name:?}: {} of {} taken, {} dropped{state}>", of.delivered, of.offered, of.dropped())
    }
}
