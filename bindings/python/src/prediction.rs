//! Predictions: values with their names, units, time and cost.

use std::sync::Arc;

use meissner::{AnyDescription, Predictor, live, softmax};
use numpy::{PyArray1, PyArrayMethods, PyReadwriteArrayDyn, PyUntypedArrayMethods};
use pyo3::exceptions::PyKeyError;
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyString, PyTuple};

use crate::arrays::as_numpy;
use crate::error::{Failure, Outcome};
use crate::methods::html_table;

/// Maximum number of values that a notebook shows.
const MAX_ROWS: usize = 20;

/// Names and units of a network's outputs.
#[derive(Debug)]
pub(crate) struct Outputs {
    names: Vec<String>,
    units: Vec<String>,
    classes: bool,
    /// Names of the layers with counts of rows.
    pub(crate) layers: Vec<String>,
}

impl Outputs {
    pub(crate) fn new<'a>(description: &AnyDescription, layers: impl Iterator<Item = &'a str>) -> Arc<Self> {
        let (names, units) = description.outputs();
        Arc::new(Self {
            names: names.to_vec(),
            units: units.to_vec(),
            classes: description.classes().is_some(),
            layers: layers.map(str::to_owned).collect(),
        })
    }

    /// "name (unit)" of each value.
    pub(crate) fn labels(&self) -> String {
        let each = self.names.iter().zip(&self.units).map(|(name, unit)| format!("{name} ({unit})"));
        each.collect::<Vec<_>>().join(", ")
    }
}

/// A prediction: an array of float32. `prediction["roll"]` and `prediction[0]` are one of its
/// values.
#[pyclass(module = "meissner", name = "Prediction", frozen, subclass)]
pub(crate) struct Prediction {
    values: Py<PyAny>,
    outputs: Arc<Outputs>,
    /// Time in microseconds of the newest covered event; None before the first one, and for frames.
    #[pyo3(get)]
    t_us: Option<i64>,
    /// Events in the window; for a network over frames the frames since the last reset.
    #[pyo3(get)]
    nodes: u64,
    rows: Vec<u64>,
    /// How unlike the window or the newest frames are to those of the training. Fewer than 1 of
    /// 1,000 of the training's were above 1. None if the weights have no statistics of the
    /// training.
    #[pyo3(get)]
    unlike: Option<f32>,
}

impl Prediction {
    /// `nodes` are the events of the window, or the frames since the last reset.
    pub(crate) fn new(
        py: Python<'_>,
        values: &[f32],
        shape: Option<&[usize]>,
        (t_us, nodes, unlike): (Option<i64>, u64, Option<f32>),
        rows: &[u64],
        outputs: &Arc<Outputs>,
    ) -> Outcome<Self> {
        let values = PyArray1::from_slice(py, values).into_any();
        let values = match shape {
            Some(shape) => values.call_method1("reshape", (shape.to_vec(),))?,
            None => values,
        };
        let outputs = Arc::clone(outputs);
        Ok(Self { values: values.unbind(), outputs, t_us, nodes, rows: rows.to_vec(), unlike })
    }
}

impl Prediction {
    /// Values, time and nodes in a line.
    pub(crate) fn text(&self, py: Python<'_>) -> PyResult<String> {
        let values = self.values.bind(py);
        let body = if let Ok(values) = values.cast::<PyArray1<f32>>()
            && values.len() <= 8
        {
            let values = values.to_vec()?;
            let each = self.outputs.names.iter().zip(&values).zip(&self.outputs.units);
            let each = each.map(|((name, value), unit)| format!("{name} {value} {unit}"));
            each.collect::<Vec<_>>().join(", ")
        } else if let Some(label) = self.label(py)? {
            format!("{label} of {} classes", self.outputs.names.len())
        } else {
            format!("{} of shape {}", self.outputs.names.join(", "), values.getattr("shape")?.str()?)
        };
        let t = self.t_us.map(|t| format!(", t {t} us")).unwrap_or_default();
        let unlike = self.unlike.filter(|unlike| *unlike > 1.0);
        let unlike = unlike.map(|unlike| format!(", unlike the training ({unlike:.1})")).unwrap_or_default();
        Ok(format!("{body}{t}, {} nodes{unlike}", self.nodes))
    }
}

/// The prediction of `predictor`, computed without the interpreter lock.
pub(crate) fn computed(
    py: Python<'_>,
    predictor: &mut (impl Predictor + Send),
    shape: Option<&[usize]>,
    outputs: &Arc<Outputs>,
) -> Outcome<Prediction> {
    let found = py.detach(|| {
        predictor.predict().map(|p| (p.values.to_vec(), (p.t_us, p.nodes as u64, p.unlike), p.rows.to_vec()))
    });
    let (values, of, rows) = found?;
    Prediction::new(py, &values, shape, of, &rows, outputs)
}

