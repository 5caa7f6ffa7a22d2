//! Pictures of a gel: the fitted lights against their twin in Python, and the content of pictures.

use std::f64::consts::{FRAC_PI_2, PI};

use meissner_kernels::random::Random;
use meissner_simulator::SimulatorError;
use meissner_simulator::gel::{
    Gel, GelCamera, GelSensor, GelSolver, Grid, Indenter, Lens, Light, Load, MeasuredOptics, Placed,
};

/// The size of the pictures that the lights were fitted to.
const GRID: Grid = Grid { width: 120, height: 160, pitch_mm: 0.1 };

const SIZE: [usize; 2] = [GRID.width, GRID.height];

fn near(found: [f32; 3], expected: [f32; 3], most: f32) {
    let is_near = found.iter().zip(expected).all(|(found, expected)| (found - expected).abs() <= most);
    assert!(is_near, "{found:?}, expected {expected:?}");
}

#[test]
fn slopes_have_the_levels_of_the_fit() {
    // `lit` of models/train/area/lights.py, with the settings that it found, at a corner, in the
    // middle, and at the other corner.
    let golden = [
        ([0.0, 0.0], [[175.79, 153.63, 201.64], [162.43, 169.71, 188.77], [153.19, 201.2, 182.8]]),
        ([0.4, -0.2], [[219.45, 170.71, 171.13], [202.46, 196.96, 171.04], [190.35, 246.34, 185.2]]),
        // The brightest level of a camera is 255.
        ([-1.0, 0.7], [[145.8, 135.5, 255.0], [133.9, 134.17, 244.73], [124.34, 134.49, 223.14]]),
    ];
    for ([along_x, along_y], expected) in golden {
        let plane = GRID.heights(|x, y| along_x * x + along_y * y);
        let picture = GelCamera::default().picture(&GRID, &plane, SIZE, None).unwrap();
        let places = [0, 80 * 120 + 60, 159 * 120 + 119];
        for (place, expected) in places.into_iter().zip(expected) {
            near(picture[place], expected, 0.1);
        }
    }
}

/// Optics of 5 bins a side: red follows the slope along columns, green the slope along rows, and
/// blue the column of the picture.
fn optics() -> MeasuredOptics {
    let bins = 5;
    let mut table = vec![0.0; 3 * bins * bins * 6];
    for (angle, direction) in (0..bins * bins).map(|bin| (bin / bins, bin % bins)) {
        let (steep, turn) = (angle as f64 / 4.0, PI * (direction as f64 / 2.0 - 1.0));
        let mut set = |colour: usize, term: usize, value: f64| {
            table[((colour * bins + angle) * bins + direction) * 6 + term] = value as f32;
        };
        set(0, 5, 100.0 * steep * turn.cos());
        set(1, 5, 100.0 * steep * turn.sin());
        set(2, 3, 0.1);
    }
    MeasuredOptics::new(table, bins, 0.0).unwrap()
}

#[test]
fn measured_optics_show_in_which_direction_a_surface_rises_and_nothing_where_it_is_flat() {
    let shown = |along_x: f64, along_y: f64| {
        let plane = GRID.heights(|x, y| along_x * x + along_y * y);
        optics().picture(&GRID, &plane, SIZE, None).unwrap()[80 * GRID.width + 60]
    };
    // At 45 degrees: half of the way to a right angle. The column is 322.2 of 640.
    let blue = 128.0 + 32.22;
    near(shown(1.0, 0.0), [178.0, 128.0, blue], 0.1);
    near(shown(-1.0, 0.0), [78.0, 128.0, blue], 0.1);
    near(shown(0.0, 1.0), [128.0, 178.0, blue], 0.1);
    near(shown(0.0, -1.0), [128.0, 78.0, blue], 0.1);
    near(shown(0.0, 0.0), [128.0; 3], 1e-3);
    // Half of the angle from which the table is used without correction.
    near(shown(0.06_f64.tan(), 0.0), [128.0 + 100.0 * 0.06 / FRAC_PI_2 as f32, 128.0, 128.0 + 16.11], 0.1);
}

#[test]
fn optics_that_cannot_be_are_refused_by_name() {
    let refused = |table: Vec<f32>, bins| MeasuredOptics::new(table, bins, 1.0).unwrap_err().to_string();
    assert_eq!(refused(vec![], 1), "bins is 1, expected at least 2");
    assert_eq!(refused(vec![0.0; 71], 2), "values of optics is 71, expected 3 x bins x bins x 6");
    assert_eq!(refused(vec![f32::NAN; 72], 2), "optics is NaN, expected finite values");
    assert!(matches!(optics().picture(&GRID, &[0.0], SIZE, None), Err(SimulatorError::Pixels { .. })));
}

