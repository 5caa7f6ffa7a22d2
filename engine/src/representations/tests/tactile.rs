//! Frames of electrodes: known answers.

mod layout {
    use proptest::prelude::*;

    use crate::representations::tactile::*;

    /// The image as the header describes it, without any list.
    fn slow(values: &[f32; ELECTRODES]) -> [Option<f32>; TACTILE_CELLS] {
        let mut image = [[None; TACTILE_COLUMNS]; TACTILE_ROWS];
        for i in 0..ELECTRODES {
            image[ELECTRODE_ROWS[i]][ELECTRODE_COLUMNS[i]] = Some(values[i]);
        }
        for _ in 0..2 {
            let before = image;
            for row in 0..TACTILE_ROWS as i32 {
                for column in 0..TACTILE_COLUMNS as i32 {
                    let (mut sum, mut count) = (0.0, 0.0);
                    for dr in -1..=1 {
                        for dc in -1..=1 {
                            let at =
                                |r: i32, c: i32| before.get(r as usize)?.get(c as usize).copied().flatten();
                            if let Some(value) = at(row + dr, column + dc) {
                                sum += f64::from(value);
                                count += 1.0;
                            }
                        }
                    }
                    let cell = &mut image[row as usize][column as usize];
                    if cell.is_none() && count > 0.0 {
                        *cell = Some((sum / count) as f32);
                    }
                }
            }
        }
        std::array::from_fn(|cell| image[cell / TACTILE_COLUMNS][cell % TACTILE_COLUMNS])
    }

    #[test]
    fn two_passes_fill_every_cell() {
        let layout = TactileLayout::new();
        assert_eq!(layout.fills.len() + ELECTRODES, TACTILE_CELLS);
        assert_eq!(layout.fills.iter().map(|(_, neighbours)| neighbours.len()).sum::<usize>(), 204);
        assert!(slow(&[0.0; ELECTRODES]).iter().all(Option::is_some));
    }

    #[test]
    fn a_cell_is_the_mean_of_its_filled_neighbours() {
        let values = std::array::from_fn(|i| (1 << i) as f32);
        let mut image = [0.0; TACTILE_CELLS];
        TactileLayout::new().image(&values, &mut image);
        let at = |row: usize, column: usize| image[row * TACTILE_COLUMNS + column];
        assert_eq!(at(0, 1), 1.0);
        assert_eq!(at(5, 5), (1 << 23) as f32);
        // First pass: a cell next to electrode 0 only, and a cell between electrodes 0 and 1.
        assert_eq!([at(0, 0), at(0, 2)], [1.0, 1.5]);
        // Second pass: (2, 0) sees (1, 0), (1, 1), (2, 1), (3, 0), (3, 1) of the first: electrodes
        // 0, 0 and 1, 1, 2, 2.
        assert_eq!(at(2, 0), (1.0 + 1.5 + 2.0 + 4.0 + 4.0) / 5.0);
    }

    #[test]
    fn means_of_the_largest_readings_do_not_overflow() {
        let mut image = [0.0; TACTILE_CELLS];
        TactileLayout::new().image(&[f32::MAX; ELECTRODES], &mut image);
        assert_eq!(image, [f32::MAX; TACTILE_CELLS]);
    }

    proptest! {
        #[test]
        fn lists_give_the_image_that_passes_give(values in proptest::array::uniform24(-5_000f32..5_000.0)) {
            let mut image = [f32::NAN; TACTILE_CELLS];
            TactileLayout::new().image(&values, &mut image);
            prop_assert_eq!(image.map(Some), slow(&values));
        }
    }
}

mod scaling {
    use crate::representations::tactile::*;

    #[test]
    fn the_smallest_value_becomes_0_and_the_largest_1() {
        let mut values = [3.0, -1.0, 7.0, 1.0];
        by_own_range(&mut values);
        assert_eq!(values, [0.5, 0.0, 1.0, 0.25]);
        let mut values = [f32::MAX, f32::MIN];
        by_own_range(&mut values);
        assert_eq!(values, [1.0, 0.0]);
    }

    #[test]
    fn equal_values_become_0() {
        let mut values = [42.0; 5];
        by_own_range(&mut values);
        assert_eq!(values, [0.0; 5]);
    }

    #[test]
    fn the_range_of_a_training_set_spans_all_its_readings() {
        let mut readings = [[5.0; ELECTRODES], [7.0; ELECTRODES]];
        readings[1][3] = -2.0;
        assert_eq!(Scaling::range_of(&readings), Some(Scaling::Range { minimum: -2.0, maximum: 7.0 }));
        assert_eq!(Scaling::range_of(&readings[..1]), None);
        assert_eq!(Scaling::range_of([]), None);
    }

    #[test]
    fn a_range_without_extent_is_refused() {
        for (minimum, maximum) in [(1.0, 1.0), (2.0, 1.0), (f32::NAN, 1.0), (0.0, f32::INFINITY)] {
            assert!(Scaling::Range { minimum, maximum }.check().is_err());
            assert!(Scaling::ReadingAndRange { minimum, maximum }.check().is_err());
        }
    }
}

mod window {
    use crate::representations::tactile::*;

    const UNIT: Scaling = Scaling::Range { minimum: 0.0, maximum: 1.0 };

    /// The first value of each step of every window over readings 0, 1, 2, ...
    fn windows(steps: usize, sampling: Sampling, readings: u16) -> Vec<(u64, Vec<f32>)> {
        let mut window = TactileWindow::new(steps, sampling, UNIT, TactileForm::Reading).expect("admissible");
        let mut out = vec![];
        for i in 0..readings {
            if let Some(sequence) = window.push(&[f32::from(i); ELECTRODES]).expect("finite") {
                let firsts = sequence.values.iter().copied().step_by(ELECTRODES).collect();
                out.push((sequence.reading, firsts));
            }
        }
        out
    }

