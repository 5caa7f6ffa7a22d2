//! `meissner prepare`: inputs of networks with labels, in a file for training.

pub(crate) mod presses;

use std::io::{Write, stdout};
use std::path::PathBuf;

use clap::Subcommand;
use meissner_evaluate::events::Digits;
use meissner_evaluate::events::{EventData, EventTask};
use meissner_evaluate::events::{TouchContainers, TouchLetters, TouchObjects};
use meissner_evaluate::prepare::{Ages, Prepared, graphs, labelled_events, slip_windows};
use meissner_evaluate::prepare::{training_frames, training_windows};
use meissner_evaluate::slip::SlipData;
use meissner_models::AnyDescription;
use meissner_run::model::{self, WeightsFile, describe, describe_any, describe_frames};

use crate::args::{INPUT, NETWORK, OUTPUT, Threads, part};
use crate::error::CliError;
use crate::output::OutArgs;
use crate::progress::Progress;
use crate::stderr::tell;
use crate::tasks::{TouchData, TouchSet};

/// `meissner prepare`.
#[derive(Debug, clap::Args)]
pub(crate) struct PrepareArgs {
    #[command(subcommand)]
    input: InputArgs,
}

#[derive(Debug, Subcommand)]
enum InputArgs {
    /// Graphs of streams of events, as a network over events reads them.
    ///
    /// The file has neighbourhoods, cells and edges. The graph of a stream is the graph after a
    /// reset and all events of the stream. It does not depend on the weights of the network.
    Graphs(GraphsArgs),
    /// Windows of electrode readings, with the direction of slip as label.
    ///
    /// Windows are consecutive and do not overlap, as in the paper; the `sampling` of the
    /// description is ignored. Readings at the end of a recording that do not fill a window are
    /// left out. Equal data give equal bytes.
    Slip(SlipArgs),
    /// Events of the recordings of digits (N-MNIST), with labels, splits and folds.
    ///
    /// Equal data give equal bytes.
    Digits(DigitsArgs),
    /// Events of the recordings of a tactile skin, with labels, splits and folds.
    ///
    /// Equal data give equal bytes.
    Touch(TouchArgs),
    /// Recordings of presses and labels of your own: checked, joined, written.
    ///
    /// The output says how many presses and labels there are, and the notes on standard error say
    /// what is odd about them. Equal data give equal bytes.
    Presses(presses::PressesArgs),
    /// Weights that say what the windows or frames of their training were like.
    ///
    /// With them, every prediction says how unlike its window or frame is to those of DATA. The
    /// predicted values stay as they are. Equal data and seeds give equal bytes.
    Windows(WindowsArgs),
}

/// At the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner prepare slip biotac_dos/ --network slip-regularised --out a.safetensors
  meissner prepare slip biotac_dos/ --network own.toml --out own.safetensors";

/// `meissner prepare slip`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = format!("{EXAMPLES}\n\n{SLIP}"))]
struct SlipArgs {
    /// Folder of the data set, with a folder for each class.
    ///
    /// The classes are aw, cw, e, n, s, t and w; recordings are files such as n/pen178.csv.
    #[arg(value_name = "DATA")]
    data: PathBuf,
    /// Name of a shipped network, or a description file (.toml).
    ///
    /// Its table `input` has the kind of the frames, the number of readings in a window, and their
    /// scaling.
    #[arg(long, value_name = "NETWORK", help_heading = NETWORK)]
    network: String,
    #[command(flatten)]
    file: OutArgs,
}

/// Tensors of the file.
const SLIP: &str = "\
Tensors, the windows in the order of the recordings and of time:
  frames     F32 (windows, steps, 1, 12, 11), (windows, steps, 24) or, scaled in
             two ways, (windows, steps, 48): the input of the network
  readings   F32 (windows, steps, 24): the same readings in the sensor's counts
  label      I64 (windows): index into classes
  recording  I64 (windows): index into recordings
  object     I64 (windows): index into objects