#[test]
fn each_side_of_a_ball_has_the_colour_of_its_light() {
    let mut gel = GelSolver::new(Gel::default(), GRID).unwrap();
    let heights = Placed::upright(Indenter::Ball { radius_mm: 3.0 }).heights(&GRID);
    let surface = gel.press(&heights, Load::Depth(0.8)).unwrap().displacement_mm;
    let camera = GelCamera::default();
    let [flat, pressed] = [&vec![0.0; GRID.pixels()], &surface]
        .map(|surface| camera.picture(&GRID, surface, SIZE, None).unwrap());
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
        // The upper left corners of the pixels: those of the coarse grid are among those of the
        // fine one.
        let corner = grid.heights(|x, y| surface(x - grid.pitch_mm / 2.0, y - grid.pitch_mm / 2.0));
        GelCamera::default().picture(&grid, &corner, [grid.width, grid.height], None).unwrap()
    });
    for (row, column) in [(40, 30), (35, 25), (50, 30), (20, 50)] {
        near(coarse[row * 60 + column], fine[2 * row * 120 + 2 * column], 1.0);
    }
}

#[test]
fn noise_is_determined_by_its_seed_and_has_its_deviation() {
    let flat = vec![0.0; GRID.pixels()];
    let camera = GelCamera::default();
    let noisy = |seed| camera.picture(&GRID, &flat, SIZE, Some(&mut Random::new(seed))).unwrap();
    assert_eq!(noisy(1), noisy(1));
    assert_ne!(noisy(1), noisy(2));
    let clean = camera.picture(&GRID, &flat, SIZE, None).unwrap();
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
    let error = camera.picture(&GRID, &[0.0], SIZE, None).unwrap_err();
    assert_eq!(error, SimulatorError::Pixels { expected: 19200, found: 1 });
    let one = Grid { width: 1, height: 1, pitch_mm: 0.1 };
    let levels = camera.picture(&one, &[5.0], [1, 1], None).unwrap();
    assert_eq!(levels, camera.picture(&one, &[0.0], [1, 1], None).unwrap());
}

#[test]
fn a_shadow_falls_behind_a_wall_away_from_the_light_and_nowhere_else() {
    // One light from the left, 0.1 high at a distance of one width; the wall is 1 mm high.
    let light = Light { place: [-1.0, 0.5, 0.2], colour: [1.0; 3] };
    let dark = Light { place: [3.0, 3.0, 1.0], colour: [0.0; 3] };
    let wall: Vec<_> =
        (0..GRID.pixels()).map(|i| if (58..62).contains(&(i % GRID.width)) { 1.0 } else { 0.0 }).collect();
    let camera = GelCamera { lights: [light, dark, dark], wide: 0.02, ..GelCamera::default() };
    let level = |shadow: f64, column: usize| {
        let picture = GelCamera { shadow, ..camera }.picture(&GRID, &wall, SIZE, None).unwrap();
        picture[80 * GRID.width + column][0]
    };
    for column in [10, 50, 115] {
        assert_eq!(level(1.0, column).to_bits(), level(0.0, column).to_bits(), "{column}: in the light");
    }
    // Only the even light is left in the shadow, or a share of the light if a share is blocked.
    let even = (255.0 * camera.even[0].powf(1.0 / camera.gamma)) as f32;
    assert!((level(1.0, 66) - even).abs() < 0.01);
    assert!(level(1.0, 66) < level(0.5, 66) && level(0.5, 66) < level(0.0, 66));
}

#[test]
fn a_turned_camera_shows_the_turned_surface_as_a_turned_picture() {
    let camera = GelCamera { shadow: 0.3, ..GelCamera::default() };
    let turned = camera.turned(120.0 / 160.0);
    let side = Grid { width: 160, height: 120, pitch_mm: 0.1 };
    let surface = |x: f64, y: f64| 0.6 * (-((x - 1.0) * (x - 1.0) + 2.0 * y * y) / 4.0).exp();
    let upright = camera.picture(&GRID, &GRID.heights(surface), SIZE, None).unwrap();
    // Rows become columns, and columns become rows from below.
    let lying = turned.picture(&side, &side.heights(|x, y| surface(-y, x)), [160, 120], None).unwrap();
    for (column, row) in [(60, 80), (30, 20), (75, 85), (119, 159)] {
        near(lying[(119 - column) * 160 + row], upright[row * 120 + column], 0.7);
    }
}

