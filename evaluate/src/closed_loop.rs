//! Control by touch: a simulated sensor, a network on its pictures, and a controller.
//!
//! Input: networks, a goal, and the disturbances between camera and controller. Output: a
//! [`Report`] with the error of the controlled quantity beside the run time of the network, for
//! each network and variation, and for a controller that knows the truth.
//!
//! The loop runs in simulated time, a step for each picture. A network that takes a millisecond on
//! this machine delays its reading by a millisecond of the loop, so a slow network misses pictures.
//! Run times differ from run to run; everything else is determined by the seed.
//!
//! Force: a ball is pressed so that its force follows a saw-tooth. The controller assumes the force
//! law of Hertz (Johnson 1985, "Contact Mechanics", Eq. 4.23), depth = reference * force^(2/3), and
//! knows the reference depth of the default gel. Marble: the ball lies under the sensor at constant
//! depth, is pushed away every two seconds, and is to be kept in the middle. When the sensor moves,
//! the marble rolls, and the contact moves by half as much in the other direction.
//!
//! A reading is brought up to date by the motion since its picture (Smith 1957, "Closer control of
//! loops with dead time"); the rest of the error is to vanish in two pictures.

mod line;

use std::f64::consts::TAU;
use std::fmt;

use libm::{cbrt, cos, hypot, sin};
use meissner_engine::frames::{Convolution, FrameOptions, Skip};
use meissner_kernels::random::Random;
use meissner_models::FrameDescription;
use meissner_run::model::FrameModel;
use meissner_run::provenance::{Header, InputCard, ModelCard};
use meissner_run::run::ContactPredictor;
use meissner_simulator::gel::GelSensor;
use meissner_simulator::plants::{BallContact, BallOnGel, ball_depth_mm};
use serde::Serialize;

use crate::area::{Area, model};
use crate::error::{EvaluateError, RequestPart, Result};
use crate::metrics::MeanStd;
use crate::pareto::pareto_front;
use crate::trainings::{EvaluatedNetwork, Request, candidates};
pub use line::Delays;
use line::{Line, Timed};

/// The goal of the controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum Goal {
    /// The force follows a saw-tooth from 0.4 to 1.6 N in 4 s and falls at once.
    SawTooth,
    /// A marble lies in the middle of the sensor.
    Marble,
}

impl Goal {
    /// The unit of its errors.
    pub fn unit(self) -> &'static str {
        match self {
            Self::SawTooth => "N",
            Self::Marble => "mm",
        }
    }
}

/// Ends of the saw-tooth in newtons.
const MIN_N: f64 = 0.4;
const MAX_N: f64 = 1.6;
const PERIOD_S: f64 = 4.0;
/// Time from one push of the marble to the next, in seconds.
const PUSH_S: f64 = 2.0;
/// How far from the middle a push leaves the marble, in millimetres.
const PUSHED_MM: f64 = 4.0;
const MARBLE_DEPTH_MM: f64 = 0.8;
/// Radius of the ball and of the marble, in millimetres.
const BALL_MM: f64 = 5.0;
/// The loop is judged only from this time on, so that the first approach does not count.
const SETTLED_S: f64 = 1.0;
/// Number of pictures within which an error is to vanish.
const STEPS: f64 = 2.0;
/// Greatest speeds of the ball into the gel, and of the contact along it, in millimetres a second.
const MAX_MM_PER_S: [f64; 2] = [10.0, 20.0];

/// What is controlled, by which networks, and for how long.
#[derive(Clone, Copy, Debug)]
#[expect(missing_docs, reason = "the names say it")]
pub struct Plan<'a> {
    /// The networks, over pictures.
    pub request: Request<'a>,
    pub goal: Goal,
    pub sensor: GelSensor,
    /// Simulated time in seconds.
    pub seconds: f64,
    /// Pictures a second.
    pub rate_hz: f64,
    /// Seed of noise, drift, pushes and lost pictures.
    pub seed: u64,
    /// Variations that are tried with each network.
    pub variations: &'a [Variation],
}

/// How a network runs in the loop.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Variation {
    /// Changes of the input up to this size are not computed; `None`: every change is computed.
    pub tolerance: Option<f32>,
    /// Delays and losses on the way.
    #[serde(flatten)]
    pub delays: Delays,
}

