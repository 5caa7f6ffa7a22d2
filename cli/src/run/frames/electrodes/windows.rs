//! Readings into windows, windows into predictions, predictions into decisions.
//!
//! A window's readings are pushed into a network whose state is that before the first frame, and the prediction is that
//! after the last of them. What a reading becomes on its own is made once; the steps of the network are computed again
//! for each window, because each starts from that state.

use std::io;
use std::time::Instant;

use meissner_engine::representations::TactileWindow;
use meissner_io::Reading;
use meissner_kernels::softmax;
use meissner_models::systems::slip::DecisionFilter;

use super::line::{Line, Outputs};
use crate::error::CliError;
use crate::run::frames::report::Report;
use meissner_pipeline::frame_predictor::FramePredictor;
use meissner_pipeline::latency::microseconds;

pub(super) struct Windows<'a> {
    pub(super) machine: FramePredictor,
    pub(super) report: Report,
    outputs: Outputs<'a>,
    window: TactileWindow,
    filter: DecisionFilter,
    values: Vec<f32>,
    probabilities: Vec<f32>,
    /// How often a decision was made or changed.
    decisions: u64,
}

impl<'a> Windows<'a> {
    pub(super) fn new(
        machine: FramePredictor,
        report: Report,
        outputs: Outputs<'a>,
        window: TactileWindow,
        filter: DecisionFilter,
    ) -> Self {
        let (values, probabilities) = (Vec::new(), Vec::new());
        Self { machine, report, outputs, window, filter, values, probabilities, decisions: 0 }
    }

    /// What follows stands in no window with what came before, and no decision rests on both.
    pub(super) fn begin_anew(&mut self) {
        self.window.reset();
        self.filter.reset();
    }

    /// How often a decision was made or changed; none where the values are not of classes.
    pub(super) fn decisions(&self) -> Option<u64> {
        self.outputs.are_classes().then_some(self.decisions)
    }

    /// Takes a reading, which `follows` the one before or not; why it cannot be one, where it cannot.
    pub(super) fn take(&mut self, reading: &Reading, follows: bool) -> Result<Option<String>, CliError> {
        let start = Instant::now();
        if !follows {
            self.begin_anew();
        }
        let sequence = self.window.push(&reading.values);
        self.machine.prepared(start.elapsed());
        let sequence = match sequence {
            Ok(None) => return Ok(None),
            Ok(Some(sequence)) => sequence,
            Err(error) => return Ok(Some(error.to_string())),
        };
        self.machine.reset();
        let [_, rows, columns] = sequence.shape;
        for frame in sequence.values.chunks_exact(rows * columns) {
            self.machine.push(frame)?;
        }
        let Self { machine, values, probabilities, .. } = self;
        machine.predict(|predicted| {
            values.clear();
            values.extend_from_slice(predicted.values);
            probabilities.clone_from(values);
            softmax(probabilities);
            Ok::<_, CliError>(())
        })?;
        let class = largest(&self.probabilities);
        let decision = self.outputs.are_classes().then(|| {
            let decision = self.filter.push(class, self.probabilities[class]);
            self.decisions += u64::from(decision.is_some_and(|decision| decision.held == 1));
            decision
        });
        self.machine.decision.record(start.elapsed());
        let line = Line {
            outputs: self.outputs,
            reading,
            values: &self.values,
            probabilities: &self.probabilities,
            class,
            decision: decision.flatten(),
            update_us: microseconds(self.machine.take_update()),
        };
        show(&mut self.report, &line)?;
        Ok(None)
    }
}

fn show(report: &mut Report, line: &Line<'_>) -> io::Result<()> {
    report.prediction(line.reading.line, &line.shown(), |_| line.text())
}

/// The index of the largest value, of several the first; 0 of none.
fn largest(values: &[f32]) -> usize {
    let larger = |a: usize, b: usize| if values[b] > values[a] { b } else { a };
    (0..values.len()).reduce(larger).unwrap_or(0)
}
