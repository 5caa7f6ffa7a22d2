//! Grasps of a bolt: forces, hysteresis, phases, and the camera's events.

use std::sync::OnceLock;

use meissner_simulator::gel::Load;
use meissner_simulator::grasp::{
    BOLTS_MM, DURATION_US, Grasp, Grip, MAX_FORCE_N, PAD, Phase, PressedPad, SENSOR, STEP_US,
};
use meissner_simulator::{CameraSettings, Cause, SimulatedEvent};

type Recording = (Vec<SimulatedEvent>, Vec<Grip>);

/// Six recordings of a seed, filmed once for all tests.
fn recordings() -> &'static [(Grasp, Recording)] {
    static FILMED: OnceLock<Vec<(Grasp, Recording)>> = OnceLock::new();
    FILMED.get_or_init(|| {
        let mut solver = Grasp::solver().expect("a pad");
        let film = |number| {
            let grasp = Grasp::drawn(11, number);
            let recording = grasp.film(&mut solver, CameraSettings::tactile()).expect("a recording");
            (grasp, recording)
        };
        (0..6).map(film).collect()
    })
}

fn filmed(grasp: &Grasp) -> Recording {
    let mut solver = Grasp::solver().expect("a pad");
    grasp.film(&mut solver, CameraSettings::ideal()).expect("a recording")
}

#[test]
fn the_force_is_that_of_the_solved_contact_at_every_depth_of_the_table_and_between() {
    let mut solver = Grasp::solver().expect("a pad");
    for number in 0..3 {
        let grasp = Grasp::drawn(5, number);
        let pad = PressedPad::new(&mut solver, &grasp.bolt, (0.0, 1.0), 3.0).expect("contacts");
        let heights = grasp.bolt.heights(&PAD);
        for i in 1..=20 {
            let depth_mm = pad.deepest_mm() * f64::from(i) / 20.0;
            let solved = solver.press(&heights, Load::Depth(depth_mm)).expect("a contact").force_n;
            let found = pad.elastic_n(depth_mm);
            assert!(
                (found - solved).abs() < 0.02 * solved + 0.01,
                "bolt {number}, {depth_mm} mm: {found}, {solved}"
            );
        }
    }
}

#[test]
fn grasping_ends_with_the_force_that_was_asked_for_and_no_force_is_beyond_the_range() {
    for (number, (grasp, (_, grips))) in recordings().iter().enumerate() {
        assert!(grips.iter().all(|grip| (0.0..=MAX_FORCE_N).contains(&grip.force_n)), "recording {number}");
        let end = grips.iter().rfind(|grip| grip.phase == Phase::Grasping).expect("it is grasped");
        assert!((end.force_n - grasp.force_n).abs() < 0.05, "{number}: {}, {}", end.force_n, grasp.force_n);
        let (first, last) = (grips[0], grips[grips.len() - 1]);
        assert_eq!([first.force_n, first.depth_mm, first.area_mm2, last.force_n], [0.0; 4]);
        assert_eq!((first.t_us, last.t_us), (0, DURATION_US));
    }
}

#[test]
fn phases_follow_each_other_and_the_force_is_almost_constant_while_it_is_held() {
    for (number, (_, (_, grips))) in recordings().iter().enumerate() {
        assert!(grips.windows(2).all(|pair| pair[0].phase as usize <= pair[1].phase as usize));
        for phase in Phase::ALL {
            assert!(grips.iter().filter(|grip| grip.phase == phase).count() >= 20, "{}", phase.name());
        }
        let held = || grips.iter().filter(|grip| grip.phase == Phase::Holding).map(|grip| grip.force_n);
        let (least, most) = (held().fold(f64::MAX, f64::min), held().fold(0.0, f64::max));
        assert!(most < 1.35 * least, "recording {number}: {least} to {most}");
    }
}

