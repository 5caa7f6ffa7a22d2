//! Contact area: images and maps compared with plain loops.

mod difference {
    use proptest::prelude::*;

    use crate::systems::contact_area::difference::{DifferenceBaseline, DifferenceSettings};
    use crate::systems::contact_area::{Centroid, ImageSize, PixelSize};

    fn settings(width: usize, height: usize, threshold: f32, blur_radius: usize) -> DifferenceSettings {
        let pixel = PixelSize::new(0.5, 0.25).unwrap();
        DifferenceSettings { size: ImageSize { width, height }, pixel, threshold, blur_radius }
    }

    #[test]
    fn without_a_blur_each_pixel_stands_for_itself() {
        let mut baseline = DifferenceBaseline::new(&[10; 12], settings(2, 2, 10.0, 0)).unwrap();
        // Differences of 10 (which does not exceed the threshold), 11, 0 and 40 levels.
        let report = baseline.measure(&[20, 0, 20, 43, 10, 10, 10, 10, 10, 50, 50, 50]).unwrap();
        assert_eq!(baseline.difference(), [10.0, 11.0, 0.0, 40.0]);
        assert_eq!(baseline.mask(), [false, true, false, true]);
        let centroid = Some(Centroid { x_px: 1.0, y_px: 0.5, x_mm: 0.5, y_mm: 0.125 });
        assert_eq!((report.pixels, report.area_mm2, report.centroid), (2, 0.25, centroid));
    }

    #[test]
    fn a_blur_spreads_a_difference_over_its_box() {
        let mut image = [0; 15];
        image[6..9].fill(90);
        let mut baseline = DifferenceBaseline::new(&[0; 15], settings(5, 1, 29.0, 1)).unwrap();
        let report = baseline.measure(&image).unwrap();
        assert_eq!(baseline.difference(), [0.0, 30.0, 30.0, 30.0, 0.0]);
        assert_eq!((report.pixels, report.centroid.map(|c| c.x_px)), (3, Some(2.0)));
    }

    #[test]
    fn at_the_border_the_box_is_cut() {
        let mut baseline = DifferenceBaseline::new(&[0; 12], settings(2, 2, 255.0, 1)).unwrap();
        baseline.measure(&[40, 40, 40, 0, 0, 0, 0, 0, 0, 0, 0, 0]).unwrap();
        assert_eq!(baseline.difference(), [10.0; 4]);
    }

    #[test]
    fn the_reference_itself_is_no_contact() {
        let mut baseline = DifferenceBaseline::new(&[7; 12], settings(2, 2, 0.0, 9)).unwrap();
        let report = baseline.measure(&[7; 12]).unwrap();
        assert_eq!((report.pixels, report.area_mm2, report.centroid), (0, 0.0, None));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        assert!(DifferenceBaseline::new(&[0; 11], settings(2, 2, 1.0, 0)).is_err());
        assert!(DifferenceBaseline::new(&[], settings(0, 2, 1.0, 0)).is_err());
        assert!(DifferenceBaseline::new(&[], settings(usize::MAX, 2, 1.0, 0)).is_err());
        for threshold in [-1.0, 256.0, f32::NAN] {
            assert!(DifferenceBaseline::new(&[0; 12], settings(2, 2, threshold, 0)).is_err());
        }
        let mut baseline = DifferenceBaseline::new(&[0; 12], settings(2, 2, 1.0, 0)).unwrap();
        let error = baseline.measure(&[0; 13]).unwrap_err().to_string();
        assert_eq!(error, "image (3 bytes a pixel): expected 12 values, found 13");
    }

