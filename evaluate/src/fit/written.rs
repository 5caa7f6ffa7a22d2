//! A fitted head as files: weights with their card.

use std::collections::BTreeMap;

use meissner_engine::Sensor;
use meissner_models::description::Refitted;
use meissner_models::{Description, ModelError, Weights};
use meissner_run::RunError;
use serde_json::json;

use super::dense::Dense;
use super::figures::OutputFigures;
use super::request::{Base, Head, Options};
use super::samples::{Samples, Target};
use crate::error::Result;
use crate::presses::Presses;

/// The file of weights of `fitted`: the layers of events as in `base`, and `head`.
///
/// # Errors
/// The weights of the base lack a tensor, or a value of the head is beyond f32.
pub(super) fn weights(
    fitted: &Refitted,
    base: &Base,
    head: &Dense,
    card: &BTreeMap<String, String>,
) -> Result<Vec<u8>> {
    let bytes = fitted.weights(&base.named, &head.values()).to_safetensors(card);
    let read = Weights::from_bytes(&bytes).map_err(ModelError::from);
    let checked = read.and_then(|weights| fitted.description.network(&weights));
    checked.map_err(|source| RunError::weights(fitted.description.name().to_owned(), source))?;
    Ok(bytes)
}

/// Key of the [`fingerprint`] of the presses that a head was fitted to.
pub(super) const FITTED_TO: &str = "presses_fingerprint";

/// Fingerprint of the events of all presses that are taken, independent of their order.
pub(super) fn fingerprint(presses: &Presses, samples: &Samples) -> String {
    let of = samples.presses.iter().map(|&press| presses.recordings[press].fingerprint);
    format!("{:016x}", of.fold(0, u64::wrapping_add))
}

/// The metadata that a run depends on, and where the weights come from.
pub(super) fn card(
    (description, base, head): (&Description, &Base, Head),
    presses: &Presses,
    sensor: Sensor,
    (target, samples, figures): (&Target, &Samples, &[OutputFigures]),
    options: &Options,
) -> BTreeMap<String, String> {
    let is_file = presses.folder.is_file();
    let folder = if is_file { presses.folder.file_stem() } else { presses.folder.file_name() };
    let folder = folder.map_or_else(|| "presses".to_owned(), |name| name.to_string_lossy().into_owned());
    // Evaluations of a set with a split expect this of weights that have not seen the test.
    let trained_on = if presses.kept_back > 0 { "train".to_owned() } else { folder.clone() };
    let fitted_to = fingerprint(presses, samples);
    let presses = samples.presses.len();
    let strengths: Vec<f64> = figures.iter().map(|figure| figure.strength).collect();
    let products: Vec<f64> = figures.iter().map(|figure| figure.products).collect();
    let widths: Vec<f64> = figures.iter().map(|figure| figure.width).collect();
    let method = match target {
        Target::Quantities(_) => "ridge regression",
        Target::Classes { .. } => "a shrunken discriminant",
    };
    let (stays, read) = match head {
        Head::New => ("layers of events".to_owned(), "readouts"),
        Head::Kept { layers, .. } => {
            (format!("layers of events and {layers} behind the readout"), "what the next one read")
        }
    };
    let valid: serde_json::Map<String, serde_json::Value> = figures
        .iter()
        .map(|of| {
            let [low, high] = of.error.interval;
            (of.name.clone(), json!({"unit": of.unit, "error": of.error.mean, "interval": [low, high]}))
        })
        .collect();
    let mut card = BTreeMap::from([
        ("network", description.name().to_owned()),
        ("about", format!("{stays} of {}, head fitted to {presses} presses of {folder}", base.name)),
        ("trained_on", trained_on),
        ("presses", presses.to_string()),
        (FITTED_TO, fitted_to),
        ("seed", options.seed.to_string()),
        ("stride", base.stride.to_string()),
        ("sensor", json!([sensor.width, sensor.height]).to_string()),
        ("preparation", description.preparation()),
        ("valid", serde_json::Value::Object(valid).to_string()),
        (
            "recipe",
            format!(
                "{stays} of {} ({}); {method} of {read} at the end and at {} random ages of each press, relative strengths \
                 {strengths:?}, products of modes {products:?} and widths of kernels {widths:?} chosen by {} folds of presses",
                base.name, base.label, options.ages, options.folds
            ),
        ),
    ]);
    if let Target::Quantities(each) = target {
        let range = |i: usize| {
            let values = samples.instants.iter().map(|instant| instant.truth[i]);
            values.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], x| [low.min(x), high.max(x)])
        };
        let ranges: Vec<[f64; 2]> = (0..each.len()).map(range).collect();
        card.insert("ranges", json!(ranges).to_string());
    }
    let licence = base.weights.metadata().get("licence").cloned();
    card.extend(licence.map(|licence| ("licence", licence)));
    card.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}
