//! The settings of a network: which approximations, alone and together, and their names.
//!
//! Input: a network, and the mean rate of its events. Output: every setting that changes the
//! network, after the exact one. Each study of frames adds those of its frames.

use meissner_engine::frames::{
    Convolution, FrameLayer, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameOptions, Skip,
};
use meissner_engine::{Event, Network};
use meissner_kernels::WinogradTile;
use meissner_run::approximations::Approximations;

use crate::error::Result;
use crate::pareto::measurement::EXACT;

#[derive(Clone, Debug)]
pub(super) struct Setting {
    pub(super) name: String,
    /// Its approximations, without the span.
    pub(super) approximations: Approximations,
    /// Share of the network's span.
    span: Option<(i64, i64)>,
}

#[derive(Clone, Copy, Debug)]
enum Change {
    Tolerance(f32),
    Neighbours(u8),
    /// A share of the network's span.
    Span(i64, i64),
    Stride(u32),
    /// A share of the mean rate of the data.
    Rate(u64, u64),
    /// Microseconds.
    Activity(i64),
    /// Milliseconds.
    Stale(i64),
}

use Change::{Activity, Neighbours, Rate, Span, Stale, Stride, Tolerance};

/// All settings; those that do not fit a network are left out.
const SETTINGS: &[&[Change]] = &[
    &[],
    &[Tolerance(1e-3)],
    &[Tolerance(1e-2)],
    &[Tolerance(3e-2)],
    &[Tolerance(1e-1)],
    &[Neighbours(12)],
    &[Neighbours(8)],
    &[Neighbours(6)],
    &[Neighbours(4)],
    &[Neighbours(2)],
    &[Span(2, 3)],
    &[Span(1, 2)],
    &[Stride(2)],
    &[Stride(4)],
    &[Stride(8)],
    &[Rate(1, 1)],
    &[Rate(1, 2)],
    &[Rate(1, 4)],
    &[Activity(1250)],
    &[Stale(1)],
    &[Stale(5)],
    &[Stale(10)],
    &[Stale(20)],
    // Several stages, each made cheaper.
    &[Tolerance(1e-2), Stale(5)],
    &[Neighbours(4), Tolerance(1e-2)],
    &[Neighbours(4), Stale(5)],
    &[Neighbours(4), Stride(2)],
    &[Neighbours(4), Stride(2), Stale(5)],
    &[Stride(2), Tolerance(1e-2)],
    &[Stride(2), Stale(5)],
    &[Stride(2), Tolerance(1e-2), Stale(5)],
    &[Stride(4), Tolerance(1e-2), Stale(5)],
    &[Stride(2), Span(1, 2)],
    &[Activity(1250), Tolerance(1e-2), Stale(5)],
];

/// The settings of `network` over `rate` events a second, read every `every_us`; 0: always.
pub(super) fn settings(network: &Network, rate: f64, every_us: i64) -> Vec<Setting> {
    let fits = |change: &Change| change.fits(network, every_us);
    let fitting = SETTINGS.iter().filter(|changes| changes.iter().all(fits));
    fitting.map(|changes| Setting::of(changes, rate)).collect()
}

impl Setting {
    fn of(changes: &[Change], rate: f64) -> Self {
        let names: Vec<String> = changes.iter().map(|change| change.name()).collect();
        let name = if names.is_empty() { EXACT.to_owned() } else { names.join(" + ") };
        let mut setting = Self { name, approximations: Approximations::default(), span: None };
        changes.iter().for_each(|change| change.apply(&mut setting, rate));
        setting
    }

    pub(super) fn network(&self, network: &Network) -> Result<Network> {
        let mut network = network.clone();
        if let Some((part, whole)) = self.span {
            let span_us = network.parts().span_us * part / whole;
            network = network.with_span_us(span_us.max(1))?;
        }
        Ok(self.approximations.adapt(network)?)
    }

    /// Whether a prediction depends on earlier reads.
    pub(super) fn reads_matter(&self) -> bool {
        self.approximations.tolerance.is_some() || self.approximations.stale_us.is_some()
    }
}

impl Change {
    /// Whether it changes `network`, or predictions every `every_us`.
    fn fits(self, network: &Network, every_us: i64) -> bool {
        let parts = network.parts();
        match self {
            // Rows that are computed once, on arrival, have no older values to be kept.
            Tolerance(_) => {
                !parts.graph.is_frozen() || parts.pooled.iter().any(|(_, level)| !level.blocks.is_empty())
            }
            Neighbours(most) => usize::from(most) < parts.graph.reach.most(),
            Span(part, whole) => parts.span_us * part / whole > 0,
            // A prediction is repeated while it is younger than the bound.
            Stale(ms) => 1000 * ms > every_us,
            Stride(_) | Rate(..) | Activity(_) => true,
        }
    }

    fn name(self) -> String {
        match self {
            Tolerance(tolerance) => format!("tolerance {tolerance}"),
            Neighbours(most) => format!("neighbours {most}"),
            Span(part, whole) => format!("span {part}/{whole}"),
            Stride(n) => format!("stride {n}"),
            Rate(1, 1) => "rate limit mean".to_owned(),
            Rate(part, whole) => format!("rate limit {part}/{whole} mean"),
            Activity(_) => "activity filter".to_owned(),
            Stale(ms) => format!("stale {ms} ms"),
        }
    }

