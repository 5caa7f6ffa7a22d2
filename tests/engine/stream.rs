//! Late, distant and other unusual events, and the neighbourhoods after them.

use meissner_engine::{
    Admission, Candidates, DropReason, Engine, EngineError, Event, GraphRule, LatePolicy, Lifetime, Options,
    Outcome, Reach, RestartPolicy, Search, Sensor,
};
use meissner_verify::CheckedEngine;
use meissner_verify::Random;
use meissner_verify::networks::{BlockShape, ConvolutionShape, NetworkShape, PoolShape};

pub(crate) const SPAN_US: i64 = 1_000;
pub(crate) const SENSOR: Sensor = Sensor { width: 40, height: 30 };

pub(crate) fn shape(candidates: Candidates) -> NetworkShape {
    let block = BlockShape {
        channels: 4,
        conv: ConvolutionShape::Spline([2, 2, 2]),
        input: 0,
        skip: None,
        extras: [true, true, true, true],
    };
    NetworkShape {
        graph: GraphRule { reach: Reach::Knn { k: 3 }, candidates },
        span_us: SPAN_US,
        capacity: 8,
        place: Some([(1, 5), (2, 7)]),
        // The second one reads the stored basis of edges.
        blocks: vec![
            block.clone(),
            BlockShape {
                input: 1,
                skip: Some(0),
                conv: ConvolutionShape::Spline([2, 2, 1]),
                ..block.clone()
            },
        ],
        pooled: vec![PoolShape {
            from: 2,
            cell: [(1, 5), (1, 4)],
            time: None,
            mean: true,
            blocks: vec![block],
        }],
        from: 1,
        grid: [2, 2],
        dense: vec![2],
        head: None,
        seed: 11,
    }
}

pub(crate) const ALL: Candidates = Candidates::All;
pub(crate) const EVERY: [Candidates; 3] =
    [Candidates::All, Candidates::Past(Lifetime::Window), Candidates::Past(Lifetime::Frozen)];

pub(crate) fn checked(candidates: Candidates) -> CheckedEngine {
    CheckedEngine::new(shape(candidates).build(), SENSOR, Search::Exhaustive)
}

pub(crate) fn rows(engine: &Engine, index: usize) -> Vec<u32> {
    engine.neighbourhood(index).iter().map(|n| n.row).collect()
}

#[test]
fn a_late_event_is_dropped_and_counted() {
    let mut stream = checked(ALL);
    stream.push(Event::new(100, 1, 1, true));
    assert_eq!(stream.push(Event::new(99, 2, 2, true)), Outcome::Dropped(DropReason::Late));
    assert_eq!(stream.engine.counters().events.late, 1);
    assert_eq!(stream.engine.nodes(), 1);
    assert_eq!(stream.compare(), Ok(()));
}

#[test]
fn a_late_event_enters_at_the_newest_time_where_the_policy_says_so() {
    let options = Options::new().with_late(LatePolicy::Clamp);
    let mut engine = Engine::with_options(shape(ALL).build(), SENSOR, options).expect("the network is exact");
    engine.push(Event::new(100, 1, 1, true));
    assert_eq!(engine.push(Event::new(40, 2, 2, true)), Outcome::Accepted);
    assert_eq!(engine.events()[1].t_us, 100);
    assert_eq!(engine.counters().events.clamped, 1);
}

#[test]
fn an_event_before_the_last_advance_is_late() {
    let mut stream = checked(ALL);
    stream.push(Event::new(100, 1, 1, true));
    stream.advance(200);
    assert_eq!(stream.push(Event::new(199, 2, 2, true)), Outcome::Dropped(DropReason::Late));
    assert_eq!(stream.push(Event::new(200, 2, 2, true)), Outcome::Accepted);
    assert_eq!(stream.compare(), Ok(()));
}

#[test]
fn an_advance_before_the_first_event_or_back_in_time_changes_nothing() {
    let mut stream = checked(ALL);
    stream.advance(1_000_000);
    assert_eq!(stream.push(Event::new(5, 1, 1, true)), Outcome::Accepted);
    stream.advance(0);
    assert_eq!(stream.engine.now_us(), Some(5));
    assert_eq!(stream.compare(), Ok(()));
}

