use super::*;
use crate::DropReason;

/// Two columns, one row, windows of 10 us, a maximum of 4.
fn small(start_us: Option<i64>) -> ConsecutiveFrames {
    let options = Consecutive { crop: Crop::new(1, 0, 2, 1), period_us: 10, start_us };
    ConsecutiveFrames::counts(Sensor::new(4, 1), options, 4.0).expect("admissible")
}

/// What comes out, in words: begin, values, touched, changed; or begin and number of empty frames.
fn told(completed: Completed<'_>) -> String {
    match completed {
        Completed::Frame(f) => {
            format!(
                "{}: {:?} {:?} touched {:?} changed {:?}",
                f.start_us, f.values, f.events, f.touched, f.changed
            )
        }
        Completed::Empty(run) => {
            format!("{}: {} empty, changed {:?}", run.start_us, run.count, run.changed)
        }
    }
}

fn push(counts: &mut ConsecutiveFrames, t_us: i64, x: u16, on: bool) -> Vec<String> {
    let mut out = vec![];
    counts.push(Event::new(t_us, x, 0, on), |completed| out.push(told(completed)));
    out
}

fn advance(counts: &mut ConsecutiveFrames, t_us: i64) -> Vec<String> {
    let mut out = vec![];
    counts.advance(t_us, |completed| out.push(told(completed)));
    out
}

#[test]
fn negative_events_count_in_channel_0_and_positive_ones_in_channel_1() {
    let mut counts = small(None);
    for (t, x, on) in [(100, 1, false), (101, 2, true), (109, 2, true)] {
        assert!(push(&mut counts, t, x, on).is_empty());
    }
    assert_eq!(
        push(&mut counts, 110, 1, true),
        ["100: [0.25, 0.0, 0.0, 0.5] [1, 2] touched [0, 1] changed [0, 1]"]
    );
    assert_eq!(counts.shape(), [2, 1, 2]);
}

#[test]
fn a_frame_tells_what_differs_from_the_frame_before() {
    let mut counts = small(None);
    push(&mut counts, 0, 1, true);
    push(&mut counts, 0, 2, true);
    push(&mut counts, 10, 1, true);
    assert_eq!(advance(&mut counts, 20), ["10: [0.0, 0.0, 0.25, 0.0] [0, 1] touched [0] changed [1]"]);
    assert_eq!(advance(&mut counts, 40), ["20: 2 empty, changed [0]"]);
    assert_eq!(advance(&mut counts, 50), ["40: 1 empty, changed []"]);
}

#[test]
fn a_silence_of_a_thousand_years_is_one_run() {
    let mut counts = small(None);
    push(&mut counts, 5, 1, true);
    let late = 5 + 31_556_952_000_000_000;
    assert_eq!(
        push(&mut counts, late, 1, true),
        [
            "5: [0.0, 0.0, 0.25, 0.0] [0, 1] touched [0] changed [0]",
            "15: 3155695199999999 empty, changed [0]"
        ]
    );
}

#[test]
fn times_at_both_ends_of_the_clock_do_not_overflow() {
    let mut counts = small(None);
    push(&mut counts, i64::MAX - 1, 1, true);
    assert!(advance(&mut counts, i64::MAX).is_empty());
    assert_eq!(counts.open().expect("time runs").start_us, i64::MAX - 1);
    let mut counts = small(Some(i64::MIN));
    let far = counts.push(Event::new(0, 1, 0, true), |_| unreachable!("time stands"));
    assert_eq!(far, Outcome::Dropped(DropReason::TimeOutOfRange));
    assert_eq!(push(&mut counts, -1, 1, true).len(), 1);
}

#[test]
fn events_before_a_given_start_are_late() {
    let mut counts = small(Some(100));
    push(&mut counts, 99, 1, true);
    assert_eq!(counts.counters().late, 1);
    let mut at_once = small(Some(100));
    push(&mut at_once, 100, 1, true);
    assert_eq!((at_once.counters().late, at_once.counters().accepted), (0, 1));
    assert_eq!(advance(&mut counts, 120), ["100: 2 empty, changed []"]);
    push(&mut counts, 119, 1, true);
    assert_eq!(counts.counters().late, 2);
    assert!(counts.open().expect("time runs").is_empty());
}

#[test]
fn an_event_outside_the_crop_moves_time_on_and_is_not_counted() {
    let mut counts = small(None);
    push(&mut counts, 0, 0, true);
    assert_eq!(push(&mut counts, 10, 3, true), ["0: 1 empty, changed []"]);
    push(&mut counts, 90, 4, true);
    assert_eq!((counts.outside_crop(), counts.counters().outside_sensor), (2, 1));
    assert_eq!(counts.open().expect("time runs").start_us, 10);
}

#[test]
fn after_a_reset_everything_is_as_at_first() {
    let mut counts = small(None);
    push(&mut counts, 0, 1, true);
    push(&mut counts, 10, 2, true);
    counts.reset();
    assert!(counts.open().is_none() && advance(&mut counts, 1_000).is_empty());
    push(&mut counts, 7, 1, false);
    assert_eq!(advance(&mut counts, 17), ["7: [0.25, 0.0, 0.0, 0.0] [1, 0] touched [0] changed [0]"]);
    assert_eq!(counts.counters().pushed, 3);
}

#[test]
fn options_out_of_range_are_refused() {
    let sensor = Sensor::new(4, 1);
    let options = Consecutive::new(Crop::whole(sensor));
    for maximum in [0.0, 0.5, -1.0, f32::NAN, f32::INFINITY] {
        assert!(ConsecutiveFrames::counts(sensor, options, maximum).is_err(), "{maximum}");
    }
    let error = ConsecutiveFrames::counts(sensor, Consecutive { period_us: 0, ..options }, 1.0);
    assert_eq!(error.expect_err("no period").to_string(), "period: expected at least 1 us, found 0");
}

fn frame(rule: SignedRule) -> (Vec<f32>, Vec<u32>) {
    let sensor = Sensor::new(3, 1);
    let mut signed =
        ConsecutiveFrames::signed(sensor, Consecutive::new(Crop::whole(sensor)), rule).expect("admissible");
    let events = [(0, 0, true), (1, 0, true), (2, 0, false), (3, 1, true), (4, 1, false), (9_999, 2, false)];
    for (t, x, on) in events {
        signed.push(Event::new(t, x, 0, on), |_| unreachable!("the window is open"));
    }
    let mut out = (vec![], vec![]);
    signed.advance(10_000, |completed| {
        let Completed::Frame(frame) = completed else { unreachable!("it has events") };
        assert_eq!((frame.shape, frame.events, frame.touched.len()), ([1, 1, 3], [3, 3], 3));
        out = (frame.values.to_vec(), frame.changed.to_vec());
    });
    out
}

#[test]
fn a_sum_adds_polarities_and_may_come_back_to_zero() {
    assert_eq!(frame(SignedRule::Sum), (vec![1.0, 0.0, -1.0], vec![0, 2]));
}

#[test]
fn the_latest_polarity_stands() {
    assert_eq!(frame(SignedRule::Latest), (vec![-1.0, -1.0, -1.0], vec![0, 1, 2]));
}
