//! Compares delivered frames with frames computed from their definitions.

use proptest::prelude::*;

use super::{EmptyFrameLimit, FeedOptions, FeedOutput, FeedState, FrameFeed};
use crate::schedule::Every;
use meissner_engine::{Event, LatePolicy, RestartPolicy, Sensor};
use meissner_models::FrameDescription;

/// A feed of frames of two columns and one row; `lines` are the lines of its `[input]` table. In a
/// silence, four empty frames are delivered.
fn feed(channels: usize, lines: &str, every: Every) -> FrameFeed {
    feed_with(4, channels, lines, every, None)
}

fn feed_with(
    longest_silence: u64,
    channels: usize,
    lines: &str,
    every: Every,
    state: Option<&FeedState>,
) -> FrameFeed {
    let text = format!(
        "[network]\nname = \"n\"\n[input]\nkind = \"image\"\nchannels = {channels}\nheight = 1\nwidth = 2\n\
         {lines}\n[[layer]]\nname = \"l\"\nkind = \"sum\"\n[output]\nnames = {:?}\nunit = \"N\"\n",
        ["a", "b"].get(..channels).expect("at most two")
    );
    let description = FrameDescription::parse(&text).expect("consistent");
    FrameFeed::new(&description, Sensor::new(4, 1), options(longest_silence, every), state)
        .expect("the crop fits")
        .expect("frames of events")
}

fn options(longest_silence: u64, every: Every) -> FeedOptions {
    let silence = EmptyFrameLimit::new(Some(longest_silence), 0);
    FeedOptions { late: LatePolicy::Clamp, restart: RestartPolicy::Reset, every, silence, keeps: true }
}

/// The delivered items for events at (time, column), as text.
fn told(feed: &mut FrameFeed, events: &[(i64, u16)]) -> Vec<String> {
    let mut out = vec![];
    let mut tell = |output: FeedOutput<'_>| {
        out.push(match output {
            FeedOutput::Frame { values, t_us, events } => format!("{t_us}: {values:?} {events}"),
            FeedOutput::LeftOut { count, resets } => {
                format!("{count} left out{}", if resets { ", reset" } else { "" })
            }
            FeedOutput::Restart => "restart".to_owned(),
        });
        Ok::<_, ()>(())
    };
    for &(t_us, x) in events {
        feed.push(Event::new(t_us, x, 0, true), &mut tell).expect("the sink takes everything");
    }
    feed.finish(&mut tell).expect("the sink takes everything");
    out
}

const COUNTS: &str = "frames = \"event-counts\"\nperiod_us = 10\nmaximum = 4";
const SLIDING: &str = "frames = \"signed\"\nspan_us = 15";

#[test]
fn a_window_comes_with_its_end_empty_windows_one_by_one_and_the_open_window_at_last() {
    let mut feed = feed(2, COUNTS, Every::Events(1));
    let out = told(&mut feed, &[(5, 1), (6, 1), (8, 0), (60, 2)]);
    let empty = [25, 35, 45, 55].map(|t_us| format!("{t_us}: [0.0, 0.0, 0.0, 0.0] 0"));
    assert_eq!(out[0], "15: [0.0, 0.0, 0.5, 0.0] 2");
    assert_eq!((&out[1..5], out[5..].concat().as_str()), (&empty[..], "65: [0.0, 0.0, 0.0, 0.25] 1"));
    assert_eq!((feed.outside_crop(), feed.period_us()), (1, Some(10)));
}

#[test]
fn a_sliding_window_is_read_on_its_grid_and_the_rest_of_a_long_silence_is_left_out() {
    let mut feed = feed(1, SLIDING, Every::StreamUs(10));
    let out = told(&mut feed, &[(0, 1), (10, 2), (101, 1)]);
    assert_eq!(out[..2], ["10: [1.0, 1.0] 2", "20: [0.0, 1.0] 1"]);
    assert_eq!(out[2..6], [30, 40, 50, 60].map(|t_us| format!("{t_us}: [0.0, 0.0] 0")));
    assert_eq!(out[6..], ["4 left out, reset", "110: [1.0, 0.0] 1"]);
}

