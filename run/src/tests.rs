//! Tests of modules that are one file each.

mod input;
mod journal;
mod video;

mod answer {
    use crate::answer::{Classes, Values};

    #[test]
    fn digits_restore_every_bit_through_f64_and_through_f32() {
        let mut values = vec![0.0, -0.0, 0.1, 7.038_531e-26, f32::MIN_POSITIVE, f32::MAX, f32::from_bits(1)];
        values.extend((0..2000_u32).map(|i| f32::from_bits(i.wrapping_mul(2_654_435_761) & 0xbf7f_ffff)));
        let text = serde_json::to_string(&Values(&values)).expect("numbers are JSON");
        for (value, digits) in values.iter().zip(text.trim_matches(['[', ']']).split(',')) {
            let through = [digits.parse::<f64>().map(|v| v as f32).ok(), digits.parse::<f32>().ok()];
            assert!(
                through.iter().all(|v| v.map(f32::to_bits) == Some(value.to_bits())),
                "{value}: {digits}"
            );
        }
    }

    #[test]
    fn values_that_are_no_logits_have_no_answer() {
        let mut classes = Classes::new(Some(vec!["a".to_owned(), "b".to_owned()]));
        assert_eq!(classes.update(&[0.0, 2.0]).map(|(class, _)| class), Some(1));
        assert_eq!(classes.answer().map(|answer| answer.class), Some("b"));
        assert!(classes.update(&[0.0; 3]).is_none() && classes.answer().is_none());
        assert!(Classes::default().update(&[1.0]).is_none());
    }
}

mod clock {
    use crate::clock::Clock;
    use std::time::{Duration, Instant};

    #[test]
    fn at_twice_the_speed_a_second_of_the_stream_takes_half_a_second() {
        let start = Instant::now();
        let clock = Clock::new(start, 1_000_000, 2.0);
        assert_eq!(clock.at(2_000_000), start + Duration::from_millis(500));
        assert_eq!(clock.stream_us(start + Duration::from_millis(500)), 2_000_000);
        assert_eq!(clock.at(0), start);
        assert!(clock.at(i64::MAX) > start && Clock::new(start, i64::MIN, 1e-6).at(i64::MAX) > start);
    }
}

mod error {
    use std::error::Error;
    use std::io;
    use std::path::PathBuf;

    use meissner_engine::{EngineError, Sensor};
    use meissner_io::IoError;
    use meissner_models::ModelError;

    use crate::error::{RunError, chain};

    fn denied() -> io::Error {
        io::Error::new(io::ErrorKind::PermissionDenied, "denied")
    }

    #[test]
    fn an_error_does_not_repeat_its_source() {
        let path = PathBuf::from("some.file");
        let format = IoError::Unsupported { expected: "some", actual: "other".to_owned() };
        let engine = || EngineError::Sensor(Sensor::new(0, 1));
        for error in [
            RunError::recording("some.file", format),
            RunError::file("open", &path, denied()),
            RunError::description("some".to_owned(), ModelError::Engine(engine())),
            RunError::weights("some".to_owned(), ModelError::Read { path, source: denied() }),
            RunError::Engine(engine()),
        ] {
            let mut outer: &dyn Error = &error;
            while let Some(source) = outer.source() {
                assert!(!outer.to_string().contains(&source.to_string()), "{outer}: {source}");
                outer = source;
            }
        }
    }

    #[test]
    fn a_chain_has_all_sources_once() {
        let path = PathBuf::from("some.pth");
        let error = RunError::weights("some.pth".to_owned(), ModelError::Read { path, source: denied() });
        assert_eq!(chain(&error), "cannot read some.pth: denied");
    }
}

mod latency {
    use crate::latency::Latency;
    use std::time::Duration;

    #[test]
    fn the_share_of_longer_durations_falls_to_0() {
        let mut latency = Latency::new();
        for us in [10, 10, 20, 40] {
            latency.record(Duration::from_micros(us));
        }
        let points = latency.longer();
        let shares: Vec<f64> = points.iter().map(|point| point.1).collect();
        assert_eq!(shares, [0.5, 0.25, 0.0]);
        assert!(points.iter().zip([10.0, 20.0, 40.0]).all(|(point, us)| (point.0 / us - 1.0).abs() < 2e-3));
    }

