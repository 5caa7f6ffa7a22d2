//! Frames of events: known answers.

mod consecutive {
    use crate::DropReason;
    use crate::counters::Outcome;
    use crate::event::{Event, Sensor};
    use crate::representations::consecutive::*;
    use crate::representations::{Completed, Crop, SignedRule};

    /// Two columns, one row, windows of 10 us, a maximum of 4.
    fn small(start_us: Option<i64>) -> ConsecutiveFrames {
        let options = Consecutive { crop: Crop::new(1, 0, 2, 1), period_us: 10, start_us };
        ConsecutiveFrames::counts(Sensor::new(4, 1), options, 4.0).expect("admissible")
    }

    /// The output as text: start, values, touched, changed; or start and number of empty frames.
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
        let mut signed = ConsecutiveFrames::signed(sensor, Consecutive::new(Crop::whole(sensor)), rule)
            .expect("admissible");
        let events =
            [(0, 0, true), (1, 0, true), (2, 0, false), (3, 1, true), (4, 1, false), (9_999, 2, false)];
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
}

mod crop {
    use crate::representations::*;

    #[test]
    fn pixels_count_from_the_crops_corner_row_by_row() {
        let crop = Crop::new(10, 20, 3, 2);
        assert_eq!(crop.index(10, 20), Some(0));
        assert_eq!(crop.index(12, 21), Some(5));
        assert_eq!(
            [crop.index(9, 20), crop.index(13, 20), crop.index(10, 22), crop.index(10, 19)],
            [None; 4]
        );
    }

    #[test]
    fn a_crop_without_pixels_or_beyond_the_sensor_is_refused() {
        let sensor = Sensor::new(8, 6);
        assert_eq!(Crop::whole(sensor).check(sensor, 2), Ok(()));
        for crop in
            [Crop::new(0, 0, 0, 6), Crop::new(0, 0, 8, 0), Crop::new(1, 0, 8, 6), Crop::new(0, 5, 1, 2)]
        {
            assert_eq!(crop.check(sensor, 2), Err(RepresentationError::Crop { crop, sensor }));
        }
    }

    #[test]
    fn a_frame_of_more_values_than_memory_is_for_is_refused() {
        let sensor = Sensor::new(u16::MAX, u16::MAX);
        let error = Crop::whole(sensor).check(sensor, 2).expect_err("8 GiB of counts");
        assert!(matches!(error, RepresentationError::Size { values: 8_589_672_450, .. }), "{error}");
    }
}

mod sliding {
    use crate::counters::Outcome;
    use crate::event::{Event, Sensor};
    use crate::representations::sliding::*;
    use crate::representations::{Crop, SignedRule};

    fn window(rule: SignedRule, capacity: usize) -> SlidingSigned {
        let sensor = Sensor::new(2, 1);
        SlidingSigned::new(sensor, Crop::whole(sensor), rule, 10, capacity).expect("admissible")
    }

    fn push(window: &mut SlidingSigned, events: &[(i64, u16, bool)]) {
        for &(t, x, on) in events {
            assert_eq!(window.push(Event::new(t, x, 0, on)), Outcome::Accepted);
        }
    }

    #[test]
    fn an_event_leaves_after_its_span_and_not_at_it() {
        let mut window = window(SignedRule::Sum, 9);
        push(&mut window, &[(100, 0, true), (103, 0, true), (104, 1, false)]);
        assert_eq!(window.frame().values, [2.0, -1.0]);
        window.advance(110);
        let frame = window.frame();
        assert_eq!((frame.values, frame.start_us, frame.changed), (&[2.0, -1.0][..], 100, &[][..]));
        window.advance(111);
        let frame = window.frame();
        assert_eq!((frame.values, frame.changed, frame.events), (&[1.0, -1.0][..], &[0][..], [1, 1]));
        window.advance(1 << 60);
        assert!(window.frame().is_empty() && window.frame().touched.is_empty());
        assert_eq!(window.counters().expired, 3);
    }

