//! Voxel grids.

use meissner::representations::{VoxelGrid as Grid, VoxelTime};
use pyo3::prelude::*;
use pyo3::types::{PyDict, PyTuple};

use super::shared::{Rectangle, crop_of, image};
use crate::arrays::{Pixels, counts};
use crate::error::{Failure, Outcome};
use crate::events::Events;
use crate::turn::turn;

/// A voxel grid (bins, height, width): polarities spread over two bins of time each.
///
/// `window_us` is (start, end), both included. `time` says how it maps to the bins: "bins" as in tonic, where the end lies one
/// bin after the last, or "centres", where it lies on the last one. The result does not depend on the order of events.
///
/// Raises `InputError`.
#[pyclass(module = "meissner", name = "VoxelGrid")]
pub(crate) struct VoxelGrid {
    grid: Grid,
}

#[pymethods]
impl VoxelGrid {
    #[new]
    #[pyo3(signature = (sensor, bins, window_us, *, time="bins", crop=None))]
    fn new(
        sensor: Pixels,
        bins: usize,
        window_us: (i64, i64),
        time: &str,
        crop: Option<Rectangle>,
    ) -> Outcome<Self> {
        let time = match time {
            "bins" => VoxelTime::Bins,
            "centres" => VoxelTime::Centres,
            found => {
                return Err(Failure::input(format!(
                    "time: expected \"bins\" or \"centres\", found {found:?}"
                )));
            }
        };
        let crop = crop_of(crop, sensor.0);
        Ok(Self { grid: Grid::new(sensor.0, crop, bins, time, window_us.0..=window_us.1)? })
    }

    /// Adds events, as `Engine.push`; returns how many lie on the sensor, in the crop and in the window.
    #[pyo3(signature = (*args, **keywords), text_signature = "($self, events=None, *, t=None, x=None, y=None, p=None)")]
    fn push<'py>(
        slf: &Bound<'_, Self>,
        py: Python<'py>,
        args: &Bound<'py, PyTuple>,
        keywords: Option<&Bound<'py, PyDict>>,
    ) -> Outcome<usize> {
        let mut this = turn(slf)?;
        let (grid, mut accepted) = (&mut this.grid, 0);
        Events::of_call(args, keywords)?.each(py, |event| accepted += usize::from(grid.push(event)))?;
        Ok(accepted)
    }

    /// The grid over the events so far: float32 (bins, height, width).
    fn frame<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let mut this = turn(slf)?;
        let frame = this.grid.frame();
        image(py, frame.values, frame.shape)
    }

    /// Empties the grid and begins another window. Counters go on.
    fn restart(slf: &Bound<'_, Self>, window_us: (i64, i64)) -> Outcome<()> {
        let mut this = turn(slf)?;
        Ok(this.grid.restart(window_us.0..=window_us.1)?)
    }

    /// Counts of the events so far.
    #[getter]
    fn counters<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let this = turn(slf)?;
        let of = this.grid.counters();
        let all = [
            ("pushed", of.pushed),
            ("accepted", of.accepted),
            ("outside_sensor", of.outside_sensor),
            ("outside_crop", of.outside_crop),
            ("outside_window", of.outside_window),
        ];
        counts(py, &all)
    }

    fn __repr__(slf: &Bound<'_, Self>) -> Outcome<String> {
        let mut this = turn(slf)?;
        let frame = this.grid.frame();
        Ok(format!("<VoxelGrid {:?}: {} events>", frame.shape, frame.events))
    }
}
