//! What can be asked for on the command line. Whatever is wrong with a single argument is found here, by clap, which
//! exits with status 2.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

mod heading;
#[cfg(test)]
mod tests;

use std::path::PathBuf;

use clap::{Parser, Subcommand, ValueEnum};
use meissner_engine::{LatePolicy, Network, Sensor};
use meissner_io::{ColumnOrder, Format, ReadOptions, TextOptions, TimeUnit};

pub(crate) use meissner_pipeline::schedule::Every;
use meissner_pipeline::time;

pub(crate) use crate::approximations::ApproximationArgs;
pub(crate) use crate::bench::BenchArgs;
pub(crate) use crate::draw::DrawArgs;
pub(crate) use crate::eval::EvalArgs;
pub(crate) use crate::pareto::ParetoArgs;
pub(crate) use crate::play::PlayArgs;
pub(crate) use crate::prepare::PrepareArgs;
pub(crate) use crate::run::RunArgs;
pub(crate) use crate::soak::SoakArgs;
pub(crate) use crate::stress::StressArgs;
pub(crate) use crate::verify::VerifyArgs;
pub(crate) use heading::*;

/// At the end of every help.
pub(crate) const STATUS: &str = "\
Exit status:
  0    success, or the reader of the output closed the pipe
  1    bad input: a file that cannot be read or does not fit, or a broken promise
  2    bad usage: an unknown option, a wrong value, options that do not fit
  130  a signal (SIGINT from Ctrl-C, or SIGTERM) ended the program
  At the first signal run, play and soak end their stream with summary and state; the others, and any at the second signal, end at once. pareto --state keeps the measurements that are finished.";

/// Incremental inference for event cameras and event-based touch.
#[derive(Debug, Parser)]
#[command(name = "meissner", version, max_term_width = 80, after_help = STATUS)]
pub(crate) struct Args {
    /// What to do.
    #[command(subcommand)]
    pub(crate) command: Command,
}

/// The subcommands.
#[derive(Debug, Subcommand)]
pub(crate) enum Command {
    /// Run a network over a recording or a live stream.
    Run(RunArgs),
    /// Play a recording at real speed through a bounded queue.
    Play(PlayArgs),
    /// Measure latencies, work, memory and missed deadlines.
    Bench(BenchArgs),
    /// List the shipped networks.
    Networks(NetworksArgs),
    /// Show the layers, shapes and costs of a network.
    Inspect(InspectArgs),
    /// Draw weights for a network from a seed.
    Draw(DrawArgs),
    /// Show what a recording holds.
    Info(InfoArgs),
    /// Write a recording in another format.
    Convert(ConvertArgs),
    /// Judge networks on a labelled data set.
    Eval(EvalArgs),
    /// Measure run time against error: a network exactly, and with approximations.
    Pareto(ParetoArgs),
    /// Write the inputs of a network with labels, for training.
    Prepare(PrepareArgs),
    /// Check every promise on streams, weights and states that are built to break it.
    Stress(StressArgs),
    /// Run for very long, and check bits, memory and latencies.
    Soak(SoakArgs),
    /// Check that a network's incremental results equal full recomputation.
    Verify(VerifyArgs),
}

/// How a recording is read.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct ReadArgs {
    /// Order of the columns of a text of events, such as xytp.
    ///
    /// The letters are t, x, y, p, and _ for each other column. Without this option, a header says the order, or the
    /// values do where they leave no doubt; where several orders fit, the text is refused. On standard input the first
    /// line decides: with commas it is t,x,y,p where it can be.
    #[arg(long, value_name = "ORDER", help_heading = INPUT)]
    pub(crate) columns: Option<ColumnOrder>,
    /// Unit of the times of a text of events.
    ///
    /// Without it, the header says the unit (such as t_ms). Where it does not, whole numbers are microseconds, numbers
    /// with a point and four or more decimals are seconds, and fewer decimals are refused. Finer times are rounded to
    /// the nearest microsecond.
    #[arg(long, value_name = "s|ms|us|ns", help_heading = INPUT)]
    pub(crate) time_unit: Option<TimeUnit>,
    /// Read a recording that was cut short as far as it is whole.
    ///
    /// What is left out is counted.
    #[arg(long, help_heading = INPUT)]
    pub(crate) salvage: bool,
}