    #[test]
    fn quantiles_are_in_microseconds_and_the_maximum_is_exact() {
        let mut latency = Latency::new();
        assert_eq!(latency.quantiles(), None);
        for us in 1..=1000 {
            latency.record(Duration::from_micros(us));
        }
        latency.record(Duration::from_nanos(123_456_789));
        let quantiles = latency.quantiles().expect("it is not empty");
        assert!((quantiles.p50 - 501.0).abs() < 2.0 && (quantiles.p99 - 991.0).abs() < 2.0);
        assert_eq!(quantiles.max, 123_456.789);
        assert_eq!(latency.total(), Duration::from_nanos(500_500_000 + 123_456_789));
    }
}

mod line_errors {
    use crate::error::RunError;
    use crate::left_out::{FIRST, LineErrors};

    /// The counts after this number of taken lines.
    fn refusals(strict: bool, taken: u64) -> LineErrors {
        let mut refusals = LineErrors::new("text", strict);
        (0..taken).for_each(|_| refusals.take());
        refusals
    }

    #[test]
    fn with_strict_the_first_refused_line_is_an_error() {
        let refused = refusals(true, 7).refuse("line 8: bad".to_owned());
        assert!(matches!(refused, Err(RunError::Line { .. })));
    }

    #[test]
    fn more_than_half_of_the_first_lines_is_an_error_as_soon_as_it_is_known() {
        let mut refusals = refusals(false, 10);
        for _ in 0..FIRST / 2 {
            assert!(refusals.refuse(String::new()).is_ok());
        }
        assert!(matches!(refusals.refuse(String::new()), Err(RunError::Lines { .. })));
    }

    #[test]
    fn later_lines_may_be_refused_in_any_number() {
        let mut refusals = refusals(false, FIRST);
        assert!((0..10 * FIRST).all(|_| refusals.refuse(String::new()).is_ok()));
        assert!(refusals.end().is_ok());
    }

    #[test]
    fn a_short_text_may_be_refused_up_to_half() {
        let mut refusals = refusals(false, 0);
        assert!(refusals.end().is_ok());
        assert!(refusals.refuse("line 1: bad".to_owned()).is_ok());
        let error = refusals.end().expect_err("the only line is refused").to_string();
        assert_eq!(error, "text: line 1: bad");
        refusals.take();
        assert!(refusals.end().is_ok());
    }
}

mod losses {
    use std::time::{Duration, Instant};

    use crate::losses::{InputLosses, LossReason, LossWatch};
    use meissner_engine::{EventCounters, Sensor};

    fn reasons(events: EventCounters, outside_crop: u64, lines_refused: u64) -> Vec<LossReason> {
        let losses = InputLosses::of_events(events, Sensor::new(4, 4));
        let losses = InputLosses { outside_crop, lines_refused, ..losses };
        losses.warnings().into_iter().map(|warning| warning.reason).collect()
    }

    #[test]
    fn a_live_stream_is_looked_at_after_a_thousand_events_and_every_second_and_a_recording_at_its_end() {
        let looks = |live| {
            let (mut watch, mut looks) = (LossWatch::new(live), Vec::new());
            let start = Instant::now();
            for ms in (0..5000).step_by(300) {
                watch.look(
                    ms,
                    || start + Duration::from_millis(ms),
                    "stream",
                    || {
                        looks.push(ms);
                        InputLosses::of_events(EventCounters::default(), Sensor::new(4, 4))
                    },
                );
            }
            looks
        };
        assert_eq!((looks(true), looks(false)), (vec![1200, 2400, 3600, 4800], vec![]));
    }

    #[test]
    fn the_losses_of_a_second_are_those_since_the_second_before() {
        let losses = |pushed, late| {
            let events = EventCounters { pushed, late, ..EventCounters::default() };
            InputLosses::of_events(events, Sensor::new(4, 4))
        };
        assert!(losses(2000, 20).since(&losses(1000, 20)).warnings().is_empty());
        let warning = losses(2000, 520).since(&losses(1000, 20)).warnings().remove(0);
        assert_eq!((warning.reason, warning.count, warning.of), (LossReason::Late, 500, 1000));
    }