Metadata, each JSON:
  classes, recordings, objects   lists of names
  sets                           {object: set that holds it}
  preparation                    {\"frames\", \"steps\", \"scaling\"} in the terms of
                                 the description. Weights that are trained on
                                 this file must have the same text in their
                                 metadata: otherwise they are refused
  range_basic                    [least, greatest] reading of the set Basic, null
                                 without Basic";

/// `meissner prepare graphs`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = GRAPHS)]
struct GraphsArgs {
    /// File with the streams (safetensors), such as `prepare digits` writes.
    #[arg(value_name = "EVENTS")]
    events: PathBuf,
    /// Name of a shipped network over events, or a description file (.toml).
    #[arg(long, value_name = "NAME", help_heading = NETWORK)]
    network: String,
    #[command(flatten)]
    file: OutArgs,
}

/// Tensors of the input and of the output.
const GRAPHS: &str = "\
Reads, for E events, one stream after the other:
  t_us, x, y, on  I64 (E): time, pixel, and 1 where the brightness rose; times of
                  a stream do not descend
  start           I64 (streams + 1): the first event of each stream, and E
  Metadata: sensor, JSON [width, height]. Everything else in the file is ignored.

Writes, for the N rows of a level, one stream after the other, and for their M in-edges, one row after the other:
  event           I32 (N0): the event of each row of level 0, an index into E
  LEVEL.start     I32 (streams + 1): the first row of each stream, and N
  LEVEL.edges     I32 (N + 1): the first in-edge of each row, and M; in-edges are
                  in neighbourhood order
  LEVEL.source    I32 (M): the row that is read, an index into N
  LEVEL.attribute F32 (M, 3): edge attributes along x, y and t, 0 to 1
  LEVEL.offset    F32 (M, 3): offsets along x, y and t in units of the level's
                  scale; for levels with PointNet blocks
  LEVEL.cell      I32 (N of the level below): the row that pools each row, an
                  index into N; for levels from 1 on
  LEVEL.index     I32 (N, 3): the row's cell along x, y and t; for levels from 1
                  on
  readout         I32 (N of the last level): cell of the readout, row by row of
                  its grid
  LEVEL is level0 for events, level1 for the first pooling and so on. At level 0 of a `frozen` graph, rows that have left the window are listed if other rows read them; their cell is -1.";

/// At the end of the long help.
const WINDOWS: &str = "\
Examples:
  meissner prepare windows train.safetensors --network own.toml \
    --weights own.safetensors --out known.safetensors
  meissner run a.aedat4 --network own.toml --weights known.safetensors

A stream with labels counts from contact, where the label depth leaves 0, or else its first label, to its last label; one without labels from its first event to its last. The windows of a network that was trained on every N-th event (stride) have every N-th event. Of frames from consecutive windows all count, of electrodes the last reading of each window; of weights that were trained on the set Basic, only this set.";

/// `meissner prepare windows`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = WINDOWS)]
#[command(override_usage = "meissner prepare windows [OPTIONS] <DATA>...\n       \
                            --network <NETWORK> --out <FILE>")]
struct WindowsArgs {
    /// Input of the training: streams, the folder of a data set, or pictures.
    ///
    /// Streams of events (safetensors) are those that `prepare graphs` reads, the folder of a data
    /// set with electrodes that of `eval slip`, pictures those of `eval area`.
    #[arg(value_name = "DATA", required = true)]
    input: Vec<PathBuf>,
    /// A shipped network, or a description file (.toml).
    #[arg(long, value_name = "NETWORK", help_heading = NETWORK)]
    network: String,
    /// Weights [default: those shipped with the network].
    #[arg(long, value_name = "FILE", help_heading = NETWORK)]
    weights: Option<PathBuf>,
    /// Random times of each stream at which its window counts, beside the end.
    #[arg(long, value_name = "N", default_value_t = 6, help_heading = INPUT)]
    ages: u32,
    /// The earliest of these times, as a part of the stream.
    ///
    /// Take that of the training: a network that was not trained to predict at the begin of a press
    /// says then that it does not know.
    #[arg(long, value_name = "PART", default_value_t = 0.3, value_parser = part, help_heading = INPUT)]
    youngest: f64,
    /// Seed of these times.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = INPUT)]
    seed: u64,
    #[command(flatten)]
    file: OutArgs,
}

/// At the end of the long help.
const DIGITS: &str = "\
Examples:
  meissner prepare digits nmnist/ --out digits.safetensors
  meissner prepare digits nmnist/ --folds 5 --out digits.safetensors";
const TOUCH: &str = "\
Examples:
  meissner prepare touch objects neutouch/ --folds 5 --out o.safetensors
  meissner prepare touch containers neutouch/ --folds 5 --out c.safetensors
  meissner prepare touch letters braille/ --out l.safetensors
  meissner fit touch-objects l.safetensors --out fitted --name letters

Of objects and containers, a pixel is 0.05 mm, and a spike has the time at which its bin of 20 ms begins. Of letters, a pixel is a taxel; `meissner eval touch --help` says what an event is.";

/// Tensors of the file.
const LABELLED: &str = "\
Tensors, all I64, the recordings by split (train first), by class and by number:
  t_us, x, y, on  (events): the events of all recordings, one after the other:
                  time in microseconds as recorded, column, row, 1 where the
                  brightness rose and 0 where it fell
  start           (recordings + 1): recording i has the events from start[i] to
                  below start[i + 1]
  label           (recordings): index into classes
  split           (recordings): 0 train, 1 test
  fold            (recordings): part of a cross-validation over both splits
                  together, from 0 on; sorted by label, the k-th recording is in
                  fold k mod N
  stamps_us       (recordings, 3): times of contact (0.2 N), of 2.5 N and of the
                  lift; of letters alone

Metadata, each JSON:
  classes, recordings   lists of names
  sensor                [columns, rows]";

/// `meissner prepare digits`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = format!("{DIGITS}\n\n{LABELLED}"))]
struct DigitsArgs {
    /// Folder of the data set, with folders train and test.
    ///
    /// One of the two is enough. Recordings are files such as train/3/00123.bin.
    #[arg(value_name = "DATA")]
    data: PathBuf,
    #[command(flatten)]
    labelled: LabelledArgs,
}

/// `meissner prepare touch`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = format!("{TOUCH}\n\n{LABELLED}"))]
struct TouchArgs {
    #[command(flatten)]
    data: TouchData,
    #[command(flatten)]
    labelled: LabelledArgs,
}

/// A file of labelled events.
#[derive(Debug, clap::Args)]
struct LabelledArgs {
    #[command(flatten)]
    file: OutArgs,
    /// Number of folds of the cross-validation.
    ///
    /// Every recording is held out by one fold, and each fold has about the same number of
    /// recordings of every class.
    #[arg(long, value_name = "N", default_value_t = 10, value_parser = clap::value_parser!(u32).range(2..),
          help_heading = OUTPUT)]
    folds: u32,
}

