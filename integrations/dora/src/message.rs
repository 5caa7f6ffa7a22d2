//! What the nodes send each other: Arrow arrays, with metadata.
//!
//! Every message has the metadata `boot` (when its sender started, in nanoseconds since 1970; names the sender's life), `number` (of the
//! message on its output, from 0 in each life) and `sent_ns` (when it was sent, same clock).
//!
//! | output | array | further metadata |
//! |---|---|---|
//! | `events` | struct of `t_us` i64, `x` u16, `y` u16, `on` bool | `first`: number of the first event in the life of the source, also of a message without events; `width`, `height` of the sensor |
//! | `predictions` | f32, the outputs of the network | the fields of [`PredictionHeader`] |
//! | `losses` | struct of `from` u64, `until` u64, `reason` utf8: numbers of events that no prediction covers | `sensor`, `stream`, `order` |
//! | `counters` | struct of `sensor` utf8, `name` utf8, `reason` utf8, `value` u64 | |
//! | `commands` | f64, roll and pitch in radians | `sensor`, `fresh`, `age_ns` |

use std::sync::Arc;
use std::time::{SystemTime, UNIX_EPOCH};

use dora_node_api::arrow_v59::array::{
    Array, ArrayRef, BooleanArray, Float32Array, Float64Array, Int64Array, StringArray, StructArray,
    UInt16Array, UInt64Array,
};
use dora_node_api::arrow_v59::datatypes::{DataType, Field};
use dora_node_api::{DoraArray, MetadataParameters, Parameter};
use meissner::{Event, Sensor};
use serde::{Deserialize, Serialize};
use thiserror::Error;

/// A message that is not of the form that its output has.
#[derive(Debug, Error, PartialEq)]
pub(crate) enum MessageError {
    /// A metadatum is absent, of another type or out of range.
    #[error("metadata `{key}`: expected {expected}, got {found}")]
    Metadata { key: &'static str, expected: &'static str, found: String },
    /// The array has another type.
    #[error("array: expected {expected}, got {found}")]
    Array { expected: &'static str, found: String },
    /// The array has nulls.
    #[error("array: expected no nulls, got {0}")]
    Nulls(usize),
}

/// Nanoseconds since 1970, on this machine's clock.
pub(crate) fn now_ns() -> i64 {
    SystemTime::now().duration_since(UNIX_EPOCH).map_or(0, |since| since.as_nanos() as i64)
}

/// The integer called `key`.
pub(crate) fn integer(metadata: &MetadataParameters, key: &'static str) -> Result<i64, MessageError> {
    match metadata.get(key) {
        Some(&Parameter::Integer(value)) => Ok(value),
        found => Err(MessageError::Metadata { key, expected: "an integer", found: shown(found) }),
    }
}

/// The integer called `key`, which is not negative.
pub(crate) fn count(metadata: &MetadataParameters, key: &'static str) -> Result<u64, MessageError> {
    let value = integer(metadata, key)?;
    u64::try_from(value).map_err(|_| MessageError::Metadata {
        key,
        expected: "0 or more",
        found: value.to_string(),
    })
}

/// The text called `key`.
pub(crate) fn text<'a>(metadata: &'a MetadataParameters, key: &'static str) -> Result<&'a str, MessageError> {
    match metadata.get(key) {
        Some(Parameter::String(value)) => Ok(value),
        found => Err(MessageError::Metadata { key, expected: "a text", found: shown(found) }),
    }
}

/// The truth value called `key`.
pub(crate) fn flag(metadata: &MetadataParameters, key: &'static str) -> Result<bool, MessageError> {
    match metadata.get(key) {
        Some(&Parameter::Bool(value)) => Ok(value),
        found => Err(MessageError::Metadata { key, expected: "true or false", found: shown(found) }),
    }
}

fn shown(found: Option<&Parameter>) -> String {
    found.map_or_else(|| "nothing".to_owned(), |value| format!("{value:?}"))
}

/// Metadata with these entries.
pub(crate) fn metadata<const N: usize>(entries: [(&str, Parameter); N]) -> MetadataParameters {
    entries.into_iter().map(|(key, value)| (key.to_owned(), value)).collect()
}

/// Where a message of events belongs.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct EventsHeader {
    /// Life of the source.
    pub(crate) boot: i64,
    /// Number of the message.
    pub(crate) number: u64,
    /// Number of its first event.
    pub(crate) first: u64,
    /// When it was sent.
    pub(crate) sent_ns: i64,
    /// Geometry of the sensor.
    pub(crate) sensor: Sensor,
}

