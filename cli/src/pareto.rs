//! `meissner pareto`: run time against error of networks, exact and with each approximation.
//! `table` and `plot` write the report as text, comma-separated values and a picture.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

pub(crate) mod plot;
pub(crate) mod table;

use std::path::{Path, PathBuf};

use clap::Subcommand;
use meissner_evaluate::events::Digits;
use meissner_evaluate::events::EventTask;
use meissner_evaluate::events::{TouchContainers, TouchLetters, TouchObjects};
use meissner_evaluate::pareto::{
    AngleOptions, Options, Progress, State, Study, angle, area, events, force, slip,
};
use meissner_run::bench::Part;
use meissner_run::text::length_us;

use crate::args::{INPUT, MEASUREMENT, NETWORK, NetworkWeights, OUTPUT, ReadArgs, Threads};
use crate::error::CliError;
use crate::output::ReportArgs;
use crate::tasks::{
    AreaTask, DigitsTask, EventNetworks, ForceTask, SlipTask, TouchData, TouchSet, TouchTask,
};
use crate::{output, progress};

/// Measures the networks that `args` name.
pub(crate) fn pareto(args: &ParetoArgs) -> Result<(), CliError> {
    match &args.study {
        StudyArgs::Digits(args) => recordings::<Digits>(&args.task.data, &args.task.networks, &args.common),
        StudyArgs::Touch(StudyOf { task: TouchTask { data: TouchData { set, data }, networks }, common }) => {
            match set {
                TouchSet::Objects => recordings::<TouchObjects>(data, networks, common),
                TouchSet::Containers => recordings::<TouchContainers>(data, networks, common),
                TouchSet::Letters => recordings::<TouchLetters>(data, networks, common),
            }
        }
        StudyArgs::Angle(StudyOf { task: args, common }) => {
            let source = args.read.open(Some(&args.recording), Part::default())?;
            let asked = AngleOptions {
                networks: &args.networks,
                weights: args.weights.file(),
                ignore_preparation: args.weights.ignore_preparation,
                sensor: args.read.sensor,
                from_us: args.from_us.unwrap_or(0),
            };
            write(angle(source, asked, &common.options())?, common)
        }
        StudyArgs::Slip(args) => {
            let workers = args.common.threads.pool()?.into();
            let options = args.common.options();
            write(slip(&args.task.data, args.task.request(), &options, &workers)?, &args.common)
        }
        StudyArgs::Area(args) => {
            let workers = args.common.threads.pool()?.into();
            let (request, options) = (args.task.networks.request(), args.common.options());
            write(area(&args.task.data, request, &options, &workers)?, &args.common)
        }
        StudyArgs::Force(args) => {
            let workers = args.common.threads.pool()?.into();
            let (request, options) = (args.task.networks.request(), args.common.options());
            write(force(&args.task.events, request, &options, &workers)?, &args.common)
        }
    }
}

/// Measures `networks` on the labelled recordings in `folder`.
fn recordings<T: EventTask>(
    folder: &Path,
    networks: &EventNetworks,
    common: &Common,
) -> Result<(), CliError> {
    let workers = common.threads.pool()?.into();
    let (request, folds) = (networks.request(), networks.folds());
    write(events::<T>(folder, request, folds, &common.options(), &workers)?, common)
}

/// Runs `study`, and writes its files and text.
fn write(study: Study<'_>, common: &Common) -> Result<(), CliError> {
    output::check_all_writable([&common.report.out, &common.csv, &common.svg])?;
    let mut state = State::open(common.state.as_deref())?;
    let mut bar = None;
    let report = study.run(&common.options(), &mut state, |progress| {
        match (progress, &bar) {
            (Progress::Missing(count), _) => {
                bar = Some(progress::Progress::tasks(count, common.report.format.json));
            }
            (Progress::Started { network, setting }, Some(bar)) => bar.start(format!("{network}, {setting}")),
            (Progress::Finished, Some(bar)) => bar.done(),
            (Progress::Started { .. } | Progress::Finished, None) => {}
        }
        Ok(())
    })?;
    if let Some(bar) = bar {
        bar.finish();
    }
    if let Some(path) = &common.svg {
        output::write(path, plot::svg(&report))?;
    }
    if let Some(path) = &common.csv {
        output::write(path, table::csv(&report))?;
    }
    output::report(&common.report, &report, |out| table::write(out, &report))
}