#[pymethods]
impl Prediction {
    /// The values: float32 of shape (outputs,), or (channels, height, width) for images.
    #[getter]
    fn values(&self, py: Python<'_>) -> Py<PyAny> {
        self.values.clone_ref(py)
    }

    /// Name of each value, or of each channel.
    #[getter]
    fn names<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.outputs.names)
    }

    /// Unit of each value, or of each channel.
    #[getter]
    fn units<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyTuple>> {
        PyTuple::new(py, &self.outputs.units)
    }

    /// Rows that each layer computed since the previous prediction: its cost.
    #[getter]
    fn rows<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let rows = PyDict::new(py);
        self.outputs
            .layers
            .iter()
            .zip(&self.rows)
            .try_for_each(|(name, rows_of)| rows.set_item(name, rows_of))?;
        Ok(rows)
    }

    /// The values by name; a channel of an image is an array.
    fn as_dict<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let dict = PyDict::new(py);
        for (i, name) in self.outputs.names.iter().enumerate() {
            dict.set_item(name, self.values.bind(py).get_item(i)?)?;
        }
        Ok(dict)
    }

    /// Probability of each class by a softmax, float32; None if no classes are predicted.
    #[getter]
    fn probabilities<'py>(&self, py: Python<'py>) -> Outcome<Option<Bound<'py, PyArray1<f32>>>> {
        if !self.outputs.classes {
            return Ok(None);
        }
        let values = self.values.bind(py).cast::<PyArray1<f32>>().map_err(PyErr::from)?;
        let mut values = values.to_vec().map_err(PyErr::from)?;
        softmax(&mut values);
        Ok(Some(PyArray1::from_vec(py, values)))
    }

    /// Name of the class with the largest logit; None if no classes are predicted.
    #[getter]
    fn label(&self, py: Python<'_>) -> PyResult<Option<&str>> {
        if !self.outputs.classes {
            return Ok(None);
        }
        let largest: usize = self.values.bind(py).call_method0("argmax")?.extract()?;
        Ok(self.outputs.names.get(largest).map(String::as_str))
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

    fn __getitem__<'py>(&self, py: Python<'py>, index: &Bound<'py, PyAny>) -> Outcome<Bound<'py, PyAny>> {
        let values = self.values.bind(py);
        let Ok(name) = index.cast::<PyString>() else { return Ok(values.get_item(index)?) };
        let name = name.to_string();
        let place = self.outputs.names.iter().position(|known| *known == name).ok_or_else(|| {
            let names = self.outputs.names.join(", ");
            Failure::Raised(PyKeyError::new_err(format!("expected one of {names}, found {name:?}")))
        })?;
        Ok(values.get_item(place)?)
    }

    fn __len__(&self, py: Python<'_>) -> PyResult<usize> {
        self.values.bind(py).len()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        Ok(self.values.bind(py).try_iter()?.into_any())
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> PyResult<String> {
        let (py, this) = (slf.py(), slf.get());
        let Outputs { names, units, .. } = &*this.outputs;
        let mut rows = Vec::new();
        if let Ok(values) = this.values.bind(py).cast::<PyArray1<f32>>() {
            // If there are many, such as the classes of a classifier, only the largest.
            let mut values: Vec<(usize, f32)> = values.to_vec()?.into_iter().enumerate().collect();
            let many = values.len() > MAX_ROWS;
            if many {
                values.sort_by(|a, b| b.1.total_cmp(&a.1));
            }
            let row = |&(i, value): &(usize, f32)| [names[i].clone(), value.to_string(), units[i].clone()];
            rows.extend(values.iter().take(MAX_ROWS).map(row));
            if many {
                rows.push([format!("{} more", values.len() - MAX_ROWS), String::new(), String::new()]);
            }
        } else {
            let shape = this.values.bind(py).getattr("shape")?.str()?.to_string();
            rows.push([names.join(", "), format!("of shape {shape}"), units.join(", ")]);
        }
        // A timely prediction states its age, too.
        let title = slf.repr()?.to_string();
        Ok(html_table(title.trim_start_matches('<').trim_end_matches('>'), &rows))
    }

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        Ok(format!("<Prediction: {}>", self.text(py)?))
    }
}

