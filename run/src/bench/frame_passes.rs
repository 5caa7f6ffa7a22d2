//! Passes of a frame network over events, and the part of the sensor that its frames cover.
//!
//! Input: events and their moments. Output: histograms, and the engine with its counters. The cost
//! of a frame is the time to enter its events, to make it, to push it, and to predict.

use std::ops::Range;
use std::time::{Duration, Instant};

use meissner_engine::frames::{Convolution, FrameEngine, FrameLayerCounters, FrameOptions, FrameShape, Skip};
use meissner_engine::representations::Crop;
use meissner_engine::{Admission, Event, EventCounters, LatePolicy, RestartPolicy, Sensor};
use meissner_models::FrameSource;
use meissner_models::description::frames::{CropPlace, SignedTiming};
use serde::Serialize;

use crate::error::{Result, RunError};
use crate::frame_feed::{EmptyFrameLimit, FeedOptions, FeedOutput, FrameFeed};
use crate::latency::{CallLatencies, Latency};
use crate::model::{FrameModel, LayerCost, WeightsFile};
use crate::schedule::{Every, Last, Schedule, times_before};
use crate::text::display_us;

/// The default time from frame to frame: 10 ms, as in the force networks.
const PERIOD_US: i64 = 10_000;
/// Largest number of frames in a warm-up. With a slow network, more frames would only take time.
pub(super) const WARMUP_FRAMES: u64 = 20;

/// A frame network whose frames are made of events.
pub struct EventFrameModel {
    /// The network.
    pub model: FrameModel,
    pub(super) costs: Vec<LayerCost>,
    place: CropPlace,
    /// Length of the windows, if they are consecutive.
    windows_us: Option<i64>,
    size: [u16; 2],
}

/// The part of the sensor that frames cover.
#[derive(Clone, Copy, Debug)]
pub struct Field {
    crop: Crop,
    sensor: Sensor,
}

impl EventFrameModel {
    /// As [`FrameModel::named`], for frames that are made of events.
    ///
    /// # Errors
    /// The network is unknown, its frames are not made of events, or the weights do not fit.
    pub fn named(name: &str, file: Option<WeightsFile<'_>>, ignore_preparation: bool) -> Result<Self> {
        let model = FrameModel::named(name, file, Convolution::Direct, ignore_preparation)?;
        let of_other = || frames_of_other(name, model.source);
        let (place, windows_us) = match model.source {
            FrameSource::EventCounts { place, period_us, .. }
            | FrameSource::Signed { place, timing: SignedTiming::Consecutive { period_us }, .. } => {
                (place, Some(period_us))
            }
            FrameSource::Signed { place, timing: SignedTiming::Sliding { .. }, .. } => (place, None),
            _ => return Err(of_other()),
        };
        let FrameShape::Image { height, width, .. } = model.description.input() else {
            return Err(of_other());
        };
        let costs = model.description.layers().iter().map(LayerCost::new).collect();
        // The sides in a description are small enough.
        Ok(Self { costs, place, windows_us, size: [width as u16, height as u16], model })
    }

    /// Microseconds from frame to frame: `asked` if given, else the value of the network.
    pub(super) fn period_us(&self, asked: Option<Every>) -> Result<i64> {
        match (asked, self.windows_us) {
            (None, windows_us) => Ok(windows_us.unwrap_or(PERIOD_US)),
            (Some(Every::StreamUs(asked_us)), None) => Ok(asked_us),
            (Some(Every::StreamUs(asked_us)), Some(windows_us)) if asked_us == windows_us => Ok(asked_us),
            (Some(found), windows_us) => {
                let name = self.model.network.name();
                let expected = windows_us.map_or_else(
                    || "the time from frame to frame, such as 10ms".to_owned(),
                    |us| format!("{}, the length of the windows of {name}", display_us(us)),
                );
                Err(RunError::FramePeriod { expected, found })
            }
        }
    }

    /// The rule for the events that belong to a frame at a moment.
    pub(super) fn end(&self) -> End {
        if self.windows_us.is_some() { End::Excluded } else { End::Included }
    }

