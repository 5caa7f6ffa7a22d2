//! Benchmarks: latency of events and frames, its distribution over phases, and the time of each stage.
//!
//! | benchmark | measures |
//! |---|---|
//! | [`EventBench`] | a network over events: latencies by phase, work, stages, deadlines |
//! | [`FrameBench`] | a frame network over events: latencies with skipping and without, deadlines |
//! | [`Comparison`] | a network over events against a frame network, over the same stream |
//!
//! All events are read before the first pass. Every pass begins with a new engine.

mod compare;
mod deadline;
mod events;
mod frame_passes;
mod frames;
mod input;
mod moments;
mod phases;

pub use compare::{CompareReport, Comparison, Ratios, SideReport, SidesReport};
pub use deadline::{DeadlineBin, DeadlineReport, Sustained};
pub use events::{
    EventBench, EventReport, LatencyReport, LayerWork, Measured, MemoryReport, PhaseLatencies, PhaseReport,
    PhasesReport, StageReport, Work, whole,
};
pub use frame_passes::{EventFrameModel, Field};
pub use frames::{FrameBench, FrameLatencyReport, FrameModeReport, FrameReport, PixelReport};
pub use input::{BenchInput, BenchOptions, FrameInputReport, InputReport, Part};
