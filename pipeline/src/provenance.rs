//! Where results come from: which network, with which weights, on what input. `docs/json.md` has the keys.
//!
//! Every JSON output of a network has a [`Header`]: `{"header": {...}}` as the first of several lines, the field `header`
//! of a single object.

use meissner_engine::Sensor;
use meissner_models::{Agreement, AnyDescription, Card, Weights};
use serde::Serialize;
use serde_json::Value;

/// Raised whenever a key changes its meaning or goes.
const SCHEMA: u32 = 1;

/// Where the results of a command come from.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Header {
    /// Version of the program.
    meissner: &'static str,
    schema: u32,
    command: &'static str,
    input: InputCard,
    /// The network; missing where there are several, each with its results.
    #[serde(flatten)]
    model: Option<ModelCard>,
    /// What a person should know about network, weights and input together.
    warnings: Vec<String>,
}

/// What was read.
#[derive(Clone, Debug, Default, Serialize)]
pub struct InputCard {
    /// Its name.
    pub name: String,
    /// Its format.
    pub format: String,
    /// Columns and rows; `None` where there are no pixels of events.
    pub sensor: Option<[u16; 2]>,
    /// Events in the input, where that is known beforehand.
    pub events: Option<u64>,
}

/// A network with its weights.
#[derive(Clone, Debug, Default, Serialize)]
pub struct ModelCard {
    /// The network.
    pub network: NetworkCard,
    /// Its weights.
    pub weights: WeightsCard,
    /// What it predicts, value after value.
    outputs: Vec<Output>,
    /// Names of the classes, where the values are their logits.
    pub classes: Option<Vec<String>>,
}

/// A network as it runs.
#[derive(Clone, Debug, Default, Serialize)]
pub struct NetworkCard {
    /// Its name.
    pub name: String,
    /// "events" or "frames".
    kind: &'static str,
    /// Of the network as it runs: what it computes and the values of its weights.
    fingerprint: Option<String>,
    /// Length of the window as it runs.
    pub span_us: Option<i64>,
    /// Most events of the window as it runs.
    pub capacity: Option<usize>,
    /// It takes every `stride`-th event.
    stride: usize,
    /// What the description says of how its input is prepared.
    preparation: Value,
}

/// Weights, and what is known about them.
#[derive(Clone, Debug, Default, Serialize)]
pub struct WeightsCard {
    /// Where they come from.
    source: String,
    about: Option<String>,
    /// Whether they were trained; `None` where they do not say.
    pub trained: Option<bool>,
    /// What they say about the preparation of their training's input: "same" as the network, "other", "drawn", "unstated".
    pub preparation: &'static str,
    /// Every how many events one was taken in the training.
    stride: usize,
    /// Sensor of the recordings of the training, where they say.
    sensor: Option<[u16; 2]>,
}

#[derive(Clone, Debug, Default, Serialize)]
struct Output {
    name: String,
    unit: String,
}

impl Header {
    /// Of results of one network.
    pub fn new(command: &'static str, input: InputCard, model: ModelCard) -> Self {
        let mut header = Self::of_many(command, input);
        header.warnings = model.warnings(header.input.sensor);
        header.model = Some(model);
        header
    }

    /// Of results of several networks, each of which says its own.
    pub fn of_many(command: &'static str, input: InputCard) -> Self {
        let (meissner, model, warnings) = (env!("CARGO_PKG_VERSION"), None, Vec::new());
        Self { meissner, schema: SCHEMA, command, input, model, warnings }
    }

    /// Logs the warnings.
    pub fn warn(&self) {
        self.warnings.iter().for_each(|warning| log::warn!("{warning}"));
    }
}

impl ModelCard {
    /// That of `description` with `weights` from `source`, which say so much on their `card`.
    pub fn new(description: &AnyDescription, weights: &Weights, card: &Card, source: String) -> Self {
        let (names, unit) = description.outputs();
        let (kind, agreement) = match description {
            AnyDescription::Events(description) => ("events", description.agreement(weights)),
            AnyDescription::Frames(description) => ("frames", description.agreement(weights)),
        };
        let (span_us, capacity) = match description {
            AnyDescription::Events(description) => {
                (Some(description.span_us()), Some(description.capacity()))
            }
            AnyDescription::Frames(_) => (None, None),
        };
        let preparation = description.preparation();
        Self {
            network: NetworkCard {
                name: description.name().to_owned(),
                kind,
                fingerprint: None,
                span_us,
                capacity,
                stride: card.stride,
                preparation: preparation
                    .and_then(|text| serde_json::from_str(&text).ok())
                    .unwrap_or(Value::Null),
            },
            weights: WeightsCard {
                source,
                about: card.about.clone(),
                trained: card.trained,
                preparation: agreement.word(),
                stride: card.stride,
                sensor: card.sensor.map(sides),
            },
            outputs: names.iter().map(|name| Output { name: name.clone(), unit: unit.to_owned() }).collect(),
            classes: description.classes().map(<[String]>::to_vec),
        }
    }

