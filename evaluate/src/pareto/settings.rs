//! The settings of a network over events: which approximations, alone and together.
//!
//! Enters: a network, and the mean rate of its events. Leaves: every setting that changes the
//! network, after the exact one.

use meissner_engine::{Event, Network};
use meissner_run::approximations::Approximations;

use super::measurement::EXACT;
use crate::error::EvaluateError;

/// A network with some approximations.
#[derive(Clone, Debug)]
pub(super) struct Setting {
    pub(super) name: String,
    /// Its approximations, without the span.
    pub(super) approximations: Approximations,
    /// Share of the network's span.
    span: Option<(i64, i64)>,
}

/// One approximation.
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

/// The settings of `network` over events with a mean rate of `rate` per second, where a prediction
/// is read every `every_us`, or after each event for 0.
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

    /// `network` with this setting.
    pub(super) fn network(&self, network: &Network) -> Result<Network, EvaluateError> {
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
    /// Whether it changes anything about `network`, or about predictions every `every_us`.
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

/// Events a second over all of `streams`, each from its first event to its last; 0 where no time
/// passes.
pub(super) fn mean_rate(streams: &[Vec<Event>]) -> f64 {
    let length = |events: &[Event]| {
        let times = || events.iter().map(|event| event.t_us);
        times().max().zip(times().min()).map_or(0, |(last, first)| last.abs_diff(first))
    };
    let us: f64 = streams.iter().map(|events| length(events) as f64).sum();
    let events: usize = streams.iter().map(Vec::len).sum();
    if us > 0.0 { events as f64 * 1e6 / us } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::{mean_rate, settings};
    use crate::regression::engine::row_costs;
    use meissner_engine::Event;
    use meissner_models::{Description, Weights};
    use meissner_run::model::Model;

    fn shipped(name: &str) -> meissner_engine::Network {
        let weights = Weights::shipped(name).expect("shipped");
        Description::shipped(name).expect("shipped").network(&weights).expect("they fit")
    }

    #[test]
    fn the_first_setting_is_exact_and_names_are_different() {
        for name in ["graphres", "tactigraph", "tactigraph-frozen", "tactigraph-past"] {
            let names: Vec<String> =
                settings(&shipped(name), 1000.0, 0).into_iter().map(|setting| setting.name).collect();
            assert_eq!(names[0], "exact");
            let mut sorted = names.clone();
            sorted.sort();
            sorted.dedup();
            assert_eq!(sorted.len(), names.len(), "{names:?}");
        }
    }

    #[test]
    fn every_setting_makes_a_network() {
        let network = shipped("tactigraph");
        for setting in settings(&network, 1000.0, 0) {
            let adapted = setting.network(&network).expect("it fits");
            assert!(setting.name != "exact" || adapted.parts().span_us == network.parts().span_us);
            assert_eq!(row_costs(&adapted).len(), network.layers().len(), "{}", setting.name);
        }
    }

    #[test]
    fn settings_that_change_nothing_are_left_out() {
        let names = |name| settings(&shipped(name), 1000.0, 0).into_iter().map(|setting| setting.name);
        let of_past: Vec<String> = names("tactigraph-past").collect();
        assert!(
            !of_past.iter().any(|name| name.contains("tolerance")),
            "rows are computed once: {of_past:?}"
        );
        assert!(!of_past.iter().any(|name| name.contains("neighbours 8")), "it has 8: {of_past:?}");
        assert!(!names("digits-frozen").any(|name| name.contains("tolerance")), "its cells have no blocks");
        assert!(names("digits-past").any(|name| name.contains("tolerance")));
    }

    #[test]
    fn a_readout_that_is_never_stale_when_it_is_read_is_left_out() {
        let stale = |every_us| -> Vec<String> {
            let settings = settings(&shipped("force-graph"), 1000.0, every_us);
            settings.into_iter().map(|setting| setting.name).filter(|name| name.contains("stale")).collect()
        };
        assert_eq!(stale(10_000), ["stale 20 ms"]);
        assert!(stale(0).iter().any(|name| name == "stale 1 ms"));
    }

    #[test]
    fn costs_of_rows_are_those_that_inspect_lists() {
        for name in ["graphres", "tactigraph", "tactigraph-past", "digits-past", "force-graph"] {
            let (description, weights) = (Description::shipped(name), Weights::shipped(name));
            let (description, weights) = (description.expect("shipped"), weights.expect("shipped"));
            let model = Model::of(&description, (&weights, String::new()), false).expect("they fit");
            assert_eq!(row_costs(&model.network), model.multiply_adds, "{name}");
        }
    }

    #[test]
    fn fewer_neighbours_are_fewer_products() {
        let network = shipped("graphres");
        let few = network.clone().with_neighbours(2).expect("it has more");
        let (all, few) = (row_costs(&network), row_costs(&few));
        assert!(few[0] < all[0] && few.last() == all.last(), "{few:?} {all:?}");
    }

    #[test]
    fn a_rate_is_of_the_time_that_passes_within_streams() {
        let stream = |times: &[i64]| times.iter().map(|&t| Event::new(t, 0, 0, true)).collect::<Vec<_>>();
        let (a, b) = (stream(&[0, 500_000]), stream(&[7_000_000, 7_500_000]));
        assert_eq!(mean_rate(&[a, b]), 4.0);
        assert_eq!(mean_rate(&[stream(&[7])]), 0.0);
    }
}
