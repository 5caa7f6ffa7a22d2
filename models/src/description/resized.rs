//! A description with other sizes, to measure how the cost of a network grows.

use meissner_engine::Reach;
use toml::{Table, Value};

use super::{Description, DescriptionError};

/// Sizes of a network over events.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sizes {
    /// Length of the window in microseconds.
    pub span_us: i64,
    /// Largest number of events in the window.
    pub capacity: usize,
    /// Maximum number of neighbours of an event; `None` keeps that of the description.
    pub neighbours: Option<usize>,
    /// Factor of the channels of every block; they are rounded, and at least 1.
    pub channels: f64,
}

impl Description {
    /// The description in `text` with other `sizes`, and without filters: every event enters its
    /// graph.
    ///
    /// # Errors
    /// `text` is not a description of a network over events, or it is inconsistent with these
    /// sizes.
    pub fn resized(text: &str, sizes: &Sizes) -> Result<Self, DescriptionError> {
        let described = Self::parse(text)?;
        let Ok(mut root) = text.parse::<Table>() else { return Ok(described) };
        root.remove("filter");
        let mut set = |part: &str, key: &str, value: i64| {
            let table = root.get_mut(part).and_then(Value::as_table_mut);
            if let Some(table) = table {
                table.insert(key.to_owned(), Value::from(value));
            }
        };
        set("network", "span_us", sizes.span_us);
        set("network", "capacity", sizes.capacity as i64);
        if let Some(neighbours) = sizes.neighbours {
            let key = if matches!(described.graph.reach, Reach::Knn { .. }) { "k" } else { "max" };
            set("graph", key, neighbours as i64);
        }
        let layers = root.get_mut("layer").and_then(Value::as_array_mut).into_iter().flatten();
        for channels in layers.filter_map(|layer| layer.get_mut("channels")) {
            let scaled = channels.as_integer().map(|channels| (channels as f64 * sizes.channels).round());
            *channels = Value::from(scaled.unwrap_or_default().max(1.0) as i64);
        }
        Self::parse(&toml::to_string(&root).unwrap_or_default())
    }
}
