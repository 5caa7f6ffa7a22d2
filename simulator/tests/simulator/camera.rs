//! The camera without noise, against the closed form and against small steps in time.

use meissner_engine::{Event, Sensor};
use meissner_simulator::{Camera, CameraSettings, Cause, SimulatedEvent, SimulatorError};
use proptest::prelude::*;

const PIXEL: Sensor = Sensor { width: 1, height: 1 };

/// No noise, and all pixels start at their light.
fn in_phase() -> CameraSettings {
    CameraSettings { initial_phase: false, ..CameraSettings::ideal() }
}

/// The events of one pixel that sees `images`, pairs of time and intensity.
fn events_of(settings: CameraSettings, images: &[(i64, f32)]) -> Vec<Event> {
    let mut camera = Camera::new(PIXEL, settings, 1).unwrap();
    let mut events = Vec::new();
    for &(t_us, intensity) in images {
        camera.push(t_us, &[intensity], &mut events).unwrap();
    }
    camera.finish(&mut events);
    events.into_iter().map(|simulated| simulated.event).collect()
}

#[test]
fn a_ramp_of_the_logarithm_crosses_at_equal_times() {
    // ln 4 = 1.386 in 13.863 ms is 0.1 a millisecond; the threshold of 0.2 is reached every 2 ms.
    let ideal = CameraSettings { dark_lux: 1e-12, ..in_phase() };
    let events = events_of(ideal, &[(5, 0.2), (13_868, 0.8)]);
    let times: Vec<i64> = events.iter().map(|event| event.t_us).collect();
    assert_eq!(times.len(), 6);
    for (i, t_us) in times.iter().enumerate() {
        let exact = 5.0 + 2_000.0 * (i + 1) as f64;
        assert!((*t_us as f64 - exact).abs() <= 2.0, "{t_us} instead of {exact}");
    }
}

#[test]
fn a_step_of_contrast_gives_its_logarithm_over_the_threshold() {
    for contrast in [1.1_f32, 1.3, 2.0, 5.0, 10.0] {
        let expected = (f64::from(contrast).ln() / 0.2).floor() as usize;
        let up = events_of(in_phase(), &[(0, 0.05), (1_000, 0.05 * contrast)]);
        let down = events_of(in_phase(), &[(0, 0.05 * contrast), (1_000, 0.05)]);
        assert_eq!((up.len(), down.len()), (expected, expected), "contrast {contrast}");
        assert!(up.iter().all(|event| event.on) && down.iter().all(|event| !event.on));
    }
}

#[test]
fn a_step_reaches_a_slow_pixel_when_the_low_pass_says() {
    // A step of ln 3 in 1 us through tau = 1 / (2 pi 100 Hz) crosses 0.2 at -tau ln(1 - 0.2 / ln
    // 3).
    let slow = CameraSettings { cutoff_max_hz: 100.0, dark_lux: 1e-12, ..in_phase() };
    let events = events_of(slow, &[(0, 0.2), (1, 0.6), (100_000, 0.6)]);
    let tau_us = 1e6 / (2.0 * std::f64::consts::PI * 100.0);
    assert_eq!(events.len(), 5);
    for (i, event) in events.iter().enumerate() {
        let exact = -tau_us * (1.0 - 0.2 * (i + 1) as f64 / 3.0_f64.ln()).ln();
        assert!((event.t_us as f64 - exact).abs() <= 2.0, "{} instead of {exact}", event.t_us);
    }
}

#[test]
fn darker_pixels_are_slower() {
    let settings = CameraSettings { cutoff_max_hz: 1e6, cutoff_hz_per_lux: 2.3, dark_lux: 0.1, ..in_phase() };
    let delay = |lux: f64| {
        events_of(CameraSettings { lux, ..settings }, &[(0, 0.2), (1, 0.4), (1_000_000, 0.4)])[0].t_us
    };
    // tau goes with 1 / light.
    let ratio = delay(10.0) as f64 / delay(1_000.0) as f64;
    assert!((ratio / 100.0 - 1.0).abs() < 0.15, "{ratio}");
}

