//! `meissner run`: its arguments.

use std::path::{Path, PathBuf};

use meissner_engine::Sensor;
use meissner_engine::frames::{Convolution, FrameOptions, Skip};
use meissner_engine::representations::Sampling;
use meissner_io::{PixelFormat, VideoFormat};
use meissner_kernels::WinogradTile;
use meissner_run::RunError;
use meissner_run::mcap::McapLog;
use meissner_run::model::FrameModel;
use meissner_run::predictor::Mode;
use meissner_run::provenance::{InputCard, ModelCard};
use meissner_run::run::{RunOptions, SaveState, VideoOptions};
use meissner_run::source::Source;
use meissner_run::text::span_us;
use meissner_view::Chosen;
use meissner_view::sensors::Sensors;

use crate::args::{
    ELECTRODES, Every, FRAMES, Input, JsonArgs, MODES, OUTPUT, PREDICTIONS, READING, REMEMBERS, REUSES,
    STATE, Threads, choice, number, of_one_engine,
};
use crate::error::CliError;
use crate::given::Given;
use crate::kind::NetworkKind::{self, Electrodes, EventFrames, EventGraph, Pictures};
use crate::output::LogArgs;
use crate::page;
use crate::predictions::{About, TableKind};

/// Examples, at the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner run
  meissner run --svg press.svg
  meissner run touch.aedat4 --network tactigraph-past --every event
  meissner run monday.csv --save-state touch.state
  meissner run tuesday.csv --resume touch.state --save-state touch.state
  meissner run touch.aedat4 --network event-frame-cnn --every 5ms --json
  meissner run press.aedat4 --network force-convlstm --threads 2
  meissner run touch.aedat4 --mcap touch.mcap
  camera | meissner run - --sensor 346x260 --network force-lstm --json
  meissner run slip.csv --network slip-regularised
  biotac | meissner run - --network slip-lstm --hold 5 --json
  meissner run images/ --network canf --overlay maps
  camera | meissner run - --network canf --video 320x240@25";

/// First bytes of a state. A file with another beginning is not read further, because the engine
/// refuses it.
const STATE_MARK: &[u8] = b"MEISSNER";
/// Largest state that is read, in bytes: 2 GiB, as for weights.
const STATE_BYTES: u64 = 1 << 31;

/// `meissner run`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = EXAMPLES, mut_arg("threads", of_one_engine))]
pub(crate) struct RunArgs {
    #[command(flatten)]
    pub(super) input: Input,
    /// Recompute only what an event changes, or every row at every prediction.
    ///
    /// Both modes give the same values, bit for bit.
    #[arg(long, value_parser = choice(MODES), default_value = "incremental", help_heading = PREDICTIONS)]
    pub(super) mode: Mode,
    /// When to predict [default: 10ms, or every frame].
    ///
    /// event: after every accepted event. N: after every N accepted events. end: once, at the end
    /// of the input. TIME: at the first event's time + TIME, + 2 TIME and so on, as soon as a later
    /// event arrives, and once more at the first due time at or after the last event. Each
    /// prediction is for the window at its due time, also in a gap between events; due times are
    /// skipped while a gap leaves the window empty.
    ///
    /// Frame networks over consecutive windows of events predict after every frame, at the end, or
    /// every TIME, which must be a multiple of the windows' length. Over a sliding window, a frame
    /// is formed whenever a prediction is due. Empty frames count like others (see
    /// --longest-silence).
    #[arg(long, value_name = "event|N|TIME|end", help_heading = PREDICTIONS)]
    pub(super) every: Option<Every>,
    #[command(flatten)]
    pub(super) threads: Threads,
    #[command(flatten)]
    pub(super) format: JsonArgs,
    /// Draw the angles of the press that the program holds into this file.
    ///
    /// `meissner run` without INPUT and other options shows this press: what a network predicts of
    /// it, and what is true.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) svg: Option<PathBuf>,
    #[command(flatten)]
    pub(super) log: LogArgs,
    /// Show events and predictions on a page of this port.
    ///
    /// It is a page as of `meissner view`, on 127.0.0.1; without PORT, on any free one. Its address
    /// goes to standard error. It is for networks over events or their frames; `meissner view`
    /// shows more, at the pace of a page.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", help_heading = OUTPUT)]
    pub(super) view: Option<u16>,
    #[command(flatten)]
    pub(super) state: StateArgs,
    #[command(flatten)]
    pub(super) frames: FrameArgs,
    #[command(flatten)]
    pub(super) electrodes: ElectrodeArgs,
}

