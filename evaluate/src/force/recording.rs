//! A network on a recording of a grasp, and its errors: over all frames, by phase, by bolt.

use meissner_engine::Event;
use meissner_simulator::grasp::Phase;
use serde::Serialize;

use crate::doubts::{BAD, Doubts};
use crate::error::Result;
use crate::judge::Figures;
use crate::metrics::{MeanStd, bhattacharyya, time_warping};
use crate::regression::Work;
use crate::regression::engine::PressEngine;
use crate::regression::press::{Effort, Presses, TimedPrediction, drive, newest};

pub(crate) const FORCE: &str = "force";
/// The labels of the phase's number and of the bolt's diameter.
const PHASE: &str = "phase";
const BOLT: &str = "bolt";

#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Outcome {
    /// Predicted and true force at the end of each frame, in newtons.
    pub(crate) values: Vec<f64>,
    pub(crate) truth: Vec<f64>,
    /// How unlike the input was at the end of each frame.
    pub(crate) unlike: Vec<Option<f32>>,
    /// The number of the phase at the end of each frame; `None` if the file has no phases.
    pub(crate) phases: Vec<Option<usize>>,
    pub(crate) bolt_mm: Option<f64>,
    /// Mean squared error of the newest prediction that a reader has, over the milliseconds.
    pub(crate) newest: Option<f64>,
    pub(crate) effort: Effort,
}

impl Outcome {
    /// The sum of `figure` of the error at each frame, and the number of frames.
    pub(crate) fn sum(&self, figure: impl Fn(f64) -> f64) -> (f64, u64) {
        let errors = self.values.iter().zip(&self.truth).map(|(value, truth)| figure(value - truth));
        (errors.sum(), self.values.len() as u64)
    }
}

/// Lets `engine` predict during recording `number`, from every `stride`-th event, at intervals of
/// `every_us`, a divisor of `period_us`. The force at the end of each `period_us` counts.
pub(crate) fn run(
    engine: &mut PressEngine,
    recordings: &Presses,
    number: usize,
    stride: usize,
    (every_us, period_us): (i64, i64),
) -> Result<Outcome> {
    let [start, end] = recordings.truth.span_us(number);
    let label = |name: &str, since: i64| recordings.truth.at(name, number, start + since);
    let force = |since: i64| label(FORCE, since).unwrap_or(f64::NAN);
    engine.reset(0);
    let part = recordings.streams.parts()[number];
    // Frames begin with the truth, and so do the engine's times.
    let since_start = |event: &Event| Event::new(event.t_us - start, event.x, event.y, event.on);
    let events = part.iter().step_by(stride).map(since_start);
    let times = (every_us..=end - start).step_by(every_us as usize);
    // An event at the end of a frame belongs to the next one.
    let within = |event_us: i64, t_us: i64| event_us < t_us;
    let shown = |values: &[f32]| values.iter().copied().map(f64::from).collect();
    let (found, effort) = drive(engine, events, times, within, shown)?;
    let of_frames = || found.iter().filter(|found| found.t_us % period_us == 0);
    let square = |held: &TimedPrediction, t_us: i64| {
        vec![(held.values[0] - force(t_us)) * (held.values[0] - force(t_us))]
    };
    Ok(Outcome {
        values: of_frames().map(|found| found.values[0]).collect(),
        truth: of_frames().map(|found| force(found.t_us)).collect(),
        unlike: of_frames().map(|found| found.unlike).collect(),
        phases: of_frames()
            .map(|found| label(PHASE, found.t_us).map(|phase| phase.round() as usize))
            .collect(),
        bolt_mm: label(BOLT, 0),
        newest: newest(&found, 0, end - start, square).map(|means| means[0]),
        effort,
    })
}

const BIN_N: f64 = 0.1;

/// Figures on recordings; `T` is a number for one training, [`MeanStd`] for several.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct ForceErrors<T = f64> {
    pub recordings: u64,
    /// All frames, those of each phase, and those of each bolt.
    pub parts: Vec<PartErrors<T>>,
    /// The same for the frames whose true force is not 0: the paper judges only these.
    pub contact: Vec<PartErrors<T>>,
    /// Mean squared error in N^2 of a reader's newest prediction at each millisecond, if any.
    pub newest: Option<T>,
    /// How unlike the training's input the input is at the ends of frames, if the weights have
    /// statistics of the training's.
    pub doubts: Option<Doubts>,
    /// Events and work of all trainings together.
    pub work: Work,
}

/// Errors of some of the frames.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct PartErrors<T = f64> {
    /// What the frames have in common: "all", a phase, or a bolt such as "8 mm".
    pub part: String,
    pub frames: u64,
    /// Mean squared error in square newtons.
    pub mse: T,
    /// Standard deviation of the recordings' own mean squared errors; 0 for a single recording.
    pub mse_std: T,
    /// Mean absolute error in newtons.
    pub mae: T,
    /// Standard deviation of the recordings' own mean absolute errors; 0 for a single recording.
    pub mae_std: T,
    /// Distance of dynamic time warping between predicted and true force in newtons: the mean over
    /// the recordings with such frames.
    pub time_warping: T,
    /// Bhattacharyya's distance of predicted and true forces; `None` where they share no bin.
    pub bhattacharyya: Option<T>,
}

