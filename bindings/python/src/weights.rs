//! Weights: from a file, bytes, arrays or a seed.

use std::collections::BTreeMap;
use std::fs;
use std::path::PathBuf;

use meissner::models::{self, NameMap, TensorFile};
use numpy::{PyArrayDyn, PyArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict, PyIterator, PyMapping, PyString};

use crate::arrays::sides;
use crate::description::Description;
use crate::error::{Failure, Outcome, wrong_type};

/// Named tensors: a mapping from names to float32 arrays.
///
/// `source` is the path or the bytes of a safetensors file or of a state dict of PyTorch (nothing
/// in it is executed), a mapping from names to arrays or torch tensors, or a torch module.
/// Floating-point values become float32. `metadata` (of texts) replaces that of the file.
///
/// Raises `WeightsError` if they cannot be read, `FileError` if a file cannot be read.
#[pyclass(module = "meissner", name = "Weights", frozen, mapping)]
pub(crate) struct Weights {
    weights: models::Weights,
}

impl Weights {
    /// The weights of an argument `weights`; None means those that come with the module.
    pub(crate) fn of(
        weights: Option<&Bound<'_, PyAny>>,
        description: &Description,
    ) -> Outcome<models::Weights> {
        let Some(weights) = weights.filter(|weights| !weights.is_none()) else {
            let shipped = description.shipped_name().and_then(models::Weights::shipped);
            return shipped.ok_or_else(|| {
                let name = description.any.name();
                let expected = "a path, bytes, a mapping of tensors or Weights.draw(network, seed)";
                let found = "None, and it is no network of this module";
                let text = format!("weights of network {name:?}: expected {expected}, found {found}");
                Failure::Refused("WeightsError", text)
            });
        };
        match weights.cast::<Self>() {
            Ok(weights) => Ok(weights.get().weights.clone()),
            Err(_) => Self::read(weights),
        }
    }

    fn read(source: &Bound<'_, PyAny>) -> Outcome<models::Weights> {
        if let Ok(bytes) = source.cast::<PyBytes>() {
            return Ok(models::Weights::from_bytes(bytes.as_bytes())?);
        }
        if source.is_instance_of::<PyString>() || source.hasattr("__fspath__")? {
            return Ok(models::Weights::load(source.extract::<PathBuf>()?)?);
        }
        if source.hasattr("state_dict")? {
            return Self::read(&source.call_method0("state_dict")?);
        }
        match source.cast::<PyMapping>() {
            Ok(tensors) => Self::of_tensors(tensors),
            Err(_) => Err(wrong_type("weights", "a path, bytes, a mapping of tensors or Weights", source)),
        }
    }

    fn bytes(&self, metadata: Option<BTreeMap<String, String>>) -> Vec<u8> {
        self.weights.to_safetensors(metadata.as_ref().unwrap_or(self.weights.metadata()))
    }