    fn apply(self, setting: &mut Setting, rate: f64) {
        let approximations = &mut setting.approximations;
        match self {
            Tolerance(tolerance) => approximations.tolerance = Some(tolerance),
            Neighbours(most) => approximations.neighbours = Some(most),
            Span(part, whole) => setting.span = Some((part, whole)),
            Stride(n) => approximations.stride = Some(n),
            Rate(part, whole) => {
                let limit = (rate * part as f64 / whole as f64).round();
                approximations.rate_limit = Some(limit.max(1.0) as u64);
            }
            Activity(us) => approximations.activity_filter_us = Some(us),
            Stale(ms) => approximations.stale_us = Some(1000 * ms),
        }
    }
}

/// Events a second of `streams`, each from its first to its last; 0 where no time passes.
pub(super) fn mean_rate(streams: &[Vec<Event>]) -> f64 {
    let length = |events: &[Event]| {
        let times = || events.iter().map(|event| event.t_us);
        times().max().zip(times().min()).map_or(0, |(last, first)| last.abs_diff(first))
    };
    let us: f64 = streams.iter().map(|events| length(events) as f64).sum();
    let events: usize = streams.iter().map(Vec::len).sum();
    if us > 0.0 { events as f64 * 1e6 / us } else { 0.0 }
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) struct FrameSetting {
    pub(super) convolution: Convolution,
    pub(super) tolerance: Option<f32>,
    pub(super) thinning: Thinning,
}

/// Frames that the network does not see.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub(super) enum Thinning {
    #[default]
    None,
    /// All but the last `kept` of the `of` readings of a window.
    Last { kept: usize, of: usize },
    /// Every second frame; the answer to the one before stands for it.
    EverySecond,
}

/// The exact setting, Winograd's convolutions, and `tolerances`, if they change a network.
pub(super) fn common(parts: &FrameNetworkParts, tolerances: &[f32]) -> Vec<FrameSetting> {
    let exact = FrameSetting::default();
    let mut settings = vec![exact];
    if has_winograd(parts) {
        let tiles = [WinogradTile::Two, WinogradTile::Four];
        settings.extend(tiles.map(|tile| FrameSetting { convolution: Convolution::Winograd(tile), ..exact }));
    }
    if has_pixels_to_keep(parts) {
        settings.extend(tolerances.iter().map(|&of| FrameSetting { tolerance: Some(of), ..exact }));
    }
    settings
}

/// What cannot be approximated in the network `name` of `parts`, in words for people.
pub(super) fn notes(name: &str, parts: &FrameNetworkParts) -> Vec<String> {
    let mut notes = Vec::new();
    let is_3x3 = |layer: &FrameLayer| matches!(layer.kind, FrameLayerKind::Conv { kernel: 3, .. });
    if !parts.layers.iter().any(is_3x3) {
        notes.push(format!("{name}: no 3 x 3 convolution outside recurrent layers, so none by Winograd"));
    } else if !has_winograd(parts) {
        notes.push(format!(
            "{name}: convolutions of few channels, which Winograd's algorithm does not compute"
        ));
    }
    if !has_pixels_to_keep(parts) {
        notes.push(format!("{name}: no pixel that a tolerance could keep, so none with one"));
    }
    notes
}

/// Whether Winograd's algorithm computes any convolution.
pub(super) fn has_winograd(parts: &FrameNetworkParts) -> bool {
    let network = FrameNetwork::new(parts.clone(), Convolution::Winograd(WinogradTile::Two));
    network.is_ok_and(|network| network.has_winograd())
}

/// Whether a tolerance can keep a pixel: recurrent layers couple all, vectors have none.
pub(super) fn has_pixels_to_keep(parts: &FrameNetworkParts) -> bool {
    use FrameLayerKind as Kind;
    let keeps = |kind: &Kind| {
        matches!(kind, Kind::Conv { .. } | Kind::UpConv { .. } | Kind::MaxPool | Kind::AveragePool { .. })
    };
    parts.layers.iter().any(|layer| keeps(&layer.kind))
}

impl FrameSetting {
    pub(super) fn name(self) -> String {
        let mut names = Vec::new();
        match self.convolution {
            Convolution::Direct => {}
            Convolution::Winograd(WinogradTile::Two) => names.push("winograd 2x2".to_owned()),
            Convolution::Winograd(WinogradTile::Four) => names.push("winograd 4x4".to_owned()),
            Convolution::Kn2row => names.push("kn2row".to_owned()),
        }
        match self.thinning {
            Thinning::None => {}
            Thinning::Last { kept, of } => names.push(format!("steps {kept} of {of}")),
            Thinning::EverySecond => names.push("every 2nd frame".to_owned()),
        }
        names.extend(self.tolerance.map(|tolerance| format!("tolerance {tolerance}")));
        if names.is_empty() { EXACT.to_owned() } else { names.join(" + ") }
    }

    pub(super) fn names(settings: &[Self]) -> Vec<(usize, String)> {
        settings.iter().map(|setting| setting.name()).enumerate().collect()
    }

    pub(super) fn options(self) -> FrameOptions {
        FrameOptions::new().with_skip(self.tolerance.map_or(Skip::Exact, Skip::Tolerance))
    }

    /// The network sees the first of so many frames.
    pub(super) fn every(self) -> usize {
        if self.thinning == Thinning::EverySecond { 2 } else { 1 }
    }
}

#[cfg(test)]
mod tests;
