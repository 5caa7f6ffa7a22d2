//! The batch over events: every prediction from scratch.

use std::sync::Arc;

use meissner::filters::{Chain, EventFilter};
use meissner::{BatchEngine, Event, Search, Stream};
use numpy::{PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyList, PyTuple};

use crate::arrays::{Pixels, sides, to_array};
use crate::description::Description;
use crate::engine::{counters, late_policy, network_of, restart_policy};
use crate::error::{Failure, Outcome};
use crate::events::Events;
use crate::graph::{self, Graph};
use crate::methods::{engine_methods, engine_over_events, html_table, rows_of_events};
use crate::prediction::{self, Outputs, Prediction};
use crate::threads::{on_own_threads, turn};
use crate::warned::Losses;

/// Number of streams that are computed before signals are handled.
const STREAMS: usize = 16;

/// Computes the same network from scratch at every prediction: the oracle of `Engine`, with its
/// methods.
///
/// Predictions equal those of an exact `Engine` bit for bit. `search` "exhaustive" compares all
/// pairs of events; "grid" uses the engine's search, for speed. With frozen in-edges it remembers
/// every event since the last reset. The other arguments are those of `Engine`.
///
/// Raises `DescriptionError`, `WeightsError`, `InputError`.
#[pyclass(module = "meissner", name = "Batch", weakref)]
#[derive(Clone)]
pub(crate) struct Batch {
    engine: BatchEngine,
    outputs: Arc<Outputs>,
    description: Description,
    losses: Losses,
}

engine_methods!(Batch);
engine_over_events!(Batch, engine.batch().sensor());

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
        let engine = BatchEngine::new(network, sensor.0)?
            .with_late(late_policy(late)?)
            .with_restart(restart_policy(restart)?)
            .with_search(search);
        Ok(Self { engine, outputs, description, losses: Losses::default() })
    }

    /// Writes the prediction to `out`, a writable contiguous array of float32.
    fn predict_into(slf: &Bound<'_, Self>, py: Python<'_>, out: &Bound<'_, PyAny>) -> Outcome<()> {
        let mut this = turn(slf)?;
        let batch = &mut this.engine;
        let out = prediction::out(out, batch.network().outputs())?;
        let values = py.detach(|| batch.predict().map(|prediction| prediction.values.to_vec()))?;
        out.write(&values)
    }

    /// Predictions of independent streams, each an argument of `push`: float32 (streams, outputs).
    ///
    /// The state of this batch is neither used nor changed; each stream passes the network's
    /// filters. Events must lie on the sensor, and
    /// times must not step back. Raises `InputError`, `NotANumberError`.
    fn predict_all<'py>(
        slf: &Bound<'_, Self>,
        py: Python<'py>,
        streams: &Bound<'py, PyAny>,
    ) -> Outcome<Bound<'py, PyAny>> {
        let this = turn(slf)?;
        let (batch, outputs) = (this.engine.batch(), this.engine.network().outputs());
        let (mut values, mut taken) = (Vec::new(), Vec::<Vec<Event>>::new());
        let mut run = |taken: &mut Vec<Vec<Event>>| -> Outcome<()> {
            let streams: Vec<Stream<'_>> = taken.iter().map(|events| Stream::new(events)).collect();
            for prediction in py.detach(|| on_own_threads(|| batch.predict_all(&streams)))? {
                values.extend(prediction?);
            }
            taken.clear();
            Ok(py.check_signals()?)
        };
        let mut filters = Chain::of_rules(this.engine.network().filters(), batch.sensor())?;
        for stream in streams.try_iter()? {
            let mut events = Events::new(&stream?)?.to_vec_clamped();
            filters.reset();
            events.retain(|&event| filters.admit(event));
            taken.push(events);
            if taken.len() == STREAMS {
                run(&mut taken)?;
            }
        }
        run(&mut taken)?;
        let rows = values.len() / outputs.max(1);
        Ok(PyArray1::from_vec(py, values).reshape([rows, outputs])?.into_any())
    }

    /// The graph of each level, for PyTorch Geometric: events, then one for each pooling.
    fn graphs<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> Outcome<Bound<'py, PyList>> {
        let this = turn(slf)?;
        let graph = this.engine.batch().graph(this.engine.stream())?;
        Ok(PyList::new(py, graph.levels.iter().map(graph::of_level))?)
    }

    /// The event graph of the window.
    fn graph(slf: &Bound<'_, Self>) -> Outcome<Graph> {
        let this = turn(slf)?;
        let graph = this.engine.batch().graph(this.engine.stream())?;
        Ok(graph::of_level(&graph.levels[0]))
    }

    /// Events of the window as a structured array, from the oldest.
    #[getter]
    fn events<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let this = turn(slf)?;
        to_array(py, graph::last(this.engine.events(), this.engine.nodes()))
    }

    /// Output of each block and pooling for the window, from scratch: (rows, channels) by name.
    fn activations<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> Outcome<Bound<'py, PyDict>> {
        let this = turn(slf)?;
        let batch = &this.engine;
        let trace = py.detach(|| batch.trace())?;
        Ok(graph::activations(py, batch.network(), |level, feature| {
            let of_level = &trace.levels[level];
            let matrix = &of_level.features[feature];
            (of_level.first..matrix.rows()).map(|row| matrix.values(row).collect()).collect()
        })?)
    }
}