#[test]
fn the_first_image_and_light_that_stays_cause_nothing() {
    let sensor = Sensor::new(40, 30);
    let mut camera = Camera::new(sensor, CameraSettings::ideal(), 3).unwrap();
    let image: Vec<f32> = (0..1_200).map(|i| i as f32 / 1_200.0).collect();
    let mut events = Vec::new();
    for t_us in [1_700_000_000_000_000, 1_700_000_000_001_000, 1_700_000_010_000_000] {
        camera.push(t_us, &image, &mut events).unwrap();
    }
    camera.finish(&mut events);
    assert_eq!(events, []);
}

#[test]
fn random_phases_spread_the_first_events_of_equal_pixels_over_a_threshold() {
    let sensor = Sensor::new(50, 40);
    let mut camera =
        Camera::new(sensor, CameraSettings { dark_lux: 1e-12, ..CameraSettings::ideal() }, 3).unwrap();
    let mut events = Vec::new();
    // The logarithm rises by one threshold in 10 ms: each pixel fires once, at a time that depends
    // on its phase, except for the half that start below their reference.
    camera.push(0, &[0.5; 2_000], &mut events).unwrap();
    camera.push(10_000, &[0.5 * 0.2_f32.exp(); 2_000], &mut events).unwrap();
    camera.finish(&mut events);
    assert!((900..1_100).contains(&events.len()), "{}", events.len());
    for tenth in 0..10 {
        let range = tenth * 1_000..(tenth + 1) * 1_000;
        let count = events.iter().filter(|simulated| range.contains(&simulated.event.t_us)).count();
        assert!((60..140).contains(&count), "{count} events in {range:?} us");
    }
}

#[test]
fn no_two_events_of_a_pixel_are_closer_than_the_refractory_time() {
    let settings = CameraSettings { refractory_us: 500.0, ..in_phase() };
    let events = events_of(settings, &[(0, 0.01), (2_000, 1.0)]);
    assert!(events.len() >= 3);
    assert!(events.windows(2).all(|pair| pair[1].t_us - pair[0].t_us >= 499), "{events:?}");
}

#[test]
fn latency_delays_and_jitter_spreads_the_stamps() {
    let sensor = Sensor::new(100, 100);
    let settings = CameraSettings { latency_us: 100.0, jitter_us: 20.0, ..in_phase() };
    let mut camera = Camera::new(sensor, settings, 9).unwrap();
    let mut events = Vec::new();
    camera.push(0, &vec![0.2; 10_000], &mut events).unwrap();
    camera.push(1, &vec![0.26; 10_000], &mut events).unwrap();
    camera.finish(&mut events);
    assert_eq!(events.len(), 10_000);
    let mean = events.iter().map(|e| e.event.t_us as f64).sum::<f64>() / 1e4;
    let variance = events.iter().map(|e| (e.event.t_us as f64 - mean).powi(2)).sum::<f64>() / 1e4;
    assert!(
        (mean - 101.3).abs() < 1.0 && (variance.sqrt() - 20.0).abs() < 1.0,
        "{mean} +- {}",
        variance.sqrt()
    );
}

#[test]
fn a_spread_of_thresholds_differs_by_polarity_and_stays_positive() {
    let sensor = Sensor::new(100, 100);
    let settings = CameraSettings { threshold_spread: 0.2, ..in_phase() };
    let count = |from: f32, to: f32| {
        let mut camera = Camera::new(sensor, settings, 2).unwrap();
        let mut events = Vec::new();
        camera.push(0, &vec![from; 10_000], &mut events).unwrap();
        camera.push(1_000, &vec![to; 10_000], &mut events).unwrap();
        camera.finish(&mut events);
        let mut pixels = vec![0_usize; 10_000];
        for simulated in events {
            pixels[usize::from(simulated.event.y) * 100 + usize::from(simulated.event.x)] += 1;
        }
        pixels
    };
    let (rising, falling) = (count(0.2, 0.4), count(0.4, 0.2));
    // At the least threshold of 0.01, ln 2 is 69 events.
    assert_eq!(rising.iter().max(), Some(&69));
    assert!(rising != falling && rising.contains(&0));
}

