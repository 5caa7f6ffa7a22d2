//! A gel under an indenter: closed forms, slow twins, and refusals.

use std::f64::consts::{PI, SQRT_2, TAU};

use meissner_simulator::SimulatorError;
use meissner_simulator::gel::{
    Contact, Gel, GelSolver, Grid, Indenter, LETTERS, Load, Placed, Relaxation, Strain,
};
use proptest::prelude::*;

const HALF_SPACE: Gel =
    Gel { modulus_mpa: 0.2, poisson: 0.5, thickness_mm: f64::INFINITY, friction: 0.6, strain: Strain::Small };
const GRID: Grid = Grid { width: 72, height: 64, pitch_mm: 0.05 };

/// `E / (1 - nu^2)`.
fn plane_modulus(gel: &Gel) -> f64 {
    gel.modulus_mpa / (1.0 - gel.poisson * gel.poisson)
}

fn solver(gel: Gel, grid: Grid) -> GelSolver {
    GelSolver::new(gel, grid).unwrap()
}

/// A paraboloid, the sphere of Hertz.
fn ball(radius_mm: f64) -> impl Fn(f64, f64) -> f64 {
    move |x, y| (x * x + y * y) / (2.0 * radius_mm)
}

fn near(found: f64, expected: f64, share: f64) {
    assert!((found - expected).abs() <= share * expected.abs(), "{found}, expected {expected}");
}

/// The largest distance from the middle among pixels with `is_there`.
fn radius(grid: &Grid, is_there: impl Fn(usize) -> bool) -> f64 {
    let places =
        (0..grid.pixels()).filter(|&i| is_there(i)).map(|i| grid.place(i % grid.width, i / grid.width));
    places.map(|(x, y)| x.hypot(y)).fold(0.0, f64::max)
}

#[test]
fn a_ball_has_the_pressure_of_hertz() {
    let (radius_mm, depth_mm) = (10.0, 0.1);
    let heights = GRID.heights(ball(radius_mm));
    let contact = solver(HALF_SPACE, GRID).press(&heights, Load::Depth(depth_mm)).unwrap();
    let modulus = plane_modulus(&HALF_SPACE);
    // Hertz 1882; Johnson 1985, Eq. 4.22 to 4.24.
    let touching_mm = (radius_mm * depth_mm).sqrt();
    near(contact.force_n, 4.0 / 3.0 * modulus * radius_mm.sqrt() * depth_mm.powf(1.5), 0.005);
    near(radius(&GRID, |i| contact.pressure_mpa[i] > 0.0), touching_mm, 0.04);
    let highest = 2.0 * modulus / PI * (depth_mm / radius_mm).sqrt();
    for (i, &pressure) in contact.pressure_mpa.iter().enumerate() {
        let (x, y) = GRID.place(i % GRID.width, i / GRID.width);
        let share = 1.0 - x.hypot(y).powi(2) / touching_mm.powi(2);
        if share > 0.2 {
            near(pressure, highest * share.sqrt(), 0.01);
        } else if share < -0.2 {
            assert_eq!(pressure, 0.0, "at {x}, {y}");
        }
    }
    // Outside the contact: Johnson 1985, Eq. 3.42a.
    let (x, y) = GRID.place(GRID.width - 1, GRID.height / 2);
    let (a, r) = (touching_mm, x.hypot(y));
    let outside =
        ((2.0 * a * a - r * r) * (a / r).asin() + r * a * (1.0 - (a / r).powi(2)).sqrt()) / (PI * radius_mm);
    near(contact.displacement_mm[GRID.height / 2 * GRID.width + GRID.width - 1], outside, 0.01);
}

#[test]
fn a_flat_punch_presses_most_at_its_rim() {
    let (punch_mm, depth_mm) = (1.2, 0.05);
    let heights = GRID.heights(|x, y| if x.hypot(y) <= punch_mm { 0.0 } else { f64::INFINITY });
    let contact = solver(HALF_SPACE, GRID).press(&heights, Load::Depth(depth_mm)).unwrap();
    // Boussinesq 1885; Johnson 1985, Eq. 3.34 and 3.36.
    let modulus = plane_modulus(&HALF_SPACE);
    near(contact.force_n, 2.0 * punch_mm * modulus * depth_mm, 0.02);
    let middle = GRID.height / 2 * GRID.width + GRID.width / 2;
    near(contact.pressure_mpa[middle], modulus * depth_mm / (PI * punch_mm), 0.02);
    let rim = middle + 23;
    assert!(contact.pressure_mpa[rim] > 2.0 * contact.pressure_mpa[middle]);
    near(contact.displacement_mm[middle], depth_mm, 1e-4);
}

