//! A network over events: the event graph, levels of blocks joined by poolings, a readout, dense
//! layers. Shapes are checked once, here.
//!
//! Feature 0 of a level is its input (polarity, or pooled maxima); feature b + 1 the output of its
//! block b. A block reads any earlier feature: a level is an acyclic graph in topological order.

mod check;
pub(crate) mod parts;

use std::sync::OnceLock;

use crate::error::in_range;
use crate::filters::{self, FilterRule};
use crate::fingerprint::{Fingerprint, activation_code};
use crate::unlikeness::{TrainingWindows, WindowStatistics};
use crate::{EngineError, Sensor};

pub use parts::{
    Aggregation, Block, Candidates, DenseLayer, Fraction, GraphRule, Level, Lifetime, NetworkParts,
    Normalisation, Pooling, Position, Reach, Readout,
};

const _: () = assert!(Network::MAX_SPAN_US == filters::MAX_US, "descriptions have one range of times");

/// Parts of time that a sum over the span has.
pub(crate) const SUM_PARTS: i64 = 8;

/// A checked, immutable network; engines share it by `Arc`.
#[derive(Clone, Debug)]
pub struct Network {
    parts: NetworkParts,
    channels: Vec<Vec<usize>>,
    filters: Vec<FilterRule>,
    training_windows: Option<TrainingWindows>,
    fingerprint: OnceLock<u64>,
}

impl Network {
    /// Longest span, about 12 days: (time difference / span)^2 then stays far from f64's limits.
    pub const MAX_SPAN_US: i64 = check::MAX_SPAN_US;
    /// Largest capacity of a window, in events.
    pub const MAX_CAPACITY: usize = check::MAX_CAPACITY;
    /// Largest number of in-edges of a node.
    pub const MAX_NEIGHBOURS: usize = check::MAX_NEIGHBOURS;
    /// Largest number of cells of a pooling.
    pub const MAX_CELLS: usize = check::MAX_CELLS;

    /// Checks that `parts` fit together.
    ///
    /// # Errors
    /// [`EngineError::Option`] for a graph, span or capacity out of range; [`EngineError::Network`]
    /// for a layer whose input does not exist or has other channels.
    pub fn new(parts: NetworkParts) -> Result<Self, EngineError> {
        let channels = check::channels(&parts)?;
        let (filters, fingerprint) = (Vec::new(), OnceLock::new());
        Ok(Self { parts, channels, filters, training_windows: None, fingerprint })
    }

    /// The same network behind the filters of `rules`, the first of which sees every event. Engines
    /// apply them; they do not apply to a window that is given as a whole.
    ///
    /// # Errors
    /// As [`FilterRule::filter`] on any sensor.
    pub fn with_filters(self, rules: impl Into<Vec<FilterRule>>) -> Result<Self, EngineError> {
        let filters = rules.into();
        filters.iter().try_for_each(|rule| rule.filter(Sensor::new(0, 0)).map(drop))?;
        Ok(Self { filters, fingerprint: OnceLock::new(), ..self })
    }

    /// The filters that the network needs before it.
    pub fn filters(&self) -> &[FilterRule] {
        &self.filters
    }

    /// The same network with statistics of the windows of its training. Predictions then tell how
    /// unlike their window is; their values do not change.
    #[must_use]
    pub fn with_training_windows(self, windows: impl Into<Option<TrainingWindows>>) -> Self {
        Self { training_windows: windows.into(), ..self }
    }

    /// Statistics of the windows of its training, if known.
    pub fn training_windows(&self) -> Option<&TrainingWindows> {
        self.training_windows.as_ref()
    }

    /// How unlike a window of `sensor` with these `statistics` is to those of the training, if they
    /// are known; the statistics are computed only then.
    pub(crate) fn unlikeness(
        &self,
        sensor: Sensor,
        statistics: impl FnOnce() -> WindowStatistics,
    ) -> Option<f32> {
        let windows = self.training_windows()?;
        Some(windows.unlikeness(statistics().features(sensor, self.parts.span_us)))
    }

    /// The parts of the network.
    pub fn parts(&self) -> &NetworkParts {
        &self.parts
    }

    /// Name, shown in reports.
    pub fn name(&self) -> &str {
        &self.parts.name
    }

    /// Hash of structure, names, filters and the bits of all parameters as used. Different networks
    /// collide only by chance; deliberate collisions are not resisted. O(parameters) on the first
    /// call.
    pub fn fingerprint(&self) -> u64 {
        *self.fingerprint.get_or_init(|| fingerprint_of(&self.parts, &self.filters))
    }

    /// Number of values in a prediction.
    pub fn outputs(&self) -> usize {
        let head = self.parts.head.as_ref().map(|head| head.output().values());
        head.or(self.parts.dense.last().map(|layer| layer.dense.outputs())).unwrap_or(0)
    }

    /// Number of levels: the event level and one per pooling.
    pub fn levels(&self) -> usize {
        self.channels.len()
    }

    /// Level `level`: 0 is the event level.
    ///
    /// # Panics
    /// If there is no such level.
    pub fn level(&self, level: usize) -> &Level {
        if level == 0 { &self.parts.events } else { &self.parts.pooled[level - 1].1 }
    }

    /// Number of [`Self::layers`] that belong to level `level`: its blocks, and its pooling.
    ///
    /// # Panics
    /// If there is no such level.
    pub fn layers_of(&self, level: usize) -> usize {
        self.level(level).blocks.len() + usize::from(level > 0)
    }

    /// Channels of each feature of level `level`.
    ///
    /// # Panics
    /// If there is no such level.
    pub fn channels(&self, level: usize) -> &[usize] {
        &self.channels[level]
    }

