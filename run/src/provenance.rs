//! The origin of results: the network, its weights and the input. `docs/json.md` explains the keys.
//!
//! Every JSON output of a network has a [`Header`]. It is the first line, `{"header": {...}}`, of
//! an output with several lines, and the field `header` of a single object.

use std::sync::OnceLock;

use meissner_engine::Sensor;
use meissner_models::{Agreement, AnyDescription, Weights};
use serde::Serialize;
use serde_json::Value;

use crate::error::{Result, RunError};
use crate::machine::Machine;
use crate::training::Output;

/// Version of the JSON format. It increases when a key is removed or changes its meaning.
const SCHEMA: u32 = 1;

/// The origin of the results of a command.
#[derive(Clone, Debug, Default, Serialize)]
pub struct Header {
    meissner: &'static str,
    schema: u32,
    command: &'static str,
    /// Command line and machine; missing if no program stated them with [`made_by`].
    #[serde(skip_serializing_if = "Option::is_none")]
    made: Option<&'static Made>,
    /// The input.
    pub input: InputCard,
    /// The network; missing if there are several networks, which are listed with their results.
    #[serde(flatten)]
    model: Option<ModelCard>,
    /// Warnings about the combination of network, weights and input.
    warnings: Vec<String>,
}

/// The command line and the machine of a result.
#[derive(Debug, Serialize)]
struct Made {
    /// The words of the command line.
    arguments: Vec<String>,
    machine: Machine,
}

static MADE: OnceLock<Made> = OnceLock::new();

/// Sets once for this process the command line of its results. Headers made from now on contain it,
/// with the machine.
pub fn made_by(arguments: Vec<String>) {
    MADE.get_or_init(|| Made { arguments, machine: Machine::this() });
}

/// The input of a command.
#[derive(Clone, Debug, Default, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct InputCard {
    pub name: String,
    pub format: String,
    /// Columns and rows; `None` if the input has no pixels of events.
    pub sensor: Option<[u16; 2]>,
    /// Number of events in the input, if it is known in advance.
    pub events: Option<u64>,
}

/// A network with its weights.
#[derive(Clone, Debug, Default, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct ModelCard {
    pub network: NetworkCard,
    pub weights: WeightsCard,
    /// The predicted values, in order.
    pub outputs: Vec<Output>,
    /// Names of the classes, if the values are logits.
    pub classes: Option<Vec<String>>,
}

/// A network with the options that it runs with.
#[derive(Clone, Debug, Default, Serialize)]
pub struct NetworkCard {
    /// Its name.
    pub name: String,
    /// "events" or "frames".
    kind: &'static str,
    /// Fingerprint of the running network: its computation and the values of its weights.
    fingerprint: Option<String>,
    /// Length of the window in this run.
    pub span_us: Option<i64>,
    /// Largest number of events in the window in this run.
    pub capacity: Option<usize>,
    /// The network takes every `stride`-th event.
    pub stride: usize,
    /// The preparation of the input, from the description.
    preparation: Value,
}

/// Weights and their metadata.
#[derive(Clone, Debug, Default, Serialize)]
pub struct WeightsCard {
    source: String,
    about: Option<String>,
    /// Whether the weights were trained; `None` if the metadata does not say.
    pub trained: Option<bool>,
    /// Preparation of the training's input: "same", "other", "drawn" or "unstated".
    pub preparation: &'static str,
    /// Stride of the events in the training: one of every `stride` events was taken.
    stride: usize,
    /// Sensor of the training recordings, if the metadata states it.
    sensor: Option<[u16; 2]>,
}

impl Header {
    /// A header for the results of one network.
    pub fn new(command: &'static str, input: InputCard, model: ModelCard) -> Self {
        let mut header = Self::of_many(command, input);
        header.warnings = model.warnings(header.input.sensor);
        header.model = Some(model);
        header
    }

    /// A header for the results of several networks, each of which is described with its results.
    pub fn of_many(command: &'static str, input: InputCard) -> Self {
        let (meissner, model, warnings) = (env!("CARGO_PKG_VERSION"), None, Vec::new());
        Self { meissner, schema: SCHEMA, command, made: MADE.get(), input, model, warnings }
    }

    /// Logs the warnings.
    pub fn warn(&self) {
        self.warnings.iter().for_each(|warning| tracing::warn!("{warning}"));
    }
}

impl ModelCard {
    /// The card of the network of `description` with `weights` from `source`.
    ///
    /// # Errors
    /// The metadata of the weights cannot be read, or state ranges of other outputs.
    pub fn new(description: &AnyDescription, weights: &Weights, source: String) -> Result<Self> {
        let card = weights.card().map_err(|error| RunError::weights(source.clone(), error))?;
        let (names, units) = description.outputs();
        let (kind, agreement, window) = match description {
            AnyDescription::Events(events) => {
                ("events", events.agreement(weights), Some((events.span_us(), events.capacity())))
            }
            AnyDescription::Frames(frames) => ("frames", frames.agreement(weights), None),
        };
        let outputs = Output::all(names, units, card.ranges)
            .map_err(|error| RunError::weights(source.clone(), error))?;
        let preparation = description.preparation().and_then(|text| serde_json::from_str(&text).ok());
        Ok(Self {
            network: NetworkCard {
                name: description.name().to_owned(),
                kind,
                fingerprint: None,
                span_us: window.map(|(span_us, _)| span_us),
                capacity: window.map(|(_, capacity)| capacity),
                stride: card.stride,
                preparation: preparation.unwrap_or(Value::Null),
            },
            weights: WeightsCard {
                source,
                about: card.about,
                trained: card.trained,
                preparation: agreement.word(),
                stride: card.stride,
                sensor: card.sensor.map(sides),
            },
            outputs,
            classes: description.classes().map(<[String]>::to_vec),
        })
    }

    /// Adds the `fingerprint` of the running network, and length and capacity of its window.
    #[must_use]
    pub fn running(mut self, fingerprint: u64, window: Option<(i64, usize)>) -> Self {
        self.network.fingerprint = Some(format!("{fingerprint:016x}"));
        if let Some((span_us, capacity)) = window {
            (self.network.span_us, self.network.capacity) = (Some(span_us), Some(capacity));
        }
        self
    }

    /// Warnings that matter before a prediction for events of `sensor` can be trusted.
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

    /// A short description of network and weights, for text reports.
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

    /// The source of the weights, with their own description.
    pub fn source(&self) -> String {
        let about = self.weights.about.as_ref().map(|about| format!(" ({about})"));
        self.weights.source.clone() + &about.unwrap_or_default()
    }

    /// Column headings of the values for people: their names and units.
    pub fn headings(&self) -> Vec<String> {
        self.outputs.iter().map(|output| format!("{} ({})", output.name, output.shown_unit())).collect()
    }
}

impl InputCard {
    /// An input of events from a sensor.
    pub fn events(name: &str, format: &impl ToString, sensor: Sensor, events: Option<u64>) -> Self {
        Self { name: name.to_owned(), format: format.to_string(), sensor: Some(sides(sensor)), events }
    }

    /// An input without pixels of events.
    pub fn other(name: &str, format: &str) -> Self {
        Self { name: name.to_owned(), format: format.to_owned(), sensor: None, events: None }
    }
}

fn sides(sensor: Sensor) -> [u16; 2] {
    [sensor.width, sensor.height]
}