#[test]
fn a_refused_image_leaves_the_camera_as_it_was() {
    let mut camera = Camera::new(Sensor::new(2, 1), CameraSettings::default(), 0).unwrap();
    let mut untouched = camera.clone();
    let mut events = Vec::new();
    for camera in [&mut camera, &mut untouched] {
        camera.push(10, &[0.1, 0.2], &mut events).unwrap();
    }
    let refusals = [
        camera.push(10, &[0.3, 0.2], &mut events),
        camera.push(i64::MAX, &[0.3, 0.2], &mut events),
        camera.push(20, &[0.3], &mut events),
        camera.push(20, &[0.3, f32::NAN], &mut events),
        camera.push(20, &[0.3, -0.1], &mut events),
    ];
    assert_eq!(refusals[0], Err(SimulatorError::Time { before: 10, found: 10 }));
    assert_eq!(refusals[2], Err(SimulatorError::Pixels { expected: 2, found: 1 }));
    assert!(matches!(refusals[3], Err(SimulatorError::Intensity { x: 1, y: 0, .. })));
    assert!(refusals.iter().all(Result::is_err));
    let after = |camera: &mut Camera| {
        let mut events = Vec::new();
        camera.push(50_000, &[0.9, 0.01], &mut events).unwrap();
        camera.finish(&mut events);
        events
    };
    assert_eq!(after(&mut camera), after(&mut untouched));
}

#[test]
fn settings_out_of_range_are_refused_by_name() {
    let refused = |settings| match Camera::new(PIXEL, settings, 0) {
        Err(SimulatorError::Setting { name, .. }) => name,
        other => panic!("{other:?}"),
    };
    let settings = CameraSettings::default();
    assert_eq!(refused(CameraSettings { lux: 0.0, ..settings }), "lux");
    assert_eq!(refused(CameraSettings { threshold_on: -0.2, ..settings }), "threshold_on");
    assert_eq!(refused(CameraSettings { jitter_us: f64::NAN, ..settings }), "jitter_us");
    assert_eq!(refused(CameraSettings { cutoff_max_hz: 0.0, ..settings }), "cutoff_max_hz");
}

/// The pixel's equations in steps of a twentieth of a microsecond: slow, and obviously equal to the
/// list in `camera`.
fn in_small_steps(settings: &CameraSettings, images: &[(i64, f32)]) -> Vec<Event> {
    const STEP_US: f64 = 0.05;
    let logarithm = |intensity: f32| (settings.lux * f64::from(intensity) + settings.dark_lux).ln();
    let mut level = logarithm(images[0].1);
    let (mut reference, mut release, mut events) = (level, 0.0, Vec::new());
    for pair in images.windows(2) {
        let [(start, from), (end, to)] = [pair[0], pair[1]];
        let (from, to) = (logarithm(from), logarithm(to));
        let lux = (0.5 * (from + to)).exp();
        let cutoff_hz = (settings.cutoff_hz_per_lux * lux).min(settings.cutoff_max_hz);
        let share = 1.0 - (-STEP_US * 2.0 * std::f64::consts::PI * cutoff_hz / 1e6).exp();
        let leak = (settings.leak_hz + settings.leak_hz_per_klux * lux / 1e3) / 1e6 * settings.threshold_on;
        let steps = ((end - start) as f64 / STEP_US).round() as usize;
        for step in 1..=steps {
            let t_us = start as f64 + step as f64 * STEP_US;
            let target = from + (to - from) * (step as f64 - 0.5) / steps as f64;
            level += share * (target - level);
            reference -= leak * STEP_US;
            let difference = level - reference;
            if t_us <= release {
                reference = level;
            } else if difference >= settings.threshold_on || difference <= -settings.threshold_off {
                events.push(Event::new(t_us.ceil() as i64, 0, 0, difference > 0.0));
                reference = level;
                release = t_us + settings.refractory_us;
            }
        }
    }
    events
}

