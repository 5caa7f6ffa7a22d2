//! Judgements of stress cases and of soaks; streams of both.

use std::sync::Arc;

use meissner_engine::{Admission, Candidates, DropReason, Event, GraphRule, LatePolicy, Reach};
use meissner_kernels::random::Random;
use meissner_run::latency::Quantiles;

use crate::error::VerifyError;
use crate::networks::{BlockShape, ConvolutionShape, NetworkShape};
use crate::random_stream::random_stream;
use crate::soak::endless::{Deck, Disturbance, Endless, Recording};
use crate::soak::report::{Calls, Checkpoint, Disturbances, Report, judged};
use crate::stream::Step;
use crate::stress::{CaseResult, Errors, Expect, events, weights};

fn result(got: &[f32], want: &[f32]) -> CaseResult {
    let mut result = CaseResult::default();
    result.compare(&Ok(got.to_vec()), &Ok(want.to_vec()));
    result
}

#[test]
fn other_bits_break_a_promise() {
    assert!(result(&[1.0], &[1.0]).judge(Expect::Finite, 1.0).broken.is_empty());
    assert_eq!(result(&[0.0], &[-0.0]).judge(Expect::Finite, 1.0).broken.len(), 1);
    assert_eq!(result(&[1.0], &[1.0, 1.0]).judge(Expect::Finite, 1.0).broken.len(), 1);
}

#[test]
fn infinite_values_must_be_expected() {
    let infinite = || result(&[f32::INFINITY], &[f32::INFINITY]);
    assert_eq!(infinite().judge(Expect::Finite, 1.0).broken.len(), 1);
    assert!(infinite().judge(Expect::Overflow, 1.0).broken.is_empty());
    assert_eq!(result(&[1.0], &[1.0]).judge(Expect::Overflow, 1.0).broken.len(), 1);
}

#[test]
fn a_predicted_nan_breaks_a_promise_even_where_an_overflow_is_expected() {
    assert_eq!(result(&[f32::NAN], &[f32::NAN]).judge(Expect::Overflow, 1.0).broken.len(), 2);
}

#[test]
fn an_error_beyond_the_bound_breaks_a_promise() {
    let mut result = result(&[1.0], &[1.0]);
    result.prediction = Some(Errors { absolute: 1e-3, relative: 1e-3, rms: 1e-3 });
    assert!(result.clone().judge(Expect::Finite, 1e-2).broken.is_empty());
    assert_eq!(result.judge(Expect::Finite, 1e-4).broken.len(), 1);
}

#[test]
fn streams_are_in_order_and_on_their_sensor() {
    for shape in events::SHAPES {
        let events = events::events(shape, 640);
        assert!(events.is_sorted_by_key(|e| e.t_us), "{}", shape.name);
        assert!(events.iter().all(|e| shape.sensor.contains(e.x, e.y)), "{}", shape.name);
    }
}

#[test]
fn every_batch_norm_of_the_shipped_networks_is_found() {
    for name in weights::NETWORKS {
        let shipped = events::weights(name).expect("it is shipped");
        let (network, norms) = weights::with_variance(name, &shipped, 0.0).expect("it fits");
        let blocks: usize = (0..network.levels()).map(|l| network.level(l).blocks.len()).sum();
        assert_eq!(norms.len(), blocks, "{name}");
    }
}

fn disturbances(seed: u64, events: u64) -> Vec<(u64, Disturbance)> {
    let mut deck = Deck::new(Random::new(seed), 100);
    (0..events).filter_map(|event| deck.after_an_event().map(|disturbance| (event, disturbance))).collect()
}

#[test]
fn they_come_as_often_as_asked_for_and_are_determined_by_the_seed() {
    let all = disturbances(7, 100_000);
    assert!((900..1_100).contains(&all.len()), "{}", all.len());
    assert_eq!(all, disturbances(7, 100_000));
    assert_ne!(all, disturbances(8, 100_000));
}

