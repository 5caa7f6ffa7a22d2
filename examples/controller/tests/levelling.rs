//! Plant, engine and law: in simulated time, and over UDP.

use std::collections::VecDeque;
use std::net::UdpSocket;
use std::path::Path;
use std::sync::atomic::AtomicBool;
use std::sync::{Arc, LazyLock};
use std::thread;
use std::time::Duration;

use meissner::live::{Live, QueueOptions};
use meissner::{Description, Engine, Event, Network, Weights, io};
use meissner_controller::{GAIN, feed, level, run};
use meissner_simulator::PressTable;
use meissner_simulator::plants::{
    COURSE, FINGERTIP_SENSOR, Fingertip, FingertipState, Phase, Surface, TAP_US, TICK_US, WristTarget,
    presses,
};

static TABLE: LazyLock<Arc<PressTable>> = LazyLock::new(presses);
static NETWORK: LazyLock<Arc<Network>> = LazyLock::new(|| {
    let description = Description::shipped("tactigraph-past").expect("a shipped network");
    let weights = Weights::shipped("tactigraph-past").expect("its weights");
    Arc::new(description.network(&weights).expect("they fit"))
});

fn engine() -> Engine {
    Engine::new(Arc::clone(&NETWORK), FINGERTIP_SENSOR).expect("room for its state")
}

/// A processor in simulated time: an engine that takes so many events in a millisecond, behind a
/// queue for so many, from which the oldest make room. It works like `Live`, without clocks and
/// threads.
struct Processor {
    engine: Engine,
    queue: VecDeque<Event>,
    rate: usize,
    capacity: usize,
    dropped: usize,
}

impl Processor {
    fn tick(&mut self, now_us: i64, events: &[Event]) {
        self.queue.extend(events);
        for event in self.queue.drain(..self.queue.len().min(self.rate)) {
            self.engine.push(event);
        }
        let over = self.queue.len().saturating_sub(self.capacity);
        self.queue.drain(..over);
        self.dropped += over;
        if self.queue.is_empty() {
            self.engine.advance(now_us);
        }
    }
}

/// The angle at the contact of each tap in degrees, the greatest number of events that waited in a
/// hold, and the number of those that were dropped.
#[derive(Debug)]
struct Levelled {
    at_contact: Vec<f64>,
    waiting: usize,
    dropped: usize,
}

impl Levelled {
    /// Mean over the contacts that the law controls: all except the first, and the first after each
    /// jump.
    fn mean(&self) -> f64 {
        let jumps = COURSE.map(|(tap, _)| tap as usize);
        let taps = self.at_contact.iter().enumerate().filter(|(tap, _)| !jumps[..3].contains(tap));
        let (sum, count) = taps.fold((0.0, 0.0), |(sum, count), (_, angle)| (sum + angle, count + 1.0));
        sum / count
    }
}

/// Settings of the processor: its rate and the room of its queue.
const EXACT: [usize; 2] = [usize::MAX, usize::MAX];
/// A press brings three times as many events in a millisecond, and a tap on average a little less.
const STALE: [usize; 2] = [50, usize::MAX];
const DROPS: [usize; 2] = [50, 256];

fn levelled(plane: Surface, seed: u64, [rate, capacity]: [usize; 2], taps: i64) -> Levelled {
    let mut tip = Fingertip::new(Arc::clone(&TABLE), plane, seed).expect("settings in range");
    let mut processor = Processor { engine: engine(), queue: VecDeque::new(), rate, capacity, dropped: 0 };
    let (mut at_contact, mut waiting, mut events) = (Vec::new(), 0, Vec::new());
    for tick in 0..taps * TAP_US / TICK_US {
        if tick * TICK_US % TAP_US == 0 {
            at_contact.push(tip.error().to_degrees());
        }
        tip.tick();
        events.clear();
        tip.take(&mut events).expect("images in order");
        let state = tip.state();
        processor.tick(state.t_us, &events);
        if state.phase == Phase::Hold {
            let predicted = processor.engine.predict().expect("finite values");
            tip.aim(level(&state, predicted.values).expect("a hold"));
            waiting = waiting.max(processor.queue.len());
        }
    }
    Levelled { at_contact, waiting, dropped: processor.dropped }
}

