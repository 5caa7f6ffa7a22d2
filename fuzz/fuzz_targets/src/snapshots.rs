//! Bytes as snapshots: refused without a change of the engine, or a state from which it can
//! continue.
//!
//! The first byte picks the engine, the second whether length and checksum are made to fit.

use std::sync::LazyLock;

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameOptions, Skip};
use meissner_engine::{
    Candidates, Engine, EngineError, Event, GraphRule, Lifetime, Options, Reach, Sensor, snapshot_note,
};
use meissner_tests::snapshots::sealed;
use meissner_verify::frame_networks::{Style, network, sequence};
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape, PoolShape};
use meissner_verify::{Incremental, Random};

use crate::Verdict;

/// Shortest bytes that can be sealed: header, length of the note and checksum.
const MIN: usize = 40;
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
    let tolerant = FrameOptions::new().with_skip(Skip::Tolerance(0.1)).with_sparse(true);
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
    let block = |channels| BlockShape {
        channels,
        conv: ConvolutionShape::Spline([2; 3]),
        input: 0,
        skip: None,
        extras: [true; 4],
    };
    let shape = NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k: 3 }, candidates },
        span_us: 500,
        capacity: 12,
        place: None,
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
    let options = Options::new().with_tolerance(tolerance);
    let mut engine = Engine::with_options(shape.build(), SENSOR, options).expect("admissible");
    engine.go_on();
    engine
}

fn frame_engine(style: Style, options: FrameOptions) -> FrameEngine {
    let network = FrameNetwork::new(network(style, FRAME, 2, 1), Convolution::Direct).expect("layers fit");
    let mut engine = FrameEngine::with_options(network, options).expect("admissible");
    engine.go_on();
    engine
}

/// Both kinds of engine, driven after a restore.
trait GoesOn: Incremental + Clone {
    /// Takes inputs after the current time, and predicts.
    fn go_on(&mut self);
}

impl GoesOn for Engine {
    /// Events of a few pixels.
    fn go_on(&mut self) {
        let mut random = Random::new(1);
        let mut now = self.now_us().unwrap_or(7);
        for i in 0..30 {
            now = now.saturating_add(random.below(40) as i64);
            let (x, y) =
                (random.below(SENSOR.width.into()) as u16, random.below(SENSOR.height.into()) as u16);
            self.push(Event::new(now, x, y, x.is_multiple_of(2)));
            if i % 4 == 3 {
                let prediction = self.predict();
                assert!(matches!(prediction, Ok(_) | Err(EngineError::NotANumber { .. })), "{prediction:?}");
            }
        }
    }
}

impl GoesOn for FrameEngine {
    fn go_on(&mut self) {
        for mut frame in sequence(3, FRAME, 3) {
            frame.truncate(self.network().input().values());
            self.push(&frame).expect("a frame that fits");
            let prediction = self.predict();
            assert!(matches!(prediction, Ok(_) | Err(EngineError::NotANumber { .. })), "{prediction:?}");
        }
    }
}

/// The engine that the first byte picks, and the bytes of the snapshot.
fn choose<'e, E>(engines: &'e [E], bytes: &[u8]) -> Option<(&'e E, Vec<u8>)> {
    let (&[which, seal], content) = bytes.split_first_chunk()?;
    let seal = seal & 1 == 1 && content.len() >= MIN;
    let content = if seal { sealed(content.to_vec()) } else { content.to_vec() };
    Some((&engines[usize::from(which) % engines.len()], content))
}

/// Snapshots of engines over events.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn snapshot(bytes: &[u8]) -> Verdict {
    check(&ENGINES, bytes)
}

/// Snapshots of frame engines.
///
/// # Panics
/// If a promise is broken.
pub(crate) fn frame_snapshot(bytes: &[u8]) -> Verdict {
    check(&FRAME_ENGINES, bytes)
}

fn check<E: GoesOn>(engines: &[E], bytes: &[u8]) -> Verdict {
    let Some((first, content)) = choose(engines, bytes) else { return Verdict::Refused };
    let mut engine = first.clone();
    if let Err(error) = engine.restore_bytes(&content) {
        let typed = matches!(error, EngineError::Snapshot { .. } | EngineError::SnapshotBytes { .. });
        assert!(typed && error.to_string().contains("expected"), "{error}");
        assert_eq!(engine.to_bytes(), first.to_bytes(), "a refusal changes nothing");
        return Verdict::Refused;
    }
    snapshot_note(&content).expect("what was restored has a note");
    let stored = engine.to_bytes();
    let mut again = first.clone();
    again.restore_bytes(&stored).expect("what was stored can be restored");
    assert_eq!(again.to_bytes(), stored);
    engine.go_on();
    engine.reset();
    engine.go_on();
    Verdict::Accepted
}

/// Snapshots of the engines above, sealed, so that changes in them are read.
pub fn seeds() -> (Vec<Vec<u8>>, Vec<Vec<u8>>) {
    let seed = |(which, bytes): (usize, Vec<u8>)| [&[which as u8, 1][..], &bytes].concat();
    let events = ENGINES.iter().map(Engine::to_bytes).enumerate().map(seed).collect();
    let frames = FRAME_ENGINES.iter().map(FrameEngine::to_bytes).enumerate().map(seed).collect();
    (events, frames)
}
