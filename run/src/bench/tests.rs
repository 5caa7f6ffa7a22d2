//! Tests of benchmarks without a clock.

mod compare {
    use crate::bench::compare::Predictions;

    fn predictions(all: &[[f32; 2]]) -> Predictions {
        let mut predictions = Predictions::default();
        all.iter().for_each(|values| predictions.note(values));
        predictions
    }

    #[test]
    fn predictions_differ_in_bits_and_if_one_is_missing() {
        let a = predictions(&[[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]]);
        assert_eq!(a.that_differ(&predictions(&[[0.0, 1.0], [2.0, 3.0], [4.0, 5.0]])), 0);
        assert_eq!(a.that_differ(&predictions(&[[-0.0, 1.0], [2.0, 3.0], [4.0, 5.0]])), 1);
        assert_eq!(a.that_differ(&predictions(&[[9.0, 9.0], [2.0, 3.0]])), 2);
        assert_eq!(predictions(&[]).that_differ(&a), 3);
    }
}

mod deadline {
    use crate::bench::deadline::{Deadline, bin};
    use std::time::Duration;

    #[test]
    fn bins_follow_one_another_two_for_each_doubling() {
        let expected = [(0, 0), (1, 1), (2, 2), (3, 3), (4, 5), (4, 5), (6, 7), (6, 7), (8, 11)];
        assert_eq!(std::array::from_fn::<_, 9, _>(|n| bin(n as u64)), expected);
        assert_eq!(bin(u64::MAX), (3 << 62, u64::MAX));
        let mut next = 0;
        while next < 100_000 {
            let (least, most) = bin(next);
            assert!(least == next && bin(most) == (least, most));
            next = most + 1;
        }
    }

    #[test]
    fn a_missed_period_delays_those_after_it_and_a_pause_makes_up_for_it() {
        let mut deadline = Deadline::new(1000);
        for (end_us, work_us) in [(1000, 1700), (2000, 900), (3000, 100), (10_000, 1000)] {
            deadline.record(1, end_us, Duration::from_micros(work_us));
        }
        let report = deadline.report();
        assert_eq!((report.periods, report.periods_without_work, report.missed), (10, 6, 1));
        assert_eq!((report.excess_max_us, report.excess_mean_us), (700.0, Some(700.0)));
        // 1700, then 700 left + 900, then 600 + 100, then 1000.
        assert_eq!(report.lag_max_us, 1700.0);
        assert_eq!(report.load, Some(0.37));
    }

    #[test]
    fn the_sustained_rate_is_below_the_first_bin_that_does_not_hold() {
        let mut deadline = Deadline::new(1000);
        for (events, work_us) in [(1, 10), (9, 100), (30, 1200), (100, 50)] {
            deadline.record(events, 1000, Duration::from_micros(work_us));
        }
        let report = deadline.report();
        assert_eq!(report.sustained.map(|s| (s.events_per_period, s.events_per_s)), Some((9, 9000.0)));
        assert!(!report.sustained_is_all_seen);
    }

    #[test]
    fn a_single_interruption_among_1000_periods_does_not_end_the_sustained_rate_and_two_do() {
        for (interruptions, sustained) in [(1, 9), (2, 1)] {
            let mut deadline = Deadline::new(1000);
            let works = [(1, 1000, 10), (9, 1, 100), (9, interruptions, 5000)];
            for (events, count, work_us) in works {
                (0..count).for_each(|_| deadline.record(events, 1000, Duration::from_micros(work_us)));
            }
            let report = deadline.report();
            assert_eq!(report.sustained.map(|s| s.events_per_period), Some(sustained));
        }
    }

    #[test]
    fn no_periods_have_no_figures() {
        let report = Deadline::new(1000).report();
        assert_eq!((report.periods, report.missed, report.load), (0, 0, None));
        assert!(report.sustained.is_none() && report.work_us.count() == 0);
    }
}

mod frame_passes {
    use meissner_engine::{Event, LatePolicy, Sensor};

    use crate::bench::frame_passes::{EventFrameModel, PredictionTimes};
    use crate::error::RunError;
    use crate::frame_feed::FeedOutput;

    /// Times of the frames that the feed delivers for `moments`.
    fn times(model: &EventFrameModel, moments: &PredictionTimes, sensor: Sensor) -> Vec<i64> {
        let mut feed = model.feed(model.field(sensor), moments.period_us).expect("the field fits");
        let mut times = Vec::new();
        let mut note = |output: FeedOutput<'_>| {
            match output {
                FeedOutput::Frame { t_us, .. } => times.push(t_us),
                other => unreachable!("{other:?}: every frame is wanted, and the clock goes on"),
            }
            Ok::<_, RunError>(())
        };
        for &event in &moments.events {
            feed.push(event, &mut note).expect("nothing refuses a frame");
        }
        feed.finish(&mut note).expect("nothing refuses a frame");
        times
    }

    #[test]
    fn frames_come_at_the_moments_whatever_the_gaps_between_events() {
        let sensor = Sensor::new(200, 100);
        for name in ["force-tdnn", "event-frame-cnn"] {
            let model = EventFrameModel::named(name, None, false).expect("it is shipped");
            let period_us = model.period_us(None).expect("it has one");
            for seed in 1..50_u64 {
                // Gaps of 0, of less than a frame, of whole frames, and longer than the window.
                let gaps = [0, 1, 3333, 9999, 10_000, 10_001, 70_000, 150_000, 200_000];
                let gap = |i: u64| gaps[(seed * (i + 1) * (i + 7) / 3 % gaps.len() as u64) as usize];
                let at = |i: u64| -5 + (0..=i).map(gap).sum::<i64>();
                let events: Vec<Event> =
                    (0..30).map(|i| Event::new(at(i), (i * 6) as u16, (i * 3) as u16, i % 2 == 0)).collect();
                let moments =
                    PredictionTimes::new(&events, (sensor, LatePolicy::Drop), period_us, model.end());
                let moments = moments.expect("there are few");
                let expected: Vec<i64> = moments.iter().map(|moment| moment.t_us).collect();
                assert_eq!(times(&model, &moments, sensor), expected, "{name}, seed {seed}");
            }
        }
    }
}

