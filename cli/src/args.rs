//! Groups of arguments that several subcommands share. Clap checks the value of each argument and
//! exits with status 2 if it is invalid.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::num::NonZeroU16;
use std::path::{Path, PathBuf};
use std::time::Duration;

use clap::builder::{PossibleValue, PossibleValuesParser, TypedValueParser};
use clap::{Arg, ValueEnum, value_parser};
use meissner_engine::filters::RateLimit;
use meissner_engine::{LatePolicy, Network, RestartPolicy, Sensor};
use meissner_io::{Chip, ColumnOrder, Format, ReadOptions, TextOptions, TimeUnit};
use meissner_run::approximations::Approximations;
use meissner_run::bench::Part;
use meissner_run::model::WeightsFile;
use meissner_run::predictor::Mode;
use meissner_run::text::{length_us, span_us};
use meissner_simulator::gel::GelSensor;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::CliError;
pub(crate) use meissner_run::schedule::Every;
pub(crate) use meissner_run::text::sensor;

// Headings of the help. Each option names its heading, because the heading of a group of arguments
// would also apply to the options that follow the group.
pub(crate) const INPUT: &str = "Input";
pub(crate) const NETWORK: &str = "Network";
pub(crate) const PREDICTIONS: &str = "Predictions";
pub(crate) const QUEUE: &str = "Queue";
pub(crate) const MEASUREMENT: &str = "Measurement";
pub(crate) const STATE: &str = "State";
pub(crate) const FRAMES: &str = "Frame networks";
pub(crate) const ELECTRODES: &str = "Electrodes";
pub(crate) const APPROXIMATIONS: &str = "Approximations";
pub(crate) const OUTPUT: &str = "Output";

/// The output as JSON.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct JsonArgs {
    /// Print JSON instead of text.
    ///
    /// docs/json.md explains the keys. `run` and `play` print one object per line, the other
    /// commands print one value.
    #[arg(long, help_heading = OUTPUT)]
    pub(crate) json: bool,
}

/// The end of every help text.
pub(crate) const STATUS: &str = "\
Exit status:
  0    success, or the reader of the output closed the pipe
  1    bad input: a file that cannot be read or does not fit, or a broken promise
  2    bad usage: an unknown option, a wrong value, options that do not fit
  130  a signal (SIGINT from Ctrl-C, SIGTERM or SIGHUP) ended the program
  run, play, send and verify --soak end their stream at the first signal, and write the summary and the state, also if nobody reads the output. The other subcommands end at once, and these four at the second signal, or when the state is written. With --state, pareto keeps finished measurements, and verify --soak finished checkpoints.

Environment:
  MEISSNER_LOG  off, error, warn (the default), info, debug or trace: level of messages on standard error
  NO_COLOR      no colours in the help";

/// A sensor of `simulate gel`.
#[derive(Clone, Copy, Debug, ValueEnum)]
pub(crate) enum GelSensorArg {
    /// The calibrated sensor.
    First,
    /// A second sensor of the same kind.
    Second,
    /// A sensor drawn for each press.
    Drawn,
}

impl GelSensorArg {
    /// The sensor, if it is always the same.
    pub(crate) fn fixed(self) -> Option<GelSensor> {
        match self {
            Self::First => Some(GelSensor::default()),
            Self::Second => Some(GelSensor::second()),
            Self::Drawn => None,
        }
    }
}

