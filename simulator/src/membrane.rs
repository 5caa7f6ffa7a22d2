//! A soft dome with markers, pressed on a plane: the sensor of contact angle by events.
//!
//! Input: a dome, the tilt of a plane, a depth. Output: the markers, and the plane's force.
//!
//! The dome is a thin shell of an incompressible Yeoh solid on a mesh of triangles, whose base is
//! fixed. A press is quasi-static: after each small step in depth, the nodes move to a minimum of
//! the energy
//!
//! - of the membrane, for a triangle of rest area A and thickness h: `A h (C10 J + C20 J^2 + C30
//!   J^3)` with `J = tr C + 1 / det C - 3`, C the right Cauchy-Green tensor in the surface (Yeoh
//!   1993, "Some forms of the strain energy function for rubber", Eq. 2; the stretch through the
//!   wall follows from incompressibility);
//! - of bending, for an edge of rest length l between triangles of rest areas A1 and A2:
//!   `3 D l^2 (angle - rest)^2 / (2 (A1 + A2))` with `D = E h^3 / 9`, `E = 6 C10` (Grinspun et al.
//!   2003, "Discrete shells", Eq. 2).
//!
//! The gradient of an angle between triangles is that of Bridson et al. 2003, "Simulation of
//! clothing with folds and wrinkles", section 4. The minimum is found by FIRE (Bitzek et al. 2006,
//! "Structural relaxation made simple"). A node that reaches the plane stays where it touched it
//! (rough contact, no slip), until the plane would have to pull it.
//!
//! The model leaves out: inertia and viscosity, so that press and release are equal; the air or gel
//! inside; shear through the wall; slip; gravity. The shell is the outer surface of the dome.

use std::f64::consts::{FRAC_PI_2, PI};

use libm::{asin, atan2, cos, sin, sqrt};

/// A point in millimetres, or a force in millinewtons. The dome's axis is z, its base z = 0.
pub type Vector = [f64; 3];

/// Size and material of a dome. The default is the published one: 40 mm wide, 20 mm high, a wall of
/// 4 mm, 169 markers in rings of 1, 6, 12, ... 42 with diameters from 0 to 35 mm, Ecoflex 00-30.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Dome {
    /// Radius of the hemisphere, in millimetres.
    pub radius_mm: f64,
    /// Thickness of the wall, in millimetres.
    pub wall_mm: f64,
    /// Diameter of the outermost ring of markers, in millimetres.
    pub rings_mm: f64,
    /// Rings of markers around the one at the top. Ring k has 6 k markers.
    pub rings: usize,
    /// The coefficients C10, C20 and C30 of the Yeoh solid, in kilopascals.
    pub yeoh_kpa: [f64; 3],
}

impl Default for Dome {
    fn default() -> Self {
        Self { radius_mm: 20.0, wall_mm: 4.0, rings_mm: 35.0, rings: 7, yeoh_kpa: [17.0, -0.2, 0.023] }
    }
}

/// A press of a dome on a plane.
#[derive(Clone, Debug)]
pub struct Press {
    shell: Shell,
    nodes: Vec<Vector>,
    forces: Vec<Vector>,
    /// Position at which a node that touches the plane is held, relative to the plane.
    held: Vec<Option<Vector>>,
    /// Unit normal of the plane, towards the dome.
    normal: Vector,
    /// The largest `-normal . node` at rest: where the plane first touches.
    touch_mm: f64,
    depth_mm: f64,
    markers: usize,
}

/// Depth between two minima, in millimetres: contact is found at these steps.
const STEP_MM: f64 = 0.25;

/// Rings of nodes between the markers and the base.
const BASE_RINGS: usize = 2;

impl Press {
    /// The dome that just touches a plane tilted by `tilt` towards `azimuth` radians from x to y.
    pub fn new(dome: &Dome, tilt: f64, azimuth: f64) -> Self {
        let shell = Shell::new(dome);
        let normal = [sin(tilt) * cos(azimuth), sin(tilt) * sin(azimuth), -cos(tilt)];
        let nodes = shell.rest.clone();
        let touch_mm = nodes.iter().map(|&node| -dot(normal, node)).fold(f64::NEG_INFINITY, f64::max);
        let markers = nodes.len() - 6 * (1..=BASE_RINGS).map(|ring| dome.rings + ring).sum::<usize>();
        Self {
            forces: vec![[0.0; 3]; nodes.len()],
            held: vec![None; nodes.len()],
            shell,
            nodes,
            normal,
            touch_mm,
            depth_mm: 0.0,
            markers,
        }
    }