#[test]
fn the_dome_is_brought_upright_from_any_side() {
    for (roll_deg, pitch_deg) in [(5.0, 3.0), (-4.0, 4.0), (0.0, -7.0)] {
        let plane = Surface::Fixed([roll_deg, pitch_deg].map(f64::to_radians));
        let run = levelled(plane, 7, EXACT, 4);
        let [first, .., last] = run.at_contact[..] else { panic!("four taps") };
        assert!((first - f64::hypot(roll_deg, pitch_deg)).abs() < 1e-9);
        assert!(last < 0.9, "{:?}", run.at_contact);
        assert_eq!((run.waiting, run.dropped), (0, 0));
    }
}

#[test]
fn events_that_wait_or_are_dropped_make_levelling_worse() {
    // The figures of the README. A few taps on one plane are not enough: there, exact and stale
    // predictions have about the same error, and the order changes with the weights and the plane.
    let [exact, stale, drops] = thread::scope(|scope| {
        let runs =
            [EXACT, STALE, DROPS].map(|case| scope.spawn(move || levelled(Surface::Course, 1, case, 24)));
        runs.map(|run| run.join().expect("it levels"))
    });
    assert!(stale.waiting > 5_000 && stale.dropped == 0, "{} {}", stale.waiting, stale.dropped);
    assert!(drops.waiting <= DROPS[1] && drops.dropped > 10_000, "{} {}", drops.waiting, drops.dropped);
    assert!(exact.mean() < stale.mean() && stale.mean() < drops.mean(), "{exact:?} {stale:?} {drops:?}");
}

#[test]
fn the_target_moves_in_holds_only_and_not_with_the_number_of_cycles() {
    let mut state = FingertipState { phase: Phase::Press, wrist: [0.1, -0.1], ..FingertipState::default() };
    assert_eq!(level(&state, &[0.5, 0.5]), None);
    state.phase = Phase::Hold;
    for _ in 0..3 {
        assert_eq!(level(&state, &[0.5, 0.25]), Some([0.1 + GAIN * 0.5, -0.1 + GAIN * 0.25]));
    }
    assert_eq!(level(&state, &[0.5]), None);
    state.phase = Phase::Lift;
    assert_eq!(level(&state, &[0.0, 0.0]), None);
}

#[test]
fn a_fingertip_gets_targets_by_the_law_and_the_end_of_the_events_ends_the_loop() {
    let press = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../run/assets/dome_press.evt3");
    let events = &io::read(&press).expect("it is part of the repository").events[..4000];
    let [sensor, robot, fingertip] = [(); 3].map(|()| UdpSocket::bind("127.0.0.1:0").expect("a free port"));
    let address = |socket: &UdpSocket| socket.local_addr().expect("it is bound");
    robot.connect(address(&fingertip)).expect("an address");
    fingertip.connect(address(&robot)).expect("an address");
    fingertip.set_read_timeout(Some(Duration::from_mins(1))).expect("a time");
    let mut alone = engine();
    alone.push_slice(events);
    let predicted = alone.predict().expect("finite values").values.to_vec();

    let (mut input, mut live) = Live::spawn(engine(), QueueOptions::new()).expect("a thread");
    let (ended, rhythm) = (AtomicBool::new(false), [5, 4].map(Duration::from_millis));
    let timing = thread::scope(|scope| {
        scope.spawn(|| feed(&sensor, &mut input, &ended).expect("the socket is there"));
        let controller = scope.spawn(|| run(&mut live, &robot, &ended, rhythm, u64::MAX).expect("it runs"));
        for part in events.chunks(80) {
            let bytes: Vec<u8> = part.iter().flat_map(|&event| io::record(event)).collect();
            send(&sensor, &bytes);
        }
        let state = FingertipState { phase: Phase::Hold, wrist: [0.1, -0.2], ..FingertipState::default() };
        let wanted = level(&state, &predicted).expect("a hold");
        let mut bytes = [0; WristTarget::BYTES];
        for _ in 0..2000 {
            fingertip.send(&state.bytes()).expect("the loop listens");
            fingertip.recv(&mut bytes).expect("a target in each cycle");
            if WristTarget::read(&bytes).expect("a target").angles == wanted {
                break;
            }
        }
        assert_eq!(WristTarget::read(&bytes).expect("a target").angles, wanted);
        send(&sensor, &[]);
        controller.join().expect("it does not panic")
    });
    assert!(timing.cycles > 0);
    assert_eq!((live.counters().delivered, live.counters().dropped()), (4000, 0));
}

fn send(to: &UdpSocket, bytes: &[u8]) {
    let from = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    from.send_to(bytes, to.local_addr().expect("it is bound")).expect("it is there");
}
