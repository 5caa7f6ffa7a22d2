//! Converts the errors of Rust to the exceptions of Python.
//!
//! Every exception derives from `meissner.Error` and keeps the text of the error and of its
//! sources. The classes are in `meissner/_errors.py`, because a class made by Rust has only one
//! base.

use std::error::Error;

use meissner::EngineError;
use meissner::io::IoError;
use meissner::live::LiveError;
use meissner::models::{DescriptionError, FormatError, ModelError, in_part};
use meissner::representations::RepresentationError;
use meissner_evaluate::EvaluateError;
use meissner_simulator::SimulatorError;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyType;

/// An error before it is raised.
pub(crate) enum Failure {
    /// An exception that Python raised.
    Raised(PyErr),
    /// A refusal, with the name of its class in `meissner`.
    Refused(&'static str, String),
    /// A refused description, with the line, layer and text of each problem.
    Description(String, Vec<(usize, Option<String>, String)>),
}

pub(crate) type Outcome<T> = Result<T, Failure>;

impl Failure {
    /// Events, frames or arguments that are not as expected.
    pub(crate) fn input(message: impl Into<String>) -> Self {
        Self::Refused("InputError", message.into())
    }

    /// An array of another type.
    pub(crate) fn dtype(message: impl Into<String>) -> Self {
        Self::Refused("DtypeError", message.into())
    }
}

impl From<PyErr> for Failure {
    fn from(error: PyErr) -> Self {
        Self::Raised(error)
    }
}

impl From<Failure> for PyErr {
    fn from(failure: Failure) -> Self {
        Python::attach(|py| match failure {
            Failure::Raised(error) => error,
            Failure::Refused(class, message) => match class_named(py, class) {
                // A message may quote a text of any length.
                Ok(class) => PyErr::from_type(class, (in_part(&message).into_owned(),)),
                Err(error) => error,
            },
            Failure::Description(message, problems) => match class_named(py, "DescriptionError") {
                Ok(class) => PyErr::from_type(class, (message, problems)),
                Err(error) => error,
            },
        })
    }
}

/// A class of `meissner/_errors.py`.
fn class_named<'py>(py: Python<'py>, name: &str) -> PyResult<Bound<'py, PyType>> {
    py.import("meissner._errors")?.getattr(name)?.cast_into::<PyType>().map_err(PyErr::from)
}

/// The text of an error and of its sources.
fn text(error: &dyn Error) -> String {
    let mut text = error.to_string();
    let mut source = error.source();
    while let Some(error) = source {
        text.push_str(": ");
        text.push_str(&error.to_string());
        source = error.source();
    }
    text
}

impl From<EngineError> for Failure {
    fn from(error: EngineError) -> Self {
        let class = match &error {
            EngineError::NotIncremental(_) => "NotIncrementalError",
            EngineError::NotANumber { .. } => "NotANumberError",
            EngineError::Snapshot { .. } | EngineError::SnapshotBytes { .. } => "SnapshotError",
            EngineError::Memory { .. } | EngineError::FrameMemory { .. } => "MemoryLimitError",
            EngineError::FrameLength { .. }
            | EngineError::FrameValue { .. }
            | EngineError::Stream { .. }
            | EngineError::Sensor(_)
            | EngineError::Option { .. } => "InputError",
            _ => "DescriptionError",
        };
        Self::Refused(class, text(&error))
    }
}

impl From<DescriptionError> for Failure {
    fn from(error: DescriptionError) -> Self {
        let problem = |problem: &meissner::models::Problem| {
            (problem.line, problem.layer.clone(), problem.kind.to_string())
        };
        Self::Description(text(&error), error.problems().iter().map(problem).collect())
    }
}

impl From<ModelError> for Failure {
    fn from(error: ModelError) -> Self {
        match error {
            ModelError::Description(error) => error.into(),
            ModelError::Engine(error) => error.into(),
            ModelError::Read { .. } => Self::Refused("FileError", text(&error)),
            _ => Self::Refused("WeightsError", text(&error)),
        }
    }
}

impl From<IoError> for Failure {
    fn from(error: IoError) -> Self {
        let class = if matches!(error, IoError::File { .. }) { "FileError" } else { "RecordingError" };
        Self::Refused(class, text(&error))
    }
}

impl From<LiveError> for Failure {
    fn from(error: LiveError) -> Self {
        match error {
            LiveError::Engine(error) => error.into(),
            LiveError::Option { .. } => Self::Refused("InputError", text(&error)),
            _ => Self::Refused("LiveError", text(&error)),
        }
    }
}

impl From<EvaluateError> for Failure {
    fn from(error: EvaluateError) -> Self {
        match error {
            EvaluateError::Dataset(error) => error.into(),
            _ => Self::Refused("EvaluationError", text(&error)),
        }
    }
}

/// Errors of one class.
macro_rules! refused {
    ($($error:ty => $class:literal),+) => {
        $(impl From<$error> for Failure {
            fn from(error: $error) -> Self {
                Self::Refused($class, text(&error))
            }
        })+
    };
}

refused!(FormatError => "WeightsError", SimulatorError => "InputError", RepresentationError => "InputError");

/// A `TypeError` for an argument of another kind.
pub(crate) fn wrong_type(what: &str, expected: &str, found: &Bound<'_, PyAny>) -> Failure {
    let found = found.get_type().name().map_or_else(|_| "another type".to_owned(), |name| name.to_string());
    PyTypeError::new_err(format!("{what}: expected {expected}, found {found}")).into()
}
