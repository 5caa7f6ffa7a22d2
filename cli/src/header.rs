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
    let events = source.recorded().map_or_else(String::new, |n| format!(", {} events", grouped(n)));
    writeln!(out, "recording    {}", source.name)?;
    writeln!(out, "             {}, {sensor} pixels{events}", source.format)?;
    model.card.write(out, mode, Some([sensor.width, sensor.height]))?;
    writeln!(out)
}
