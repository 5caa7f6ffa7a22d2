//! Plants of closed loops: a fingertip on a wrist, a ball on a gel.

use std::sync::Arc;

use meissner_engine::Event;
use meissner_simulator::gel::GelSensor;
use meissner_simulator::plants::{
    BallOnGel, DEPTH_MM, Fingertip, FingertipState, Phase, Surface, TAP_US, TICK_US, Wrist, WristTarget,
    ball_depth_mm, depth_mm, presses,
};

#[test]
fn the_depth_of_a_tap_has_no_jump_and_phases_come_in_order() {
    let depths: Vec<f64> = (0..=2 * TAP_US).step_by(100).map(depth_mm).collect();
    assert!(depths.windows(2).all(|pair| (pair[1] - pair[0]).abs() < 0.02));
    assert!(depths.contains(&DEPTH_MM));
    let mut phases: Vec<Phase> = (0..TAP_US).step_by(1000).map(|t_us| Phase::at(t_us).0).collect();
    phases.dedup();
    assert_eq!(phases, [Phase::Approach, Phase::Press, Phase::Hold, Phase::Lift, Phase::Free]);
    assert!((0..5).all(|i| Phase::of(i).map(|phase| phase as u32) == Some(i)) && Phase::of(5).is_none());
}

#[test]
fn the_course_of_a_surface_jumps_and_then_turns_slowly() {
    let degrees = |tap| Surface::Course.at(tap).map(|angle| (angle.to_degrees() * 1e6).round() / 1e6);
    assert_eq!(
        [5, 6, 11, 12, 18, 24, 99].map(degrees),
        [[4.0, -3.0], [-1.5, 2.5], [-1.5, 2.5], [2.0, 5.0], [-1.0, 2.5], [-4.0, 0.0], [-4.0, 0.0]]
    );
}

#[test]
fn datagrams_are_read_as_they_were_written_and_others_are_refused() {
    let target = WristTarget { cycle: 7, angles: [0.25, -0.5] };
    assert_eq!(WristTarget::read(&target.bytes()), Some(target));
    let state = FingertipState { t_us: -3, depth_mm: 1.5, wrist: [0.125, 2.0], phase: Phase::Lift, tap: 9 };
    assert_eq!(FingertipState::read(&state.bytes()), Some(state));
    let mut bytes = state.bytes();
    bytes[32] = 5;
    let refused =
        (FingertipState::read(&bytes), FingertipState::read(&bytes[1..]), WristTarget::read(&bytes));
    assert_eq!(refused, (None, None, None));
}

#[test]
fn filming_ahead_gives_the_same_events() {
    let table = presses();
    let [mut ahead, mut late] = [0, 0].map(|_| {
        Fingertip::new(Arc::clone(&table), Surface::Fixed([0.05, 0.02]), 3).expect("settings in range")
    });
    let [mut first, mut second]: [Vec<Event>; 2] = Default::default();
    for tick in 0..TAP_US / TICK_US {
        let seen = first.len();
        while ahead.film_ahead().expect("images in order") {}
        for (tip, events) in [(&mut ahead, &mut first), (&mut late, &mut second)] {
            tip.aim([0.05, 0.02]);
            tip.tick();
            tip.take(events).expect("images in order");
        }
        assert_eq!(first[seen..], second[seen..], "{tick}");
    }
    assert!(first.len() > 10_000 && first.is_sorted_by_key(|event| event.t_us));
    // The wrist arrived in the air, and no event is later than the state.
    assert!(ahead.error() < 1e-3 && ahead.state().phase == Phase::Approach);
}

#[test]
fn a_ball_stays_on_the_sensor_and_within_its_depth() {
    let (mut plant, at_rest) = BallOnGel::new(&GelSensor::default(), 5.0, [64, 48], 1).unwrap();
    assert_eq!(at_rest.len(), 64 * 48 * 3);
    assert_eq!(plant.truth().force_n, 0.0);
    let moved = plant.move_by([-5.0, 0.0, 0.0]).unwrap();
    // 60 % of a gel of 4 mm.
    assert!((moved[0] + 2.4).abs() < 1e-12 && plant.truth().middle_mm.is_none());
    assert_eq!(plant.picture().unwrap().len(), at_rest.len());
    let moved = plant.move_by([1e9, 1e9, -1e9]).unwrap();
    assert!((moved[0] - 4.8).abs() < 1e-12 && (moved[1] - 5.76).abs() < 1e-9 && moved[2] < -4.0, "{moved:?}");
    assert!(plant.truth().force_n > 1.6);
    let deep = plant.truth().force_n;
    plant.move_by([-0.4, -5.76, 0.0]).unwrap();
    assert!(plant.truth().force_n < deep);
}

#[test]
fn a_coarse_grid_is_fine_enough_for_a_ball() {
    let sensor = GelSensor::default();
    for force_n in [0.4, 1.6] {
        // Pictures with twice as many pixels a side are solved on a grid twice as fine.
        let [coarse, fine] =
            [[320, 240], [640, 480]].map(|size| ball_depth_mm(&sensor, 5.0, size, force_n).unwrap());
        assert!((coarse / fine - 1.0).abs() < 0.02, "{force_n} N: {coarse} mm, {fine} mm");
    }
}

#[test]
fn a_wrist_turns_no_faster_than_its_limit_and_arrives() {
    let mut wrist = Wrist::default();
    wrist.aim([0.14, f64::NAN]);
    let mut before = 0.0;
    for _ in 0..130 {
        wrist.turn(0.001);
        let [roll, pitch] = wrist.angles();
        assert!(roll - before <= 0.002 + 1e-12 && pitch == 0.0);
        before = roll;
    }
    assert!((before - 0.14).abs() < 0.002, "{before}");
    wrist.aim([9.0, -9.0]);
    (0..1000).for_each(|_| wrist.turn(0.001));
    assert!((wrist.angles()[0] - 0.35).abs() < 1e-6 && (wrist.angles()[1] + 0.35).abs() < 1e-6);
}
