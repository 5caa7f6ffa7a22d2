//! Counts of work done and avoided, outcomes of events, and the time of stages.

use std::time::{Duration, Instant};

use crate::memory::FixedVec;

/// Reason why an event did not enter the window.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
#[non_exhaustive]
pub enum DropReason {
    /// Its pixel is not on the sensor.
    OutsideSensor,
    /// It is earlier than the newest event or the last `advance`, and the policy drops such events.
    Late,
    /// The difference between its time and the epoch cannot be represented.
    TimeOutOfRange,
    /// Its time is far ahead of the events before and after it.
    Outlier,
    /// A filter that the network states dropped it ([`crate::Network::filters`]).
    Filtered,
}

names!(DropReason {
    OutsideSensor => "outside_sensor",
    Late => "late",
    TimeOutOfRange => "time_out_of_range",
    Outlier => "outlier",
    Filtered => "network_filter",
});

/// Result of pushing an event.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It entered the window.
    Accepted,
    /// It did not enter.
    Dropped(DropReason),
    /// Its time disagrees with the clock; later events decide whether it enters
    /// ([`crate::RestartPolicy`]).
    Held,
}

/// Counts of events since the engine was created.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct EventCounters {
    /// Events pushed, without those that are still [held](crate::Outcome::Held).
    pub pushed: u64,
    /// Events that entered the window.
    pub accepted: u64,
    /// Dropped: not on the sensor.
    pub outside_sensor: u64,
    /// Dropped: late.
    pub late: u64,
    /// Dropped: time out of range.
    pub time_out_of_range: u64,
    /// Dropped: a single time far ahead.
    pub outliers: u64,
    /// Dropped: by a filter that the network states.
    pub filtered: u64,
    /// Late events that were accepted with the newest time, under the clamping policy.
    pub clamped: u64,
    /// Events that left because they were older than the span.
    pub expired: u64,
    /// Events that left earlier because the window was full.
    pub evicted: u64,
    /// Number of restarts of the sensor's clock, each of which reset the engine.
    pub restarts: u64,
}

impl EventCounters {
    /// Number of reasons in [`Self::dropped`].
    pub const DROP_REASONS: usize = 5;

    /// Dropped events by reason.
    pub fn dropped(&self) -> [(DropReason, u64); Self::DROP_REASONS] {
        [
            (DropReason::OutsideSensor, self.outside_sensor),
            (DropReason::Late, self.late),
            (DropReason::TimeOutOfRange, self.time_out_of_range),
            (DropReason::Outlier, self.outliers),
            (DropReason::Filtered, self.filtered),
        ]
    }
}

/// Counts of one layer since the engine was made. A layer is a block or a pooling.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct LayerCounters {
    /// Rows computed.
    pub recomputed: u64,
    /// Computed rows whose bits did not change; propagation stopped there.
    pub unchanged: u64,
    /// Computed rows that changed by no more than [`crate::Options::tolerance`], and kept their
    /// values.
    pub within_tolerance: u64,
    /// Rows of the window that a prediction used without recomputing them.
    pub kept: u64,
}

/// Counts of predictions since the engine was made.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct PredictionCounters {
    /// Predictions read.
    pub read: u64,
    /// Predictions for which no value of the readout had changed.
    pub reused: u64,
    /// Readout cells recomputed.
    pub cells_recomputed: u64,
    /// Recomputed readout cells whose values did not change.
    pub cells_unchanged: u64,
    /// Pooled neighbourhoods checked because an edge or a position near them changed.
    pub neighbourhoods_checked: u64,
    /// Checked neighbourhoods whose edges and attributes did not change.
    pub neighbourhoods_unchanged: u64,
}

/// A row that was computed.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct ComputedRow {
    /// Its index, as in [`crate::Engine::feature`].
    pub row: usize,
    /// Whether its values changed. If not, nothing was recomputed because of it.
    pub changed: bool,
}

#[derive(Clone, Debug, Default)]
pub(crate) struct LayerLog {
    pub(crate) counters: LayerCounters,
    /// Slots of the rows computed since the last prediction, and whether each changed, if they are
    /// recorded; at most as many as the capacity.
    pub(crate) rows: Option<FixedVec<(u32, bool)>>,
}

impl LayerLog {
    #[inline]
    pub(crate) fn note(&mut self, row: u32, unchanged: bool) {
        self.counters.recomputed += 1;
        self.counters.unchanged += u64::from(unchanged);
        if let Some(rows) = &mut self.rows
            && rows.len() < rows.capacity()
        {
            rows.push((row, !unchanged));
        }
    }
}

/// Counters that the stages update while they run.
#[derive(Clone, Debug, Default)]
pub(crate) struct Log {
    pub(crate) layers: Vec<LayerLog>,
    pub(crate) predictions: PredictionCounters,
}

/// All counters. A `reset` keeps them.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Counters {
    /// Events.
    pub events: EventCounters,
    /// Layers, in the order of [`crate::Network::layers`].
    pub layers: Vec<LayerCounters>,
    /// Predictions.
    pub predictions: PredictionCounters,
}