    proptest! {
        #[test]
        fn running_sums_have_the_bits_of_summing_every_box(
            (width, height, images) in (1_usize..8, 1_usize..8).prop_flat_map(|(w, h)| {
                (Just(w), Just(h), prop::collection::vec(any::<[u8; 2]>(), w * h * 3))
            }),
            radius in 0_usize..10,
        ) {
            let (image, reference): (Vec<u8>, Vec<u8>) = images.into_iter().map(<(u8, u8)>::from).unzip();
            let mut baseline =
                DifferenceBaseline::new(&reference, settings(width, height, 80.0, radius)).unwrap();
            // Data of a previous image do not remain.
            baseline.measure(&reference).unwrap();
            let report = baseline.measure(&image).unwrap();
            let mut pixels = 0;
            for y in 0..height {
                for x in 0..width {
                    let mut values = Vec::new();
                    for v in (0..height).filter(|v| v.abs_diff(y) <= radius) {
                        for u in (0..width).filter(|u| u.abs_diff(x) <= radius) {
                            let at = (v * width + u) * 3;
                            values.extend((at..at + 3).map(|i| u32::from(image[i].abs_diff(reference[i]))));
                        }
                    }
                    let mean = (f64::from(values.iter().sum::<u32>()) / values.len() as f64) as f32;
                    prop_assert_eq!(baseline.difference()[y * width + x].to_bits(), mean.to_bits());
                    prop_assert_eq!(baseline.mask()[y * width + x], mean > 80.0);
                    pixels += usize::from(mean > 80.0);
                }
            }
            prop_assert_eq!(report.pixels, pixels);
        }
    }
}

mod normalisation {
    use proptest::prelude::*;

    use crate::systems::contact_area::{ContactError, ForceNormalisation, ImageNormalisation};

    #[test]
    fn two_pixels_become_three_planes() {
        let normalisation = ImageNormalisation::new([0.0, 0.5, 1.0], [1.0, 0.5, 0.25]).unwrap();
        let mut planes = [f32::NAN; 6];
        normalisation.apply(&[255, 255, 255, 0, 0, 0], None, &mut planes).unwrap();
        assert_eq!(planes, [1.0, 0.0, 1.0, -1.0, 0.0, -4.0]);
    }

    #[test]
    fn the_inverse_of_the_force_is_y_times_std_plus_mean() {
        let normalisation = ForceNormalisation::new(0.25, 2.0).unwrap();
        let mut map = [0.0, 1.0, -0.5];
        normalisation.apply(&mut map);
        assert_eq!(map, [0.25, 2.25, -0.75]);
        assert_eq!(ForceNormalisation::new(0.0, 1.0).unwrap().force(1e-4), 1e-4);
    }

