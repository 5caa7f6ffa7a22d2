//! Descriptions of networks: from a name, a file, a text or a dict.

use std::fs;
use std::path::{Path, PathBuf};

use meissner::AnyDescription;
use meissner::frames::FrameShape;
use pyo3::prelude::*;
use pyo3::types::{PyBool, PyDict, PyFloat, PyList, PyMapping, PyString, PyTuple};
use toml::{Table, Value};

use crate::error::{Failure, Outcome, wrong_type};

/// A checked description of a network: its layers and their connections, without weights.
///
/// `network` is the name of a network that comes with the module (`networks()`), the path or the
/// text of a TOML file, or a dict with the same tables, in which `None` means that a key is not
/// set.
///
/// Raises `DescriptionError` with every inconsistency and its line, `FileError`.
#[pyclass(module = "meissner", name = "Description", frozen, from_py_object)]
#[derive(Clone)]
pub(crate) struct Description {
    pub(crate) any: AnyDescription,
    toml: String,
}

impl Description {
    fn shipped(name: &str) -> Option<Self> {
        let toml = AnyDescription::shipped_text(name)?.to_owned();
        Some(Self { any: AnyDescription::shipped(name)?, toml })
    }

    fn parse(toml: String) -> Outcome<Self> {
        Ok(Self { any: AnyDescription::parse(&toml)?, toml })
    }

    fn load(path: &Path) -> Outcome<Self> {
        // `load` limits the size of the file.
        AnyDescription::load(path)?;
        let toml = fs::read_to_string(path).map_err(|error| {
            Failure::Refused("FileError", format!("cannot read {}: {error}", path.display()))
        })?;
        Self::parse(toml)
    }

    /// The description that an argument `network` names.
    pub(crate) fn of(network: &Bound<'_, PyAny>) -> Outcome<Self> {
        if let Ok(description) = network.cast::<Self>() {
            return Ok(description.get().clone());
        }
        if let Ok(text) = network.cast::<PyString>() {
            let text = text.to_string();
            if text.contains('\n') {
                return Self::parse(text);
            }
            if let Some(shipped) = Self::shipped(&text) {
                return Ok(shipped);
            }
            let path = Path::new(&text);
            if path.extension().is_some_and(|e| e.eq_ignore_ascii_case("toml")) || path.is_file() {
                return Self::load(path);
            }
            let names: Vec<&str> = AnyDescription::shipped_names().collect();
            let names = names.join(", ");
            return Err(refused(format!(
                "network: expected {names}, or the path of a .toml file, found {text:?}"
            )));
        }
        if network.hasattr("__fspath__")? {
            return Self::load(&network.extract::<PathBuf>()?);
        }
        if let Ok(tables) = network.cast::<PyMapping>() {
            let text = toml::to_string(&table("network", tables)?)
                .map_err(|error| refused(format!("network: {error}")))?;
            return Self::parse(text);
        }
        Err(wrong_type("network", "a name, a path, a text of TOML, a dict or a Description", network))
    }

    /// The name, if this is a description that comes with the module.
    pub(crate) fn shipped_name(&self) -> Option<&'static str> {
        let name = AnyDescription::shipped_names().find(|name| *name == self.any.name())?;
        (AnyDescription::shipped(name)? == self.any).then_some(name)
    }

    /// The description of a network over events.
    pub(crate) fn events(&self) -> Outcome<&meissner::Description> {
        match &self.any {
            AnyDescription::Events(description) => Ok(description),
            AnyDescription::Frames(_) => Err(self.wrong("events", "frames: FrameEngine")),
        }
    }

    /// The description of a network over frames.
    pub(crate) fn frames(&self) -> Outcome<&meissner::FrameDescription> {
        match &self.any {
            AnyDescription::Frames(description) => Ok(description),
            AnyDescription::Events(_) => Err(self.wrong("frames", "events: Engine")),
        }
    }

    fn wrong(&self, expected: &str, found: &str) -> Failure {
        let name = self.any.name();
        refused(format!(
            "network {name:?}: expected a network over {expected}, found one over {found} runs it"
        ))
    }
}

/// A refusal without a list of problems.
fn refused(message: String) -> Failure {
    Failure::Description(message, Vec::new())
}

#[pymethods]
impl Description {
    #[new]
    fn new(network: &Bound<'_, PyAny>) -> Outcome<Self> {
        Self::of(network)
    }

    /// Name of the network.
    #[getter]
    fn name(&self) -> &str {
        self.any.name()
    }