impl fmt::Display for Variation {
    /// The variation, in words.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { tolerance, delays: Delays { slower, stale_us, lost } } = *self;
        let parts = [
            tolerance.map(|tolerance| format!("tolerance {tolerance}")),
            (slower != 1.0).then(|| format!("{slower} times slower")),
            (stale_us > 0).then(|| format!("{} ms later", stale_us as f64 / 1e3)),
            (lost > 0.0).then(|| format!("{:.0} % lost", 100.0 * lost)),
        ];
        let parts: Vec<String> = parts.into_iter().flatten().collect();
        f.pad(&if parts.is_empty() { "as it is".to_owned() } else { parts.join(", ") })
    }
}

/// Errors and times of all loops, with the keys of the JSON report.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Report {
    pub header: Header,
    pub goal: Goal,
    pub seconds: f64,
    pub rate_hz: f64,
    pub seed: u64,
    /// Remarks about the trainings, for people.
    pub notes: Vec<String>,
    /// A controller that knows the truth of every picture at once.
    pub truth: Row,
    pub networks: Vec<NetworkReport>,
}

/// The loops of a network.
#[derive(Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct NetworkReport {
    #[serde(flatten)]
    pub card: ModelCard,
    #[serde(skip)]
    pub weights: String,
    pub rows: Vec<Row>,
}

/// A loop.
#[derive(Clone, Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Row {
    /// Name of the variation, or `the truth`.
    pub name: String,
    #[serde(flatten)]
    pub variation: Variation,
    /// Mean distance from the goal, in the goal's unit.
    pub error: f64,
    /// Root of the mean square distance.
    pub rms: f64,
    /// Mean distance of readings from the truth of their pictures; `None` without readings.
    pub reading_error: Option<f64>,
    /// Median run time of a picture in microseconds, as the loop saw it; `None` without readings.
    pub run_us: Option<f64>,
    /// Mean age of the newest reading at a motion, in microseconds; `None` without readings.
    pub age_us: Option<f64>,
    /// Pictures that were taken.
    pub pictures: u64,
    /// Pictures that became readings.
    pub read: u64,
    /// Pictures that were lost. The others were replaced by newer ones while the network was busy.
    pub pictures_lost: u64,
    /// Whether no other loop has both a smaller run time and a smaller error.
    pub on_front: bool,
    /// At each picture: time in seconds, goal, truth. For a marble, the distance from the middle.
    #[serde(serialize_with = "crate::thinned::trace")]
    pub trace: Vec<(f64, f64, f64)>,
}

/// Runs the loops of `plan`, one after the other, so that none slows another.
///
/// Complexity: a contact and a picture for each step, and a network's run for each picture that it
/// takes.
///
/// # Errors
/// A network cannot be read or runs on other frames; a time, rate or share of the plan is out of
/// range.
pub fn run(plan: &Plan<'_>) -> Result<Report> {
    check(plan)?;
    let (candidates, notes) = candidates::<Area>(plan.request)?;
    let models = candidates.iter().flat_map(|candidate| {
        candidate.trainings.iter().map(move |training| {
            let model = model(&candidate.description, training, Convolution::Direct)?;
            Ok((candidate, model))
        })
    });
    let models: Vec<(&EvaluatedNetwork<FrameDescription>, FrameModel)> = models.collect::<Result<_>>()?;
    let mut networks = Vec::new();
    let mut size = [320, 240];
    for (candidate, model) in models {
        let read = ContactPredictor::new(&model, FrameOptions::new())?.size();
        size = [read.width, read.height];
        let mut rows = Vec::new();
        for variation in plan.variations {
            let skip = variation.tolerance.map_or(Skip::Exact, Skip::Tolerance);
            let mut predictor = ContactPredictor::new(&model, FrameOptions::new().with_skip(skip))?;
            rows.push(drive(plan, *variation, size, Some(&mut predictor))?);
        }
        networks.push(NetworkReport { card: model.card, weights: candidate.weights(), rows });
    }
    let truth = drive(plan, Variation::default(), size, None)?;
    mark_front(&mut networks);
    let header = Header::of_many("simulate loop", InputCard::other("simulated gel", "pictures"));
    let Plan { goal, seconds, rate_hz, seed, .. } = *plan;
    Ok(Report { header, goal, seconds, rate_hz, seed, notes, truth, networks })
}

fn check(plan: &Plan<'_>) -> Result<()> {
    let refused = |part: RequestPart, expected: &str, found: f64| {
        Err(EvaluateError::request(part, expected, found.to_string()))
    };
    let is_positive = |value: f64| value > 0.0 && value.is_finite();
    if !is_positive(plan.seconds) || plan.seconds > 3600.0 {
        return refused(RequestPart::Seconds, "above 0, and at most 3600", plan.seconds);
    }
    if !is_positive(plan.rate_hz) || plan.rate_hz > 10_000.0 {
        return refused(RequestPart::Rate, "above 0, and at most 10000", plan.rate_hz);
    }
    for Variation { delays: Delays { slower, lost, .. }, .. } in plan.variations {
        if !is_positive(*slower) {
            return refused(RequestPart::Slower, "above 0", *slower);
        }
        if !(0.0..=1.0).contains(lost) {
            return refused(RequestPart::Lost, "a share from 0 to 1", *lost);
        }
    }
    Ok(())
}