impl ForceErrors {
    /// The figures of these `outcomes`; `None` for none.
    pub(super) fn new(outcomes: &[Outcome]) -> Option<Self> {
        let parts = parts(outcomes, |_, _| true);
        let mean = parts.first()?.mae;
        let frames = outcomes.iter().flat_map(|outcome| {
            let errors = outcome.values.iter().zip(&outcome.truth);
            let bad = errors.map(move |(value, truth)| (value - truth).abs() > BAD * mean);
            outcome.unlike.iter().copied().zip(bad)
        });
        let doubts = Doubts::of(frames);
        let newest: Vec<f64> = outcomes.iter().filter_map(|outcome| outcome.newest).collect();
        let mut work = Work::default();
        outcomes.iter().for_each(|outcome| work.add_press(&outcome.effort));
        Some(Self {
            recordings: outcomes.len() as u64,
            parts,
            contact: self::parts(outcomes, |outcome, frame| outcome.truth[frame] != 0.0),
            newest: MeanStd::of(&newest).map(|newest| newest.mean),
            doubts,
            work,
        })
    }
}

impl PartErrors {
    /// The errors of the frames that are in the part; `None` for no frames.
    pub(crate) fn of(
        part: &str,
        outcomes: &[Outcome],
        is_in: impl Fn(&Outcome, usize) -> bool,
    ) -> Option<Self> {
        let (mut values, mut truths, mut warped) = (Vec::new(), Vec::new(), Vec::new());
        let (mut own_squares, mut own_absolutes) = (Vec::new(), Vec::new());
        for outcome in outcomes {
            let pairs = outcome.values.iter().zip(&outcome.truth).enumerate();
            let pairs = pairs.filter(|&(frame, _)| is_in(outcome, frame));
            let (value, truth): (Vec<f64>, Vec<f64>) =
                pairs.map(|(_, (value, truth))| (value, truth)).unzip();
            let errors = errors(&value, &truth);
            let Some(squares) = MeanStd::over(&errors, |error| error * error) else { continue };
            own_squares.push(squares.mean);
            own_absolutes.extend(MeanStd::over(&errors, |error| error.abs()).map(|own| own.mean));
            warped.push(time_warping(&value, &truth));
            values.extend(value);
            truths.extend(truth);
        }
        let errors = errors(&values, &truths);
        Some(Self {
            part: part.to_owned(),
            frames: errors.len() as u64,
            mse: MeanStd::over(&errors, |error| error * error)?.mean,
            mse_std: MeanStd::of(&own_squares)?.std.unwrap_or(0.0),
            mae: MeanStd::over(&errors, |error| error.abs())?.mean,
            mae_std: MeanStd::of(&own_absolutes)?.std.unwrap_or(0.0),
            time_warping: MeanStd::of(&warped)?.mean,
            bhattacharyya: bhattacharyya(&values, &truths, BIN_N),
        })
    }

    fn mean(each: &[&Self]) -> Option<PartErrors<MeanStd>> {
        let first = each.first()?;
        let shared = each.iter().filter_map(|part| part.bhattacharyya).collect::<Vec<_>>();
        Some(PartErrors {
            part: first.part.clone(),
            frames: first.frames,
            mse: MeanStd::over(each, |part| part.mse)?,
            mse_std: MeanStd::over(each, |part| part.mse_std)?,
            mae: MeanStd::over(each, |part| part.mae)?,
            mae_std: MeanStd::over(each, |part| part.mae_std)?,
            time_warping: MeanStd::over(each, |part| part.time_warping)?,
            bhattacharyya: MeanStd::of(&shared),
        })
    }
}

fn errors(values: &[f64], truths: &[f64]) -> Vec<f64> {
    values.iter().zip(truths).map(|(value, truth)| value - truth).collect()
}

/// The errors of the frames of `outcomes` that are `within`: all of them, those of each phase, and
/// those of each bolt.
fn parts(outcomes: &[Outcome], within: impl Fn(&Outcome, usize) -> bool) -> Vec<PartErrors> {
    let mut parts = Vec::from_iter(PartErrors::of("all", outcomes, &within));
    for (number, phase) in Phase::ALL.into_iter().enumerate() {
        let is_in =
            |outcome: &Outcome, frame: usize| outcome.phases[frame] == Some(number) && within(outcome, frame);
        parts.extend(PartErrors::of(phase.name(), outcomes, is_in));
    }
    let mut bolts: Vec<f64> = outcomes.iter().filter_map(|outcome| outcome.bolt_mm).collect();
    bolts.sort_unstable_by(f64::total_cmp);
    bolts.dedup();
    for bolt in bolts {
        let is_of = |outcome: &Outcome, frame: usize| outcome.bolt_mm == Some(bolt) && within(outcome, frame);
        parts.extend(PartErrors::of(&format!("{bolt} mm"), outcomes, is_of));
    }
    parts
}

impl Figures for ForceErrors {
    type Mean = ForceErrors<MeanStd>;

    fn mean(each: &[&Self]) -> Option<ForceErrors<MeanStd>> {
        let first = each.first()?;
        let mut work = Work::default();
        each.iter().for_each(|one| work.add(&one.work));
        // Trainings that were judged on other recordings may have other parts.
        let parts = |of: fn(&Self) -> &[PartErrors]| {
            let mean = |part: &PartErrors| {
                let own = each.iter().filter_map(|one| of(one).iter().find(|own| own.part == part.part));
                PartErrors::mean(&own.collect::<Vec<_>>())
            };
            of(first).iter().map(mean).collect::<Option<Vec<_>>>()
        };
        let newest: Vec<f64> = each.iter().filter_map(|one| one.newest).collect();
        Some(ForceErrors {
            recordings: first.recordings,
            parts: parts(|one| &one.parts)?,
            contact: parts(|one| &one.contact)?,
            newest: MeanStd::of(&newest),
            doubts: Doubts::sum(each.iter().map(|one| one.doubts)),
            work,
        })
    }
}