#[test]
fn a_lens_bends_darkens_and_blurs() {
    let lens = Lens { distortion: 0.1, vignetting: 0.3, blur: 0.01 };
    let camera = GelCamera { lens, ..GelCamera::default() };
    let flat = vec![0.0; GRID.pixels()];
    let [plain, dark] =
        [GelCamera::default(), camera].map(|camera| camera.picture(&GRID, &flat, SIZE, None).unwrap());
    assert!(
        dark[0][0] < 0.95 * plain[0][0] && (dark[80 * 120 + 60][0] - plain[80 * 120 + 60][0]).abs() < 1.0
    );
    // All of the force is in the picture, wherever it presses: what is bent away from the middle
    // covers less of it.
    for place in [(60, 80), (40, 100), (90, 60)] {
        let pressure = GRID.heights(|x, y| {
            let (at_x, at_y) = GRID.place(place.0, place.1);
            (-((x - at_x) * (x - at_x) + (y - at_y) * (y - at_y)) / 0.5).exp()
        });
        let total = pressure.iter().sum::<f64>() * GRID.pitch_mm * GRID.pitch_mm;
        for size in [SIZE, [240, 320], [60, 80]] {
            let shown: f64 = lens.forces(&GRID, &pressure, size).iter().sum();
            assert!((shown / total - 1.0).abs() < 0.005, "{place:?} {size:?}: {shown} of {total}");
        }
    }
    // A sharp edge becomes as wide as the blur.
    let blurred = GelCamera { lens: Lens { blur: 0.02, ..Lens::default() }, ..GelCamera::default() };
    let step = GRID.heights(|x, _| if x < 0.0 { 0.0 } else { 0.4 * x });
    let [sharp, soft] =
        [GelCamera::default(), blurred].map(|camera| camera.picture(&GRID, &step, SIZE, None).unwrap());
    let rise = |picture: &[[f32; 3]]| {
        (0..119).map(|i| (picture[9600 + i + 1][0] - picture[9600 + i][0]).abs()).fold(0.0, f32::max)
    };
    assert!(rise(&soft) < 0.4 * rise(&sharp), "{} {}", rise(&soft), rise(&sharp));
}

#[test]
fn a_picture_has_more_pixels_than_its_surface() {
    let surface = |x: f64, y: f64| 0.8 * (-(x * x + y * y) / 8.0).exp();
    let coarse = Grid { width: 60, height: 80, pitch_mm: 0.2 };
    let [fine, from_coarse] = [GRID, coarse]
        .map(|grid| GelCamera::default().picture(&grid, &grid.heights(surface), SIZE, None).unwrap());
    for (fine, coarse) in fine.iter().zip(&from_coarse) {
        near(*coarse, *fine, 1.5);
    }
}

#[test]
fn drawn_sensors_are_spread_about_the_default_and_the_second_one_is_among_them() {
    type Property<'a> = &'a dyn Fn(&GelSensor) -> f64;

    let default = GelSensor::default();
    let drawn: Vec<_> = (0..400).map(|seed| GelSensor::drawn(&mut Random::new(seed))).collect();
    assert_eq!(drawn[7], GelSensor::drawn(&mut Random::new(7)));
    // The logarithm of a property over the default's: its mean, its deviation, and the second
    // sensor's.
    let spread = |of: Property<'_>| {
        let logarithm = |sensor: &GelSensor| (of(sensor) / of(&default)).ln();
        let values: Vec<_> = drawn.iter().map(logarithm).collect();
        let mean = values.iter().sum::<f64>() / 400.0;
        let deviation = (values.iter().map(|v| (v - mean) * (v - mean)).sum::<f64>() / 399.0).sqrt();
        (mean, deviation, logarithm(&GelSensor::second()))
    };
    let strength = |light: usize| move |sensor: &GelSensor| sensor.camera.lights[light].colour[light];
    let cases: [(Property<'_>, f64); 6] = [
        (&|sensor| sensor.gel.modulus_mpa, 0.12),
        (&|sensor| sensor.gel.thickness_mm, 0.1),
        (&|sensor| sensor.width_mm, 0.07),
        (&strength(0), 0.2),
        (&strength(1), 0.2),
        (&strength(2), 0.2),
    ];
    for (i, (of, expected)) in cases.into_iter().enumerate() {
        let (mean, deviation, second) = spread(of);
        assert!(
            mean.abs() < 0.2 * expected && (deviation / expected - 1.0).abs() < 0.15,
            "{i}: {mean} {deviation}"
        );
        assert!((0.5..2.0).contains(&(second.abs() / expected)), "{i}: {second}");
    }
    assert!(drawn.iter().all(|sensor| (0.0..=0.5).contains(&sensor.camera.shadow)));
    let grid = default.grid(320, 240);
    assert!((grid.pitch_mm - 0.06).abs() < 1e-12 && grid.pixels() == 76_800);
}
