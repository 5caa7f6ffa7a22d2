//! Clocks, fractions, fingerprints, and marks of changed pixels.

mod restart {
    use crate::restart::{CONFIRMING, ClockWatch, MAX_SILENCE_US, RestartPolicy};
    use crate::{Event, Sensor};

    const SENSOR: Sensor = Sensor { width: 4, height: 4 };

    const WINDOW_US: i64 = 100;
    const FAR_US: i64 = 1_000 * MAX_SILENCE_US;

    /// The clocks of events at `times`, each with the times taken, including late ones; then the
    /// numbers of outliers and of events still held.
    fn clocks(policy: RestartPolicy, times: &[i64]) -> (Vec<Vec<i64>>, u64, usize) {
        let mut watch = ClockWatch::new(policy, SENSOR, WINDOW_US);
        let (mut clocks, mut outliers) = (vec![Vec::new()], 0);
        for &t_us in times {
            let clock: &mut Vec<i64> = clocks.last_mut().expect("there is one");
            let now_us = clock.iter().copied().max();
            let Some(decision) = watch.decide(Event::new(t_us, 0, 0, true), now_us) else {
                clock.push(t_us);
                continue;
            };
            outliers += decision.outliers;
            if decision.restarts {
                clocks.push(Vec::new());
            }
            let clock = clocks.last_mut().expect("there is one");
            clock.extend(decision.taken.events().iter().map(|event| event.t_us));
            assert_eq!(decision.passes, decision.taken.events().last().is_some_and(|last| last.t_us == t_us));
        }
        (clocks, outliers, watch.held().len())
    }

    fn reset(times: &[i64]) -> (Vec<Vec<i64>>, u64, usize) {
        clocks(RestartPolicy::Reset, times)
    }

    #[test]
    fn a_run_back_by_more_than_the_window_restarts_the_clock_and_loses_no_event() {
        let old = [FAR_US, FAR_US + 5];
        let new: Vec<i64> = (0..20).map(|i| 3 * i).collect();
        let times = [&old[..], &new].concat();
        assert_eq!(reset(&times), (vec![old.to_vec(), new.clone()], 0, 0));
        let (clocks, _, held) = reset(&times[..2 + CONFIRMING - 1]);
        assert_eq!((clocks, held), (vec![old.to_vec()], CONFIRMING - 1));
    }

    #[test]
    fn late_events_within_the_window_are_not_a_restart() {
        let times: Vec<i64> = (0..100).map(|i| 1000 + i - WINDOW_US * (i % 2)).collect();
        assert_eq!(reset(&times), (vec![times.clone()], 0, 0));
    }

    #[test]
    fn a_late_packet_is_late_and_keeps_its_place() {
        let times = [&[1000][..], &[10; CONFIRMING - 1], &[1001, 1002]].concat();
        assert_eq!(reset(&times), (vec![times.clone()], 0, 0));
    }

    #[test]
    fn events_of_two_clocks_that_alternate_are_no_restart() {
        let times: Vec<i64> = (0..100).map(|i| i + FAR_US * (i % 2)).collect();
        let (clocks, outliers, held) = reset(&times);
        assert_eq!((clocks.len(), outliers, held), (1, 49, 1));
    }

    #[test]
    fn a_single_stamp_far_ahead_is_dropped_and_the_clock_goes_on() {
        assert_eq!(reset(&[0, 1, FAR_US, 2, 3]), (vec![vec![0, 1, 2, 3]], 1, 0));
        assert_eq!(reset(&[0, i64::MAX, 2, i64::MAX, 3]), (vec![vec![0, 2, 3]], 2, 0));
        // Two of them far from each other do not confirm each other.
        assert_eq!(reset(&[0, FAR_US, 3 * FAR_US, 2, 3]), (vec![vec![0, 2, 3]], 2, 0));
    }

    #[test]
    fn the_second_event_after_a_long_silence_brings_the_first() {
        assert_eq!(reset(&[0, FAR_US]), (vec![vec![0]], 0, 1));
        assert_eq!(reset(&[0, FAR_US, FAR_US + 1]), (vec![vec![0, FAR_US, FAR_US + 1]], 0, 0));
        assert_eq!(reset(&[0, MAX_SILENCE_US]), (vec![vec![0, MAX_SILENCE_US]], 0, 0));
    }

