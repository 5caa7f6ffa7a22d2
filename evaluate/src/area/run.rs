//! A network on the pictures of a press, one after another.

use std::time::{Duration, Instant};

use meissner_engine::frames::FrameOptions;
use meissner_models::systems::contact_area::ContactReport;
use meissner_run::RunError;
use meissner_run::model::FrameModel;
use meissner_run::run::ContactPredictor;

use super::pictures::Press;

/// How a network runs over the pictures of a press.
#[derive(Clone, Copy, Debug)]
pub(crate) struct PressOptions {
    /// What is skipped between pictures.
    pub(crate) options: FrameOptions,
    /// Of so many pictures the network sees the first; its answer stands for the others.
    pub(crate) every: usize,
}

/// A network with its last answer.
pub(crate) struct Run {
    pub(crate) predictor: ContactPredictor,
    every: usize,
    /// Pictures since the press began.
    pictures: usize,
    last: Option<ContactReport>,
}

/// The contact in a picture, and the time for it.
pub(crate) struct Answer {
    pub(crate) report: ContactReport,
    /// Time to take the picture.
    pub(crate) push: Duration,
    /// The same with the prediction.
    pub(crate) push_predict: Duration,
}

impl Run {
    pub(crate) fn new(model: &FrameModel, how: PressOptions) -> Result<Self, RunError> {
        let predictor = ContactPredictor::new(model, how.options)?;
        Ok(Self { predictor, every: how.every, pictures: 0, last: None })
    }

    /// Forgets all pictures, and takes the picture of the sensor at rest.
    pub(crate) fn begin(&mut self, press: &Press) {
        self.predictor.reset();
        self.predictor.set_reference(&press.reference);
        (self.pictures, self.last) = (0, None);
    }

    /// The answer to the next picture, or the last one where the network does not see it.
    pub(crate) fn measure(&mut self, rgb: &[u8]) -> Result<Answer, RunError> {
        let start = Instant::now();
        let is_seen = self.pictures.is_multiple_of(self.every);
        self.pictures += 1;
        if let Some(report) = self.last.filter(|_| !is_seen) {
            let spent = start.elapsed();
            return Ok(Answer { report, push: spent, push_predict: spent });
        }
        self.predictor.push(rgb)?;
        let push = start.elapsed();
        let report = self.predictor.predict()?;
        let push_predict = start.elapsed();
        self.last = Some(report);
        Ok(Answer { report, push, push_predict })
    }
}
