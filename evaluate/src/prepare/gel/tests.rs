//! Plans of presses: forces over time, indenters, optics.

use rayon::ThreadPoolBuilder;
use safetensors::SafeTensors;

use super::*;
use crate::streams::{floats, tensor};

fn plan<'a>(shapes: Shapes, presses: usize) -> GelPlan<'a> {
    let sensor = Some(GelSensor::default());
    GelPlan {
        sensor,
        optics: None,
        width_mm: None,
        shapes,
        presses,
        pictures: 1,
        force_n: [2.0, 2.0],
        saw_teeth: 0,
        size: [32, 24],
        coarseness: 1,
        seed: 3,
    }
}

/// The force of each picture in N, the map of each, the first byte of each press at rest, and the
/// width of a pixel.
fn pressed(plan: &GelPlan<'_>) -> (Vec<f64>, Vec<Vec<f32>>, Vec<u8>, f32) {
    let pool = ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let bytes = gel_presses(plan, &pool).unwrap().file.into_bytes();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let data = |name| tensor(&file, name, file.tensor(name).unwrap().dtype(), "").unwrap().data().to_vec();
    let maps: Vec<_> =
        floats(&data("force")).chunks_exact(plan.size[0] * plan.size[1]).map(<[f32]>::to_vec).collect();
    let forces = maps.iter().map(|map| map.iter().map(|&force| f64::from(force)).sum()).collect();
    let rest = data("reference").chunks_exact(plan.size[0] * plan.size[1] * 3).map(|rest| rest[0]).collect();
    (forces, maps, rest, floats(&data("pixel_mm"))[0])
}

#[test]
fn a_saw_tooth_rises_and_falls_in_straight_lines() {
    let plan = GelPlan { pictures: 19, saw_teeth: 2, ..plan(Shapes::Larger, 1) };
    let shares: Vec<_> = (0..19).map(|picture| plan.share(picture)).collect();
    // A tooth has ten steps: the fifth is the top, and the tenth is back at rest.
    let tooth = [0.2, 0.4, 0.6, 0.8, 1.0, 0.8, 0.6, 0.4, 0.2, 0.0];
    let expected: Vec<_> = tooth.iter().chain(&tooth[..9]).copied().collect();
    assert!(
        shares.iter().zip(&expected).all(|(found, expected)| (found - expected).abs() < 1e-12),
        "{shares:?}"
    );
    let (forces, ..) = pressed(&plan);
    for (force, share) in forces.iter().zip(expected) {
        // The surface extends beyond the middles of the outer pixels, but the pressure there is
        // unknown.
        assert!((force - 2.0 * share).abs() < 0.02, "{force} N, {share} of 2 N");
    }
    // Without teeth, one squared sine.
    let sine = GelPlan { pictures: 3, ..plan };
    let sine = GelPlan { saw_teeth: 0, ..sine };
    assert!((sine.share(0) - 0.5).abs() < 1e-12 && (sine.share(1) - 1.0).abs() < 1e-12);
}

#[test]
fn larger_indenters_press_everywhere_but_in_their_hole() {
    let touched = |shapes| pressed(&plan(shapes, 1)).1[0].iter().filter(|&&force| force > 0.0).count();
    assert_eq!(touched(Shapes::Larger), 32 * 24);
    let with_hole = touched(Shapes::LargerUnseen);
    assert!((600..32 * 24).contains(&with_hole), "{with_hole}");
}

#[test]
fn irregular_bodies_come_in_turn_and_are_the_same_for_every_seed() {
    let pool = ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let plan = plan(Shapes::Irregular, 7);
    let bytes = gel_presses(&plan, &pool).unwrap().file.into_bytes();
    let (_, header) = SafeTensors::read_metadata(&bytes).unwrap();
    let kinds = &header.metadata().as_ref().unwrap()["indenters"];
    let expected = "[\"body 1\",\"body 2\",\"body 3\",\"body 4\",\"body 5\",\"body 1\",\"body 2\"]";
    assert_eq!(kinds, expected);
    let body = |seed: u64| indenter(Shapes::Irregular, 3, &mut Random::new(seed)).0;
    assert_eq!(body(1), body(2));
}

#[test]
fn an_indenter_that_is_too_small_for_a_force_stops_at_the_greatest_depth() {
    let plan = GelPlan { force_n: [500.0, 500.0], ..plan(Shapes::Unseen, 3) };
    let pool = ThreadPoolBuilder::new().num_threads(1).build().unwrap();
    let bytes = gel_presses(&plan, &pool).unwrap().file.into_bytes();
    let file = SafeTensors::deserialize(&bytes).unwrap();
    let depths = floats(file.tensor("depth_mm").unwrap().data());
    assert!(depths.iter().all(|depth| (depth - 2.4).abs() < 1e-6), "{depths:?}");
}

#[test]
fn measured_optics_replace_the_camera_and_keep_the_contact() {
    let optics = MeasuredOptics::new(vec![0.0; 3 * 2 * 2 * 6], 2, 0.0).unwrap();
    let drawn = plan(Shapes::Unseen, 2);
    let shown = GelPlan { optics: Some(&optics), width_mm: Some(16.0), ..drawn };
    let (forces, _, rest, pixel_mm) = pressed(&shown);
    assert_eq!((rest, pixel_mm), (vec![128, 128], 0.5));
    assert!(forces.iter().all(|force| (force - 2.0).abs() < 0.1), "{forces:?}");
}
