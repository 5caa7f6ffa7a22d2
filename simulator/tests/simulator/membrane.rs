//! A dome on a plane: symmetry, contact, and force.

use meissner_simulator::{Dome, Press};

fn pressed(tilt_deg: f64, azimuth_deg: f64, depth_mm: f64) -> Press {
    let mut press = Press::new(&Dome::default(), tilt_deg.to_radians(), azimuth_deg.to_radians());
    press.press_to(depth_mm);
    press
}

#[test]
fn a_press_flattens_the_top_and_pushes_the_sides_outwards() {
    let press = pressed(0.0, 0.0, 5.0);
    let markers = press.markers();
    // Nothing is beyond the plane. The top may bend away from it a little, as a flattened shell
    // does.
    assert!(markers.iter().all(|marker| marker[2] <= 15.0 + 0.05), "{:?}", markers[0]);
    assert!((14.5..=15.05).contains(&markers[0][2]), "{:?}", markers[0]);
    let rest = Press::new(&Dome::default(), 0.0, 0.0);
    let out = |i: usize| {
        let radius = |marker: [f64; 3]| marker[0].hypot(marker[1]);
        radius(press.markers()[i]) - radius(rest.markers()[i])
    };
    // The first marker of ring 4 and of ring 7.
    assert!(out(37) > 0.1 && out(127) > 0.0, "{} {}", out(37), out(127));
}

#[test]
fn a_flat_press_has_the_symmetry_of_the_rings() {
    let press = pressed(0.0, 0.0, 4.0);
    for ring in [2_usize, 5] {
        let first = 1 + 3 * ring * (ring - 1);
        let corners: Vec<_> = (0..6).map(|sector| press.markers()[first + sector * ring]).collect();
        for corner in &corners {
            assert!((corner[2] - corners[0][2]).abs() < 0.05, "{corners:?}");
            assert!((corner[0].hypot(corner[1]) - corners[0][0].hypot(corners[0][1])).abs() < 0.05);
        }
    }
    let sideways = press.markers()[0];
    assert!(sideways[0].abs() < 0.02 && sideways[1].abs() < 0.02, "{sideways:?}");
}

#[test]
fn a_tilted_plane_presses_its_side_of_the_dome() {
    // The plane leans towards +x: there it is further away, and the dome is pressed at -x.
    let press = pressed(9.0, 0.0, 5.0);
    let rest = Press::new(&Dome::default(), 0.0, 0.0);
    let sunk = |i: usize| rest.markers()[i][2] - press.markers()[i][2];
    // Ring 4 begins at +x; its opposite marker is 12 further.
    assert!((sunk(37) - sunk(37 + 12)).abs() > 0.3, "{} {}", sunk(37), sunk(37 + 12));
    // A turn of the plane by 60 degrees turns the markers by as much.
    let turned = pressed(9.0, 60.0, 5.0);
    for (a, b) in [(37, 37 + 4), (1, 2), (127, 127 + 7)] {
        assert!((press.markers()[a][2] - turned.markers()[b][2]).abs() < 0.05);
    }
}

#[test]
fn the_force_grows_with_depth() {
    let forces: Vec<f64> = [1.0, 3.0, 6.0, 10.0].map(|depth| pressed(3.0, 20.0, depth).force_n()).to_vec();
    assert!(forces[0] > 0.0 && forces.windows(2).all(|pair| pair[1] > pair[0]), "{forces:?}");
    // Ecoflex 00-30 is soft: newtons, not tens of newtons.
    assert!(forces[3] < 20.0, "{forces:?}");
}