    pub(super) fn field(&self, sensor: Sensor) -> Field {
        let [width, height] = self.size;
        let crop = self.place.crop(width, height, sensor);
        let around = Field { crop, sensor }.around();
        Field { crop: self.place.crop(width, height, around), sensor }
    }

    /// A feed that makes a frame over `field` every `period_us` from accepted events.
    pub(super) fn feed(&self, field: Field, period_us: i64) -> Result<FrameFeed> {
        let name = self.model.network.name();
        let options = FeedOptions {
            late: LatePolicy::Drop,
            restart: RestartPolicy::Keep,
            every: Every::StreamUs(period_us),
            silence: EmptyFrameLimit::new(Some(u64::MAX), 0),
            keeps: false,
        };
        FrameFeed::new(&self.model.description, field.around(), options, None)
            .map_err(|source| RunError::Frames { network: name.to_owned(), source })?
            .ok_or_else(|| frames_of_other(name, self.model.source))
    }

    /// Multiply-adds of the pixels that `counters` counted.
    pub(super) fn multiply_adds(&self, counters: &[FrameLayerCounters]) -> u64 {
        self.costs.iter().zip(counters).map(|(cost, counters)| cost.of(counters)).sum()
    }
}

fn frames_of_other(network: &str, source: FrameSource) -> RunError {
    let expected = "a frame network whose frames are made of events (event-counts, signed)";
    RunError::other_network(network, expected, format!("frames = {:?}", source.word()))
}

impl Field {
    /// A sensor that contains every pixel of the crop.
    fn around(self) -> Sensor {
        let side = |side: u16, first: u16, count: u16| side.max(first.saturating_add(count));
        let Crop { x, y, width, height } = self.crop;
        Sensor::new(side(self.sensor.width, x, width), side(self.sensor.height, y, height))
    }

    pub(super) fn is_padded(self) -> bool {
        self.around() != self.sensor
    }
}

impl std::fmt::Display for Field {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { crop, sensor } = *self;
        if crop == Crop::whole(sensor) {
            return write!(f, "all {}x{} pixels", crop.width, crop.height);
        }
        write!(f, "{crop}")?;
        if self.is_padded() {
            write!(f, ", zeros where the sensor of {sensor} has no pixels")?;
        }
        Ok(())
    }
}

pub(super) struct FramePasses<'a> {
    pub(super) model: &'a EventFrameModel,
    pub(super) field: Field,
    pub(super) moments: &'a PredictionTimes,
}

/// Durations of the parts of a frame, over any number of passes.
#[derive(Debug, Default, Serialize)]
#[non_exhaustive]
pub struct FrameLatencies {
    /// Entering the events, and making the frame.
    pub frame: Latency,
    /// The calls of the engine.
    #[serde(flatten)]
    pub calls: CallLatencies,
}

pub(super) struct Predicted<'a> {
    pub(super) t_us: i64,
    pub(super) values: &'a [f32],
    /// Time of all work since the first event of the frame.
    pub(super) work: Duration,
}

pub(super) struct Pass {
    pub(super) engine: FrameEngine,
    /// Accepted events that no frame covers.
    pub(super) outside: u64,
    /// Events that left a sliding window early because it was full.
    pub(super) evicted: u64,
}

/// An engine, its measurements, and the start of its next frame.
struct InProgress<'a> {
    engine: FrameEngine,
    into: &'a mut FrameLatencies,
    look: &'a mut dyn FnMut(Predicted<'_>),
    /// Number of frames that are still allowed.
    left: u64,
    since: Instant,
}

impl FramePasses<'_> {
    /// Runs a new engine over `frames` frames; `into` has latencies, `look` gets predictions.
    pub(super) fn pass(
        &self,
        skip: Skip,
        frames: u64,
        into: &mut FrameLatencies,
        look: &mut dyn FnMut(Predicted<'_>),
    ) -> Result<Pass> {
        let options = FrameOptions::new().with_skip(skip).with_sparse(true).with_two_threads(false);
        let engine = FrameEngine::with_options(self.model.model.network.clone(), options)?;
        let mut feed = self.model.feed(self.field, self.moments.period_us)?;
        let mut run = InProgress { engine, into, look, left: frames, since: Instant::now() };
        for &event in &self.moments.events {
            feed.push(event, |output| run.take(output))?;
            if run.left == 0 {
                break;
            }
        }
        feed.finish(|output| run.take(output))?;
        let (outside, evicted) = (feed.outside_crop(), feed.evicted());
        Ok(Pass { engine: run.engine, outside, evicted })
    }
}

