//! Estimates of clocks from motion and events, against a known offset and drift.

use std::fmt::Write;

use meissner_engine::Event;
use meissner_kernels::random::Random;

use super::{Folder, SENSOR, kinds, odd};
use crate::presses::clock::{Shifts, fit, motion};
use crate::presses::{ClockFit, OddityKind, Options};
use meissner_simulator::{Camera, CameraSettings, MarkerScene, MarkerTracks};

/// A session of presses at random times: begin and duration of each, in microseconds of the host.
fn session(presses: usize, seed: u64) -> Vec<(i64, i64)> {
    let mut random = Random::new(seed);
    let mut at = 400_000.0;
    let press = |_| {
        let (begin, duration) = (at, 150_000.0 + 150_000.0 * random.uniform());
        at += 700_000.0 + 900_000.0 * random.uniform();
        (begin as i64, duration as i64)
    };
    (0..presses).map(press).collect()
}

/// Depth and speed of a press at a share of its duration: down and up again.
fn depth(share: f64) -> f64 {
    (1.0 - (2.0 * std::f64::consts::PI * share).cos()) / 2.0
}

/// The log of a robot with a pose every 8 ms.
fn poses(session: &[(i64, i64)]) -> Vec<(i64, f64)> {
    let end = session.last().map_or(0, |press| press.0 + 1_000_000);
    let at = |t_us: i64| {
        let during = session.iter().find(|press| (press.0..=press.0 + press.1).contains(&t_us));
        during.map_or(0.0, |press| depth((t_us - press.0) as f64 / press.1 as f64))
    };
    (0..end / 8_000).map(|i| (i * 8_000, at(i * 8_000))).collect()
}

/// Events of a press on the host's clock: their number is proportional to the change of depth.
fn events(press: (i64, i64), random: &mut Random) -> Vec<i64> {
    let mut times: Vec<i64> = Vec::new();
    let steps = 400;
    for step in 0..steps {
        let [from, to] = [step, step + 1].map(|step| f64::from(step) / f64::from(steps));
        let count = 400.0 * (depth(to) - depth(from)).abs();
        let count = count as usize + usize::from(random.uniform() < count.fract());
        times.extend(
            (0..count).map(|_| press.0 + ((from + random.uniform() * (to - from)) * press.1 as f64) as i64),
        );
    }
    times.sort_unstable();
    times
}

/// The session in a folder: the sensor's clock is `offset_us` ahead, and gains `ppm`.
fn recorded(presses: usize, offset_us: i64, ppm: f64, seed: u64) -> Folder {
    let (folder, session, mut random) = (Folder::new(), session(presses, seed), Random::new(seed + 1));
    for (i, &press) in session.iter().enumerate() {
        let sensor = |t_us: i64| t_us + offset_us + (t_us as f64 * ppm * 1e-6) as i64;
        let event = |t_us| Event::new(sensor(t_us), (t_us % 32) as u16, (t_us % 24) as u16, t_us % 2 == 0);
        let events: Vec<Event> = events(press, &mut random).into_iter().map(event).collect();
        folder.events(&format!("press{i}.es"), &events);
    }
    let mut text = "host_us,depth_mm\n".to_owned();
    for (t_us, depth) in poses(&session) {
        writeln!(text, "{t_us},{depth:.4}").expect("a text takes everything");
    }
    folder.file("labels.csv", &text);
    folder
}

fn found(folder: &Folder, offset_us: i64) -> (ClockFit, Vec<OddityKind>) {
    let options = Options { offset_us: Some(offset_us), ..Options::default() };
    let presses = folder.try_read(&options).expect("they join");
    (presses.clock.expect("there are poses"), kinds(&presses))
}

#[test]
fn the_proposed_offset_is_right_within_5_ms() {
    let offset_us = 1_234_567;
    let folder = recorded(20, offset_us, 0.0, 3);
    for error in [0, 30_000, -170_000, 900_000] {
        let (fit, kinds) = found(&folder, offset_us + error);
        assert!((fit.shift_us + error).abs() < 5_000, "{error}: {fit:?}");
        assert!(fit.is_sure(), "{error}: {fit:?}");
        assert_eq!(kinds.contains(&OddityKind::Offset), error != 0, "{error}: {kinds:?}");
        assert!(!kinds.contains(&OddityKind::Drift), "{error}: {fit:?}");
    }
    let options = Options { offset_us: Some(offset_us + 30_000), ..Options::default() };
    let presses = folder.try_read(&options).expect("they join");
    let text = odd(&presses, OddityKind::Offset).first.clone();
    let proposed =
        text.split_once("--offset ").and_then(|(_, rest)| rest.split_once("us,")).expect("an offset");
    let proposed: i64 = proposed.0.parse().expect("microseconds");
    assert!((proposed - offset_us).abs() < 5_000, "{text}");
}

#[test]
fn an_offset_that_joins_nothing_is_refused_with_a_proposal() {
    let offset_us = 7_000_000_000;
    let folder = recorded(20, offset_us, 0.0, 4);
    let message = folder.refusal(&Options::default());
    let proposed =
        message.split_once("best with ").and_then(|(_, rest)| rest.split_once("us ")).expect(&message).0;
    let proposed: i64 = proposed.parse().expect("microseconds");
    assert!((proposed - offset_us).abs() < 5_000, "{message}");
}

