//! Shapes that are pressed into a gel.

use std::f64::consts::TAU;

use libm::{atan2, cos, fabs, hypot, sin, sqrt, tan};
use meissner_kernels::random::Random;

use super::Grid;

/// A rigid body, by the height of its underside. Lengths are in millimetres, angles in radians.
#[derive(Clone, Copy, Debug, PartialEq)]
#[non_exhaustive]
#[expect(missing_docs, reason = "the shapes explain the fields")]
pub enum Indenter {
    Ball {
        radius_mm: f64,
    },
    /// A cylinder that lies along x.
    Cylinder {
        radius_mm: f64,
        length_mm: f64,
    },
    /// The flat end of a rod.
    Punch {
        radius_mm: f64,
    },
    /// The flat end of a tube with a hole of radius `hole_mm`.
    Ring {
        radius_mm: f64,
        hole_mm: f64,
    },
    /// A face of a cuboid: `width_mm` along x, `length_mm` along y.
    Block {
        width_mm: f64,
        length_mm: f64,
    },
    /// A cone on its tip; the angle is between its axis and its side.
    Cone {
        half_angle: f64,
    },
    /// A wedge on its edge, which lies along x; the angle is between its middle plane and a side.
    Edge {
        half_angle: f64,
        length_mm: f64,
    },
    /// A square of `side` x `side` balls, with this distance between the middles of neighbours.
    Dots {
        radius_mm: f64,
        spacing_mm: f64,
        side: u8,
    },
    /// A capital letter in relief, one of [`LETTERS`], of this height; other letters become a
    /// block.
    Letter {
        letter: char,
        size_mm: f64,
    },
    /// A rounded body with waves, drawn from a seed, of this radius of curvature without them.
    Irregular {
        seed: u64,
        radius_mm: f64,
    },
    /// A flat polygon, whose corners are drawn from a seed within a radius.
    Polygon {
        seed: u64,
        radius_mm: f64,
    },
    /// Two to nine pins, round or rectangular, with flat ends at different heights. All is drawn
    /// from a seed, with the middles within a radius.
    Pins {
        seed: u64,
        radius_mm: f64,
    },
    /// Parallel ridges along x with round crests on a round plate: their roundness and distance are
    /// drawn from a seed.
    Ridges {
        seed: u64,
        radius_mm: f64,
    },
    /// A round wire on its side, bent to an arc of radius `bend_mm`, at most a full turn.
    Wire {
        radius_mm: f64,
        bend_mm: f64,
        arc: f64,
    },
}

/// The letters that [`Indenter::Letter`] knows.
pub const LETTERS: &str = "ACEFHKLOTUXZ";

/// Strokes of [`LETTERS`] on 5 x 7 squares: a row a number, the leftmost in its highest bit.
const STROKES: [[u8; 7]; 12] = [
    [0b01110, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001],
    [0b01111, 0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b01111],
    [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b11111],
    [0b11111, 0b10000, 0b10000, 0b11110, 0b10000, 0b10000, 0b10000],
    [0b10001, 0b10001, 0b10001, 0b11111, 0b10001, 0b10001, 0b10001],
    [0b10001, 0b10010, 0b10100, 0b11000, 0b10100, 0b10010, 0b10001],
    [0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b10000, 0b11111],
    [0b01110, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110],
    [0b11111, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100, 0b00100],
    [0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b10001, 0b01110],
    [0b10001, 0b10001, 0b01010, 0b00100, 0b01010, 0b10001, 0b10001],
    [0b11111, 0b00001, 0b00010, 0b00100, 0b01000, 0b10000, 0b11111],
];
/// Height of the plate of a letter above its strokes; the plate is as large as the letter.
const RELIEF_MM: f64 = 1.5;
/// Waves of an irregular body.
const WAVES: usize = 6;

