//! Finds areas for labels beside points, so that no label covers another.
//!
//! Input: points with the widths of their labels, and areas that must stay free. Output: an area
//! for each label, as near to its point as possible, in the order of the points; `None` if no area
//! is free.

use crate::svg::{Area, Place};

/// Height of a label.
const HEIGHT: f64 = 15.0;
/// Distances from a point at which a label is tried.
const NEAREST: f64 = 7.0;
const STEP: f64 = 9.0;
const RINGS: usize = 60;
/// Directions that are tried at each distance.
const DIRECTIONS: usize = 32;
/// Number of positions that are checked on the line from a point to its label.
const SAMPLES: usize = 24;

/// An area inside `field` for the label of each of `points` (place, width), free of `obstacles`.
pub(crate) fn place(points: &[(Place, f64)], obstacles: &[Area], field: &Area) -> Vec<Option<Area>> {
    let mut placed: Vec<Option<Area>> = Vec::new();
    let mut lines: Vec<[Place; SAMPLES]> = Vec::new();
    for &(point, width) in points {
        let is_free = |area: &Area| {
            let line = line(point, area);
            let crosses = |other: &Area| other.overlaps(area) || line.iter().any(|&at| other.contains(at));
            field.contains((area.left, area.top))
                && field.contains((area.right, area.bottom))
                && !placed.iter().flatten().any(crosses)
                && !lines.iter().flatten().any(|&at| area.contains(at))
                && !obstacles.iter().any(|obstacle| obstacle.overlaps(area))
        };
        let found = candidates(point, width).find(is_free);
        lines.extend(found.map(|area| line(point, &area)));
        placed.push(found);
    }
    placed
}

/// Areas around `point`, the nearest first.
fn candidates((x, y): Place, width: f64) -> impl Iterator<Item = Area> {
    (0..RINGS * DIRECTIONS).map(move |i| {
        let distance = NEAREST + STEP * (i / DIRECTIONS) as f64;
        // First to the right, then to the left, then in the other directions.
        let turn = (i % DIRECTIONS / 2 + i % 2 * (DIRECTIONS / 2)) as f64 / DIRECTIONS as f64;
        let (sine, cosine) = (turn * std::f64::consts::TAU).sin_cos();
        let (x, y) = (x + cosine * (distance + width / 2.0), y - sine * (distance + HEIGHT / 2.0));
        Area::at((x - width / 2.0, y - HEIGHT / 2.0), width, HEIGHT)
    })
}

/// Positions on the line from a point to its label.
fn line(point: Place, area: &Area) -> [Place; SAMPLES] {
    let end = area.nearest(point);
    std::array::from_fn(|i| {
        let share = i as f64 / SAMPLES as f64;
        (point.0 + share * (end.0 - point.0), point.1 + share * (end.1 - point.1))
    })
}
