//! Engines that are broken on purpose: each mismatch is found, shrunk, written, and replayed.

use std::sync::Arc;

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameSnapshot};
use meissner_engine::{
    Candidates, Engine, EngineError, Event, EventCounters, GraphRule, Network, Outcome, Prediction,
    Predictor, Reach, Sensor, Snapshot,
};
use meissner_kernels::Neighbour;
use meissner_verify::frame_networks::{Style, network as frame_network};
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape, PoolShape};
use meissner_verify::{
    Difference, Incremental, IncrementalEvents, Mismatch, Step, Stream, Summary, VerifyError, random_frames,
    random_streams, verify, verify_frames, verify_stream,
};

fn network() -> Arc<Network> {
    let block = BlockShape {
        channels: 4,
        conv: ConvolutionShape::Spline([2; 3]),
        input: 0,
        skip: None,
        extras: [true; 4],
    };
    let pool = PoolShape { from: 1, cell: [(1, 4); 2], time: None, mean: true, blocks: vec![block.clone()] };
    let shape = NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k: 3 }, candidates: Candidates::All },
        span_us: 1_000,
        capacity: 40,
        place: None,
        blocks: vec![block],
        pooled: vec![pool],
        from: 1,
        grid: [2, 2],
        dense: vec![2],
        head: None,
        seed: 3,
    };
    Arc::new(shape.build())
}

/// A fault of an engine.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Fault {
    /// An advance of time without an event expires nothing.
    SkippedExpiry,
    /// A row that the last change made dirty keeps its old value, once there are four rows.
    DroppedRow,
    /// A reset forgets nothing.
    IgnoredReset,
    /// Every fifth event is lost.
    LostEvent,
}

struct Broken {
    engine: Engine,
    fault: Fault,
    events: usize,
    /// The rows of the first block as they were before the last event.
    before: Vec<Vec<f32>>,
}

impl Broken {
    fn new(fault: Fault) -> impl Fn(Arc<Network>, Sensor) -> Result<Self, EngineError> {
        move |network, sensor| {
            Ok(Self { engine: Engine::new(network, sensor)?, fault, events: 0, before: Vec::new() })
        }
    }
}

impl Predictor for Broken {
    type Input = Event;

    fn push(&mut self, event: &Event) -> Result<Outcome, EngineError> {
        self.events += 1;
        if self.fault == Fault::LostEvent && self.events.is_multiple_of(5) {
            return Ok(Outcome::Accepted);
        }
        if self.fault == Fault::DroppedRow {
            self.engine.predict()?;
            self.before = self.engine.feature(0, 1);
        }
        Ok(self.engine.push(*event))
    }

    fn advance(&mut self, t_us: i64) {
        if self.fault != Fault::SkippedExpiry {
            self.engine.advance(t_us);
        }
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.engine.predict()
    }

    fn reset(&mut self) {
        if self.fault != Fault::IgnoredReset {
            self.engine.reset();
        }
    }

    fn event_counters(&self) -> EventCounters {
        *self.engine.event_counters()
    }
}

impl Incremental for Broken {
    type Snapshot = Snapshot;

    fn snapshot(&self) -> Snapshot {
        self.engine.snapshot()
    }

    fn restore(&mut self, snapshot: &Snapshot) -> Result<(), EngineError> {
        self.engine.restore(snapshot)
    }

    fn to_bytes(&self) -> Vec<u8> {
        self.engine.to_bytes()
    }

    fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        self.engine.restore_bytes(bytes)
    }
}

impl IncrementalEvents for Broken {
    fn nodes(&self) -> usize {
        self.engine.nodes()
    }

    fn neighbourhood(&self, index: usize) -> Vec<Neighbour> {
        self.engine.neighbourhood(index)
    }

    fn rows(&self, level: usize, feature: usize) -> Vec<Vec<f32>> {
        let mut rows = self.engine.feature(level, feature);
        if (level, feature) == (0, 1) && rows.len() >= 4 && rows.len() == self.before.len() + 1 {
            rows[0].clone_from(&self.before[0]);
        }
        rows
    }
}

fn found(fault: Fault) -> Mismatch {
    let (network, mut summary) = (network(), Summary::default());
    let mut streams = random_streams(&network, None, 200, 1);
    match streams.try_for_each(|stream| verify_stream(&network, stream, Broken::new(fault), &mut summary)) {
        Err(VerifyError::Mismatch(mismatch)) => *mismatch,
        other => panic!("{fault:?}: {other:?}"),
    }
}

#[test]
fn a_broken_engine_is_found_and_its_minimal_stream_is_small_and_replays() {
    for (fault, most) in
        [(Fault::SkippedExpiry, 3), (Fault::DroppedRow, 6), (Fault::IgnoredReset, 3), (Fault::LostEvent, 6)]
    {
        let mismatch = found(fault);
        let steps = &mismatch.stream.steps;
        assert!(steps.len() <= most && mismatch.found_in > most, "{fault:?}: {mismatch:?}");
        let times = steps.iter().filter_map(Step::input).map(|event| event.t_us);
        assert!(times.clone().all(|t| (0..=2_000).contains(&t)), "{fault:?}: {steps:?}");

        let text = mismatch.stream.to_text(&mismatch.to_string());
        let stream = Stream::<Event>::parse(&text).expect("what was written");
        assert_eq!(stream, mismatch.stream, "{text}");
        let mut summary = Summary::default();
        match verify_stream(&network(), stream.clone(), Broken::new(fault), &mut summary) {
            Err(VerifyError::Mismatch(again)) => assert_eq!(again.difference, mismatch.difference),
            other => panic!("{fault:?}: {other:?}"),
        }
        verify_stream(&network(), stream, Engine::new, &mut summary).expect("the engine is not broken");
        assert_eq!(summary.cases, 1);
    }
}