#[test]
fn a_force_and_the_depth_that_it_takes_give_the_same_contact() {
    let mut gel = solver(Gel::default(), GRID);
    let heights = GRID.heights(|x, y| (x * x + 2.0 * y * y + 0.3 * (4.0 * x).sin().abs()) / 8.0);
    let by_depth = gel.press(&heights, Load::Depth(0.2)).unwrap();
    let by_force = gel.press(&heights, Load::Force(by_depth.force_n)).unwrap();
    near(by_force.force_n, by_depth.force_n, 1e-9);
    near(by_force.depth_mm, 0.2, 1e-3);
    let largest = by_depth.pressure_mpa.iter().copied().fold(0.0, f64::max);
    for (a, b) in by_depth.pressure_mpa.iter().zip(&by_force.pressure_mpa) {
        assert!((a - b).abs() < 0.01 * largest, "{a} and {b}");
    }
}

#[test]
fn a_thin_layer_is_as_stiff_as_a_column_and_a_thick_one_a_half_space() {
    let grid = Grid { width: 48, height: 48, pitch_mm: 0.5 };
    let ones = vec![1e-3; grid.pixels()];
    let middle = 24 * 48 + 24;
    for poisson in [0.0, 0.3, 0.45] {
        let gel = Gel { modulus_mpa: 0.2, poisson, thickness_mm: 1.0, friction: 0.0, strain: Strain::Small };
        // A uniform pressure far and wide compresses columns that cannot widen.
        let column = (1.0 + poisson) * (1.0 - 2.0 * poisson) / (0.2 * (1.0 - poisson)) * 1e-3;
        near(solver(gel, grid).displacement(&ones)[middle], column, 0.01);
        let (thick, half_space) =
            (Gel { thickness_mm: 4000.0, ..gel }, Gel { thickness_mm: f64::INFINITY, ..gel });
        let moved = [thick, half_space].map(|gel| solver(gel, grid).displacement(&ones)[middle]);
        near(moved[0], moved[1], 0.01);
    }
    let heights = GRID.heights(ball(5.0));
    let forces = [0.5, 1.0, 2.0, 4.0, 100.0].map(|thickness_mm| {
        let gel = Gel { thickness_mm, ..Gel::default() };
        solver(gel, GRID).press(&heights, Load::Depth(0.15)).unwrap().force_n
    });
    assert!(forces.is_sorted_by(|a, b| a > b), "{forces:?}");
}

/// Displacements of the nodes at the top of a finite-element gel, 5.5 mm thick and slightly domed,
/// under a load on one node: distance in mm, mean of the nodes of a ring as a share of the loaded
/// one's, and their standard deviation. Computed from the published field of Taxim (Si and Yuan
/// 2022), which states neither load nor material.
const FINITE_ELEMENTS: [[f64; 3]; 6] = [
    [0.763, 0.1384, 0.0311],
    [1.058, 0.0874, 0.0129],
    [1.404, 0.0580, 0.0083],
    [1.805, 0.0377, 0.0051],
    [2.259, 0.0240, 0.0036],
    [2.756, 0.0146, 0.0022],
];

#[test]
fn a_point_load_has_the_shape_of_a_finite_element_gel() {
    let grid = Grid { width: 65, height: 65, pitch_mm: 0.1 };
    let mut pressure = vec![0.0; grid.pixels()];
    pressure[32 * 65 + 32] = 0.01;
    let gel = Gel { thickness_mm: 5.5, ..Gel::default() };
    let moved = solver(gel, grid).displacement(&pressure);
    // Along a row: rings of 1.4 mm are 14 pixels from the middle.
    let at = |away_mm: f64| grid.between([32.0 + away_mm / grid.pitch_mm, 32.0], |i| moved[i]);
    let [reference_mm, reference, _] = FINITE_ELEMENTS[2];
    let scale = reference / at(reference_mm);
    for [away_mm, share, deviation] in FINITE_ELEMENTS {
        let found = scale * at(away_mm);
        assert!(
            (found - share).abs() < deviation,
            "{found} at {away_mm} mm, expected {share} +- {deviation}"
        );
    }
}