#[test]
fn a_sliding_window_is_read_after_events_or_at_the_end() {
    let events = [(0, 1), (10, 2), (26, 2), (27, 2)];
    assert_eq!(told(&mut feed(1, SLIDING, Every::Events(3)), &events), ["26: [0.0, 1.0] 1"]);
    assert_eq!(told(&mut feed(1, SLIDING, Every::End), &events), ["27: [0.0, 2.0] 2"]);
}

#[test]
fn a_late_event_enters_at_the_newest_time_where_that_is_asked_for() {
    let mut feed = feed(2, COUNTS, Every::End);
    let out = told(&mut feed, &[(0, 1), (12, 1), (3, 1)]);
    assert_eq!(out, ["10: [0.0, 0.0, 0.25, 0.0] 1", "20: [0.0, 0.0, 0.5, 0.0] 2"]);
    assert_eq!(feed.counters().clamped, 1);
}

#[test]
fn silences_of_any_length_are_counted_to_the_clocks_end() {
    let mut feed = feed(1, SLIDING, Every::StreamUs(1));
    // The second event confirms the first.
    let out = told(&mut feed, &[(0, 1), (i64::MAX, 1), (i64::MAX, 1)]);
    assert_eq!(out[15], "16: [0.0, 0.0] 0");
    assert_eq!(out[19], format!("{} left out, reset", i64::MAX - 20));
    assert_eq!(out.len(), 21, "{out:?}");
}

#[test]
fn nothing_has_no_frames() {
    assert!(told(&mut feed(2, COUNTS, Every::End), &[]).is_empty());
    assert!(told(&mut feed(1, SLIDING, Every::StreamUs(5)), &[]).is_empty());
}

/// Times of frames with their values.
fn all_frames(feed: &mut FrameFeed, events: &[(i64, u16, bool)]) -> Vec<(i64, Vec<f32>)> {
    let mut out = vec![];
    let mut tell = |output: FeedOutput<'_>| {
        match output {
            FeedOutput::Frame { values, t_us, .. } => out.push((t_us, values.to_vec())),
            other => unreachable!("{other:?}: every frame is wanted, and time goes on"),
        }
        Ok::<_, ()>(())
    };
    for &(t_us, x, on) in events {
        feed.push(Event::new(t_us, x, 0, on), &mut tell).expect("the sink takes everything");
    }
    feed.finish(&mut tell).expect("the sink takes everything");
    out
}

/// The frames' two columns are the middle two of the sensor's four.
fn column(x: u16) -> Option<usize> {
    (1..3).contains(&x).then(|| usize::from(x) - 1)
}

fn events() -> impl Strategy<Value = Vec<(i64, u16, bool)>> {
    let event = (prop_oneof![0_i64..4, 0_i64..90], 0_u16..4, any::<bool>());
    prop::collection::vec(event, 1..40).prop_map(|events| {
        let mut now = -100;
        let at = |(later, x, on)| {
            now += later;
            (now, x, on)
        };
        events.into_iter().map(at).collect()
    })
}

proptest! {
    #[test]
    fn a_sliding_window_shows_the_events_of_its_span_at_every_time_of_the_grid(
        events in events(), span in 1_i64..60, period in 1_i64..30,
    ) {
        let (first, last) = (events[0].0, events[events.len() - 1].0);
        let due = (1..).map(|k| first + k * period);
        // Up to the first time that covers the last event.
        let due: Vec<i64> = due.take(((last - first + period - 1) / period).max(1) as usize).collect();
        let expected: Vec<(i64, Vec<f32>)> = due.into_iter().map(|due| {
            let mut frame = vec![0.0; 2];
            for &(_, x, on) in events.iter().filter(|e| e.0 <= due && due - e.0 <= span) {
                if let Some(x) = column(x) {
                    frame[x] += if on { 1.0 } else { -1.0 };
                }
            }
            (due, frame)
        }).collect();
        let lines = format!("frames = \"signed\"\nspan_us = {span}");
        let found = all_frames(&mut feed_with(u64::MAX, 1, &lines, Every::StreamUs(period), None), &events);
        prop_assert_eq!(found, expected);
    }

    #[test]
    fn every_event_is_counted_in_its_window(events in events(), period in 1_i64..30) {
        let (first, last) = (events[0].0, events[events.len() - 1].0);
        let mut expected: Vec<(i64, Vec<f32>)> =
            (0..=(last - first) / period).map(|k| (first + (k + 1) * period, vec![0.0; 4])).collect();
        for &(t, x, on) in &events {
            if let Some(x) = column(x) {
                expected[((t - first) / period) as usize].1[2 * usize::from(on) + x] += 0.25;
            }
        }
        let lines = format!("frames = \"event-counts\"\nperiod_us = {period}\nmaximum = 4");
        let found = all_frames(&mut feed_with(u64::MAX, 2, &lines, Every::End, None), &events);
        prop_assert_eq!(found, expected);
    }
}