/// Found by fuzzing: the comparison with the batch took such a time for the newest one.
#[test]
fn an_advance_further_than_63_bits_from_the_epoch_changes_nothing() {
    let mut stream = checked(ALL);
    assert_eq!(stream.push(Event::new(-5, 1, 1, true)), Outcome::Accepted);
    stream.advance(i64::MAX);
    assert_eq!((stream.engine.now_us(), stream.engine.nodes()), (Some(-5), 1));
    assert_eq!(stream.compare(), Ok(()));
    stream.advance(i64::MAX - 5);
    assert_eq!((stream.engine.now_us(), stream.engine.nodes()), (Some(i64::MAX - 5), 0));
    assert_eq!(stream.compare(), Ok(()));
}

#[test]
fn among_equal_stamps_and_distances_the_later_arrival_comes_first() {
    for candidates in EVERY {
        let mut stream = checked(candidates);
        for _ in 0..5 {
            stream.push(Event::new(7, 3, 3, true));
        }
        assert_eq!(rows(&stream.engine, 4), [3, 2, 1], "{candidates:?}");
        assert_eq!(stream.compare(), Ok(()), "{candidates:?}");
    }
}

#[test]
fn an_event_outside_the_sensor_is_dropped_and_counted() {
    let mut stream = checked(ALL);
    for (x, y) in [(40, 0), (0, 30), (u16::MAX, u16::MAX)] {
        let outcome = stream.push(Event::new(0, x, y, true));
        assert_eq!(outcome, Outcome::Dropped(DropReason::OutsideSensor));
    }
    assert_eq!(stream.engine.counters().events.outside_sensor, 3);
    assert_eq!(stream.engine.counters().events.accepted, 0);
    assert_eq!(stream.compare(), Ok(()));
}

/// A search of every cell of 8 x 8 pixels would go through 67 million of them for an event.
#[test]
fn the_largest_sensor_takes_few_mib_and_gives_the_bits_of_the_batch() {
    for candidates in EVERY {
        let sensor = Sensor::new(u16::MAX, u16::MAX);
        let shape = NetworkShape { capacity: 300, ..shape(candidates) };
        let mut stream = CheckedEngine::new(shape.build(), sensor, Search::Exhaustive);
        assert!(stream.engine.state_bytes() < 8 << 20, "{candidates:?}: {}", stream.engine.state_bytes());
        let mut random = Random::new(3);
        for i in 0..600 {
            let mut pixel = || random.below(u16::MAX.into()) as u16;
            stream.push(Event::new(i / 8, pixel(), pixel(), i % 3 == 0));
            if i % 100 == 99 {
                assert_eq!(stream.compare(), Ok(()), "{candidates:?}");
            }
        }
    }
}

#[test]
fn cells_of_a_pooling_without_time_lie_in_the_middle_of_the_span() {
    let mut above = shape(ALL);
    above.pooled[0].mean = false;
    above.pooled.push(PoolShape { cell: [(1, 2), (1, 2)], ..above.pooled[0].clone() });
    let mut stream = CheckedEngine::new(above.build(), SENSOR, Search::Exhaustive);
    stream.push(Event::new(0, 1, 1, true));
    stream.push(Event::new(900, 39, 29, true));
    for level in &stream.batch.trace().expect("numbers").levels[1..] {
        assert!(level.cells.iter().all(|cell| cell[2] == 0), "{:?}", level.cells);
        assert!(level.positions.iter().all(|position| position[2] == 0.5), "{:?}", level.positions);
    }
}

#[test]
fn a_time_jump_of_hours_empties_the_window_and_goes_on() {
    for candidates in EVERY {
        let mut stream = checked(candidates);
        for i in 0..6 {
            stream.push(Event::new(i, i as u16, 2, true));
        }
        assert_eq!(stream.compare(), Ok(()), "{candidates:?}");
        // One event after so long may be an outlier; the second confirms it.
        let held = stream.push(Event::new(7 * 3_600_000_000, 3, 3, false));
        assert_eq!((held, stream.engine.nodes()), (Outcome::Held, 6), "{candidates:?}");
        stream.push(Event::new(7 * 3_600_000_000 + 1, 3, 3, false));
        assert_eq!(stream.engine.nodes(), 2, "{candidates:?}");
        assert_eq!(stream.engine.counters().events.expired, 6, "{candidates:?}");
        assert_eq!(stream.compare(), Ok(()), "{candidates:?}");
    }
}

