//! A frame engine behind the queue.

use std::sync::{Arc, Mutex, PoisonError};
use std::time::Duration;

use meissner_engine::frames::{
    Convolution, Frame, FrameEngine, FrameLayer, FrameLayerKind, FrameNetwork, FrameNetworkParts, FrameShape,
    TimedFrames,
};
use meissner_engine::{EngineError, EventCounters, Outcome, Prediction};
use meissner_kernels::Activation;
use meissner_live::{Live, LiveError, Overload, Predictor};

use crate::fake::{PATIENCE, options};

/// A dense layer over the last three frames of two values.
fn engine() -> TimedFrames {
    let layer = |name: &str, from, kind| FrameLayer { name: name.to_owned(), from, kind };
    let weight = (0..18).map(|i| (i as f32).sin()).collect();
    let dense = FrameLayerKind::Dense { outputs: 3, weight, bias: None, activation: Activation::Tanh };
    let layers = vec![layer("delay", 0, FrameLayerKind::Delay { frames: 3 }), layer("out", 1, dense)];
    let parts =
        FrameNetworkParts { name: "past".to_owned(), input: FrameShape::Vector(2), layers, training: None };
    let network = FrameNetwork::new(parts, Convolution::Direct).expect("the parts fit");
    TimedFrames::new(FrameEngine::new(network).expect("it is small"))
}

fn frame(t_us: i64) -> Frame {
    Frame { t_us, values: vec![(t_us as f32).sin(), (t_us as f32).cos()] }
}

/// Remembers the times of accepted frames, and stands still while a test holds the gate.
struct Gated {
    frames: TimedFrames,
    gate: Arc<Mutex<()>>,
    times: Vec<i64>,
}

impl Gated {
    fn new() -> (Self, Arc<Mutex<()>>) {
        let gate = Arc::new(Mutex::new(()));
        (Self { frames: engine(), gate: Arc::clone(&gate), times: Vec::new() }, gate)
    }
}

impl Predictor for Gated {
    type Input = Frame;

    fn push(&mut self, frame: &Frame) -> Result<Outcome, EngineError> {
        drop(self.gate.lock().unwrap_or_else(PoisonError::into_inner));
        let outcome = self.frames.push(frame)?;
        self.times.extend((outcome == Outcome::Accepted).then_some(frame.t_us));
        Ok(outcome)
    }

    fn advance(&mut self, t_us: i64) {
        self.frames.advance(t_us);
    }

    fn predict(&mut self) -> Result<Prediction<'_>, EngineError> {
        self.frames.predict()
    }

    fn reset(&mut self) {
        self.frames.reset();
    }

    fn event_counters(&self) -> EventCounters {
        self.frames.event_counters()
    }
}

/// The bits of the prediction after frames at `times`, without a queue.
fn directly(times: &[i64]) -> Vec<u32> {
    let mut engine = engine();
    times.iter().for_each(|&t| assert_eq!(engine.push(&frame(t)), Ok(Outcome::Accepted)));
    bits(engine.predict().expect("finite").values)
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

#[test]
fn under_every_policy_the_last_prediction_is_that_of_the_accepted_frames_without_a_queue() {
    for overload in
        [Overload::Block, Overload::DropOldest, Overload::DropNewest, Overload::Thin { stride: 3 }]
    {
        let name = overload.name();
        let (mut input, mut live) =
            Live::spawn(Gated::new().0, options(8, overload)).expect("options are fine");
        for t in (0..500).step_by(10) {
            let frames: Vec<Frame> = (t..t + 10).map(frame).collect();
            input.push_slice(&frames).expect("the worker lives");
            live.predict(Duration::from_micros(50)).expect("finite");
        }
        let last = live.predict(PATIENCE).expect("finite");
        assert!(last.fresh, "{name}");
        let (last, t_us, nodes) = (bits(last.values), last.t_us, last.nodes);
        let counters = live.counters();
        let times = live.close().expect("the worker lives").times;
        assert_eq!((times.len() as u64, nodes), (counters.delivered, times.len()), "{name}");
        assert_eq!(t_us, times.last().copied(), "{name}");
        assert_eq!(counters.offered, counters.delivered + counters.dropped(), "{name}");
        assert_eq!(last, directly(&times), "{name}");
    }
}

#[test]
fn at_the_deadline_comes_the_newest_finished_prediction_of_frames() {
    let (gated, gate) = Gated::new();
    let (mut input, mut live) = Live::spawn(gated, options(64, Overload::Block)).expect("options are fine");
    input.push_slice(&[frame(1), frame(2)]).expect("the worker lives");
    assert_eq!(bits(live.predict(PATIENCE).expect("finite").values), directly(&[1, 2]));
    let held = gate.lock().expect("nobody panicked");
    input.push_slice(&[frame(10), frame(20)]).expect("the worker lives");
    let deadline = Duration::from_millis(5);
    let timely = live.predict(deadline).expect("finite");
    assert!(!timely.fresh && !timely.own && timely.waited >= deadline, "{timely:?}");
    assert_eq!((timely.t_us, timely.behind_events, timely.behind_us), (Some(2), 2, 18));
    assert_eq!(bits(timely.values), directly(&[1, 2]));
    drop(held);
    assert_eq!(bits(live.predict(PATIENCE).expect("finite").values), directly(&[1, 2, 10, 20]));
}

#[test]
fn a_frame_that_does_not_fit_is_an_error_once_and_a_late_one_is_dropped() {
    let (mut input, mut live) = Live::spawn(engine(), options(8, Overload::Block)).expect("options are fine");
    let wrong = Frame { t_us: 2, values: vec![0.0; 3] };
    input.push_slice(&[frame(1), wrong]).expect("the worker lives");
    let error = live.predict(PATIENCE).expect_err("three values");
    assert!(matches!(error, LiveError::Engine(EngineError::FrameLength { found: 3, .. })), "{error}");
    input.push_slice(&[frame(5), frame(4)]).expect("the worker lives");
    input.advance(9);
    assert_eq!(bits(live.predict(PATIENCE).expect("finite").values), directly(&[1, 5]));
    input.push_slice(&[frame(8), frame(9)]).expect("the worker lives");
    assert_eq!(bits(live.predict(PATIENCE).expect("finite").values), directly(&[1, 5, 9]));
}