#[test]
fn a_restart_of_the_clock_forgets_the_open_window_and_is_told_before_the_frames_of_the_new_clock() {
    for (channels, lines) in [(2, COUNTS), (1, SLIDING)] {
        let mut feed = feed(channels, lines, Every::StreamUs(10));
        let old = [(5_000_000, 1), (5_000_006, 1)];
        let new: Vec<_> = (0..20).map(|i| (2 * i, 1)).collect();
        let out = told(&mut feed, &[&old[..], &new].concat());
        assert_eq!(out[0], "restart", "{out:?}");
        let mut fresh = self::feed(channels, lines, Every::StreamUs(10));
        assert_eq!(out[1..], told(&mut fresh, &new), "{lines}");
        assert_eq!((feed.counters().restarts, feed.counters().accepted, feed.counters().late), (1, 22, 0));
    }
}

#[test]
fn a_restart_of_the_clock_after_a_resumed_state_begins_windows_of_the_new_clock() {
    let new: Vec<_> = (0..20).map(|i| (2 * i, 1)).collect();
    for (channels, lines) in [(2, COUNTS), (1, SLIDING)] {
        let every = Every::StreamUs(10);
        let mut first = feed(channels, lines, every);
        told(&mut first, &[(5_000_000, 1), (5_000_006, 3)]);
        let mut resumed = feed_with(4, channels, lines, every, first.state().as_ref());
        let out = told(&mut resumed, &new);
        assert_eq!(out[0], "restart", "{out:?}");
        assert_eq!(out[1..], told(&mut feed(channels, lines, every), &new), "{lines}");
        assert_eq!((resumed.counters().restarts, resumed.outside_crop()), (1, 0));
    }
}

#[test]
fn a_feed_that_begins_at_a_time_has_frames_before_its_first_event() {
    let state = FeedState::beginning(-20);
    let mut feed = feed_with(u64::MAX, 2, COUNTS, Every::End, Some(&state));
    let out = told(&mut feed, &[(0, 1)]);
    assert_eq!(out[..2], [-10, 0].map(|t_us| format!("{t_us}: [0.0, 0.0, 0.0, 0.0] 0")));
    assert_eq!(out[2..], ["10: [0.0, 0.0, 0.25, 0.0] 1"]);
}

#[test]
fn frames_beyond_the_longest_silence_are_left_out_and_the_first_of_them_resets() {
    let mut silence = EmptyFrameLimit::new(Some(5), 0);
    let taken = [3, 2, 1, 4, u64::MAX].map(|count| silence.take(count));
    assert_eq!(taken, [(3, 0, false), (2, 0, false), (0, 1, true), (0, 4, false), (0, u64::MAX, false)]);
    silence.end();
    assert_eq!((silence.take(6), silence.frames()), ((5, 1, true), 6));
}

mod live {
    //! Predictions compared with those of an engine that gets each frame by its definition.

    use std::sync::Arc;

    use proptest::prelude::*;

    use crate::RunError;
    use crate::live_frames::LiveFrames;
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
        let count =
            |reason| frames.dropped().into_iter().find(|&(of, _)| of == reason).map(|(_, count)| count);
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
}