#[test]
fn a_time_too_far_from_the_epoch_is_dropped_and_counted() {
    let options = Options::new().with_restart(RestartPolicy::Keep);
    let mut engine = Engine::with_options(shape(ALL).build(), SENSOR, options).expect("the network is exact");
    engine.push(Event::new(-5, 1, 1, true));
    let far = engine.push(Event::new(i64::MAX, 1, 1, true));
    assert_eq!(far, Outcome::Dropped(DropReason::TimeOutOfRange));
    assert_eq!(engine.counters().events.time_out_of_range, 1);
}

#[test]
fn a_time_too_far_before_an_epoch_is_late() {
    let mut stream = checked(ALL);
    stream.push(Event::new(5, 1, 1, true));
    assert_eq!(stream.push(Event::new(i64::MIN, 1, 1, true)), Outcome::Held);
    assert_eq!(stream.push(Event::new(6, 1, 1, true)), Outcome::Accepted);
    assert_eq!(stream.engine.counters().events.late, 1);
    assert_eq!(stream.compare(), Ok(()));
}

#[test]
fn every_event_is_counted_as_pushed_and_as_accepted_or_dropped() {
    let mut engine = Engine::new(shape(ALL).build(), SENSOR).expect("the network is exact");
    let events = [(0, 1), (3, 2), (2, 3), (4, 40), (5, 4)].map(|(t_us, x)| Event::new(t_us, x, 1, true));
    assert_eq!(engine.push_slice(&events), 3);
    let counters = engine.counters().events;
    assert_eq!((counters.pushed, counters.accepted), (5, 3));
    let dropped = counters.dropped().map(|(reason, count)| (reason.name(), count));
    assert_eq!(
        dropped,
        [("outside_sensor", 1), ("late", 1), ("time_out_of_range", 0), ("outlier", 0), ("network_filter", 0)]
    );
}

#[test]
fn a_gate_gives_events_their_times_on_their_own_clock() {
    let mut gate = Admission::new(SENSOR, LatePolicy::Clamp);
    let at = |t_us| Event::new(t_us, 1, 1, true);
    assert_eq!(gate.admit(at(100)), Ok(at(100)));
    assert_eq!(gate.admit(at(160)), Ok(at(160)));
    assert_eq!(gate.admit(at(130)), Ok(at(160)));
    let mut resumed = Admission::new(SENSOR, LatePolicy::Drop);
    resumed.resume(100, 160);
    assert_eq!((resumed.epoch_us(), resumed.now_us()), (Some(100), Some(160)));
    assert_eq!(resumed.admit(at(159)), Err(DropReason::Late));
    assert_eq!(resumed.admit(at(160)), Ok(at(160)));
    // An impossible newest time becomes the epoch.
    for (epoch, now) in [(100, 40), (i64::MIN, i64::MAX)] {
        resumed.resume(epoch, now);
        assert_eq!((resumed.epoch_us(), resumed.now_us()), (Some(epoch), Some(epoch)));
    }
}

#[test]
fn a_node_as_far_as_the_last_neighbour_is_found_beyond_the_cells_that_are_nearer() {
    for candidates in EVERY {
        let shape = NetworkShape {
            capacity: 100,
            graph: GraphRule { reach: Reach::Knn { k: 1 }, candidates },
            ..shape(candidates)
        };
        let mut stream = CheckedEngine::new(shape.build(), Sensor::new(64, 64), Search::Exhaustive);
        // Too many nodes to be compared one by one.
        for i in 0..70 {
            stream.push(Event::new(0, 40 + i % 20, 40 + i / 20, true));
        }
        // In the cell of the last event, and in the cell to its left: both are one pixel away.
        for x in [9, 7, 8] {
            stream.push(Event::new(0, x, 8, true));
        }
        assert_eq!(rows(&stream.engine, 72), [71], "{candidates:?}");
        assert_eq!(stream.compare(), Ok(()), "{candidates:?}");
    }
}