    /// The same for a run that takes every so many events one, whatever the weights say.
    #[must_use]
    pub fn taking_every(mut self, stride: usize) -> Self {
        self.network.stride = stride;
        self
    }

    /// The network takes every so many events one.
    pub fn stride(&self) -> usize {
        self.network.stride
    }

    /// The same of a network as it runs: its `fingerprint` and, over events, the length and the capacity of its window.
    #[must_use]
    pub fn running(mut self, fingerprint: u64, window: Option<(i64, usize)>) -> Self {
        self.network.fingerprint = Some(format!("{fingerprint:016x}"));
        if let Some((span_us, capacity)) = window {
            (self.network.span_us, self.network.capacity) = (Some(span_us), Some(capacity));
        }
        self
    }

    /// What a person should know before believing a prediction for events of `sensor`.
    pub fn warnings(&self, sensor: Option<[u16; 2]>) -> Vec<String> {
        let Self { network, weights, .. } = self;
        let name = &network.name;
        let mut warnings = Vec::new();
        let stated = network.preparation != Value::Null;
        if stated && weights.preparation == Agreement::Unstated.word() {
            warnings.push(format!(
                "weights do not say how they were prepared: predictions of {name} are those of their training only if it \
                 was prepared as {}",
                network.preparation
            ));
        }
        if weights.preparation == Agreement::Other.word() {
            warnings.push(format!(
                "weights were trained on another preparation than {name} computes: predictions are not those that they were \
                 trained for"
            ));
        }
        let described = network.preparation.get("span_us").and_then(Value::as_i64);
        if weights.preparation == Agreement::Same.word()
            && let (Some(described), Some(runs)) = (described, network.span_us)
            && described != runs
        {
            warnings.push(format!(
                "weights were trained with a window of {described} us, {name} runs with {runs} us"
            ));
        }
        if let (Some(trained), Some(found)) = (weights.sensor, sensor)
            && trained != found
        {
            let [[tw, th], [w, h]] = [trained, found];
            warnings.push(format!(
                "weights were trained on a sensor of {tw}x{th} pixels, the recording is of {w}x{h}: positions count in \
                 shares of the sensor, predictions may mean nothing"
            ));
        }
        warnings
    }

    /// Network and weights in few words, for people.
    pub fn trust(&self) -> String {
        let weights = &self.weights;
        let trained = match weights.trained {
            Some(true) => "trained",
            Some(false) => "drawn from a seed: predictions mean nothing",
            None => "do not say whether they are trained",
        };
        let prepared = match weights.preparation {
            "unstated" if self.network.preparation != Value::Null => ", do not say how they were prepared",
            "other" => ", on another preparation: predictions are not those they were trained for",
            _ => "",
        };
        let stride = match self.network.stride {
            1 => String::new(),
            n => format!(", on every {n} events one, which are taken here too"),
        };
        format!("{trained}{prepared}{stride}")
    }

    /// Where the weights come from, with what they say about themselves.
    pub fn source(&self) -> String {
        let about = self.weights.about.as_ref().map(|about| format!(" ({about})"));
        self.weights.source.clone() + &about.unwrap_or_default()
    }

    /// Headings of the values: names with their unit.
    pub fn headings(&self) -> Vec<String> {
        self.outputs.iter().map(|Output { name, unit }| format!("{name} ({unit})")).collect()
    }
}

impl InputCard {
    /// Events from a sensor.
    pub fn events(name: &str, format: &impl ToString, sensor: Sensor, events: Option<u64>) -> Self {
        Self { name: name.to_owned(), format: format.to_string(), sensor: Some(sides(sensor)), events }
    }

    /// Something without pixels of events.
    pub fn other(name: &str, format: &str) -> Self {
        Self { name: name.to_owned(), format: format.to_owned(), sensor: None, events: None }
    }
}

/// Columns and rows.
fn sides(sensor: Sensor) -> [u16; 2] {
    [sensor.width, sensor.height]
}