    #[test]
    fn every_restart_is_told() {
        let events =
            EventCounters { pushed: 1_000_000, accepted: 1_000_000, restarts: 1, ..EventCounters::default() };
        assert_eq!(reasons(events, 0, 0), [LossReason::Restart]);
    }

    #[test]
    fn more_than_a_hundredth_is_warned_of_and_a_hundredth_is_not() {
        let events = EventCounters { pushed: 1000, accepted: 500, late: 10, ..EventCounters::default() };
        assert!(reasons(events, 5, 10).is_empty());
        assert_eq!(reasons(EventCounters { late: 11, ..events }, 5, 0), [LossReason::Late]);
        assert_eq!(
            reasons(EventCounters { outside_sensor: 11, ..events }, 0, 0),
            [LossReason::OutsideSensor]
        );
        assert_eq!(
            reasons(EventCounters { time_out_of_range: 11, ..events }, 0, 0),
            [LossReason::TimeOutOfRange]
        );
        assert_eq!(reasons(events, 6, 11), [LossReason::OutsideCrop, LossReason::LinesRefused]);
        assert!(reasons(EventCounters::default(), 0, 0).is_empty());
    }

    #[test]
    fn advice_stands_at_the_end_of_the_message_of_its_reason() {
        let losses = InputLosses { lines_refused: 1, ..InputLosses::of_lines(1) };
        let advice = |reason| (reason == LossReason::LinesRefused).then_some("look at them");
        let message = losses.with_advice(advice).warnings().remove(0).message;
        assert_eq!(message, "1 of 2 (50.0 %) lines are refused: the first are named above (look at them)");
    }
}

mod memory {
    use crate::memory::parse;

    #[test]
    fn a_size_is_read_in_units_of_1024_bytes_and_is_absent_where_it_is_not_reported() {
        let status = "Name:\tmeissner\nVmPeak:\t  9 kB\nVmHWM:\t    1234 kB\nVmRSS:\t 7 kB\n";
        assert_eq!(parse(status, "VmHWM:"), Some(1234 * 1024));
        assert_eq!(parse(status, "VmRSS:"), Some(7 * 1024));
        assert_eq!(parse("Name:\tmeissner\n", "VmHWM:"), None);
        assert_eq!(parse("VmHWM:\tmany\n", "VmHWM:"), None);
    }
}

mod model {
    use crate::model::nearest;

    #[test]
    fn a_name_that_is_nearly_right_is_answered_with_the_right_one() {
        for (wrong, right) in [
            ("graphress", "graphres"),
            ("tactigraf", "tactigraph"),
            ("tactigraph-pst", "tactigraph-past"),
            ("slip_lstm", "slip-lstm"),
            ("digit-past", "digits-past"),
        ] {
            assert_eq!(nearest(wrong), Some(right));
        }
        assert_eq!(nearest("xyz"), None);
    }
}

mod schedule {
    use crate::schedule::{Every, Last, Schedule, times_before};

    /// Due times before each of the events at `times`.
    fn due(schedule: &mut Schedule, times: &[i64]) -> Vec<Vec<i64>> {
        let before = |&t: &i64| {
            let arrival = schedule.arrival_us(|| Some(t));
            std::iter::from_fn(|| schedule.due_before(arrival?)).collect()
        };
        times.iter().map(before).collect()
    }

    #[test]
    fn periods_count_from_the_first_event_and_hold_the_event_at_their_end() {
        let mut schedule = Schedule::new(Every::StreamUs(10));
        let due = due(&mut schedule, &[5, 15, 16, 40]);
        assert_eq!(due, [vec![], vec![], vec![15], vec![25, 35]]);
        assert_eq!(schedule.last(), Last::At(45));
    }

    #[test]
    fn a_skipped_gap_resumes_on_the_same_grid() {
        let mut schedule = Schedule::new(Every::StreamUs(10));
        due(&mut schedule, &[5]);
        for (t, next) in [(15, 15), (16, 25), (1_000_000, 1_000_005)] {
            schedule.skip_to(t);
            assert_eq!(schedule.last(), Last::At(next));
        }
        schedule.skip_to(i64::MAX);
        assert_eq!(schedule.last(), Last::Nothing);
    }