/// How a recording is read.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct ReadArgs {
    /// Size of the sensor in pixels, instead of the recording's.
    ///
    /// This option is required if the recording does not state the size. CSV states it in a line `#
    /// sensor WxH` before the first event, so on standard input the program waits for the first
    /// event unless this option is given. Events outside the sensor are dropped and counted.
    #[arg(long, value_name = "WxH", value_parser = sensor, help_heading = INPUT)]
    pub(crate) sensor: Option<Sensor>,
    /// Order of the columns of a text of events, such as xytp.
    ///
    /// The letters are t, x, y, p, and _ for every other column. Without this option, the order is
    /// read from the header, or inferred from the values if only one order fits them; if several
    /// fit, the text is refused. On standard input the first line decides: a line with commas is
    /// read as t,x,y,p if possible.
    #[arg(long, value_name = "ORDER", help_heading = INPUT)]
    pub(crate) columns: Option<ColumnOrder>,
    /// Unit of the times of a text of events.
    ///
    /// Without this option, the unit is read from the header (such as t_ms). If the header has
    /// none, whole numbers are microseconds, and numbers with at least four decimals are seconds;
    /// numbers with fewer decimals are refused. Finer times are rounded to the nearest microsecond.
    #[arg(long, value_name = "s|ms|us|ns", help_heading = INPUT)]
    pub(crate) time_unit: Option<TimeUnit>,
    /// Read the intact part of a truncated recording.
    ///
    /// The part that is skipped is counted.
    #[arg(long, help_heading = INPUT)]
    pub(crate) salvage: bool,
    /// Refuse what would be skipped in the recording.
    ///
    /// Without this option, anything that is not an event of the sensor is skipped, counted by
    /// kind, and reported: lines of a text that cannot be read ("lines_refused"; the first five are
    /// shown), events outside the sensor that the file names, words of a type that holds no events,
    /// such as padding, and events before the first time of a stream.
    ///
    /// If more than half of the first 100 lines (or of a shorter text) cannot be read, the program
    /// ends with an error. With this option, the first line, event or word that would be skipped
    /// ends it: the summary of standard input covers what came before, and a file is not run at
    /// all.
    #[arg(long, help_heading = INPUT)]
    pub(crate) strict: bool,
    /// Format of the recording, instead of the one that its content shows.
    ///
    /// On a stream, evt2, evt21 or evt3 reads the raw bytes of a Prophesee sensor, as a driver or
    /// v4l2 gives them: with a header or without, from the start or joined in the middle. Bytes
    /// that were lost are noticed and counted ("lines_refused"), and the stream goes on; without a
    /// header, --sensor is needed. A lost datagram cannot be noticed. aedat4 reads a file of AEDAT4
    /// from its start. Without this option, a stream is a text or records of 16 bytes.
    #[arg(long, value_name = "NAME", help_heading = INPUT)]
    pub(crate) format: Option<Format>,
    /// Chip of a recording in AEDAT 2 that names none, such as DAVIS346.
    ///
    /// DVS128, DAVIS128, DAVIS208, DAVIS240, DAVIS346 or DAVIS640; it decides how addresses are
    /// read, instead of the header. --sensor decides it too, where it is given and only one chip
    /// has this size.
    #[arg(long, value_name = "NAME", help_heading = INPUT)]
    pub(crate) chip: Option<Chip>,
    /// Which stream of events of AEDAT or MCAP is read, counted from 1 [default: 1].
    #[arg(long, value_name = "N", help_heading = INPUT)]
    pub(crate) stream: Option<NonZeroU16>,
    /// How long to try to connect again after a cut [default: 5s for dv://].
    ///
    /// This is for a connection to a server, dv:// or tcp://. Each cut is told and counted
    /// ("lines_refused"), because what is sent until the connection is there again is lost. After
    /// TIME, the stream has ended. 0s: a cut is its end.
    #[arg(long, value_name = "TIME", value_parser = length, help_heading = INPUT)]
    pub(crate) reconnect: Option<Duration>,
}

impl ReadArgs {
    /// The options for the reader of a recording.
    pub(crate) fn options(self) -> ReadOptions {
        let text = TextOptions::default().columns(self.columns).time_unit(self.time_unit);
        let options = ReadOptions::default().text(text).salvage(self.salvage).strict(self.strict);
        options.format(self.format).chip(self.chip).stream(self.stream).sensor(self.sensor)
    }
}

/// The part of a recording that is read.
#[derive(Clone, Copy, Debug, clap::Args)]
pub(crate) struct PartArgs {
    /// Skip the first TIME of the recording.
    ///
    /// TIME counts from the first event. The part outside --from and --for is not read at all if
    /// the recording is AEDAT, EVT2, DAT or npy. Its damage is then not found, and an event that is
    /// more than 1 s earlier than one before it may be missed.
    #[arg(long = "from", value_name = "TIME", value_parser = length_us, help_heading = INPUT)]
    pub(crate) from_us: Option<i64>,
    /// Read only TIME of the recording, starting at --from.
    #[arg(long = "for", value_name = "TIME", value_parser = span_us, help_heading = INPUT)]
    pub(crate) for_us: Option<i64>,
}

impl PartArgs {
    /// The part.
    pub(crate) fn part(self) -> Part {
        Part { from_us: self.from_us, for_us: self.for_us }
    }
}