/// The method of measurement, at the end of the long help.
const METHOD: &str = "\
How it measures:
  Each network is run exactly, then with each approximation that changes the network, and with some approximations together. The errors of a setting are differences from the exact form of the same network. The exact setting is measured like all others: its time ratio shows which differences in time are noise.
  Time: on one thread, while nothing else runs. A setting and the exact network process the same events in turns of 1,000 events, 10 windows, one press or one recording, --repeat times. The time of an event is the median over the repeats. All repeats compute the same, so an interruption of one repeat changes no figure. Mean, p50 and p99 are over the events. The ratio is the mean of the setting divided by the mean of the exact network in the same run. Times in the plot, on the front and in the last paragraph are the ratio multiplied by the time of the exact setting: no point moves if the machine is slower during one setting.
  Networks over events: the time of an event of the input, with filters, push and prediction. An event that a filter drops costs only the filter, and the last prediction stays valid.
  Frame networks: the time of a window of readings, from the reset. The time of push is that of the frames of the window.
  Area: the time of a picture, in presses of which each begins with a reset and the picture of the sensor at rest. These two do not count. The time of push is that of the picture as the network's input.
  Force: the time of a recording of a grasp, so that networks of both kinds are on one front: all its events, and a prediction at the end of each frame of 10 ms. An event of an event graph is pushed when it comes; an event of a frame network is counted, and the frame is pushed at its end.
  Work: computed rows of events and cells (pixels of frame networks), and multiply-adds at full neighbourhoods, as `meissner inspect` lists them. Winograd convolutions count like direct ones.
  Numerical error: over all predictions at the same moments, after each event (of the timed presses and recordings: each picture, each frame), in the order of time, and for each tenth of the streams. The max and RMS error are in the units of the outputs. The relative RMS error is a share of the RMS of the exact outputs. A stale readout is compared with the exact prediction of that moment.
  Wrong answers: with 95 % Wilson intervals. For several trainings, errors and bounds are means. Digits and touch are judged on the split test, or by cross-validation over all recordings if --trainings has folds of a network. Slip is judged on unseen objects, and folds are left out. Windows of one recording depend on each other, so the intervals for windows are too narrow. If predictions depend on earlier reads (tolerance, stale readout), a prediction is read after each event.
  Area: 1 - IoU in percent, the mean over all pictures of all files, and the mean absolute error of the force where it is known. Force: the mean squared error over all frames of all recordings, and the mean absolute error. Both are those of `meissner eval` for the exact setting. Their 95 % intervals are of a mean over presses or recordings, which are independent of each other (a ratio of sums, Cochran 1977, with Student's t); a single one gives none.
  Front: the settings that no other setting beats in time and error; equal settings are all on the front. With labels there is one front over all networks. Without labels there is one for each network, because errors are in the units of its outputs. The last paragraph names the fastest settings whose error is at most a bound above the exact one: points of a percentage, or a share of the exact mean squared error. A setting that is less than 1.02 times as fast does not count as faster.

Settings:
  Networks over events: tolerance; fewer neighbours than the network has; a shorter span, as a share of the network's; every Nth event (stride); a rate limit as a share of the mean rate of the events; the activity filter at 1250us; a stale readout.
  Frame networks: Winograd convolutions and a tolerance, if the network has layers for them; for windows, only the last readings; for pictures and for frames of grasps, every second one. The answer to the one before then stands for the one that is left out. A network with a state makes a step for each frame that it sees: of a grasp it sees half of the events and half of the steps.
  Area: tolerances are in the unit of the network's input, in which a grey level of the camera is 0.04 for the shipped networks, and hold for every layer.
  Force: a stale readout of 10 ms or less changes nothing, because a prediction is read every 10 ms.

State (--state):
  One line of JSON for each measurement: {\"key\": {\"system\", \"network\", \"weights\": fingerprint, \"setting\", \"data\": fingerprint, \"options\", \"version\"}, \"measurement\"}. A measurement in the file is not repeated. An unfinished last line is cut off. Any other line that cannot be read is an error. All times in a file should be from one machine.

CSV (--csv):
  The same figures, with a line for each setting, without the tenths. error_unit is share, N^2 or N; errors without labels have none.";

/// `meissner pareto`.
#[derive(Debug, clap::Args)]
pub(crate) struct ParetoArgs {
    #[command(subcommand)]
    study: StudyArgs,
}

#[derive(Debug, Subcommand)]
enum StudyArgs {
    /// Digits (N-MNIST), networks over events: time against wrong answers.
    Digits(StudyOf<DigitsTask>),
    /// Objects, containers and letters under a skin: time against wrong answers.
    Touch(StudyOf<TouchTask>),
    /// A recording without labels, networks over events: time against numerical error.
    Angle(StudyOf<AngleTask>),
    /// Direction of slip, frame networks: time against wrong answers on unseen objects.
    Slip(StudyOf<SlipTask>),
    /// Contact area from pictures of a gel: time against 1 - IoU.
    Area(StudyOf<AreaTask>),
    /// Force of grasps, networks of both kinds: time against the mean squared error.
    Force(StudyOf<ForceTask>),
}

/// The inputs of a study, and the options of all studies.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD)]
struct StudyOf<T: clap::Args> {
    #[command(flatten)]
    task: T,
    #[command(flatten)]
    common: Common,
}

/// A recording and networks over events.
#[derive(Debug, clap::Args)]
struct AngleTask {
    /// Recording.
    #[arg(value_name = "RECORDING")]
    recording: PathBuf,
    /// How the recording is read.
    #[command(flatten)]
    read: ReadArgs,
    /// Leave out events of the first TIME of the recording.
    #[arg(long = "from", value_name = "TIME", value_parser = length_us, help_heading = INPUT)]
    from_us: Option<i64>,
    /// Network over events to measure [default: tactigraph-past].
    ///
    /// The name of a shipped network, or a description file, which needs --weights. It may be given
    /// several times.
    #[arg(long = "network", value_name = "NETWORK", help_heading = NETWORK)]
    networks: Vec<String>,
    #[command(flatten)]
    weights: NetworkWeights,
}

/// Options of all studies.
#[derive(Debug, clap::Args)]
struct Common {
    /// Keep finished measurements in this file, and do not repeat them.
    #[arg(long, value_name = "FILE.jsonl", help_heading = MEASUREMENT)]
    state: Option<PathBuf>,
    /// Measure only settings with TEXT in "NETWORK, SETTING", and the exact setting.
    ///
    /// It may be given several times.
    #[arg(long, value_name = "TEXT", help_heading = MEASUREMENT)]
    only: Vec<String>,
    /// Approximate number of events that are timed in each repeat [default: 20000].
    ///
    /// `pareto digits` and `pareto touch` take whole recordings. For `pareto slip` it is the number
    /// of windows, 400 by default; for `pareto area` that of pictures, of whole presses, 40 by
    /// default; for `pareto force` that of recordings, 20 by default.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = MEASUREMENT)]
    timed_events: Option<u32>,
    /// Repeats of each measurement of time.
    #[arg(long, value_name = "N", default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..=1000),
          help_heading = MEASUREMENT)]
    repeat: u32,
    #[command(flatten)]
    threads: Threads,
    #[command(flatten)]
    report: ReportArgs,
    /// Write a table to this file, a line for each setting.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    csv: Option<PathBuf>,
    /// Draw time against error, with the front, into this file.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    svg: Option<PathBuf>,
}

impl Common {
    /// The options without the command line.
    fn options(&self) -> Options {
        let timed = self.timed_events.map(|events| events as usize);
        Options { timed, repeats: self.repeat, only: self.only.clone() }
    }
}
