//! Engine and batch against the same network in f64: random networks, and networks small enough to
//! compute by hand.
//!
//! `MEISSNER_CASES` sets the number of cases (200 without it).

use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_engine::{
    Aggregation, Block, Candidates, DenseLayer, Event, GraphConvolution, GraphRule, Level, Network,
    NetworkParts, Normalisation, Reach, Readout, Search, Sensor, Stream, Trace,
};
use meissner_kernels::{Activation, Dense, SplineConv, SplineParts, WinogradTile};
use meissner_reference::{Difference, EventReference, EventTrace, FrameReference, ReferenceError};
use meissner_tests::cases;
use meissner_verify::CheckedEngine;
use meissner_verify::frame_networks::{self, Style};
use meissner_verify::strategies::{network, script};
use proptest::prelude::*;

/// Largest difference, as a share of the largest magnitude so far. 2,000 random cases of each kind
/// stay below 1.5e-6 (networks over events) and 6e-6 (frame networks, by Winograd's tiles); others
/// may be a few times as far off.
const WITHIN: f64 = 3e-5;

/// Adds the magnitudes of a feature to `scale`, and returns an error if its difference exceeds
/// their limit.
fn check(what: &str, difference: Difference, scale: &mut f64) -> Result<(), String> {
    *scale = scale.max(difference.largest);
    if difference.not_numbers + difference.infinite == 0 && difference.absolute <= WITHIN * *scale {
        Ok(())
    } else {
        Err(format!("{what}: {difference:?} at a scale of {scale:e}"))
    }
}

/// Compares every value of a batch with f64.
fn compare(got: &Trace, want: &EventTrace) -> Result<(), String> {
    let mut scale = 1.0;
    for (l, (got, want)) in got.levels.iter().zip(&want.levels).enumerate() {
        if got.first != want.first {
            return Err(format!("level {l} begins at row {}, not {}", got.first, want.first));
        }
        for (f, (got_rows, want_rows)) in got.features.iter().zip(&want.features).enumerate() {
            if got_rows.rows() != want_rows.len() {
                return Err(format!("level {l}: {} rows, not {}", got_rows.rows(), want_rows.len()));
            }
            let mut difference = Difference::default();
            for (row, want) in want_rows.iter().enumerate().skip(got.first) {
                difference.add_all(&got_rows.values(row).collect::<Vec<_>>(), want);
            }
            check(&format!("level {l} feature {f}"), difference, &mut scale)?;
        }
    }
    let mut difference = Difference::default();
    for (cell, want) in want.readout.iter().enumerate() {
        difference.add_all(&got.readout.values(cell).collect::<Vec<_>>(), want);
    }
    check("readout", difference, &mut scale)?;
    let mut difference = Difference::default();
    difference.add_all(&got.prediction, &want.prediction);
    // Dense weights are up to 0.5, over as many inputs as the readout has values.
    scale *= (got.readout.rows() * got.readout.columns()).max(1) as f64;
    check("prediction", difference, &mut scale)
}

proptest! {
    #![proptest_config(cases(200))]

    #[test]
    fn every_row_of_a_random_network_is_close_to_f64(shape in network(), script in script(40)) {
        let (network, head) = shape.build_with_head();
        let network = Arc::new(network);
        let reference = EventReference::new(Arc::clone(&network), script.sensor, head).expect("fixed scales");
        let mut checked = CheckedEngine::new(network, script.sensor, Search::Exhaustive);
        let done = checked.run_with(&script, |checked| {
            checked.compare().map_err(|e| e.to_string())?;
            compare(&checked.batch.trace().map_err(|e| e.to_string())?, &reference.forward(checked.batch.stream()))
        });
        prop_assert_eq!(done, Ok(()));
    }

    #[test]
    fn every_prediction_of_a_random_frame_network_is_close_to_f64(
        style in prop_oneof![
            Just(Style::Classifier),
            any::<bool>().prop_map(|squeeze| Style::UNet { squeeze }),
            Just(Style::ConvolutionsThenLstm),
            (1usize..=8, any::<bool>()).prop_map(|(hidden, peepholes)| Style::ConvLstm { hidden, peepholes }),
            Just(Style::Delays),
            any::<bool>().prop_map(|vector| Style::Committee { vector }),
        ],
        (channels, height, width) in (1usize..=3, 1usize..=6, 1usize..=6),
        wide in 1usize..=9,
        convolution in prop_oneof![
            Just(Convolution::Direct),
            Just(Convolution::Winograd(WinogradTile::Two)),
            Just(Convolution::Winograd(WinogradTile::Four)),
            Just(Convolution::Kn2row),
        ],
        seed in any::<u64>(),
    ) {
        // Sides that can be halved.
        let image = [channels, 2 * height, 2 * width];
        let parts = frame_networks::network(style, image, wide, seed);
        let mut reference = FrameReference::new(parts.clone()).expect("the layers fit");
        let network = FrameNetwork::new(parts, convolution).expect("the layers fit");
        let mut engine = FrameEngine::new(network).expect("in range");
        let mut scale = 1.0;
        for frame in frame_networks::sequence(12, image, seed) {
            engine.push(&frame).expect("a frame that fits");
            let wide: Vec<f64> = frame.iter().map(|&v| f64::from(v)).collect();
            let mut difference = Difference::default();
            difference.add_all(engine.predict().expect("finite").values, reference.push(&wide));
            prop_assert_eq!(check("prediction", difference, &mut scale), Ok(()));
        }
    }
}