/// The default gel under large pressures.
const STIFFENING: Gel =
    Gel { modulus_mpa: 0.15, poisson: 0.48, thickness_mm: 4.0, friction: 0.8, strain: Strain::Logarithmic };

#[test]
fn a_thin_layer_under_a_large_pressure_is_a_column_of_hencky() {
    let grid = Grid { width: 48, height: 48, pitch_mm: 0.5 };
    let middle = 24 * 48 + 24;
    let gel = Gel { poisson: 0.3, thickness_mm: 1.0, ..STIFFENING };
    let confined_mpa = 0.15 * 0.7 / (1.3 * 0.4);
    for pressure in [0.01_f64, 0.1, 0.3] {
        // The stress is the modulus times the logarithm of the stretch 1 - moved / thickness.
        let expected = 1.0 - (-pressure / confined_mpa).exp();
        near(solver(gel, grid).displacement(&vec![pressure; grid.pixels()])[middle], expected, 0.01);
    }
}

#[test]
fn a_stiffening_gel_touches_where_it_presses_and_never_lies_beyond_the_indenter() {
    for indenter in indenters() {
        let heights = Placed { tilts: [0.02, -0.01], ..Placed::upright(indenter) }.heights(&GRID);
        let mut gel = solver(Gel { thickness_mm: 1.0, ..STIFFENING }, GRID);
        let contact = gel.press(&heights, Load::Depth(0.5)).unwrap();
        assert_eq!(contact.depth_mm, gel.gel().strain.moved(1.0, gel.gel().strain.linear(1.0, 0.5)));
        for (i, height) in heights.iter().enumerate() {
            let gap = contact.displacement_mm[i] - (contact.depth_mm - height);
            assert!(gap > -2e-4, "{indenter:?}: {gap} at {i}");
            assert!(contact.pressure_mpa[i] == 0.0 || gap.abs() < 2e-4, "{indenter:?}: {gap} at {i}");
        }
        // The force at a depth leads back to that depth.
        let again = gel.press(&heights, Load::Force(contact.force_n)).unwrap();
        near(again.depth_mm, 0.5, 1e-3);
        near(again.force_n, contact.force_n, 1e-9);
    }
}

#[test]
fn a_stiffening_gel_is_one_of_small_strains_at_first_and_then_stiffer() {
    let heights = GRID.heights(ball(2.0));
    let force = |strain: Strain, depth_mm: f64| {
        solver(Gel { strain, thickness_mm: 1.0, ..STIFFENING }, GRID)
            .press(&heights, Load::Depth(depth_mm))
            .unwrap()
            .force_n
    };
    near(force(Strain::Logarithmic, 0.005), force(Strain::Small, 0.005), 0.01);
    let ratios =
        [0.1, 0.3, 0.6].map(|depth_mm| force(Strain::Logarithmic, depth_mm) / force(Strain::Small, depth_mm));
    assert!(ratios[0] > 1.03 && ratios.is_sorted(), "{ratios:?}");
    // A half-space has no thickness to be compressed.
    let half_space = |strain: Strain| Gel { strain, ..HALF_SPACE };
    let [small, large] = [Strain::Small, Strain::Logarithmic]
        .map(|strain| solver(half_space(strain), GRID).press(&heights, Load::Depth(0.1)).unwrap());
    assert_eq!(small, large);
}