/// Times up to 3 ms apart and intensities of any contrast.
fn images() -> impl Strategy<Value = Vec<(i64, f32)>> {
    let image = (1_i64..3_000, 0.0_f32..1.0, any::<bool>());
    prop::collection::vec(image, 2..8).prop_map(|images| {
        let (mut t_us, mut before, mut all) = (0, 0.5, Vec::new());
        for (after, intensity, stays) in images {
            t_us += after;
            before = if stays { before } else { intensity };
            all.push((t_us, before));
        }
        all
    })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(64))]

    #[test]
    fn events_are_those_of_small_steps(images in images(), cutoff in 30.0..5_000.0, leak in 0.0..500.0, refractory in 20.0..800.0) {
        let settings = CameraSettings {
            dark_lux: 1.0,
            cutoff_max_hz: cutoff,
            cutoff_hz_per_lux: 5.0,
            leak_hz: leak,
            refractory_us: refractory,
            threshold_off: 0.25,
            ..in_phase()
        };
        let (found, expected) = (events_of(settings, &images), in_small_steps(&settings, &images));
        // If the level only touches a threshold, one of the two may miss it, and everything after
        // it differs. If it comes close slowly, a small difference of levels is a larger difference
        // of times.
        let close = |i: usize| {
            let since = if i == 0 { 0 } else { expected[i].t_us - expected[i - 1].t_us };
            found[i].on == expected[i].on && (found[i].t_us - expected[i].t_us).abs() <= 3 + since / 100
        };
        let agree = (0..found.len().min(expected.len())).take_while(|&i| close(i)).count();
        prop_assert!(agree + 1 >= expected.len().min(found.len()), "{found:?}\n{expected:?}");
        prop_assert!(found.len().abs_diff(expected.len()) <= 1, "{found:?}\n{expected:?}");
    }

    #[test]
    fn an_image_on_the_line_between_two_changes_nothing(images in images(), seed: u64, share in 0.1..0.9) {
        // No limit of bandwidth and no noise that depends on the light: then only the line matters.
        let settings = CameraSettings { leak_hz: 200.0, shot_hz: 300.0, shot_corner_lux: 1e9, refractory_us: 80.0, ..CameraSettings::ideal() };
        let run = |images: &[(i64, f32)]| {
            let mut camera = Camera::new(PIXEL, settings, seed).unwrap();
            let mut events: Vec<SimulatedEvent> = Vec::new();
            for &(t_us, intensity) in images {
                camera.push(t_us, &[intensity], &mut events).unwrap();
            }
            camera.finish(&mut events);
            events
        };
        let mut finer = Vec::new();
        for pair in images.windows(2) {
            finer.push(pair[0]);
            let [(start, from), (end, to)] = [pair[0], pair[1]];
            let t_us = start + ((end - start) as f64 * share) as i64;
            if t_us > start {
                let logarithm = |intensity: f32| (settings.lux * f64::from(intensity) + settings.dark_lux).ln();
                let part = (t_us - start) as f64 / (end - start) as f64;
                let light = (logarithm(from) + (logarithm(to) - logarithm(from)) * part).exp() - settings.dark_lux;
                finer.push((t_us, (light / settings.lux) as f32));
            }
        }
        finer.extend(images.last());
        let (coarse, fine) = (run(&images), run(&finer));
        prop_assert_eq!(coarse.len(), fine.len());
        for (a, b) in coarse.iter().zip(&fine) {
            prop_assert!(a.cause == b.cause && a.event.on == b.event.on && (a.event.t_us - b.event.t_us).abs() <= 2, "{a:?} {b:?}");
        }
    }

    #[test]
    fn events_are_in_order_and_determined_by_the_seed(seed: u64, lights in prop::collection::vec(0.0_f32..1.0, 4 * 6)) {
        let run = |seed| {
            let mut camera = Camera::new(Sensor::new(2, 2), CameraSettings { hot_share: 0.5, shot_hz: 100.0, lux: 1.0, ..CameraSettings::default() }, seed).unwrap();
            let mut events = Vec::new();
            for (i, image) in lights.chunks(4).enumerate() {
                camera.push(1_000 * i as i64, image, &mut events).unwrap();
            }
            camera.finish(&mut events);
            events
        };
        let events = run(seed);
        prop_assert!(events.windows(2).all(|pair| pair[0].event.t_us <= pair[1].event.t_us));
        prop_assert_eq!(&events, &run(seed));
        prop_assert!(events.iter().all(|e| e.cause != Cause::Leak));
    }
}

mod noise {
    //! Noise against measurements: the share of 2,500 pixels of a real sensor with noise, by light
    //! and polarity.

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
        // Measured, on and off in per cent: 100 and 100 at 0.1 lux, 34 and 0.2 at 161 lux, 95 and 0
        // at 3,000 lux. The duration of the measurement is not known; the rates are set for ten
        // seconds.
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
        let settings = CameraSettings {
            leak_hz: 0.0,
            leak_hz_per_klux: 0.0,
            hot_share: 0.0,
            ..CameraSettings::default()
        };
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
}
