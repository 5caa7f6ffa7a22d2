//! Messages between the nodes: Arrow arrays, with metadata.
//!
//! Every message has the metadata of a [`Stamp`].
//!
//! | output | array | further metadata |
//! |---|---|---|
//! | `events` | struct: `t_us` i64, `x` u16, `y` u16, `on` bool | the fields of [`EventsHeader`] |
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
use meissner_packets::{PacketError, failed};
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use serde_json::{Map, Value};

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
pub(crate) fn read<T: DeserializeOwned>(metadata: &MetadataParameters) -> Result<T, PacketError> {
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
    serde_json::from_value(Value::Object(entries)).map_err(failed("metadata"))
}

/// The identity of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Stamp {
    /// Start of its sender, in nanoseconds since 1970: the name of the sender's life.
    pub(crate) boot: i64,
    /// Its number on its output, from 0 in each life.
    pub(crate) number: u64,
    /// Its sending time, in nanoseconds since 1970.
    pub(crate) sent_ns: i64,
}

/// The position of a message of events.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct EventsHeader {
    /// Number of its first event in the life of the source; also set for a message without events.
    pub(crate) first: u64,
    pub(crate) width: NonZeroU16,
    pub(crate) height: NonZeroU16,
}

impl EventsHeader {
    pub(crate) fn sensor(&self) -> Sensor {
        Sensor::new(self.width.get(), self.height.get())
    }
}

/// The events that a prediction covers, and its times.
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
    /// Index among all messages in this life of the inference node.
    pub(crate) order: u64,
    /// Number of the first event that it does not cover; those before were taken or lost.
    pub(crate) next: u64,
    /// Events of this stream that the engine got.
    pub(crate) accepted: u64,
    /// Time of the newest event in the window, in microseconds.
    pub(crate) t_us: Option<i64>,
    /// Events in the window.
    pub(crate) nodes: u64,
    /// Whether it covers everything that had arrived.
    pub(crate) fresh: bool,
    /// Sending time of the newest covered message of events, in nanoseconds.
    pub(crate) events_sent_ns: i64,
    /// Arrival of that message at the inference node.
    pub(crate) events_received_ns: i64,
    /// Sending time of the prediction.
    pub(crate) sent_ns: i64,
}

/// The position of a loss.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct LossHeader {
    pub(crate) sensor: String,
    /// Life of the source.
    pub(crate) stream: i64,
    /// Index among all messages in this life of the inference node.
    pub(crate) order: u64,
}

/// The origin of a command.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct CommandHeader {
    pub(crate) sensor: String,
    /// Whether it was made from a new prediction.
    pub(crate) fresh: bool,
    /// Age of the events that it was made from, in nanoseconds.
    pub(crate) age_ns: i64,
}

/// A count of a sensor.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub(crate) struct Counter {
    pub(crate) sensor: String,
    pub(crate) name: String,
    /// The reason for drops; otherwise empty.
    pub(crate) reason: String,
    /// The count since the start of the source.
    pub(crate) value: u64,
}

impl Counter {
    pub(crate) fn new(sensor: &str, name: &str, value: u64) -> Self {
        Self::with_reason(sensor, name, "", value)
    }

    pub(crate) fn with_reason(sensor: &str, name: &str, reason: &str, value: u64) -> Self {
        let [sensor, name, reason] = [sensor, name, reason].map(str::to_owned);
        Self { sensor, name, reason, value }
    }
}

/// Events as an array.
pub(crate) fn events_array(events: &[Event]) -> ArrayRef {
    let times = Int64Array::from_iter_values(events.iter().map(|event| event.t_us));
    let columns = UInt16Array::from_iter_values(events.iter().map(|event| event.x));
    let rows = UInt16Array::from_iter_values(events.iter().map(|event| event.y));
    let on: BooleanArray = events.iter().map(|event| event.on).collect::<Vec<_>>().into();
    let arrays: [(&str, ArrayRef); 4] =
        [("t_us", Arc::new(times)), ("x", Arc::new(columns)), ("y", Arc::new(rows)), ("on", Arc::new(on))];
    let column = |(name, array): (&str, ArrayRef)| {
        (Arc::new(Field::new(name, array.data_type().clone(), false)), array)
    };
    Arc::new(StructArray::from(arrays.map(column).to_vec()))
}

const EVENTS: &str = "a struct of t_us i64, x u16, y u16, on bool";

/// The events in `data`, appended to `events`.
pub(crate) fn read_events(data: &DoraArray, events: &mut Vec<Event>) -> Result<(), PacketError> {
    let rows: &StructArray = array(data, EVENTS)?;
    without_nulls(rows.columns().iter().map(Array::null_count).sum())?;
    let times: &Int64Array = column(rows, "t_us")?;
    let columns: &UInt16Array = column(rows, "x")?;
    let lines: &UInt16Array = column(rows, "y")?;
    let on: &BooleanArray = column(rows, "on")?;
    let event = |row| Event::new(times.value(row), columns.value(row), lines.value(row), on.value(row));
    events.extend((0..rows.len()).map(event));
    Ok(())
}

/// An array without nulls, of the expected type.
fn array<'a, A: Array + 'static>(data: &'a DoraArray, expected: &'static str) -> Result<&'a A, PacketError> {
    let array = data.as_array().as_any().downcast_ref::<A>();
    let array = array.ok_or_else(|| PacketError::unexpected("array", expected, &data.type_name()))?;
    without_nulls(array.null_count())?;
    Ok(array)
}

fn without_nulls(nulls: usize) -> Result<(), PacketError> {
    if nulls == 0 { Ok(()) } else { Err(PacketError::unexpected("array", "no nulls", &nulls.to_string())) }
}

/// A column of events by its name.
fn column<'a, A: 'static>(rows: &'a StructArray, name: &str) -> Result<&'a A, PacketError> {
    let column = rows.column_by_name(name).and_then(|column| column.as_any().downcast_ref());
    let found = || format!("{:?}", rows.data_type());
    column.ok_or_else(|| PacketError::unexpected("array", EVENTS, &found()))
}

/// The values of a prediction as an array.
pub(crate) fn values_array(values: &[f32]) -> ArrayRef {
    Arc::new(Float32Array::from(values.to_vec()))
}

/// The values of a prediction.
pub(crate) fn read_values(data: &DoraArray) -> Result<Vec<f32>, PacketError> {
    Ok(array::<Float32Array>(data, "f32")?.values().to_vec())
}

/// A command as an array.
pub(crate) fn turn_array(turn: [f64; 2]) -> ArrayRef {
    Arc::new(Float64Array::from(turn.to_vec()))
}

/// A command.
pub(crate) fn read_turn(data: &DoraArray) -> Result<Vec<f64>, PacketError> {
    Ok(array::<Float64Array>(data, "f64")?.values().to_vec())
}

/// Items as texts of JSON.
pub(crate) fn texts_array<T: Serialize>(items: &[T]) -> ArrayRef {
    let text = |item| serde_json::to_string(item).expect("counts and texts are written without errors");
    Arc::new(StringArray::from_iter_values(items.iter().map(text)))
}

/// The items in texts of JSON.
pub(crate) fn read_texts<T: DeserializeOwned>(data: &DoraArray) -> Result<Vec<T>, PacketError> {
    let texts: &StringArray = array(data, "utf8")?;
    texts.iter().flatten().map(|text| serde_json::from_str(text).map_err(failed("text"))).collect()
}