/// Options for networks that read frames.
#[derive(Debug, clap::Args)]
pub(super) struct FrameArgs {
    /// Compute everything at every frame, even if no change reaches it.
    ///
    /// The results have the same bits.
    #[arg(long, conflicts_with = "tolerance", help_heading = FRAMES)]
    pub(super) no_skip: bool,
    /// Algorithm for 3 x 3 convolutions of many channels [default: direct].
    ///
    /// The Winograd algorithms round differently: they are an approximation.
    #[arg(long, value_parser = choice(CONVOLUTIONS), value_name = "WAY", help_heading = FRAMES)]
    pub(super) convolution: Option<Convolution>,
    /// Largest number of consecutive empty frames that are pushed [default: 6000].
    ///
    /// Each empty frame is a step of the network. After N of them, the state is reset to the one
    /// before the first frame, and the remaining empty frames are skipped. 6000 is a minute of
    /// frames of 10 ms. The summary counts the pushed and the skipped frames.
    #[arg(long, value_name = "N", help_heading = FRAMES)]
    pub(super) longest_silence: Option<u64>,
    /// Read INPUT as raw video: pictures without headers, one after the other.
    ///
    /// INPUT is a file, a named pipe, -, tcp://HOST:PORT or tcp-listen://HOST:PORT. PIXELS are the
    /// bytes of a pixel: rgb24 (the default), bgr24 as arrays of cv2, or gray8. The size must be
    /// that of the network: `meissner inspect NETWORK` shows it, and ffmpeg scales with -s.
    ///
    /// Without FPS, every picture is predicted, and the writer waits. With FPS (25, 29.97 or
    /// 30000/1001 pictures a second), a stream never waits: a picture that has waited for longer
    /// than 1/FPS is dropped if a newer one is there, and counted. Of a file,
    /// every picture is predicted. Bytes after the last whole picture are left out and counted;
    /// with --strict they are an error.
    #[arg(long, value_name = "WxH[@FPS][:PIXELS]", value_parser = video, help_heading = FRAMES)]
    pub(super) video: Option<Video>,
    /// Draw forces, outline and centroid over each picture, into this folder.
    ///
    /// The files are PNG and have the names of the pictures, or their numbers in a video.
    #[arg(long, value_name = "DIR", help_heading = FRAMES)]
    pub(super) overlay: Option<PathBuf>,
    /// Force in N per pixel at the overlay's strongest colour.
    ///
    /// Without this option, it is the strongest force of each picture.
    #[arg(long, value_name = "X", requires = "overlay", value_parser = number, help_heading = FRAMES)]
    pub(super) full_scale: Option<f32>,
    /// Picture without contact, to compare with by plain differences.
    ///
    /// The output then also has the area and the centroid of the region in which a picture differs
    /// from this one by more than 10 of 255 levels, averaged over 5 x 5 pixels. Networks whose
    /// pictures enter as differences, canf among them, take it instead of the first
    /// picture.
    #[arg(long, value_name = "IMAGE", help_heading = FRAMES)]
    pub(super) reference: Option<PathBuf>,
}

/// Options for networks that read electrodes.
#[derive(Debug, clap::Args)]
pub(super) struct ElectrodeArgs {
    /// Readings that form a window [default: as in the network's description].
    ///
    /// sliding: the newest readings, with a prediction at every reading, as a controller needs it
    /// (the shipped networks' default). consecutive: windows that do not overlap, as the paper on
    /// direction of slip evaluates. N: every Nth reading, in windows that do not overlap.
    ///
    /// A line that is not a reading (too few fields, text, NaN: see --strict) starts a new window
    /// and clears the decision. If the CSV has a column of time, so does a reading that is earlier
    /// than the one before it, or more than 50 ms later. Nothing is printed while a new window
    /// fills. The summary counts these cases, and also values outside 0 to 4095 and intervals that
    /// differ from 10 ms by more than 20 %, which are used unchanged.
    #[arg(long, value_name = "sliding|consecutive|N", value_parser = sampling, help_heading = ELECTRODES)]
    pub(super) sampling: Option<Sampling>,
    /// Change the decision only when N windows in a row agree [default: 1].
    ///
    /// The first decision also needs N windows that agree; until then there is none. With sliding
    /// windows at 100 Hz, this delays a decision by 10 (N - 1) ms. An interruption of the readings
    /// clears the decision (see --sampling).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = ELECTRODES)]
    pub(super) hold: Option<u32>,
    /// Ignore windows whose largest probability is below P [default: 0].
    ///
    /// An ignored window does not change the decision, and it ends a run of windows that agree (see
    /// --hold).
    #[arg(long, value_name = "P", value_parser = probability, help_heading = ELECTRODES)]
    pub(super) least_probability: Option<f32>,
}

