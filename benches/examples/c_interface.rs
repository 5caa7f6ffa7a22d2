//! The cost of the C interface: the same events in blocks, each with a prediction, through Rust and
//! through C in turns. `cargo run --release -p meissner-benches --example c_interface -- [BLOCK
//! [RECORDING]]`.
//!
//! With a block of 4,096 and a recording, the Rust side of `bindings/python/benches/overhead.py`.
#![allow(unsafe_code, reason = "the interface takes raw pointers")]

use std::hint::black_box;
use std::ptr::{null, null_mut};
use std::time::Instant;

use ::meissner_engine::{Engine, Event, Sensor};
use meissner_benches::timing::median;
use meissner_c::{
    meissner_engine, meissner_engine_new, meissner_engine_predict, meissner_engine_push_events,
    meissner_engine_release, meissner_event, meissner_network_open, meissner_network_release,
    meissner_prediction, meissner_status,
};
use meissner_models::{Description, Weights};
use meissner_verify::Random;

const SENSOR: Sensor = Sensor { width: 240, height: 180 };
const EVENTS: i64 = 1_000_000;
const BLOCK: usize = 256;
/// Events between turns.
const TURN: usize = 24_576;

type Push =
    unsafe extern "C" fn(*const meissner_engine, *const meissner_event, usize, *mut usize) -> meissner_status;
type Predict = unsafe extern "C" fn(
    *const meissner_engine,
    *mut f32,
    usize,
    *mut meissner_prediction,
) -> meissner_status;

fn main() {
    let mut arguments = std::env::args().skip(1);
    let length = arguments.next().map_or(BLOCK, |text| text.parse().expect("events of a block"));
    let events = arguments
        .next()
        .map_or_else(events, |path| meissner_io::read(path.as_ref()).expect("a recording").events);
    let description = Description::shipped("tactigraph-past").expect("a shipped network");
    let network = description.network(&Weights::shipped("tactigraph-past").expect("its weights"));
    let mut rust = Engine::new(network.expect("they fit"), SENSOR).expect("an engine");
    let c = engine();
    let of_c: Vec<meissner_event> = events
        .iter()
        .map(|e| meissner_event { t_us: e.t_us, x: e.x, y: e.y, polarity: i8::from(e.on) })
        .collect();

    // Called through a pointer, as C does, so that nothing of it is inlined here.
    let push = black_box(meissner_engine_push_events as Push);
    let predict = black_box(meissner_engine_predict as Predict);
    let (mut ratios, mut of_rust) = (Vec::new(), Vec::new());
    for (turn, (rust_events, c_events)) in events.chunks(TURN).zip(of_c.chunks(TURN)).enumerate() {
        let mut sums = [0_u32; 2];
        let mut seconds = [0.0; 2];
        for side in [turn % 2, 1 - turn % 2] {
            let start = Instant::now();
            if side == 0 {
                for block in rust_events.chunks(length) {
                    rust.push_slice(block);
                    let values = rust.predict().expect("numbers").values;
                    sums[0] = values.iter().fold(sums[0], |sum, value| sum.rotate_left(1) ^ value.to_bits());
                }
            } else {
                for block in c_events.chunks(length) {
                    let mut values = [0.0_f32; 2];
                    // SAFETY: the handle is valid, and every pointer for the length beside it.
                    unsafe {
                        assert_eq!(
                            push(c, block.as_ptr(), block.len(), null_mut()),
                            meissner_status::MEISSNER_OK
                        );
                        assert_eq!(
                            predict(c, values.as_mut_ptr(), 2, null_mut()),
                            meissner_status::MEISSNER_OK
                        );
                    }
                    sums[1] = values.iter().fold(sums[1], |sum, value| sum.rotate_left(1) ^ value.to_bits());
                }
            }
            seconds[side] = start.elapsed().as_secs_f64();
        }
        assert_eq!(sums[0], sums[1], "the same bits");
        of_rust.push(seconds[0] * 1e9 / rust_events.len() as f64);
        ratios.push(seconds[1] / seconds[0]);
    }
    println!(
        "{} events in blocks of {length}: {:.0} ns an event through Rust; through C {:.3} times as long (medians of {} turns)",
        events.len(),
        median(of_rust),
        median(ratios),
        events.len().div_ceil(TURN),
    );
    // SAFETY: the handle is not used again.
    unsafe { meissner_engine_release(c) };
}

/// An engine of the C interface.
fn engine() -> *mut meissner_engine {
    let (mut network, mut engine) = (null_mut(), null_mut());
    // SAFETY: every pointer is valid.
    unsafe {
        let opened = meissner_network_open(c"tactigraph-past".as_ptr(), null(), null(), &raw mut network);
        assert_eq!(opened, meissner_status::MEISSNER_OK);
        let made = meissner_engine_new(network, SENSOR.width, SENSOR.height, null(), &raw mut engine);
        assert_eq!(made, meissner_status::MEISSNER_OK);
        meissner_network_release(network);
    }
    engine
}

/// A blob that moves over the sensor, with noise: 20,000 events in the window.
fn events() -> Vec<Event> {
    let mut random = Random::new(5);
    let event = |i: i64| {
        let spread = if random.below(10) == 0 { 170 } else { 40 };
        let mut pixel = |centre: u64, extent: u64| ((centre + random.below(spread)) % extent) as u16;
        Event::new(i * 8, pixel(i as u64 / 4_000, 240), pixel(20 + i as u64 / 9_000, 180), i % 3 == 0)
    };
    (0..EVENTS).map(event).collect()
}