    /// Number of channels of the readout.
    pub fn readout_channels(&self) -> usize {
        self.channels[self.channels.len() - 1][self.parts.readout.from]
    }

    /// Copies of the readout's grid: one, or one for each time cell of a window.
    pub fn readout_times(&self) -> usize {
        self.readout_time().map_or(1, check::times)
    }

    /// Length of a part of a sum in microseconds: an eighth of the span, rounded up. The readout
    /// sums the events of each part from the epoch in order of arrival, then the parts in order.
    pub fn sum_part_us(&self) -> i64 {
        self.parts.span_us / SUM_PARTS + i64::from(self.parts.span_us % SUM_PARTS > 0)
    }

    /// Length of the readout's time cells as a fraction of the span, if the readout separates them.
    pub(crate) fn readout_time(&self) -> Option<Fraction> {
        let last = self.parts.pooled.last();
        last.and_then(|(pooling, _)| pooling.time).filter(|_| self.parts.readout.by_time)
    }

    /// Names of layers that compute rows: the blocks of level 0, then each pooling with its blocks.
    pub fn layers(&self) -> Vec<&str> {
        let mut names: Vec<&str> = self.parts.events.blocks.iter().map(|b| b.name.as_str()).collect();
        for (pooling, level) in &self.parts.pooled {
            names.push(&pooling.name);
            names.extend(level.blocks.iter().map(|b| b.name.as_str()));
        }
        names
    }
}

/// Variants of a network: a coarser graph, a shorter window. Each is checked again. Their
/// predictions differ; only a measurement shows by how much.
impl Network {
    /// The same network with a different span.
    ///
    /// # Errors
    /// [`EngineError::Option`] if the span is out of range.
    pub fn with_span_us(self, span_us: i64) -> Result<Self, EngineError> {
        self.changed(|parts| parts.span_us = span_us)
    }

    /// The same network with a window of at most `capacity` events.
    ///
    /// # Errors
    /// [`EngineError::Option`] if the capacity is out of range.
    pub fn with_capacity(self, capacity: usize) -> Result<Self, EngineError> {
        self.changed(|parts| parts.capacity = capacity)
    }

    /// The same network with the first `most` neighbours of each node of the event graph.
    ///
    /// # Errors
    /// [`EngineError::Option`] for 0, and for more neighbours than the network was trained with.
    pub fn with_neighbours(self, most: usize) -> Result<Self, EngineError> {
        in_range("neighbours of a node", most as i64, 1, self.parts().graph.reach.most() as i64)?;
        self.changed(|parts| {
            let (Reach::Knn { k: old } | Reach::Radius { max: old, .. }) = &mut parts.graph.reach;
            *old = most;
        })
    }

    fn changed(self, change: impl FnOnce(&mut NetworkParts)) -> Result<Self, EngineError> {
        let Self { mut parts, filters, training_windows, .. } = self;
        change(&mut parts);
        Self::new(parts)?.with_training_windows(training_windows).with_filters(filters)
    }
}

fn fingerprint_of(parts: &NetworkParts, filters: &[FilterRule]) -> u64 {
    let mut to = Fingerprint::new();
    to.text(&parts.name);
    to.word(parts.span_us as u64);
    to.size(parts.capacity);
    match parts.graph.reach {
        Reach::Knn { k } => [0, k as u64, 0],
        Reach::Radius { r, max } => [1, max as u64, r.to_bits()],
    }
    .into_iter()
    .for_each(|word| to.word(word));
    to.word(match parts.graph.candidates {
        Candidates::All => 0,
        Candidates::Past(Lifetime::Window) => 1,
        Candidates::Past(Lifetime::Frozen) => 2,
    });
    to.word(match parts.normalisation {
        Normalisation::Fixed => 0,
        Normalisation::PerGraph => 1,
    });
    add_level(&mut to, &parts.events);
    to.size(parts.pooled.len());
    for (above, blocks) in &parts.pooled {
        add_pooling(&mut to, above);
        add_level(&mut to, blocks);
    }
    let Readout { from, columns, rows, aggregation, by_time } = parts.readout;
    to.sizes([from, columns, rows, by_time.into()]);
    if aggregation == Aggregation::Sum {
        to.text("sum");
    }
    to.size(parts.dense.len());
    for DenseLayer { name, dense } in &parts.dense {
        to.text(name);
        to.sizes([dense.inputs(), dense.channels(), activation_code(dense.activation())]);
        to.values(&dense.weight());
        to.values(dense.bias());
    }
    to.word(parts.head.is_some().into());
    if let Some(head) = &parts.head {
        to.word(head.fingerprint());
    }
    if let Some(cell) = parts.place {
        cell.into_iter().for_each(|size| to.word(fraction(size)));
    }
    filters.iter().for_each(|rule| rule.fingerprint(&mut to));
    to.finish()
}

fn fraction(size: Fraction) -> u64 {
    u64::from(size.numerator()) << 32 | u64::from(size.denominator())
}

fn add_level(to: &mut Fingerprint, level: &Level) {
    to.word(level.scale.to_bits().into());
    to.size(level.blocks.len());
    for Block { name, input, skip, conv } in &level.blocks {
        to.text(name);
        to.size(*input);
        to.size(skip.map_or(0, |skip| skip + 1));
        conv.fingerprint(to);
    }
}

fn add_pooling(to: &mut Fingerprint, pooling: &Pooling) {
    to.text(&pooling.name);
    to.size(pooling.from);
    let [x, y] = pooling.cell;
    for size in [Some(x), Some(y), pooling.time] {
        to.word(size.map_or(0, fraction));
    }
    to.word(match pooling.position {
        Position::Mean => 0,
        Position::Centre => 1,
    });
}