/// A raw video: its format, and the pictures in a second.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(crate) struct Video(VideoFormat, Option<f64>);

impl Video {
    /// The options of this video; if it is `strict`, left-over bytes are an error.
    pub(crate) fn options(self, strict: bool) -> VideoOptions {
        let Self(format, rate) = self;
        VideoOptions { format, rate, strict }
    }
}

/// The names of algorithms for 3 x 3 convolutions, with their help.
const CONVOLUTIONS: &[(&str, &str, Convolution)] = &[
    ("direct", "Multiply and add, pixel by pixel", Convolution::Direct),
    ("winograd2", "Winograd's filtering of 2 x 2 pixels", Convolution::Winograd(WinogradTile::Two)),
    ("winograd4", "Winograd's filtering of 4 x 4 pixels", Convolution::Winograd(WinogradTile::Four)),
];

impl FrameArgs {
    /// The algorithm for 3 x 3 convolutions.
    pub(super) fn convolution(&self) -> Convolution {
        self.convolution.unwrap_or(Convolution::Direct)
    }
}

/// Options for runs that are resumed later.
#[derive(Clone, Debug, Default, clap::Args)]
pub(super) struct StateArgs {
    /// Write the state after the last event to this file, for --resume.
    ///
    /// For networks over events, and over frames of events. Results that are due only because the
    /// input ends (the prediction of --every TIME, a frame whose window is still open) are left to
    /// the resumed run; --every end predicts. The state is also written after Ctrl-C, SIGTERM and
    /// errors of input and output, but not after an error of the engine or if most of a text is
    /// refused.
    ///
    /// The file is replaced atomically: a crash leaves the previous one. What is no regular file,
    /// such as a device, is refused before the run.
    #[arg(long, value_name = "FILE", help_heading = STATE)]
    pub(super) save_state: Option<PathBuf>,
    /// Also write the state after every TIME of stream time.
    #[arg(long = "save-every", value_name = "TIME", requires = "save_state", value_parser = span_us,
          help_heading = STATE)]
    pub(super) save_every_us: Option<i64>,
    /// Resume from the state in this file; INPUT is the input that follows it.
    ///
    /// Both runs together print the same as a single run. Network, weights, sensor, --late and
    /// --tolerance must be the same as in the run that wrote the state; otherwise the state is
    /// refused. Repeated events are not detected: events before the last event of the first run are
    /// late (see --late), and events at its time count twice. "rows" of the first prediction and
    /// "skips" count only this run, which computes each row again.
    #[arg(long, value_name = "FILE", help_heading = STATE)]
    pub(super) resume: Option<PathBuf>,
}

/// Options of [`StateArgs`] that make a run part of a longer one.
const STATES: &[&str] = &["--save-state", "--resume"];

impl RunArgs {
    /// The options of a run over events.
    pub(super) fn options(&self) -> Result<RunOptions, CliError> {
        let read =
            |path: &PathBuf| meissner_io::read_file(path, STATE_MARK, STATE_BYTES).map_err(RunError::File);
        let save = |path: PathBuf| SaveState { path, every_us: self.state.save_every_us };
        Ok(RunOptions {
            mode: self.mode,
            every: self.every,
            late: self.input.late,
            restart: self.input.restart,
            approximations: self.input.approximations.values(),
            two_threads: self.threads.are_two(),
            limit: self.input.limit,
            resume: self.state.resume.as_ref().map(read).transpose()?,
            save: self.state.save_state.clone().map(save),
            longest_silence: self.frames.longest_silence,
        })
    }

    /// The options of a raw video, if the input is one.
    pub(super) fn video(&self) -> Option<VideoOptions> {
        Some(self.frames.video?.options(self.input.read.strict))
    }

    /// The page for events of `source`, if requested.
    pub(super) fn page<N>(
        &self,
        source: &Source,
        sensor: Sensor,
        span_us: i64,
        chosen: &Chosen<N>,
    ) -> Result<Option<Sensors>, CliError> {
        page::sensors(self.view, &[(source.name.clone(), sensor)], span_us, self.input.network(), chosen)
    }

