//! Preparation of the input of a training: weights and description must agree on it.
//!
//! Weights state it in their metadata `preparation`, a JSON object in the words of a description.
//! For a network over events, it describes the graph:
//!
//! ```text
//! {"kind":"knn","k":8,"candidates":"past","lifetime":"window","normalisation":"fixed",
//!  "scales":[0.1,0.1176],
//!  "span_us":300000,"cells":[["1/8","1/8","1/3"]]}
//! ```
//!
//! `scales` of edge attributes, level by level, are missing with "per-graph". `cells` are those of
//! the poolings. `place` means that places in cells are an input; `filters` are the filters before
//! the network, as in their tables. `lifetime` may be missing: both give the same graph until an
//! event leaves. The published contact-angle checkpoint has no metadata and counts as
//! `graphres-published`.
//!
//! For a network over readings of electrodes, it contains the words of `[input]`:
//!
//! ```text
//! {"frames":"tactile-image","steps":5,"scaling":"image"}
//! {"frames":"electrodes","steps":5,"scaling":["reading",[1911.0,3743.0]]}
//! ```
//!
//! For a network over frames of events, it is its filters, `{"filters":[...]}`, if it has any.
//!
//! Sampling is not compared: windows without overlap in training may slide in a run.
//!
//! Weights that state another preparation are refused unless the caller accepts them. Weights
//! without a statement are accepted, and `agreement` reports it.

use meissner_engine::filters::FilterRule;
use meissner_engine::{Normalisation, Reach};
use serde_json::{Map, Value, json};

use super::frames::{FrameDescription, FrameSource};
use super::layer::{LayerKind, normalisation_word};
use super::{Description, filters};
use crate::error::ModelError;
use crate::weights::Weights;

pub(crate) const KEY: &str = "preparation";
/// The keys of the object for readings, in order.
const READING_KEYS: [&str; 3] = ["frames", "steps", "scaling"];
/// The network with the preparation of the published checkpoint.
const PUBLISHED: &str = "graphres-published";
/// The key that weights may omit.
const LIFETIME: &str = "lifetime";

/// Whether weights state the same preparation of their training's input as a description.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum Agreement {
    /// They state the same preparation.
    Same,
    /// They state no preparation because they were drawn from a seed.
    Drawn,
    /// They state no preparation.
    Unstated,
    /// They state another preparation.
    Other,
}

impl Agreement {
    /// Its word in reports: "same", "drawn", "unstated" or "other".
    pub fn word(self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::Drawn => "drawn",
            Self::Unstated => "unstated",
            Self::Other => "other",
        }
    }

    /// Compares the preparation `expected` by a description with the one that `weights` state.
    fn of(weights: &Weights, expected: Option<&str>) -> Self {
        let Some(stated) = stated_or_published(weights) else {
            return if weights.is_drawn() { Self::Drawn } else { Self::Unstated };
        };
        let (Some(mut expected), Some(found)) = (expected.and_then(entries), entries(&stated)) else {
            return Self::Other;
        };
        if !found.contains_key(LIFETIME) {
            expected.remove(LIFETIME);
        }
        if expected == found { Self::Same } else { Self::Other }
    }
}

impl Description {
    /// The metadata `preparation` of weights trained for it: the graph's rule, scales, span and
    /// cells of poolings, as a JSON object.
    pub fn preparation(&self) -> String {
        let summary = self.graph_summary();
        let mut entries = vec![("kind", json!(summary.kind))];
        match self.graph.reach {
            Reach::Knn { k } => entries.push(("k", json!(k))),
            Reach::Radius { r, max } => entries.extend([("r", json!(r)), ("max", json!(max))]),
        }
        entries.push(("candidates", json!(summary.candidates)));
        entries.extend(summary.lifetime.map(|lifetime| (LIFETIME, json!(lifetime))));
        let (mut scales, mut cells) = (vec![self.scale.to_string()], Vec::new());
        for layer in &self.layers {
            if let LayerKind::Pool { cell, scale, .. } = &layer.kind {
                scales.push(scale.to_string());
                cells.push(cell.cell.iter().chain(&cell.time).map(ToString::to_string).collect::<Vec<_>>());
            }
        }
        let fixed = self.normalisation == Normalisation::Fixed;
        entries.push(("normalisation", json!(normalisation_word(self.normalisation))));
        let mut text: Vec<String> = entries.iter().map(|(key, value)| format!("{key:?}:{value}")).collect();
        if fixed {
            // The shortest digits of an f32. The shortest digits of the equal f64 can be longer.
            text.push(format!("\"scales\":[{}]", scales.join(",")));
        }
        text.push(format!("\"span_us\":{}", self.span_us));
        text.push(format!("\"cells\":{}", json!(cells)));
        text.extend(
            self.place.map(|place| format!("\"place\":{}", json!(place.map(|size| size.to_string())))),
        );
        text.extend(filtered(&self.filters));
        format!("{{{}}}", text.join(","))
    }