#[test]
fn at_equal_depth_the_force_is_smaller_when_the_bolt_leaves() {
    for (number, (_, (_, grips))) in recordings().iter().enumerate() {
        let deepest = grips.iter().map(|grip| grip.depth_mm).fold(0.0, f64::max);
        let at = |phase: Phase, share: f64| {
            let of = grips.iter().filter(|grip| grip.phase == phase && grip.depth_mm > 0.0);
            of.min_by(|a, b| {
                let away = |grip: &Grip| (grip.depth_mm - share * deepest).abs();
                away(a).total_cmp(&away(b))
            })
            .expect("the depth was reached")
        };
        for share in [0.3, 0.5, 0.7] {
            let (pressed, released) = (at(Phase::Grasping, share), at(Phase::Releasing, share));
            // The two depths are not quite equal: compare the stiffness.
            let stiffness = |grip: &Grip| grip.force_n / grip.depth_mm;
            assert!(stiffness(released) < 0.98 * stiffness(pressed), "{number}: {pressed:?}, {released:?}");
        }
    }
}

#[test]
fn the_edge_of_a_growing_contact_becomes_darker_and_that_of_a_shrinking_one_brighter() {
    let mut grasp = Grasp::drawn(3, 1);
    // Only the contact moves: the bolt begins and ends at the pad, and does not slip.
    grasp.away_mm = [0.0; 2];
    grasp.settles_mm = [0.0; 2];
    grasp.look.reflection = 0.0;
    grasp.look.wet = 0.4;
    grasp.vibration.depth = 0.0;
    grasp.vibration.place_mm = [0.0; 2];
    let (events, grips) = filmed(&grasp);
    let mut solver = Grasp::solver().expect("a pad");
    let mut pad = PressedPad::new(&mut solver, &grasp.bolt, (0.0, 1.0), grasp.force_n).expect("contacts");
    pad.press_to(grips.iter().map(|grip| grip.depth_mm).fold(0.0, f64::max), 0.0);
    // Beside the contact, the bolt comes nearer and so becomes brighter.
    let touched = |e: &&SimulatedEvent| {
        let cell = |pixel: u16| ((f64::from(pixel) - 57.0) * 0.16 / PAD.pitch_mm + 23.5).round() as usize;
        pad.pressure_mpa()[cell(e.event.y) * PAD.width + cell(e.event.x)] > 0.01
    };
    let phase = |t_us: i64| grips[(t_us / STEP_US) as usize].phase;
    let on_of = |wanted: Phase| {
        let of = events.iter().filter(touched).filter(|e| phase(e.event.t_us) == wanted);
        let of: Vec<bool> = of.map(|e| e.event.on).collect();
        (of.len(), of.iter().filter(|&&on| on).count() as f64 / of.len() as f64)
    };
    let (grasping, releasing) = (on_of(Phase::Grasping), on_of(Phase::Releasing));
    assert!(grasping.0 > 1_000 && grasping.1 < 0.05, "{grasping:?}");
    assert!(releasing.0 > 1_000 && releasing.1 > 0.95, "{releasing:?}");
}

#[test]
fn equal_seeds_give_equal_recordings_whatever_was_solved_before() {
    let mut shared = Grasp::solver().expect("a pad");
    let film = |number: usize, solver: &mut _| {
        Grasp::drawn(7, number).film(solver, CameraSettings::default()).expect("a recording")
    };
    let first: Vec<_> = (0..2).map(|number| film(number, &mut shared)).collect();
    for number in [1, 0] {
        assert_eq!(film(number, &mut Grasp::solver().expect("a pad")), first[number]);
    }
    assert_ne!(first[0].0, film(3, &mut shared).0);
    assert_ne!(Grasp::drawn(7, 0), Grasp::drawn(8, 0));
}

#[test]
fn recordings_have_bolts_in_turn_and_events_in_order_within_their_frames() {
    for (number, (grasp, (events, _))) in recordings().iter().enumerate() {
        assert_eq!(grasp.bolt_mm(), BOLTS_MM[number % 3]);
        assert!(events.windows(2).all(|pair| pair[0].event.t_us <= pair[1].event.t_us));
        let inside = |e: &SimulatedEvent| {
            SENSOR.contains(e.event.x, e.event.y) && (0..DURATION_US).contains(&e.event.t_us)
        };
        assert!(events.iter().all(inside));
        let signal = events.iter().filter(|e| e.cause == Cause::Signal).count();
        assert!((2_000..80_000).contains(&signal), "recording {number}: {signal} events");
    }
}
