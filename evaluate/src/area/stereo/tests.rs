use meissner_simulator::gel::Grid;
use ndarray::Array2;

use super::*;

fn workers() -> Workers {
    Workers::from(rayon::ThreadPoolBuilder::new().num_threads(2).build().expect("threads"))
}

/// Least squares over each pair of neighbours and over the borders, by the method of Gauss and
/// Seidel.
fn slow_integral(slopes: &Array2<f64>, ImageSize { width, height }: ImageSize) -> Array2<f64> {
    let mut z = Array2::<f64>::zeros((height, width));
    let slope = |column: usize, row: usize, axis: usize| slopes[[row * width + column, axis]];
    for _ in 0..4000 {
        for (row, column) in (0..height).flat_map(|row| (0..width).map(move |column| (row, column))) {
            // Each neighbour asks for its own height less the mean slope between the two; a border
            // asks for the negative of this height, so that the height between them is 0.
            let here = [slope(column, row, 0), slope(column, row, 1)];
            let (mut asked, mut weight) = (0.0, 0.0);
            let mut ask = |to: Option<(usize, usize)>, axis: usize, sign: f64| {
                if let Some((column, row)) = to {
                    asked += z[[row, column]] - sign * (here[axis] + slope(column, row, axis)) / 2.0;
                    weight += 1.0;
                } else {
                    asked -= sign * here[axis];
                    weight += 2.0;
                }
            };
            ask((column + 1 < width).then_some((column + 1, row)), 0, 1.0);
            ask(column.checked_sub(1).map(|column| (column, row)), 0, -1.0);
            ask((row + 1 < height).then_some((column, row + 1)), 1, 1.0);
            ask(row.checked_sub(1).map(|row| (column, row)), 1, -1.0);
            z[[row, column]] = asked / weight;
        }
    }
    z
}

#[test]
fn an_integral_is_that_of_the_slow_way() {
    let mut random = Random::new(3);
    for size in [(13, 9), (8, 8), (1, 5), (6, 1), (1, 1)] {
        let size = ImageSize { width: size.0, height: size.1 };
        let slopes = Array2::from_shape_fn((size.width * size.height, 2), |_| random.uniform() - 0.5);
        let (found, expected) = (Poisson::new(size).integral(&slopes), slow_integral(&slopes, size));
        for (found, expected) in found.iter().zip(&expected) {
            assert!((found - expected).abs() < 1e-9, "{size:?}: {found} {expected}");
        }
    }
}

#[test]
fn slopes_of_a_known_surface_give_it_back() {
    let grid = Grid { width: 160, height: 120, pitch_mm: 0.12 };
    // Two hills and a valley that are flat near the borders.
    let hill = |x: f64, y: f64, wide: f64| (-(x * x + y * y) / (2.0 * wide * wide)).exp();
    let depth = grid.heights(|x, y| {
        0.8 * hill(x - 1.0, y - 0.5, 1.2) - 0.3 * hill(x + 2.0, y, 1.0) + 0.5 * hill(x, y + 1.5, 0.9)
    });
    let poisson = Poisson::new(ImageSize { width: grid.width, height: grid.height });
    let found = poisson.integral(&slopes(&grid, &depth));
    for (found, expected) in found.iter().zip(&depth) {
        assert!((found * grid.pitch_mm - expected).abs() < 0.01, "{} {expected}", found * grid.pitch_mm);
    }
    // A slope that is the same everywhere is the light's, not the surface's.
    let even = Array2::from_elem((grid.pixels(), 2), 0.3);
    assert!(poisson.integral(&even).iter().all(|depth| depth.abs() < 1e-9));
}

#[test]
fn the_depth_and_the_force_of_a_ball_are_found() {
    let stereo = Stereo::calibrated(&workers()).expect("it can be calibrated");
    let sensor = GelSensor::default();
    let size = ImageSize { width: 160, height: 120 };
    let grid = sensor.grid(size.width, size.height);
    let mut solver = GelSolver::new(sensor.gel, grid).expect("in range");
    let ball = Placed { at_mm: [1.0, -0.5], ..Placed::upright(Indenter::Ball { radius_mm: 5.0 }) };
    let contact = solver.press(&ball.heights(&grid), Load::Depth(0.9)).expect("a contact");
    let mut random = Random::new(11);
    let mut picture = |displacement_mm: &[f64]| {
        let picture = [size.width, size.height];
        let levels = sensor.camera.picture(&grid, displacement_mm, picture, Some(&mut random)).expect("fits");
        picture_bytes(&levels, picture, None)
    };
    let (reference, rgb) = (picture(&vec![0.0; grid.pixels()]), picture(&contact.displacement_mm));
    let mut engine = Engine::new(size).expect("a size");
    let depth = stereo.depth_mm(&engine.poisson, &rgb, &reference, grid.pitch_mm);
    let deepest = depth.iter().copied().fold(0.0, f32::max);
    let expected = contact.displacement_mm.iter().copied().fold(0.0, f64::max);
    assert!((f64::from(deepest) / expected - 1.0).abs() < 0.1, "{deepest} mm, {expected} mm");
    let at = DEPTHS_MM.iter().position(|&mm| mm == 0.3).expect("it is tried");
    let report = engine.meters[at].measure(&depth).expect("finite");
    let force_n = stereo.newtons_per_mm3[at] * report.force_n * grid.pitch_mm * grid.pitch_mm;
    assert!((force_n / contact.force_n - 1.0).abs() < 0.2, "{force_n} N, {} N", contact.force_n);
    let centre = report.centroid.expect("a contact");
    assert!((centre.x_px - 79.5 - 1.0 / grid.pitch_mm).abs() < 2.0, "{centre:?}");
    assert!((centre.y_px - 59.5 + 0.5 / grid.pitch_mm).abs() < 2.0, "{centre:?}");
}

#[test]
fn an_unchanged_picture_has_no_depth_and_fewer_pixels_bear_more() {
    let stereo = Stereo::calibrated(&workers()).expect("it can be calibrated");
    // Without a change of colour there is no slope, at any position.
    let picture: Vec<u8> = (0..8 * 6 * 3).map(|i| (i % 250) as u8).collect();
    let size = ImageSize { width: 8, height: 6 };
    assert!(terms(&picture, &picture, size).flatten().all(|term| term == 0.0));
    let depth = stereo.depth_mm(&Poisson::new(size), &picture, &picture, 0.1);
    assert!(depth.iter().all(|&mm| mm == 0.0));
    // More force for the same volume where fewer pixels count.
    assert!(stereo.newtons_per_mm3.is_sorted() && stereo.newtons_per_mm3[0] > 0.0);
}
