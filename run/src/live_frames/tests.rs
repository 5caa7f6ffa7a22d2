//! Compares predictions with those of an engine that is given the frames by their definition, every
//! empty one by itself.

use std::sync::Arc;

use proptest::prelude::*;

use super::LiveFrames;
use crate::RunError;
use crate::model::FrameModel;
use meissner_engine::frames::{Convolution, FrameEngine, FrameOptions};
use meissner_engine::{DropReason, EngineError, Event, Outcome, Predictor, Sensor};
use meissner_models::{FrameDescription, draw};

const SENSOR: Sensor = Sensor { width: 4, height: 1 };

/// Time from frame to frame, in microseconds.
const PERIOD_US: i64 = 10_000;

const COUNTS: &str = "channels = 2\nframes = \"event-counts\"\nperiod_us = 10000\nmaximum = 4";
const SLIDING: &str = "channels = 1\nframes = \"signed\"\nspan_us = 15000";

/// A network with a memory over frames of two columns and one row; `lines` are the lines of its
/// `[input]` table.
fn model(lines: &str) -> Arc<FrameModel> {
    let text = format!(
        "[network]\nname = \"n\"\n[input]\nkind = \"image\"\nheight = 1\nwidth = 2\n{lines}\n\
         [[layer]]\nname = \"flat\"\nkind = \"flatten\"\n\
         [[layer]]\nname = \"memory\"\nkind = \"lstm\"\nhidden = 3\nlayer = 0\nweights = \"lstm\"\n\
         [output]\nnames = [\"a\", \"b\", \"c\"]\nunit = \"N\"\n"
    );
    let description = FrameDescription::parse(&text).expect("consistent");
    let weights = draw(&description, 5);
    let model = FrameModel::of(&description, (&weights, "drawn".to_owned()), Convolution::Direct, true);
    model.expect("they fit").into()
}

fn live(model: &Arc<FrameModel>) -> LiveFrames {
    LiveFrames::new(Arc::clone(model), SENSOR, FrameOptions::new()).expect("frames of events")
}

/// The values, as bits, with time and number of frames.
type Predicted = (Vec<u32>, Option<i64>, usize);

