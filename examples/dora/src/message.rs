//! What the nodes send each other: Arrow arrays, with metadata.
//!
//! Every message has the metadata of a [`Stamp`].
//!
//! | output | array | further metadata |
//! |---|---|---|
//! | `events` | struct of `t_us` i64, `x` u16, `y` u16, `on` bool | the fields of [`EventsHeader`] |
//! | `predictions` | f32, the outputs of the network | the fields of [`PredictionHeader`] |
//! | `losses` | utf8, a [`Gap`](meissner_packets::Gap) as JSON | the fields of [`LossHeader`] |
//! | `counters` | utf8, each a [`Counter`] as JSON | |
//! | `commands` | f64, roll and pitch in radians | the fields of [`CommandHeader`] |

use std::num::NonZeroU16;
use std::sync::Arc;

use dora_node_api::arrow_v59::array::{
    Array, ArrayRef, BooleanArray, Float32Array, Float64Array, Int64Array, StringArray, StructArray,
    UInt16Array,
};
use dora_node_api::arrow_v59::datatypes::Field;
use dora_node_api::{DoraArray, MetadataParameters, Parameter};
use meissner::{Event, Sensor};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};
use thiserror::Error;

/// A message that is not of the form that its output has.
#[derive(Debug, Error)]
pub(crate) enum MessageError {
    /// A metadatum is absent, of another type or out of range.
    #[error("metadata: {0}")]
    Metadata(serde_json::Error),
    /// The array has another type.
    #[error("array: expected {expected}, got {found}")]
    Array { expected: &'static str, found: String },
    /// The array has nulls.
    #[error("array: expected no nulls, got {0}")]
    Nulls(usize),
    /// A text is not the JSON that it should be.
    #[error("text: {0}")]
    Text(serde_json::Error),
}

/// Metadata with the fields of `entries`: integers, truth values and texts. Others are left out.
pub(crate) fn metadata(entries: &impl Serialize) -> MetadataParameters {
    let Ok(Value::Object(entries)) = serde_json::to_value(entries) else {
        return MetadataParameters::default();
    };
    let parameter = |(key, value): (String, Value)| {
        let value = match value {
            Value::Bool(value) => Parameter::Bool(value),
            Value::String(value) => Parameter::String(value),
            Value::Number(value) => Parameter::Integer(value.as_i64().or(value.as_u64().map(|v| v as i64))?),
            _ => return None,
        };
        Some((key, value))
    };
    entries.into_iter().filter_map(parameter).collect()
}

/// The fields of `T` in `metadata`.
pub(crate) fn read<T: DeserializeOwned>(metadata: &MetadataParameters) -> Result<T, MessageError> {
    let value = |(key, parameter): (&String, &Parameter)| {
        let value = match parameter {
            Parameter::Bool(value) => (*value).into(),
            Parameter::Integer(value) => (*value).into(),
            Parameter::Float(value) => (*value).into(),
            Parameter::String(value) => value.as_str().into(),
            _ => return None,
        };
        Some((key.clone(), value))
    };
    let entries: Map<String, Value> = metadata.iter().filter_map(value).collect();
    serde_json::from_value(Value::Object(entries)).map_err(MessageError::Metadata)
}

/// Which message it is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Stamp {
    /// When its sender started, in nanoseconds since 1970: the name of the sender's life.
    pub(crate) boot: i64,
    /// Its number on its output, from 0 in each life.
    pub(crate) number: u64,
    /// When it was sent, in nanoseconds since 1970.
    pub(crate) sent_ns: i64,
}

/// Where a message of events belongs.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct EventsHeader {
    /// Number of its first event in the life of the source, also of a message without events.
    pub(crate) first: u64,
    /// Columns of the sensor.
    pub(crate) width: NonZeroU16,
    /// Rows of the sensor.
    pub(crate) height: NonZeroU16,
}

impl EventsHeader {
    /// The sensor.
    pub(crate) fn sensor(&self) -> Sensor {
        Sensor::new(self.width.get(), self.height.get())
    }
}

/// What a prediction covers, and when it was made.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct PredictionHeader {
    /// Name of the sensor: the input of the inference node.
    pub(crate) sensor: String,
    /// Life of the source whose events it covers.
    pub(crate) stream: i64,
    /// Life of the inference node.
    pub(crate) boot: i64,
    /// Number of the prediction on its output.
    pub(crate) number: u64,
    /// Place among all messages in this life of the inference node.
    pub(crate) order: u64,
    /// Number of the first event that it does not cover: all before it were given to the engine, or
    /// are in a loss.
    pub(crate) next: u64,
    /// Events that were given to the engine, of this stream.
    pub(crate) accepted: u64,
    /// Time of the newest event in the window, in microseconds.
    pub(crate) t_us: Option<i64>,
    /// Events in the window.
    pub(crate) nodes: u64,
    /// Whether it covers everything that had arrived.
    pub(crate) fresh: bool,
    /// When the newest covered message of events was sent, in nanoseconds.
    pub(crate) events_sent_ns: i64,
    /// When that message arrived at the inference node.
    pub(crate) events_received_ns: i64,
    /// When the prediction was sent.
    pub(crate) sent_ns: i64,
}