#[test]
fn drift_is_found_within_three_standard_errors_and_50_ppm() {
    for ppm in [-400.0, 400.0] {
        let offset_us = -50_000;
        let folder = recorded(30, offset_us, ppm, 5);
        let (fit, kinds) = found(&folder, offset_us);
        let drift = fit.drift.expect("the session has parts");
        let error = (drift.ppm - ppm).abs();
        assert!(error < 50.0 && error < 3.0 * drift.error_ppm.max(10.0), "{ppm}: {fit:?}");
        assert!(kinds.contains(&OddityKind::Drift), "{ppm}: {kinds:?}");
    }
}

#[test]
fn the_list_of_recordings_shows_drift_too() {
    let folder = recorded(20, 1_000_000, 0.0, 6);
    let options = Options { offset_us: Some(1_000_000), ..Options::default() };
    let presses = folder.try_read(&options).expect("they join");
    let mut list = "recording,first_us,host_us\n".to_owned();
    for recording in &presses.recordings {
        // The host's clock is slow by 2000 ppm.
        let host = (recording.first_us - 1_000_000) * 998 / 1_000;
        writeln!(list, "{},{},{host}", recording.name, recording.first_us).expect("a text takes everything");
    }
    folder.file("recordings.csv", &list);
    let text = odd(&folder.read(), OddityKind::Drift).first.clone();
    assert!(text.starts_with("2004 ppm") && text.ends_with("by recordings.csv"), "{text}");
}

#[test]
fn presses_that_repeat_evenly_leave_the_offset_unsure_and_near_the_used_one() {
    let even: Vec<(i64, i64)> = (0..20).map(|i| (400_000 + i * 1_000_000, 200_000)).collect();
    let (poses, mut random) = (poses(&even), Random::new(7));
    let mut rates: Vec<(i64, f64)> =
        even.iter().flat_map(|&press| events(press, &mut random)).map(|t_us| (t_us + 20_000, 1.0)).collect();
    rates.sort_by_key(|rate| rate.0);
    let (times, values): (Vec<i64>, Vec<f64>) = poses.into_iter().unzip();
    let steps = motion(&times, &values, None, 100_000);
    let (_, fit) = fit(&rates, &[steps], Shifts::Within(5_000_000)).expect("they vary");
    assert!((fit.shift_us - 20_000).abs() < 5_000 && !fit.is_sure(), "{fit:?}");
}

#[test]
fn an_angle_that_wraps_is_no_motion() {
    let times: Vec<i64> = (0..10).map(|i| i * 100_000).collect();
    let values = [179.0, -179.0, -177.0, -175.0, f64::NAN, -172.0, -172.0, -172.0, -172.0, -172.0];
    let sizes =
        |period| motion(&times, &values, period, 100_000).iter().map(|step| step.2).collect::<Vec<_>>();
    assert_eq!(sizes(Some(360.0)), [2.0, 2.0, 2.0, 0.0, 3.0, 0.0, 0.0, 0.0, 0.0]);
    assert_eq!(sizes(None)[0], 358.0);
    assert_eq!(motion(&[0, 10, 10, 500_000], &[0.0, 1.0, 2.0, 3.0], None, 100).len(), 1);
}

#[test]
fn times_at_the_ends_of_the_clock_give_nothing_instead_of_an_overflow() {
    let ends = [(i64::MIN, 1.0), (i64::MAX, 1.0)];
    assert_eq!(fit(&ends, &[vec![(0, 10, 1.0)]], Shifts::All), None);
    assert_eq!(fit(&[(0, 1.0), (10, 2.0)], &[vec![(i64::MIN, i64::MIN + 5, 1.0)]], Shifts::All), None);
    let far = 1 << 59;
    assert!(
        fit(&[(-far, 1.0), (far, 2.0)], &[vec![(0, 10, 1.0), (10, 20, 2.0)]], Shifts::All)
            .is_none_or(|(_, fit)| fit.correlation <= 1.0)
    );
}

/// The markers of a soft sensor move with the depth, before a camera with noise and latency.
#[test]
fn the_offset_of_filmed_presses_is_right_within_5_ms() {
    let (offset_us, folder, session) = (-2_500_000, Folder::new(), session(10, 8));
    let mut text = "host_us,force_n\n".to_owned();
    for (t_us, depth) in poses(&session) {
        writeln!(text, "{t_us},{:.3}", 5.0 * depth.powf(1.5)).expect("a text takes everything");
    }
    folder.file("labels.csv", &text);
    for (i, press) in session.into_iter().enumerate() {
        let times: Vec<i64> = (-5..=45).map(|step| press.0 + press.1 * step / 40).collect();
        let at = |t_us: &i64| {
            let share = (t_us - press.0) as f64 / press.1 as f64;
            let moved = 5.0 * depth(share.clamp(0.0, 1.0)) as f32;
            [[6.0, 6.0], [20.0, 8.0], [12.0, 16.0], [24.0, 18.0]]
                .map(|[x, y]: [f32; 2]| [x + moved, y + 0.3 * moved])
        };
        let tracks =
            MarkerTracks::new(times.clone(), 4, times.iter().flat_map(at).collect()).expect("tracks");
        let mut camera = Camera::new(SENSOR, CameraSettings::tactile(), i as u64).expect("a camera");
        let mut filmed = Vec::new();
        tracks.film(&MarkerScene::default(), &mut camera, &mut filmed).expect("a film");
        let events: Vec<Event> = filmed
            .iter()
            .map(|filmed| Event { t_us: filmed.event.t_us + offset_us, ..filmed.event })
            .collect();
        folder.events(&format!("press{i}.npy"), &events);
    }
    let (fit, kinds) = found(&folder, offset_us + 40_000);
    assert!((fit.shift_us + 40_000).abs() < 5_000 && fit.is_sure(), "{fit:?}");
    assert!(kinds.contains(&OddityKind::Offset), "{kinds:?}");
}