    #[test]
    fn the_latest_polarity_stands_until_that_event_leaves() {
        let mut window = window(SignedRule::Latest, 9);
        push(&mut window, &[(0, 0, true), (5, 0, false)]);
        window.advance(11);
        assert_eq!(window.frame().values, [-1.0, 0.0]);
        window.advance(16);
        let frame = window.frame();
        assert_eq!((frame.values, frame.changed), (&[0.0, 0.0][..], &[0][..]));
    }

    #[test]
    fn what_comes_and_goes_between_two_frames_changes_nothing() {
        let mut window = window(SignedRule::Sum, 9);
        push(&mut window, &[(0, 0, true), (1, 0, false), (2, 1, true)]);
        window.advance(50);
        assert!(window.frame().changed.is_empty());
    }

    #[test]
    fn a_full_window_lets_its_oldest_event_go() {
        let mut window = window(SignedRule::Sum, 2);
        push(&mut window, &[(0, 0, true), (0, 1, true), (0, 1, true)]);
        assert_eq!(window.frame().values, [0.0, 2.0]);
        assert_eq!(window.counters().evicted, 1);
    }

    #[test]
    fn a_reset_empties_the_frame_and_says_so() {
        let mut window = window(SignedRule::Sum, 9);
        push(&mut window, &[(1_000, 0, true)]);
        assert_eq!(window.frame().changed, [0]);
        window.reset();
        assert_eq!(window.frame().changed, [0]);
        push(&mut window, &[(-1_000, 1, true)]);
        assert_eq!(window.frame().values, [0.0, 1.0]);
    }
}

mod time_surface {
    use crate::event::{Event, Sensor};
    use crate::representations::Crop;
    use crate::representations::time_surface::*;

    fn surface(decay: Decay) -> TimeSurface {
        let sensor = Sensor::new(2, 1);
        let mut surface = TimeSurface::new(sensor, Crop::whole(sensor), decay).expect("admissible");
        for (t, x, on) in [(-1_000, 0, false), (-600, 0, true), (0, 0, true)] {
            surface.push(Event::new(t, x, 0, on));
        }
        surface
    }

    #[test]
    fn a_value_is_the_exponential_of_the_age_of_the_latest_event() {
        let mut surface = surface(Decay::Exponential { tau_us: 1_000.0 });
        let now = surface.surface();
        let inverse_e = 1.0 / std::f32::consts::E;
        assert!((now.values[0] - inverse_e).abs() < 1e-7);
        assert_eq!((&now.values[1..], now.at_us), (&[0.0, 1.0, 0.0][..], Some(0)));
        surface.advance(1_000);
        assert!((surface.surface().values[2] - inverse_e).abs() < 1e-7);
    }

    #[test]
    fn a_linear_value_falls_to_zero_and_is_then_no_longer_visited() {
        let mut surface = surface(Decay::Linear { span_us: 2_000.0 });
        assert_eq!(surface.surface().values, [0.5, 0.0, 1.0, 0.0]);
        surface.advance(1_000);
        let later = surface.surface();
        assert_eq!((later.values, later.active), (&[0.0, 0.0, 0.5, 0.0][..], &[2][..]));
        surface.advance(i64::MAX - 1_000);
        assert!(surface.surface().active.is_empty());
    }

    #[test]
    fn an_exponential_ends_after_104_time_constants() {
        let mut surface = surface(Decay::Exponential { tau_us: 10.0 });
        surface.advance(1_030);
        assert_eq!(surface.surface().active.len(), 1);
        surface.advance(1_040);
        let later = surface.surface();
        assert_eq!((later.values, later.active), (&[0.0; 4][..], &[][..]));
    }

    #[test]
    fn a_reset_surface_is_zero() {
        let mut surface = surface(Decay::Exponential { tau_us: 10.0 });
        surface.surface();
        surface.reset();
        let empty = surface.surface();
        assert_eq!((empty.values, empty.at_us), (&[0.0; 4][..], None));
    }

    #[test]
    fn a_time_constant_out_of_range_is_refused() {
        let sensor = Sensor::new(2, 1);
        for tau_us in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            let decay = Decay::Exponential { tau_us };
            assert!(TimeSurface::new(sensor, Crop::whole(sensor), decay).is_err(), "{tau_us}");
        }
    }
}

