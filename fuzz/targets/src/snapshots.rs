//! Bytes as snapshots: refused by name with the engine as it was, or a state that can be stored, restored and gone on from.
//!
//! The first byte picks the engine, the second whether length and checksum are made to fit what follows, so that a content
//! that was made up is looked at.

use std::sync::{Arc, LazyLock};

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameOptions, Skip};
use meissner_engine::{
    Candidates, Engine, EngineError, Event, GraphRule, Lifetime, Options, Reach, Sensor, snapshot_note,
};
use meissner_tests::frame_networks::{Style, network, sequence};
use meissner_tests::networks::{BlockShape, NetworkShape, PoolShape};
use meissner_tests::random::Random;
use meissner_tests::snapshots::sealed;

use crate::target::Verdict;

/// Shortest bytes that can be sealed: header, length of the note and checksum.
const LEAST: usize = 40;
const SENSOR: Sensor = Sensor { width: 20, height: 10 };
/// Channels, rows and columns of a frame.
const FRAME: [usize; 3] = [2, 4, 6];

static ENGINES: LazyLock<Vec<Engine>> = LazyLock::new(|| {
    let exact = [Candidates::All, Candidates::Past(Lifetime::Window), Candidates::Past(Lifetime::Frozen)]
        .map(|candidates| (candidates, 0.0));
    exact.into_iter().chain([(Candidates::All, 0.1)]).map(|(c, tolerance)| engine(c, tolerance)).collect()
});

static FRAME_ENGINES: LazyLock<Vec<FrameEngine>> = LazyLock::new(|| {
    let state = Style::ConvLstm { hidden: 2, peepholes: true };
    let tolerant = FrameOptions { skip: Skip::Tolerance(0.1), sparse: true, ..FrameOptions::default() };
    [
        (Style::Classifier, FrameOptions::default()),
        (state, FrameOptions::default()),
        (Style::Delays, FrameOptions::default()),
        (Style::Classifier, tolerant),
    ]
    .map(|(style, options)| frame_engine(style, options))
    .into()
});

fn engine(candidates: Candidates, tolerance: f32) -> Engine {
    let block = |channels| BlockShape { channels, kernel: [2; 3], input: 0, skip: None, extras: [true; 4] };
    let shape = NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k: 3 }, candidates },
        span_us: 500,
        capacity: 12,
        blocks: vec![block(2)],
        pooled: vec![PoolShape {
            from: 1,
            cell: [(1, 4), (1, 2)],
            time: Some((1, 2)),
            mean: true,
            blocks: vec![block(2)],
        }],
        from: 1,
        grid: [2, 1],
        dense: vec![2],
        head: None,
        seed: 5,
    };
    let options = Options { tolerance, ..Options::default() };
    let mut engine = Engine::with_options(shape.build(), SENSOR, options).expect("admissible");
    go_on(&mut engine, 30);
    engine
}

fn frame_engine(style: Style, options: FrameOptions) -> FrameEngine {
    let network = FrameNetwork::new(network(style, FRAME, 2, 1), Convolution::Direct).expect("layers fit");
    let mut engine = FrameEngine::new(Arc::new(network), options).expect("admissible");
    go_on_with_frames(&mut engine, 3);
    engine
}

/// Events of a few pixels after whatever time it is, and predictions.
fn go_on(engine: &mut Engine, events: usize) {
    let mut random = Random::new(1);
    let mut now = engine.now_us().unwrap_or(7);
    for i in 0..events {
        now = now.saturating_add(random.below(40) as i64);
        let (x, y) = (random.below(SENSOR.width.into()) as u16, random.below(SENSOR.height.into()) as u16);
        engine.push(Event::new(now, x, y, x.is_multiple_of(2)));
        if i % 4 == 3 {
            let prediction = engine.predict();
            assert!(matches!(prediction, Ok(_) | Err(EngineError::NotANumber { .. })), "{prediction:?}");
        }
    }
}

fn go_on_with_frames(engine: &mut FrameEngine, frames: usize) {
    for mut frame in sequence(frames, FRAME, 3) {
        frame.truncate(engine.network().input().values());
        engine.push(&frame).expect("a frame that fits");
        let prediction = engine.predict();
        assert!(matches!(prediction, Ok(_) | Err(EngineError::NotANumber { .. })), "{prediction:?}");
    }
}

/// The engine that the first byte picks, and the bytes of the snapshot.
fn choose<'e, E>(engines: &'e [E], bytes: &[u8]) -> Option<(&'e E, Vec<u8>)> {
    let (&[which, seal], content) = bytes.split_first_chunk()?;
    let seal = seal & 1 == 1 && content.len() >= LEAST;
    let content = if seal { sealed(content.to_vec()) } else { content.to_vec() };
    Some((&engines[usize::from(which) % engines.len()], content))
}

fn is_typed(error: &EngineError) {
    let typed = matches!(error, EngineError::Snapshot { .. } | EngineError::SnapshotBytes { .. });
    assert!(typed && error.to_string().contains("expected"), "{error}");
}

/// Snapshots of engines over events.
///
/// # Panics
/// If a promise is broken.
pub fn snapshot(bytes: &[u8]) -> Verdict {
    let Some((first, content)) = choose(&ENGINES, bytes) else { return Verdict::Refused };
    let mut engine = first.clone();
    if let Err(error) = engine.restore_bytes(&content) {
        is_typed(&error);
        assert_eq!(engine.to_bytes(), first.to_bytes(), "a refusal changes nothing");
        return Verdict::Refused;
    }
    snapshot_note(&content).expect("what was restored has a note");
    let stored = engine.to_bytes();
    let mut again = first.clone();
    again.restore_bytes(&stored).expect("what was stored can be restored");
    assert_eq!(again.to_bytes(), stored);
    go_on(&mut engine, 20);
    engine.reset();
    go_on(&mut engine, 4);
    Verdict::Accepted
}

/// Snapshots of frame engines.
///
/// # Panics
/// If a promise is broken.
pub fn frame_snapshot(bytes: &[u8]) -> Verdict {
    let Some((first, content)) = choose(&FRAME_ENGINES, bytes) else { return Verdict::Refused };
    let mut engine = first.clone();
    if let Err(error) = engine.restore_bytes(&content) {
        is_typed(&error);
        assert_eq!(engine.to_bytes(), first.to_bytes(), "a refusal changes nothing");
        return Verdict::Refused;
    }
    snapshot_note(&content).expect("what was restored has a note");
    let stored = engine.to_bytes();
    let mut again = first.clone();
    again.restore_bytes(&stored).expect("what was stored can be restored");
    assert_eq!(again.to_bytes(), stored);
    go_on_with_frames(&mut engine, 2);
    engine.reset();
    go_on_with_frames(&mut engine, 1);
    Verdict::Accepted
}

/// Snapshots of the engines above, as the targets read them: sealed ones, so that what is changed in them is looked at.
pub fn seeds() -> (Vec<Vec<u8>>, Vec<Vec<u8>>) {
    let seed = |(which, bytes): (usize, Vec<u8>)| [&[which as u8, 1][..], &bytes].concat();
    let events = ENGINES.iter().map(Engine::to_bytes).enumerate().map(seed).collect();
    let frames = FRAME_ENGINES.iter().map(FrameEngine::to_bytes).enumerate().map(seed).collect();
    (events, frames)
}