fn predict(live: &mut LiveFrames) -> Predicted {
    let prediction = live.predict().expect("finite");
    (bits(prediction.values), prediction.t_us, prediction.nodes)
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

/// The prediction over the frames of `events` that are complete at `now`.
fn by_definition(model: &FrameModel, events: &[Event], now: i64, sliding: bool) -> Predicted {
    let mut engine = FrameEngine::new(Arc::clone(&model.network)).expect("it is small");
    let first = events[0].t_us;
    let ends = (1..).map(|k| first + k * PERIOD_US);
    let ends: Vec<_> = ends.take_while(|&end| if sliding { end < now } else { end <= now }).collect();
    for &end in &ends {
        let mut frame = vec![0.0; if sliding { 2 } else { 4 }];
        let is_inside =
            |t| if sliding { t <= end && end - t <= 15_000 } else { t < end && t >= end - PERIOD_US };
        for event in events.iter().filter(|event| is_inside(event.t_us)) {
            let column = usize::from(event.x).wrapping_sub(1);
            match (sliding, column) {
                (true, 0 | 1) => frame[column] += if event.on { 1.0 } else { -1.0 },
                (false, 0 | 1) => frame[2 * usize::from(event.on) + column] += 0.25,
                _ => (),
            }
        }
        engine.push(&frame).expect("of this length");
    }
    let prediction = engine.predict().expect("finite");
    (bits(prediction.values), ends.last().copied(), ends.len())
}

fn events() -> impl Strategy<Value = Vec<Event>> {
    let gap = prop_oneof![0_i64..4, 0_i64..9_000, Just(PERIOD_US), 0_i64..90_000];
    prop::collection::vec((gap, 0_u16..4, any::<bool>()), 1..40).prop_map(|events| {
        let mut now = -100;
        let at = |(later, x, on)| {
            now += later;
            Event::new(now, x, 0, on)
        };
        events.into_iter().map(at).collect()
    })
}

proptest! {
    #[test]
    fn a_prediction_is_that_of_the_complete_frames_at_any_time_and_after_any_restart(
        events in events(), sliding in any::<bool>(), cut in 0_usize..40, later in 0_i64..50_000,
    ) {
        let model = model(if sliding { SLIDING } else { COUNTS });
        let mut frames = live(&model);
        for (taken, &event) in (1..).zip(&events) {
            prop_assert_eq!(frames.push(&event), Ok(Outcome::Accepted));
            let expected = by_definition(&model, &events[..taken], event.t_us, sliding);
            prop_assert_eq!(predict(&mut frames), expected);
            if taken == cut {
                let state = frames.to_bytes_with(b"here");
                prop_assert_eq!(LiveFrames::note(&state), Ok(b"here".to_vec()));
                frames = live(&model);
                frames.restore_bytes(&state).expect("an equal network");
            }
        }
        let now = events[events.len() - 1].t_us + later;
        frames.advance(now);
        let state = frames.to_bytes_with(&[]);
        frames.restore_bytes(&state).expect("an equal network");
        prop_assert_eq!(predict(&mut frames), by_definition(&model, &events, now, sliding));
        frames.reset();
        prop_assert_eq!(predict(&mut frames), predict(&mut live(&model)));
        frames.push(&events[0]).expect("a frame that fits");
        frames.advance(now);
        prop_assert_eq!(predict(&mut frames), by_definition(&model, &events[..1], now, sliding));
    }
}

#[test]
fn a_longer_silence_than_any_network_needs_ends_its_memory() {
    let model = model(COUNTS);
    let mut frames = live(&model);
    frames.push(&Event::new(0, 1, 0, true)).expect("frames that fit");
    frames.advance(6_001 * PERIOD_US);
    assert_eq!(predict(&mut frames).2, 6_001, "a frame with the event, and the longest silence");
    frames.advance(i64::MAX);
    let start = predict(&mut live(&model));
    let (values, t_us, nodes) = predict(&mut frames);
    assert_eq!((values, nodes), (start.0, 0));
    assert_eq!(t_us, Some(6_001 * PERIOD_US), "the last frame that it took");
}

#[test]
fn dropped_events_are_counted_over_a_restart() {
    let model = model(COUNTS);
    let mut frames = live(&model);
    for (t_us, x) in [(20, 1), (10, 1), (30, 4), (30, 1)] {
        frames.push(&Event::new(t_us, x, 0, true)).expect("frames that fit");
    }
    let state = frames.to_bytes_with(&[]);
    let mut frames = live(&model);
    frames.restore_bytes(&state).expect("an equal network");
    frames.push(&Event::new(29, 1, 0, true)).expect("frames that fit");
    let count = |reason| frames.dropped().into_iter().find(|&(of, _)| of == reason).map(|(_, count)| count);
    assert_eq!((count(DropReason::OutsideSensor), count(DropReason::Late)), (Some(1), Some(2)));
}

#[test]
fn states_of_other_frames_and_damaged_ones_are_refused_and_change_nothing() {
    let (counts, sliding) = (model(COUNTS), model(SLIDING));
    let mut frames = live(&counts);
    frames.push(&Event::new(0, 1, 0, true)).expect("frames that fit");
    frames.advance(3 * PERIOD_US);
    let before = predict(&mut frames);
    let other_sensor = LiveFrames::new(Arc::clone(&counts), Sensor::new(6, 1), FrameOptions::new());
    let states = [
        live(&sliding).to_bytes_with(&[]),
        other_sensor.expect("it is larger").to_bytes_with(&[]),
        FrameEngine::new(Arc::clone(&counts.network)).expect("it is small").to_bytes(),
    ];
    for state in states {
        assert!(matches!(frames.restore_bytes(&state), Err(EngineError::Snapshot { .. })));
    }
    let mut state = frames.to_bytes_with(b"note");
    state[40] ^= 1;
    for state in [&state[..], &state[..30], b""] {
        assert!(frames.restore_bytes(state).is_err());
    }
    assert_eq!(predict(&mut frames), before);
}

#[test]
fn networks_over_other_input_are_refused_by_name() {
    for name in ["slip-lstm", "canf"] {
        let model = FrameModel::named(name, None, Convolution::Direct, false).expect("it is shipped");
        let refused = LiveFrames::new(model.into(), Sensor::new(346, 260), FrameOptions::new()).err();
        let refused = refused.expect("it reads no events");
        assert!(matches!(refused, RunError::OtherNetwork { .. }), "{refused}");
        assert!(refused.to_string().contains(name), "{refused}");
    }
}