mod input {
    use crate::bench::Part;

    fn times(part: Part, times: &[i64]) -> Vec<i64> {
        let inside = |t: &i64| part.range().is_none_or(|range| range.contains(*t, times[0]));
        times.iter().copied().filter(inside).collect()
    }

    #[test]
    fn a_part_begins_at_its_start_and_ends_before_its_end() {
        let all = [100, 1099, 1100, 1101, 1599, 1600];
        assert_eq!(times(Part::default(), &all), all);
        assert_eq!(times(Part { from_us: Some(1000), for_us: None }, &all), all[2..]);
        assert_eq!(times(Part { from_us: None, for_us: Some(1000) }, &all), all[..2]);
        assert_eq!(times(Part { from_us: Some(1000), for_us: Some(500) }, &all), all[2..5]);
        assert_eq!(times(Part { from_us: Some(1), for_us: Some(1) }, &[i64::MAX, i64::MIN]), [0; 0]);
    }

    #[test]
    fn a_whole_recording_holds_events_before_its_first_one() {
        assert_eq!(times(Part::default(), &[5, 3]), [5, 3]);
    }
}

mod moments {
    use crate::bench::frame_passes::{End, PredictionTimes};
    use crate::error::RunError;
    use meissner_engine::{Event, LatePolicy, Sensor};

    fn moments(times: &[i64], end: End) -> PredictionTimes {
        let events: Vec<Event> = times.iter().map(|&t| Event::new(t, 0, 0, true)).collect();
        PredictionTimes::new(&events, (Sensor::new(4, 4), LatePolicy::Drop), 10, end).expect("there are few")
    }

    fn counted(moments: &PredictionTimes) -> Vec<(i64, usize)> {
        moments.iter().map(|moment| (moment.t_us, moment.events.len())).collect()
    }

    #[test]
    fn an_event_at_a_moment_belongs_to_it_if_windows_slide_and_to_the_next_if_they_are_consecutive() {
        let times = [5, 15, 16, 40, 45];
        assert_eq!(counted(&moments(&times, End::Included)), [(15, 2), (25, 1), (35, 0), (45, 2)]);
        assert_eq!(counted(&moments(&times, End::Excluded)), [(15, 1), (25, 2), (35, 0), (45, 1), (55, 1)]);
    }

    #[test]
    fn one_event_has_one_moment_and_none_has_none() {
        for end in [End::Included, End::Excluded] {
            assert_eq!(counted(&moments(&[7], end)), [(17, 1)]);
            assert!(counted(&moments(&[], end)).is_empty());
        }
    }

    #[test]
    fn dropped_events_have_no_moments() {
        let moments = moments(&[100, 50, 101], End::Included);
        assert_eq!((counted(&moments), moments.counters.late), (vec![(110, 2)], 1));
    }

    #[test]
    fn more_frames_than_anybody_waits_for_are_refused() {
        let events = [0, i64::MAX / 2].map(|t| Event::new(t, 0, 0, true));
        let refused = PredictionTimes::new(&events, (Sensor::new(4, 4), LatePolicy::Drop), 10, End::Included);
        assert!(matches!(refused, Err(RunError::ManyFrames { most: 1_000_000, .. })), "{refused:?}");
    }
}

mod phases {
    use crate::bench::phases::{Phase, Phases};
    use meissner_engine::{Event, LatePolicy, Sensor};

    fn phases(events: &[Event], burst_rate: Option<u64>) -> Phases {
        Phases::new(events, Sensor::new(4, 4), LatePolicy::Drop, burst_rate)
    }

    #[test]
    fn a_burst_begins_when_the_events_before_reach_the_rate_and_ends_10_ms_after_them() {
        // 300 events per second are 3 in 10 ms.
        let events = [0, 1, 2, 3, 9_999, 10_000, 50_000].map(|t| Event::new(t, 0, 0, true));
        let phases = phases(&events, Some(300));
        let burst: Vec<bool> = (0..events.len()).map(|i| phases.of(i) == Phase::Burst).collect();
        assert_eq!(burst, [false, false, false, true, true, true, false]);
        assert_eq!((phases.count(Phase::Idle), phases.count(Phase::Burst)), (4, 3));
    }

    #[test]
    fn without_a_rate_5_times_the_mean_is_taken() {
        let phases = phases(&[0, 1_000_000].map(|t| Event::new(t, 0, 0, true)), None);
        assert_eq!((phases.mean_rate, phases.burst_rate), (Some(2.0), Some(10.0)));
    }

    #[test]
    fn dropped_events_raise_no_rate() {
        let events: Vec<Event> = (0..100).map(|t| Event::new(t, 9, 9, true)).collect();
        assert_eq!(phases(&events, Some(1)).count(Phase::Burst), 0);
    }

    #[test]
    fn no_events_and_no_span_have_no_burst() {
        assert_eq!(phases(&[], None).burst_rate, None);
        assert_eq!(phases(&[Event::new(7, 0, 0, true); 9], None).count(Phase::Burst), 0);
    }
}