impl EventsHeader {
    /// The header in `metadata`.
    pub(crate) fn read(metadata: &MetadataParameters) -> Result<Self, MessageError> {
        let side = |key| {
            let found = count(metadata, key)?;
            u16::try_from(found).ok().filter(|&side| side > 0).ok_or_else(|| MessageError::Metadata {
                key,
                expected: "1 to 65535",
                found: found.to_string(),
            })
        };
        Ok(Self {
            boot: integer(metadata, "boot")?,
            number: count(metadata, "number")?,
            first: count(metadata, "first")?,
            sent_ns: integer(metadata, "sent_ns")?,
            sensor: Sensor::new(side("width")?, side("height")?),
        })
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
    let rows = structs(data, EVENTS)?;
    let times: &Int64Array = column(rows, "t_us", EVENTS)?;
    let columns: &UInt16Array = column(rows, "x", EVENTS)?;
    let lines: &UInt16Array = column(rows, "y", EVENTS)?;
    let on: &BooleanArray = column(rows, "on", EVENTS)?;
    events.extend(
        (0..rows.len())
            .map(|row| Event::new(times.value(row), columns.value(row), lines.value(row), on.value(row))),
    );
    Ok(())
}

/// The rows of a struct without nulls.
fn structs<'a>(data: &'a DoraArray, expected: &'static str) -> Result<&'a StructArray, MessageError> {
    let array = data.as_array();
    let rows = array.as_any().downcast_ref::<StructArray>();
    let rows = rows.ok_or_else(|| MessageError::Array { expected, found: data.type_name() })?;
    let nulls = rows.null_count() + rows.columns().iter().map(Array::null_count).sum::<usize>();
    if nulls > 0 { Err(MessageError::Nulls(nulls)) } else { Ok(rows) }
}

/// A column by its name.
fn column<'a, A: 'static>(
    rows: &'a StructArray,
    name: &str,
    expected: &'static str,
) -> Result<&'a A, MessageError> {
    let column = rows.column_by_name(name).and_then(|column| column.as_any().downcast_ref());
    column.ok_or_else(|| MessageError::Array { expected, found: format!("{:?}", rows.data_type()) })
}

/// What a prediction covers, and when it was made.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
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
    /// Number of the first event that it does not cover: all before it were given to the engine, or are in a loss.
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

impl PredictionHeader {
    /// The metadata beside those of every message.
    pub(crate) fn metadata(&self) -> MetadataParameters {
        let integer = |value: u64| Parameter::Integer(value as i64);
        let mut entries = metadata([
            ("sensor", Parameter::String(self.sensor.clone())),
            ("stream", Parameter::Integer(self.stream)),
            ("order", integer(self.order)),
            ("next", integer(self.next)),
            ("accepted", integer(self.accepted)),
            ("nodes", integer(self.nodes)),
            ("fresh", Parameter::Bool(self.fresh)),
            ("events_sent_ns", Parameter::Integer(self.events_sent_ns)),
            ("events_received_ns", Parameter::Integer(self.events_received_ns)),
        ]);
        if let Some(t_us) = self.t_us {
            entries.insert("t_us".to_owned(), Parameter::Integer(t_us));
        }
        entries
    }

    /// The header in `metadata`.
    pub(crate) fn read(metadata: &MetadataParameters) -> Result<Self, MessageError> {
        Ok(Self {
            sensor: text(metadata, "sensor")?.to_owned(),
            stream: integer(metadata, "stream")?,
            boot: integer(metadata, "boot")?,
            number: count(metadata, "number")?,
            order: count(metadata, "order")?,
            next: count(metadata, "next")?,
            accepted: count(metadata, "accepted")?,
            t_us: metadata.contains_key("t_us").then(|| integer(metadata, "t_us")).transpose()?,
            nodes: count(metadata, "nodes")?,
            fresh: flag(metadata, "fresh")?,
            events_sent_ns: integer(metadata, "events_sent_ns")?,
            events_received_ns: integer(metadata, "events_received_ns")?,
            sent_ns: integer(metadata, "sent_ns")?,
        })
    }
}