    #[test]
    fn consecutive_windows_do_not_overlap() {
        let expected = [(2, vec![0.0, 1.0, 2.0]), (5, vec![3.0, 4.0, 5.0])];
        assert_eq!(windows(3, Sampling::Consecutive, 8), expected);
    }

    #[test]
    fn a_sliding_window_decides_at_every_reading() {
        let expected = [(2, vec![0.0, 1.0, 2.0]), (3, vec![1.0, 2.0, 3.0]), (4, vec![2.0, 3.0, 4.0])];
        assert_eq!(windows(3, Sampling::Sliding, 5), expected);
        assert_eq!(windows(1, Sampling::Sliding, 2), [(0, vec![0.0]), (1, vec![1.0])]);
    }

    #[test]
    fn a_stride_passes_over_the_readings_between() {
        let expected = [(3, vec![0.0, 3.0]), (9, vec![6.0, 9.0])];
        assert_eq!(windows(2, Sampling::Step { stride: 3 }, 12), expected);
        assert_eq!(windows(2, Sampling::Step { stride: 1 }, 5), windows(2, Sampling::Consecutive, 5));
    }

    #[test]
    fn an_image_is_scaled_by_its_own_minimum_and_maximum() {
        let mut window = TactileWindow::new(1, Sampling::Sliding, Scaling::PerImage, TactileForm::Image);
        let window = window.as_mut().expect("admissible");
        let reading: [f32; ELECTRODES] = std::array::from_fn(|i| 100.0 + i as f32);
        let sequence = window.push(&reading).expect("finite").expect("one step");
        assert_eq!(sequence.shape, [1, 12, 11]);
        assert_eq!(sequence.values[1], 0.0);
        assert_eq!(sequence.values[5 * TACTILE_COLUMNS + 5], 1.0);
        assert!(sequence.values.iter().all(|value| (0.0..=1.0).contains(value)));
        let sequence = window.push(&[0.1; ELECTRODES]).expect("finite").expect("one step");
        assert_eq!(sequence.values, [0.0; TACTILE_CELLS]);
    }

    #[test]
    fn values_beyond_a_range_lie_beyond_0_and_1() {
        let range = Scaling::Range { minimum: 100.0, maximum: 300.0 };
        let mut window =
            TactileWindow::new(1, Sampling::Sliding, range, TactileForm::Reading).expect("admissible");
        let mut reading = [200.0; ELECTRODES];
        (reading[0], reading[1]) = (0.0, 500.0);
        let sequence = window.push(&reading).expect("finite").expect("one step");
        assert_eq!((sequence.shape, &sequence.values[..3]), ([1, 1, 24], &[-0.5, 2.0, 0.5][..]));
    }

    #[test]
    fn a_reading_scaled_twice_shows_its_own_range_and_then_the_fixed_one() {
        let both = Scaling::ReadingAndRange { minimum: 100.0, maximum: 300.0 };
        let mut window =
            TactileWindow::new(2, Sampling::Sliding, both, TactileForm::Reading).expect("admissible");
        let mut reading = [150.0; ELECTRODES];
        (reading[0], reading[1]) = (100.0, 200.0);
        assert_eq!(window.push(&reading), Ok(None));
        let sequence = window.push(&[200.0; ELECTRODES]).expect("finite").expect("two steps");
        assert_eq!(sequence.shape, [2, 1, 48]);
        let (first, second) = sequence.values.split_at(48);
        assert_eq!((&first[..3], &first[24..27]), (&[0.0, 1.0, 0.5][..], &[0.0, 0.5, 0.25][..]));
        assert_eq!(second, [[0.0; 24], [0.5; 24]].concat());
    }

    #[test]
    fn an_image_cannot_be_scaled_twice() {
        let both = Scaling::ReadingAndRange { minimum: 0.0, maximum: 1.0 };
        let error = TactileWindow::new(1, Sampling::Sliding, both, TactileForm::Image).expect_err("an image");
        assert_eq!(
            error.to_string(),
            "scaling: expected one that gives an image one value for each electrode, found both by reading and by range"
        );
    }

    #[test]
    fn a_reading_that_is_not_finite_is_refused_and_not_taken() {
        let narrow = Scaling::Range { minimum: 0.0, maximum: 1e-30 };
        let mut window =
            TactileWindow::new(2, Sampling::Consecutive, narrow, TactileForm::Image).expect("admissible");
        assert_eq!(window.push(&[0.0; ELECTRODES]), Ok(None));
        for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY, 1e30] {
            let mut reading = [0.0; ELECTRODES];
            reading[7] = bad;
            let error = window.push(&reading).expect_err("not finite");
            assert!(error.to_string().starts_with("electrode 7: expected a "), "{error}");
        }
        let sequence = window.push(&[1e-30; ELECTRODES]).expect("finite").expect("the second step");
        assert_eq!((sequence.reading, sequence.values[0], sequence.values[TACTILE_CELLS]), (1, 0.0, 1.0));
    }

    #[test]
    fn options_out_of_range_are_refused() {
        for (steps, sampling) in
            [(0, Sampling::Sliding), (1 << 17, Sampling::Sliding), (5, Sampling::Step { stride: 0 })]
        {
            assert!(TactileWindow::new(steps, sampling, UNIT, TactileForm::Image).is_err());
        }
    }
}
