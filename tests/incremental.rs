//! Incremental equals batch, bit for bit: every row of every layer, over random networks, streams and interleavings.
//!
//! `MEISSNER_CASES` sets the number of cases (2,000 without it).

use meissner_engine::Search;
use meissner_tests::{compare::Watched, networks, streams};
use proptest::prelude::*;

fn config() -> ProptestConfig {
    let cases = std::env::var("MEISSNER_CASES").ok().and_then(|cases| cases.parse().ok()).unwrap_or(2_000);
    ProptestConfig { cases, max_shrink_iters: 20_000, ..ProptestConfig::default() }
}

proptest! {
    #![proptest_config(config())]

    #[test]
    fn incremental_equals_batch_bit_for_bit(shape in networks::network(), script in streams::script(120)) {
        let search = if shape.seed % 2 == 0 { Search::Exhaustive } else { Search::Grid };
        let mut watched = Watched::new(shape.build(), script.sensor, search);
        prop_assert_eq!(watched.run(&script), Ok(()));
    }
}