    #[test]
    fn means_must_be_finite_and_deviations_positive() {
        for bad in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(ImageNormalisation::new([0.0; 3], [1.0, 1.0, bad]).is_err(), "{bad}");
            assert!(ForceNormalisation::new(0.0, bad).is_err(), "{bad}");
        }
        for bad in [f32::NAN, f32::NEG_INFINITY] {
            assert!(ImageNormalisation::new([0.0, bad, 0.0], [1.0; 3]).is_err(), "{bad}");
            assert!(ForceNormalisation::new(bad, 1.0).is_err(), "{bad}");
        }
        let error = ImageNormalisation::new([0.0; 3], [1.0, 1.0, -1.0]).unwrap_err().to_string();
        assert_eq!(error, "standard deviation of the image: expected a positive number, found -1");
        assert!(ImageNormalisation::new([0.0; 3], [1.0, 1.0, 1e-40]).is_err(), "1 / 1e-40 is beyond f32");
    }

    #[test]
    fn lengths_that_do_not_fit_are_refused() {
        let normalisation = ImageNormalisation::new([0.0; 3], [1.0; 3]).unwrap();
        let error = normalisation.apply(&[0; 6], None, &mut [0.0; 5]).unwrap_err();
        assert_eq!(error, ContactError::Length { what: "planes", expected: 6, found: 5 });
        let error = normalisation.apply(&[0; 6], Some(&[0; 3]), &mut [0.0; 6]).unwrap_err();
        assert_eq!(
            error,
            ContactError::Length { what: "reference (3 bytes a pixel)", expected: 6, found: 3 }
        );
        assert!(normalisation.apply(&[0; 5], None, &mut [0.0; 5]).is_err());
        assert!(normalisation.apply(&[], None, &mut []).is_ok());
    }

    proptest! {
        #[test]
        fn the_tables_have_the_bits_of_the_equation(
            pairs in prop::collection::vec(any::<[[u8; 3]; 2]>(), 0..40),
            mean in prop::array::uniform3(-1.0_f32..2.0),
            std in prop::array::uniform3(0.01_f32..3.0),
        ) {
            let [rgb, reference] = [0, 1].map(|which| pairs.iter().map(|pair| pair[which]).collect::<Vec<_>>());
            let normalisation = ImageNormalisation::new(mean, std).unwrap();
            let [mut planes, mut differences] = [0, 1].map(|_| vec![f32::NAN; rgb.len() * 3]);
            normalisation.apply(rgb.as_flattened(), None, &mut planes).unwrap();
            normalisation.apply(rgb.as_flattened(), Some(reference.as_flattened()), &mut differences).unwrap();
            for (channel, (mean, std)) in mean.into_iter().zip(std).enumerate() {
                for (at, pixel) in rgb.iter().enumerate() {
                    let expected = (f32::from(pixel[channel]) / 255.0 - mean) / std;
                    prop_assert_eq!(planes[channel * rgb.len() + at].to_bits(), expected.to_bits());
                    let difference = f32::from(pixel[channel]) - f32::from(reference[at][channel]);
                    let expected = (difference / 255.0 - mean) / std;
                    prop_assert_eq!(differences[channel * rgb.len() + at].to_bits(), expected.to_bits());
                }
            }
        }
    }
}

mod overlay {
    use crate::systems::contact_area::overlay::{ColourMap, Overlay, Picture, blend};
    use crate::systems::contact_area::{Centroid, ContactError, ImageSize};

    const SIZE: ImageSize = ImageSize { width: 5, height: 5 };

    fn drawn(mask: &[bool], force: Option<&[f32]>, centroid: Option<(f64, f64)>) -> Vec<[u8; 3]> {
        let centroid = centroid.map(|(x_px, y_px)| Centroid { x_px, y_px, x_mm: 0.0, y_mm: 0.0 });
        let overlay = Overlay { arm: 1, ..Overlay::new(SIZE, 2.0).unwrap() };
        let mut out = vec![0; 75];
        overlay.draw(&Picture { rgb: &[100; 75], mask, force, centroid }, &mut out).unwrap();
        out.as_chunks().0.to_vec()
    }

    /// Rows and columns 1 to 3.
    fn square() -> [bool; 25] {
        std::array::from_fn(|at| (1..4).contains(&(at % 5)) && (1..4).contains(&(at / 5)))
    }

    #[test]
    fn without_a_contact_the_image_stays() {
        assert_eq!(drawn(&[false; 25], Some(&[9.0; 25]), None), [[100; 3]; 25]);
    }

    #[test]
    fn a_contact_has_an_outline_and_forces_inside_it() {
        let found = drawn(&square(), Some(&[1.0; 25]), None);
        // Half of the full scale: 255, 170, 0 with an opacity of 165 over 100.
        // (9000 + 255 * 165) / 255 = 200.3, (9000 + 170 * 165) / 255 = 145.3, 9000 / 255 = 35.3.
        for (at, pixel) in found.into_iter().enumerate() {
            let expected = match (square()[at], at) {
                (_, 12) => [200, 145, 35],
                (true, _) => [255; 3],
                (false, _) => [100; 3],
            };
            assert_eq!(pixel, expected, "pixel {at}");
        }
        assert_eq!(drawn(&square(), None, None)[12], [100; 3]);
    }