    /// Adds the path of the state file to `error`.
    pub(super) fn refused(&self, error: RunError) -> CliError {
        match (error, &self.state.resume) {
            (RunError::Resume(source), Some(path)) => CliError::Resume { path: path.clone(), source },
            (error, _) => error.into(),
        }
    }

    /// The options of a frame engine; `sparse` frames are mostly zeros.
    pub(super) fn frame_options(&self, sparse: bool) -> FrameOptions {
        let skip = match self.input.approximations.tolerance {
            Some(tolerance) => Skip::Tolerance(tolerance),
            None if self.frames.no_skip => Skip::Nothing,
            None => Skip::Exact,
        };
        let two_threads = self.threads.are_two();
        FrameOptions::new().with_skip(skip).with_sparse(sparse).with_two_threads(two_threads)
    }

    /// A description of how a frame network runs, for the text report.
    fn mode_of(&self, options: FrameOptions) -> String {
        let skip = match options.skip {
            Skip::Nothing => "computes everything".to_owned(),
            Skip::Exact => "computes what changes".to_owned(),
            Skip::Tolerance(tolerance) => {
                format!("computes what changes by more than {tolerance} (an approximation)")
            }
        };
        let way = match self.frames.convolution() {
            // Only heads are made with the latter.
            Convolution::Direct | Convolution::Kn2row => "",
            Convolution::Winograd(WinogradTile::Two) => ", convolves by Winograd 2 x 2 (an approximation)",
            Convolution::Winograd(WinogradTile::Four) => ", convolves by Winograd 4 x 4 (an approximation)",
        };
        let threads = if options.two_threads { ", two threads" } else { "" };
        format!("{skip}{way}{threads}")
    }

    /// The subject of a report about the network of `card`; `live`, `total`: as in [`About`].
    pub(super) fn about<'a>(
        &self,
        table: TableKind,
        input: InputCard,
        (card, mode): (&'a ModelCard, String),
        (live, total): (bool, Option<u64>),
    ) -> About<'a> {
        let inputs = vec![input];
        About { command: "run", json: self.format.json, live, inputs, card, mode, frames: None, table, total }
    }

    /// As [`Self::about`], for a frame network that runs with `options`.
    pub(super) fn about_frames<'a>(
        &self,
        table: TableKind,
        input: InputCard,
        (model, options): (&'a FrameModel, FrameOptions),
        stream: (bool, Option<u64>),
    ) -> About<'a> {
        let about = self.about(table, input, (&model.card, self.mode_of(options)), stream);
        About { frames: Some(model), ..about }
    }

    /// Begins the log, if there is one.
    pub(super) fn begin_log(&self, card: &ModelCard, sensor: Sensor) -> Result<Option<McapLog>, CliError> {
        self.log.begin(card, &[sensor], self.input.recording.is_none())
    }

    /// The path of the input, which must be `expected`.
    pub(super) fn recording(&self, expected: &str) -> Result<&Path, CliError> {
        self.input.recording.as_deref().ok_or_else(|| self.no_input(expected, "no INPUT"))
    }

    pub(super) fn no_input(&self, expected: &str, found: &str) -> CliError {
        let network = format!("network {}", self.input.network());
        CliError::usage(&network, &format!("{expected} as INPUT"), found)
    }

    /// Refuses options that do not apply to a network of `kind`.
    pub(super) fn check(&self, given: &Given, kind: NetworkKind) -> Result<(), CliError> {
        for (options, kinds) in OPTIONS_OF_KINDS.iter().filter(|(_, kinds)| !kinds.contains(&kind)) {
            if let Some(option) = given.first(options) {
                let (option, network) = (option.to_owned(), self.input.network().to_owned());
                let fits = kinds.iter().map(|kind| kind.name()).collect::<Vec<_>>().join(" or ");
                return Err(CliError::Misfit { option, fits, network, kind: kind.name() });
            }
        }
        // Checked now, because hours later it would be too late.
        self.log.check()?;
        let state = self.state.save_state.as_deref();
        Ok(state.map_or(Ok(()), meissner_io::check_replaceable).map_err(RunError::File)?)
    }

    /// Refuses approximations that reuse earlier results in batch mode, and states of runs with
    /// memory that the state does not contain.
    pub(super) fn check_state(&self, given: &Given) -> Result<(), CliError> {
        let batch = self.mode == Mode::Batch;
        if let Some(option) = given.first(REUSES).filter(|_| batch) {
            return Err(CliError::usage(
                option,
                "--mode incremental with it, since it says what may be kept",
                "--mode batch, which computes every row at every prediction",
            ));
        }
        let Some(option) = given.first(STATES) else { return Ok(()) };
        let found = match given.first(REMEMBERS) {
            _ if batch => "--mode batch, which keeps all events",
            Some(other) => &format!("{other}, which remembers what the state does not hold"),
            None => return Ok(()),
        };
        let expected = "neither --mode batch nor filters nor a stale readout with it";
        Err(CliError::usage(option, expected, found))
    }

    /// Refuses a state of a run that skips events: the state does not say which event is next.
    pub(super) fn check_stride(given: &Given, card: &ModelCard) -> Result<(), CliError> {
        match (given.first(STATES), card.network.stride) {
            (Some(option), stride @ 2..) => {
                let found = format!("weights with metadata \"stride\" {stride}");
                Err(CliError::usage(option, "weights of a network that takes every event", &found))
            }
            _ => Ok(()),
        }
    }
}