#[test]
fn a_reader_whose_neighbour_was_replaced_by_a_farther_one_takes_a_newcomer_in_between() {
    let shape =
        NetworkShape { graph: GraphRule { reach: Reach::Knn { k: 1 }, candidates: ALL }, ..shape(ALL) };
    let mut stream = CheckedEngine::new(shape.build(), Sensor::new(64, 64), Search::Exhaustive);
    for (t_us, x, y) in [(0, 5, 4), (10, 4, 4), (10, 60, 60), (SPAN_US + 1, 20, 4)] {
        stream.push(Event::new(t_us, x, y, true));
    }
    assert_eq!(rows(&stream.engine, 0), [2]);
    assert_eq!(stream.compare(), Ok(()));
}

#[test]
fn an_expired_neighbour_is_replaced_by_no_later_node_where_only_the_past_is_read() {
    for (candidates, later) in [(ALL, true), (Candidates::Past(Lifetime::Window), false)] {
        let shape = NetworkShape {
            capacity: 100,
            graph: GraphRule { reach: Reach::Knn { k: 1 }, candidates },
            ..shape(candidates)
        };
        let mut stream = CheckedEngine::new(shape.build(), Sensor::new(64, 64), Search::Exhaustive);
        stream.push(Event::new(0, 5, 4, true));
        // Too many nodes to be compared one by one.
        for i in 0..70 {
            stream.push(Event::new(10, 40 + i % 20, 40 + i / 20, true));
        }
        // The reader, one at its time and one later.
        for (t_us, x) in [(10, 4), (10, 7), (11, 6)] {
            stream.push(Event::new(t_us, x, 4, true));
        }
        assert_eq!(stream.compare(), Ok(()), "{candidates:?}");
        stream.advance(SPAN_US + 1);
        assert_eq!(stream.engine.nodes(), 73);
        assert_eq!(rows(&stream.engine, 70)[0] > 70, later, "{candidates:?}");
        assert_eq!(stream.compare(), Ok(()), "{candidates:?}");
    }
}

#[test]
fn a_search_for_more_neighbours_than_there_are_nodes_ends_also_after_a_reset() {
    for candidates in EVERY {
        let shape = NetworkShape {
            capacity: 100,
            graph: GraphRule { reach: Reach::Knn { k: 90 }, candidates },
            ..shape(candidates)
        };
        let mut stream = CheckedEngine::new(shape.build(), SENSOR, Search::Exhaustive);
        for _ in 0..2 {
            for i in 0..70 {
                stream.push(Event::new(i, (i % 40) as u16, (i % 30) as u16, true));
            }
            assert_eq!(rows(&stream.engine, 69).len(), 69, "{candidates:?}");
            stream.reset();
        }
    }
}

#[test]
fn a_full_window_evicts_the_oldest_event() {
    for candidates in EVERY {
        let mut stream = checked(candidates);
        for i in 0..20 {
            stream.push(Event::new(i, (i % 7) as u16, (i % 5) as u16, i % 2 == 0));
            assert_eq!(stream.compare(), Ok(()), "{candidates:?}");
        }
        let times: Vec<i64> = stream.engine.events().iter().map(|event| event.t_us).collect();
        assert_eq!(times, (12..20).collect::<Vec<_>>(), "{candidates:?}");
        assert_eq!(stream.engine.counters().events.evicted, 12, "{candidates:?}");
    }
}

#[test]
fn the_window_holds_events_of_exactly_the_span() {
    let mut stream = checked(ALL);
    stream.push(Event::new(0, 1, 1, true));
    stream.push(Event::new(SPAN_US, 2, 2, true));
    assert_eq!(stream.engine.nodes(), 2);
    stream.push(Event::new(SPAN_US + 1, 3, 3, true));
    assert_eq!(stream.engine.nodes(), 2);
    assert_eq!(stream.compare(), Ok(()));
}

#[test]
fn an_expired_neighbour_is_replaced_by_the_next_nearest() {
    for candidates in [ALL, Candidates::Past(Lifetime::Window)] {
        let mut stream = checked(candidates);
        stream.push(Event::new(0, 10, 10, true));
        for x in [12, 14, 16, 11] {
            stream.push(Event::new(20, x, 10, true));
        }
        // Columns 12, 10 (a fiftieth of the span ago) and 14; column 16 is the fourth nearest.
        assert_eq!(rows(&stream.engine, 4), [1, 0, 2], "{candidates:?}");
        stream.advance(SPAN_US + 1);
        assert_eq!(rows(&stream.engine, 3), [0, 1, 2], "{candidates:?}");
        assert_eq!(stream.compare(), Ok(()), "{candidates:?}");
    }
}