#[test]
fn each_deck_holds_each_kind() {
    for deck in disturbances(1, 100_000).chunks_exact(8) {
        let count = |is: fn(&Disturbance) -> bool| deck.iter().filter(|(_, card)| is(card)).count();
        assert_eq!(count(|card| matches!(card, Disturbance::Silence)), 2);
        assert_eq!(count(|card| matches!(card, Disturbance::Advance)), 1);
        assert_eq!(count(|card| matches!(card, Disturbance::Bytes)), 2);
        assert_eq!(count(|card| matches!(card, Disturbance::Snapshot { detour: 1.. })), 2);
        assert_eq!(count(|card| matches!(card, Disturbance::Reset)), 1);
    }
}

#[test]
fn one_at_every_event_is_possible() {
    let mut deck = Deck::new(Random::new(1), 1);
    assert!((0..100).all(|_| deck.after_an_event().is_some()));
}

fn recording(times: &[i64]) -> Recording {
    let events = times.iter().map(|&t| Event::new(t, 0, 0, true)).collect();
    Recording::new(String::new(), events).expect("there are events")
}

fn times(stream: &mut Endless, count: usize) -> Vec<i64> {
    (0..count).map(|_| stream.next().t_us).collect()
}

/// A stream over `recordings` whose first three events have these distances.
fn beginning_with(distances: [i64; 2], recordings: Vec<Recording>) -> Endless {
    let recordings: Arc<[Recording]> = recordings.into();
    let mut streams = (0..).map(|seed| Endless::new(Arc::clone(&recordings), Random::new(seed)));
    let begins = |stream: &Endless| {
        let t = times(&mut stream.clone(), 3);
        [t[1] - t[0], t[2] - t[1]] == distances
    };
    streams.find(begins).expect("one of them does")
}

#[test]
fn streams_begin_with_any_event_at_any_time_and_are_determined_by_the_seed() {
    let events = |at: u16| Event::new(1_000 * i64::from(at), at, 0, true);
    let part = |from, to| Recording::new(String::new(), (from..to).map(events).collect()).expect("events");
    let recordings: Arc<[Recording]> = [part(0, 5), part(5, 7)].into();
    let first = |seed| Endless::new(Arc::clone(&recordings), Random::new(seed)).next();
    let firsts: Vec<Event> = (0..200).map(first).collect();
    assert!((0..7).all(|x| firsts.iter().any(|event| event.x == x)), "{firsts:?}");
    assert!(firsts.iter().all(|event| (0..1 << 45).contains(&event.t_us)));
    assert!(firsts.iter().any(|event| event.t_us > 1 << 44));
    assert_eq!(firsts, (0..200).map(first).collect::<Vec<_>>());
}

#[test]
fn recordings_follow_one_another_in_a_loop_with_silences_between_them() {
    let mut stream = beginning_with([10, 20], vec![recording(&[1_000, 1_010, 1_030]), recording(&[-5, 0])]);
    let t = times(&mut stream, 8);
    assert!(t[3] > t[2] && t[5] > t[4], "{t:?}");
    assert_eq!((t[4] - t[3], t[6] - t[5], t[7] - t[5]), (5, 10, 30));
    assert_eq!(stream.rounds(), 2);
}

#[test]
fn a_silence_makes_what_follows_later_and_its_middle_is_in_it() {
    let mut stream = Endless::new([recording(&[0, 10, 20])].into(), Random::new(1));
    for _ in 0..1_000 {
        let before = stream.next().t_us;
        let middle = stream.fall_silent();
        let after = stream.clone().next().t_us;
        assert!(before <= middle && middle <= after, "{before} {middle} {after}");
        assert!(after - before < (1 << 30) + 20, "{before} {after}");
    }
}

#[test]
fn a_stamp_that_steps_back_does_so_in_every_round() {
    let mut stream = beginning_with([50, -10], vec![recording(&[0, 50, 40])]);
    let t = times(&mut stream, 6);
    assert_eq!((t[4] - t[3], t[5] - t[3]), (50, 40));
    assert!(t[3] > t[1], "{t:?}");
}

