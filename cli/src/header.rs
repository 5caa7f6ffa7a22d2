//! The first lines of a report for people: input, network and weights.

use std::io::{self, Write};

use meissner_engine::Sensor;
use meissner_pipeline::model::FrameModel;
use meissner_pipeline::provenance::ModelCard;
use meissner_pipeline::source::Source;
use meissner_pipeline::text::grouped;

/// Writes recording, network with its `mode`, weights and window.
pub(crate) fn header(
    out: &mut impl Write,
    card: &ModelCard,
    mode: &str,
    source: &Source,
    sensor: Sensor,
) -> io::Result<()> {
    writeln!(out, "recording    {}", source.name)?;
    writeln!(out, "             {}", about(source, sensor))?;
    write_model(out, card, mode, Some([sensor.width, sensor.height]))?;
    writeln!(out)
}

/// Format, sensor and events of `source`.
pub(crate) fn about(source: &Source, sensor: Sensor) -> String {
    let events = source.recorded().map_or_else(String::new, |n| format!(", {} events", grouped(n)));
    format!("{}, {sensor} pixels{events}", source.format)
}

/// Writes input, network with its `mode`, weights and frames of a frame network.
pub(crate) fn frame_header(
    out: &mut impl Write,
    model: &FrameModel,
    mode: &str,
    [name, about]: [&str; 2],
) -> io::Result<()> {
    writeln!(out, "input        {name}\n             {about}")?;
    write_model(out, &model.card, mode, None)?;
    writeln!(out, "frames       {}: {}\n", model.description.input(), model.source)
}

/// Writes the lines of network and weights: the first says what runs on which sensor and whether the weights are trained.
pub(crate) fn write_model(
    out: &mut impl Write,
    card: &ModelCard,
    mode: &str,
    sensor: Option<[u16; 2]>,
) -> io::Result<()> {
    let on = sensor.map_or_else(String::new, |[width, height]| format!(" on {width}x{height} pixels"));
    writeln!(out, "network      {}{on}, weights {}", card.network.name, card.trust())?;
    writeln!(out, "             {mode}")?;
    writeln!(out, "weights      {}", card.source())?;
    if let (Some(span_us), Some(capacity)) = (card.network.span_us, card.network.capacity) {
        let capacity = grouped(capacity as u64);
        writeln!(out, "window       {} ms, at most {capacity} events", span_us as f64 / 1e3)?;
    }
    Ok(())
}
