//! A soft dome that is pressed on a plane.

use meissner_simulator::{Dome, DomeView, Press as Model};
use numpy::PyArray1;
use pyo3::prelude::*;

use crate::arrays::Pixels;
use crate::error::{Failure, Outcome};
use crate::turn::turn;

/// Depth of a part of a press, after which signals are handled, in millimetres.
const STEP_MM: f64 = 0.25;

/// A soft dome with markers inside that is pressed on a plane: a thin shell of an incompressible Yeoh solid, quasi-static.
///
/// - `tilt`, `azimuth`: of the plane, in radians; its normal leans towards `azimuth`, counted from x to y.
/// - `radius_mm`, `wall_mm`: of the hemisphere; `rings_mm`: diameter of the outermost of the `rings` of markers around the one at
///   the top; ring k has 6 k markers.
/// - `yeoh_kpa`: the coefficients C10, C20, C30. The default dome is the published one.
///
/// Raises `InputError`.
#[pyclass(module = "meissner", name = "Press")]
pub(crate) struct Press {
    dome: Dome,
    press: Model,
}

#[pymethods]
impl Press {
    #[new]
    #[pyo3(signature = (tilt=0.0, azimuth=0.0, *, radius_mm=20.0, wall_mm=4.0, rings_mm=35.0, rings=7, yeoh_kpa=[17.0, -0.2, 0.023]))]
    fn new(
        tilt: f64,
        azimuth: f64,
        radius_mm: f64,
        wall_mm: f64,
        rings_mm: f64,
        rings: usize,
        yeoh_kpa: [f64; 3],
    ) -> Outcome<Self> {
        let refuse = |what: &str, expected: &str, found: f64| {
            Err(Failure::input(format!("{what}: expected {expected}, found {found}")))
        };
        for (what, found) in [("tilt", tilt), ("azimuth", azimuth)] {
            if !found.is_finite() {
                return refuse(what, "a finite angle in radians", found);
            }
        }
        for (what, found) in [("radius_mm", radius_mm), ("wall_mm", wall_mm), ("rings_mm", rings_mm)] {
            if !(found.is_finite() && found > 0.0) {
                return refuse(what, "a finite length above 0 mm", found);
            }
        }
        if rings_mm >= 2.0 * radius_mm {
            return refuse(
                "rings_mm",
                &format!("less than the diameter of {} mm", 2.0 * radius_mm),
                rings_mm,
            );
        }
        if !(1..=30).contains(&rings) {
            return refuse("rings", "1 to 30", rings as f64);
        }
        if !(yeoh_kpa.iter().all(|c| c.is_finite()) && yeoh_kpa[0] > 0.0) {
            return refuse("yeoh_kpa", "finite coefficients, the first above 0", yeoh_kpa[0]);
        }
        let dome = Dome { radius_mm, wall_mm, rings_mm, rings, yeoh_kpa };
        Ok(Self { press: Model::new(&dome, tilt, azimuth), dome })
    }

    /// Presses on to `depth_mm` along the axis of the dome. A depth below the present one changes nothing. 15 mm of the default dome
    /// take about a second. Other threads run meanwhile, and Ctrl-C ends it at a smaller depth.
    fn press_to(slf: &Bound<'_, Self>, py: Python<'_>, depth_mm: f64) -> Outcome<()> {
        let mut this = turn(slf)?;
        let most = this.dome.radius_mm;
        if !(0.0..=most).contains(&depth_mm) {
            return Err(Failure::input(format!("depth_mm: expected 0 to {most} mm, found {depth_mm}")));
        }
        while this.press.depth_mm() < depth_mm {
            let press = &mut this.press;
            py.detach(|| press.press_to(depth_mm.min(press.depth_mm() + STEP_MM)));
            py.check_signals()?;
        }
        Ok(())
    }

    /// How deep the dome is pressed, in millimetres.
    #[getter]
    fn depth_mm(slf: &Bound<'_, Self>) -> Outcome<f64> {
        let this = turn(slf)?;
        Ok(this.press.depth_mm())
    }

    /// The force with which the plane presses the dome along its axis, in newtons.
    #[getter]
    fn force_n(slf: &Bound<'_, Self>) -> Outcome<f64> {
        let this = turn(slf)?;
        Ok(this.press.force_n())
    }

    /// The markers, ring after ring from the top outwards: float64 (markers, 3), x, y, z in millimetres above the base.
    #[getter]
    fn markers<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyAny>> {
        let this = turn(slf)?;
        let markers = this.press.markers();
        PyArray1::from_iter(py, markers.iter().flatten().copied()).call_method1("reshape", (markers.len(), 3))
    }

    /// Where the camera below the base sees the markers: float32 (markers, 2), column and row in pixels of `sensor`, for
    /// `film_markers`. As in `meissner simulate dome`.
    fn positions<'py>(slf: &Bound<'_, Self>, py: Python<'py>, sensor: Pixels) -> PyResult<Bound<'py, PyAny>> {
        let this = turn(slf)?;
        let (view, markers) = (DomeView::new(&this.dome, sensor.0), this.press.markers());
        let seen = markers.iter().flat_map(|&marker| view.place(marker));
        PyArray1::from_iter(py, seen).call_method1("reshape", (markers.len(), 2))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> Outcome<String> {
        let this = turn(slf)?;
        let (depth, force) = (this.press.depth_mm(), this.press.force_n());
        Ok(format!("<Press: {} markers, {depth:.2} mm deep, {force:.2} N>", this.press.markers().len()))
    }
}
