//! Graphs and activations as arrays, in the layout of `PyTorch` Geometric.

use meissner::{Event, LevelTrace, Network};
use meissner_evaluate::prepare::graphs_of;
use meissner_evaluate::streams::Streams;
use numpy::{IntoPyArray, PyArray1, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyTuple};

use crate::description::Description;
use crate::error::{Failure, Outcome};
use crate::threads::on_own_threads;

/// A graph of events, or of the cells of a pooling, in the layout of PyTorch Geometric.
#[pyclass(module = "meissner", name = "Graph", frozen)]
pub(crate) struct Graph {
    /// Sources, then targets.
    edges: [Vec<i64>; 2],
    attributes: Vec<f32>,
    features: Vec<f32>,
    channels: usize,
    positions: Vec<f32>,
}

/// The event graph of an engine's window.
pub(crate) fn of_engine(engine: &meissner::Engine) -> Graph {
    let (network, sensor) = (engine.network(), engine.sensor());
    let events = engine.events();
    let mut graph = Graph::empty(network.channels(0)[0], events.len());
    for (target, event) in events.iter().enumerate() {
        for neighbour in engine.neighbourhood(target) {
            graph.edge(neighbour.row.into(), target, neighbour.u);
        }
        graph.features.push(if event.on { 1.0 } else { -1.0 });
        if let Some([x, y]) = network.parts().place {
            graph.features.extend([x.place(event.x, sensor.width), y.place(event.y, sensor.height)]);
        }
        let t = event.t_us.wrapping_sub(events[0].t_us) as f64 / network.parts().span_us as f64;
        let position =
            [f64::from(event.x) / f64::from(sensor.width), f64::from(event.y) / f64::from(sensor.height), t];
        graph.positions.extend(position.map(|p| p as f32));
    }
    graph
}

/// The rows of a level that are in the window, without edges from earlier ones.
pub(crate) fn of_level(trace: &LevelTrace) -> Graph {
    let features = &trace.features[0];
    let rows = features.rows();
    let mut graph = Graph::empty(features.columns(), rows - trace.first);
    let start = trace
        .positions
        .get(trace.first)
        .map_or(0.0, |position| if trace.cells.is_empty() { position[2] } else { 0.0 });
    for row in trace.first..rows {
        for neighbour in trace.edges.row(row) {
            if let Some(source) = (neighbour.row as usize).checked_sub(trace.first) {
                graph.edge(source as i64, row - trace.first, neighbour.u);
            }
        }
        graph.features.extend(features.values(row));
        let [x, y, t] = trace.positions[row];
        graph.positions.extend([x as f32, y as f32, (t - start) as f32]);
    }
    graph
}

impl Graph {
    fn empty(channels: usize, rows: usize) -> Self {
        Self {
            edges: [Vec::new(), Vec::new()],
            attributes: Vec::new(),
            features: Vec::with_capacity(rows * channels),
            channels,
            positions: Vec::with_capacity(rows * 3),
        }
    }

    fn edge(&mut self, source: i64, target: usize, attribute: [f32; 3]) {
        self.edges[0].push(source);
        self.edges[1].push(target as i64);
        self.attributes.extend(attribute);
    }

    fn nodes(&self) -> usize {
        self.positions.len() / 3
    }
}

/// `values` as an array of rows of `columns`.
fn rows<'py, T: numpy::Element + Clone>(
    py: Python<'py>,
    values: &[T],
    columns: usize,
) -> PyResult<Bound<'py, PyAny>> {
    Ok(PyArray1::from_slice(py, values).reshape([values.len() / columns.max(1), columns])?.into_any())
}

#[pymethods]
impl Graph {
    /// (2, edges), int64: the node that is read, then the node that reads it.
    #[getter]
    fn edge_index<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let edges = self.edges.concat();
        Ok(edges.into_pyarray(py).reshape([2, self.edges[0].len()])?.into_any())
    }

    /// (edges, 3), float32 from 0 to 1: clamp((p_j - p_i) / (2 s) + 0.5) along x, y, t with the
    /// scale s of the level.
    #[getter]
    fn edge_attr<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        rows(py, &self.attributes, 3)
    }

    /// (nodes, channels), float32: the input of the level. For events, the polarity, -1 or 1, and
    /// the position in the cell if the network reads it; for cells, the maxima of their members.
    #[getter]
    fn x<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        rows(py, &self.features, self.channels)
    }

    /// (nodes, 3), float32: x / width, y / height, t / span. Time counts from the oldest event of
    /// the window; for cells, from the first event since the last reset.
    #[getter]
    fn pos<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        rows(py, &self.positions, 3)
    }

    /// Number of nodes.
    #[getter]
    fn num_nodes(&self) -> usize {
        self.nodes()
    }

    /// Number of edges.
    #[getter]
    fn num_edges(&self) -> usize {
        self.edges[0].len()
    }

    /// A `torch_geometric.data.Data` with x, edge_index, edge_attr and pos. Needs torch_geometric.
    fn to_pyg<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let tensor = py.import("torch")?.getattr("from_numpy")?;
        let fields = PyDict::new(py);
        fields.set_item("x", tensor.call1((self.x(py)?,))?)?;
        fields.set_item("edge_index", tensor.call1((self.edge_index(py)?,))?)?;
        fields.set_item("edge_attr", tensor.call1((self.edge_attr(py)?,))?)?;
        fields.set_item("pos", tensor.call1((self.pos(py)?,))?)?;
        py.import("torch_geometric.data")?.getattr("Data")?.call((), Some(&fields))
    }

    fn __len__(&self) -> usize {
        self.nodes()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let both = PyTuple::new(py, [self.edge_index(py)?, self.edge_attr(py)?])?;
        Ok(both.try_iter()?.into_any())
    }

    fn __repr__(&self) -> String {
        format!(
            "<Graph: {} nodes of {} channels, {} edges>",
            self.nodes(),
            self.channels,
            self.edges[0].len()
        )
    }
}

/// Output of each layer, by name, from the rows of a feature of a level.
pub(crate) fn activations<'py>(
    py: Python<'py>,
    network: &Network,
    feature: impl Fn(usize, usize) -> Vec<Vec<f32>>,
) -> PyResult<Bound<'py, PyDict>> {
    let (dict, mut names) = (PyDict::new(py), network.layers().into_iter());
    for level in 0..network.levels() {
        // Feature 0 of a level is the output of the pooling that starts it.
        for (i, channels) in network.channels(level).iter().enumerate().skip(usize::from(level == 0)) {
            let values = feature(level, i).concat();
            if let Some(name) = names.next() {
                dict.set_item(name, rows(py, &values, *channels)?)?;
            }
        }
    }
    Ok(dict)
}

/// The last `nodes` of the events of a stream in a batch: those of the window.
pub(crate) fn last(events: &[Event], nodes: usize) -> &[Event] {
    &events[events.len() - nodes..]
}

/// The graphs of `streams`, as `meissner prepare graphs` makes them: the bytes of a safetensors
/// file, from the bytes of another one.
#[pyfunction]
pub(crate) fn _graphs<'py>(
    py: Python<'py>,
    network: &Bound<'py, PyAny>,
    streams: &[u8],
) -> Outcome<Bound<'py, PyBytes>> {
    let description = Description::of(network)?;
    let over_events = description.events()?;
    let made = py.detach(|| {
        let streams = Streams::from_bytes(streams).map_err(|error| Failure::input(error.to_string()))?;
        let prepared = on_own_threads(|| graphs_of(&streams, over_events))??;
        Ok::<_, Failure>(prepared.file.into_bytes())
    })?;
    Ok(PyBytes::new(py, &made))
}