#[test]
fn a_mismatch_names_layer_row_input_and_both_values() {
    let mismatch = found(Fault::DroppedRow);
    let Difference::Row { layer, row, channel, found, expected } = &mismatch.difference else {
        panic!("{mismatch}");
    };
    assert_eq!((layer.as_str(), *row), ("conv1_1", 0));
    let text = mismatch.to_string();
    let input = mismatch.input;
    for part in [
        format!("input {input} "),
        format!("row 0, channel {channel}"),
        format!("{found} ("),
        format!("{expected} ("),
    ] {
        assert!(text.contains(&part), "{part}: {text}");
    }
}

#[test]
fn the_engine_equals_the_batch_on_every_kind_of_stream() {
    let verified = || verify(network(), None, 40, 1).expect("incremental equals batch");
    let summary = verified();
    assert_eq!((summary.cases, summary.refused), (40, 0));
    assert!(summary.inputs > 500 && summary.rows > 10_000, "{summary:?}");
    assert_eq!(verified(), summary, "a run is determined by its seed");
    assert_ne!(verify(network(), None, 40, 2).expect("incremental equals batch"), summary);
}

/// A frame engine that does not see the last value of a frame change.
struct BrokenFrames(FrameEngine);

impl Predictor for BrokenFrames {
    type Input = Vec<f32>;

    fn push(&mut self, frame: &Vec<f32>) -> Result<Outcome, EngineError> {
        let mut frame = frame.clone();
        frame[0] = 0.0;
        self.0.push(&frame).map(|()| Outcome::Accepted)
    }

    fn advance(&mut self, _: i64) {}

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        Predictor::predict(&mut self.0)
    }

    fn reset(&mut self) {
        self.0.reset();
    }

    fn event_counters(&self) -> EventCounters {
        self.0.event_counters()
    }
}

impl Incremental for BrokenFrames {
    type Snapshot = FrameSnapshot;

    fn snapshot(&self) -> FrameSnapshot {
        self.0.snapshot()
    }

    fn restore(&mut self, snapshot: &FrameSnapshot) -> Result<(), EngineError> {
        self.0.restore(snapshot)
    }

    fn to_bytes(&self) -> Vec<u8> {
        self.0.to_bytes()
    }

    fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        self.0.restore_bytes(bytes)
    }
}

fn frames(style: Style) -> Arc<FrameNetwork> {
    let parts = frame_network(style, [1, 4, 4], 3, 1);
    Arc::new(FrameNetwork::new(parts, Convolution::Direct).expect("the layers fit"))
}

#[test]
fn a_broken_frame_engine_is_found_and_its_minimal_sequence_is_one_value_and_replays() {
    let network = frames(Style::Classifier);
    let broken = |network| FrameEngine::new(network).map(BrokenFrames);
    let mut summary = Summary::default();
    let mut streams = random_frames(16, 50, 1);
    let mismatch = match streams.try_for_each(|stream| verify_frames(&network, stream, broken, &mut summary))
    {
        Err(VerifyError::FrameMismatch(mismatch)) => *mismatch,
        other => panic!("{other:?}"),
    };
    let mut one = vec![0.0; 16];
    one[0] = 1.0;
    assert_eq!(mismatch.stream.steps, [Step::Push(one)]);
    let stream = Stream::<Vec<f32>>::parse(&mismatch.stream.to_text(""), 16).expect("what was written");
    assert_eq!(stream, mismatch.stream);
    let mut summary = Summary::default();
    let again = verify_frames(&network, stream.clone(), broken, &mut summary);
    assert!(matches!(again, Err(VerifyError::FrameMismatch(_))), "{again:?}");
    verify_frames(&network, stream, FrameEngine::new, &mut summary).expect("not broken");
    assert_eq!(summary.cases, 1);
}

#[test]
fn frame_engines_that_skip_equal_those_that_compute_everything() {
    for style in [Style::Classifier, Style::ConvLstm { hidden: 2, peepholes: true }, Style::Delays] {
        let (network, mut summary) = (frames(style), Summary::default());
        for stream in random_frames(16, 30, 1) {
            verify_frames(&network, stream, FrameEngine::new, &mut summary).expect("skipping changes no bit");
        }
        assert!(summary.cases == 30 && summary.comparisons > 60, "{summary:?}");
    }
}

#[test]
fn a_text_that_is_no_stream_is_refused_with_its_line() {
    let refused = |text: &str| Stream::<Event>::parse(text).expect_err(text).to_string();
    assert!(refused("# sensor 3x3\n0,1,1\n").contains("line 2: expected an event t,x,y,p"));
    assert!(refused("# sensor 3x3\n0,1,1,2\n").contains("line 2"));
    assert!(refused("# sensor 3x3\n# advance soon\n").contains("a time in microseconds"));
    assert!(refused("0,1,1,1\n").contains("# sensor WxH"));
    assert!(
        Stream::<Vec<f32>>::parse("frame 3=x", 4).is_err()
            && Stream::<Vec<f32>>::parse("frame 4=1", 4).is_err()
    );
}