impl Indenter {
    /// The height of the underside at a position, about 0 at its lowest point; infinite beside the
    /// body.
    pub fn height(&self, x: f64, y: f64) -> f64 {
        let flat = |is_there: bool| if is_there { 0.0 } else { f64::INFINITY };
        match *self {
            Self::Ball { radius_mm } => dome(radius_mm, hypot(x, y)),
            Self::Cylinder { radius_mm, length_mm } => dome(radius_mm, y) + flat(fabs(x) <= length_mm / 2.0),
            Self::Punch { radius_mm } => flat(hypot(x, y) <= radius_mm),
            Self::Ring { radius_mm, hole_mm } => flat((hole_mm..=radius_mm).contains(&hypot(x, y))),
            Self::Block { width_mm, length_mm } => {
                flat(fabs(x) <= width_mm / 2.0 && fabs(y) <= length_mm / 2.0)
            }
            Self::Cone { half_angle } => hypot(x, y) / tan(half_angle),
            Self::Edge { half_angle, length_mm } => {
                fabs(y) / tan(half_angle) + flat(fabs(x) <= length_mm / 2.0)
            }
            Self::Dots { radius_mm, spacing_mm, side } => {
                let last = f64::from(side) - 1.0;
                let from_nearest = |place: f64| {
                    let index = (place / spacing_mm + last / 2.0).round().clamp(0.0, last.max(0.0));
                    place - (index - last / 2.0) * spacing_mm
                };
                dome(radius_mm, hypot(from_nearest(x), from_nearest(y)))
            }
            Self::Letter { letter, size_mm } => {
                let square = size_mm / 7.0;
                let (column, row) = ((x / square + 2.5).floor(), (y / square + 3.5).floor());
                let Some(strokes) =
                    LETTERS.chars().position(|known| known == letter).map(|index| STROKES[index])
                else {
                    return flat(fabs(x) <= size_mm / 2.0 && fabs(y) <= size_mm / 2.0);
                };
                if !((0.0..5.0).contains(&column) && (0.0..7.0).contains(&row)) {
                    return f64::INFINITY;
                }
                let is_stroke = strokes[row as usize] >> (4 - column as u8) & 1 == 1;
                if is_stroke { 0.0 } else { RELIEF_MM }
            }
            Self::Irregular { seed, radius_mm } => {
                let mut random = Random::new(seed);
                let waves = (0..WAVES).map(|_| {
                    // Waves of half a radius to a fifth of it in length, steep enough to leave
                    // gaps.
                    let length = radius_mm * (0.2 + 0.3 * random.uniform());
                    let (direction, phase) = (TAU * random.uniform(), TAU * random.uniform());
                    let along = cos(direction) * x + sin(direction) * y;
                    0.012 * length * (1.0 - cos(TAU * along / length + phase))
                });
                (x * x + y * y) / (2.0 * radius_mm) + waves.sum::<f64>()
            }
            Self::Polygon { seed, radius_mm } => {
                let mut random = Random::new(seed);
                let corners = 3 + random.bits() % 6;
                let corners: Vec<_> = (0..corners)
                    .map(|i| {
                        let angle = TAU * i as f64 / corners as f64;
                        let away = radius_mm * (0.25 + 0.75 * random.uniform());
                        [away * cos(angle), away * sin(angle)]
                    })
                    .collect();
                // Every corner is visible from the middle: a point is inside if it is on the inner
                // side of the edge in its direction.
                let left_of = |[ax, ay]: [f64; 2], [bx, by]: [f64; 2]| ax * by - ay * bx >= 0.0;
                let is_inside = (0..corners.len()).any(|i| {
                    let (a, b) = (corners[i], corners[(i + 1) % corners.len()]);
                    let faced = left_of(a, [x, y]) && left_of([x, y], b);
                    faced && left_of([b[0] - a[0], b[1] - a[1]], [x - a[0], y - a[1]])
                });
                flat(is_inside)
            }
            Self::Pins { seed, radius_mm } => {
                let mut random = Random::new(seed);
                let pins = 2 + random.bits() % 8;
                let ends = (0..pins).map(|_| {
                    let (away, angle) = (radius_mm * sqrt(random.uniform()), TAU * random.uniform());
                    let (from_x, from_y) = (x - away * cos(angle), y - away * sin(angle));
                    let turn = TAU * random.uniform();
                    let u = cos(turn) * from_x + sin(turn) * from_y;
                    let v = cos(turn) * from_y - sin(turn) * from_x;
                    let [half_u, half_v] = [(); 2].map(|()| 0.5 + 1.5 * random.uniform());
                    let is_round = random.bits().is_multiple_of(2);
                    let is_inside =
                        if is_round { hypot(u, v) <= half_u } else { fabs(u) <= half_u && fabs(v) <= half_v };
                    0.2 * random.uniform() + flat(is_inside)
                });
                ends.fold(f64::INFINITY, f64::min)
            }
            Self::Ridges { seed, radius_mm } => {
                let mut random = Random::new(seed);
                let crest_mm = 0.3 + 1.7 * random.uniform();
                let spacing_mm = crest_mm * (1.2 + 1.8 * random.uniform());
                let across = y / spacing_mm + random.uniform();
                dome(crest_mm, spacing_mm * (across - across.round())) + flat(hypot(x, y) <= radius_mm)
            }
            Self::Wire { radius_mm, bend_mm, arc } => {
                // The middle of the arc is the middle of the body.
                let (away, angle) = (hypot(x + bend_mm, y), atan2(y, x + bend_mm));
                dome(radius_mm, away - bend_mm) + flat(fabs(angle) <= arc / 2.0)
            }
        }
    }
}

/// The height of the underside of a ball at this distance from its axis.
fn dome(radius: f64, away: f64) -> f64 {
    let below = radius * radius - away * away;
    if below >= 0.0 { radius - sqrt(below) } else { f64::INFINITY }
}

/// An indenter above a gel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placed {
    /// The shape.
    pub indenter: Indenter,
    /// Position of its middle relative to the middle of the gel, in millimetres.
    pub at_mm: [f64; 2],
    /// Its turn from x to y, in radians.
    pub turn: f64,
    /// Slopes of its axis along x and y, in radians; below a tenth.
    pub tilts: [f64; 2],
}

impl Placed {
    /// The indenter in the middle of the gel, upright.
    pub fn upright(indenter: Indenter) -> Self {
        Self { indenter, at_mm: [0.0; 2], turn: 0.0, tilts: [0.0; 2] }
    }

    /// The height of the underside at a position on the gel, not yet relative to its lowest point.
    pub(crate) fn height(&self, x: f64, y: f64) -> f64 {
        let (cosine, sine) = (cos(self.turn), sin(self.turn));
        let [slope_x, slope_y] = self.tilts.map(tan);
        let (x, y) = (x - self.at_mm[0], y - self.at_mm[1]);
        let (own_x, own_y) = (cosine * x + sine * y, cosine * y - sine * x);
        self.indenter.height(own_x, own_y) + slope_x * x + slope_y * y
    }

    /// The heights above the lowest point at the middle of each pixel. O(pixels).
    pub fn heights(&self, grid: &Grid) -> Vec<f64> {
        let mut heights = grid.heights(|x, y| self.height(x, y));
        let lowest = heights.iter().copied().fold(f64::INFINITY, f64::min);
        if lowest.is_finite() {
            heights.iter_mut().for_each(|height| *height -= lowest);
        }
        heights
    }
}