/// The values of a prediction as an array.
pub(crate) fn values_array(values: &[f32]) -> ArrayRef {
    Arc::new(Float32Array::from(values.to_vec()))
}

/// The values of a prediction.
pub(crate) fn read_values(data: &DoraArray) -> Result<Vec<f32>, MessageError> {
    let expected = "f32";
    let values = data.as_array().as_any().downcast_ref::<Float32Array>();
    let values = values.ok_or_else(|| MessageError::Array { expected, found: data.type_name() })?;
    if values.null_count() > 0 {
        return Err(MessageError::Nulls(values.null_count()));
    }
    Ok(values.values().to_vec())
}

/// A command as an array.
pub(crate) fn turn_array(turn: [f64; 2]) -> ArrayRef {
    Arc::new(Float64Array::from(turn.to_vec()))
}

/// A command.
pub(crate) fn read_turn(data: &DoraArray) -> Result<Vec<f64>, MessageError> {
    let turn = data.as_array().as_any().downcast_ref::<Float64Array>();
    let turn = turn.ok_or_else(|| MessageError::Array { expected: "f64", found: data.type_name() })?;
    Ok(turn.iter().flatten().collect())
}

/// Events that no prediction covers, by their numbers.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Loss {
    /// The first.
    pub(crate) from: u64,
    /// The first after them.
    pub(crate) until: u64,
    /// Why.
    pub(crate) reason: String,
}

/// A loss as an array.
pub(crate) fn loss_array(loss: &Loss) -> ArrayRef {
    let field = |name: &str, kind| Arc::new(Field::new(name, kind, false));
    let number = |value| Arc::new(UInt64Array::from(vec![value])) as ArrayRef;
    Arc::new(StructArray::from(vec![
        (field("from", DataType::UInt64), number(loss.from)),
        (field("until", DataType::UInt64), number(loss.until)),
        (
            field("reason", DataType::Utf8),
            Arc::new(StringArray::from(vec![loss.reason.as_str()])) as ArrayRef,
        ),
    ]))
}

const LOSSES: &str = "a struct of from u64, until u64, reason utf8";

/// The losses in `data`.
pub(crate) fn read_losses(data: &DoraArray) -> Result<Vec<Loss>, MessageError> {
    let rows = structs(data, LOSSES)?;
    let from: &UInt64Array = column(rows, "from", LOSSES)?;
    let until: &UInt64Array = column(rows, "until", LOSSES)?;
    let reasons: &StringArray = column(rows, "reason", LOSSES)?;
    let loss =
        |row| Loss { from: from.value(row), until: until.value(row), reason: reasons.value(row).to_owned() };
    Ok((0..rows.len()).map(loss).collect())
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

/// Counts as an array.
pub(crate) fn counters_array(counters: &[Counter]) -> ArrayRef {
    let field = |name: &str, kind| Arc::new(Field::new(name, kind, false));
    let texts = |of: fn(&Counter) -> &str| {
        Arc::new(StringArray::from_iter_values(counters.iter().map(of))) as ArrayRef
    };
    let values: UInt64Array = counters.iter().map(|counter| counter.value).collect::<Vec<_>>().into();
    Arc::new(StructArray::from(vec![
        (field("sensor", DataType::Utf8), texts(|counter| &counter.sensor)),
        (field("name", DataType::Utf8), texts(|counter| &counter.name)),
        (field("reason", DataType::Utf8), texts(|counter| &counter.reason)),
        (field("value", DataType::UInt64), Arc::new(values) as ArrayRef),
    ]))
}

const COUNTERS: &str = "a struct of sensor utf8, name utf8, reason utf8, value u64";

/// The counts in `data`.
pub(crate) fn read_counters(data: &DoraArray) -> Result<Vec<Counter>, MessageError> {
    let rows = structs(data, COUNTERS)?;
    let texts = |name| column::<StringArray>(rows, name, COUNTERS);
    let (sensors, names, reasons) = (texts("sensor")?, texts("name")?, texts("reason")?);
    let values: &UInt64Array = column(rows, "value", COUNTERS)?;
    let counter = |row| {
        Counter::with_reason(sensors.value(row), names.value(row), reasons.value(row), values.value(row))
    };
    Ok((0..rows.len()).map(counter).collect())
}

#[cfg(test)]
mod tests;
