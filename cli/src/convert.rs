//! `meissner convert`: a recording in another format.

use std::io::{Write, stdout};

use meissner_io::Format;

use crate::args::ConvertArgs;
use crate::error::CliError;
use crate::source;
use crate::tell::tell;
use crate::text::grouped;

/// Reads, writes, and says what did not come along.
pub(crate) fn convert(args: &ConvertArgs) -> Result<(), CliError> {
    let format = match args.to {
        Some(to) => to.into(),
        None => Format::from_path(&args.output).map_err(|e| CliError::NotWritable(e.to_string()))?,
    };
    if !format.is_writable() {
        return Err(CliError::NotWritable(format!("{format} is read, not written")));
    }
    let recording = source::read(&args.input)?;
    let sensor = args.sensor.or(recording.sensor);
    let output = args.output.display().to_string();
    meissner_io::write(&args.output, format, sensor, &recording.events)
        .map_err(|e| CliError::recording(&output, e))?;
    for stream in &recording.other_streams {
        tell(format_args!("note: {}: {} {} left out", stream.name, grouped(stream.elements), stream.kind));
    }
    if format == Format::Npy || sensor.is_none() {
        tell(format_args!("note: {output} does not name the sensor's geometry: `run` needs --sensor WxH"));
    }
    let events = grouped(recording.events.len() as u64);
    let mut out = stdout().lock();
    writeln!(out, "{output}: {events} events as {format}")?;
    Ok(out.flush()?)
}