mod voxel_grid {
    use std::ops::RangeInclusive;

    use crate::event::{Event, Sensor};
    use crate::representations::Crop;
    use crate::representations::voxel_grid::*;

    fn grid(bins: usize, time: VoxelTime, window_us: RangeInclusive<i64>) -> VoxelGrid {
        let sensor = Sensor::new(2, 1);
        VoxelGrid::new(sensor, Crop::whole(sensor), bins, time, window_us).expect("admissible")
    }

    fn push(grid: &mut VoxelGrid, events: &[(i64, u16, bool)]) {
        events.iter().for_each(|&(t, x, on)| assert!(grid.push(Event::new(t, x, 0, on))));
    }

    #[test]
    fn an_event_is_shared_between_the_bins_before_and_after_it() {
        // tau = 3 (t - 100) / 12.
        let mut grid = grid(3, VoxelTime::Bins, 100..=112);
        push(&mut grid, &[(100, 0, true), (105, 0, true), (107, 1, false), (111, 1, true), (112, 0, true)]);
        assert_eq!(grid.frame().values, [1.0, 0.0, 0.75, -0.25, 0.25, -0.75 + 0.25]);
        assert_eq!((grid.frame().events, grid.frame().touched.len()), (5, 2));
    }

    #[test]
    fn between_centres_every_event_keeps_its_whole_weight() {
        // tau = 2 (t - 100) / 8.
        let mut grid = grid(3, VoxelTime::Centres, 100..=108);
        push(&mut grid, &[(100, 0, true), (103, 0, true), (108, 0, true), (105, 1, false)]);
        assert_eq!(grid.frame().values, [1.25, 0.0, 0.75, -0.75, 1.0, -0.25]);
    }

    #[test]
    fn a_window_of_one_instant_puts_everything_into_the_first_bin() {
        for time in [VoxelTime::Bins, VoxelTime::Centres] {
            let mut grid = grid(2, time, 7..=7);
            push(&mut grid, &[(7, 0, true), (7, 0, true), (7, 1, false)]);
            assert_eq!(grid.frame().values, [2.0, -1.0, 0.0, 0.0]);
        }
        let mut grid = grid(1, VoxelTime::Centres, 0..=9);
        push(&mut grid, &[(9, 0, true)]);
        assert_eq!(grid.frame().values, [1.0, 0.0]);
    }

    #[test]
    fn what_is_outside_is_counted_and_a_restart_empties_the_grid() {
        let sensor = Sensor::new(4, 1);
        let mut grid =
            VoxelGrid::new(sensor, Crop::new(0, 0, 2, 1), 2, VoxelTime::Bins, 0..=10).expect("admissible");
        for (t, x) in [(0, 4), (0, 2), (-1, 0), (11, 0), (i64::MIN, 0), (10, 0), (0, 1)] {
            grid.push(Event::new(t, x, 0, true));
        }
        let counts =
            VoxelCounters { pushed: 7, accepted: 2, outside_sensor: 1, outside_crop: 1, outside_window: 3 };
        assert_eq!(*grid.counters(), counts);
        assert_eq!(grid.frame().values, [0.0, 1.0, 0.0, 0.0]);
        grid.restart(20..=30).expect("admissible");
        let empty = grid.frame();
        assert_eq!((empty.values, empty.touched, empty.events), (&[0.0; 4][..], &[][..], 0));
    }

    #[test]
    fn windows_and_bins_out_of_range_are_refused() {
        let mut grid = grid(2, VoxelTime::Bins, 0..=10);
        push(&mut grid, &[(0, 0, true)]);
        let (start, end) = (10, 9);
        for window in [start..=end, 0..=1 << 32, i64::MIN..=i64::MAX] {
            assert!(grid.restart(window).is_err());
        }
        assert_eq!(grid.frame().values[0], 1.0);
        let sensor = Sensor::new(2, 1);
        for bins in [0, (1 << 16) + 1] {
            assert!(VoxelGrid::new(sensor, Crop::whole(sensor), bins, VoxelTime::Bins, 0..=1).is_err());
        }
    }
}
