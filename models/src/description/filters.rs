//! The filters before a network: tables `[[filter]]`, and the same words for reports.
//!
//! Input: the table of a file. Output: rules, in the order in which events pass them.

use std::ops::RangeInclusive;

use meissner_engine::Network;
use meissner_engine::filters::{FilterRule, HotPixel};
use serde::{Serialize, Serializer};
use toml::de::DeValue;

use super::table::{Spanned, Table};

const FILTER: &str = "filter";
/// Maximum number of filters of a network.
const MAX_FILTERS: usize = 8;
/// The ranges that the engine accepts.
const TIMES_US: RangeInclusive<i64> = 1..=Network::MAX_SPAN_US;
const BURSTS: RangeInclusive<i64> = 1..=HotPixel::MAX_BURST;

/// Reads a table of a kind.
type Read = fn(&mut Table<'_, '_>) -> FilterRule;
const KINDS: [(&str, Read); 3] = [
    ("hot_pixel", |table| FilterRule::HotPixel {
        period_us: table.integer("period_us", TIMES_US, None),
        burst: table.size("burst", BURSTS, None) as u32,
    }),
    ("refractory", |table| FilterRule::Refractory { us: table.integer("time_us", TIMES_US, None) }),
    ("activity_filter", |table| FilterRule::BackgroundActivity {
        us: table.integer("time_us", TIMES_US, None),
    }),
];

/// The rules of the tables `[[filter]]` in `root`, without reported ones.
pub(super) fn read(root: &mut Table<'_, '_>) -> Vec<FilterRule> {
    let tables = root.optional(FILTER, "tables [[filter]]", DeValue::as_array);
    let Some(Spanned { value: tables, .. }) = tables else { return Vec::new() };
    let mut rules = Vec::new();
    for value in tables.iter().take(MAX_FILTERS) {
        let Some(mut table) = root.layer(FILTER, value) else { continue };
        // The keys of an unknown kind are unknown.
        if let Some(read) = table.choice("kind", &KINDS) {
            rules.extend(table.known(read));
            table.finish();
        }
    }
    if let Some(more) = tables.get(MAX_FILTERS) {
        let line = root.line_at(more);
        root.refuse(line, FILTER, format!("at most {MAX_FILTERS} filters"), tables.len().to_string());
    }
    rules
}

/// A rule with the keys of its table, in their order.
#[derive(Clone, Copy, Debug, Serialize)]
#[serde(tag = "kind", rename_all = "snake_case")]
enum Summary {
    HotPixel { period_us: i64, burst: u32 },
    Refractory { time_us: i64 },
    ActivityFilter { time_us: i64 },
}

impl Summary {
    /// The summaries of `rules`; a description has only these kinds.
    fn all(rules: &[FilterRule]) -> Vec<Self> {
        let one = |&rule: &FilterRule| match rule {
            FilterRule::HotPixel { period_us, burst } => Some(Self::HotPixel { period_us, burst }),
            FilterRule::Refractory { us } => Some(Self::Refractory { time_us: us }),
            FilterRule::BackgroundActivity { us } => Some(Self::ActivityFilter { time_us: us }),
            _ => None,
        };
        rules.iter().filter_map(one).collect()
    }
}

/// `rules` in the form of the metadata `preparation`.
pub(super) fn json(rules: &[FilterRule]) -> String {
    serde_json::to_string(&Summary::all(rules)).expect("numbers and words are JSON")
}

/// `rules` in one line, such as `hot_pixel, period_us = 10000, burst = 16`.
pub(crate) fn line(rules: &[FilterRule]) -> String {
    let one = |rule| match rule {
        Summary::HotPixel { period_us, burst } => {
            format!("hot_pixel, period_us = {period_us}, burst = {burst}")
        }
        Summary::Refractory { time_us } => format!("refractory, time_us = {time_us}"),
        Summary::ActivityFilter { time_us } => format!("activity_filter, time_us = {time_us}"),
    };
    Summary::all(rules).into_iter().map(one).collect::<Vec<_>>().join("; ")
}

pub(super) fn serialize<S: Serializer>(rules: &[FilterRule], to: S) -> Result<S::Ok, S::Error> {
    Summary::all(rules).serialize(to)
}
