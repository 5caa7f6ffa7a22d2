//! The batch over events: every prediction from scratch.

use std::sync::Arc;

use meissner::{BatchEngine, Event, Search, Stream};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

use crate::arrays::{Pixels, sides, to_array};
use crate::description::Description;
use crate::engine::{counters, late_policy, network_of, restart_policy};
use crate::error::{Failure, Outcome};
use crate::events::Events;
use crate::fork::on_own_threads;
use crate::graph::{self, Graph};
use crate::html;
use crate::prediction::{self, Outputs, Prediction};
use crate::turn::turn;
use crate::warned::Losses;

/// Streams that are computed until signals are handled.
const STREAMS: usize = 16;

/// The same network computed from scratch at every prediction: the oracle of `Engine`, with its methods.
///
/// Predictions equal those of an exact `Engine` bit for bit. `search` "exhaustive" compares all pairs of events and shares
/// nothing with the engine but the kernels; "grid" uses the engine's search, for speed. For a network with frozen in-edges it
/// remembers every event since the last reset. The other arguments are those of `Engine`.
///
/// Raises `DescriptionError`, `WeightsError`, `InputError`.
#[pyclass(module = "meissner", name = "Batch", weakref)]
#[derive(Clone)]
pub(crate) struct Batch {
    batch: BatchEngine,
    outputs: Arc<Outputs>,
    description: Description,
    losses: Losses,
}

