//! Labelled data sets. A recording is read on request.
//!
//! `meissner/_datasets.py` makes sequences of them.

use std::path::PathBuf;

use meissner::io::datasets::{
    BadRows, Dataset as Set, EventDataset, EventFile, EventRecording, NeutouchSet, SlipFile,
};
use meissner::models;
use meissner_evaluate::streams::Streams;
use models::systems::{digits, letters, slip, touch};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::{sides, to_array};
use crate::error::{Failure, Outcome};

/// The recordings of a data set.
#[pyclass(module = "meissner", name = "_Recordings", frozen)]
pub(crate) struct Recordings {
    parts: Parts,
    #[pyo3(get)]
    classes: Vec<String>,
    #[pyo3(get)]
    sensor: Option<(u16, u16)>,
    #[pyo3(get)]
    passed_over: Vec<PathBuf>,
}

enum Parts {
    /// Files of N-MNIST.
    Files(Vec<EventFile>),
    /// An archive, which is read completely.
    Read(Vec<EventRecording>),
    Slips(Vec<SlipFile>),
    Presses(Streams),
}

/// Name, class and split of a recording.
type Label<'a> = (&'a str, Option<usize>, Option<&'static str>);

impl Parts {
    fn len(&self) -> usize {
        match self {
            Self::Files(files) => files.len(),
            Self::Read(recordings) => recordings.len(),
            Self::Slips(files) => files.len(),
            Self::Presses(streams) => streams.parts().len(),
        }
    }

    fn label(&self, i: usize) -> Label<'_> {
        match self {
            Self::Files(files) => (&files[i].name, Some(files[i].class), Some(files[i].split.name())),
            Self::Read(all) => (&all[i].name, Some(all[i].class), Some(all[i].split.name())),
            Self::Slips(files) => (&files[i].name, Some(files[i].class), None),
            Self::Presses(_) => ("", None, None),
        }
    }
}

#[pymethods]
impl Recordings {
    /// Lists the data set `name` at `path`.
    #[new]
    fn new(py: Python<'_>, name: &str, path: PathBuf) -> Outcome<Self> {
        let names = |classes: &[&str]| classes.iter().map(|&class| class.to_owned()).collect::<Vec<_>>();
        let neutouch = |set: NeutouchSet, classes: &[&str]| -> Outcome<Self> {
            let Set { recordings, passed_over } = py.detach(|| EventDataset::neutouch(&path, set))?;
            let (classes, sensor) = (names(classes), Some(sides(touch::SENSOR)));
            Ok(Self { parts: Parts::Read(recordings), classes, sensor, passed_over })
        };
        match name {
            "nmnist" => {
                let Set { recordings, passed_over } = py.detach(|| Set::nmnist_files(&path))?;
                let (classes, sensor) = (names(&digits::CLASSES), Some(sides(digits::SENSOR)));
                Ok(Self { parts: Parts::Files(recordings), classes, sensor, passed_over })
            }
            "objects" => neutouch(NeutouchSet::Objects, &touch::OBJECTS),
            "containers" => neutouch(NeutouchSet::Containers, &touch::CONTAINERS),
            "letters" => {
                let Set { recordings, passed_over } =
                    py.detach(|| EventDataset::letters(&path, &letters::CLASSES))?;
                let (classes, sensor) = (names(&letters::CLASSES), Some(sides(letters::SENSOR)));
                Ok(Self { parts: Parts::Read(recordings), classes, sensor, passed_over })
            }
            "slip" => {
                let Set { recordings, passed_over } = py.detach(|| Set::slip_files(&path, &slip::CLASSES))?;
                let classes = names(&slip::CLASSES);
                Ok(Self { parts: Parts::Slips(recordings), classes, sensor: None, passed_over })
            }
            "presses" => {
                let streams = py.detach(|| Streams::read(&path))?;
                let sensor = Some(sides(streams.sensor()));
                Ok(Self {
                    parts: Parts::Presses(streams),
                    classes: Vec::new(),
                    sensor,
                    passed_over: Vec::new(),
                })
            }
            found => Err(Failure::input(format!("name: expected a data set, found {found:?}"))),
        }
    }

    /// Name, class and split of each recording.
    #[getter]
    fn labels(&self) -> Vec<Label<'_>> {
        (0..self.parts.len()).map(|i| self.parts.label(i)).collect()
    }

    /// The data of recording `i`, and its other known properties.
    fn read<'py>(&self, py: Python<'py>, i: usize) -> Outcome<(Bound<'py, PyAny>, Bound<'py, PyDict>)> {
        if i >= self.parts.len() {
            return Err(Failure::input(format!("i: expected below {}, found {i}", self.parts.len())));
        }
        let more = PyDict::new(py);
        let data = match &self.parts {
            Parts::Files(files) => to_array(py, &py.detach(|| files[i].read())?.events)?,
            Parts::Read(recordings) => {
                if let Some(contact) = recordings[i].contact {
                    more.set_item("contact_us", contact.begin_us)?;
                    more.set_item("held_us", contact.held_us)?;
                    more.set_item("lifted_us", contact.lifted_us)?;
                }
                to_array(py, &recordings[i].events)?
            }
            Parts::Slips(files) => {
                let recording = py.detach(|| files[i].read(BadRows::Refuse))?;
                more.set_item("object", recording.object)?;
                let (values, count) =
                    (recording.readings.iter().flat_map(|r| r.values), recording.readings.len());
                PyArray1::from_iter(py, values).call_method1("reshape", (count, -1))?
            }
            Parts::Presses(streams) => {
                if let Some(labels) = streams.labels(i) {
                    more.set_item("t_us", PyArray1::from_slice(py, labels.t_us))?;
                    for (name, values) in labels.values {
                        more.set_item(name, PyArray1::from_slice(py, values))?;
                    }
                }
                to_array(py, streams.parts()[i])?
            }
        };
        Ok((data, more))
    }
}
