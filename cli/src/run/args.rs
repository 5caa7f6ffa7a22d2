//! `meissner run`: what can be asked for.

use std::path::PathBuf;

use clap::ValueEnum;
use meissner_engine::frames::Convolution;
use meissner_engine::representations::Sampling;
use meissner_kernels::WinogradTile;

use super::state::StateArgs;
use crate::approximations::number;
use crate::args::{ELECTRODES, Every, FRAMES, Input, Mode, OUTPUT, PREDICTIONS, STATUS};

/// At the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner run touch.aedat4 --network tactigraph-past --every event
  meissner run monday.csv --save-state touch.state
  meissner run tuesday.csv --resume touch.state --save-state touch.state
  meissner run touch.aedat4 --network event-frame-cnn --every 5ms --json
  meissner run press.aedat4 --network force-convlstm --threads 2
  camera | meissner run - --sensor 346x260 --network force-lstm --json
  meissner run slip.csv --network slip-regularised
  biotac | meissner run - --network slip-lstm --hold 5 --json
  meissner run images/ --network canf --overlay maps";

/// What `--json` prints.
const JSON: &str = "\
JSON (--json): one object a line: a header that says what runs on what, predictions, then a summary (docs/json.md).
  A prediction: {\"t_us\": time of the newest event that it covers (null before the first), \"value\": [outputs, with the digits that restore each f32], \"class\" and \"probabilities\" where outputs are classes, \"nodes\": events in the window, \"rows\": [rows computed for each layer since the last prediction], \"update_us\": microseconds spent in pushes and predictions since the last prediction}.
  The last line: {\"summary\": {\"events\": taken, \"accepted\", \"dropped\": {reason: count}, \"predictions\", \"nodes_max\": most events in the window, \"latency_us\": {\"push\", \"predict\": {\"p50\", \"p90\", \"p99\", \"p999\", \"max\"} (null where there was none)}, \"events_per_s\": events over the time in pushes and predictions, \"skips\": {what was computed, came out unchanged, or was not needed; \"layers\": [the same for each layer]}, \"approximations\": {those that were asked for, \"filters\": [{\"name\", \"passed\", \"dropped\"}]} (missing where none was), \"salvaged\": {\"events\": kept, \"what\": is not whole, \"place\": where it starts, \"bytes_not_read\"} (missing where the recording is whole)}}.
  Frame networks, a prediction over events: {\"t_us\": end of the newest frame's window, \"value\", \"frames\": frames that the state has seen, \"events\": events in the newest frame, \"update_us\": microseconds spent since the last prediction in making frames and in the network}. Over electrodes: {\"line\" and \"time_s\" (null without a column of time) of the newest reading, \"value\", \"probabilities\": softmax of the values, \"class\": name of the largest, \"decision\": name of the class that stands and \"held\": windows for which it has stood, from 1 (null before the first decision, see --hold), \"update_us\"}; where the unit is not \"logit\", probabilities, class, decision and held are null. Over pictures: {\"image\": path, \"area_mm2\", \"force_n\", \"median_force_n\", \"centroid\": {\"x_px\", \"y_px\", \"x_mm\", \"y_mm\"} (null without a contact), \"baseline\": {\"area_mm2\", \"centroid\"} (null without --reference), \"overlay\": path (null without --overlay), \"update_us\"}.
  Their last line: {\"summary\": {counts of events, electrodes or pictures, \"frames\": pushed, \"predictions\", \"latency_us\": {\"prepare\": making a frame, for each event, reading or picture, \"push\" and \"predict\": as above, for each frame and prediction, \"decision\" (over electrodes, where there was a prediction): from a reading whose line has been parsed to the decision after it}, \"frames_per_s\": frames over all that time, \"pixels\": {\"computed\", \"skipped\", \"absorbed\"}, \"layers\": [the same for each layer]}}.";

/// `meissner run`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{JSON}\n\n{EXAMPLES}\n\n{STATUS}"))]
pub(crate) struct RunArgs {
    /// Input and network.
    #[command(flatten)]
    pub(crate) input: Input,
    /// Recompute what an event changes, or every row at every prediction.
    ///
    /// Both give the same values, bit for bit.
    #[arg(long, value_enum, default_value_t = Mode::Incremental, help_heading = PREDICTIONS)]
    pub(crate) mode: Mode,
    /// When to predict [default: 10ms, or every frame].
    ///
    /// event: after every accepted event. N: after every N accepted events. end: once, at the end of the input. TIME:
    /// at the first event's time + TIME, + 2 TIME and so on, as soon as a later event arrives, and once more at the
    /// first such time at or after the last event. Each of these predictions is for the window at its time, also in a
    /// gap between events; times at which a gap has emptied the window are left out.
    ///
    /// Frame networks over consecutive windows of events predict after every frame, at the end, or every TIME that is
    /// a multiple of the windows' length. Over a sliding window, a frame is formed whenever a prediction is due. Empty
    /// frames count like others (see --longest-silence).
    #[arg(long, value_name = "event|N|TIME|end", help_heading = PREDICTIONS)]
    pub(crate) every: Option<Every>,
    /// Print JSON lines: the predictions, then a summary.
    ///
    /// The keys are explained below.
    #[arg(long, help_heading = OUTPUT)]
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
pub(crate) struct FrameArgs {
    /// Compute everything at every frame, also what no change reaches.
    ///
    /// The results have the same bits.
    #[arg(long, conflicts_with = "tolerance", help_heading = FRAMES)]
    pub(crate) no_skip: bool,
    /// How 3 x 3 convolutions of many channels are computed [default: direct].
    ///
    /// Winograd's ways round differently: they are an approximation.
    #[arg(long, value_enum, value_name = "WAY", help_heading = FRAMES)]
    pub(crate) convolution: Option<Way>,
    /// Threads that share the rows of large maps, 1 or 2 [default: 1].
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u8).range(1..=2), help_heading = FRAMES)]
    pub(crate) threads: Option<u8>,
    /// Most empty frames in a row that are pushed [default: 6000].
    ///
    /// Each empty frame is a step of the network. After that many, the state goes back to that before the first frame,
    /// until events come again. 6000 is a minute of frames of 10 ms. The summary counts both.
    #[arg(long, value_name = "N", help_heading = FRAMES)]
    pub(crate) longest_silence: Option<u64>,
    /// Draw forces, outline and centroid over each picture, into this folder.
    ///
    /// The files are PNG, with the names of the pictures.
    #[arg(long, value_name = "DIR", help_heading = FRAMES)]
    pub(crate) overlay: Option<PathBuf>,
    /// Force in N per pixel at the overlay's strongest colour.
    ///
    /// Without it, this is the strongest force of each picture.
    #[arg(long, value_name = "X", requires = "overlay", value_parser = number, help_heading = FRAMES)]
    pub(crate) full_scale: Option<f32>,
    /// Picture without contact, to compare with by plain differences.
    ///
    /// Adds the area and the centroid of where a picture differs from this one by more than 10 of 255 levels, in the
    /// mean over 5 x 5 pixels.
    #[arg(long, value_name = "IMAGE", help_heading = FRAMES)]
    pub(crate) reference: Option<PathBuf>,
}

/// What can be asked for where the network reads electrodes.
#[derive(Debug, clap::Args)]
pub(crate) struct ElectrodeArgs {
    /// Which readings form a window [default: as the network's description says].
    ///
    /// sliding: the newest readings, with a prediction at every reading, as a controller needs it (the shipped
    /// networks' default). consecutive: windows that do not overlap, as the paper on direction of slip evaluates. N:
    /// every Nth reading, in windows that do not overlap.
    ///
    /// A window begins anew, and the decision is forgotten, at a line that is no reading (too few fields, text, NaN:
    /// see --strict), and where the CSV has a column of time, at a reading more than 50 ms later than the one before,
    /// or earlier. Nothing is printed while a new window fills. The summary counts each of these, values outside 0 to
    /// 4095, and intervals more than 20 % off 10 ms; the latter two are used as they are.
    #[arg(long, value_name = "sliding|consecutive|N", value_parser = sampling, help_heading = ELECTRODES)]
    pub(crate) sampling: Option<Sampling>,
    /// Change the decision only when N windows in a row agree [default: 1].
    ///
    /// The first decision, too, needs N windows that agree; until then there is none. With sliding windows at 100 Hz a
    /// decision comes 10 (N - 1) ms after the first window that would have made it. The decision is forgotten where a
    /// window begins anew (see --sampling).
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = ELECTRODES)]
    pub(crate) hold: Option<u32>,
    /// Ignore windows whose largest probability is below P [default: 0].
    ///
    /// Such a window leaves the decision as it is, and ends a run of windows that agree (see --hold).
    #[arg(long, value_name = "P", value_parser = probability, help_heading = ELECTRODES)]
    pub(crate) least_probability: Option<f32>,
}

/// How 3 x 3 convolutions are computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, ValueEnum)]
pub(crate) enum Way {
    /// Multiply and add, pixel by pixel.
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