/// Writes the file that `args` select.
pub(crate) fn prepare(args: &PrepareArgs) -> Result<(), CliError> {
    let file = match &args.input {
        InputArgs::Graphs(args) => &args.file,
        InputArgs::Slip(args) => &args.file,
        InputArgs::Digits(DigitsArgs { labelled, .. }) | InputArgs::Touch(TouchArgs { labelled, .. }) => {
            &labelled.file
        }
        InputArgs::Windows(args) => &args.file,
        InputArgs::Presses(args) => return presses::prepare(args),
    };
    file.check()?;
    let progress = Progress::busy(|| "preparing".to_owned());
    let (notes, prepared) = match &args.input {
        InputArgs::Graphs(args) => {
            let (description, _) = describe(&args.network)?;
            (Vec::new(), graphs(&args.events, &description, &Threads::default().pool()?)?)
        }
        InputArgs::Slip(args) => {
            let (description, _) = describe_frames(&args.network)?;
            let data = SlipData::read(&args.data)?;
            let prepared = slip_windows(&data, &description)?;
            (data.notes, prepared)
        }
        InputArgs::Digits(args) => args.labelled.prepared(Digits::read(&args.data)?)?,
        InputArgs::Touch(args) => {
            let TouchData { set, data } = &args.data;
            args.labelled.prepared(match set {
                TouchSet::Objects => TouchObjects::read(data)?,
                TouchSet::Containers => TouchContainers::read(data)?,
                TouchSet::Letters => TouchLetters::read(data)?,
            })?
        }
        InputArgs::Windows(args) => (Vec::new(), args.prepared()?),
        InputArgs::Presses(args) => return presses::prepare(args),
    };
    file.write(prepared.file.into_bytes())?;
    progress.finish();
    notes.iter().for_each(|note| tell(format_args!("note: {note}")));
    let mut standard = stdout().lock();
    writeln!(standard, "{}: {}", file.out.display(), prepared.contents)?;
    Ok(standard.flush()?)
}

impl WindowsArgs {
    fn prepared(&self) -> Result<Prepared, CliError> {
        let Self { input, network, weights, ages, youngest, seed, .. } = self;
        let (description, shipped) = describe_any(network)?;
        let (weights, label) = model::weights(network, shipped, weights.as_deref().map(WeightsFile::from))?;
        let ages = Ages { count: *ages as usize, youngest: *youngest, seed: *seed };
        Ok(match description {
            AnyDescription::Events(of) => training_windows(input, &of, (&weights, &label), ages)?,
            AnyDescription::Frames(of) => training_frames(input, &of, (&weights, &label), ages)?,
        })
    }
}

impl LabelledArgs {
    /// The events of `data` with labels, splits and folds: notes, and the content of the file.
    fn prepared(&self, data: EventData) -> Result<(Vec<String>, Prepared), CliError> {
        let prepared = labelled_events(&data, self.folds as usize)?;
        Ok((data.notes, prepared))
    }
}