/// Options that fit networks of some kinds only, and these kinds.
pub(crate) const OPTIONS_OF_KINDS: &[(&[&str], &[NetworkKind])] = &[
    (&["--sensor", "--from", "--for", "--late", "--restart", "--every"], &[EventGraph, EventFrames]),
    (STATES, &[EventGraph, EventFrames]),
    (READING, &[EventGraph, EventFrames]),
    (&["--mcap", "--view"], &[EventGraph, EventFrames]),
    (&["--strict"], &[EventGraph, EventFrames, Electrodes, Pictures]),
    (&["--span", "--capacity", "--mode", "--neighbours"], &[EventGraph]),
    (REMEMBERS, &[EventGraph]),
    (&["--no-skip", "--convolution"], &[EventFrames, Electrodes, Pictures]),
    (&["--longest-silence"], &[EventFrames]),
    (&["--video", "--overlay", "--full-scale", "--reference"], &[Pictures]),
    (&["--sampling", "--hold", "--least-probability"], &[Electrodes]),
];

/// Reads the format of a raw video: `320x240`, `320x240@25` or `320x240@30000/1001:bgr24`.
pub(crate) fn video(text: &str) -> Result<Video, String> {
    let (text, pixels) = text.split_once(':').map_or((text, None), |(text, pixels)| (text, Some(pixels)));
    let pixels = pixels.map_or(Ok(PixelFormat::default()), str::parse).map_err(|error| error.to_string())?;
    let (size, rate) = text.split_once('@').map_or((text, None), |(size, rate)| (size, Some(rate)));
    let rate = rate.map(|rate| {
        let (pictures, seconds) = rate.split_once('/').unwrap_or((rate, "1"));
        let rate = pictures.parse::<f64>().ok().zip(seconds.parse::<f64>().ok());
        let rate =
            rate.map(|(pictures, seconds)| pictures / seconds).filter(|rate| (1e-3..=1e5).contains(rate));
        rate.ok_or_else(|| "expected 0.001 to 100000 pictures a second, such as 25 or 30000/1001".to_owned())
    });
    let sides = size.split_once('x').and_then(|(width, height)| width.parse().ok().zip(height.parse().ok()));
    let (width, height) = sides.ok_or_else(|| {
        "expected columns x rows, such as 320x240, 320x240@25 or 320x240@25:bgr24".to_owned()
    })?;
    let format = VideoFormat::new(width, height, pixels).map_err(|error| error.to_string())?;
    Ok(Video(format, rate.transpose()?))
}

/// Reads a number from 0 to 1.
fn probability(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|number: &f32| (0.0..=1.0).contains(number));
    number.ok_or_else(|| "expected a number from 0 to 1, such as 0.6".to_owned())
}

/// Reads the sampling of readings.
fn sampling(text: &str) -> Result<Sampling, String> {
    let stride = || text.parse().ok().filter(|stride| (1..=1 << 16).contains(stride));
    match text {
        "consecutive" => Ok(Sampling::Consecutive),
        "sliding" => Ok(Sampling::Sliding),
        _ => stride()
            .map(|stride| Sampling::Step { stride })
            .ok_or_else(|| "expected consecutive, sliding, or a stride from 1 to 65536".to_owned()),
    }
}