    /// Presses on to `depth_mm` along the axis of the dome, if that is deeper.
    ///
    /// Complexity: about a second for 15 mm of the default dome.
    pub fn press_to(&mut self, depth_mm: f64) {
        while self.depth_mm < depth_mm {
            self.depth_mm = (self.depth_mm + STEP_MM).min(depth_mm);
            // A node that touches is held from then on, which lets other nodes touch.
            for _ in 0..8 {
                self.carry();
                self.relax();
                if !self.change_contact() {
                    break;
                }
            }
        }
    }

    /// Depth of the press, in millimetres.
    pub fn depth_mm(&self) -> f64 {
        self.depth_mm
    }

    /// The markers, ring after ring from the top outwards, in millimetres.
    pub fn markers(&self) -> &[Vector] {
        &self.nodes[..self.markers]
    }

    /// The force with which the plane presses the dome along its axis, in newtons.
    pub fn force_n(&self) -> f64 {
        let held = self.held.iter().zip(&self.forces).filter(|(held, _)| held.is_some());
        // The plane balances the elastic forces at the nodes that it holds.
        held.map(|(_, force)| force[2]).sum::<f64>() / 1e3
    }

    /// Height of a point above the plane, in millimetres; negative inside it.
    fn height(&self, point: Vector) -> f64 {
        dot(self.normal, point) + self.touch_mm + self.normal[2] * self.depth_mm
    }

    /// Moves the nodes that are held along with the plane.
    fn carry(&mut self) {
        for (node, held) in self.nodes.iter_mut().zip(&self.held) {
            if let Some([x, y, z]) = *held {
                *node = [x, y, z - self.depth_mm];
            }
        }
    }

    /// Holds nodes inside the plane, and releases those that it would pull. Returns whether any
    /// node changed.
    fn change_contact(&mut self) -> bool {
        let mut changed = false;
        for i in 0..self.nodes.len() {
            if self.shell.fixed[i] {
                continue;
            }
            if self.held[i].is_some() {
                // The elastic force pushes a pressed node into the plane.
                if dot(self.normal, self.forces[i]) > 0.0 {
                    self.held[i] = None;
                    changed = true;
                }
            } else {
                let height = self.height(self.nodes[i]);
                if height < 0.0 {
                    let [x, y, z] = along(self.nodes[i], -height, self.normal);
                    self.held[i] = Some([x, y, z + self.depth_mm]);
                    changed = true;
                }
            }
        }
        changed
    }

    /// Moves the free nodes to a minimum of the energy.
    fn relax(&mut self) {
        /// Largest force that is left on a free node, in millinewtons.
        const TOLERANCE: f64 = 0.02;
        const EVALUATIONS: usize = 3_000;
        // FIRE with the parameters of its paper, for nodes of mass 1 and stiffness of the shell.
        let longest = 0.5 / sqrt(self.shell.stiffness);
        let (mut step, mut mixing, mut downhill) = (0.1 * longest, 0.1, 0);
        let mut velocity = vec![[0.0; 3]; self.nodes.len()];
        let is_free = |&i: &usize| !self.shell.fixed[i] && self.held[i].is_none();
        let free: Vec<usize> = (0..self.nodes.len()).filter(is_free).collect();
        for _ in 0..EVALUATIONS {
            self.shell.forces(&self.nodes, &mut self.forces);
            let (mut power, mut speed, mut force) = (0.0, 0.0, 0.0);
            let mut largest = 0.0_f64;
            for &i in &free {
                power += dot(self.forces[i], velocity[i]);
                speed += dot(velocity[i], velocity[i]);
                force += dot(self.forces[i], self.forces[i]);
                largest = largest.max(dot(self.forces[i], self.forces[i]));
            }
            if largest < TOLERANCE * TOLERANCE {
                break;
            }
            if power > 0.0 {
                let turn = mixing * sqrt(speed / force);
                for &i in &free {
                    velocity[i] = along(velocity[i].map(|v| (1.0 - mixing) * v), turn, self.forces[i]);
                }
                downhill += 1;
                if downhill > 5 {
                    step = (1.1 * step).min(longest);
                    mixing *= 0.99;
                }
            } else {
                velocity.fill([0.0; 3]);
                (step, mixing, downhill) = (0.5 * step, 0.1, 0);
            }
            for &i in &free {
                velocity[i] = along(velocity[i], step, self.forces[i]);
                self.nodes[i] = along(self.nodes[i], step, velocity[i]);
            }
        }
        self.shell.forces(&self.nodes, &mut self.forces);
    }
}

/// The dome at rest, and its elastic forces.
#[derive(Clone, Debug)]
struct Shell {
    rest: Vec<Vector>,
    /// Nodes of the base do not move.
    fixed: Vec<bool>,
    triangles: Vec<Triangle>,
    hinges: Vec<Hinge>,
    yeoh_kpa: [f64; 3],
    /// About the largest stiffness of a node, in millinewtons per millimetre.
    stiffness: f64,
}

