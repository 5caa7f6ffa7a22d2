//! How the readings that weights were trained on were prepared: what a description and its weights must agree on.
//!
//! Weights say it in their metadata under `preparation`, as a JSON object with the words of a description's `[input]`:
//!
//! ```text
//! {"frames":"tactile-image","steps":5,"scaling":"image"}
//! {"frames":"electrodes","steps":5,"scaling":["reading",[1911.0,3743.0]]}
//! ```
//!
//! How readings are sampled is no part of it: a network that was trained on windows that do not overlap may run on sliding
//! ones. Weights that say nothing are taken as they are.

use serde_json::{Map, Value};

use super::super::Agreement;
use super::{FrameDescription, FrameSource};
use crate::{ModelError, Weights};

/// The key of the metadata.
pub(in super::super) const KEY: &str = "preparation";
/// The keys of the object, in order.
const KEYS: [&str; 3] = ["frames", "steps", "scaling"];

impl FrameDescription {
    /// What weights that are trained for this description carry as metadata `preparation`: frames, steps and scaling in the
    /// words of `[input]`, as a JSON object. `None` where frames are not made of readings of electrodes.
    pub fn preparation(&self) -> Option<String> {
        match self.source() {
            FrameSource::TactileImage(_) | FrameSource::Electrodes(_) => {
                let settings = self.settings();
                let entries = KEYS.iter().filter_map(|&key| Some(format!("{key:?}:{}", settings.get(key)?)));
                Some(format!("{{{}}}", entries.collect::<Vec<_>>().join(",")))
            }
            _ => None,
        }
    }

    /// Whether `weights` were trained on frames as this description has them made, by what they say.
    pub fn agreement(&self, weights: &Weights) -> Agreement {
        let Some(found) = weights.metadata().get(KEY) else { return Agreement::without_statement(weights) };
        let read = |text: &str| serde_json::from_str::<Map<String, Value>>(text).ok().map(normal);
        let expected = self.preparation().as_deref().and_then(read);
        if expected.is_some() && expected == read(found) { Agreement::Same } else { Agreement::Other }
    }

    /// `Ok` where `weights` do not say how their frames were prepared, or say the same as this description.
    pub(super) fn check_preparation(&self, weights: &Weights) -> Result<(), ModelError> {
        if self.agreement(weights) != Agreement::Other {
            return Ok(());
        }
        let none = || format!("none, since frames = {:?}", self.source().word());
        Err(ModelError::Preparation {
            network: self.name().to_owned(),
            expected: self.preparation().unwrap_or_else(none),
            found: weights.metadata().get(KEY).cloned().unwrap_or_default(),
            published: None,
        })
    }

    fn settings(&self) -> Map<String, Value> {
        match serde_json::to_value(self.source()) {
            Ok(Value::Object(settings)) => settings,
            _ => Map::new(),
        }
    }
}

/// The entries that count, with numbers as the engine takes them, so that 3488 and 3488.0 are the same.
pub(in super::super) fn normal(entries: Map<String, Value>) -> Map<String, Value> {
    // Sampling may be there and does not count.
    let counting = entries.into_iter().filter(|(key, _)| key != "sampling");
    counting.map(|(key, value)| (key, rounded(value))).collect()
}

/// `value` with its numbers, also those of lists in lists, as f32.
fn rounded(value: Value) -> Value {
    match value {
        // A text that a file holds is parsed to a depth of 128 at most.
        Value::Array(list) => list.into_iter().map(rounded).collect(),
        value => value.as_f64().map_or(value, |number| Value::from(number as f32)),
    }
}

#[cfg(test)]
mod tests {
    use std::collections::BTreeMap;

    use super::KEY;
    use crate::{FrameDescription, ModelError, draw};

    fn description(network: &str, scaling: &str) -> FrameDescription {
        let text = match network {
            "slip-lstm" => include_str!("../../../networks/slip-lstm.toml"),
            _ => include_str!("../../../networks/slip-tuned.toml"),
        };
        let from = if network == "slip-lstm" { "scaling = \"reading\"" } else { "scaling = \"image\"" };
        FrameDescription::parse(&text.replace(from, &format!("scaling = {scaling}"))).expect("consistent")
    }

