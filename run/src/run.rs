//! Runs a network over an input, passes the predictions to an observer, and returns a summary.
//!
//! | input | run |
//! |---|---|
//! | events, for a network over events | [`EventRun`] |
//! | events, for a network over frames of events | [`FrameRun`] |
//! | readings of 24 electrodes | [`ElectrodeRun`] |
//! | pictures of an optical tactile sensor | [`PictureRun`] |
//!
//! Inputs are taken as fast as they come. The timings cover making frames, pushes, clock advances
//! and predictions. They do not cover reading and the observer.
//!
//! The steps at the end of a stream depend on how it ends:
//!
//! | the stream ends with | state | due predictions | result |
//! |---|---|---|---|
//! | its last event, the limit, a signal | written | read | success |
//! | input that cannot be read, a refused line | written | read | the error |
//! | a text of which most lines are refused | not written | read | the error |
//! | an error of the engine | not written | not read | the error |
//! | an error of the observer | written | not read | the error |

mod contact;
mod electrodes;
mod events;
mod frame_predictor;
mod frames;
mod pictures;
mod prediction;
mod state;
mod stream;
mod summary;

pub use contact::ContactPredictor;
pub use electrodes::{ElectrodeOptions, ElectrodeRun};
pub use events::EventRun;
pub use frames::FrameRun;
pub use pictures::{BLUR_RADIUS, PictureOptions, PictureRun};
pub use prediction::{
    ElectrodePrediction, EventPrediction, FramePrediction, Observer, PicturePrediction, Prediction,
    ReportPrediction, ReportState,
};
pub(crate) use state::EVERY;
pub use state::{RunOptions, SaveState};
pub use stream::StreamRun;
pub use summary::{
    ElectrodeCounts, Ended, EventCounts, EventSummary, FrameSummary, InputCounts, LayerPixels, Pixels,
    Summary,
};
