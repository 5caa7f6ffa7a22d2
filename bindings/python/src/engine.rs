//! The engine over events.

use std::sync::Arc;

use meissner::{Counters, EventCounters, LatePolicy, Network, Options, RestartPolicy, Sensor, models};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};

use crate::arrays::{Pixels, counts, sides, to_array};
use crate::description::Description;
use crate::error::{Failure, Outcome};
use crate::events::Events;
use crate::graph::{self, Graph};
use crate::methods::{engine_methods, engine_over_events, html_table, rows_of_events};
use crate::prediction::{self, Outputs, Prediction};
use crate::threads::turn;
use crate::warned::{self, Losses};
use crate::weights::Weights;

/// A network over the events of a sliding window: recomputes only what an event changes, and
/// predicts the bits that `Batch` computes from scratch.
///
/// - `network`: as for `Description`; a `Description` too.
/// - `sensor`: (width, height) in pixels.
/// - `weights`: as for `Weights`; None for those that come with the module.
/// - `late`: an event earlier than the newest time is dropped and counted ("drop"), or takes that
///   time ("clamp").
/// - `restart`: when the clock of the sensor restarts, "reset" forgets the events before, "keep"
///   keeps the old clock, for which the events are late. With "reset", events earlier than the
///   window or more than 10 s ahead are held until a restart can be distinguished from a single
///   wrong time.
/// - `tolerance`: largest change of a row that does not propagate; 0 is exact.
/// - `span_us`, `capacity`: replace the length of the window and its maximum number of events.
/// - `memory_limit`: maximum bytes of state; all memory is allocated here.
/// - `check_preparation`: False to run weights that were trained with another preparation.
///
/// An engine serves one thread at a time; others wait for their turn. `copy.copy(engine)` is an
/// independent engine in the same state. `len(engine)` is the number of events in the window.
///
/// Warns (`MeissnerWarning`) if the weights were trained on another sensor, window or preparation,
/// and once for each reason for which more than a hundredth of the events is lost.
///
/// Raises `DescriptionError`, `WeightsError`, `InputError`, `NotIncrementalError` for a network
/// that only `Batch` runs, `MemoryLimitError`.
#[pyclass(module = "meissner", name = "Engine", weakref)]
#[derive(Clone)]
pub(crate) struct Engine {
    pub(crate) engine: meissner::Engine,
    pub(crate) outputs: Arc<Outputs>,
    pub(crate) description: Description,
    values: Vec<f32>,
    losses: Losses,
}

impl Engine {
    pub(crate) fn new_from(
        engine: meissner::Engine,
        outputs: &Arc<Outputs>,
        description: &Description,
    ) -> Self {
        let values = vec![0.0; engine.network().outputs()];
        Self {
            engine,
            outputs: Arc::clone(outputs),
            description: description.clone(),
            values,
            losses: Losses::default(),
        }
    }
}

engine_methods!(Engine);
engine_over_events!(Engine, engine.sensor(), state_bytes);

/// A network over events with its description, from the arguments of a constructor.
pub(crate) fn network_of(
    any: &Bound<'_, PyAny>,
    weights: Option<&Bound<'_, PyAny>>,
    (span_us, capacity): (Option<i64>, Option<usize>),
    check_preparation: bool,
    sensor: Sensor,
) -> Outcome<(Description, Network)> {
    let description = Description::of(any)?;
    let events = description.events()?;
    let weights: models::Weights = Weights::of(weights, &description)?;
    let mut network = if check_preparation {
        events.network(&weights)?
    } else {
        events.network_ignoring_preparation(&weights)?
    };
    if let Some(span_us) = span_us {
        network = network.with_span_us(span_us)?;
    }
    if let Some(capacity) = capacity {
        // Beyond the range of signed numbers, the refusal would state another number.
        if i64::try_from(capacity).is_err() {
            return Err(Failure::input(format!("capacity: expected at most {}, found {capacity}", i64::MAX)));
        }
        network = network.with_capacity(capacity)?;
    }
    let window = (network.parts().span_us, network.parts().capacity);
    warned::of_network(any.py(), &description, &weights, Some(window), Some(sensor))?;
    Ok((description, network))
}

/// The policy of this name.
pub(crate) fn late_policy(name: &str) -> Outcome<LatePolicy> {
    let found = [LatePolicy::Drop, LatePolicy::Clamp].into_iter().find(|policy| policy.name() == name);
    found.ok_or_else(|| Failure::input(format!("late: expected \"drop\" or \"clamp\", found {name:?}")))
}

/// The policy of this name.
pub(crate) fn restart_policy(name: &str) -> Outcome<RestartPolicy> {
    let found = RestartPolicy::ALL.into_iter().find(|policy| policy.name() == name);
    found.ok_or_else(|| Failure::input(format!("restart: expected \"reset\" or \"keep\", found {name:?}")))
}

