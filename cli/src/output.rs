//! Standard output, and files that the program writes.

use std::io::{self, BufWriter, Stdout, Write, stdout};
use std::path::{Path, PathBuf};

use meissner_engine::Sensor;
use meissner_run::mcap::McapLog;
use meissner_run::provenance::ModelCard;
use meissner_run::{RunError, interrupt};
use serde::Serialize;

use crate::args::{JsonArgs, OUTPUT};
use crate::error::CliError;
use crate::text::Folded;

/// Where a report goes.
#[derive(Debug, clap::Args)]
pub(crate) struct ReportArgs {
    #[command(flatten)]
    pub(crate) format: JsonArgs,
    /// Also write the report to this file, as one JSON object.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(crate) out: Option<PathBuf>,
}

/// The file that a command makes.
#[derive(Debug, clap::Args)]
pub(crate) struct OutArgs {
    /// File to write (safetensors).
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(crate) out: PathBuf,
    #[command(flatten)]
    force: Force,
}

impl OutArgs {
    /// Checks before minutes of work that the file can be written.
    pub(crate) fn check(&self) -> Result<(), CliError> {
        check_result(&self.out, self.force)
    }

    /// Writes the file, unless `content` is an error.
    pub(crate) fn write(&self, content: impl AsRef<[u8]>) -> Result<(), CliError> {
        write(&self.out, content)
    }
}

/// The log of a run, for viewers.
#[derive(Debug, clap::Args)]
pub(crate) struct LogArgs {
    /// Also write events and predictions to this file, for viewers (MCAP).
    ///
    /// Foxglove and Lichtblick open it: pictures of the events (/events/image), predictions that
    /// can be plotted (/prediction), their times (/latency), and where it is known the truth
    /// (/truth). /events has the events themselves as packets of ROS 2, which this program reads
    /// too.
    ///
    /// The file is readable at any time, up to a second before. If it cannot be written any more,
    /// the run goes on, and ends with an error.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(crate) mcap: Option<PathBuf>,
    #[command(flatten)]
    force: Force,
}

impl LogArgs {
    /// Checks before the work that the file can be written.
    pub(crate) fn check(&self) -> Result<(), CliError> {
        self.mcap.as_deref().map_or(Ok(()), |path| check_result(path, self.force))
    }

    /// Begins the log of a network over inputs with these `sensors`, if requested.
    pub(crate) fn begin(
        &self,
        card: &ModelCard,
        sensors: &[Sensor],
        is_press: bool,
    ) -> Result<Option<McapLog>, CliError> {
        let log = self.mcap.as_deref().map(|path| McapLog::create(path, card, sensors, is_press));
        Ok(log.transpose()?)
    }
}

/// Whether a result may replace an existing file.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct Force {
    /// Replace the file if it exists.
    ///
    /// Results of work are not replaced without this option. Reports, pictures and states are.
    #[arg(long, short, help_heading = OUTPUT)]
    pub(crate) force: bool,
}

/// Standard output. A signal can end the program even if nobody reads the output.
pub(crate) type Out = Folded<BufWriter<interrupt::Output<Stdout>>>;

/// Standard output, with long lines folded for people.
pub(crate) fn out(json: bool) -> Out {
    Folded::new(BufWriter::new(interrupt::output(stdout())), !json)
}

/// Writes `report` to standard output: as one line of JSON, or as `text`.
pub(crate) fn print(
    as_json: bool,
    report: &impl Serialize,
    text: impl FnOnce(&mut Out) -> io::Result<()>,
) -> Result<(), CliError> {
    let mut out = out(as_json);
    if as_json {
        out.write_all(&json(report)?)?;
    } else {
        text(&mut out)?;
    }
    Ok(out.flush()?)
}

/// Checks before minutes of work that the file at `path` can be written; changes nothing.
pub(crate) fn check_writable(path: &Path) -> Result<(), CliError> {
    meissner_io::check_writable(path).map_err(|error| RunError::File(error).into())
}

/// [`check_writable`] for the file of a result, which is replaced only with `force`.
pub(crate) fn check_result(path: &Path, force: Force) -> Result<(), CliError> {
    // A device such as /dev/null is not a file and loses nothing when it is written to.
    if !force.force && path.is_file() {
        let path = path.display().to_string();
        return Err(CliError::usage(&path, "no such file", "one: --force replaces it"));
    }
    check_writable(path)
}

/// [`check_writable`] for all of `paths`.
pub(crate) fn check_all_writable<const N: usize>(paths: [&Option<PathBuf>; N]) -> Result<(), CliError> {
    paths.into_iter().flatten().try_for_each(|path| check_writable(path))
}

/// Writes `report` to standard output, as JSON or `text`, and as JSON to the file of `args`.
pub(crate) fn report(
    args: &ReportArgs,
    report: &impl Serialize,
    text: impl FnOnce(&mut Out) -> io::Result<()>,
) -> Result<(), CliError> {
    if let Some(path) = &args.out {
        write(path, json(report)?)?;
    }
    print(args.format.json, report, text)
}

/// `report` as one line of JSON.
pub(crate) fn json(report: &impl Serialize) -> Result<Vec<u8>, io::Error> {
    let mut text = serde_json::to_vec(report)?;
    text.push(b'\n');
    Ok(text)
}

/// Writes `content` to the file at `path`, which is replaced as a whole if it exists.
pub(crate) fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<(), CliError> {
    let written = meissner_io::write_file(path, |out| out.write_all(content.as_ref()));
    written.map_err(|error| RunError::File(error).into())
}
