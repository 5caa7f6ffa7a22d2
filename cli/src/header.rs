//! The first lines of a text report: input, network and weights.

use std::io::{self, Write};

use meissner_run::model::FrameModel;
use meissner_run::provenance::{InputCard, ModelCard};
use meissner_run::text::grouped;

/// Writes the inputs, the network with its `mode`, the weights, and the window or the frames.
/// `frames` is given for a frame network.
pub(crate) fn header(
    out: &mut impl Write,
    inputs: &[InputCard],
    card: &ModelCard,
    mode: &str,
    frames: Option<&FrameModel>,
) -> io::Result<()> {
    for (number, input) in inputs.iter().enumerate() {
        let sensor = input.sensor.map(|[width, height]| format!(", {width}x{height} pixels"));
        let events = input.events.map(|events| format!(", {} events", grouped(events)));
        let about = [Some(input.format.clone()), sensor, events].into_iter().flatten().collect::<String>();
        let key = if inputs.len() > 1 {
            format!("input {number}")
        } else {
            if frames.is_some() { "input" } else { "recording" }.to_owned()
        };
        writeln!(out, "{key:<12} {}\n             {about}", input.name)?;
    }
    // Of several inputs, each has its sensor beside it.
    let sensor = if let [input] = inputs { input.sensor } else { None };
    write_model(out, card, mode, sensor.filter(|_| frames.is_none()))?;
    if let Some(model) = frames {
        writeln!(out, "frames       {}: {}", model.description.input(), model.source)?;
    }
    writeln!(out)
}

/// Writes the lines of network and weights: the first says what runs on which sensor and whether
/// the weights are trained.
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