#[pymethods]
impl Batch {
    #[new]
    #[pyo3(signature = (network, sensor, weights=None, *, search="exhaustive", late="drop", restart="reset", span_us=None, capacity=None, check_preparation=true))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        network: &Bound<'_, PyAny>,
        sensor: Pixels,
        weights: Option<&Bound<'_, PyAny>>,
        search: &str,
        late: &str,
        restart: &str,
        span_us: Option<i64>,
        capacity: Option<usize>,
        check_preparation: bool,
    ) -> Outcome<Self> {
        let search = match search {
            "exhaustive" => Search::Exhaustive,
            "grid" => Search::Grid,
            found => {
                let expected = "\"exhaustive\" or \"grid\"";
                return Err(Failure::input(format!("search: expected {expected}, found {found:?}")));
            }
        };
        let (description, network) =
            network_of(network, weights, (span_us, capacity), check_preparation, sensor.0)?;
        let outputs = Outputs::new(&description.any, network.layers().into_iter());
        let batch = BatchEngine::new(network, sensor.0)?
            .with_late(late_policy(late)?)
            .with_restart(restart_policy(restart)?)
            .with_search(search);
        Ok(Self { batch, outputs, description, losses: Losses::default() })
    }

    /// Inserts events in order; returns how many were accepted. As `Engine.push`.
    #[pyo3(signature = (*args, **keywords), text_signature = "($self, events=None, *, t=None, x=None, y=None, p=None)")]
    fn push<'py>(
        slf: &Bound<'_, Self>,
        py: Python<'py>,
        args: &Bound<'py, PyTuple>,
        keywords: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<usize> {
        let mut this = turn(slf)?;
        let events = Events::of_call(args, keywords)?;
        let restarts = this.batch.counters().events.restarts;
        let (batch, mut accepted) = (&mut this.batch, 0);
        events.work(py, |part| {
            accepted += batch.push_slice(part);
            Ok(())
        })?;
        if accepted < events.len() || this.batch.counters().events.restarts > restarts {
            let Self { batch, losses, .. } = &mut *this;
            losses.look(py, batch.counters().events, batch.batch().sensor())?;
        }
        Ok(accepted)
    }

    /// Advances the clock to `t_us` without an event. As `Engine.advance`.
    fn advance(slf: &Bound<'_, Self>, t_us: i64) -> Outcome<()> {
        let mut this = turn(slf)?;
        this.batch.advance(t_us);
        Ok(())
    }

    /// Computes every row of every layer. Raises `NotANumberError`.
    fn predict(slf: &Bound<'_, Self>, py: Python<'_>) -> Outcome<Prediction> {
        let mut this = turn(slf)?;
        let Self { batch, outputs, .. } = &mut *this;
        prediction::computed(py, batch, None, outputs)
    }

    /// Writes the prediction to `out`, a writable contiguous array of float32.
    fn predict_into(slf: &Bound<'_, Self>, py: Python<'_>, out: &Bound<'_, PyAny>) -> Outcome<()> {
        let mut this = turn(slf)?;
        let batch = &mut this.batch;
        let out = prediction::out(out, batch.network().outputs())?;
        let values = py.detach(|| batch.predict().map(|prediction| prediction.values.to_vec()))?;
        out.write(&values)
    }

    /// Predictions of independent streams, each an argument of `push`, on all processors: float32 (streams, outputs).
    ///
    /// The state of this batch is neither used nor changed. Events must lie on the sensor, and times must not step back.
    /// Raises `InputError`, `NotANumberError`.
    fn predict_all<'py>(
        slf: &Bound<'_, Self>,
        py: Python<'py>,
        streams: &Bound<'py, PyAny>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let this = turn(slf)?;
        let (batch, outputs) = (this.batch.batch(), this.batch.network().outputs());
        let (mut values, mut taken) = (Vec::new(), Vec::<Vec<Event>>::new());
        let mut run = |taken: &mut Vec<Vec<Event>>| -> Outcome<()> {
            let streams: Vec<Stream<'_>> = taken.iter().map(|events| Stream::new(events)).collect();
            for prediction in py.detach(|| on_own_threads(|| batch.predict_all(&streams)))? {
                values.extend(prediction?);
            }
            taken.clear();
            Ok(py.check_signals()?)
        };
        for stream in streams.try_iter()? {
            taken.push(Events::new(&stream?)?.to_vec_clamped());
            if taken.len() == STREAMS {
                run(&mut taken)?;
            }
        }
        run(&mut taken)?;
        let rows = values.len() / outputs.max(1);
        Ok(PyArray1::from_vec(py, values).reshape([rows, outputs])?.into_any())
    }

    /// Removes all events; the next one sets a new epoch. Counters are kept.
    fn reset(slf: &Bound<'_, Self>) -> Outcome<()> {
        let mut this = turn(slf)?;
        this.batch.reset();
        Ok(())
    }

    /// Counts since the batch was made, as those of `Engine`; every row counts as recomputed.
    #[getter]
    fn counters<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let this = turn(slf)?;
        counters(py, &this.batch.counters(), &this.outputs.layers)
    }

    /// The graph of each level, for PyTorch Geometric: that of the events, then one for each pooling.
    fn graphs<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> Outcome<Bound<'py, PyList>> {
        let this = turn(slf)?;
        let graph = this.batch.batch().graph(this.batch.stream())?;
        Ok(PyList::new(py, graph.levels.iter().map(graph::of_level))?)
    }

    /// The event graph of the window.
    fn graph(slf: &Bound<'_, Self>) -> Outcome<Graph> {
        let this = turn(slf)?;
        let graph = this.batch.batch().graph(this.batch.stream())?;
        Ok(graph::of_level(&graph.levels[0]))
    }

    /// Events of the window as a structured array, from the oldest.
    #[getter]
    fn events<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let this = turn(slf)?;
        to_array(py, graph::last(this.batch.events(), this.batch.nodes()))
    }

    /// Output of each block and pooling for the current window, computed from scratch: arrays (rows, channels) by name.
    fn activations<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> Outcome<Bound<'py, PyDict>> {
        let this = turn(slf)?;
        let batch = &this.batch;
        let trace = py.detach(|| batch.trace())?;
        Ok(graph::activations(py, batch.network(), |level, feature| {
            let of_level = &trace.levels[level];
            let matrix = &of_level.features[feature];
            (of_level.first..matrix.rows()).map(|row| matrix.values(row).collect()).collect()
        })?)
    }

    /// The description of the network.
    #[getter]
    fn description(slf: &Bound<'_, Self>) -> Outcome<Description> {
        let this = turn(slf)?;
        Ok(this.description.clone())
    }

    /// (width, height) of the sensor.
    #[getter]
    fn sensor(slf: &Bound<'_, Self>) -> Outcome<(u16, u16)> {
        let this = turn(slf)?;
        Ok(sides(this.batch.batch().sensor()))
    }

    /// Current time in microseconds; None before the first event.
    #[getter]
    fn now_us(slf: &Bound<'_, Self>) -> Outcome<Option<i64>> {
        let this = turn(slf)?;
        Ok(this.batch.now_us())
    }

    fn __len__(slf: &Bound<'_, Self>) -> Outcome<usize> {
        let this = turn(slf)?;
        Ok(this.batch.nodes())
    }

    #[expect(clippy::unused_self, reason = "the protocol of Python")]
    fn __bool__(&self) -> bool {
        true
    }

    fn __copy__(&self) -> Self {
        self.clone()
    }

    fn __deepcopy__(slf: &Bound<'_, Self>, _memo: &Bound<'_, PyAny>) -> Outcome<Self> {
        let this = turn(slf)?;
        Ok(this.clone())
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> Outcome<String> {
        let this = turn(slf)?;
        let batch = &this.batch;
        let title = format!("Batch {:?} on {}", batch.network().name(), batch.batch().sensor());
        let mut rows = vec![
            ["predicts".to_owned(), this.outputs.labels()],
            ["events in the window".to_owned(), batch.nodes().to_string()],
            ["time".to_owned(), batch.now_us().map_or("none yet".to_owned(), |t_us| format!("{t_us} us"))],
        ];
        rows.extend(html::of_events(batch.counters().events));
        Ok(html::table(&title, &rows))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> Outcome<String> {
        let this = turn(slf)?;
        let (name, sensor, nodes) =
            (this.batch.network().name(), this.batch.batch().sensor(), this.batch.nodes());
        Ok(format!("<Batch {name:?} on {sensor}: {nodes} events, predicts {}>", this.outputs.labels()))
    }
}