    #[test]
    fn a_resumed_schedule_is_due_when_one_that_went_on_is() {
        for every in [Every::StreamUs(10), Every::Events(3)] {
            for cut in 1..7 {
                let times = [5, 6, 15, 15, 16, 40, 65];
                let (mut whole, mut resumed) = (Schedule::new(every), Schedule::new(every));
                due(&mut whole, &times[..cut]);
                for _ in 0..cut {
                    whole.is_due_after_event();
                }
                resumed.resume(5, times[cut - 1], cut as u64);
                for i in cut..7 {
                    assert_eq!(due(&mut resumed, &times[i..=i]), due(&mut whole, &times[i..=i]), "{cut} {i}");
                    assert_eq!(resumed.is_due_after_event(), whole.is_due_after_event(), "{cut} {i}");
                }
                assert_eq!(resumed.last(), whole.last());
            }
        }
    }

    #[test]
    fn a_dropped_event_does_not_advance_the_clock() {
        let mut schedule = Schedule::new(Every::StreamUs(10));
        due(&mut schedule, &[0]);
        assert_eq!(schedule.arrival_us(|| None), None);
        assert_eq!(schedule.last(), Last::At(10));
    }

    #[test]
    fn events_are_counted_from_one_prediction_to_the_next() {
        let mut schedule = Schedule::new(Every::Events(3));
        let due: Vec<bool> = (0..7).map(|_| schedule.is_due_after_event()).collect();
        assert_eq!(due, [false, false, true, false, false, true, false]);
        assert_eq!(schedule.last(), Last::Nothing);
    }

    #[test]
    fn times_before_an_end_are_counted_over_the_whole_clock() {
        let counts =
            [(5, 5), (5, 6), (5, 15), (5, 16), (5, -100)].map(|(first, end)| times_before(first, end, 10));
        assert_eq!(counts, [0, 1, 1, 2, 0]);
        assert_eq!(times_before(i64::MIN, i64::MAX, 1), u64::MAX);
    }
}

mod text {
    use crate::text::{date, date_now, display_us, grouped, length_us, sensor, span_us};
    use meissner_engine::Sensor;

    #[test]
    fn days_have_dates() {
        let dates = [(0, "1970-01-01"), (-1, "1969-12-31"), (11_016, "2000-02-29"), (11_017, "2000-03-01")];
        dates.iter().for_each(|&(days, text)| assert_eq!(date(days), text));
        assert_eq!([20_784, 47_540, 47_541].map(date), ["2026-11-27", "2100-02-28", "2100-03-01"]);
        assert!(date_now().as_str() > "2026-11");
    }

    #[test]
    fn a_sensor_has_two_sides_of_at_least_a_pixel() {
        assert_eq!(sensor("346x260"), Ok(Sensor::new(346, 260)));
        for text in ["", "346", "346x", "0x260", "346x0", "65536x1", "70000x1", "-1x1", "3x4x5", "346X260 "] {
            assert!(sensor(text).is_err(), "{text}");
        }
    }

    #[test]
    fn a_time_is_a_number_with_its_unit_read_exactly() {
        for (text, us) in [
            ("1us", 1),
            ("500us", 500),
            ("5ms", 5_000),
            ("1.5ms", 1_500),
            ("0.000001s", 1),
            ("2s", 2_000_000),
            ("2.50s", 2_500_000),
            ("3.0us", 3),
            ("1099511627776us", 1 << 40),
        ] {
            assert_eq!(span_us(text), Ok(us), "{text}");
        }
        assert_eq!(length_us("0s"), Ok(0));
    }

