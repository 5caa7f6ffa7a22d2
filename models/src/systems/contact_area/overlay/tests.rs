use super::{ColourMap, Overlay, Picture, blend};
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
    // (100 * 90 + 255 * 165) / 255 = 200.3, (9000 + 170 * 165) / 255 = 145.3, 9000 / 255 = 35.3.
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
