use meissner_simulator::gel::GelSensor;

use super::{Delays, Goal, MAX_N, PERIOD_S, Plan, Report, Variation, run, saw_tooth};
use crate::area::tests::red;
use crate::error::EvaluateError;
use crate::trainings::Request;

fn report(goal: Goal, seconds: f64, variations: &[Variation]) -> Result<Report, EvaluateError> {
    // The forces are wrong, the middle is about right.
    let folder = tempfile::tempdir().unwrap();
    let (networks, weights) = red(folder.path(), [0.02, 0.004]);
    let request = Request { networks: &networks, weights: Some((&*weights).into()), trainings: None };
    let sensor = GelSensor::second();
    run(&Plan { request, goal, sensor, seconds, rate_hz: 25.0, seed: 4, variations })
}

#[test]
fn a_saw_tooth_rises_evenly_and_falls_at_once() {
    assert_eq!(saw_tooth(0.0), 0.4);
    assert!((saw_tooth(PERIOD_S / 2.0) - 1.0).abs() < 1e-12);
    assert!((saw_tooth(PERIOD_S - 1e-9) - MAX_N).abs() < 1e-6 && saw_tooth(PERIOD_S) == 0.4);
}

#[test]
fn a_controller_that_knows_the_truth_follows_but_for_the_fall() {
    let report = report(Goal::SawTooth, 6.0, &[]).unwrap();
    let row = &report.truth;
    assert_eq!((row.pictures, row.read, row.pictures_lost, row.reading_error), (150, 150, 0, Some(0.0)));
    // While the goal rises, the error comes from a wrong model of the gel and is small.
    let rising = row.trace.iter().filter(|(at_s, ..)| (1.0..4.0).contains(at_s) || *at_s > 4.5);
    let worst = rising.map(|(_, goal, is)| (goal - is).abs()).fold(0.0, f64::max);
    assert!(worst < 0.05, "{worst} N");
    assert!(row.error < 0.06 && row.rms > row.error, "{} {}", row.error, row.rms);
}

#[test]
fn a_pushed_marble_comes_back_to_the_middle() {
    let report = report(Goal::Marble, 4.0, &[]).unwrap();
    let at = |step: usize| report.truth.trace[step].2;
    assert!((at(0) - 4.0).abs() < 1e-9 && (at(50) - 4.0).abs() < 1e-9);
    for before_push in [49, 99] {
        assert!(at(before_push) < 1e-3, "{} mm", at(before_push));
    }
    // It cannot roll faster than it may: 20 mm/s is 0.8 mm a picture.
    let trace = &report.truth.trace;
    assert!(trace.windows(2).all(|pair| pair[0].2 - pair[1].2 < 0.8 + 1e-9));
}

#[test]
fn a_network_that_sees_the_marble_brings_it_nearer_and_the_same_seed_gives_the_same_loop() {
    // A run time that no machine reaches: the loop then depends on the seed alone.
    let delays = Delays { slower: 1e-9, ..Delays::default() };
    let variations = [
        Variation { tolerance: None, delays },
        Variation { tolerance: None, delays: Delays { stale_us: 400_000, ..delays } },
        Variation { tolerance: None, delays: Delays { lost: 1.0, ..delays } },
    ];
    let [one, two] = [(); 2].map(|()| report(Goal::Marble, 4.0, &variations).unwrap());
    let rows = &one.networks[0].rows;
    for (row, again) in rows.iter().zip(&two.networks[0].rows) {
        assert_eq!(row.trace, again.trace);
    }
    let [fresh, stale, blind] = [0, 1, 2].map(|i| &rows[i]);
    assert!(
        fresh.error < stale.error && stale.error < blind.error,
        "{} {} {}",
        fresh.error,
        stale.error,
        blind.error
    );
    assert!(
        (blind.error - 4.0).abs() < 1e-9 && (blind.read, blind.pictures_lost) == (0, 100),
        "nothing is seen"
    );
    assert_eq!((blind.run_us, blind.age_us, blind.reading_error), (None, None, None));
    assert!(stale.age_us > Some(400_000.0), "{:?}", stale.age_us);
    assert!(one.truth.error < fresh.error);
}

#[test]
fn a_network_without_time_for_every_picture_takes_the_newest() {
    let delays = Delays { slower: 1e6, ..Delays::default() };
    let report = report(Goal::SawTooth, 2.0, &[Variation { tolerance: None, delays }]).unwrap();
    let row = &report.networks[0].rows[0];
    assert!(row.read < row.pictures && row.pictures_lost == 0, "{} of {}", row.read, row.pictures);
}

#[test]
fn what_is_no_loop_is_refused() {
    let lost = |lost: f64| Variation { tolerance: None, delays: Delays { lost, ..Delays::default() } };
    let slower = |slower: f64| Variation { tolerance: None, delays: Delays { slower, ..Delays::default() } };
    for (seconds, variation) in
        [(0.0, lost(0.0)), (f64::NAN, lost(0.0)), (1.0, lost(1.5)), (1.0, slower(0.0))]
    {
        let error = report(Goal::Marble, seconds, &[variation]).err().expect("it is refused");
        assert!(matches!(error, EvaluateError::Request { .. }), "{error}");
    }
}

mod line {
    use std::convert::Infallible;
    use std::time::Duration;

    use meissner_simulator::plants::BallContact;

    use crate::closed_loop::line::{Delays, Line};

    /// A network that takes a millisecond and predicts the first byte of a picture.
    #[expect(clippy::unnecessary_wraps, reason = "networks may fail")]
    fn says(picture: &[u8]) -> Result<(BallContact, Duration), Infallible> {
        let reading = BallContact { force_n: picture[0].into(), middle_mm: None };
        Ok((reading, Duration::from_millis(1)))
    }

    fn line(delays: Delays, pictures: &[f64]) -> Line {
        let mut line = Line::new(delays, 3);
        for (number, &now_us) in pictures.iter().enumerate() {
            let pushed = line.push(now_us, || Ok(vec![number as u8]), &mut says);
            pushed.expect("it never fails");
        }
        line
    }

    #[test]
    fn a_busy_network_takes_the_newest_picture_when_it_is_free() {
        let delays = Delays { slower: 2.5, stale_us: 300, ..Delays::default() };
        let mut line = line(delays, &[0.0, 1000.0, 2000.0, 3000.0]);
        line.advance(9000.0, &mut says).expect("it never fails");
        let found: Vec<_> = line
            .readings
            .iter()
            .map(|timed| (timed.reading.force_n, timed.taken_us, timed.ready_us))
            .collect();
        // Picture 1 is replaced by 2 at 2000, which begins at 2500; 3 waits until 5000.
        assert_eq!(found, [(0.0, 0.0, 2800.0), (2.0, 2000.0, 5300.0), (3.0, 3000.0, 7800.0)]);
        assert_eq!(line.newest(2799.0), None);
        assert_eq!(line.newest(5299.0).map(|timed| timed.taken_us), Some(0.0));
        assert_eq!(line.newest(1e9).map(|timed| timed.taken_us), Some(3000.0));
    }

    #[test]
    fn lost_pictures_are_about_their_share_and_a_network_never_sees_them() {
        let times: Vec<f64> = (0..1000).map(|i| 10_000.0 * f64::from(i)).collect();
        let half = line(Delays { lost: 0.5, ..Delays::default() }, &times);
        assert!((400..600).contains(&half.lost), "{}", half.lost);
        assert_eq!(half.readings.len() as u64 + half.lost, 1000);
        assert_eq!(line(Delays { lost: 1.0, ..Delays::default() }, &times).readings.len(), 0);
    }
}
