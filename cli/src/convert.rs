//! `meissner convert`: writes a recording in another format.

use std::io::{BufWriter, Write, stdout};
use std::path::{Path, PathBuf};

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, IoError};

use crate::args::{OUTPUT, PartArgs, ReadArgs, choice};
use crate::error::CliError;
use crate::output;
use crate::output::Force;
use crate::progress::Progress;
use crate::stderr::tell;
use meissner_run::RunError;
use meissner_run::text::grouped;

/// `meissner convert`.
#[derive(Debug, clap::Args)]
pub(crate) struct ConvertArgs {
    /// Recording to read, or - for text on standard input.
    #[arg(value_name = "IN")]
    input: PathBuf,
    /// File to write, or - for standard output.
    ///
    /// The file must not exist (see --force). Standard output needs --to.
    #[arg(value_name = "OUT")]
    output: PathBuf,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    part: PartArgs,
    /// Format to write [default: from the extension of OUT].
    ///
    /// The extensions are .aedat4, .csv, .npy, .dat, .es, .mcap, .evt3 and .raw (EVT3).
    #[arg(long, value_name = "FORMAT", value_parser = choice(FORMATS), help_heading = OUTPUT)]
    to: Option<Format>,
}

/// The names of the formats that can be written, with their help.
const FORMATS: &[(&str, &str, Format)] = &[
    ("aedat4", "AEDAT4 with LZ4, with a sensor", Format::Aedat4),
    ("csv", "Text, one event per line", Format::Csv),
    ("npy", "NumPy structured array", Format::Npy),
    ("dat", "Prophesee DAT, version 2", Format::Dat),
    ("evt3", "Prophesee EVT 3.0", Format::Evt3),
    ("es", "Event Stream 2, with a sensor", Format::Es),
    ("mcap", "MCAP with packets of ROS 2, with a sensor", Format::Mcap),
];

/// Reads and writes the recording, and reports the parts that the new format does not have.
pub(crate) fn convert(args: &ConvertArgs) -> Result<(), CliError> {
    let to_stdout = args.output == Path::new("-");
    let format = match args.to {
        Some(format) => format,
        None => Format::from_path(&args.output).map_err(|e| CliError::NotWritable(e.to_string()))?,
    };
    if !format.is_writable() {
        return Err(CliError::NotWritable(format!("{format} is read, not written")));
    }
    if !to_stdout {
        output::check_result(&args.output, args.force)?;
    }
    let progress = Progress::busy(|| "converting".to_owned());
    let recording = args.read.read(&args.input, args.part.part())?;
    let sensor = args.read.sensor.or(recording.sensor);
    let output = if to_stdout { "standard output".to_owned() } else { args.output.display().to_string() };
    if to_stdout {
        print(format, sensor, &recording.events, &output)?;
    } else {
        meissner_io::write(&args.output, format, sensor, &recording.events)
            .map_err(|e| RunError::recording(&output, e))?;
    }
    progress.finish();
    for stream in &recording.other_streams {
        tell(format_args!("note: {}: {} {} left out", stream.name, grouped(stream.elements), stream.kind));
    }
    if format == Format::Npy || sensor.is_none() {
        tell(format_args!("note: {output} does not name the sensor's geometry: `run` needs --sensor WxH"));
    }
    let events = grouped(recording.events.len() as u64);
    if to_stdout {
        tell(format_args!("{output}: {events} events as {format}"));
        return Ok(());
    }
    let mut out = stdout().lock();
    writeln!(out, "{output}: {events} events as {format}")?;
    Ok(out.flush()?)
}

/// Writes the recording to standard output.
fn print(format: Format, sensor: Option<Sensor>, events: &[Event], name: &str) -> Result<(), CliError> {
    let mut out = BufWriter::with_capacity(1 << 16, stdout().lock());
    meissner_io::encode(format, sensor, events, &mut out).map_err(|error| match error {
        IoError::Stream { source, .. } => CliError::Output(source),
        error => RunError::recording(name, error).into(),
    })?;
    Ok(out.flush()?)
}
