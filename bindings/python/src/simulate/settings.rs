//! Parameters of the camera, by name.

use meissner_simulator::CameraSettings;
use pyo3::exceptions::PyTypeError;
use pyo3::prelude::*;
use pyo3::types::PyDict;

use crate::error::Outcome;

/// The settings `base` or the `ideal` ones, with those of `given` in their place.
pub(super) fn of(
    base: CameraSettings,
    ideal: bool,
    given: Option<&Bound<'_, PyDict>>,
) -> Outcome<CameraSettings> {
    let mut settings = if ideal { CameraSettings::ideal() } else { base };
    for (name, value) in given.into_iter().flatten() {
        let name: String = name.extract()?;
        let number: &mut f64 = match &*name {
            "lux" => &mut settings.lux,
            "dark_lux" => &mut settings.dark_lux,
            "threshold_on" => &mut settings.threshold_on,
            "threshold_off" => &mut settings.threshold_off,
            "threshold_spread" => &mut settings.threshold_spread,
            "cutoff_hz_per_lux" => &mut settings.cutoff_hz_per_lux,
            "cutoff_max_hz" => &mut settings.cutoff_max_hz,
            "leak_hz" => &mut settings.leak_hz,
            "leak_hz_per_klux" => &mut settings.leak_hz_per_klux,
            "shot_hz" => &mut settings.shot_hz,
            "shot_corner_lux" => &mut settings.shot_corner_lux,
            "hot_share" => &mut settings.hot_share,
            "hot_hz" => &mut settings.hot_hz,
            "refractory_us" => &mut settings.refractory_us,
            "latency_us" => &mut settings.latency_us,
            "jitter_us" => &mut settings.jitter_us,
            "initial_phase" => {
                settings.initial_phase = value.extract()?;
                continue;
            }
            _ => {
                let message =
                    format!("expected a setting of the camera, found {name}: see help(meissner.Camera)");
                return Err(PyTypeError::new_err(message).into());
            }
        };
        *number = value.extract()?;
    }
    Ok(settings)
}
