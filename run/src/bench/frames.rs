//! A benchmark of a frame network over events: the latency of a frame, with and without skipping.

use meissner_engine::frames::{FrameEngine, Skip};
use serde::Serialize;

use super::deadline::{Deadline, DeadlineReport};
use super::frame_passes::{EventFrameModel, FrameLatencies, FramePasses, PredictionTimes, WARMUP_FRAMES};
use super::{BenchInput, BenchOptions, FrameInputReport, InputReport};
use crate::error::{Result, RunError};
use crate::latency::clock_us;
use crate::losses::InputLosses;
use crate::memory::peak_resident_bytes;

/// The report of a frame network. Counts are of one pass, except in distributions.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct FrameReport {
    #[serde(flatten)]
    pub input: InputReport,
    #[serde(flatten)]
    pub made: FrameInputReport,
    pub warmup_frames: u64,
    /// Overhead of the clock, which is included in every push and prediction.
    pub clock_us: f64,
    /// Events that left a sliding window early because it was full.
    pub evicted: u64,
    pub frames: u64,
    /// Passes with skipping: pixels whose inputs do not change keep their values.
    pub skipping: FrameModeReport,
    /// Passes in which everything is computed.
    pub everything: FrameModeReport,
    /// Peak resident memory of the process; `None` if the platform does not report it.
    pub peak_resident_bytes: Option<u64>,
    /// Deadlines of the first pass with skipping.
    pub deadline: DeadlineReport,
}

/// Measures the frame network `model` over `input`.
///
/// # Errors
/// The period differs from that of the frames, there are too many frames, or the engine refuses an
/// option.
pub fn bench_frames(
    model: &EventFrameModel,
    input: &BenchInput,
    options: &BenchOptions,
) -> Result<FrameReport> {
    let (period_us, repeat) = (model.period_us(options.every)?, options.repeat.max(1));
    let moments = PredictionTimes::new(&input.events, (input.sensor, options.late), period_us, model.end())?;
    let field = model.field(input.sensor);
    let passes = FramePasses { model, field, moments: &moments };

    let clock_us = clock_us();
    let warmup = if options.warmup == 0 { 0 } else { WARMUP_FRAMES };
    let mut works = Deadline::new(period_us);
    let [skipping, everything] = [Skip::Exact, Skip::Nothing].map(|skip| {
        let mut times = FrameLatencies::default();
        let mut last = passes.pass(skip, warmup, &mut FrameLatencies::default(), &mut |_| ())?;
        for pass in 0..repeat {
            let mut entered = moments.iter().map(|moment| moment.events.len() as u64);
            let is_judged = pass == 0 && skip == Skip::Exact;
            last = passes.pass(skip, u64::MAX, &mut times, &mut |predicted| {
                if is_judged {
                    works.record(entered.next().unwrap_or(0), predicted.t_us, predicted.work);
                }
            })?;
        }
        let way = FrameModeReport::new(model, &last.engine, times, repeat);
        Ok::<_, RunError>((way, last))
    });
    let ((skipping, last), (everything, _)) = (skipping?, everything?);

    let losses = InputLosses { outside_crop: last.outside, ..input.losses(moments.counters) };
    Ok(FrameReport {
        made: FrameInputReport::new(input, model, field, &moments, last.outside),
        input: input.report(&moments.counters, &losses, repeat),
        warmup_frames: warmup.min(moments.count() as u64),
        clock_us,
        evicted: last.evicted,
        frames: moments.count() as u64,
        skipping,
        everything,
        peak_resident_bytes: peak_resident_bytes(),
        deadline: works.report(),
    })
}

/// Passes with skipping, or passes without.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct FrameModeReport {
    /// Times of a frame.
    pub latency_us: FrameLatencies,
    /// Seconds of compute for the whole stream, as the mean over the passes.
    pub compute_s: f64,
    /// Frames divided by that time.
    pub frames_per_s: Option<f64>,
    pub layers: Vec<PixelReport>,
    /// Multiply-adds of one pass.
    pub multiply_adds: u64,
    /// Multiply-adds divided by the compute time.
    pub multiply_adds_per_s: Option<f64>,
    pub state_bytes: u64,
}

/// Pixels of a layer; a layer over vectors has one.
#[derive(Debug, Serialize)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct PixelReport {
    pub name: String,
    /// Pixels of all frames.
    pub pixels: u64,
    /// Of these, computed: in blocks, so that some skipped or absorbed pixels are computed too.
    pub computed: u64,
    /// Kept because their inputs had not changed.
    pub skipped: u64,
    /// Taken from the layer's output over zeros.
    pub absorbed: u64,
    pub multiply_adds: u64,
}

impl FrameModeReport {
    /// The report of `passes` passes. The counters are those of `engine`, from the last pass.
    fn new(model: &EventFrameModel, engine: &FrameEngine, latency_us: FrameLatencies, passes: u32) -> Self {
        let counters = engine.counters();
        let compute = latency_us.frame.total() + latency_us.calls.push_predict.total();
        let compute_s = compute.as_secs_f64() / f64::from(passes);
        let over = |amount: u64| (compute_s > 0.0).then(|| amount as f64 / compute_s);
        let layers = model.costs.iter().zip(&counters.layers).map(|(cost, layer)| PixelReport {
            name: cost.name.clone(),
            pixels: cost.pixels * counters.frames,
            computed: layer.computed,
            skipped: layer.skipped,
            absorbed: layer.absorbed,
            multiply_adds: cost.of(layer),
        });
        let multiply_adds = model.multiply_adds(&counters.layers);
        Self {
            latency_us,
            compute_s,
            frames_per_s: over(counters.frames),
            layers: layers.collect(),
            multiply_adds,
            multiply_adds_per_s: over(multiply_adds),
            state_bytes: engine.state_bytes() as u64,
        }
    }
}
