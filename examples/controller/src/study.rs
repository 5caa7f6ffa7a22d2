//! The closed loop in simulated time: how well the dome is levelled with exact predictions, with stale ones, and with dropped events.
//!
//! Enters: an engine, a fingertip, a processor's speed and queue. Leaves: the error over time, and a picture of several. Equal input gives
//! equal bytes.

use meissner::live::LiveError;
use meissner::{Engine, EngineError};
use meissner_plot::{Panel, Plane, Series, Style, page};
use meissner_simulator::SimulatorError;
use thiserror::Error;

use crate::fingertip::{Fingertip, TICK_US};
use crate::law::Levelling;
use crate::processor::Processor;
use crate::surface::COURSE;
use crate::tap::{Phase, TAP_US};

/// A processor of the study.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Case {
    /// Its name in the picture.
    pub name: &'static str,
    /// Events that it takes in a millisecond.
    pub rate: usize,
    /// Events that may wait.
    pub capacity: usize,
}

/// Events in a millisecond that a slow processor takes. A press brings three times as many, and a tap on average a little less.
const SLOW: usize = 50;

/// Predictions that are exact, that are stale because events wait, and that lack events because there is no room to wait.
pub const CASES: [Case; 3] = [
    Case { name: "exact", rate: usize::MAX, capacity: usize::MAX },
    Case { name: "stale", rate: SLOW, capacity: usize::MAX },
    Case { name: "drops", rate: SLOW, capacity: 256 },
];

/// How a dome was levelled.
#[derive(Clone, Debug)]
pub struct Levelled {
    /// The processor.
    pub case: Case,
    /// Seconds, and the angle between dome and plane in degrees, wherever it changes.
    pub errors: Vec<(f64, f64)>,
    /// The angle at the contact of each tap, in degrees.
    pub at_contact: Vec<f64>,
    /// Most events that were waiting during a hold.
    pub waiting: usize,
    /// Events that were dropped.
    pub dropped: u64,
}

impl Levelled {
    /// Mean of the angle at the contacts for which the law is to blame, in degrees: all but the first, and the first after each jump of the
    /// course.
    pub fn mean(&self) -> f64 {
        let jumps = COURSE.map(|(tap, _)| tap as usize);
        let taps = self.at_contact.iter().enumerate().filter(|(tap, _)| !jumps[..3].contains(tap));
        let (sum, count) = taps.fold((0.0, 0.0), |(sum, count), (_, angle)| (sum + angle, count + 1.0));
        sum / count
    }
}

/// Why a study ended early.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum StudyError {
    /// A prediction failed.
    #[error(transparent)]
    Engine(#[from] EngineError),
    /// The live engine failed.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// The camera refused an image.
    #[error(transparent)]
    Simulator(#[from] SimulatorError),
}

/// Lets the law level `tip` for `taps` taps with the predictions of `engine` on the processor of `case`.
///
/// # Errors
/// A prediction fails.
pub fn level(engine: Engine, mut tip: Fingertip, case: Case, taps: usize) -> Result<Levelled, StudyError> {
    let mut processor = Processor::new(engine, case.rate, case.capacity);
    let mut law = Levelling::default();
    let mut events = Vec::new();
    let mut levelled = Levelled { case, errors: Vec::new(), at_contact: Vec::new(), waiting: 0, dropped: 0 };
    for tick in 0..taps as i64 * TAP_US / TICK_US {
        let error = tip.error().to_degrees();
        if tick * TICK_US % TAP_US == 0 {
            levelled.at_contact.push(error);
        }
        levelled.errors.push((tick as f64 * TICK_US as f64 * 1e-6, error));
        tip.tick();
        events.clear();
        tip.take(&mut events)?;
        let state = tip.state();
        processor.tick(state.t_us, &events);
        if state.phase == Phase::Hold {
            tip.aim(law.target(&state, processor.predict()?));
            levelled.waiting = levelled.waiting.max(processor.waiting());
        }
    }
    levelled.dropped = processor.dropped();
    levelled.errors = corners(&levelled.errors, 0.02);
    Ok(levelled)
}

/// The points of a line that are needed to draw it within `tolerance`: where it is constant, the ends.
fn corners(points: &[(f64, f64)], tolerance: f64) -> Vec<(f64, f64)> {
    let mut kept: Vec<(f64, f64)> = Vec::new();
    for (i, &point) in points.iter().enumerate() {
        let moved = |other: &(f64, f64)| (other.1 - point.1).abs() > tolerance;
        let turns = points.get(i + 1).is_none_or(|next| kept.last().is_none_or(moved) || moved(next));
        if turns {
            kept.push(point);
        }
    }
    kept
}

/// The errors over time, in one picture.
pub fn picture(levelled: &[Levelled]) -> String {
    let series = levelled.iter().enumerate().map(|(colour, levelled)| Series {
        name: levelled.case.name.to_owned(),
        colour,
        style: Style::Line,
        points: levelled.errors.clone(),
    });
    let plane = Plane {
        title: "Angle between the axis of the dome and the normal of the plane".to_owned(),
        about: "The plane is tilted at 0 s, jumps at 4.8 and 9.6 s, and turns from then on by 0.65 degrees with each tap.".to_owned(),
        x_title: "time (s)".to_owned(),
        y_title: "error (degrees)".to_owned(),
        from_zero: true,
        ordered: false,
        series: series.collect(),
    };
    let about = format!(
        "A simulated dome taps a plane every 0.8 s. exact: every event in time. stale: a processor takes {SLOW} events in a \
         millisecond, and the others wait. drops: only {} may wait, and the oldest make room.",
        CASES[2].capacity
    );
    page("Levelling by touch", &about, &[vec![Panel::Plane(plane)]])
}

#[cfg(test)]
mod tests {
    use super::corners;

    #[test]
    fn a_line_keeps_its_ends_and_where_it_turns() {
        let points = [(0.0, 1.0), (1.0, 1.0), (2.0, 1.0), (3.0, 0.5), (4.0, 0.0), (5.0, 0.0), (6.0, 0.0)];
        let expected = [(0.0, 1.0), (2.0, 1.0), (3.0, 0.5), (4.0, 0.0), (6.0, 0.0)];
        assert_eq!(corners(&points, 0.01), expected);
    }
}