/// Marks the loops that no other beats in run time and error, over all networks.
fn mark_front(networks: &mut [NetworkReport]) {
    let mut rows: Vec<&mut Row> = networks.iter_mut().flat_map(|network| &mut network.rows).collect();
    let points: Vec<_> = rows.iter().map(|row| (row.run_us.unwrap_or(f64::INFINITY), row.error)).collect();
    pareto_front(&points).into_iter().for_each(|place| rows[place].on_front = true);
}

/// A loop with a network, or with the truth instead of a network.
fn drive(
    plan: &Plan<'_>,
    variation: Variation,
    size: [usize; 2],
    mut network: Option<&mut ContactPredictor>,
) -> Result<Row> {
    let (mut plant, at_rest) = BallOnGel::new(&plan.sensor, BALL_MM, size, plan.seed)?;
    if let Some(predictor) = &mut network {
        predictor.set_reference(&at_rest);
    }
    let controller = Controller::new(plan, size)?;
    let mut line = Line::new(variation.delays, plan.seed);
    let mut pushes = Random::new(plan.seed ^ 1);
    let step_us = 1e6 / plan.rate_hz;
    let steps = (plan.seconds * plan.rate_hz).ceil() as usize;
    let pushed_every = ((PUSH_S * plan.rate_hz) as usize).max(1);
    // How far the controller has moved the contact until each picture, and the truth at that time.
    let (mut path, mut truths) = (vec![[0.0; 3]], Vec::new());
    let (mut trace, mut ages) = (Vec::new(), Vec::new());
    for step in 0..steps {
        let now_us = step as f64 * step_us;
        if plan.goal == Goal::Marble && step % pushed_every == 0 {
            let (angle, truth) = (TAU * pushes.uniform(), plant.truth());
            let [x, y] = truth.middle_mm.unwrap_or_default();
            let deeper = if step == 0 { MARBLE_DEPTH_MM } else { 0.0 };
            plant.move_by([deeper, PUSHED_MM * cos(angle) - x, PUSHED_MM * sin(angle) - y])?;
        }
        let truth = plant.truth();
        let (goal, is) = plan.goal.compared(truth, now_us / 1e6);
        trace.push((now_us / 1e6, goal, is));
        truths.push(truth);
        match &mut network {
            Some(predictor) => {
                let scale = scale(&plan.sensor, predictor);
                let mut estimate = |rgb: &[u8]| -> Result<_> {
                    let reading = read(predictor, rgb, scale)?;
                    Ok((reading, predictor.take_update()))
                };
                line.push(now_us, || Ok(plant.picture()?), &mut estimate)?;
            }
            None => {
                line.readings.push(Timed { taken_us: now_us, ready_us: now_us, run_us: 0.0, reading: truth });
            }
        }
        let mut motion = [0.0; 3];
        if let Some(timed) = line.newest(now_us) {
            ages.push(now_us - timed.taken_us);
            let taken = (timed.taken_us / step_us).round() as usize;
            let since = [0, 1, 2].map(|axis| path[step][axis] - path[taken][axis]);
            motion = controller.motion(timed.reading, since, (now_us + step_us) / 1e6);
        }
        let moved = plant.move_by(motion)?;
        path.push([0, 1, 2].map(|axis| path[step][axis] + moved[axis]));
    }
    let taken = |timed: &Timed| truths[(timed.taken_us / step_us).round() as usize];
    let missed = line.readings.iter().filter_map(|timed| plan.goal.missed(timed.reading, taken(timed)));
    let missed: Vec<f64> = missed.collect();
    let mut run_us: Vec<f64> = line.readings.iter().map(|timed| timed.run_us).collect();
    run_us.sort_by(f64::total_cmp);
    let judged = trace.iter().filter(|(at_s, ..)| plan.goal == Goal::Marble || *at_s >= SETTLED_S);
    let errors: Vec<f64> = judged.map(|(_, goal, is)| (goal - is).abs()).collect();
    let mean = |values: &[f64]| MeanStd::of(values).map(|found| found.mean);
    let squares = MeanStd::over(&errors, |error| error * error).map_or(0.0, |found| found.mean);
    Ok(Row {
        name: if network.is_some() { variation.to_string() } else { "the truth".to_owned() },
        variation,
        error: mean(&errors).unwrap_or(0.0),
        rms: squares.sqrt(),
        reading_error: mean(&missed),
        run_us: run_us.get(run_us.len() / 2).copied(),
        age_us: mean(&ages),
        pictures: steps as u64,
        read: line.readings.len() as u64,
        pictures_lost: line.lost,
        on_front: false,
        trace,
    })
}

