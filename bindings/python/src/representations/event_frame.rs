//! A frame of events.

use pyo3::prelude::*;

use crate::arrays::as_numpy;

/// A frame of events, or a run of equal frames without any.
#[pyclass(module = "meissner", name = "EventFrame", frozen)]
pub(crate) struct EventFrame {
    /// The values: float32 (channels, height, width).
    #[pyo3(get)]
    pub(crate) values: Py<PyAny>,
    /// Begin of the frame's window in microseconds.
    #[pyo3(get)]
    pub(super) start_us: i64,
    pub(super) events: [u64; 2],
    /// Number of equal consecutive frames: 1, or the length of a run of frames without events.
    #[pyo3(get)]
    pub(crate) count: u64,
}

#[pymethods]
impl EventFrame {
    /// Events inside by polarity: (OFF, ON).
    #[getter]
    fn events(&self) -> (u64, u64) {
        (self.events[0], self.events[1])
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

    fn __repr__(&self, py: Python<'_>) -> PyResult<String> {
        let shape = self.values.bind(py).getattr("shape")?;
        let (start, [off, on], count) = (self.start_us, self.events, self.count);
        Ok(format!("<EventFrame {shape} from {start} us: {off} OFF, {on} ON, {count} of them>"))
    }
}
