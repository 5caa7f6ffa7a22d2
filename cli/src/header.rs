//! The first lines of a report for people: what runs on what.

use std::io::{self, Write};

use meissner_engine::Sensor;

use crate::model::Model;
use crate::source::Source;
use crate::text::grouped;

/// Writes recording, network with its `mode`, weights and window.
pub(crate) fn header(
    out: &mut impl Write,
    model: &Model,
    mode: &str,
    source: &Source,
    sensor: Sensor,
) -> io::Result<()> {
    let parts = model.network.parts();
    let window =
        format!("{} ms, at most {} events", parts.span_us as f64 / 1e3, grouped(parts.capacity as u64));
    let events = source.remaining().map_or_else(String::new, |n| format!(", {} events", grouped(n)));
    writeln!(out, "recording    {}", source.name)?;
    writeln!(out, "             {}, {sensor} pixels{events}", source.format)?;
    writeln!(out, "network      {}, {mode}", model.network.name())?;
    writeln!(out, "weights      {}", model.weights)?;
    writeln!(out, "window       {window}\n")
}
