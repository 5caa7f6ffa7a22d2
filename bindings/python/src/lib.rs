//! The Python module of Meissner: `meissner._meissner`, which the package `meissner` re-exports.
//!
//! | file | contents |
//! |---|---|
//! | `events`, `arrays` | events from `NumPy`, in place and in blocks; code that classes share |
//! | `engine`, `batch`, `frames`, `live` | the engines |
//! | `methods` | methods of several classes; tables of a notebook |
//! | `prediction`, `graph` | the results of engines |
//! | `description`, `weights` | networks, from all forms that a user may have |
//! | `representations`, `filters`, `recording`, `write` | frames of events; files |
//! | `simulate` | a membrane, markers and a camera |
//! | `sums` | computations of trainings in Rust |
//! | `datasets`, `evaluate`, `metrics` | labelled data sets, figures of networks on them |
//! | `threads` | one thread at a time in an object; forks; long work that can be stopped |
//! | `error`, `warned` | exceptions, warnings |
#![forbid(unsafe_code)]

mod arrays;
mod batch;
mod datasets;
mod description;
mod engine;
mod error;
mod evaluate;
mod events;
mod filters;
mod frames;
mod graph;
mod live;
mod methods;
mod metrics;
mod prediction;
mod recording;
mod representations;
mod simulate;
mod sums;
mod threads;
mod warned;
mod weights;
mod write;

use pyo3::prelude::*;
use pyo3::types::PyTuple;

/// The part of `meissner` that is written in Rust.
#[pymodule]
mod _meissner {
    use super::{Bound, PyModule, PyModuleMethods, PyResult, PyTuple, arrays, simulate};
    #[pymodule_export]
    use super::{
        batch::Batch,
        datasets::Recordings,
        description::Description,
        engine::Engine,
        evaluate::{judge, measure},
        filters::Filters,
        frames::FrameEngine,
        graph::{_graphs, Graph},
        live::Live,
        metrics::{_confusion, _iou, _mean_std, _pareto_front, _scores, _wilson_95},
        prediction::{Prediction, Timely},
        recording::{Blocks, Recording, Windows, open},
        representations::{EventFrame, EventFrames, SlidingFrame, TimeSurface, VoxelGrid, frames_for},
        simulate::{Camera, Press, film_markers},
        sums::{_spline_sums, _spline_sums_gradient},
        weights::{Card, Weights},
        write::write,
    };
    use meissner::AnyDescription;
    use pyo3::pyfunction;

    /// Names of the networks that come with the module.
    ///
    /// `kind` is "events", "frames" or None.
    #[pyfunction]
    #[pyo3(signature = (kind=None))]
    fn networks(kind: Option<&str>) -> Result<Vec<&'static str>, super::error::Failure> {
        match kind {
            None => Ok(AnyDescription::shipped_names().collect()),
            Some("events") => Ok(meissner::Description::shipped_names().to_vec()),
            Some("frames") => Ok(meissner::FrameDescription::shipped_names().to_vec()),
            Some(found) => {
                let expected = "\"events\", \"frames\" or None";
                Err(super::error::Failure::input(format!("kind: expected {expected}, found {found:?}")))
            }
        }
    }

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("__version__", env!("CARGO_PKG_VERSION"))?;
        module.add("_TIME_FIELDS", PyTuple::new(module.py(), meissner::io::EVENT_FIELDS[0])?)?;
        module.add("EVENT_DTYPE", arrays::dtype(module.py())?)?;
        module.add("SIMULATED_DTYPE", simulate::dtype(module.py())?)?;
        module.add("CAUSES", PyTuple::new(module.py(), simulate::causes())?)
    }
}