impl ReadArgs {
    /// What they say, for the reader.
    pub(crate) fn options(self) -> ReadOptions {
        let text = TextOptions::new().columns(self.columns).time_unit(self.time_unit);
        ReadOptions::new().text(text).salvage(self.salvage)
    }

    /// The options, and whether each is given.
    pub(crate) fn given(self) -> [(&'static str, bool); 3] {
        [
            ("--columns", self.columns.is_some()),
            ("--time-unit", self.time_unit.is_some()),
            ("--salvage", self.salvage),
        ]
    }
}

/// What `run`, `play` and `bench` work on.
#[derive(Debug, clap::Args)]
pub(crate) struct Input {
    /// Recording, or - for standard input [default: a small built-in recording].
    ///
    /// Events: AEDAT4, EVT2, EVT3, DAT, N-MNIST, CSV or npy. On standard input, CSV lines (t_us,x,y,p) are read as they
    /// arrive. The built-in recording is a synthetic press and release.
    ///
    /// Electrodes: CSV with a column for each of the 24, also on standard input. Pictures: a PNG, JPEG, PPM or PGM
    /// file, a folder of them, or a text file with one path a line.
    #[arg(value_name = "INPUT")]
    pub(crate) recording: Option<PathBuf>,
    /// Size of the sensor in pixels, in place of the recording's.
    ///
    /// Needed where the recording does not state it. CSV states it in a line `# sensor WxH` before the first event:
    /// without this option, the program waits for the first event on standard input. Events outside the sensor are
    /// dropped and counted.
    #[arg(long, value_name = "WxH", value_parser = sensor, help_heading = INPUT)]
    pub(crate) sensor: Option<Sensor>,
    /// Read at most N events of the recording.
    #[arg(long, value_name = "N", help_heading = INPUT)]
    pub(crate) limit: Option<u64>,
    /// End with an error at the first line of a text that cannot be read.
    ///
    /// Without it, such a line is counted ("lines_refused"), the first five are named on standard error, and the stream
    /// goes on; more than half of the first 100 lines, or of a shorter text, are an error. With it, standard input is
    /// summed up to the line, and of a file of events nothing is run.
    #[arg(long, help_heading = INPUT)]
    pub(crate) strict: bool,
    /// What to do with an event that is earlier than one before it.
    #[arg(long, value_enum, default_value_t = Late::Drop, help_heading = INPUT)]
    pub(crate) late: Late,
    /// How the recording is read.
    #[command(flatten)]
    pub(crate) read: ReadArgs,
    /// Name of a shipped network, or a description file (.toml).
    ///
    /// `meissner networks` lists the shipped networks. A description file needs --weights.
    #[arg(long, value_name = "NETWORK", default_value = meissner_pipeline::model::DEFAULT_NETWORK, help_heading = NETWORK)]
    pub(crate) network: String,
    /// Weights [default: those shipped with the network].
    ///
    /// The file is safetensors, or a state dict that PyTorch saved.
    #[arg(long, value_name = "FILE", help_heading = NETWORK)]
    pub(crate) weights: Option<PathBuf>,
    /// Run weights that were trained on another preparation of the input.
    ///
    /// A preparation is the graph with its scales, span and cells, or how frames are made. Without this option such
    /// weights are refused. With it the predictions are not those that the weights were trained for, and every output
    /// says so.
    #[arg(long, help_heading = NETWORK)]
    pub(crate) ignore_preparation: bool,
    /// Length of the window, in place of the description's.
    #[arg(long = "span", value_name = "TIME", value_parser = time::span_us, help_heading = NETWORK)]
    pub(crate) span_us: Option<i64>,
    /// Most events in the window, in place of the description's.
    #[arg(long, value_name = "N", help_heading = NETWORK,
          value_parser = clap::value_parser!(u32).range(1..=Network::LARGEST_CAPACITY as i64))]
    pub(crate) capacity: Option<u32>,
    /// What makes results cheaper and less exact.
    #[command(flatten)]
    pub(crate) approximations: ApproximationArgs,
}