/// A block that passes its input on, weighted by the x attribute.
fn slope() -> GraphConvolution {
    let parts = SplineParts {
        inputs: 1,
        outputs: 1,
        kernel: [2, 1, 1],
        weight: vec![0.0, 1.0],
        root: None,
        bias: None,
        norm: None,
        elu: false,
    };
    SplineConv::new(&parts).expect("sizes fit").into()
}

fn line(normalisation: Normalisation) -> Network {
    let dense = Dense::new(2, 1, 1, &[1.0, 10.0], Some(&[0.5]), Activation::Identity).expect("sizes fit");
    let parts = NetworkParts {
        name: "line".to_owned(),
        span_us: 100,
        capacity: 3,
        graph: GraphRule { reach: Reach::Knn { k: 1 }, candidates: Candidates::All },
        normalisation,
        place: None,
        events: Level {
            scale: 0.5,
            blocks: vec![Block { name: "slope".to_owned(), input: 0, skip: None, conv: slope() }],
        },
        pooled: Vec::new(),
        readout: Readout { from: 1, columns: 2, rows: 1, aggregation: Aggregation::Max, by_time: false },
        dense: vec![DenseLayer { name: "fc".to_owned(), dense }],
        head: None,
    };
    Network::new(parts).expect("the parts fit")
}

#[test]
fn three_events_on_a_line_are_what_a_hand_computes() {
    let sensor = Sensor::new(8, 1);
    // At x = 0, 2 and 5; the first of the four is evicted, as the window holds three.
    let events = [
        Event::new(0, 7, 0, true),
        Event::new(0, 0, 0, true),
        Event::new(0, 2, 0, true),
        Event::new(0, 5, 0, false),
    ];
    let network = Arc::new(line(Normalisation::Fixed));
    let reference = EventReference::new(Arc::clone(&network), sensor, None).expect("fixed scales");
    let trace = reference.forward(Stream::new(&events));
    // u = dx / 8 + 0.5: the first reads the second (0.75, on), the second the first, the third the
    // second.
    assert_eq!(trace.levels[0].features[1], [[0.75], [0.25], [0.125]]);
    // Columns 0 to 3 hold the first two, of which 0.75 is larger.
    assert_eq!(trace.readout, [[0.75], [0.125]]);
    assert_eq!(trace.prediction, [0.5 + 0.75 + 1.25]);
    let mut checked = CheckedEngine::new(network, sensor, Search::Exhaustive);
    for event in events {
        checked.push(event);
    }
    assert_eq!(checked.predict(), Ok(vec![2.5]));
}

#[test]
fn what_has_no_reference_is_refused() {
    let sensor = Sensor::new(8, 1);
    let refused = EventReference::new(line(Normalisation::PerGraph), sensor, None).map(drop);
    assert_eq!(refused, Err(ReferenceError::PerGraph("line".to_owned())));
    let head = frame_networks::head([1, 2, 2], 1, 1, 1);
    let refused = EventReference::new(line(Normalisation::Fixed), sensor, Some(head)).map(drop);
    assert!(matches!(refused, Err(ReferenceError::Head { .. })), "{refused:?}");
}