    fn of_tensors(tensors: &Bound<'_, PyMapping>) -> Outcome<models::Weights> {
        let mut file = TensorFile::new(BTreeMap::new());
        let numpy = tensors.py().import("numpy")?;
        for item in tensors.items()?.iter() {
            let (name, tensor): (String, Bound<'_, PyAny>) = item.extract()?;
            let array = numpy.call_method1("asarray", (in_memory(tensor)?,))?;
            let (kind, shape): (String, Vec<usize>) =
                (array.getattr("dtype")?.getattr("kind")?.extract()?, array.getattr("shape")?.extract()?);
            let order = PyDict::new(array.py());
            order.set_item("order", "C")?;
            let converted = |dtype: &str| numpy.call_method("asarray", (&array, dtype), Some(&order));
            match &*kind {
                "f" => {
                    let values = converted("f4")?.cast_into::<PyArrayDyn<f32>>().map_err(PyErr::from)?;
                    file.f32(&name, &shape, values.readonly().as_slice().map_err(PyErr::from)?);
                }
                "i" | "u" | "b" => {
                    let values = converted("i8")?.cast_into::<PyArrayDyn<i64>>().map_err(PyErr::from)?;
                    file.i64(&name, &shape, values.readonly().as_slice().map_err(PyErr::from)?);
                }
                _ => {
                    let dtype = array.getattr("dtype")?;
                    return Err(Failure::dtype(format!("tensor {name:?}: expected numbers, found {dtype}")));
                }
            }
        }
        Ok(models::Weights::from_bytes(&file.into_bytes())?)
    }
}

/// A tensor of torch as one whose memory `NumPy` can read; any other object unchanged.
fn in_memory(tensor: Bound<'_, PyAny>) -> PyResult<Bound<'_, PyAny>> {
    if !tensor.hasattr("detach")? {
        return Ok(tensor);
    }
    let tensor = tensor.call_method0("detach")?.call_method0("cpu")?;
    if tensor.call_method0("is_floating_point")?.is_truthy()? {
        tensor.call_method0("float")
    } else {
        Ok(tensor)
    }
}

#[pymethods]
impl Weights {
    #[new]
    #[pyo3(signature = (source, metadata=None))]
    fn new(source: &Bound<'_, PyAny>, metadata: Option<BTreeMap<String, String>>) -> Outcome<Self> {
        let weights = match source.cast::<Self>() {
            Ok(weights) => weights.get().weights.clone(),
            Err(_) => Self::read(source)?,
        };
        match metadata {
            None => Ok(Self { weights }),
            Some(metadata) => {
                Ok(Self { weights: models::Weights::from_bytes(&weights.to_safetensors(&metadata))? })
            }
        }
    }

    /// Weights of the network `name` that comes with the module.
    #[staticmethod]
    fn shipped(name: &str) -> Outcome<Self> {
        let weights = models::Weights::shipped(name).ok_or_else(|| {
            let names: Vec<&str> = meissner::AnyDescription::shipped_names().collect();
            Failure::Refused(
                "WeightsError",
                format!("weights: expected a network of {}, found {name:?}", names.join(", ")),
            )
        })?;
        Ok(Self { weights })
    }

    /// Weights of `network` drawn from `seed`, the same on every machine. They are not trained.
    #[staticmethod]
    #[pyo3(signature = (network, seed=0))]
    fn draw(network: &Bound<'_, PyAny>, seed: u64) -> Outcome<Self> {
        let description = Description::of(network)?;
        let bytes = models::drawn_file(&description.any, seed);
        Ok(Self { weights: models::Weights::from_bytes(&bytes)? })
    }

    /// The metadata of the file: texts by name.
    #[getter]
    fn metadata(&self) -> BTreeMap<String, String> {
        self.weights.metadata().clone()
    }

    /// The facts on which a run depends, from the metadata. Raises `WeightsError` for another form.
    #[getter]
    fn card(&self) -> Outcome<Card> {
        Ok(Card::new(self.weights.card()?))
    }

    /// The bytes of a safetensors file. `metadata` replaces that of these weights.
    #[pyo3(signature = (metadata=None))]
    fn to_bytes<'py>(
        &self,
        py: Python<'py>,
        metadata: Option<BTreeMap<String, String>>,
    ) -> Bound<'py, PyBytes> {
        PyBytes::new(py, &self.bytes(metadata))
    }

    /// Writes a safetensors file, as `to_bytes` makes it. Raises `FileError`.
    #[pyo3(signature = (path, metadata=None))]
    fn save(&self, path: PathBuf, metadata: Option<BTreeMap<String, String>>) -> Outcome<()> {
        fs::write(&path, self.bytes(metadata)).map_err(|error| {
            Failure::Refused("FileError", format!("cannot write {}: {error}", path.display()))
        })
    }

    /// Names of tensors that `network` does not read.
    fn unused(&self, network: &Bound<'_, PyAny>) -> Outcome<Vec<String>> {
        Ok(Description::of(network)?.any.unused_tensors(&self.weights)?)
    }

    /// These weights under other names: a mapping from a name of the file to that of the network,
    /// or from the start of names to another, both with a dot at the end ("" leaves it out).
    /// Raises `WeightsError` for a missing name, or two tensors with one name.
    fn renamed(&self, names: BTreeMap<String, String>) -> Outcome<Self> {
        let map = names.iter().try_fold(NameMap::default(), |map, (old, new)| map.with(old, new))?;
        Ok(Self { weights: self.weights.clone().renamed(&map)? })
    }

    /// Names, in order.
    fn keys(&self) -> Vec<String> {
        self.weights.names().map(str::to_owned).collect()
    }

