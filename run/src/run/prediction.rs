//! The predictions of a run, and the observer that takes them.

use std::io;

use meissner_engine::Event;
use meissner_models::systems::contact_area::{ContactReport, DifferenceReport};
use serde::Serialize;

use crate::answer::{Answer, Values};

/// Takes the predictions of a run as they are read.
pub trait Observer {
    /// Takes a prediction.
    ///
    /// # Errors
    /// The prediction cannot be shown; the run ends with
    /// [`RunError::Output`](crate::RunError::Output).
    fn prediction(&mut self, prediction: &Prediction<'_>) -> io::Result<()>;

    /// Reports the number of events taken so far.
    fn progress(&mut self, _taken: u64) {}

    /// Takes an event of the input of this number, before the predictions that become due with it.
    fn event(&mut self, _input: usize, _event: Event) {}

    /// Whether the observer uses events: collecting the events of a play has a cost.
    fn takes_events(&self) -> bool {
        false
    }
}

/// A prediction, serialised in the form of the program's JSON lines.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(untagged)]
#[non_exhaustive]
pub enum Prediction<'a> {
    /// A prediction of a network over events.
    Events(EventPrediction<'a>),
    /// A prediction of a network over frames of events.
    Frames(FramePrediction<'a>),
    /// A prediction of a network over electrodes.
    Electrodes(ElectrodePrediction<'a>),
    /// A prediction of a network over pictures.
    Picture(PicturePrediction<'a>),
    /// A report of a recording at real speed, see [`crate::play`].
    Report(ReportPrediction<'a>),
}

/// A prediction of a network over events.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct EventPrediction<'a> {
    /// Time of the newest event that it covers; `None` before the first.
    pub t_us: Option<i64>,
    pub value: Values<'a>,
    /// Class and probabilities, if the values are logits of classes.
    #[serde(flatten)]
    pub answer: Option<Answer<'a>>,
    /// Names of the values outside the range of the training.
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    pub outside_training: &'a [String],
    /// How unlike the window is to those of the training: above 1, fewer than 1 of 1,000 of these
    /// were. `None` if the weights contain no statistics of the training.
    pub unlike: Option<f32>,
    /// Events in the window.
    pub nodes: usize,
    /// Rows computed for each layer since the last prediction.
    pub rows: &'a [u64],
    /// Microseconds spent in pushes and predictions since the last prediction.
    pub update_us: f64,
    /// Time of the prediction: its due time, or that of the newest event.
    #[serde(skip)]
    pub at_us: Option<i64>,
    /// Stream time since the first event in microseconds; `None` before it.
    #[serde(skip)]
    pub elapsed_us: Option<i128>,
    /// Events taken so far.
    #[serde(skip)]
    pub taken: u64,
}

/// A prediction of a network over frames of events.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct FramePrediction<'a> {
    /// End of the window of the newest frame.
    pub t_us: i64,
    pub value: Values<'a>,
    /// Class and probabilities, if the values are logits of classes.
    #[serde(flatten)]
    pub answer: Option<Answer<'a>>,
    /// Names of the values outside the range of the training.
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    pub outside_training: &'a [String],
    /// How unlike the newest frames are to those of the training, as in
    /// [`EventPrediction::unlike`].
    pub unlike: Option<f32>,
    /// Frames that the state has seen.
    pub frames: u64,
    /// Events in the newest frame.
    pub events: u64,
    /// Microseconds spent in making frames and in the network since the last prediction.
    pub update_us: f64,
    /// Stream time since the first event in microseconds.
    #[serde(skip)]
    pub elapsed_us: i128,
    /// Events taken so far.
    #[serde(skip)]
    pub taken: u64,
}

/// A prediction of a network over electrodes, for a window of readings.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct ElectrodePrediction<'a> {
    /// Line of the newest reading.
    pub line: u64,
    /// Time of the newest reading; `None` without a column of time.
    pub time_s: Option<f64>,
    pub value: Values<'a>,
    /// Softmax of the values; `None` if they are not logits of classes.
    pub probabilities: Option<Values<'a>>,
    /// Name of the most probable class.
    pub class: Option<&'a str>,
    /// Name of the decided class; `None` before the first decision.
    pub decision: Option<&'a str>,
    /// Windows for which the decision has been held, from 1.
    pub held: Option<u64>,
    /// Names of the values outside the range of the training.
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    pub outside_training: &'a [String],
    /// How unlike the newest reading is to those of the training, as in
    /// [`EventPrediction::unlike`].
    pub unlike: Option<f32>,
    /// Microseconds spent since the last prediction.
    pub update_us: f64,
}

/// The contact in a picture.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct PicturePrediction<'a> {
    /// Path of the picture, if it is a file.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub image: Option<&'a str>,
    /// Number of the picture in a video, from 0; late pictures count.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub picture: Option<u64>,
    #[serde(flatten)]
    pub contact: ContactReport,
    /// How unlike the picture is to those of the training, as in [`EventPrediction::unlike`].
    pub unlike: Option<f32>,
    /// The contact by plain differences to a reference picture, if there is one.
    pub baseline: Option<DifferenceReport>,
    /// Path of the overlay, if one is drawn.
    pub overlay: Option<&'a str>,
    /// Microseconds spent since the last prediction.
    pub update_us: f64,
    /// Microseconds from the arrival of the picture's last byte on a stream to its prediction.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub since_arrival_us: Option<f64>,
    /// Pictures taken so far.
    #[serde(skip)]
    pub taken: u64,
}

/// A report of a recording that is played at real speed.
#[derive(Clone, Copy, Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct ReportPrediction<'a> {
    /// Index of its input, counted from 0.
    pub input: usize,
    /// Due time of the report, in stream time.
    pub at_us: i64,
    /// Time of the newest event that it covers; `None` before the first.
    pub t_us: Option<i64>,
    pub value: Values<'a>,
    /// Class and probabilities, if the values are logits of classes.
    #[serde(flatten)]
    pub answer: Option<Answer<'a>>,
    /// Names of the values outside the range of the training.
    #[serde(skip_serializing_if = "<[String]>::is_empty")]
    pub outside_training: &'a [String],
    /// How unlike the window is to those of the training, as in [`EventPrediction::unlike`].
    pub unlike: Option<f32>,
    /// Events in the window.
    pub nodes: usize,
    /// How current the prediction of the report is.
    pub state: ReportState,
    /// Events that had entered the queue and are not covered.
    pub behind_events: u64,
    /// Stream time that had entered the queue and is not covered.
    pub behind_us: u64,
    /// Events since the previous report that the engine dropped or holds.
    pub lost_events: u64,
    /// Events since the previous report that the queue dropped.
    pub dropped_events: u64,
    /// Restarts of the sensor's clock since the previous report.
    pub restarts: u64,
    /// Time since the start of the prediction.
    pub age_us: f64,
    /// Time since the report was requested.
    pub waited_us: f64,
    /// Number of the report, from 1.
    #[serde(skip)]
    pub number: u64,
    /// Stream time from the first event to the due time of the report, in microseconds.
    #[serde(skip)]
    pub elapsed_us: i128,
}

/// How current the prediction of a report is.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "lowercase")]
pub enum ReportState {
    /// It covers all events that had entered the queue.
    Fresh,
    /// It covers the events taken shortly before the deadline, or the engine lost some.
    Behind,
    /// It is the prediction of an earlier report.
    Old,
}

impl ReportState {
    /// A short name.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fresh => "fresh",
            Self::Behind => "behind",
            Self::Old => "old",
        }
    }
}