#[derive(Clone, Copy, Debug)]
struct Triangle {
    nodes: [usize; 3],
    /// Inverse of the matrix of both edges from the first node, at rest, in their plane.
    inverse: [[f64; 2]; 2],
    /// Area times thickness at rest, in cubic millimetres.
    volume: f64,
}

/// An edge between two triangles.
#[derive(Clone, Copy, Debug)]
struct Hinge {
    /// The opposite corners of the two triangles, then the ends of the edge.
    nodes: [usize; 4],
    /// Angle between the triangles at rest.
    rest: f64,
    /// In millinewton millimetres.
    stiffness: f64,
}

impl Shell {
    fn new(dome: &Dome) -> Self {
        let (rest, triangles) = mesh(dome);
        let base = rest.len() - 6 * (dome.rings + BASE_RINGS);
        let modulus_kpa = 6.0 * dome.yeoh_kpa[0];
        let bending = modulus_kpa * dome.wall_mm * dome.wall_mm * dome.wall_mm / 9.0;
        let triangles: Vec<Triangle> =
            triangles.into_iter().map(|nodes| Triangle::new(nodes, &rest, dome.wall_mm)).collect();
        let mut hinges = Vec::new();
        for (i, first) in triangles.iter().enumerate() {
            for second in &triangles[i + 1..] {
                if let Some(nodes) = common_edge(first.nodes, second.nodes) {
                    let edge = between(rest[nodes[2]], rest[nodes[3]]);
                    let area = (first.volume + second.volume) / dome.wall_mm;
                    let stiffness = 3.0 * bending * dot(edge, edge) / area;
                    let rest = angle(nodes.map(|node| rest[node])).0;
                    hinges.push(Hinge { nodes, rest, stiffness });
                }
            }
        }
        let fixed = (0..rest.len()).map(|node| node >= base).collect();
        let stiffness = 8.0 * modulus_kpa * dome.wall_mm;
        Self { rest, fixed, triangles, hinges, yeoh_kpa: dome.yeoh_kpa, stiffness }
    }

    /// Writes the elastic force on each node: minus the gradient of the energy.
    fn forces(&self, nodes: &[Vector], forces: &mut [Vector]) {
        forces.fill([0.0; 3]);
        for triangle in &self.triangles {
            triangle.add_forces(self.yeoh_kpa, nodes, forces);
        }
        for hinge in &self.hinges {
            let (angle, gradient) = angle(hinge.nodes.map(|node| nodes[node]));
            let torque = -hinge.stiffness * (angle - hinge.rest);
            for (&node, gradient) in hinge.nodes.iter().zip(gradient) {
                forces[node] = along(forces[node], torque, gradient);
            }
        }
    }
}

impl Triangle {
    fn new(nodes: [usize; 3], rest: &[Vector], wall_mm: f64) -> Self {
        let [a, b] = edges(nodes, rest);
        // Coordinates in the plane of the triangle: a along the first axis.
        let length = sqrt(dot(a, a));
        let (along_a, across) = (dot(a, b) / length, sqrt(dot(cross(a, b), cross(a, b))) / length);
        let determinant = length * across;
        let inverse = [[1.0 / length, -along_a / determinant], [0.0, 1.0 / across]];
        Self { nodes, inverse, volume: 0.5 * determinant * wall_mm }
    }

    /// Columns of the deformation gradient, and the right Cauchy-Green tensor: xx, xy, yy.
    fn deformation(&self, nodes: &[Vector]) -> ([Vector; 2], [f64; 3]) {
        let [a, b] = edges(self.nodes, nodes);
        let column = |j: usize| along(a.map(|a| a * self.inverse[0][j]), self.inverse[1][j], b);
        let (f, g) = (column(0), column(1));
        ([f, g], [dot(f, f), dot(f, g), dot(g, g)])
    }

    fn add_forces(&self, [c10, c20, c30]: [f64; 3], nodes: &[Vector], forces: &mut [Vector]) {
        let ([f, g], [xx, xy, yy]) = self.deformation(nodes);
        let determinant = xx * yy - xy * xy;
        let j = xx + yy + 1.0 / determinant - 3.0;
        let slope = c10 + 2.0 * c20 * j + 3.0 * c30 * j * j;
        // dJ/dC is 1 - cof C / det^2; the energy changes by twice that along the gradient.
        let scale = 2.0 * self.volume * slope;
        let inverse_square = 1.0 / (determinant * determinant);
        let (sx, sxy, sy) = (1.0 - yy * inverse_square, xy * inverse_square, 1.0 - xx * inverse_square);
        let stress_f = along(f.map(|f| scale * sx * f), scale * sxy, g);
        let stress_g = along(g.map(|g| scale * sy * g), scale * sxy, f);
        let on = |row: usize| {
            let [p, q] = self.inverse[row];
            along(stress_f.map(|s| -p * s), -q, stress_g)
        };
        let (on_b, on_c) = (on(0), on(1));
        let [a, b, c] = self.nodes;
        forces[b] = along(forces[b], 1.0, on_b);
        forces[c] = along(forces[c], 1.0, on_c);
        forces[a] = along(along(forces[a], -1.0, on_b), -1.0, on_c);
    }
}

