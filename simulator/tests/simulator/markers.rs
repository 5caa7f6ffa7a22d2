//! Markers: where a moving disc makes events, and of which polarity.

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
            assert!(ahead > -1.0 && (distance - 4.0).abs() < 1.0, "{event:?} with the marker at {centre}");
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
