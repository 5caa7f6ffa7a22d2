//! Snapshots that were damaged anywhere, made up, or do not fit are refused with the location, and
//! the engine stays unchanged.

use std::sync::Arc;

use meissner_engine::frames::{
    Convolution, FrameEngine, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameOptions, FrameSnapshot,
    Skip,
};
use meissner_engine::{Candidates, Engine, EngineError, Event, GraphRule, Lifetime, Options, Reach, Sensor};
use meissner_kernels::{Isa, WinogradTile};
use meissner_tests::cases;
use meissner_tests::snapshots::{Fields, sealed};
use meissner_verify::frame_networks::{Style, network, sequence};
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape, PoolShape};
use meissner_verify::strategies::frame_style;
use meissner_verify::{Incremental, bits};
use proptest::prelude::*;

/// An engine over events that has taken some events, and the bytes of one that has taken more.
fn over_events() -> (Engine, Vec<u8>) {
    let block = |channels| BlockShape {
        channels,
        conv: ConvolutionShape::Spline([2, 2, 1]),
        input: 0,
        skip: None,
        extras: [true; 4],
    };
    let pool = PoolShape { from: 1, cell: [(1, 4), (1, 2)], time: None, mean: true, blocks: vec![block(2)] };
    let shape = NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k: 3 }, candidates: Candidates::Past(Lifetime::Frozen) },
        span_us: 500,
        capacity: 9,
        place: None,
        blocks: vec![block(2)],
        pooled: vec![pool],
        from: 1,
        grid: [2, 2],
        dense: vec![2],
        head: None,
        seed: 5,
    };
    let network = Arc::new(shape.build());
    let run = |events: u16| {
        let options = Options::default();
        let sensor = Sensor::new(20, 10);
        let mut engine = Engine::with_options(network.clone(), sensor, options).expect("admissible");
        for i in 0..events {
            engine.push(Event::new(i64::from(i) * 70, i * 7 % 20, i * 3 % 10, i % 2 == 0));
        }
        engine.predict().expect("finite");
        engine
    };
    (run(4), run(12).to_bytes())
}

/// An engine over frames that remembers some frames, and the bytes of one that has taken more.
fn over_frames() -> (FrameEngine, Vec<u8>) {
    const SMALL: [usize; 3] = [1, 4, 6];
    let parts = network(Style::ConvLstm { hidden: 3, peepholes: true }, SMALL, 2, 1);
    let network = Arc::new(FrameNetwork::new(parts, Convolution::Direct).expect("parts that fit"));
    let run = |frames| {
        let mut engine = FrameEngine::new(network.clone()).expect("in range");
        sequence(frames, SMALL, 3).iter().for_each(|frame| engine.push(frame).expect("a frame that fits"));
        engine
    };
    (run(1), run(2).to_bytes())
}

/// Asserts that `wrong` is refused with a typed error that states what was expected, or restored;
/// returns which.
fn is_refused(engine: &mut impl Incremental, before: &[u8], wrong: &[u8], at: usize) -> bool {
    match engine.restore_bytes(wrong) {
        Ok(()) => {
            engine.restore_bytes(before).expect("its own bytes");
            false
        }
        Err(error) => {
            let text = error.to_string();
            match error {
                // The location is a byte of the snapshot, or its end.
                EngineError::SnapshotBytes { at: place, .. } => {
                    assert!(place <= wrong.len() && text.contains("at byte"), "{at}: {text}");
                }
                // The snapshot has another version, network, sensor or option; the error names it.
                EngineError::Snapshot { what, .. } => assert!(!what.is_empty(), "{at}: {text}"),
                _ => panic!("{at}: {text}"),
            }
            assert!(text.contains("expected") && text.contains("found"), "{at}: {text}");
            assert!(text.len() < 1000, "{at}: {text:.600}");
            assert_eq!(engine.to_bytes(), before, "{at}: {text}");
            true
        }
    }
}

