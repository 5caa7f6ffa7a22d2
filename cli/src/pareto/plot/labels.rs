//! Places for labels beside points, so that no label covers another.
//!
//! Enters: points with the widths of their labels, and what else should stay free. Leaves: a box for each label, as near to
//! its point as there is room, in the order of the points; none where no place is free.

/// Height of a label.
pub(super) const HEIGHT: f64 = 15.0;
/// Distances from a point at which a label is tried.
const NEAREST: f64 = 7.0;
const STEP: f64 = 9.0;
const RINGS: usize = 60;
/// Directions that are tried at each distance.
const DIRECTIONS: usize = 32;
/// A line to a label is looked at in so many places.
const SAMPLES: usize = 24;

/// A part of the drawing: left, top, right, bottom.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Area {
    pub(super) left: f64,
    pub(super) top: f64,
    pub(super) right: f64,
    pub(super) bottom: f64,
}

impl Area {
    /// The square around a point.
    pub(super) fn around((x, y): (f64, f64), reach: f64) -> Self {
        Self { left: x - reach, top: y - reach, right: x + reach, bottom: y + reach }
    }

    /// What a line along an axis covers.
    pub(super) fn between(a: (f64, f64), b: (f64, f64)) -> Self {
        let Self { left, top, .. } = Self::around((a.0.min(b.0), a.1.min(b.1)), 1.0);
        let Self { right, bottom, .. } = Self::around((a.0.max(b.0), a.1.max(b.1)), 1.0);
        Self { left, top, right, bottom }
    }

    pub(super) fn overlaps(&self, other: &Self) -> bool {
        self.left < other.right
            && other.left < self.right
            && self.top < other.bottom
            && other.top < self.bottom
    }

    fn holds(&self, (x, y): (f64, f64)) -> bool {
        (self.left..=self.right).contains(&x) && (self.top..=self.bottom).contains(&y)
    }

    fn is_inside(&self, outer: &Self) -> bool {
        outer.holds((self.left, self.top)) && outer.holds((self.right, self.bottom))
    }

    /// The place of this area that is nearest to a point.
    pub(super) fn nearest(&self, (x, y): (f64, f64)) -> (f64, f64) {
        (x.clamp(self.left, self.right), y.clamp(self.top, self.bottom))
    }
}

/// A box inside `field` for the label of each of `points` (place, width), free of `obstacles`.
pub(super) fn place(points: &[((f64, f64), f64)], obstacles: &[Area], field: &Area) -> Vec<Option<Area>> {
    let mut placed: Vec<Option<Area>> = Vec::new();
    let mut lines: Vec<[(f64, f64); SAMPLES]> = Vec::new();
    for &(point, width) in points {
        let fits = |area: &Area| {
            let line = line(point, area);
            let crosses = |other: &Area| other.overlaps(area) || line.iter().any(|&at| other.holds(at));
            area.is_inside(field)
                && !placed.iter().flatten().any(crosses)
                && !lines.iter().flatten().any(|&at| area.holds(at))
        };
        let is_free = |area: &Area| fits(area) && !obstacles.iter().any(|obstacle| obstacle.overlaps(area));
        let found = candidates(point, width).find(is_free);
        lines.extend(found.map(|area| line(point, &area)));
        placed.push(found);
    }
    placed
}

/// Boxes around `point`, the nearest first.
fn candidates((x, y): (f64, f64), width: f64) -> impl Iterator<Item = Area> {
    (0..RINGS * DIRECTIONS).map(move |i| {
        let distance = NEAREST + STEP * (i / DIRECTIONS) as f64;
        // To the right first, then to the left, then the others.
        let turn = (i % DIRECTIONS / 2 + i % 2 * (DIRECTIONS / 2)) as f64 / DIRECTIONS as f64;
        let (sine, cosine) = (turn * std::f64::consts::TAU).sin_cos();
        let (centre_x, centre_y) =
            (x + cosine * (distance + width / 2.0), y - sine * (distance + HEIGHT / 2.0));
        let left = centre_x - width / 2.0;
        let top = centre_y - HEIGHT / 2.0;
        Area { left, top, right: left + width, bottom: top + HEIGHT }
    })
}

/// Places along the line from a point to its label.
fn line(point: (f64, f64), area: &Area) -> [(f64, f64); SAMPLES] {
    let end = area.nearest(point);
    std::array::from_fn(|i| {
        let share = i as f64 / SAMPLES as f64;
        (point.0 + share * (end.0 - point.0), point.1 + share * (end.1 - point.1))
    })
}

#[cfg(test)]
mod tests {
    use super::{Area, place};
    use proptest::prelude::*;

    const FIELD: Area = Area { left: 0.0, top: 0.0, right: 900.0, bottom: 500.0 };

    #[test]
    fn a_label_alone_is_to_the_right_of_its_point() {
        let placed = place(&[((100.0, 100.0), 60.0)], &[], &FIELD);
        let area = placed[0].expect("there is room");
        assert!(area.left > 100.0 && area.top < 100.0 && area.bottom > 100.0, "{area:?}");
    }

    #[test]
    fn a_label_at_the_border_stays_inside() {
        let placed = place(&[((899.0, 499.0), 60.0)], &[], &FIELD);
        assert!(placed[0].is_some_and(|area| area.right <= 900.0 && area.bottom <= 500.0));
    }

    #[test]
    fn where_there_is_no_room_there_is_no_label() {
        let narrow = Area { right: 50.0, ..FIELD };
        assert_eq!(place(&[((10.0, 10.0), 60.0)], &[], &narrow), [None]);
    }

    proptest! {
        #[test]
        fn no_label_covers_another(
            points in proptest::collection::vec(((0.0..900.0, 0.0..500.0), 30.0..200.0), 1..20)
        ) {
            let obstacles: Vec<Area> = points.iter().map(|&(point, _)| Area::around(point, 5.0)).collect();
            let placed = place(&points, &obstacles, &FIELD);
            for (i, a) in placed.iter().enumerate() {
                let Some(a) = a else { continue };
                prop_assert!(a.is_inside(&FIELD));
                for b in placed[..i].iter().flatten() {
                    prop_assert!(!a.overlaps(b), "{:?} {:?}", a, b);
                }
            }
        }
    }
}