/// The input and the network of `run`, `play` and `bench`.
#[derive(Debug, clap::Args)]
pub(crate) struct Input {
    /// Recording, or - for standard input [default: a small built-in recording].
    ///
    /// Events: AEDAT 2, 3.1 or 4, EVT2, EVT2.1, EVT3, DAT, Event Stream (.es), N-MNIST, CSV, npy or
    /// MCAP of ROS 2, also inside gzip, or alone in a zip archive. The built-in recording is a
    /// simulated press and release; `meissner run` without any option compares its true angles with
    /// the predicted ones.
    ///
    /// Live events: - for standard input, tcp://HOST:PORT, tcp-listen://HOST:PORT or
    /// udp://HOST:PORT. CSV lines (t_us,x,y,p) or records of 16 bytes (`meissner send --help`) are
    /// read as they arrive, with --format the raw bytes of a Prophesee sensor. dv://HOST:PORT, or
    /// dv:///PATH for a local socket, is a stream of dv-processing (its NetworkWriter).
    ///
    /// Electrodes: CSV with a column for each of the 24 electrodes, also live. Pictures: a PNG,
    /// JPEG, PPM or PGM file, a folder of them, a text file with one path per line, MCAP, or raw
    /// video, also live (--video).
    #[arg(value_name = "INPUT")]
    pub(crate) recording: Option<PathBuf>,
    /// Read at most N events of the recording.
    #[arg(long, value_name = "N", help_heading = INPUT)]
    pub(crate) limit: Option<u64>,
    #[command(flatten)]
    pub(crate) part: PartArgs,
    /// Policy for an event that is earlier than an event before it.
    #[arg(long, value_parser = choice(LATE_POLICIES), default_value = "drop", help_heading = INPUT)]
    pub(crate) late: LatePolicy,
    /// Policy for a clock of the sensor that restarts.
    ///
    /// A sensor that was connected again, or whose counter began anew, starts a new clock: events
    /// in a row are earlier by more than the window. Restarts are counted ("restarts"). With reset,
    /// a single event more than 10 s ahead is dropped as an outlier unless the one after it
    /// confirms its time.
    #[arg(long, value_parser = choice(RESTART_POLICIES), default_value = "reset", help_heading = INPUT)]
    pub(crate) restart: RestartPolicy,
    #[command(flatten)]
    pub(crate) read: ReadArgs,
    /// A shipped network, or a description file (.toml) [default: tactigraph-past].
    ///
    /// `meissner networks` lists the shipped networks. A description file needs --weights.
    #[arg(long, value_name = "NETWORK", help_heading = NETWORK)]
    pub(crate) network: Option<String>,
    #[command(flatten)]
    pub(crate) weights: NetworkWeights,
    /// Length of the window, instead of the description's.
    #[arg(long = "span", value_name = "TIME", value_parser = span_us, help_heading = NETWORK)]
    pub(crate) span_us: Option<i64>,
    /// Largest number of events in the window, instead of the description's.
    #[arg(long, value_name = "N", help_heading = NETWORK,
          value_parser = clap::value_parser!(u32).range(1..=Network::MAX_CAPACITY as i64))]
    pub(crate) capacity: Option<u32>,
    #[command(flatten)]
    pub(crate) approximations: ApproximationArgs,
}

/// What makes the names in a file of weights those of the network.
#[derive(Debug, clap::Args)]
pub(crate) struct MapArgs {
    /// Names in --weights that stand for others in the network.
    ///
    /// OLD=NEW says what the network calls the tensor OLD of the file; FILE has a line OLD = NEW
    /// for each. With dots at the ends, all names that start with OLD are meant: encoder.=blocks.
    /// It may be given several times. Names that differ by a habit of PyTorch need no map
    /// (docs/weights-from-pytorch.md).
    #[arg(long = "map", value_name = "OLD=NEW|FILE", requires = "weights", help_heading = NETWORK)]
    lines: Vec<String>,
}

impl MapArgs {
    /// The weights at `path`, with these names.
    pub(crate) fn of<'a>(&'a self, path: Option<&'a Path>) -> Option<WeightsFile<'a>> {
        path.map(|path| WeightsFile { path, map: &self.lines })
    }
}

/// The weights of a network.
#[derive(Debug, clap::Args)]
pub(crate) struct NetworkWeights {
    /// Weights [default: those shipped with the network].
    ///
    /// The file is safetensors, or a state dict that PyTorch saved. `verify` draws weights for a
    /// description file from --seed.
    #[arg(id = "weights", long = "weights", value_name = "FILE", help_heading = NETWORK)]
    path: Option<PathBuf>,
    #[command(flatten)]
    map: MapArgs,
    /// Run weights that were trained on another preparation of the input.
    ///
    /// The preparation is the graph with its scales, span and cells, or the way in which frames are
    /// made. Without this option, such weights are refused. With it, the predictions are not the
    /// ones that the weights were trained for, and every output says so.
    #[arg(long, help_heading = NETWORK)]
    pub(crate) ignore_preparation: bool,
}