fn damage(mut engine: impl Incremental, bytes: &[u8]) {
    let before = engine.to_bytes();
    assert!(!is_refused(&mut engine, &before, bytes, 0), "whole");
    for length in 0..bytes.len() {
        assert!(is_refused(&mut engine, &before, &bytes[..length], length), "cut at {length}");
    }
    let longer = [bytes, &[0]].concat();
    assert!(is_refused(&mut engine, &before, &longer, bytes.len()), "a byte more");
    for bit in 0..8 * bytes.len() {
        let mut flipped = bytes.to_vec();
        flipped[bit / 8] ^= 1 << (bit % 8);
        assert!(is_refused(&mut engine, &before, &flipped, bit / 8), "bit {bit}");
        // With the right length and checksum, it may be another state.
        is_refused(&mut engine, &before, &sealed(flipped), bit / 8);
    }
    for at in 0..bytes.len() - 8 {
        for length in [1_u64 << 63, u64::MAX, u64::from(u32::MAX), 0x7fff_ffff_ffff_ffff] {
            let mut wrong = bytes.to_vec();
            wrong[at..at + 8].copy_from_slice(&length.to_le_bytes());
            is_refused(&mut engine, &before, &sealed(wrong), at);
        }
    }
}

#[test]
fn a_snapshot_of_events_that_was_cut_flipped_or_made_up_anywhere_is_refused_with_its_place() {
    let (engine, bytes) = over_events();
    damage(engine, &bytes);
}

#[test]
fn a_snapshot_of_frames_that_was_cut_flipped_or_made_up_anywhere_is_refused_with_its_place() {
    let (engine, bytes) = over_frames();
    damage(engine, &bytes);
}

fn engine(parts: &FrameNetworkParts, convolution: Convolution, options: FrameOptions) -> FrameEngine {
    let network = FrameNetwork::new(parts.clone(), convolution).expect("parts that fit");
    FrameEngine::with_options(network, options).expect("options in range")
}

fn predict(engine: &mut FrameEngine) -> (Vec<u32>, u64) {
    let prediction = engine.predict().expect("finite values");
    (bits(prediction.values), prediction.frames)
}

fn options() -> impl Strategy<Value = FrameOptions> {
    let skip = prop_oneof![Just(Skip::Nothing), Just(Skip::Exact), Just(Skip::Tolerance(0.1))];
    (skip, any::<bool>()).prop_map(|(skip, sparse)| FrameOptions::new().with_skip(skip).with_sparse(sparse))
}

proptest! {
    #![proptest_config(cases(150))]

    #[test]
    fn a_content_that_was_made_up_is_refused_or_gives_other_numbers(
        style in frame_style(),
        options in options(),
        changes in proptest::collection::vec(
            (0.0f64..1.0, prop_oneof![Just(1u64 << 63), Just(u64::MAX), Just(0), any::<u64>()]), 1..4,
        ),
        seed in any::<u64>(),
    ) {
        let (mut engine, mut bytes) = after_frames(style, options, seed);
        for (place, word) in changes {
            let at = 24 + ((bytes.len() - 40) as f64 * place) as usize;
            bytes[at..at + 8].copy_from_slice(&word.to_le_bytes());
        }
        let before = engine.to_bytes();
        if engine.restore_bytes(&sealed(bytes)).is_err() {
            prop_assert_eq!(&engine.to_bytes(), &before);
        }
        for frame in sequence(3, SIZE, seed) {
            engine.push(&frame).expect("a frame that fits");
            let _ = engine.predict();
        }
        engine.reset();
        let _ = engine.predict();
    }
}

/// Found by the property test: counts of a layer that runs with its pooling are multiplied by four.
#[test]
fn counts_that_were_made_up_leave_room_to_go_on() {
    let style = Style::Classifier;
    let (mut engine, bytes) = after_frames(style, FrameOptions::default(), 1);
    let fields = Fields::of(&bytes, |bytes| engine.restore_bytes(bytes));
    // Pixels that the pooling, the second layer, computed.
    let (start, end) = (fields.at("count of pixels"), fields.end("count of pixels"));
    let at = start + (end - start) / engine.counters().layers.len();
    let with = |count: u64| {
        let mut bytes = bytes.clone();
        bytes[at..at + 8].copy_from_slice(&count.to_le_bytes());
        sealed(bytes)
    };
    let error = engine.restore_bytes(&with(1 << 56)).expect_err("too large").to_string();
    let expected = format!("count of pixels at byte {at}: expected a count below 2^56, found {}", 1u64 << 56);
    assert_eq!(error, format!("snapshot: {expected}"));
    assert_eq!(engine.restore_bytes(&with((1 << 56) - 1)), Ok(()));
    for frame in sequence(3, SIZE, 2) {
        engine.push(&frame).expect("a frame that fits");
        predict(&mut engine);
    }
    assert!(engine.counters().layers[1].computed > 1 << 56);
}

