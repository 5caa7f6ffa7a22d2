//! Pictures of a gel: the fitted lights against their twin in Python, and what a picture shows.

use meissner_models::random::Random;
use meissner_simulator::SimulatorError;
use meissner_simulator::gel::{Gel, GelCamera, GelSolver, Grid, Indenter, Load, Placed};

/// The size of the pictures that the lights were fitted to.
const GRID: Grid = Grid { width: 120, height: 160, pitch_mm: 0.1 };

fn near(found: [f32; 3], expected: [f32; 3], most: f32) {
    let is_near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() <= most);
    assert!(is_near, "{found:?}, expected {expected:?}");
}

#[test]
fn slopes_have_the_levels_of_the_fit() {
    // `lit` of train/area/lights.py, with the settings that it found, at a corner, in the middle, and at the other corner.
    let golden = [
        ([0.0, 0.0], [[175.79, 153.63, 201.64], [162.43, 169.71, 188.77], [153.19, 201.2, 182.8]]),
        ([0.4, -0.2], [[219.45, 170.71, 171.13], [202.46, 196.96, 171.04], [190.35, 246.34, 185.2]]),
        // The brightest level of a camera is 255.
        ([-1.0, 0.7], [[145.8, 135.5, 255.0], [133.9, 134.17, 244.73], [124.34, 134.49, 223.14]]),
    ];
    for ([along_x, along_y], expected) in golden {
        let plane = GRID.heights(|x, y| along_x * x + along_y * y);
        let picture = GelCamera::default().picture(&GRID, &plane, None).unwrap();
        let places = [0, 80 * 120 + 60, 159 * 120 + 119];
        for (place, expected) in places.into_iter().zip(expected) {
            near(picture[place], expected, 0.1);
        }
    }
}

#[test]
fn each_side_of_a_ball_has_the_colour_of_its_light() {
    let mut gel = GelSolver::new(Gel::default(), GRID).unwrap();
    let heights = Placed::upright(Indenter::Ball { radius_mm: 3.0 }).heights(&GRID);
    let surface = gel.press(&heights, Load::Depth(0.8)).unwrap().displacement_mm;
    let camera = GelCamera::default();
    let [flat, pressed] =
        [&vec![0.0; GRID.pixels()], &surface].map(|surface| camera.picture(&GRID, surface, None).unwrap());
    let change = |column: usize, row: usize| {
        let at = row * GRID.width + column;
        [0, 1, 2].map(|channel| pressed[at][channel] - flat[at][channel])
    };
    // Red from the left, green from below, blue from above; ten pixels from the middle.
    let (left, right, above, below) = (change(49, 79), change(69, 79), change(59, 69), change(59, 89));
    assert!(left[0] > 20.0 && right[0] < -10.0, "{left:?} {right:?}");
    assert!(below[1] > 20.0 && above[1] < -10.0, "{below:?} {above:?}");
    assert!(above[2] > 20.0 && below[2] < -10.0, "{above:?} {below:?}");
    // A corner far away hardly changes.
    assert!(change(0, 159).iter().all(|change| change.abs() < 6.0), "{:?}", change(0, 159));
}

#[test]
fn a_picture_of_half_the_pixels_has_the_same_levels() {
    let surface = |x: f64, y: f64| 0.8 * (-(x * x + y * y) / 8.0).exp();
    let half = Grid { width: 60, height: 80, pitch_mm: 0.2 };
    let [fine, coarse] = [GRID, half].map(|grid| {
        // The upper left corners of the pixels: those of the coarse grid are among those of the fine one.
        let corner = grid.heights(|x, y| surface(x - grid.pitch_mm / 2.0, y - grid.pitch_mm / 2.0));
        GelCamera::default().picture(&grid, &corner, None).unwrap()
    });
    for (row, column) in [(40, 30), (35, 25), (50, 30), (20, 50)] {
        near(coarse[row * 60 + column], fine[2 * row * 120 + 2 * column], 1.0);
    }
}

#[test]
fn noise_is_determined_by_its_seed_and_has_its_deviation() {
    let flat = vec![0.0; GRID.pixels()];
    let camera = GelCamera::default();
    let noisy = |seed| camera.picture(&GRID, &flat, Some(&mut Random::new(seed))).unwrap();
    assert_eq!(noisy(1), noisy(1));
    assert_ne!(noisy(1), noisy(2));
    let clean = camera.picture(&GRID, &flat, None).unwrap();
    for channel in 0..3 {
        let differences = noisy(3).into_iter().zip(&clean).map(|(a, b)| f64::from(a[channel] - b[channel]));
        let variance =
            differences.map(|difference| difference * difference).sum::<f64>() / clean.len() as f64;
        assert!((variance.sqrt() - camera.noise).abs() < 0.05, "channel {channel}: {}", variance.sqrt());
    }
}

#[test]
fn a_surface_of_another_size_is_refused_and_a_single_pixel_is_flat() {
    let camera = GelCamera::default();
    let error = camera.picture(&GRID, &[0.0], None).unwrap_err();
    assert_eq!(error, SimulatorError::Pixels { expected: 19200, found: 1 });
    let one = Grid { width: 1, height: 1, pitch_mm: 0.1 };
    let levels = camera.picture(&one, &[5.0], None).unwrap();
    assert_eq!(levels, camera.picture(&one, &[0.0], None).unwrap());
}