/// Where a loss belongs.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct LossHeader {
    /// Name of the sensor.
    pub(crate) sensor: String,
    /// Life of the source.
    pub(crate) stream: i64,
    /// Place among all messages in this life of the inference node.
    pub(crate) order: u64,
}

/// What a command was made from.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CommandHeader {
    /// Name of the sensor.
    pub(crate) sensor: String,
    /// Whether it was made from a new prediction.
    pub(crate) fresh: bool,
    /// Age of the events that it was made from, in nanoseconds.
    pub(crate) age_ns: i64,
}

/// A count of a sensor.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Counter {
    /// Name of the sensor.
    pub(crate) sensor: String,
    /// What is counted.
    pub(crate) name: String,
    /// Why, for what was dropped; otherwise empty.
    pub(crate) reason: String,
    /// The count since the start of the source.
    pub(crate) value: u64,
}

impl Counter {
    /// A count without a reason.
    pub(crate) fn new(sensor: &str, name: &str, value: u64) -> Self {
        Self::with_reason(sensor, name, "", value)
    }

    /// A count with a reason.
    pub(crate) fn with_reason(sensor: &str, name: &str, reason: &str, value: u64) -> Self {
        let [sensor, name, reason] = [sensor, name, reason].map(str::to_owned);
        Self { sensor, name, reason, value }
    }
}

/// Events as an array.
pub(crate) fn events_array(events: &[Event]) -> ArrayRef {
    let column =
        |name: &str, array: ArrayRef| (Arc::new(Field::new(name, array.data_type().clone(), false)), array);
    let times: Int64Array = events.iter().map(|event| event.t_us).collect::<Vec<_>>().into();
    let columns: UInt16Array = events.iter().map(|event| event.x).collect::<Vec<_>>().into();
    let rows: UInt16Array = events.iter().map(|event| event.y).collect::<Vec<_>>().into();
    let on: BooleanArray = events.iter().map(|event| event.on).collect::<Vec<_>>().into();
    Arc::new(StructArray::from(vec![
        column("t_us", Arc::new(times)),
        column("x", Arc::new(columns)),
        column("y", Arc::new(rows)),
        column("on", Arc::new(on)),
    ]))
}

const EVENTS: &str = "a struct of t_us i64, x u16, y u16, on bool";

/// The events in `data`, appended to `events`.
pub(crate) fn read_events(data: &DoraArray, events: &mut Vec<Event>) -> Result<(), MessageError> {
    let rows: &StructArray = array(data, EVENTS)?;
    let nulls = rows.columns().iter().map(Array::null_count).sum::<usize>();
    if nulls > 0 {
        return Err(MessageError::Nulls(nulls));
    }
    let times: &Int64Array = column(rows, "t_us")?;
    let columns: &UInt16Array = column(rows, "x")?;
    let lines: &UInt16Array = column(rows, "y")?;
    let on: &BooleanArray = column(rows, "on")?;
    events.extend(
        (0..rows.len())
            .map(|row| Event::new(times.value(row), columns.value(row), lines.value(row), on.value(row))),
    );
    Ok(())
}

/// An array without nulls, of the type that is expected.
fn array<'a, A: Array + 'static>(data: &'a DoraArray, expected: &'static str) -> Result<&'a A, MessageError> {
    let array = data.as_array().as_any().downcast_ref::<A>();
    let array = array.ok_or_else(|| MessageError::Array { expected, found: data.type_name() })?;
    if array.null_count() > 0 { Err(MessageError::Nulls(array.null_count())) } else { Ok(array) }
}

/// A column of events by its name.
fn column<'a, A: 'static>(rows: &'a StructArray, name: &str) -> Result<&'a A, MessageError> {
    let column = rows.column_by_name(name).and_then(|column| column.as_any().downcast_ref());
    column.ok_or_else(|| MessageError::Array { expected: EVENTS, found: format!("{:?}", rows.data_type()) })
}

/// The values of a prediction as an array.
pub(crate) fn values_array(values: &[f32]) -> ArrayRef {
    Arc::new(Float32Array::from(values.to_vec()))
}

/// The values of a prediction.
pub(crate) fn read_values(data: &DoraArray) -> Result<Vec<f32>, MessageError> {
    Ok(array::<Float32Array>(data, "f32")?.values().to_vec())
}

/// A command as an array.
pub(crate) fn turn_array(turn: [f64; 2]) -> ArrayRef {
    Arc::new(Float64Array::from(turn.to_vec()))
}

/// A command.
pub(crate) fn read_turn(data: &DoraArray) -> Result<Vec<f64>, MessageError> {
    Ok(array::<Float64Array>(data, "f64")?.values().to_vec())
}

/// Items as texts of JSON.
pub(crate) fn texts_array<T: Serialize>(items: &[T]) -> ArrayRef {
    let text = |item| serde_json::to_string(item).expect("counts and texts are written without errors");
    Arc::new(StringArray::from_iter_values(items.iter().map(text)))
}

/// The items in texts of JSON.
pub(crate) fn read_texts<T: DeserializeOwned>(data: &DoraArray) -> Result<Vec<T>, MessageError> {
    let texts: &StringArray = array(data, "utf8")?;
    texts.iter().flatten().map(|text| serde_json::from_str(text).map_err(MessageError::Text)).collect()
}

#[cfg(test)]
mod tests;
