//! Arguments of `meissner pareto`.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use clap::Subcommand;
use meissner_evaluate::pareto::Options;
use meissner_run::text::length_us;

use crate::args::{INPUT, MEASUREMENT, NETWORK, NetworkWeights, OUTPUT, ReadArgs};
use crate::output::ReportArgs;
use crate::tasks::{AreaTask, DigitsTask, ForceTask, SlipTask, TouchTask};
use crate::threads::Threads;

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
    pub(super) study: StudyArgs,
}

#[derive(Debug, Subcommand)]
pub(super) enum StudyArgs {
    /// Digits (N-MNIST), networks over events: time against wrong answers.
    Digits(StudyOf<DigitsTask>),
    /// Objects and containers under a tactile skin: time against wrong answers.
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
pub(super) struct StudyOf<T: clap::Args> {
    #[command(flatten)]
    pub(super) task: T,
    #[command(flatten)]
    pub(super) common: Common,
}

/// A recording and networks over events.
#[derive(Debug, clap::Args)]
pub(super) struct AngleTask {
    /// Recording.
    #[arg(value_name = "RECORDING")]
    pub(super) recording: PathBuf,
    /// How the recording is read.
    #[command(flatten)]
    pub(super) read: ReadArgs,
    /// Leave out events of the first TIME of the recording.
    #[arg(long = "from", value_name = "TIME", value_parser = length_us, help_heading = INPUT)]
    pub(super) from_us: Option<i64>,
    /// Network over events to measure [default: tactigraph-past].
    ///
    /// The name of a shipped network, or a description file, which needs --weights. It may be given
    /// several times.
    #[arg(long = "network", value_name = "NETWORK", help_heading = NETWORK)]
    pub(super) networks: Vec<String>,
    #[command(flatten)]
    pub(super) weights: NetworkWeights,
}

/// Options of all studies.
#[derive(Debug, clap::Args)]
pub(super) struct Common {
    /// Keep finished measurements in this file, and do not repeat them.
    #[arg(long, value_name = "FILE.jsonl", help_heading = MEASUREMENT)]
    pub(super) state: Option<PathBuf>,
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
    pub(super) threads: Threads,
    #[command(flatten)]
    pub(super) report: ReportArgs,
    /// Write a table to this file, a line for each setting.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) csv: Option<PathBuf>,
    /// Draw time against error, with the front, into this file.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    pub(super) svg: Option<PathBuf>,
}

impl Common {
    /// The options without the command line.
    pub(super) fn options(&self) -> Options {
        let timed = self.timed_events.map(|events| events as usize);
        Options { timed, repeats: self.repeat, only: self.only.clone() }
    }
}