#[test]
fn a_ball_that_is_shifted_sticks_in_the_circle_of_mindlin() {
    let (radius_mm, depth_mm) = (10.0, 0.1);
    let heights = GRID.heights(ball(radius_mm));
    let mut gel = solver(HALF_SPACE, GRID);
    let contact = gel.press(&heights, Load::Depth(depth_mm)).unwrap();
    let limit_n = HALF_SPACE.friction * contact.force_n;
    // Mindlin 1949; Johnson 1985, Eq. 7.39 and 7.42: the shift and the stick circle under a share
    // of the limit.
    let (a, shear) = ((radius_mm * depth_mm).sqrt(), HALF_SPACE.modulus_mpa / 3.0);
    for share in [0.2, 0.5, 0.9_f64] {
        let slips = (1.0 - share).powf(1.0 / 3.0);
        let shift_mm =
            3.0 * limit_n * (2.0 - HALF_SPACE.poisson) / (16.0 * a * shear) * (1.0 - slips * slips);
        let slide = gel.slide(&heights, &contact, shift_mm).unwrap();
        near(slide.force_n, share * limit_n, 0.02);
        assert!((radius(&GRID, |i| slide.sticks[i]) - a * slips).abs() < 1.5 * GRID.pitch_mm, "{share}");
    }
    let far = gel.slide(&heights, &contact, 1.0).unwrap();
    near(far.force_n, limit_n, 1e-9);
    assert!(!far.sticks.contains(&true));
    assert_eq!(gel.slide(&heights, &contact, 0.0).unwrap().force_n, 0.0);
}

/// The displacement as a direct sum over all pairs of pixels.
fn summed(kernel: &[Vec<f64>], pressure: &[f64]) -> Vec<f64> {
    kernel.iter().map(|row| row.iter().zip(pressure).map(|(k, p)| k * p).sum()).collect()
}

/// The kernel between all pairs: the displacement under the pressure of one pixel after the other.
fn pairs(gel: &mut GelSolver) -> Vec<Vec<f64>> {
    let pixels = gel.grid().pixels();
    let unit = |i: usize| (0..pixels).map(|j| f64::from(u8::from(i == j))).collect::<Vec<_>>();
    (0..pixels).map(|i| gel.displacement(&unit(i))).collect()
}

/// Projected Gauss-Seidel: pixel after pixel takes the pressure that closes its gap, or none.
fn relaxed(kernel: &[Vec<f64>], heights: &[f64], depth_mm: f64) -> Vec<f64> {
    let mut pressure = vec![0.0; heights.len()];
    for _ in 0..4000 {
        for i in 0..heights.len() {
            let moved: f64 = kernel[i].iter().zip(&pressure).map(|(k, p)| k * p).sum();
            let gap = moved - (depth_mm - heights[i]);
            pressure[i] = f64::max(0.0, pressure[i] - gap / kernel[i][i]);
        }
    }
    pressure
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(24))]

    #[test]
    fn any_indenter_has_the_contact_of_the_slow_twin(
        heights in prop::collection::vec(prop_oneof![4 => 0.0..0.4, 1 => Just(f64::INFINITY)], 9 * 7),
        depth_mm in 0.05..0.5,
        thickness_mm in prop_oneof![0.5..5.0, Just(f64::INFINITY)],
        poisson in 0.0..0.5,
    ) {
        let grid = Grid { width: 9, height: 7, pitch_mm: 0.3 };
        let mut gel = solver(Gel { thickness_mm, poisson, ..Gel::default() }, grid);
        let kernel = pairs(&mut gel);
        // The kernel is symmetric, and falls with the distance.
        for (i, row) in kernel.iter().enumerate() {
            for (j, &value) in row.iter().enumerate() {
                prop_assert!((value - kernel[j][i]).abs() < 1e-12 && row[i] >= value);
            }
        }
        let Contact { pressure_mpa, displacement_mm, force_n, .. } = gel.press(&heights, Load::Depth(depth_mm)).unwrap();
        let slow = relaxed(&kernel, &heights, depth_mm);
        let largest = slow.iter().copied().fold(1e-9, f64::max);
        let moved = summed(&kernel, &pressure_mpa);
        for i in 0..grid.pixels() {
            prop_assert!((pressure_mpa[i] - slow[i]).abs() < 1e-3 * largest, "{i}: {} {}", pressure_mpa[i], slow[i]);
            prop_assert!((displacement_mm[i] - moved[i]).abs() < 1e-9);
            // No pixel is pulled, gel and indenter do not overlap, and they touch where there is
            // pressure.
            let gap = displacement_mm[i] - (depth_mm - heights[i]);
            prop_assert!(pressure_mpa[i] >= 0.0 && gap > -1e-4, "{i}: {gap}");
            prop_assert!(pressure_mpa[i] < 1e-3 * largest || gap < 1e-4, "{i}: {gap}");
        }
        prop_assert!((force_n - pressure_mpa.iter().sum::<f64>() * 0.09).abs() < 1e-9);
    }

    /// The pressure at the end of a ramp does not depend on its division into steps.
    #[test]
    fn a_ramp_relaxes_the_same_in_any_steps(cuts in prop::collection::vec(0.001..0.2, 1..20), share in 0.0..1.0, time_s in 0.01..2.0) {
        let whole: f64 = cuts.iter().sum();
        let at_once = Relaxation::new(1, share, time_s).step(whole, &[3.0]);
        let mut gel = Relaxation::new(1, share, time_s);
        let (mut now, mut pressure) = (0.0, vec![0.0]);
        for cut in cuts {
            now += cut;
            pressure = gel.step(cut, &[3.0 * now / whole]);
        }
        prop_assert!((pressure[0] - at_once[0]).abs() < 1e-9, "{} {}", pressure[0], at_once[0]);
    }
}