impl NetworkWeights {
    /// The file, if there is one.
    pub(crate) fn file(&self) -> Option<WeightsFile<'_>> {
        self.map.of(self.path.as_deref())
    }
}

/// Approximations, which make results cheaper and less exact.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct ApproximationArgs {
    /// Keep the values of a row or pixel that changes by at most X.
    ///
    /// X is the limit for every channel. Without this option every change counts, and results are
    /// exact. In networks over events, a new row of a spline block is always stored, and pooled
    /// maxima and the readout are exact over the stored rows, so errors do not grow with time. Rows
    /// that are computed once on arrival (the event level of tactigraph-frozen and tactigraph-past)
    /// stay exact.
    #[arg(long, value_name = "X", value_parser = number, help_heading = APPROXIMATIONS)]
    pub(crate) tolerance: Option<f32>,
    /// Limit each node of the event graph to its first K neighbours.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u8).range(1..), help_heading = APPROXIMATIONS)]
    pub(crate) neighbours: Option<u8>,
    #[command(flatten)]
    pub(crate) filters: FilterArgs,
    /// Recompute a prediction only after N more accepted events.
    ///
    /// Until then the last prediction is repeated, with its time. With --stale-time too, a
    /// prediction is recomputed as soon as either limit is reached.
    #[arg(long, value_name = "N", help_heading = APPROXIMATIONS,
          value_parser = clap::value_parser!(u64).range(1..=i64::MAX as u64))]
    pub(crate) stale_events: Option<u64>,
    /// Recompute a prediction only after TIME more of stream time.
    #[arg(long = "stale-time", value_name = "TIME", value_parser = span_us, help_heading = APPROXIMATIONS)]
    pub(crate) stale_us: Option<i64>,
}

/// Filters of events.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct FilterArgs {
    /// Drop events as noise if no neighbouring pixel fired within TIME before.
    ///
    /// The neighbours are the 8 pixels around the event. The contact-angle paper uses 1250us.
    /// Filters act in this order: --activity-filter, --refractory, --rate-limit, --stride. Late
    /// events and events outside the sensor are dropped after the filters.
    #[arg(long = "activity-filter", value_name = "TIME", value_parser = span_us, help_heading = APPROXIMATIONS)]
    pub(crate) activity_filter_us: Option<i64>,
    /// Drop events of a pixel within TIME after its last kept event.
    #[arg(long = "refractory", value_name = "TIME", value_parser = span_us, help_heading = APPROXIMATIONS)]
    pub(crate) refractory_us: Option<i64>,
    /// Thin events evenly above this rate, in events per second.
    ///
    /// Bursts of up to 1 ms at this rate pass unthinned.
    #[arg(long, value_name = "RATE", help_heading = APPROXIMATIONS,
          value_parser = clap::value_parser!(u64).range(1..=RateLimit::HIGHEST))]
    pub(crate) rate_limit: Option<u64>,
    /// Keep every Nth event, and drop the others.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = APPROXIMATIONS)]
    pub(crate) stride: Option<u32>,
}

impl FilterArgs {
    /// The requested filters.
    pub(crate) fn values(&self) -> Approximations {
        Approximations {
            activity_filter_us: self.activity_filter_us,
            refractory_us: self.refractory_us,
            rate_limit: self.rate_limit,
            stride: self.stride,
            ..Approximations::default()
        }
    }
}

impl ApproximationArgs {
    /// The requested approximations.
    pub(crate) fn values(&self) -> Approximations {
        Approximations {
            tolerance: self.tolerance,
            neighbours: self.neighbours,
            stale_events: self.stale_events,
            stale_us: self.stale_us,
            ..self.filters.values()
        }
    }
}

/// Options of [`ReadArgs`] that apply only to events.
pub(crate) const READING: &[&str] =
    &["--columns", "--time-unit", "--salvage", "--format", "--chip", "--stream", "--reconnect"];
