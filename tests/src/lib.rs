//! Helpers of the whole-engine tests: oracles of filters and representations, stored rows, files.

pub mod event_filters;
pub mod event_frames;
pub mod fixed_run;
pub mod shared;
pub mod snapshots;
pub mod within_tolerance;

use proptest::prelude::ProptestConfig;

/// The number of cases that `MEISSNER_CASES` sets, `default` without it.
pub fn cases(default: u32) -> ProptestConfig {
    let cases = std::env::var("MEISSNER_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(default);
    ProptestConfig { cases, max_shrink_iters: 20_000, ..ProptestConfig::default() }
}