const SIZE: [usize; 3] = [2, 8, 20];

/// An engine that has seen three frames, and the bytes of one that has seen five.
fn after_frames(style: Style, options: FrameOptions, seed: u64) -> (FrameEngine, Vec<u8>) {
    let parts = network(style, SIZE, 3, seed);
    let run = |frames| {
        let mut engine = engine(&parts, Convolution::Direct, options);
        sequence(frames, SIZE, seed).iter().for_each(|frame| engine.push(frame).expect("a frame that fits"));
        engine
    };
    (run(3), run(5).to_bytes())
}

#[test]
fn bytes_become_a_snapshot_with_the_errors_of_a_restored_engine() {
    let (mut engine, bytes) = after_frames(Style::Delays, FrameOptions::default(), 2);
    let mut flipped = bytes.clone();
    flipped[bytes.len() / 2] ^= 8;
    for wrong in [&bytes[..bytes.len() - 1], &flipped] {
        assert_eq!(FrameSnapshot::from_bytes(wrong).err(), engine.restore_bytes(wrong).err());
    }
    let snapshot = FrameSnapshot::from_bytes(&bytes).expect("bytes of a snapshot");
    assert_eq!(snapshot.to_bytes(), bytes);
    engine.restore(&snapshot).expect("bytes of an equal engine");
    assert_eq!(engine.to_bytes(), bytes);
}

#[test]
fn a_frame_snapshot_of_another_network_or_way_to_skip_is_refused() {
    let parts = network(Style::ConvolutionsThenLstm, SIZE, 3, 1);
    let mut other = parts.clone();
    let FrameLayerKind::Lstm { bias, .. } = &mut other.layers[4].kind else { panic!("an LSTM") };
    bias[3] = f32::from_bits(bias[3].to_bits() ^ 1);
    let exact = FrameOptions::default();
    let mut wanted = engine(&parts, Convolution::Direct, exact);
    let refuse = |wanted: &mut FrameEngine, found: &FrameEngine, name: &str| {
        for error in [wanted.restore(&found.snapshot()), wanted.restore_bytes(&found.to_bytes())] {
            let error = error.expect_err(name);
            assert!(matches!(error, EngineError::Snapshot { what, .. } if what == name), "{error}");
        }
    };
    refuse(&mut wanted, &engine(&other, Convolution::Direct, exact), "network");
    let winograd = Convolution::Winograd(WinogradTile::Two);
    refuse(&mut wanted, &engine(&parts, winograd, exact), "network");
    let tolerance = exact.with_skip(Skip::Tolerance(0.5));
    refuse(&mut wanted, &engine(&parts, Convolution::Direct, tolerance), "skip");
    let sparse = exact.with_sparse(true);
    refuse(&mut wanted, &engine(&parts, Convolution::Direct, sparse), "sparse");
}

#[test]
fn options_that_reach_no_result_are_no_reason_to_refuse_a_frame_snapshot() {
    let parts = network(Style::ConvolutionsThenLstm, SIZE, 3, 1);
    let own = FrameOptions::default();
    let other = own.with_isa(Isa::portable()).with_two_threads(true).with_memory_limit(u128::MAX);
    let mut found = engine(&parts, Convolution::Direct, other);
    sequence(5, SIZE, 1).iter().for_each(|frame| found.push(frame).expect("a frame that fits"));
    let (mut restored, mut read) =
        (engine(&parts, Convolution::Direct, own), engine(&parts, Convolution::Direct, own));
    assert_eq!(restored.restore(&found.snapshot()), Ok(()));
    assert_eq!(read.restore_bytes(&found.to_bytes()), Ok(()));
    for frame in sequence(3, SIZE, 2) {
        for engine in [&mut found, &mut restored, &mut read] {
            engine.push(&frame).expect("a frame that fits");
        }
        let expected = predict(&mut found);
        assert_eq!([predict(&mut restored), predict(&mut read)], [expected.clone(), expected]);
    }
}