    fn built(description: &FrameDescription, preparation: Option<&str>) -> Result<(), ModelError> {
        let metadata: BTreeMap<_, _> =
            preparation.iter().map(|text| (KEY.to_owned(), (*text).to_owned())).collect();
        description.network_parts(&draw(description, 1).with_metadata(metadata)).map(drop)
    }

    #[test]
    fn the_preparation_has_the_words_of_the_file() {
        let of = |network, scaling| description(network, scaling).preparation().expect("over readings");
        assert_eq!(
            of("slip-lstm", "\"reading\""),
            r#"{"frames":"electrodes","steps":5,"scaling":"reading"}"#
        );
        assert_eq!(
            of("slip-tuned", "[0, 3488.1]"),
            r#"{"frames":"tactile-image","steps":5,"scaling":[0.0,3488.1]}"#
        );
        assert_eq!(FrameDescription::shipped("force-lstm").expect("shipped").preparation(), None);
    }

    #[test]
    fn weights_that_say_the_same_or_nothing_fit() {
        let range = description("slip-tuned", "[0, 3488.1]");
        built(&range, None).unwrap();
        built(&range, range.preparation().as_deref()).unwrap();
        let other_words =
            r#"{ "sampling": 3, "scaling": [0, 3488.10], "steps": 5.0, "frames": "tactile-image" }"#;
        built(&range, Some(other_words)).unwrap();
    }

    #[test]
    fn a_preparation_of_two_scalings_is_read_back() {
        let text = include_str!("../../../networks/slip-lstm.toml")
            .replace("values = 24", "values = 48")
            .replace("scaling = \"reading\"", "scaling = [\"reading\", [1911, 3743.1]]");
        let both = FrameDescription::parse(&text).expect("consistent");
        let preparation = both.preparation().expect("over readings");
        let expected = r#"{"frames":"electrodes","steps":5,"scaling":["reading",[1911.0,3743.1]]}"#;
        assert_eq!(preparation, expected);
        built(&both, Some(&preparation)).unwrap();
        let other_words = preparation.replace("1911.0", "1911").replace("3743.1", "3743.10");
        built(&both, Some(&other_words)).unwrap();
        for scaling in [r#"["reading",[1911,3743]]"#, r#""reading""#, "[1911,3743.1]", r#"["reading"]"#] {
            let found = format!(r#"{{"frames":"electrodes","steps":5,"scaling":{scaling}}}"#);
            let error = built(&both, Some(&found)).expect_err(&found);
            assert!(matches!(error, ModelError::Preparation { .. }), "{error}");
        }
    }

    #[test]
    fn weights_that_were_trained_on_other_frames_are_refused_with_both() {
        let image = description("slip-tuned", "\"image\"");
        for found in [
            r#"{"frames":"electrodes","steps":5,"scaling":"image"}"#,
            r#"{"frames":"tactile-image","steps":4,"scaling":"image"}"#,
            r#"{"frames":"tactile-image","steps":5,"scaling":[0,3488]}"#,
            r#"{"frames":"tactile-image","steps":5}"#,
            r#"{"frames":"tactile-image","steps":5,"scaling":"image","order":"reversed"}"#,
            "image",
        ] {
            let error = built(&image, Some(found)).expect_err(found);
            assert!(matches!(error, ModelError::Preparation { .. }), "{error}");
            let message = error.to_string();
            let expected = image.preparation().expect("over readings");
            assert!(message.contains(&expected) && message.contains(found), "{message}");
        }
    }

    #[test]
    fn a_network_over_events_refuses_weights_for_readings() {
        let force = FrameDescription::shipped("force-tdnn").expect("shipped");
        let error = built(&force, Some("{}")).unwrap_err().to_string();
        assert!(error.contains("event-counts"), "{error}");
    }
}