impl Goal {
    /// The goal at a time in seconds, and the true value of the same quantity.
    fn compared(self, truth: BallContact, at_s: f64) -> (f64, f64) {
        match self {
            Self::SawTooth => (saw_tooth(at_s), truth.force_n),
            Self::Marble => (0.0, truth.middle_mm.map_or(PUSHED_MM, |[x, y]| hypot(x, y))),
        }
    }

    /// How far a reading is from the truth; `None` if one of them has no contact to compare.
    fn missed(self, reading: BallContact, truth: BallContact) -> Option<f64> {
        match self {
            Self::SawTooth => Some((reading.force_n - truth.force_n).abs()),
            Self::Marble => {
                let (found, is) = (reading.middle_mm?, truth.middle_mm?);
                Some(hypot(found[0] - is[0], found[1] - is[1]))
            }
        }
    }
}

/// The force that is the goal at a time in seconds.
fn saw_tooth(at_s: f64) -> f64 {
    MIN_N + (MAX_N - MIN_N) * (at_s / PERIOD_S).fract()
}

/// Turns readings into motions of the contact.
struct Controller {
    goal: Goal,
    /// Time of a step in seconds.
    step_s: f64,
    /// Depth of the ball in the default gel at one newton, in millimetres.
    reference_mm: f64,
}

impl Controller {
    fn new(plan: &Plan<'_>, size: [usize; 2]) -> Result<Self> {
        let middle_n = f64::midpoint(MIN_N, MAX_N);
        let depth_mm = ball_depth_mm(&GelSensor::default(), BALL_MM, size, middle_n)?;
        let reference_mm = depth_mm / two_thirds(middle_n);
        Ok(Self { goal: plan.goal, step_s: 1.0 / plan.rate_hz, reference_mm })
    }

    /// How far the contact is to move until `end_s`, deeper and along x and y, when `reading` is
    /// the newest one and the contact has moved by `since` after its picture.
    fn motion(&self, reading: BallContact, since: [f64; 3], end_s: f64) -> [f64; 3] {
        let [into, along] = MAX_MM_PER_S.map(|speed| speed * self.step_s);
        match (self.goal, reading.middle_mm) {
            (Goal::SawTooth, _) => {
                let depth = |force_n: f64| self.reference_mm * two_thirds(force_n.max(0.0));
                let missing = depth(saw_tooth(end_s)) - (depth(reading.force_n) + since[0]);
                [(missing / STEPS).clamp(-into, into), 0.0, 0.0]
            }
            (Goal::Marble, Some([x, y])) => {
                let missing = [-(x + since[1]), -(y + since[2])].map(|missing| missing / STEPS);
                let length = hypot(missing[0], missing[1]);
                let share = if length > along { along / length } else { 1.0 };
                [0.0, missing[0] * share, missing[1] * share]
            }
            // A marble that is not seen stays where it is.
            (Goal::Marble, None) => [0.0; 3],
        }
    }
}

fn two_thirds(x: f64) -> f64 {
    let root = cbrt(x);
    root * root
}

/// Width of a pixel of the sensor, and the factor from forces on the network's pixels to its own.
fn scale(sensor: &GelSensor, predictor: &ContactPredictor) -> (f64, f64) {
    let (own_mm, pixel_mm) =
        (predictor.pixel().sides_mm()[0], sensor.width_mm / predictor.size().width as f64);
    (pixel_mm, (pixel_mm / own_mm) * (pixel_mm / own_mm))
}

fn read(predictor: &mut ContactPredictor, rgb: &[u8], (pixel_mm, scale): (f64, f64)) -> Result<BallContact> {
    let report = predictor.measure(rgb)?;
    let size = predictor.size();
    let from_middle = |at_px: f64, side: usize| (at_px - (side - 1) as f64 / 2.0) * pixel_mm;
    let middle_mm =
        report.centroid.map(|at| [from_middle(at.x_px, size.width), from_middle(at.y_px, size.height)]);
    Ok(BallContact { force_n: report.force_n * scale, middle_mm })
}

#[cfg(test)]
mod tests;