    #[test]
    fn bare_numbers_other_units_and_parts_of_a_microsecond_are_refused_with_the_forms() {
        for wrong in [
            "",
            "5",
            "0.5",
            "us",
            "ms",
            ".5ms",
            "5.ms",
            "-1ms",
            "+1ms",
            "1e3us",
            "5 ms",
            "5ns",
            "1min",
            "5MS",
            "0.5us",
            "1.0005ms",
            "1.5.5ms",
            "99999999999999999999us",
            "9223372036854775807s",
        ] {
            let message = span_us(wrong).expect_err(wrong);
            assert!(message.contains("such as 500us, 1.5ms or 2s"), "{wrong}: {message}");
        }
        assert!(span_us("0us").is_err() && span_us("13000000s").is_err());
    }

    #[test]
    fn a_time_is_shown_as_it_is_read() {
        for us in [1, 999, 1_000, 1_500, 10_000, 2_000_000, 2_000_001, 1 << 40] {
            assert_eq!(span_us(&display_us(us)), Ok(us));
        }
        assert_eq!([1_500, 10_000, 60_000_000].map(display_us), ["1500us", "10ms", "60s"]);
    }

    #[test]
    fn digits_come_in_groups_of_three() {
        let texts = [0, 12, 999, 1000, 12_345, 1_234_567].map(grouped);
        assert_eq!(texts, ["0", "12", "999", "1,000", "12,345", "1,234,567"]);
    }
}

mod training {
    use crate::training::{Output, Training};

    fn outputs(ranges: Option<Vec<[f64; 2]>>) -> Vec<Output> {
        let text = |words: [&str; 2]| words.map(str::to_owned);
        Output::all(&text(["roll", "depth"]), &text(["rad", "mm"]), ranges).expect("a range for each")
    }

    #[test]
    fn values_beyond_a_tenth_of_the_range_and_no_numbers_are_marked_and_counted() {
        let mut training = Training::new(&outputs(Some(vec![[-0.15708, 0.15708], [2.0, 5.0]])));
        let mut marks = |values: [f32; 2]| {
            training.update(&values, None);
            training.newest().join(" ")
        };
        assert_eq!(marks([0.18, 1.71]), "");
        assert_eq!(marks([0.19, 3.0]), "roll");
        assert_eq!(marks([-0.19, 5.31]), "roll depth");
        assert_eq!(marks([0.0, f32::NAN]), "depth");
        assert_eq!(training.outside(), Some(3));
        let expected = "3 of 4 predictions have values outside the range of the training (roll -9.0 to 9.0 deg, depth 2.0 to \
                        5.0 mm): they mean little";
        assert_eq!(training.warning().as_deref(), Some(expected));
    }

    #[test]
    fn windows_unlike_those_of_the_training_are_counted() {
        let mut training = Training::new(&outputs(None));
        assert_eq!(training.unlike(), None);
        [0.4, 1.0, 1.01, 12.34].into_iter().for_each(|unlike| training.update(&[0.0, 0.0], Some(unlike)));
        assert_eq!(training.unlike(), Some(2));
    }

    #[test]
    fn without_ranges_nothing_is_marked() {
        let mut training = Training::new(&outputs(None));
        training.update(&[9.0, f32::NAN], None);
        assert_eq!((training.newest().len(), training.outside(), training.warning()), (0, None, None));
    }

    #[test]
    fn radians_are_degrees_for_people() {
        let [roll, depth] = &outputs(None)[..] else { panic!("two outputs") };
        assert_eq!((roll.shown_unit(), depth.shown_unit()), ("deg", "mm"));
        assert!((roll.shown(0.5) - 28.647_889).abs() < 1e-6 && depth.shown(0.5) == 0.5);
    }
}

mod state {
    use crate::run::{SaveState, Saver};

    #[test]
    fn states_are_due_when_the_time_has_passed_since_the_last() {
        let saver = |every_us| Saver::new(SaveState { path: "state".into(), every_us });
        let mut every_10 = saver(Some(10));
        let due: Vec<bool> = [-3, 6, 7, 16, 17, 90, 91].map(|t| every_10.is_due(t)).to_vec();
        assert_eq!(due, [false, false, true, false, true, true, false]);
        let mut at_the_end = saver(None);
        assert!(!at_the_end.is_due(0) && !at_the_end.is_due(i64::MAX));
        let mut restarted = saver(Some(10));
        assert_eq!([1000, 0, 9, 10].map(|t| restarted.is_due(t)), [false, false, false, true]);
    }
}