    #[test]
    fn an_advance_of_the_clock_brings_an_event_after_a_long_silence() {
        let mut watch = ClockWatch::new(RestartPolicy::Reset, SENSOR, WINDOW_US);
        let event = Event::new(FAR_US, 1, 2, true);
        assert!(watch.decide(event, Some(0)).is_some_and(|decision| !decision.passes));
        assert!(watch.advance(10, Some(0)).taken.events().is_empty());
        assert_eq!(watch.advance(FAR_US, Some(0)).taken.events(), [event]);
        assert!(watch.held().is_empty());
    }

    #[test]
    fn a_leftover_far_ahead_at_the_start_costs_a_restart_and_no_event() {
        let new: Vec<i64> = (0..9).collect();
        let times = [&[FAR_US][..], &new].concat();
        assert_eq!(reset(&times), (vec![vec![FAR_US], new], 0, 0));
    }

    #[test]
    fn a_clock_that_cannot_hold_both_times_begins_anew() {
        let times = [i64::MIN, i64::MAX - 1, i64::MAX];
        assert_eq!(reset(&times), (vec![vec![i64::MIN], vec![i64::MAX - 1, i64::MAX]], 0, 0));
    }

    #[test]
    fn what_is_not_confirmed_at_the_end_is_late_or_an_outlier() {
        let mut watch = ClockWatch::new(RestartPolicy::Reset, SENSOR, WINDOW_US);
        let (back, ahead) = (Event::new(-FAR_US, 0, 0, true), Event::new(FAR_US, 0, 0, true));
        let _ = watch.decide(back, Some(0));
        let end = watch.end(Some(0));
        assert_eq!((end.taken.events(), end.outliers), (&[back][..], 0));
        let _ = watch.decide(ahead, Some(0));
        let end = watch.end(Some(0));
        assert_eq!((end.taken.events().len(), end.outliers, watch.held().len()), (0, 1, 0));
    }

    #[test]
    fn what_one_watch_held_another_can_hold_and_nothing_else() {
        let event = |t_us| Event::new(t_us, 0, 0, true);
        let mut watch = ClockWatch::new(RestartPolicy::Reset, SENSOR, WINDOW_US);
        let back = [0, 1, 2].map(event);
        assert!(watch.hold(&back, Some(1000)) && watch.held() == back);
        assert!(watch.hold(&[event(FAR_US)], Some(1000)));
        for refused in [vec![950], vec![FAR_US, FAR_US], vec![0; CONFIRMING], vec![0, FAR_US]] {
            let events: Vec<Event> = refused.into_iter().map(event).collect();
            assert!(!watch.hold(&events, Some(1000)) && watch.held().is_empty(), "{events:?}");
        }
        assert!(!watch.hold(&back, None));
        assert!(!ClockWatch::new(RestartPolicy::Keep, SENSOR, WINDOW_US).hold(&back, Some(1000)));
    }

    #[test]
    fn with_keep_every_event_passes_at_once() {
        let times = [FAR_US, 0, 1, 2, 3, 4, 5, 6, 7, 8, 9, 10 * FAR_US];
        assert_eq!(clocks(RestartPolicy::Keep, &times), (vec![times.to_vec()], 0, 0));
    }
}

mod fraction {
    use proptest::prelude::*;

    use crate::network::parts::Fraction;

    fn fraction(numerator: u32, denominator: u32) -> Fraction {
        Fraction::new(numerator, denominator).expect("positive")
    }

    #[test]
    fn lengths_are_rounded_up_to_whole_cells() {
        assert_eq!([1, 2, 3, 4].map(|n| fraction(n, 3).cells_of(fraction(1, 3))), [1, 2, 3, 4]);
        assert_eq!(fraction(1, 3).cells_of(fraction(1, 4)), 2);
        assert_eq!(fraction(1, 4).cells_of(fraction(1, 3)), 1);
        assert_eq!(fraction(u32::MAX, 1).cells_of(fraction(1, u32::MAX)), (u32::MAX as usize).pow(2));
    }

    #[test]
    fn cells_of_positions_whose_products_do_not_fit_are_exact() {
        let most = u32::MAX;
        // 2^127 (2^32 - 1) / 2^32 is between 2^127 - 2^95 - 1 and 2^127 - 2^95.
        assert_eq!(fraction(1, most).cell(i128::MAX, 1 << 32), i128::MAX - (1 << 95));
        assert_eq!(fraction(1, most).cell(i128::MIN, 1 << 32), i128::MIN + (1 << 95));
        assert_eq!(fraction(most, most).cell(i128::MAX, 1), i128::MAX);
        assert_eq!([i128::MIN, i128::MAX].map(|p| fraction(1, 2).cell(p, 1)), [i128::MIN, i128::MAX]);
        assert_eq!(fraction(most, 1).cell(i128::MIN, (1 << 62) - 1), -((1 << 33) + 3));
    }