#[test]
fn what_is_held_relaxes_and_what_is_let_go_is_0() {
    let mut gel = Relaxation::new(2, 0.4, 0.5);
    assert_eq!(gel.step(0.0, &[2.0, 0.0]), [2.0, 0.0]);
    near(gel.step(0.5, &[2.0, 0.0])[0], 2.0 * (0.6 + 0.4 * (-1.0_f64).exp()), 1e-12);
    near(gel.step(50.0, &[2.0, 0.0])[0], 1.2, 1e-9);
    // After a sudden release, the gel is still below its position at rest.
    assert_eq!(gel.step(0.0, &[0.0, 0.0]), [0.0, 0.0]);
}

#[test]
fn less_force_is_measured_on_the_way_back() {
    let mut gel = solver(Gel::default(), Grid { width: 24, height: 24, pitch_mm: 0.2 });
    let heights = gel.grid().heights(ball(6.0));
    let mut relaxation = Relaxation::new(gel.grid().pixels(), 0.3, 0.2);
    let depths = (0..=10).chain((0..10).rev()).map(|step| f64::from(step) * 0.03);
    let forces: Vec<f64> = depths
        .map(|depth_mm| {
            let elastic = gel.press(&heights, Load::Depth(depth_mm)).unwrap().pressure_mpa;
            relaxation.step(0.02, &elastic).iter().sum()
        })
        .collect();
    for step in 1..10 {
        assert!(forces[step] > 1.02 * forces[20 - step], "step {step}: {forces:?}");
    }
}

#[test]
fn no_indenter_and_no_depth_are_no_contact() {
    let mut gel = solver(Gel::default(), GRID);
    let heights = GRID.heights(ball(5.0));
    let none = gel.press(&heights, Load::Depth(0.0)).unwrap();
    assert_eq!((none.force_n, none.displacement_mm.iter().sum::<f64>()), (0.0, 0.0));
    let nothing = vec![f64::INFINITY; GRID.pixels()];
    assert_eq!(gel.press(&nothing, Load::Depth(1.0)).unwrap().force_n, 0.0);
    assert!(matches!(gel.press(&nothing, Load::Force(1.0)), Err(SimulatorError::NoContact { .. })));
    assert_eq!(gel.press(&heights, Load::Force(0.0)).unwrap().force_n, 0.0);
}

#[test]
fn what_cannot_be_is_refused_by_name() {
    let refused = |gel: Gel, grid: Grid| GelSolver::new(gel, grid).err().unwrap().to_string();
    let gel = Gel::default();
    assert_eq!(refused(Gel { poisson: 0.6, ..gel }, GRID), "poisson is 0.6, expected 0 to 0.5");
    assert_eq!(refused(Gel { modulus_mpa: 0.0, ..gel }, GRID), "modulus_mpa is 0, expected above 0");
    assert!(refused(Gel { thickness_mm: f64::NAN, ..gel }, GRID).starts_with("thickness_mm is NaN"));
    assert!(refused(gel, Grid { width: 0, ..GRID }).starts_with("width is 0"));
    let mut gel = solver(gel, GRID);
    let heights = GRID.heights(ball(5.0));
    assert!(matches!(gel.press(&heights[1..], Load::Depth(0.1)), Err(SimulatorError::Pixels { .. })));
    for (load, name) in [(Load::Depth(-1.0), "depth is -1"), (Load::Force(f64::NAN), "force is NaN")] {
        assert!(gel.press(&heights, load).unwrap_err().to_string().starts_with(name));
    }
    let too_deep = solver(STIFFENING, GRID).press(&heights, Load::Depth(4.0)).unwrap_err().to_string();
    assert_eq!(too_deep, "depth is 4, expected below the gel's thickness");
    let mut broken = heights;
    broken[7] = f64::NAN;
    assert!(gel.press(&broken, Load::Depth(0.1)).unwrap_err().to_string().starts_with("height is NaN"));
}