/// Found by the property test: neighbours that are about to leave do not show that a reader has all
/// candidates that stay.
#[test]
fn a_list_that_loses_several_neighbours_at_once_is_filled_up_again() {
    for candidates in [ALL, Candidates::Past(Lifetime::Window)] {
        let mut stream = checked(candidates);
        for x in [10, 11, 12] {
            stream.push(Event::new(0, x, 10, true));
        }
        for x in [20, 22, 24, 11] {
            stream.push(Event::new(20, x, 10, true));
        }
        assert_eq!(rows(&stream.engine, 6), [1, 2, 0], "{candidates:?}");
        stream.advance(SPAN_US + 1);
        assert_eq!(rows(&stream.engine, 3), [0, 1, 2], "{candidates:?}");
        assert_eq!(stream.compare(), Ok(()), "{candidates:?}");
    }
}

#[test]
fn a_nearer_newcomer_displaces_the_farthest_neighbour() {
    let mut stream = checked(ALL);
    for (x, y) in [(30, 20), (10, 11), (11, 10), (10, 14), (10, 10)] {
        stream.push(Event::new(500, x, y, true));
    }
    assert_eq!(rows(&stream.engine, 4), [2, 1, 3]);
    stream.push(Event::new(501, 10, 11, true));
    assert_eq!(rows(&stream.engine, 4), [2, 1, 5]);
    assert_eq!(stream.compare(), Ok(()));
}

#[test]
fn a_reset_forgets_events_clock_and_epoch() {
    let mut stream = checked(Candidates::Past(Lifetime::Frozen));
    for i in 0..5 {
        stream.push(Event::new(1_000_000 + i, 3, 3, true));
    }
    stream.reset();
    assert_eq!(stream.engine.nodes(), 0);
    assert_eq!(stream.compare(), Ok(()));
    assert_eq!(stream.push(Event::new(4, 3, 3, true)), Outcome::Accepted);
    assert_eq!(stream.compare(), Ok(()));
}

#[test]
fn the_epoch_does_not_reach_the_bits() {
    for candidates in EVERY {
        let predict = |origin: i64| {
            let mut engine = Engine::new(shape(candidates).build(), SENSOR).expect("the network is exact");
            for i in 0..30 {
                engine.push(Event::new(
                    origin + 17 * i,
                    (i * 7 % 40) as u16,
                    (i * 11 % 30) as u16,
                    i % 3 == 0,
                ));
            }
            engine.predict().expect("finite").values.iter().map(|v| v.to_bits()).collect::<Vec<_>>()
        };
        let expected = predict(0);
        for origin in [1_700_000_000_000_000, -3, i64::MIN, i64::MAX - 600] {
            assert_eq!(predict(origin), expected, "{candidates:?} from {origin}");
        }
    }
}

#[test]
fn a_snapshot_of_another_network_is_refused_and_changes_nothing() {
    let mut engine = Engine::new(shape(ALL).build(), SENSOR).expect("the network is exact");
    engine.push(Event::new(0, 1, 1, true));
    let other = NetworkShape { seed: 99, ..shape(ALL) }.build();
    let other = Engine::new(other, SENSOR).expect("the network is exact").snapshot();
    let before = engine.to_bytes();
    assert!(matches!(engine.restore(&other), Err(EngineError::Snapshot { .. })));
    assert_eq!(engine.to_bytes(), before);
    assert_eq!(engine.nodes(), 1);
}

#[test]
fn what_debugging_prints_of_an_engine_fits_a_few_lines() {
    let mut engine = Engine::new(shape(ALL).build(), SENSOR).expect("exact");
    engine.push(Event::new(7, 1, 2, true));
    let printed = format!("{engine:?}");
    assert!(printed.len() < 500 && printed.contains("nodes: 1, now_us: Some(7)"), "{printed}");
}
