use proptest::prelude::*;

use super::{ForceNormalisation, ImageNormalisation};
use crate::systems::contact_area::ContactError;

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
    assert_eq!(ForceNormalisation::IDENTITY.force(1e-4), 1e-4);
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
    assert_eq!(error, ContactError::Length { what: "reference (3 bytes a pixel)", expected: 6, found: 3 });
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
