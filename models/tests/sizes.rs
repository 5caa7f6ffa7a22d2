//! Descriptions with other sizes.

use meissner_models::description::Sizes;
use meissner_models::{Description, LayerKind, draw};

fn sizes(channels: f64) -> Sizes {
    Sizes { span_us: 40_000, capacity: 77, neighbours: Some(3), channels }
}

#[test]
fn every_shipped_network_runs_in_other_sizes() {
    for name in Description::shipped_names() {
        let text = Description::shipped_text(name).expect("a shipped description");
        let usual = Description::shipped(name).expect("a shipped description");
        for channels in [0.5, 2.0] {
            let resized =
                Description::resized(text, &sizes(channels)).unwrap_or_else(|e| panic!("{name}: {e}"));
            assert_eq!((resized.span_us(), resized.capacity()), (40_000, 77), "{name}");
            assert_eq!(resized.graph().reach.most(), 3, "{name}");
            assert!(resized.filters().is_empty(), "{name}");
            for (layer, before) in resized.layers().iter().zip(usual.layers()) {
                let is_block = matches!(layer.kind, LayerKind::Block { .. });
                let expected = (before.outputs as f64 * channels).round() as usize;
                assert!(!is_block || layer.outputs == expected, "{name}: {layer:?}");
            }
            resized.network(&draw(&resized, 0)).unwrap_or_else(|error| panic!("{name}: {error}"));
        }
    }
}

#[test]
fn blocks_keep_a_channel_and_sizes_beyond_the_limits_are_refused() {
    let text = Description::shipped_text("tactigraph-past").expect("a shipped description");
    let narrow = Description::resized(text, &sizes(0.01)).expect("a description");
    assert!(narrow.layers()[..3].iter().all(|layer| layer.outputs == 1));
    let unchanged = Sizes { neighbours: None, ..sizes(1.0) };
    let of_graph = Description::resized(text, &unchanged).expect("a description").graph().reach.most();
    assert_eq!(of_graph, 8);
    for wrong in [
        Sizes { span_us: 0, ..sizes(1.0) },
        Sizes { capacity: 0, ..sizes(1.0) },
        Sizes { neighbours: Some(256), ..sizes(1.0) },
        sizes(1e9),
    ] {
        assert!(Description::resized(text, &wrong).is_err(), "{wrong:?}");
    }
    assert!(Description::resized("[network]", &sizes(1.0)).is_err());
}