/// Every kind of indenter.
fn indenters() -> Vec<Indenter> {
    let mut all = vec![
        Indenter::Ball { radius_mm: 3.0 },
        Indenter::Cylinder { radius_mm: 2.0, length_mm: 3.0 },
        Indenter::Punch { radius_mm: 1.5 },
        Indenter::Ring { radius_mm: 1.8, hole_mm: 1.0 },
        Indenter::Block { width_mm: 2.0, length_mm: 1.2 },
        Indenter::Cone { half_angle: 1.2 },
        Indenter::Edge { half_angle: 1.2, length_mm: 2.5 },
        Indenter::Dots { radius_mm: 0.5, spacing_mm: 0.8, side: 3 },
        Indenter::Irregular { seed: 5, radius_mm: 6.0 },
        Indenter::Polygon { seed: 7, radius_mm: 1.8 },
        Indenter::Pins { seed: 3, radius_mm: 1.5 },
        Indenter::Ridges { seed: 3, radius_mm: 1.5 },
        Indenter::Wire { radius_mm: 0.5, bend_mm: 1.5, arc: 2.0 },
    ];
    all.extend(LETTERS.chars().map(|letter| Indenter::Letter { letter, size_mm: 3.0 }));
    all
}

#[test]
fn every_indenter_presses_with_its_lowest_part_and_more_the_deeper() {
    let mut gel = solver(Gel::default(), GRID);
    for indenter in indenters() {
        let placed =
            Placed { at_mm: [0.2, -0.1], turn: 0.4, tilts: [0.02, -0.01], ..Placed::upright(indenter) };
        let heights = placed.heights(&GRID);
        assert_eq!(heights.iter().copied().fold(f64::INFINITY, f64::min), 0.0, "{indenter:?}");
        let contacts = [0.05, 0.1].map(|depth_mm| gel.press(&heights, Load::Depth(depth_mm)).unwrap());
        assert!(contacts[1].force_n > 1.2 * contacts[0].force_n, "{indenter:?}");
        for (height, pressure) in heights.iter().zip(&contacts[1].pressure_mpa) {
            assert!(*pressure == 0.0 || *height <= 0.1 + 1e-6, "{indenter:?} presses at {height} mm");
        }
    }
}

#[test]
fn an_indenter_is_moved_and_turned_with_its_pixels() {
    let grid = Grid { width: 41, height: 41, pitch_mm: 0.1 };
    let letter = Indenter::Letter { letter: 'L', size_mm: 1.4 };
    let upright = Placed::upright(letter).heights(&grid);
    // The foot of the L is at its lower right; rows go down.
    let is_stroke = |heights: &[f64], column: usize, row: usize| heights[row * grid.width + column] == 0.0;
    assert!(is_stroke(&upright, 24, 26) && is_stroke(&upright, 16, 15) && !is_stroke(&upright, 24, 15));
    let moved = Placed { at_mm: [0.5, -0.3], ..Placed::upright(letter) }.heights(&grid);
    assert!(is_stroke(&moved, 29, 23) && is_stroke(&moved, 21, 12) && !is_stroke(&moved, 29, 12));
    // A quarter turn from x to y.
    let turned = Placed { turn: PI / 2.0, ..Placed::upright(letter) }.heights(&grid);
    assert!(is_stroke(&turned, 14, 24) && is_stroke(&turned, 25, 16) && !is_stroke(&turned, 25, 24));
    let seeds =
        [1, 2].map(|seed| Placed::upright(Indenter::Irregular { seed, radius_mm: 4.0 }).heights(&grid));
    assert_ne!(seeds[0], seeds[1]);
}

