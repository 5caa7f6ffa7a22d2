//! Benchmarks: latency of events and frames, its distribution over phases, and the time of each
//! stage.
//!
//! | benchmark | measures |
//! |---|---|
//! | [`EventBench`] | a network over events: latencies by phase, work, stages, deadlines |
//! | [`bench_frames`] | a frame network over events: latencies with skipping and without, deadlines |
//! | [`compare`] | a network over events against a frame network, over the same stream |
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

pub use compare::{CompareReport, Ratios, SideReport, SidesReport, compare};
pub use deadline::{DeadlineBin, DeadlineReport, Sustained};
pub use events::{
    EventBench, EventReport, LayerWork, MemoryReport, PhaseReport, PhasesReport, SlicesReport, StageReport,
    Work,
};
pub use frame_passes::{EventFrameModel, Field, FrameLatencies};
pub use frames::{FrameModeReport, FrameReport, PixelReport, bench_frames};
pub use input::{BenchInput, BenchOptions, FrameInputReport, InputReport, Part};
