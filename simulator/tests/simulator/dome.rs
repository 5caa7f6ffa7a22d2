//! The dome: its mesh and presses, markers in a camera, and the table of presses.

mod markers {
    //! Markers: the positions and polarities of the events of a moving disc.

    use meissner_engine::Sensor;
    use meissner_simulator::{Camera, CameraSettings, MarkerScene, MarkerTracks, SimulatorError};

    const SENSOR: Sensor = Sensor { width: 40, height: 30 };

    #[test]
    fn a_bright_marker_turns_pixels_on_in_front_of_it_and_off_after_it() {
        let tracks = MarkerTracks::new(vec![0, 50_000], 1, vec![[10.0, 15.0], [28.0, 15.0]]).unwrap();
        let scene = MarkerScene { radius: 4.0, ..MarkerScene::default() };
        let mut camera = Camera::new(SENSOR, CameraSettings::ideal(), 5).unwrap();
        let mut events = Vec::new();
        tracks.film(&scene, &mut camera, &mut events).unwrap();
        let (on, off): (Vec<_>, Vec<_>) =
            events.iter().map(|simulated| simulated.event).partition(|event| event.on);
        assert!(on.len() > 100 && on.len().abs_diff(off.len()) < on.len() / 5, "{} {}", on.len(), off.len());
        for (events, side) in [(on, 1.0), (off, -1.0)] {
            for event in events {
                let centre = 10.0 + 18.0 * event.t_us as f32 / 50_000.0;
                let ahead = (f32::from(event.x) - centre) * side;
                let distance = (f32::from(event.x) - centre).hypot(f32::from(event.y) - 15.0);
                assert!(
                    ahead > -1.0 && (distance - 4.0).abs() < 1.0,
                    "{event:?} with the marker at {centre}"
                );
            }
        }
    }

    #[test]
    fn a_marker_that_rests_causes_nothing() {
        let tracks = MarkerTracks::new(vec![0, 10_000, 20_000], 1, vec![[10.3, 15.2]; 3]).unwrap();
        let mut camera = Camera::new(SENSOR, CameraSettings::ideal(), 5).unwrap();
        let mut events = Vec::new();
        tracks.film(&MarkerScene::default(), &mut camera, &mut events).unwrap();
        assert_eq!(events, []);
    }

    #[test]
    fn the_light_of_a_marker_is_its_area_wherever_it_is() {
        let scene = MarkerScene { radius: 3.0, edge: 1.0, marker: 1.0, ground: 0.0 };
        let mut image = vec![0.0; 40 * 30];
        for offset in [0.0, 0.25, 0.5, 0.9] {
            scene.draw(SENSOR, &[[15.0 + offset, 12.0 - offset]], &mut image);
            let light: f32 = image.iter().sum();
            assert!((light / (std::f32::consts::PI * 9.0) - 1.0).abs() < 0.05, "{light} at {offset}");
        }
        // Markers that leave the image, or lie outside of it, are cut.
        scene.draw(SENSOR, &[[-50.0, 3.0], [39.0, 29.0], [1e9, 1e9]], &mut image);
        assert!(image.iter().sum::<f32>() > 5.0);
    }

    #[test]
    fn many_times_give_the_events_of_two_where_the_motion_is_the_same() {
        let film = |times: &[i64]| {
            let positions = times.iter().map(|&t| [10.0 + t as f32 / 5_000.0, 15.0]).collect();
            let tracks = MarkerTracks::new(times.to_vec(), 1, positions).unwrap();
            let mut camera = Camera::new(SENSOR, CameraSettings::ideal(), 5).unwrap();
            let mut events = Vec::new();
            tracks.film(&MarkerScene::default(), &mut camera, &mut events).unwrap();
            events
        };
        let (two, many) = (film(&[0, 80_000]), film(&[0, 9_000, 20_000, 35_000, 52_000, 80_000]));
        assert!(two.len().abs_diff(many.len()) <= two.len() / 20, "{} {}", two.len(), many.len());
    }

    #[test]
    fn tracks_that_do_not_fit_are_refused() {
        assert_eq!(
            MarkerTracks::new(vec![0, 1], 2, vec![[0.0; 2]; 3]),
            Err(SimulatorError::Tracks { times: 2, markers: 2, found: 3 })
        );
        assert_eq!(
            MarkerTracks::new(vec![5, 5], 1, vec![[0.0; 2]; 2]),
            Err(SimulatorError::Time { before: 5, found: 5 })
        );
        assert_eq!(
            MarkerTracks::new(vec![0, 7], 2, vec![[0.0; 2], [0.0; 2], [0.0; 2], [f32::NAN, 0.0]]),
            Err(SimulatorError::Position { marker: 1, t_us: 7 })
        );
    }
}

mod membrane {
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
        let forces: Vec<f64> =
            [1.0, 3.0, 6.0, 10.0].map(|depth| pressed(3.0, 20.0, depth).force_n()).to_vec();
        assert!(forces[0] > 0.0 && forces.windows(2).all(|pair| pair[1] > pair[0]), "{forces:?}");
        // Ecoflex 00-30 is soft: newtons, not tens of newtons.
        assert!(forces[3] < 20.0, "{forces:?}");
    }
}

mod table {
    //! Presses by interpolation, against presses that are computed.

    use meissner_engine::Sensor;
    use meissner_simulator::{Dome, DomeView, Press, PressTable};

    #[test]
    fn a_press_between_those_of_the_table_is_a_small_part_of_a_pixel_off() {
        let dome = Dome::default();
        let table = PressTable::new(&dome, 6.0);
        let view = DomeView::new(&dome, Sensor::new(346, 260));
        let mut markers = Vec::new();
        // Between tilts and directions, in several sixths of a turn, and on a press of the table.
        for (tilt_deg, azimuth_deg, depth_mm, most) in [
            (0.0, 0.0, 6.0, 1e-4),
            (2.0, 180.0, 5.0, 0.05),
            (3.0, 10.0, 5.8, 0.4),
            (9.0, 250.0, 4.25, 0.4),
            (5.0, 350.0, 6.0, 0.4),
        ] {
            let (tilt, azimuth) = (f64::to_radians(tilt_deg), f64::to_radians(azimuth_deg));
            let mut press = Press::new(&dome, tilt, azimuth);
            press.press_to(depth_mm);
            table.markers(tilt, azimuth, depth_mm, &mut markers);
            assert_eq!((markers.len(), press.markers().len()), (table.count(), table.count()));
            let away = |(&found, &expected): (&[f64; 3], &[f64; 3])| {
                let (found, expected) = (view.place(found), view.place(expected));
                (found[0] - expected[0]).hypot(found[1] - expected[1])
            };
            let mut away: Vec<f32> = markers.iter().zip(press.markers()).map(away).collect();
            away.sort_unstable_by(f32::total_cmp);
            let (median, furthest) = (away[away.len() / 2], away[away.len() - 1]);
            assert!(median < 0.1 && furthest < most, "{tilt_deg} {azimuth_deg}: {median} {furthest} pixels");
        }
    }
}