/// Nodes and triangles of a hemisphere: ring k has 6 k nodes, those of the base last.
fn mesh(dome: &Dome) -> (Vec<Vector>, Vec<[usize; 3]>) {
    let rings = dome.rings + BASE_RINGS;
    let outermost = asin(0.5 * dome.rings_mm / dome.radius_mm);
    let polar = |ring: usize| {
        if ring <= dome.rings {
            asin(0.5 * dome.rings_mm / dome.radius_mm * ring as f64 / dome.rings as f64)
        } else {
            let share = (ring - dome.rings) as f64 / BASE_RINGS as f64;
            outermost + share * (FRAC_PI_2 - outermost)
        }
    };
    let mut nodes = vec![[0.0, 0.0, dome.radius_mm]];
    for ring in 1..=rings {
        let polar = polar(ring);
        let z = if ring == rings { 0.0 } else { dome.radius_mm * cos(polar) };
        for i in 0..6 * ring {
            let azimuth = 2.0 * PI * i as f64 / (6 * ring) as f64;
            let r = dome.radius_mm * sin(polar);
            nodes.push([r * cos(azimuth), r * sin(azimuth), z]);
        }
    }
    let node = |ring: usize, i: usize| {
        if ring == 0 { 0 } else { 1 + 3 * ring * (ring - 1) + i % (6 * ring) }
    };
    let mut triangles = Vec::new();
    for ring in 1..=rings {
        for sector in 0..6 {
            for i in 0..ring {
                let (outer, inner) = (sector * ring + i, sector * (ring - 1) + i);
                triangles.push([node(ring, outer), node(ring, outer + 1), node(ring - 1, inner)]);
                if i + 1 < ring {
                    triangles.push([node(ring, outer + 1), node(ring - 1, inner + 1), node(ring - 1, inner)]);
                }
            }
        }
    }
    (nodes, triangles)
}

/// The corners opposite a common edge, then the ends of the edge in the order of the first
/// triangle.
fn common_edge(first: [usize; 3], second: [usize; 3]) -> Option<[usize; 4]> {
    (0..3).find_map(|i| {
        let (from, to) = (first[i], first[(i + 1) % 3]);
        let j = (0..3).find(|&j| second[j] == to && second[(j + 1) % 3] == from)?;
        Some([first[(i + 2) % 3], second[(j + 2) % 3], from, to])
    })
}

/// The angle between the normals of two triangles, and its gradient at the opposite corners a and b
/// and at the ends c and d of the common edge.
fn angle([a, b, c, d]: [Vector; 4]) -> (f64, [Vector; 4]) {
    let edge = between(c, d);
    let length = sqrt(dot(edge, edge));
    let (m, n) = (cross(between(c, a), between(d, a)), cross(between(d, b), between(c, b)));
    let (mm, nn) = (dot(m, m), dot(n, n));
    let sine = dot(cross(m, n), edge) / length;
    let angle = atan2(sine, dot(m, n));
    let part = |vector: Vector, share: f64| vector.map(|v| share * v);
    let (m, n) = (part(m, 1.0 / mm), part(n, 1.0 / nn));
    let at = |from: Vector, to: Vector| dot(between(from, to), edge) / length;
    (
        angle,
        [
            part(m, -length),
            part(n, -length),
            along(part(m, at(a, d)), at(b, d), n),
            along(part(m, at(c, a)), at(c, b), n),
        ],
    )
}

fn edges([a, b, c]: [usize; 3], nodes: &[Vector]) -> [Vector; 2] {
    [between(nodes[a], nodes[b]), between(nodes[a], nodes[c])]
}

fn between(from: Vector, to: Vector) -> Vector {
    [to[0] - from[0], to[1] - from[1], to[2] - from[2]]
}

/// `start + distance direction`.
fn along(start: Vector, distance: f64, direction: Vector) -> Vector {
    [
        start[0] + distance * direction[0],
        start[1] + distance * direction[1],
        start[2] + distance * direction[2],
    ]
}

fn dot(a: Vector, b: Vector) -> f64 {
    a[0] * b[0] + a[1] * b[1] + a[2] * b[2]
}

fn cross(a: Vector, b: Vector) -> Vector {
    [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
}

#[cfg(test)]
mod tests;