#[pymethods]
impl Engine {
    #[new]
    #[pyo3(signature = (network, sensor, weights=None, *, late="drop", restart="reset", tolerance=0.0, span_us=None, capacity=None, memory_limit=1 << 32, check_preparation=true))]
    #[expect(clippy::too_many_arguments, reason = "keywords in Python")]
    fn new(
        network: &Bound<'_, PyAny>,
        sensor: Pixels,
        weights: Option<&Bound<'_, PyAny>>,
        late: &str,
        restart: &str,
        tolerance: f32,
        span_us: Option<i64>,
        capacity: Option<usize>,
        memory_limit: u128,
        check_preparation: bool,
    ) -> Outcome<Self> {
        let (description, network) =
            network_of(network, weights, (span_us, capacity), check_preparation, sensor.0)?;
        let options = Options::new()
            .with_late(late_policy(late)?)
            .with_restart(restart_policy(restart)?)
            .with_tolerance(tolerance)
            .with_memory_limit(memory_limit);
        let outputs = Outputs::new(&description.any, network.layers().into_iter());
        let engine = meissner::Engine::with_options(network, sensor.0, options)?;
        Ok(Self::new_from(engine, &outputs, &description))
    }

    /// Writes the prediction to `out`, a writable contiguous float32 array; allocates nothing.
    ///
    /// Raises `InputError`, `DtypeError`, `NotANumberError`.
    fn predict_into(slf: &Bound<'_, Self>, py: Python<'_>, out: &Bound<'_, PyAny>) -> Outcome<()> {
        let mut this = turn(slf)?;
        let Self { engine, values, .. } = &mut *this;
        let out = prediction::out(out, values.len())?;
        py.detach(|| engine.predict().map(|prediction| values.copy_from_slice(prediction.values)))?;
        out.write(values)
    }

    /// The state as bytes, for `restore` in this or another process.
    fn snapshot<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> Outcome<Bound<'py, PyBytes>> {
        let this = turn(slf)?;
        Ok(PyBytes::new(py, &this.engine.to_bytes()))
    }

    /// Returns to the state of `snapshot`, of an engine with the same network, sensor and options.
    ///
    /// Raises `SnapshotError`; the state is then unchanged.
    fn restore(slf: &Bound<'_, Self>, snapshot: &[u8]) -> Outcome<()> {
        let mut this = turn(slf)?;
        Ok(this.engine.restore_bytes(snapshot)?)
    }

    /// The event graph of the window, for PyTorch Geometric.
    fn graph(slf: &Bound<'_, Self>) -> Outcome<Graph> {
        let this = turn(slf)?;
        Ok(graph::of_engine(&this.engine))
    }

    /// Events of the window as a structured array, from the oldest, with their accepted times.
    #[getter]
    fn events<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let this = turn(slf)?;
        to_array(py, &this.engine.events())
    }

    /// Output of each block and pooling as of the last prediction: arrays (rows, channels) by name.
    /// Rows of a pooled level are its cells in the order of t, y, x.
    fn activations<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let this = turn(slf)?;
        graph::activations(py, this.engine.network(), |level, feature| this.engine.feature(level, feature))
    }

    /// Time of the first event since the last reset.
    #[getter]
    fn epoch_us(slf: &Bound<'_, Self>) -> Outcome<Option<i64>> {
        let this = turn(slf)?;
        Ok(this.engine.epoch_us())
    }

    /// Bytes of state, all allocated when the engine was made.
    #[getter]
    fn state_bytes(slf: &Bound<'_, Self>) -> Outcome<u128> {
        let this = turn(slf)?;
        Ok(this.engine.state_bytes())
    }
}

/// Counts of events as a dict.
pub(crate) fn event_counters(py: Python<'_>, of: EventCounters) -> PyResult<Bound<'_, PyDict>> {
    let all = [
        ("pushed", of.pushed),
        ("accepted", of.accepted),
        ("outside_sensor", of.outside_sensor),
        ("late", of.late),
        ("time_out_of_range", of.time_out_of_range),
        ("outliers", of.outliers),
        ("filtered", of.filtered),
        ("clamped", of.clamped),
        ("expired", of.expired),
        ("evicted", of.evicted),
        ("restarts", of.restarts),
    ];
    counts(py, &all)
}

/// Counters as nested dicts.
pub(crate) fn counters<'py>(
    py: Python<'py>,
    of: &Counters,
    layers: &[String],
) -> PyResult<Bound<'py, PyDict>> {
    let predictions = &of.predictions;
    let dict = PyDict::new(py);
    dict.set_item("events", event_counters(py, of.events)?)?;
    let by_layer = PyDict::new(py);
    for (name, layer) in layers.iter().zip(&of.layers) {
        let of_layer = [
            ("recomputed", layer.recomputed),
            ("unchanged", layer.unchanged),
            ("within_tolerance", layer.within_tolerance),
            ("kept", layer.kept),
        ];
        by_layer.set_item(name, counts(py, &of_layer)?)?;
    }
    dict.set_item("layers", by_layer)?;
    dict.set_item(
        "predictions",
        counts(
            py,
            &[
                ("read", predictions.read),
                ("reused", predictions.reused),
                ("cells_recomputed", predictions.cells_recomputed),
                ("cells_unchanged", predictions.cells_unchanged),
                ("neighbourhoods_checked", predictions.neighbourhoods_checked),
                ("neighbourhoods_unchanged", predictions.neighbourhoods_unchanged),
            ],
        )?,
    )?;
    Ok(dict)
}