    #[test]
    fn places_run_evenly_from_one_end_of_a_cell_to_the_other() {
        let places = |n, d, extent| (0..extent).map(|x| fraction(n, d).place(x, extent)).collect::<Vec<_>>();
        assert_eq!(places(1, 2, 8), [-0.75, -0.25, 0.25, 0.75, -0.75, -0.25, 0.25, 0.75]);
        assert_eq!(places(1, 4, 4), [0.0; 4]);
        assert_eq!(places(3, 4, 4), [-2.0 / 3.0, 0.0, 2.0 / 3.0, -2.0 / 3.0].map(|v: f64| v as f32));
        // Cells of 2.5 pixels: the third pixel begins in the first cell; its centre is at the
        // cell's end.
        assert_eq!(places(1, 2, 5)[2], 1.0);
        // The whole sensor is one cell, and a larger cell is not filled.
        assert_eq!(places(1, 1, 2), [-0.5, 0.5]);
        assert_eq!(places(2, 1, 2), [-0.75, -0.25]);
        assert!(fraction(u32::MAX, 1).place(u16::MAX - 1, u16::MAX) < -0.99);
    }

    proptest! {
        #[test]
        fn pixels_of_one_cell_have_ascending_places(n in 1u32..400, d in 1u32..400, x in 0u16..999, extent in 1000u16..2000) {
            let size = fraction(n, d);
            let [a, b] = [x, x + 1].map(|x| size.place(x, extent));
            let [cell, next] = [x, x + 1].map(|x| size.cell(x.into(), extent.into()));
            prop_assert!(cell != next || a < b);
            let width = f64::from(d) / (f64::from(n) * f64::from(extent));
            prop_assert!((-1.0..=1.0 + width).contains(&f64::from(a)), "{}", a);
        }

        #[test]
        fn large_positions_fall_into_the_cells_of_the_same_share(
            n in 1..u32::MAX, d in 1..u32::MAX, position in any::<i64>(), extent in 1i64..1 << 30, times in 0u32..33,
        ) {
            let size = fraction(n, d);
            let small = size.cell(position.into(), extent.into());
            prop_assert_eq!(size.cell(i128::from(position) << times, i128::from(extent) << times), small);
            prop_assert_eq!((i128::from(position) * i128::from(d)).div_euclid(i128::from(extent) * i128::from(n)), small);
        }
    }
}

mod fingerprint {
    use crate::fingerprint::of_bytes;

    /// Values from the authors' test suite.
    #[test]
    fn fingerprints_of_bytes_are_those_of_fnv_1a() {
        assert_eq!(of_bytes(b""), 0xcbf2_9ce4_8422_2325);
        assert_eq!(of_bytes(b"a"), 0xaf63_dc4c_8601_ec8c);
        assert_eq!(of_bytes(b"foobar"), 0x8594_4171_f739_67e8);
    }
}

mod published {
    use crate::batch::published::{cell, mean, positions, readout_cell};
    use crate::{Event, Fraction};

    /// As exact fractions, rows 101, 113 and 125 of 260 are exactly one cell of 12 rows apart.
    #[test]
    fn a_row_on_a_cells_edge_falls_into_the_cell_that_float32_gives_it() {
        let size = Fraction::new(12, 260).expect("positive");
        let rows = |y: u16| {
            let events = [Event::new(0, 0, 101, true), Event::new(0, 0, y, true)];
            let [first, second] = positions(&events, 0, [346.0, 260.0, 1.0])[..] else {
                panic!("two events")
            };
            cell(second[1], first[1] as f32, size)
        };
        assert_eq!([112, 113, 124, 125].map(rows), [0, 0, 1, 1]);
        assert_eq!(size.cell(12, 260), 1);
    }

    #[test]
    fn a_readout_cell_beyond_the_image_is_the_last() {
        assert_eq!([0.0, 0.25, 0.99, 1.5].map(|p| readout_cell(p, 0.0, 4)), [0, 1, 3, 3]);
    }