#[test]
fn a_recording_without_events_is_refused() {
    assert!(
        matches!(Recording::new("empty".to_owned(), Vec::new()), Err(VerifyError::Empty(name)) if name == "empty")
    );
}

/// A run of `count` checkpoints that keeps every promise.
fn report(count: u64) -> Report {
    // Medians of the first and last tenth: 10 and 30, also if one call of each was interrupted.
    let us = |i: u64| match i {
        0 => 9_000.0,
        _ if i < count / 2 => 10.0,
        _ => 30.0,
    };
    let row = |i: u64| Checkpoint {
        events: 100 * (i + 1),
        accepted: 99,
        rounds: 2,
        disturbances: Disturbances { resets: 3, ..Disturbances::default() },
        t_us: Some(5),
        nodes: 7,
        compared: 9,
        equal: true,
        bits: vec!["1".to_owned()],
        latency_us: Calls {
            push: Some(Quantiles { p50: us(i), p90: us(i), p99: us(i), p999: us(i), max: us(i) }),
            predict: None,
        },
        live_bytes: Some(1_000_000 + i),
        // Memory that the allocator keeps is not judged.
        resident_bytes: Some(1_000_000 * (i + 1)),
        seconds: (i + 1) as f64,
    };
    Report::default().with_checkpoints((0..count).map(row).collect())
}

#[test]
fn counts_are_sums_over_checkpoints() {
    let report = report(40);
    assert_eq!((report.events, report.accepted, report.rounds), (4_000, 40 * 99, 80));
    assert_eq!((report.disturbances.resets, report.disturbances.silences), (120, 0));
    assert_eq!((report.seconds, report.first.resident_bytes), (40.0, Some(3_000_000)));
    assert_eq!(report.first.latency_us.push.map(|push| (push.p50, push.max)), Some((10.0, 9_000.0)));
    assert_eq!(Report::default().with_checkpoints(Vec::new()).events, 0);
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

#[test]
fn streams_hold_every_difficulty_and_are_determined_by_their_seed() {
    let graph = GraphRule { reach: Reach::Knn { k: 4 }, candidates: Candidates::All };
    let block = BlockShape {
        channels: 2,
        conv: ConvolutionShape::Spline([2; 3]),
        input: 0,
        skip: None,
        extras: [true; 4],
    };
    let network = NetworkShape {
        graph,
        span_us: 1_000,
        capacity: 500,
        place: None,
        blocks: vec![block],
        pooled: vec![],
        from: 1,
        grid: [1, 1],
        dense: vec![1],
        head: None,
        seed: 1,
    }
    .build();
    let (mut sides, mut evicted, mut late, mut outside) = (Vec::new(), 0, 0, 0);
    let mut kinds = [0; 6];
    for seed in 0..300 {
        let stream = random_stream(&network, None, &mut Random::new(seed));
        assert_eq!(stream.steps, random_stream(&network, None, &mut Random::new(seed)).steps);
        let sensor = stream.sensor.expect("streams of events have a sensor");
        sides.push(sensor.width);
        let mut admission = Admission::new(sensor, LatePolicy::Drop);
        for step in &stream.steps {
            let kind = match step {
                Step::Push(event) => {
                    match admission.admit(*event) {
                        Err(DropReason::OutsideSensor) => outside += 1,
                        Err(DropReason::Late) => late += 1,
                        _ => {}
                    }
                    0
                }
                Step::Advance(_) => 1,
                Step::Predict => 2,
                Step::Reset => 3,
                Step::Snapshot => 4,
                Step::Bytes => 5,
            };
            kinds[kind] += 1;
        }
        evicted += usize::from(stream.capacity.is_some_and(|capacity| capacity < stream.steps.len() / 4));
    }
    assert!(kinds.iter().all(|&count| count > 50), "{kinds:?}");
    assert!(evicted > 50 && late > 50 && outside > 50, "{evicted} {late} {outside}");
    assert!(sides.iter().any(|&side| side < 12) && sides.iter().any(|&side| side > 70), "{sides:?}");
}
