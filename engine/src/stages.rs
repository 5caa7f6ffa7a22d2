//! Optional timing of an engine's stages.

use std::fmt;
use std::time::{Duration, Instant};

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

    /// Name for reports.
    pub fn name(self) -> &'static str {
        match self {
            Self::EventGraph => "event graph",
            Self::PooledGraphs => "pooled graphs",
            Self::EventLayers => "event layers",
            Self::PooledMaxima => "pooled maxima",
            Self::PooledAttributes => "pooled attributes",
            Self::PooledLayers => "pooled layers",
            Self::Readout => "readout",
            Self::Dense => "dense",
        }
    }
}

impl fmt::Display for Stage {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

/// Sums the time of each stage; does nothing unless enabled.
#[derive(Clone, Debug)]
pub(crate) struct Stopwatch {
    /// Start of the current stage.
    began: Option<Instant>,
    enabled: bool,
    times: [Duration; Stage::ALL.len()],
}

impl Stopwatch {
    pub(crate) fn new(enabled: bool) -> Self {
        Self { began: None, enabled, times: Default::default() }
    }

    /// Starts the first stage.
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