    /// Arrays, in the order of names.
    fn values<'py>(&self, py: Python<'py>) -> Outcome<Vec<Bound<'py, PyAny>>> {
        self.weights.names().map(|name| self.__getitem__(py, name)).collect()
    }

    /// Names and arrays.
    fn items<'py>(&self, py: Python<'py>) -> Outcome<Vec<(String, Bound<'py, PyAny>)>> {
        self.weights.names().map(|name| Ok((name.to_owned(), self.__getitem__(py, name)?))).collect()
    }

    fn __getitem__<'py>(&self, py: Python<'py>, name: &str) -> Outcome<Bound<'py, PyAny>> {
        let missing = || Failure::Raised(pyo3::exceptions::PyKeyError::new_err(name.to_owned()));
        let tensor = self.weights.get(name).ok_or_else(missing)?;
        let values = tensor.values().ok_or_else(|| {
            let found = tensor.dtype();
            Failure::dtype(format!("tensor {name:?}: expected floating-point values, found {found}"))
        })?;
        let values = numpy::PyArray1::from_slice(py, values);
        Ok(values.call_method1("reshape", (tensor.shape().to_vec(),))?)
    }

    fn __contains__(&self, name: &str) -> bool {
        self.weights.get(name).is_some()
    }

    fn __len__(&self) -> usize {
        self.weights.names().count()
    }

    fn __iter__<'py>(&self, py: Python<'py>) -> PyResult<Bound<'py, PyIterator>> {
        self.keys().into_pyobject(py)?.try_iter()
    }

    fn __repr__(&self) -> String {
        let values: usize =
            self.weights.iter().map(|(_, tensor)| tensor.shape().iter().product::<usize>()).sum();
        let card = self.weights.card().map(|card| Card::new(card).said()).unwrap_or_default();
        format!("<Weights: {} tensors, {values} values{card}>", self.__len__())
    }

    fn __reduce__<'py>(slf: &Bound<'py, Self>) -> (Bound<'py, PyAny>, (Bound<'py, PyBytes>,)) {
        (slf.get_type().into_any(), (slf.get().to_bytes(slf.py(), None),))
    }
}

/// The facts on which a run depends, from the metadata of weights.
#[pyclass(module = "meissner", name = "Card", frozen)]
pub(crate) struct Card {
    /// Whether they were trained; None if unknown.
    #[pyo3(get)]
    trained: Option<bool>,
    /// One line about them.
    #[pyo3(get)]
    about: Option<String>,
    /// Preparation of the input of the training, as JSON.
    #[pyo3(get)]
    preparation: Option<String>,
    /// Stride of the training: it took every `stride`-th event.
    #[pyo3(get)]
    stride: usize,
    /// (width, height) of the sensor of the training.
    #[pyo3(get)]
    sensor: Option<(u16, u16)>,
    /// Whether these are the weights of the published contact-angle checkpoint.
    #[pyo3(get)]
    published: bool,
}

impl Card {
    fn new(card: models::Card) -> Self {
        let models::Card { trained, about, preparation, stride, sensor, published, .. } = card;
        Self { trained, about, preparation, stride, sensor: sensor.map(sides), published }
    }

    /// Text for the end of a `repr`.
    fn said(&self) -> String {
        let trained = match self.trained {
            Some(true) => ", trained",
            Some(false) => ", not trained",
            None => "",
        };
        let about = self.about.as_ref().map(|about| format!(", {about:?}")).unwrap_or_default();
        format!("{trained}{about}")
    }
}

#[pymethods]
impl Card {
    /// The card of the weights that come with the network `name`; no weights are made.
    #[staticmethod]
    fn shipped(name: &str) -> Outcome<Self> {
        let missing = || {
            let message = format!("weights: expected a network of networks(), found {name:?}");
            Failure::Refused("WeightsError", message)
        };
        Ok(Self::new(models::Card::shipped(name).ok_or_else(missing)?))
    }

    fn __repr__(&self) -> String {
        let sensor = self.sensor.map(|(w, h)| format!(", sensor {w}x{h}")).unwrap_or_default();
        format!("<Card: stride {}{sensor}{}>", self.stride, self.said())
    }
}
