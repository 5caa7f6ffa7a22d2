//! Sessions over the embedded press and over little streams, and the bytes of their frames.

mod frame_networks;
mod frames;
mod servers;
mod sessions;
mod truths;

use std::cell::Cell;

use meissner_engine::{Event, Sensor};

use crate::subject::Subject;
use crate::{Input, Session, Shipped, Truth};

thread_local! {
    /// The clock of a test: it stands still unless the test moves it.
    static CLOCK_US: Cell<f64> = const { Cell::new(0.0) };
}

fn clock() -> f64 {
    CLOCK_US.get()
}

fn wait_us(us: f64) {
    CLOCK_US.set(CLOCK_US.get() + us);
}

/// The first press.
fn press() -> Input {
    let bytes = include_bytes!("../../run/assets/dome_press.evt3");
    let recording = meissner_io::decode(bytes).expect("a recording");
    let sensor = recording.sensor.expect("it names its sensor");
    let truth = Truth {
        names: ["depth_mm", "roll_rad"].map(str::to_owned).to_vec(),
        rows: vec![(0, vec![0.0, 0.1]), (100_000, vec![8.0, 0.1]), (300_000, vec![0.0, 0.2])],
    };
    Input { name: "press".to_owned(), sensor, events: recording.events, live: false, truth }
}

/// A line that moves along x, with some late events.
fn line(count: u16) -> Vec<Event> {
    let late = |i: u16| if i % 50 == 49 { 700 } else { 0 };
    (0..count).map(|i| Event::new(300 * i64::from(i) - late(i), i / 7 % 34, i * 11 % 34, i % 3 > 0)).collect()
}

fn digits(events: Vec<Event>, live: bool) -> Input {
    let (name, sensor) = ("line".to_owned(), Sensor::new(34, 34));
    Input { name, sensor, events, live, ..Input::default() }
}

fn session(input: Input, network: &str) -> Session {
    let mut session = Session::new(input, Box::new(Shipped), network, clock).expect("a session");
    session.command(r#"{"do": "pause"}"#).expect("a command");
    session
}

/// The frame after `command`, once the session has nothing left to do.
fn after<S: Subject>(session: &mut Session<S>, command: &str) -> Vec<u8> {
    session.command(command).expect("a command");
    let mut frame = session.step(f64::INFINITY).expect("a frame");
    while let Some(next) = session.step(f64::INFINITY) {
        frame = next;
    }
    frame
}