    /// The input of the network: "events" or "frames".
    #[getter]
    fn kind(&self) -> &'static str {
        match self.any {
            AnyDescription::Events(_) => "events",
            AnyDescription::Frames(_) => "frames",
        }
    }

    /// Length of the window in microseconds; None for a network over frames.
    #[getter]
    fn span_us(&self) -> Option<i64> {
        self.events().ok().map(meissner::Description::span_us)
    }

    /// Maximum number of events in the window; None for a network over frames.
    #[getter]
    fn capacity(&self) -> Option<usize> {
        self.events().ok().map(meissner::Description::capacity)
    }

    /// Shape of a frame, (channels, height, width) or (values,); None for a network over events.
    #[getter]
    fn input_shape(&self) -> Option<Vec<usize>> {
        self.frames().ok().map(|description| shape(description.input()))
    }

    /// Names of the predicted values.
    #[getter]
    fn outputs<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.any.outputs().0)
    }

    /// Unit of each predicted value.
    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, self.any.outputs().1)
    }

    /// Names of the classes whose logits are predicted; None for other values.
    #[getter]
    fn classes<'py>(&self, py: Python<'py>) -> PyResult<Option<Bound<'py, PyTuple>>> {
        self.any.classes().map(|names| PyTuple::new(py, names)).transpose()
    }

    /// Trained parameters, without running statistics.
    #[getter]
    fn parameters(&self) -> usize {
        match &self.any {
            AnyDescription::Events(description) => description.parameters(),
            AnyDescription::Frames(description) => description.parameters(),
        }
    }

    /// A dict for each layer, in the order of evaluation, with its name, kind, shapes and cost.
    #[getter]
    fn layers<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        Ok(self.summary(py)?.get_item("layers")?)
    }

    /// Shape of each tensor that the weights must have, by name.
    #[getter]
    fn tensors<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let tensors = PyDict::new(py);
        for (name, shape) in self.any.tensors() {
            tensors.set_item(name, PyTuple::new(py, shape)?)?;
        }
        Ok(tensors)
    }

    /// Everything about the network as a dict, as `meissner inspect --json` prints it.
    fn summary<'py>(&self, py: Python<'py>) -> Outcome<Bound<'py, PyAny>> {
        let json = serde_json::to_string(&self.any.summary())
            .map_err(|error| refused(format!("summary: {error}")))?;
        Ok(py.import("json")?.call_method1("loads", (json,))?)
    }

    /// The text of the description file.
    fn to_toml(&self) -> &str {
        &self.toml
    }

    /// The network in the DOT language of Graphviz.
    fn to_dot(&self) -> String {
        self.any.to_dot()
    }

    /// The network as a picture, a standalone SVG.
    fn to_svg(&self) -> String {
        self.any.to_svg()
    }

    fn _repr_svg_(&self) -> String {
        self.any.to_svg()
    }

    fn __str__(&self) -> String {
        self.any.to_table()
    }

    fn __repr__(&self) -> String {
        let (kind, parameters) = (self.kind(), self.parameters());
        let outputs = self.any.labelled_outputs();
        format!("<Description {:?}: {kind} to {outputs}, {parameters} parameters>", self.name())
    }

    fn __eq__(&self, other: &Bound<'_, PyAny>) -> bool {
        other.cast::<Self>().is_ok_and(|other| other.get().any == self.any)
    }

    fn __hash__(&self) -> usize {
        self.name().bytes().fold(0, |hash, byte| hash.wrapping_mul(31).wrapping_add(byte.into()))
    }

    fn __reduce__(slf: &Bound<'_, Self>) -> (Py<PyAny>, (String,)) {
        let toml = slf.get().toml.clone();
        // A text with a line break is read neither as a name nor as a path.
        (slf.get_type().into_any().unbind(), (toml + "\n",))
    }
}

/// Sides of a shape.
pub(crate) fn shape(shape: FrameShape) -> Vec<usize> {
    match shape {
        FrameShape::Vector(values) => vec![values],
        FrameShape::Image { channels, height, width } => vec![channels, height, width],
    }
}

/// The tables of a dict.
fn table(place: &str, mapping: &Bound<'_, PyMapping>) -> Outcome<Table> {
    let mut table = Table::new();
    for item in mapping.items()?.iter() {
        let (key, found): (String, Bound<'_, PyAny>) = item.extract()?;
        if !found.is_none() {
            let value = value(&format!("{place}.{key}"), &found)?;
            table.insert(key, value);
        }
    }
    Ok(table)
}

fn value(place: &str, found: &Bound<'_, PyAny>) -> Outcome<Value> {
    if let Ok(flag) = found.cast::<PyBool>() {
        return Ok(Value::Boolean(flag.is_true()));
    }
    if let Ok(text) = found.cast::<PyString>() {
        return Ok(Value::String(text.to_string()));
    }
    if let Ok(mapping) = found.cast::<PyMapping>() {
        return table(place, mapping).map(Value::Table);
    }
    if found.is_instance_of::<PyList>() || found.is_instance_of::<PyTuple>() {
        let items = found.try_iter()?.enumerate();
        let items = items.map(|(i, item)| value(&format!("{place}[{i}]"), &item?));
        return items.collect::<Outcome<_>>().map(Value::Array);
    }
    if !found.is_instance_of::<PyFloat>()
        && let Ok(integer) = found.extract::<i64>()
    {
        return Ok(Value::Integer(integer));
    }
    if let Ok(float) = found.extract::<f64>() {
        return Ok(Value::Float(float));
    }
    Err(wrong_type(place, "a table, a list, a text, a number or a bool", found))
}
