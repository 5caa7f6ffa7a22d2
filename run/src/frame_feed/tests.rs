//! Compares delivered frames with frames computed from their definitions.

use proptest::prelude::*;

use super::{FeedOutput, FrameFeed};
use crate::empty_frames::EmptyFrameLimit;
use crate::schedule::Every;
use meissner_engine::{Event, LatePolicy, RestartPolicy, Sensor};
use meissner_models::FrameDescription;

/// A feed of frames of two columns and one row; `lines` are the lines of its `[input]` table. Of a
/// silence, four empty frames come.
fn feed(channels: usize, lines: &str, every: Every) -> FrameFeed {
    feed_with(4, channels, lines, every)
}

fn feed_with(longest_silence: u64, channels: usize, lines: &str, every: Every) -> FrameFeed {
    let text = format!(
        "[network]\nname = \"n\"\n[input]\nkind = \"image\"\nchannels = {channels}\nheight = 1\nwidth = 2\n\
         {lines}\n[[layer]]\nname = \"l\"\nkind = \"sum\"\n[output]\nnames = {:?}\nunit = \"N\"\n",
        ["a", "b"].get(..channels).expect("at most two")
    );
    let description = FrameDescription::parse(&text).expect("consistent");
    let feed = FrameFeed::new(
        &description,
        Sensor::new(4, 1),
        (LatePolicy::Clamp, RestartPolicy::Reset),
        every,
        EmptyFrameLimit::new(Some(longest_silence), 0),
        None,
    );
    feed.expect("the crop fits").expect("frames of events")
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
        let found = all_frames(&mut feed_with(u64::MAX, 1, &lines, Every::StreamUs(period)), &events);
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
        let found = all_frames(&mut feed_with(u64::MAX, 2, &lines, Every::End), &events);
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