/// A prediction that was available by its deadline, with the events that it covers and its age.
#[pyclass(module = "meissner", name = "Timely", extends = Prediction, frozen)]
pub(crate) struct Timely {
    /// Whether it covers every event that had been offered before the call, except dropped ones: no
    /// event waits, and the engine has lost none.
    #[pyo3(get)]
    fresh: bool,
    /// Whether it was computed for this call; otherwise it is the newest finished one.
    #[pyo3(get)]
    own: bool,
    /// Events or frames that had entered the queue before the call and are not covered.
    #[pyo3(get)]
    behind_events: u64,
    /// Microseconds of the stream from the last covered event to the last one in the queue.
    #[pyo3(get)]
    behind_us: u64,
    /// Events or frames that the engine got since the previous prediction and that are not in this
    /// one: late, outside the sensor, far ahead, or held until a restart of the clock is decided.
    #[pyo3(get)]
    lost_events: u64,
    /// Events or frames that the queue dropped since the previous prediction.
    #[pyo3(get)]
    dropped_events: u64,
    /// Restarts of the sensor's clock since the previous prediction; each reset the engine.
    #[pyo3(get)]
    restarts: u64,
    /// Microseconds from the begin of its computation to the answer.
    #[pyo3(get)]
    age_us: f64,
    /// Microseconds from the call to the answer.
    #[pyo3(get)]
    waited_us: f64,
}

/// The answer of a live engine.
pub(crate) struct Taken {
    values: Vec<f32>,
    of: (Option<i64>, u64, Option<f32>),
    timely: Timely,
}

impl Taken {
    pub(crate) fn new(found: &live::TimedAnswer<'_>) -> Self {
        let timely = Timely {
            fresh: found.fresh,
            own: found.own,
            behind_events: found.behind_events,
            behind_us: found.behind_us,
            lost_events: found.lost_events,
            dropped_events: found.dropped_events,
            restarts: found.restarts,
            age_us: found.age.as_secs_f64() * 1e6,
            waited_us: found.waited.as_secs_f64() * 1e6,
        };
        let of = (found.t_us, found.nodes as u64, found.unlike);
        Self { values: found.values.to_vec(), of, timely }
    }
}

/// The object of `taken`, with values of this shape.
pub(crate) fn timely(
    py: Python<'_>,
    taken: Taken,
    shape: Option<&[usize]>,
    outputs: &Arc<Outputs>,
) -> Outcome<Py<Timely>> {
    let prediction = Prediction::new(py, &taken.values, shape, taken.of, &[], outputs)?;
    Ok(Py::new(py, PyClassInitializer::from(prediction).add_subclass(taken.timely))?)
}

#[pymethods]
impl Timely {
    fn __repr__(slf: &Bound<'_, Self>) -> PyResult<String> {
        let text = slf.as_super().get().text(slf.py())?;
        let of = slf.get();
        let age = of.age_us as u64;
        let covers = if of.fresh {
            "fresh".to_owned()
        } else if of.behind_events == 0 && of.lost_events > 0 {
            format!("{} events lost", of.lost_events)
        } else {
            format!("{} events ({} us) behind", of.behind_events, of.behind_us)
        };
        Ok(format!("<Timely: {text}, {covers}, {age} us old>"))
    }
}

/// An array of the caller, checked before any computation.
pub(crate) struct Out<'py>(PyReadwriteArrayDyn<'py, f32>);

/// `out`, which must be a writable, contiguous array of `length` float32.
pub(crate) fn out<'py>(out: &Bound<'py, PyAny>, length: usize) -> Outcome<Out<'py>> {
    let expected = format!("expected a writable contiguous array of {length} float32");
    let refuse = |found: String| Failure::input(format!("out: {expected}, found {found}"));
    let Ok(array) = out.cast::<numpy::PyArrayDyn<f32>>() else {
        let dtype = out.getattr("dtype").and_then(|dtype| Ok(dtype.str()?.to_string()));
        let found = dtype.unwrap_or_else(|_| out.get_type().to_string());
        return Err(Failure::dtype(format!("out: {expected}, found {found}")));
    };
    let mut array = array.try_readwrite().map_err(|error| refuse(error.to_string()))?;
    let found = array.as_slice_mut().map_err(|_| refuse("one with gaps".to_owned()))?.len();
    if found == length { Ok(Out(array)) } else { Err(refuse(format!("{found} values"))) }
}

impl Out<'_> {
    pub(crate) fn write(mut self, values: &[f32]) -> Outcome<()> {
        self.0.as_slice_mut().map_err(PyErr::from)?.copy_from_slice(values);
        Ok(())
    }
}