impl InProgress<'_> {
    fn take(&mut self, output: FeedOutput<'_>) -> Result<()> {
        match output {
            FeedOutput::Frame { values, t_us, .. } => self.frame(values, t_us),
            FeedOutput::LeftOut { .. } | FeedOutput::Restart => {
                unreachable!("every frame is wanted, and the clock goes on")
            }
        }
    }

    fn frame(&mut self, values: &[f32], t_us: i64) -> Result<()> {
        if self.left == 0 {
            return Ok(());
        }
        self.left -= 1;
        let begin = Instant::now();
        self.engine.push(values)?;
        let pushed = Instant::now();
        let prediction = self.engine.predict()?;
        let end = Instant::now();
        self.into.frame.record(begin - self.since);
        self.into.calls.push.record(pushed - begin);
        self.into.calls.predict.record(end - pushed);
        self.into.calls.push_predict.record(end - begin);
        (self.look)(Predicted { t_us, values: prediction.values, work: end - self.since });
        self.since = Instant::now();
        Ok(())
    }
}

/// Largest number of moments in a benchmark. More frames would take too long.
const MAX: u64 = 1_000_000;

/// The rule for the events that belong to a moment.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum End {
    /// Events up to the moment and at it, as in a sliding window.
    Included,
    /// Events before the moment, as in consecutive windows.
    Excluded,
}

#[derive(Debug)]
pub(super) struct PredictionTimes {
    /// The accepted events, with the times at which they enter.
    pub(super) events: Vec<Event>,
    pub(super) period_us: i64,
    pub(super) counters: EventCounters,
    /// Each moment's time, and the end of its events in `events`.
    ends: Vec<(i64, usize)>,
}

#[derive(Clone, Debug)]
pub(super) struct Moment {
    /// The events since the moment before.
    pub(super) events: Range<usize>,
    pub(super) t_us: i64,
}

impl PredictionTimes {
    /// The moments of those `events` that `sensor` and `late` accept.
    pub(super) fn new(
        events: &[Event],
        (sensor, late): (Sensor, LatePolicy),
        period_us: i64,
        end: End,
    ) -> Result<Self> {
        let mut gate = Admission::new(sensor, late);
        let events: Vec<Event> = events.iter().filter_map(|&event| gate.admit(event).ok()).collect();
        let mut moments = Self { events, period_us, counters: *gate.counters(), ends: Vec::new() };
        let (Some(first), Some(last)) = (moments.events.first(), moments.events.last()) else {
            return Ok(moments);
        };
        let found = times_before(first.t_us, last.t_us, period_us).max(1);
        if found > MAX {
            return Err(RunError::ManyFrames { most: MAX, found, period_us });
        }
        let mut schedule = Schedule::new(Every::StreamUs(period_us));
        schedule.begin(first.t_us);
        for (index, event) in moments.events.iter().enumerate() {
            // A moment that is due before an event ends a window without the event.
            let t_us = match end {
                End::Included => event.t_us,
                End::Excluded => event.t_us.saturating_add(1),
            };
            moments.ends.extend(std::iter::from_fn(|| schedule.due_before(t_us)).map(|due| (due, index)));
        }
        // There is no moment beyond the end of the clock.
        let Last::At(last_us) = schedule.last() else {
            return Err(RunError::ManyFrames { most: MAX, found, period_us });
        };
        moments.ends.push((last_us, moments.events.len()));
        Ok(moments)
    }

    pub(super) fn count(&self) -> usize {
        self.ends.len()
    }

    /// Stream time from the first event to the last moment, in seconds.
    pub(super) fn stream_s(&self) -> f64 {
        self.count() as f64 * self.period_us as f64 / 1e6
    }

    pub(super) fn iter(&self) -> impl Iterator<Item = Moment> {
        let begins = std::iter::once(0).chain(self.ends.iter().map(|&(_, end)| end));
        begins.zip(&self.ends).map(|(begin, &(t_us, end))| Moment { events: begin..end, t_us })
    }
}
