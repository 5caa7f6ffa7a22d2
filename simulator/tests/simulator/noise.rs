//! Noise against measured facts: how many of 2,500 pixels of a real sensor show any, by light and
//! polarity.

use meissner_engine::Sensor;
use meissner_simulator::{Camera, CameraSettings, Cause, SimulatedEvent};

/// The events of a white wall at `lux` for `seconds`.
fn white_wall(settings: CameraSettings, sensor: Sensor, lux: f64, seconds: i64) -> Vec<SimulatedEvent> {
    let image = vec![1.0; usize::from(sensor.width) * usize::from(sensor.height)];
    let mut camera = Camera::new(sensor, CameraSettings { lux, ..settings }, 11).unwrap();
    let mut events = Vec::new();
    camera.push(0, &image, &mut events).unwrap();
    camera.push(seconds * 1_000_000, &image, &mut events).unwrap();
    camera.finish(&mut events);
    events
}

/// Share of pixels, in per cent, with an event of each polarity (on, off) that `counts`.
fn share_of_pixels(events: &[SimulatedEvent], sensor: Sensor) -> [f64; 2] {
    let pixels = usize::from(sensor.width) * usize::from(sensor.height);
    [true, false].map(|on| {
        let mut seen = vec![false; pixels];
        for simulated in events.iter().filter(|simulated| simulated.event.on == on) {
            seen[usize::from(simulated.event.y) * usize::from(sensor.width)
                + usize::from(simulated.event.x)] = true;
        }
        100.0 * seen.iter().filter(|&&seen| seen).count() as f64 / pixels as f64
    })
}

#[test]
fn noise_by_light_and_polarity_is_that_of_a_measured_sensor() {
    // Measured, on and off in per cent: 100 and 100 at 0.1 lux, 34 and 0.2 at 161 lux, 95 and 0 at
    // 3,000 lux. How long the sensor was watched is not known; the rates are set for ten seconds.
    let sensor = Sensor::new(50, 50);
    let settings = CameraSettings { hot_share: 0.0, ..CameraSettings::default() };
    let dim = share_of_pixels(&white_wall(settings, sensor, 0.1, 10), sensor);
    let room = share_of_pixels(&white_wall(settings, sensor, 161.0, 10), sensor);
    let bright = share_of_pixels(&white_wall(settings, sensor, 3_000.0, 10), sensor);
    assert!(dim[0] > 99.0 && dim[1] > 99.0, "{dim:?}");
    assert!((room[0] - 34.0).abs() < 6.0 && room[1] < 0.6, "{room:?}");
    assert!((bright[0] - 95.0).abs() < 5.0 && bright[1] == 0.0, "{bright:?}");
}

#[test]
fn shot_noise_prefers_no_polarity() {
    let settings =
        CameraSettings { leak_hz: 0.0, leak_hz_per_klux: 0.0, hot_share: 0.0, ..CameraSettings::default() };
    let events = white_wall(settings, Sensor::new(50, 50), 0.05, 10);
    assert!(events.iter().all(|simulated| simulated.cause == Cause::ShotNoise));
    let on = events.iter().filter(|simulated| simulated.event.on).count() as f64 / events.len() as f64;
    assert!(events.len() > 100_000 && (on - 0.5).abs() < 0.005, "{on} of {}", events.len());
    // 5 Hz of 2,500 pixels for 10 s.
    assert!((events.len() as f64 / 125_000.0 - 1.0).abs() < 0.01, "{}", events.len());
}

#[test]
fn leak_makes_on_events_at_its_rate() {
    let settings = CameraSettings {
        shot_hz: 0.0,
        hot_share: 0.0,
        leak_hz: 2.0,
        leak_hz_per_klux: 0.0,
        threshold_spread: 0.0,
        ..CameraSettings::default()
    };
    let events = white_wall(settings, Sensor::new(30, 30), 300.0, 10);
    assert!(events.iter().all(|simulated| simulated.event.on));
    let leaks = events.iter().filter(|simulated| simulated.cause == Cause::Leak).count();
    // A first event that the phase brings before half a threshold of leak counts as signal.
    assert!(leaks as f64 > 0.95 * events.len() as f64);
    assert!((events.len() as f64 / (2.0 * 10.0 * 900.0) - 1.0).abs() < 0.05, "{}", events.len());
}

#[test]
fn hot_pixels_are_as_many_and_as_frequent_as_asked() {
    let settings = CameraSettings { hot_share: 0.02, hot_hz: 100.0, ..CameraSettings::default() };
    let sensor = Sensor::new(100, 100);
    let events = white_wall(settings, sensor, 300.0, 10);
    let hot: Vec<SimulatedEvent> =
        events.into_iter().filter(|simulated| simulated.cause == Cause::HotPixel).collect();
    let [share, off] = share_of_pixels(&hot, sensor);
    assert!((share - 2.0).abs() < 0.5 && off == 0.0, "{share}");
    let rate = hot.len() as f64 / 10.0 / (share * 100.0);
    assert!((rate - 50.0).abs() < 8.0, "{rate} Hz");
}