    #[test]
    fn a_contact_at_the_border_has_its_outline_there() {
        let found = drawn(&[true; 25], None, None);
        let edges = found.iter().filter(|pixel| **pixel == [255; 3]).count();
        assert_eq!((edges, found[12]), (16, [100; 3]));
    }

    #[test]
    fn the_cross_is_cut_at_the_border() {
        let blue = [0, 90, 255];
        let places = |x, y| -> Vec<usize> {
            let found = drawn(&[false; 25], None, Some((x, y)));
            (0..25).filter(|&at| found[at] == blue).collect()
        };
        assert_eq!(places(2.4, 1.5), [7, 11, 12, 13, 17]);
        assert_eq!(places(0.0, 0.0), [0, 1, 5]);
        assert_eq!(places(-1.0, 4.0), [20]);
        assert!(places(f64::INFINITY, f64::MIN).is_empty());
    }

    #[test]
    fn an_opaque_colour_covers_and_a_transparent_one_does_not() {
        let mut pixel = [10, 20, 30];
        blend(&mut pixel, [200, 210, 220, 0]);
        assert_eq!(pixel, [10, 20, 30]);
        blend(&mut pixel, [200, 210, 220, 255]);
        assert_eq!(pixel, [200, 210, 220]);
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let overlay = Overlay::new(SIZE, 2.0).unwrap();
        assert_eq!(overlay.colours, ColourMap::HEAT);
        let (rgb, mask, force) = ([0; 75], [false; 25], [0.0; 25]);
        let whole = Picture { rgb: &rgb, mask: &mask, force: Some(&force), centroid: None };
        let cut = [
            Picture { rgb: &rgb[1..], ..whole },
            Picture { mask: &mask[1..], ..whole },
            Picture { force: Some(&force[1..]), ..whole },
        ];
        for picture in cut {
            assert!(matches!(overlay.draw(&picture, &mut [0; 75]), Err(ContactError::Length { .. })));
        }
        assert!(overlay.draw(&whole, &mut [0; 74]).is_err());
        for scale in [0.0, -1.0, f32::NAN, f32::INFINITY] {
            assert!(Overlay::new(SIZE, scale).is_err());
        }
    }

    #[test]
    fn the_points_themselves_are_met() {
        for (index, point) in ColourMap::HEAT.points.into_iter().enumerate() {
            assert_eq!(ColourMap::HEAT.at(index as f32 / 4.0), point);
        }
    }

    #[test]
    fn between_two_points_it_is_linear() {
        let map = ColourMap { points: [[0; 4], [0, 100, 200, 255], [0; 4], [0; 4], [0; 4]] };
        assert_eq!(map.at(0.125), [0, 50, 100, 128]);
        assert_eq!(map.at(0.3125), [0, 75, 150, 191]);
    }

    #[test]
    fn beyond_its_ends_it_stays_at_them() {
        let map = ColourMap::HEAT;
        assert_eq!([-1.0, f32::NAN, f32::NEG_INFINITY].map(|t| map.at(t)), [map.points[0]; 3]);
        assert_eq!([1.5, f32::INFINITY].map(|t| map.at(t)), [map.points[4]; 2]);
    }
}

mod report {
    use proptest::prelude::*;

    use crate::systems::contact_area::report::{
        ContactMeter, ContactReport, ContactSettings, RunningMedian, force_mae, iou,
    };
    use crate::systems::contact_area::{Centroid, ContactError, ImageSize, PixelSize};

    fn settings(width: usize, height: usize) -> ContactSettings {
        ContactSettings::new(ImageSize { width, height }, PixelSize::new(0.5, 0.25).unwrap())
    }

    fn meter(width: usize, height: usize) -> ContactMeter {
        ContactMeter::new(settings(width, height)).unwrap()
    }

