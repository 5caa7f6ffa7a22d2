//! Small snapshots of both kinds of engine, damaged at every place: refused with the place, and the engine as it was.

use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_engine::{Candidates, Engine, EngineError, Event, GraphRule, Lifetime, Options, Reach, Sensor};
use meissner_tests::snapshots::sealed;
use meissner_verify::Incremental;
use meissner_verify::frame_networks::{Style, network, sequence};
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape, PoolShape};

/// An engine over events that has seen some, and the bytes of one that has seen more.
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

/// An engine over frames that remembers some, and the bytes of one that has seen more.
fn over_frames() -> (FrameEngine, Vec<u8>) {
    const SIZE: [usize; 3] = [1, 4, 6];
    let parts = network(Style::ConvLstm { hidden: 3, peepholes: true }, SIZE, 2, 1);
    let network = Arc::new(FrameNetwork::new(parts, Convolution::Direct).expect("parts that fit"));
    let run = |frames| {
        let mut engine = FrameEngine::new(network.clone()).expect("in range");
        sequence(frames, SIZE, 3).iter().for_each(|frame| engine.push(frame).expect("a frame that fits"));
        engine
    };
    (run(1), run(2).to_bytes())
}

/// Has `wrong` refused with a typed error that names what was expected and found, or restored; says which.
fn is_refused(engine: &mut impl Incremental, before: &[u8], wrong: &[u8], at: usize) -> bool {
    match engine.restore_bytes(wrong) {
        Ok(()) => {
            engine.restore_bytes(before).expect("its own bytes");
            false
        }
        Err(error) => {
            let typed = matches!(error, EngineError::Snapshot { .. } | EngineError::SnapshotBytes { .. });
            let text = error.to_string();
            assert!(typed && text.contains("expected") && text.contains("found"), "{at}: {text}");
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
        // With length and checksum that fit, it may be another state.
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
