//! What the arguments of representations stand for, and arrays of frames.

use meissner::representations::{Crop, SignedRule};
use meissner::{EventCounters, Sensor};
use numpy::PyArray1;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::arrays::counts;
use crate::error::{Failure, Outcome};

/// (x, y, width, height).
pub(super) type Rectangle = (u16, u16, u16, u16);

/// An array of `shape`.
pub(super) fn image<'py>(py: Python<'py>, values: &[f32], shape: [usize; 3]) -> PyResult<Bound<'py, PyAny>> {
    PyArray1::from_slice(py, values).call_method1("reshape", (shape.to_vec(),))
}

/// The part of a sensor that an argument `crop` names: (x, y, width, height), or None for all of it.
pub(super) fn crop_of(crop: Option<Rectangle>, sensor: Sensor) -> Crop {
    crop.map_or(Crop::whole(sensor), |(x, y, width, height)| Crop::new(x, y, width, height))
}

/// The rule of this name; None for counts.
pub(super) fn rule_of(rule: &str) -> Outcome<Option<SignedRule>> {
    match rule {
        "counts" => Ok(None),
        "sum" => Ok(Some(SignedRule::Sum)),
        "latest" => Ok(Some(SignedRule::Latest)),
        found => {
            let expected = "\"counts\", \"sum\" or \"latest\"";
            Err(Failure::input(format!("rule: expected {expected}, found {found:?}")))
        }
    }
}

/// Counts of the events of a representation.
pub(super) fn counted<'py>(
    py: Python<'py>,
    of: &EventCounters,
    outside_crop: u64,
) -> PyResult<Bound<'py, PyDict>> {
    let all = [
        ("pushed", of.pushed),
        ("accepted", of.accepted),
        ("outside_sensor", of.outside_sensor),
        ("outside_crop", outside_crop),
        ("late", of.late),
        ("time_out_of_range", of.time_out_of_range),
        ("expired", of.expired),
        ("evicted", of.evicted),
    ];
    counts(py, &all)
}