    #[test]
    fn a_contact_is_counted_weighed_and_placed() {
        let mut meter = meter(3, 2);
        let report = meter.measure(&[0.0, 1.0, 0.0, -5.0, 1.0, 2.0]).unwrap();
        let expected = ContactReport {
            pixels: 3,
            area_mm2: 0.375,
            force_n: 4.0,
            median_force_n: 4.0,
            // (1 * 1 + 1 * 1 + 2 * 2) / 4 and (1 * 0 + 1 * 1 + 2 * 1) / 4.
            centroid: Some(Centroid { x_px: 1.5, y_px: 0.75, x_mm: 0.75, y_mm: 0.1875 }),
        };
        assert_eq!(report, expected);
        assert_eq!(meter.mask(), [false, true, false, false, true, true]);
    }

    #[test]
    fn a_force_at_the_threshold_is_no_contact() {
        let above = f32::from_bits(1e-4_f32.to_bits() + 1);
        let report = meter(2, 1).measure(&[1e-4, above]).unwrap();
        assert_eq!((report.pixels, report.force_n), (1, f64::from(above)));
    }

    #[test]
    fn without_a_contact_there_is_no_force_and_no_centroid() {
        let report = meter(2, 1).measure(&[1e-5, -1.0]).unwrap();
        assert_eq!((report.pixels, report.area_mm2, report.force_n, report.centroid), (0, 0.0, 0.0, None));
    }

    #[test]
    fn the_median_of_five_passes_over_an_outlier() {
        let mut meter = meter(1, 1);
        let medians = [1.0, 1.0, 50.0, 2.0, 2.0, 3.0].map(|f| meter.measure(&[f]).unwrap().median_force_n);
        assert_eq!(medians, [1.0, 1.0, 1.0, 1.5, 2.0, 2.0]);
        meter.reset();
        assert_eq!(meter.mask(), [false]);
        assert_eq!(meter.measure(&[9.0]).unwrap().median_force_n, 9.0);
    }

    #[test]
    fn a_map_that_is_refused_leaves_no_trace() {
        let mut meter = meter(2, 2);
        meter.measure(&[1.0, 0.0, 0.0, 0.0]).unwrap();
        let before = meter.clone();
        let error = meter.measure(&[2.0, 2.0, f32::NEG_INFINITY, 2.0]).unwrap_err().to_string();
        assert_eq!(error, "map of forces: expected finite values, found -inf at column 0, row 1");
        let error = meter.measure(&[2.0; 3]).unwrap_err();
        assert_eq!(error, ContactError::Length { what: "map of forces", expected: 4, found: 3 });
        assert_eq!(meter, before);
    }

    #[test]
    fn settings_that_mean_nothing_are_refused() {
        for threshold_n in [-1e-4, f32::NAN, f32::INFINITY] {
            assert!(ContactMeter::new(ContactSettings { threshold_n, ..settings(1, 1) }).is_err());
        }
        assert!(ContactMeter::new(ContactSettings { median_window: 4, ..settings(1, 1) }).is_err());
        for (width, height) in [(0, 4), (4, 0), (usize::MAX, 2), (1 << 11, (1 << 11) + 1)] {
            assert!(ContactMeter::new(settings(width, height)).is_err(), "{width} {height}");
        }
        for (x_mm, y_mm) in [(0.0, 1.0), (1.0, -1.0), (f64::NAN, 1.0), (1.0, f64::INFINITY)] {
            assert!(PixelSize::new(x_mm, y_mm).is_err(), "{x_mm} {y_mm}");
        }
    }

