//! Judging a soak.

use std::time::Duration;

use meissner_run::latency::Latency;

use super::report::{Calls, Checkpoint, Part, Report, judged, ratios};

/// A run of `count` checkpoints that keeps every promise.
fn report(count: u64) -> Report {
    let row = |i: u64| Checkpoint {
        events: 100 * (i + 1),
        t_us: Some(5),
        nodes: 7,
        compared: 9,
        equal: true,
        bits: vec!["1".to_owned()],
        latency_us: Calls { push: None, predict: None },
        live_bytes: Some(1_000_000 + i),
        // What the allocator keeps is not judged.
        resident_bytes: Some(1_000_000 * (i + 1)),
        seconds: 0.0,
    };
    let part = |us| {
        let mut latencies = Calls::<Latency>::default();
        latencies.push.record(Duration::from_micros(us));
        let mut part = Part::default();
        part.add(&row(0), &latencies);
        part.report()
    };
    let (first, last) = (part(10), part(30));
    Report {
        events: 100 * count,
        accepted: 100 * count,
        ratio: ratios(&first, &last),
        first,
        last,
        checkpoints: (0..count).map(row).collect(),
        ..Report::default()
    }
}

#[test]
fn a_run_that_keeps_every_promise_breaks_none() {
    let judged = judged(report(40), 10);
    assert!(judged.broken.is_empty(), "{:?}", judged.broken);
    assert!(judged.memory.is_some_and(|memory| memory.growth_percent < 0.1));
}

#[test]
fn other_bits_at_a_single_checkpoint_are_told_with_their_place() {
    let mut report = report(40);
    report.checkpoints[16].equal = false;
    let broken = judged(report, 10).broken;
    assert_eq!(broken.len(), 1);
    assert!(broken[0].contains("over 9 events after event 1,700"), "{broken:?}");
}

#[test]
fn other_bits_after_the_return_to_a_state_are_told() {
    let mut report = report(3);
    report.disturbances.returns_that_differ = 2;
    let broken = judged(report, 10).broken;
    assert!(broken.len() == 1 && broken[0].contains("2 times"), "{broken:?}");
}

#[test]
fn memory_that_grows_after_warm_up_is_told_and_memory_of_the_warm_up_is_not() {
    let grown = |from: usize, percent| {
        let mut report = report(40);
        report.checkpoints[from..].iter_mut().for_each(|row| row.live_bytes = Some(1_120_000));
        judged(report, percent).broken
    };
    assert!(grown(7, 10).is_empty());
    assert!(grown(20, 10)[0].contains("at most 10 % after warm-up, found 12.0 %"), "{:?}", grown(20, 10));
    assert!(grown(20, 15).is_empty());
}

#[test]
fn the_largest_batch_belongs_to_the_warm_up_where_it_is_in_the_first_half() {
    let grown = |largest: usize| {
        let mut report = report(40);
        report.checkpoints[largest].compared = 90;
        report.checkpoints[largest..].iter_mut().for_each(|row| row.live_bytes = Some(2_000_000));
        judged(report, 10).broken.len()
    };
    assert_eq!([0, 8, 19, 20, 30].map(grown), [0, 0, 0, 1, 1]);
}

#[test]
fn memory_is_not_judged_over_few_checkpoints_or_where_it_is_not_known() {
    assert_eq!(judged(report(19), 0).memory, None);
    let mut unknown = report(40);
    unknown.checkpoints.iter_mut().for_each(|row| row.live_bytes = None);
    assert_eq!(judged(unknown, 0).memory, None);
}

#[test]
fn latencies_are_ratios_and_break_nothing() {
    let judged = judged(report(40), 10);
    let ratio = judged.ratio;
    assert!(ratio.push.is_some_and(|push| (push.p50 - 3.0).abs() < 0.01), "{ratio:?}");
    assert_eq!(ratio.predict, None);
    assert!(judged.broken.is_empty());
}