    #[test]
    fn a_mean_is_a_sum_in_float32() {
        let positions = [[1.0; 3], [f64::from(f32::EPSILON / 2.0); 3], [f64::from(f32::EPSILON / 2.0); 3]];
        assert_eq!(mean(&[0, 1, 2], &positions), [f64::from(1.0_f32 / 3.0); 3]);
    }
}

mod changes {
    use meissner_kernels::Region;
    use proptest::prelude::*;

    use crate::frames::changes::Changes;

    fn changes() -> impl Strategy<Value = Changes> {
        (1usize..9, 1usize..150).prop_flat_map(|(height, width)| {
            proptest::collection::vec((0..height, 0..width), 0..12).prop_map(move |pixels| {
                let mut changes = Changes::none(height, width);
                pixels.into_iter().for_each(|(y, x)| changes.set(y, x));
                changes
            })
        })
    }

    fn of(height: usize, width: usize, marked: impl Fn(usize, usize) -> bool) -> Changes {
        let mut out = Changes::none(height, width);
        for y in 0..height {
            for x in (0..width).filter(|&x| marked(y, x)) {
                out.set(y, x);
            }
        }
        out
    }

    proptest! {
        #[test]
        fn a_rectangle_is_found_where_the_marks_are_one(
            changes in changes(), (y, x, height, width) in (0usize..9, 0usize..99, 1usize..9, 1usize..9),
        ) {
            let marked = |region: Region| of(changes.height, changes.width, |v, u| {
                (region.y..region.y + region.height).contains(&v) && (region.x..region.x + region.width).contains(&u)
            });
            if let Some(region) = changes.rectangle() {
                prop_assert_eq!(&marked(region), &changes);
            }
            let region = Region { y, x, height, width };
            if y + height <= changes.height && x + width <= changes.width {
                prop_assert_eq!(marked(region).rectangle(), Some(region));
            }
            prop_assert_eq!(marked(Region { height: 0, ..region }).rectangle(), None);
            let mut large = Changes::none(9, 8);
            large.set_all();
            prop_assert_eq!(large.rectangle(), None);
        }

        #[test]
        fn changes_spread_as_windows_read(changes in changes(), size in 1usize..4) {
            let Changes { height, width, .. } = changes;
            let near = |y: usize, x: usize| {
                (y.saturating_sub(1)..(y + 2).min(height))
                    .any(|v| (x.saturating_sub(1)..(x + 2).min(width)).any(|u| changes.contains(v, u)))
            };
            let mut spread = Changes::none(height, width);
            spread.spread_of(&changes);
            prop_assert_eq!(&spread, &of(height, width, near));

            let (h, w) = (height / size, width / size);
            let below = |y: usize, x: usize| {
                (0..size * size).any(|i| changes.contains(y * size + i / size, x * size + i % size))
            };
            let mut shrunk = Changes::none(h, w);
            shrunk.shrunk_from(&changes, size);
            prop_assert_eq!(&shrunk, &of(h, w, below));

            let mut filled = changes.clone();
            filled.fill_tiles(size, &mut Changes::default());
            let in_tile = |y: usize, x: usize| {
                (y / size * size..((y / size + 1) * size).min(height))
                    .any(|v| (x / size * size..((x / size + 1) * size).min(width)).any(|u| changes.contains(v, u)))
            };
            prop_assert_eq!(&filled, &of(height, width, in_tile));

            let mut doubled = Changes::none(2 * height, 2 * width);
            doubled.doubled_from(&changes);
            prop_assert_eq!(&doubled, &of(2 * height, 2 * width, |y, x| changes.contains(y / 2, x / 2)));
        }

        #[test]
        fn regions_hold_every_marked_pixel_once(changes in changes(), rows in 1usize..5, columns in 1usize..40) {
            let mut covered = Changes::none(changes.height, changes.width);
            let mut pixels = 0;
            changes.for_each_region(rows, columns, |region| {
                assert!(changes.any_in(region));
                covered.set_region(region);
                pixels += region.height * region.width;
            });
            prop_assert_eq!(covered.count(), pixels);
            changes.for_each(|y, x| assert!(covered.contains(y, x)));
            let mut all = Changes::none(changes.height, changes.width);
            all.set_all();
            prop_assert_eq!(all.count(), changes.height * changes.width);
            all.include(&changes);
            prop_assert_eq!(all.count(), changes.height * changes.width);
        }
    }
}