#[test]
fn pins_are_apart_or_overlap_within_their_radius() {
    let grid = Grid { width: 121, height: 121, pitch_mm: 0.15 };
    let mut counts = Vec::new();
    for seed in 0..40 {
        let heights = Placed::upright(Indenter::Pins { seed, radius_mm: 6.0 }).heights(&grid);
        let mut is_left: Vec<_> = heights.iter().map(|height| height.is_finite()).collect();
        for (pixel, height) in heights.iter().enumerate().filter(|(_, height)| height.is_finite()) {
            let [x, y] = [pixel % 121, pixel / 121].map(|i| (i as f64 - 60.0) * 0.15);
            // The outermost middle plus half a diagonal of the largest end.
            assert!(x.hypot(y) <= 6.0 + 2.0 * SQRT_2 && (0.0..=0.2).contains(height), "{seed}: {x}, {y}");
        }
        // Count of separate touching regions, by flood fill.
        let mut places = 0;
        while let Some(first) = is_left.iter().position(|&is| is) {
            let mut open = vec![first];
            places += 1;
            while let Some(pixel) = open.pop() {
                if is_left.get(pixel) == Some(&true) {
                    is_left[pixel] = false;
                    open.extend([pixel + 1, pixel + 121, pixel.wrapping_sub(1), pixel.wrapping_sub(121)]);
                }
            }
        }
        counts.push(places);
    }
    assert!(counts.iter().all(|places| (1..=9).contains(places)), "{counts:?}");
    assert!(counts.iter().filter(|&&places| places > 1).count() >= 30, "{counts:?}");
}

#[test]
fn ridges_are_alike_with_valleys_between() {
    for seed in 0..50 {
        let ridges = Indenter::Ridges { seed, radius_mm: 9.0 };
        let heights: Vec<_> = (-600..=600).map(|i| ridges.height(0.0, 0.01 * f64::from(i))).collect();
        // Crests are where a height is below both neighbours; they are all at height 0.
        let crests: Vec<_> =
            (1..1200).filter(|&i| heights[i] <= heights[i - 1] && heights[i] < heights[i + 1]).collect();
        assert!(crests.len() >= 2 && crests.iter().all(|&i| heights[i] < 1e-3), "{seed}: {crests:?}");
        let gaps: Vec<_> = crests.windows(2).map(|pair| pair[1] - pair[0]).collect();
        assert!(gaps.iter().all(|gap| gap.abs_diff(gaps[0]) <= 1), "{seed}: {gaps:?}");
        let valley = heights[crests[0]..crests[1]].iter().copied().fold(0.0, f64::max);
        assert!(valley > 0.05, "{seed}: {valley} mm");
        assert_eq!(ridges.height(0.0, 0.3), ridges.height(4.0, 0.3));
        assert!(ridges.height(9.1, 0.0).is_infinite());
    }
}

#[test]
fn polygons_hold_their_corners_and_wires_follow_their_arc() {
    for seed in 0..50 {
        let polygon = Indenter::Polygon { seed, radius_mm: 2.0 };
        let is_inside = |angle: f64, away: f64| polygon.height(away * angle.cos(), away * angle.sin()) == 0.0;
        for i in 0..90 {
            let angle = TAU * (f64::from(i) + 0.5) / 90.0;
            // Along a ray from the middle, the polygon ends once, and within its radius.
            let inside: Vec<_> = (1..40).map(|step| is_inside(angle, 0.06 * f64::from(step))).collect();
            assert!(inside.is_sorted_by(|before, after| before >= after) && !inside[33], "{seed}: {angle}");
            assert!(inside[0], "{seed}: {angle}");
        }
    }
    let wire = Indenter::Wire { radius_mm: 0.5, bend_mm: 2.0, arc: 1.0 };
    let at = |angle: f64, away: f64| wire.height(away * angle.cos() - 2.0, away * angle.sin());
    assert_eq!(wire.height(0.0, 0.0), 0.0);
    assert!(at(0.4, 2.0) < 1e-12 && (at(-0.4, 2.3) - 0.1).abs() < 1e-12);
    assert!(at(0.6, 2.0).is_infinite() && at(0.0, 2.6).is_infinite());
}