    /// Whether `weights` state that they were trained on graphs of this description.
    pub fn agreement(&self, weights: &Weights) -> Agreement {
        Agreement::of(weights, Some(&self.preparation()))
    }

    /// `Ok` if `weights` state the same preparation as this description, or none.
    pub(super) fn check_preparation(&self, weights: &Weights) -> Result<(), ModelError> {
        check(self.name(), Some(self.preparation()), "", weights)
    }
}

impl FrameDescription {
    /// The metadata `preparation` of weights trained for it, as JSON: for readings of electrodes,
    /// frames, steps and scaling in the words of `[input]`; for events, the filters; `None` for
    /// pictures, and without filters.
    pub fn preparation(&self) -> Option<String> {
        let (FrameSource::TactileImage(_) | FrameSource::Electrodes(_)) = self.source() else {
            return filtered(self.filters()).map(|filters| format!("{{{filters}}}"));
        };
        let settings = serde_json::to_value(self.source()).unwrap_or_default();
        let entries = READING_KEYS.iter().filter_map(|&key| Some(format!("{key:?}:{}", settings.get(key)?)));
        Some(format!("{{{}}}", entries.collect::<Vec<_>>().join(",")))
    }

    /// Whether `weights` state that they were trained on frames of this description.
    pub fn agreement(&self, weights: &Weights) -> Agreement {
        Agreement::of(weights, self.preparation().as_deref())
    }

    /// `Ok` if `weights` state the same preparation as this description, or none.
    pub(super) fn check_preparation(&self, weights: &Weights) -> Result<(), ModelError> {
        check(self.name(), self.preparation(), self.source().word(), weights)
    }
}

/// The entry of filters, if there are any.
fn filtered(rules: &[FilterRule]) -> Option<String> {
    (!rules.is_empty()).then(|| format!("\"filters\":{}", filters::json(rules)))
}

/// `Ok` if `weights` state the preparation that `network` expects, or none. A network without an
/// expected preparation has frames of the kind `frames`.
fn check(network: &str, expected: Option<String>, frames: &str, weights: &Weights) -> Result<(), ModelError> {
    if Agreement::of(weights, expected.as_deref()) != Agreement::Other {
        return Ok(());
    }
    Err(ModelError::Preparation {
        network: network.to_owned(),
        expected: expected.unwrap_or_else(|| format!("none, since frames = {frames:?}")),
        found: stated_or_published(weights).unwrap_or_default(),
        published: weights.is_published().then_some(PUBLISHED),
    })
}

/// The preparation that `weights` state, or that of the published checkpoint if they are its
/// weights.
fn stated_or_published(weights: &Weights) -> Option<String> {
    let known = || {
        let published = weights.is_published().then(|| Description::shipped(PUBLISHED)).flatten();
        published.map(|description| description.preparation())
    };
    weights.metadata().get(KEY).cloned().or_else(known)
}

/// The entries of a JSON object that are compared, with numbers as in the engine: 3488 equals
/// 3488.0.
fn entries(text: &str) -> Option<Map<String, Value>> {
    let entries: Map<String, Value> = serde_json::from_str(text).ok()?;
    let counting = entries.into_iter().filter(|(key, _)| key != "sampling");
    Some(counting.map(|(key, value)| (key, rounded(value))).collect())
}

/// `value` with its numbers, including those of nested lists and objects, as f32.
fn rounded(value: Value) -> Value {
    match value {
        Value::Object(entries) => entries.into_iter().map(|(key, value)| (key, rounded(value))).collect(),
        // The parser limits the depth of lists to 128.
        Value::Array(list) => list.into_iter().map(rounded).collect(),
        value => value.as_f64().map_or(value, |number| Value::from(number as f32)),
    }
}
