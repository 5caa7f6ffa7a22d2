//! `meissner run`: what can be asked for.
#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use clap::ValueEnum;
use meissner_engine::frames::Convolution;
use meissner_engine::representations::Sampling;
use meissner_kernels::WinogradTile;

use super::state::StateArgs;
use crate::approximations::number;
use crate::args::{Every, Input, Mode, STATUS};

/// At the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner run touch.aedat4 --network tactigraph-past --every event
  meissner run monday.csv --save-state touch.state
  meissner run tuesday.csv --resume touch.state --save-state touch.state
  meissner run touch.aedat4 --network event-frame-cnn --every 5000us --json
  meissner run press.aedat4 --network force-convlstm --threads 2
  camera | meissner run - --sensor 346x260 --network force-lstm --json
  meissner run slip.csv --network slip-regularised
  biotac | meissner run - --network slip-lstm --hold 5 --least-probability 0.6 --json
  meissner run images/ --network canf --overlay maps --reference images/untouched.png";

/// `meissner run`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{EXAMPLES}\n\n{STATUS}"))]
pub(crate) struct RunArgs {
    /// Input and network.
    #[command(flatten)]
    pub(crate) input: Input,
    /// Recompute what an event changes, or every row at every prediction. The values are the same, bit for bit.
    #[arg(long, value_enum, default_value_t = Mode::Incremental)]
    pub(crate) mode: Mode,
    /// When a prediction is read: after every accepted event, at the end, after every N accepted events, or every N
    /// microseconds of stream time [default: 10000us, or every frame].
    ///
    /// Every N microseconds: at the first event's time + N, + 2N, and so on, as soon as an event later than that
    /// arrives, and once more at the first such time at or after the last event. Each prediction is for the window at
    /// its time, also in a gap between events. Once a gap has emptied the window, its remaining times are left out:
    /// nothing can change before the next event.
    ///
    /// Frame networks over consecutive windows of events predict after every frame, at the end, or every N microseconds
    /// with N a multiple of the windows' length. Over a sliding window, a frame is formed and predicted for whenever one
    /// is due. In both, empty frames count like others (see --longest-silence).
    #[arg(long, value_name = "event|end|N|Nus")]
    pub(crate) every: Option<Every>,
    /// One JSON object a line: a header that says what runs on what, predictions, then a summary (docs/json.md).
    ///
    /// A prediction: {"t_us": time of the newest event that it covers (null before the first), "value": [outputs, with
    /// the digits that restore each f32], "class" and "probabilities" where outputs are classes, "nodes": events in the window, "rows": [rows computed for each layer since
    /// the last prediction], "update_us": microseconds spent in pushes and predictions since the last prediction}.
    ///
    /// The last line: {"summary": {"events": taken, "accepted", "dropped": {reason: count}, "predictions", "nodes_max":
    /// most events in the window, "latency_us": {"push", "predict": {"p50", "p90", "p99", "p999", "max"} (null where there
    /// was none)}, "events_per_s": events over the time in pushes and predictions, "skips": {what was
    /// computed, came out unchanged, or was not needed; "layers": [the same for each layer]}, "approximations": {those that
    /// were asked for, "filters": [{"name", "passed", "dropped"}]} (missing where none was), "salvaged": {"events": kept, "what": is not
    /// whole, "place": where it starts, "bytes_not_read"} (missing where the recording is whole)}}.
    ///
    /// Frame networks, a prediction over events: {"t_us": end of the newest frame's window, "value", "frames": frames
    /// that the state has seen, "events": events in the newest frame, "update_us": microseconds spent since the last
    /// prediction in making frames and in the network}. Over electrodes: {"line" and "time_s" (null without a column
    /// of time) of the newest reading, "value", "probabilities": softmax of the values, "class": name of the largest,
    /// "decision": name of the class that stands and "held": windows for which it has stood, from 1 (null before the
    /// first decision, see --hold), "update_us"}; where the unit is not "logit", probabilities, class, decision and
    /// held are null. Over pictures: {"image": path, "area_mm2", "force_n", "median_force_n", "centroid": {"x_px",
    /// "y_px", "x_mm", "y_mm"} (null without a contact), "baseline": {"area_mm2", "centroid"} (null without
    /// --reference), "overlay": path (null without --overlay), "update_us"}.
    ///
    /// Their last line: {"summary": {counts of events, electrodes or pictures, "frames": pushed, "predictions",
    /// "latency_us": {"prepare": making a frame, for each event, reading or picture, "push" and "predict": as above, for
    /// each frame and prediction, "decision" (over electrodes, where there was a prediction): from a reading whose line
    /// has been parsed to the decision behind it}, "frames_per_s": frames over
    /// all that time, "pixels": {"computed", "skipped", "absorbed"}, "layers": [the same for each layer]}}.
    #[arg(long)]
    pub(crate) json: bool,
    /// Where a run goes on later, or from.
    #[command(flatten)]
    pub(crate) state: StateArgs,
    /// How a frame network runs.
    #[command(flatten)]
    pub(crate) frames: FrameArgs,
    /// What is made of readings and decisions.
    #[command(flatten)]
    pub(crate) electrodes: ElectrodeArgs,
}

