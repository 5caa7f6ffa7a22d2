//! Forces against the gradient of the energy.

use super::{Dome, Press, Shell, Triangle, Vector, angle};

impl Shell {
    /// The elastic energy in microjoules.
    fn energy(&self, nodes: &[Vector]) -> f64 {
        let membrane =
            self.triangles.iter().map(|triangle| triangle.energy(self.yeoh_kpa, nodes)).sum::<f64>();
        let bending = self.hinges.iter().map(|hinge| {
            let bent = angle(hinge.nodes.map(|node| nodes[node])).0 - hinge.rest;
            0.5 * hinge.stiffness * bent * bent
        });
        membrane + bending.sum::<f64>()
    }
}

impl Triangle {
    fn energy(&self, [c10, c20, c30]: [f64; 3], nodes: &[Vector]) -> f64 {
        let (_, [xx, xy, yy]) = self.deformation(nodes);
        let j = xx + yy + 1.0 / (xx * yy - xy * xy) - 3.0;
        self.volume * (c10 * j + c20 * j * j + c30 * j * j * j)
    }
}

#[test]
fn forces_are_minus_the_gradient_of_the_energy() {
    let shell = Shell::new(&Dome::default());
    let mut nodes = shell.rest.clone();
    for (i, node) in nodes.iter_mut().enumerate() {
        for (axis, value) in node.iter_mut().enumerate() {
            *value += 0.3 * libm::sin((7 * i + 3 * axis) as f64);
        }
    }
    let mut forces = vec![[0.0; 3]; nodes.len()];
    shell.forces(&nodes, &mut forces);
    for i in [0, 1, 5, 40, 130, 200] {
        for axis in 0..3 {
            let mut energy = [0.0; 2];
            for (energy, by) in energy.iter_mut().zip([1e-5, -1e-5]) {
                let mut moved = nodes.clone();
                moved[i][axis] += by;
                *energy = shell.energy(&moved);
            }
            let expected = -(energy[0] - energy[1]) / 2e-5;
            assert!(
                (forces[i][axis] - expected).abs() < 1e-4 * (1.0 + expected.abs()),
                "{i} {axis}: {} {expected}",
                forces[i][axis]
            );
        }
    }
}

#[test]
fn the_dome_at_rest_is_in_balance() {
    let shell = Shell::new(&Dome::default());
    let mut forces = vec![[1.0; 3]; shell.rest.len()];
    shell.forces(&shell.rest, &mut forces);
    assert!(forces.iter().flatten().all(|force| force.abs() < 1e-9));
    assert_eq!(Press::new(&Dome::default(), 0.1, 0.0).markers().len(), 169);
}