impl Counters {
    /// Counts since `earlier`, an earlier state of the same engine's counters.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        let layers = self.layers.iter().zip(&earlier.layers);
        Self {
            events: self.events.since(earlier.events),
            layers: layers.map(|(now, earlier)| now.since(*earlier)).collect(),
            predictions: self.predictions.since(earlier.predictions),
        }
    }
}

/// Pixels of a frame network's layer so far; a layer over vectors counts as one pixel.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FrameLayerCounters {
    /// Computed.
    pub computed: u64,
    /// Kept, because nothing in their receptive field had changed.
    pub skipped: u64,
    /// Taken from the layer's output for a frame of zeros, because only zeros reached them.
    pub absorbed: u64,
}

/// Counts since a frame engine was made.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FrameCounters {
    /// Frames pushed.
    pub frames: u64,
    /// Predictions read.
    pub predictions: u64,
    /// Each layer's pixels.
    pub layers: Vec<FrameLayerCounters>,
}

impl FrameCounters {
    /// Counts since `earlier`, an earlier state of the same engine's counters.
    #[must_use]
    pub fn since(&self, earlier: &Self) -> Self {
        let layers = self.layers.iter().zip(&earlier.layers);
        Self {
            frames: self.frames.saturating_sub(earlier.frames),
            predictions: self.predictions.saturating_sub(earlier.predictions),
            layers: layers.map(|(now, earlier)| now.since(*earlier)).collect(),
        }
    }
}

/// Counters to an array in the order of the fields, and back; the difference to an earlier state.
macro_rules! counts {
    ($name:ident { $($field:ident),* }) => {
        impl $name {
            pub(crate) fn to_array(self) -> [u64; [$(stringify!($field)),*].len()] {
                [$(self.$field),*]
            }

            pub(crate) fn from_array([$($field),*]: [u64; [$(stringify!($field)),*].len()]) -> Self {
                Self { $($field),* }
            }

            /// Counts since `earlier`, an earlier state of the same counters.
            #[must_use]
            pub fn since(self, earlier: Self) -> Self {
                Self { $($field: self.$field.saturating_sub(earlier.$field)),* }
            }
        }
    };
}

counts!(EventCounters {
    pushed,
    accepted,
    outside_sensor,
    late,
    time_out_of_range,
    outliers,
    clamped,
    expired,
    evicted,
    restarts,
    filtered
});
counts!(LayerCounters { recomputed, unchanged, within_tolerance, kept });
counts!(PredictionCounters {
    read,
    reused,
    cells_recomputed,
    cells_unchanged,
    neighbourhoods_checked,
    neighbourhoods_unchanged
});
counts!(FrameLayerCounters { computed, skipped, absorbed });

/// A stage of the engine, in execution order.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Stage {
    /// Event graph: searches, neighbourhoods, reverse lists.
    EventGraph,
    /// Structure of the pooled levels and of the readout: members, merged edges.
    PooledGraphs,
    /// Blocks of the event level.
    EventLayers,
    /// Maxima of the poolings.
    PooledMaxima,
    /// Positions and edge attributes of the pooled levels.
    PooledAttributes,
    /// Blocks above the event level.
    PooledLayers,
    /// Maxima or sums of the readout.
    Readout,
    /// Dense layers.
    Dense,
}

impl Stage {
    /// All stages, in order.
    pub const ALL: [Self; 8] = [
        Self::EventGraph,
        Self::PooledGraphs,
        Self::EventLayers,
        Self::PooledMaxima,
        Self::PooledAttributes,
        Self::PooledLayers,
        Self::Readout,
        Self::Dense,
    ];
}

names!(Stage {
    EventGraph => "event graph",
    PooledGraphs => "pooled graphs",
    EventLayers => "event layers",
    PooledMaxima => "pooled maxima",
    PooledAttributes => "pooled attributes",
    PooledLayers => "pooled layers",
    Readout => "readout",
    Dense => "dense",
});

/// Sums the time of each stage; does nothing unless enabled.
#[derive(Clone, Debug)]
pub(crate) struct Stopwatch {
    began: Option<Instant>,
    enabled: bool,
    times: [Duration; Stage::ALL.len()],
}

impl Stopwatch {
    pub(crate) fn new(enabled: bool) -> Self {
        Self { began: None, enabled, times: Default::default() }
    }

    #[inline]
    pub(crate) fn start(&mut self) {
        if self.enabled {
            self.began = Some(Instant::now());
        }
    }

    /// Ends `stage` and starts the next.
    #[inline]
    pub(crate) fn lap(&mut self, stage: Stage) {
        if let Some(began) = self.began {
            let now = Instant::now();
            self.times[stage as usize] += now - began;
            self.began = Some(now);
        }
    }

    pub(crate) fn times(&self) -> [(Stage, Duration); Stage::ALL.len()] {
        Stage::ALL.map(|stage| (stage, self.times[stage as usize]))
    }
}