/// What can be asked for where the network reads frames.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Frame networks")]
pub(crate) struct FrameArgs {
    /// Compute everything, at every frame. Without it what no change reaches is kept, with the same bits as if it had
    /// been computed.
    #[arg(long, conflicts_with = "tolerance")]
    pub(crate) no_skip: bool,
    /// How 3 x 3 convolutions of many channels are computed; Winograd's ways round otherwise: an approximation
    /// [default: direct].
    #[arg(long, value_enum, value_name = "direct|winograd2|winograd4")]
    pub(crate) convolution: Option<Way>,
    /// Threads that share the rows of large maps [default: 1].
    #[arg(long, value_name = "1|2", value_parser = clap::value_parser!(u8).range(1..=2))]
    pub(crate) threads: Option<u8>,
    /// Most consecutive frames without events that are pushed, each a step of the network; after them the state is
    /// that before the first frame, until events come again. The summary counts both [default: 6000].
    ///
    /// 6000 is a minute of frames of 10 ms.
    #[arg(long, value_name = "FRAMES")]
    pub(crate) longest_silence: Option<u64>,
    /// Write each picture with forces, outline and centroid drawn over it to this folder, as PNG with the same name.
    #[arg(long, value_name = "DIR")]
    pub(crate) overlay: Option<PathBuf>,
    /// Force in N per pixel that has the overlay's strongest colour [default: the strongest force of each picture].
    #[arg(long, value_name = "X", requires = "overlay", value_parser = number)]
    pub(crate) full_scale: Option<f32>,
    /// Picture without contact: adds the area and the centroid of where others differ from it by more than 10 of 255
    /// levels, in the mean over 5 x 5 pixels.
    #[arg(long, value_name = "IMAGE")]
    pub(crate) reference: Option<PathBuf>,
}

/// What can be asked for where the network reads electrodes.
#[derive(Debug, clap::Args)]
#[command(next_help_heading = "Electrodes")]
pub(crate) struct ElectrodeArgs {
    /// Which readings stand together in a window, in place of what the description says: the newest ones, with a
    /// prediction a reading (sliding), those of windows that do not overlap (consecutive), or every Nth reading, in
    /// windows that do not overlap (N) [default of the shipped networks: sliding].
    ///
    /// The paper on direction of slip trains and evaluates on windows that do not overlap: use consecutive to compare
    /// with its figures, sliding in a controller.
    ///
    /// A window begins anew, and the decision is forgotten, at a row that is no reading (too few fields, text, NaN: see
    /// --strict), and where the CSV has a column of time, at a reading more than 50 ms later (5 periods
    /// of 100 Hz) or earlier than the one before. What such a reading would complete is no window of readings that
    /// follow each other. A repeated time parts nothing: it may be coarser than the readings. The summary counts each
    /// of these, values beyond 0 to 4095 and intervals more than 20 % off 10 ms; the latter two are used as they are.
    /// Nothing is printed while readings stay away or a new window fills: a controller should not act on an old line.
    #[arg(long, value_name = "consecutive|sliding|N", value_parser = sampling)]
    pub(crate) sampling: Option<Sampling>,
    /// A decision changes only when N windows in a row agree on another class [default: 1, each window decides].
    ///
    /// The first decision, too, needs N windows that agree; until then there is none. With sliding windows at 100 Hz a
    /// decision comes 10 (N - 1) ms after the first window that would have made it. A window in which the class that
    /// stands, or a third one, is the most probable ends a run of windows that agree. Where a window begins anew (see
    /// --sampling) the decision is forgotten rather than kept: what was decided before a break may no longer hold.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..))]
    pub(crate) hold: Option<u32>,
    /// A window whose largest probability is below P has no say: the decision stands [default: 0].
    ///
    /// Such a window ends a run of windows that agree: with --hold N, each of the last N windows is to be that sure.
    #[arg(long, value_name = "P", value_parser = probability)]
    pub(crate) least_probability: Option<f32>,
}

/// How 3 x 3 convolutions are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Way {
    /// Product by product.
    Direct,
    /// Winograd's filtering of 2 x 2 pixels.
    Winograd2,
    /// Winograd's filtering of 4 x 4 pixels.
    Winograd4,
}

impl From<Way> for Convolution {
    fn from(way: Way) -> Self {
        match way {
            Way::Direct => Self::Direct,
            Way::Winograd2 => Self::Winograd(WinogradTile::Two),
            Way::Winograd4 => Self::Winograd(WinogradTile::Four),
        }
    }
}

/// Reads a number from 0 to 1.
fn probability(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|number: &f32| (0.0..=1.0).contains(number));
    number.ok_or_else(|| "expected a number from 0 to 1, such as 0.6".to_owned())
}

/// Reads which readings stand together.
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