    proptest! {
        #[test]
        fn the_report_has_the_bits_of_the_plain_sums(
            width in 1_usize..6,
            forces in prop::collection::vec(-1e-3_f32..1e-3, 6..30),
        ) {
            let height = forces.len() / width;
            let forces = &forces[..width * height];
            let report = meter(width, height).measure(forces).unwrap();
            let contact: Vec<usize> = (0..forces.len()).filter(|&at| forces[at] > 1e-4).collect();
            let sum = |weight: &dyn Fn(usize) -> usize| {
                contact.iter().map(|&at| f64::from(forces[at]) * weight(at) as f64).fold(0.0, |a, b| a + b)
            };
            let total = sum(&|_| 1);
            prop_assert_eq!((report.pixels, report.force_n.to_bits()), (contact.len(), total.to_bits()));
            let place = report.centroid.map(|c| (c.x_px, c.y_px));
            let expected = (sum(&|at| at % width) / total, sum(&|at| at / width) / total);
            prop_assert_eq!(place, (!contact.is_empty()).then_some(expected));
        }
    }

    #[test]
    fn an_outlier_does_not_pass() {
        let mut median = RunningMedian::new(5).unwrap();
        let found = [1.0, 2.0, 90.0, 3.0, 4.0, 5.0, 6.0].map(|value| median.push(value));
        assert_eq!(found, [1.0, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0]);
    }

    #[test]
    fn a_window_of_one_gives_the_value_itself() {
        let mut median = RunningMedian::new(1).unwrap();
        assert_eq!([3.0, -1.0, 2.0].map(|value| median.push(value)), [3.0, -1.0, 2.0]);
    }

    #[test]
    fn after_a_reset_nothing_is_remembered() {
        let mut median = RunningMedian::new(3).unwrap();
        for value in [7.0, 8.0, 9.0, 10.0] {
            median.push(value);
        }
        median.reset();
        assert_eq!([1.0, 2.0].map(|value| median.push(value)), [1.0, 1.5]);
    }

    #[test]
    fn an_even_window_is_refused() {
        assert!(RunningMedian::new(0).is_err());
        assert!(RunningMedian::new(usize::MAX).is_err());
        let error = RunningMedian::new(4).unwrap_err().to_string();
        assert_eq!(error, "window of the running median: expected an odd number up to 65535, found 4");
    }

    proptest! {
        #[test]
        fn the_median_is_that_of_the_sorted_window(
            half in 0_usize..5,
            values in prop::collection::vec(prop_oneof![any::<f64>(), (-3_i8..3).prop_map(f64::from)], 0..40),
        ) {
            let window = 2 * half + 1;
            let mut median = RunningMedian::new(window).unwrap();
            for end in 1..=values.len() {
                let mut last = values[end.saturating_sub(window)..end].to_vec();
                last.sort_by(f64::total_cmp);
                let middle = last.len() / 2;
                let expected = if last.len() % 2 == 1 {
                    last[middle]
                } else {
                    last[middle - 1] / 2.0 + last[middle] / 2.0
                };
                prop_assert_eq!(median.push(values[end - 1]).to_bits(), expected.to_bits());
            }
        }
    }

    #[test]
    fn the_iou_counts_common_pixels_over_all() {
        assert_eq!(iou(&[true, true, false, false], &[true, false, true, false]).unwrap(), 1.0 / 3.0);
        assert_eq!(iou(&[true, false], &[true, false]).unwrap(), 1.0);
        assert_eq!(iou(&[true, false], &[false, true]).unwrap(), 0.0);
    }

    #[test]
    fn masks_without_a_contact_agree() {
        assert_eq!(iou(&[false; 3], &[false; 3]).unwrap(), 1.0);
        assert_eq!(iou(&[], &[]).unwrap(), 1.0);
    }

    #[test]
    fn the_mae_is_the_mean_of_the_differences() {
        assert_eq!(force_mae(&[1.0, 2.0, -3.0, 0.0], &[1.5, 1.0, -3.0, 0.5]).unwrap(), 0.5);
    }

    #[test]
    fn maps_of_different_lengths_and_empty_ones_are_refused() {
        let error = iou(&[true], &[true, true]).unwrap_err().to_string();
        assert_eq!(error, "mask: expected 2 values, found 1");
        assert!(force_mae(&[1.0], &[1.0, 2.0]).is_err());
        assert!(force_mae(&[], &[]).is_err());
    }
}