/// Approximations that make a prediction depend on earlier predictions.
pub(crate) const REUSES: &[&str] = &["--tolerance", "--stale-events", "--stale-time"];
/// Approximations that keep events or predictions outside the engine.
pub(crate) const REMEMBERS: &[&str] =
    &["--activity-filter", "--refractory", "--rate-limit", "--stride", "--stale-events", "--stale-time"];

/// The names of modes, with their help.
pub(crate) const MODES: &[(&str, &str, Mode)] = &[
    ("incremental", "Recompute only what an event changes", Mode::Incremental),
    ("batch", "Recompute every row, at every prediction", Mode::Batch),
];

/// The names of policies for late events, with their help.
const LATE_POLICIES: &[(&str, &str, LatePolicy)] = &[
    ("drop", "Drop the event, and count it", LatePolicy::Drop),
    ("clamp", "Accept the event at the newest time, and count it", LatePolicy::Clamp),
];

/// The names of policies for restarts, with their help.
const RESTART_POLICIES: &[(&str, &str, RestartPolicy)] = &[
    ("reset", "Forget the events before, and go on with the new clock", RestartPolicy::Reset),
    ("keep", "Keep the old clock: such events are late", RestartPolicy::Keep),
];

/// Reads the name of one of `choices`: (name, help, value).
pub(crate) fn choice<T: Copy + Send + Sync>(
    choices: &'static [(&'static str, &'static str, T)],
) -> impl TypedValueParser<Value = T> {
    let names = choices.iter().map(|&(name, help, _)| PossibleValue::new(name).help(help));
    PossibleValuesParser::new(names).map(|chosen| {
        let choice = choices.iter().find(|&&(name, ..)| name == chosen);
        choice.expect("clap accepts only these names").2
    })
}

/// Reads a finite number of at least 0.
pub(crate) fn number(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|number: &f32| number.is_finite() && *number >= 0.0);
    number.ok_or_else(|| "expected a finite number of at least 0, such as 0.01".to_owned())
}

/// Reads a positive number.
pub(crate) fn positive(text: &str) -> Result<f64, String> {
    let number = text.parse().ok().filter(|number: &f64| (1e-6..=1e6).contains(number));
    number.ok_or_else(|| "expected a number from 0.000001 to 1000000, such as 0.5".to_owned())
}

/// Reads a part of a whole.
pub(crate) fn part(text: &str) -> Result<f64, String> {
    let part = text.parse().ok().filter(|part: &f64| (0.0..=1.0).contains(part));
    part.ok_or_else(|| "expected a number from 0 to 1, such as 0.3".to_owned())
}

/// Reads a length of time.
pub(crate) fn length(text: &str) -> Result<Duration, String> {
    length_us(text).map(|us| Duration::from_micros(us.unsigned_abs()))
}

/// Reads a length of time above 0.
pub(crate) fn period(text: &str) -> Result<Duration, String> {
    span_us(text).map(|us| Duration::from_micros(us.unsigned_abs()))
}

/// The number of threads.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub(crate) struct Threads {
    /// Threads that share the work [default: the machine's cores].
    ///
    /// The results are the same for any number.
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..=512), help_heading = MEASUREMENT)]
    threads: Option<u16>,
}

/// `--threads` for a single engine, whose work at most two threads share.
pub(crate) fn of_one_engine(arg: Arg) -> Arg {
    let help = "Threads that share the work of a prediction, 1 or 2 [default: 1]";
    let more = "The second helps where a prediction takes hundreds of microseconds. The values are the same, bit for bit. \
                Not with --mode batch, whose predictions one thread computes.";
    let arg = arg.value_parser(value_parser!(u16).range(1..=2)).help_heading(PREDICTIONS);
    arg.help(help).long_help(format!("{help}.\n\n{more}"))
}

impl Threads {
    /// A pool of this many threads.
    pub(crate) fn pool(self) -> Result<ThreadPool, CliError> {
        let threads = self.threads.map_or(0, usize::from);
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        pool.map_err(|source| CliError::Threads { threads, source })
    }

    /// Whether two threads share the work of one engine.
    pub(crate) fn are_two(self) -> bool {
        self.threads == Some(2)
    }

    /// The pool whose two threads share the work of one engine, if there are two. The calling
    /// thread is one of them while the pool exists.
    pub(crate) fn shared(self) -> Result<Option<ThreadPool>, CliError> {
        let two = || ThreadPoolBuilder::new().num_threads(2).use_current_thread().build();
        self.are_two().then(two).transpose().map_err(|source| CliError::Threads { threads: 2, source })
    }
}
