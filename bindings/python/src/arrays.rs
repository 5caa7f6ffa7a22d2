//! Shared by classes: structured arrays of events, sizes of sensors, counts by name.

use meissner::{Event, Sensor};
use numpy::{PyArray1, PyArrayDyn, PyArrayMethods, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::{Failure, Outcome};

/// Bytes of an event in an array that this module makes: t, x, y, p.
const PACKED: usize = 13;

/// The dtype of the arrays that this module makes: t, x, y, p without gaps.
pub(crate) fn dtype(py: Python<'_>) -> PyResult<Bound<'_, PyAny>> {
    py.import("numpy")?.getattr("dtype")?.call1((vec![("t", "<i8"), ("x", "<u2"), ("y", "<u2"), ("p", "?")],))
}

/// A structured array of `events`.
pub(crate) fn to_array<'py>(py: Python<'py>, events: &[Event]) -> PyResult<Bound<'py, PyAny>> {
    let mut bytes = Vec::with_capacity(events.len() * PACKED);
    for event in events {
        put(event, &mut bytes);
    }
    PyArray1::from_vec(py, bytes).call_method1("view", (dtype(py)?,))
}

/// Appends an event in the layout of [`dtype`].
pub(crate) fn put(event: &Event, bytes: &mut Vec<u8>) {
    bytes.extend_from_slice(&event.t_us.to_le_bytes());
    bytes.extend_from_slice(&event.x.to_le_bytes());
    bytes.extend_from_slice(&event.y.to_le_bytes());
    bytes.push(event.on.into());
}

/// An array of numbers as contiguous f32, without a copy if it already is.
pub(crate) fn contiguous<'py>(
    name: &str,
    object: &Bound<'py, PyAny>,
) -> Outcome<Bound<'py, PyArrayDyn<f32>>> {
    let numpy = object.py().import("numpy")?;
    let array = numpy.call_method1("asarray", (object,))?;
    let kind: String = array.getattr("dtype")?.getattr("kind")?.extract()?;
    if !matches!(&*kind, "f" | "i" | "u" | "b") {
        let found = array.getattr("dtype")?;
        return Err(Failure::dtype(format!("{name}: expected numbers, found {found}")));
    }
    let array = numpy.call_method1("ascontiguousarray", (array, "f4"))?;
    Ok(array.cast_into::<PyArrayDyn<f32>>().map_err(PyErr::from)?)
}

/// The values of an array of numbers in f32, row by row, and its shape.
pub(crate) fn float32(name: &str, object: &Bound<'_, PyAny>) -> Outcome<(Vec<f32>, Vec<usize>)> {
    let array = contiguous(name, object)?;
    let shape = array.shape().to_vec();
    let array = array.try_readonly().map_err(PyErr::from)?;
    Ok((array.as_slice().map_err(PyErr::from)?.to_vec(), shape))
}

/// The method `__array__` of an object with the array `values`.
pub(crate) fn as_numpy<'py>(
    values: &Bound<'py, PyAny>,
    dtype: Option<Bound<'py, PyAny>>,
    copy: Option<bool>,
) -> PyResult<Bound<'py, PyAny>> {
    match (dtype, copy) {
        (None, Some(true)) => values.call_method0("copy"),
        (None, _) => Ok(values.clone()),
        (Some(dtype), _) => values.call_method1("astype", (dtype,)),
    }
}

/// A sensor from (width, height); a third number, as in tonic's `sensor_size`, is ignored.
pub(crate) struct Pixels(pub(crate) Sensor);

impl<'a, 'py> FromPyObject<'a, 'py> for Pixels {
    type Error = PyErr;

    fn extract(object: Borrowed<'a, 'py, PyAny>) -> PyResult<Self> {
        let sides: PyResult<Vec<i64>> =
            object.try_iter().and_then(|sides| sides.map(|side| side?.extract()).collect());
        let sides = sides.map_err(|_| {
            let found = object.repr().map_or_else(|_| "another object".to_owned(), |text| text.to_string());
            Failure::dtype(format!("sensor: expected (width, height) in pixels, found {found}"))
        })?;
        let side = |side: i64| u16::try_from(side).ok().filter(|side| *side > 0);
        match sides[..] {
            [width, height] | [width, height, _] => match (side(width), side(height)) {
                (Some(width), Some(height)) => Ok(Self(Sensor::new(width, height))),
                _ => Err(Failure::input(format!(
                    "sensor: expected 1 to 65535 pixels a side, found ({width}, {height})"
                ))
                .into()),
            },
            _ => Err(Failure::input(format!(
                "sensor: expected (width, height) in pixels, found {} numbers",
                sides.len()
            ))
            .into()),
        }
    }
}

/// `(width, height)`.
pub(crate) fn sides(sensor: Sensor) -> (u16, u16) {
    (sensor.width, sensor.height)
}

/// Counts by name.
pub(crate) fn counts<'py>(py: Python<'py>, counts: &[(&str, u64)]) -> PyResult<Bound<'py, PyDict>> {
    let dict = PyDict::new(py);
    counts.iter().try_for_each(|(name, count)| dict.set_item(name, count))?;
    Ok(dict)
}