/// `meissner networks`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS)]
pub(crate) struct NetworksArgs {
    /// Print one JSON array.
    ///
    /// An object for each network: {"name", "system", "purpose", "trained" (whether the shipped weights are), "sensor":
    /// [columns, rows] in pixels (null where any will do), "input", "outputs": list of names, "unit"}.
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) json: bool,
}

/// `meissner inspect`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS)]
pub(crate) struct InspectArgs {
    /// Name of a shipped network, or a description file (.toml).
    ///
    /// `meissner networks` lists the shipped networks.
    #[arg(value_name = "NETWORK")]
    pub(crate) network: String,
    /// Print the graph of the layers in Graphviz's DOT language.
    #[arg(long, conflicts_with = "json", help_heading = OUTPUT)]
    pub(crate) dot: bool,
    /// Draw the network into this file, in place of the table.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(crate) svg: Option<PathBuf>,
    /// Print one JSON object.
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) json: bool,
}

/// `meissner info`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS)]
pub(crate) struct InfoArgs {
    /// Recording, or - for text on standard input.
    pub(crate) recording: PathBuf,
    /// How it is read.
    #[command(flatten)]
    pub(crate) read: ReadArgs,
    /// Print one JSON object.
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) json: bool,
}

/// `meissner convert`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS)]
pub(crate) struct ConvertArgs {
    /// Recording to read, or - for text on standard input.
    #[arg(value_name = "IN")]
    pub(crate) input: PathBuf,
    /// File to write, or - for standard output.
    ///
    /// The file must not exist (see --force). Standard output needs --to.
    #[arg(value_name = "OUT")]
    pub(crate) output: PathBuf,
    /// Replace OUT where it exists.
    #[arg(long, short, help_heading = OUTPUT)]
    pub(crate) force: bool,
    /// How IN is read.
    #[command(flatten)]
    pub(crate) read: ReadArgs,
    /// Size of the sensor in pixels for the header, in place of the recording's.
    #[arg(long, value_name = "WxH", value_parser = sensor, help_heading = INPUT)]
    pub(crate) sensor: Option<Sensor>,
    /// Format to write [default: as OUT's extension says].
    ///
    /// The extensions are .csv, .npy, .dat, .evt3 and .raw (EVT3).
    #[arg(long, value_name = "FORMAT", value_enum, help_heading = OUTPUT)]
    pub(crate) to: Option<To>,
}

/// How predictions are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Mode {
    /// Recompute what an event changes.
    Incremental,
    /// Recompute every row, at every prediction.
    Batch,
}

impl From<Mode> for meissner_pipeline::predictor::Mode {
    fn from(mode: Mode) -> Self {
        match mode {
            Mode::Incremental => Self::Incremental,
            Mode::Batch => Self::Batch,
        }
    }
}

/// What becomes of late events.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Late {
    /// Drop it, and count it.
    Drop,
    /// Accept it at the newest time, and count it.
    Clamp,
}

impl From<Late> for LatePolicy {
    fn from(late: Late) -> Self {
        match late {
            Late::Drop => Self::Drop,
            Late::Clamp => Self::Clamp,
        }
    }
}

/// The formats that can be written.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum To {
    /// Text, one event a line.
    Csv,
    /// NumPy structured array.
    Npy,
    /// Prophesee DAT, version 2.
    Dat,
    /// Prophesee EVT 3.0.
    Evt3,
}

impl From<To> for Format {
    fn from(to: To) -> Self {
        match to {
            To::Csv => Self::Csv,
            To::Npy => Self::Npy,
            To::Dat => Self::Dat,
            To::Evt3 => Self::Evt3,
        }
    }
}

/// Reads columns x rows.
pub(crate) fn sensor(text: &str) -> Result<Sensor, String> {
    let side = |text: &str| text.parse().ok().filter(|&side: &u16| side > 0);
    let parse = || {
        let (width, height) = text.split_once('x')?;
        Some(Sensor::new(side(width)?, side(height)?))
    };
    parse().ok_or_else(|| "expected columns x rows, each 1 to 65535, such as 346x260".to_owned())
}
