//! Streams of the suites: recordings where they exist, else a synthetic stream; the window.
//!
//! The folder with recordings is `MEISSNER_SHARED`, else `../shared` beside the project. An engine
//! accepts every event of these streams.

use meissner_engine::{Event, Sensor};
use meissner_kernels::random::Random;

#[path = "../../tests/shared_files.rs"]
mod shared_files;

pub use shared_files::find_shared as shared;

/// Span of the shipped networks' windows in microseconds.
pub const SPAN_US: i64 = 150_000;
/// Number of events of the window to which batch figures refer.
pub const WINDOW: usize = 7_006;

/// Events of one sensor.
#[derive(Clone, Debug)]
pub struct Recording {
    /// Name, for reports.
    pub name: String,
    /// The sensor.
    pub sensor: Sensor,
    /// Accepted events in order.
    pub events: Vec<Event>,
}

impl Recording {
    /// `data/events/NAME.aedat4` of the shared folder, if it exists.
    ///
    /// # Panics
    /// If it cannot be read, or names no geometry.
    pub fn load(name: &str) -> Option<Self> {
        let path = shared(&format!("data/events/{name}.aedat4"))?;
        let recording = meissner_io::read(&path).expect("a readable recording");
        let sensor = recording.sensor.expect("AEDAT4 names its geometry");
        let mut newest = i64::MIN;
        let in_order = |event: &Event| {
            let keep = event.t_us >= newest;
            newest = newest.max(event.t_us);
            keep
        };
        let events = recording.events.into_iter().filter(in_order).collect();
        Some(Self { name: name.to_owned(), sensor, events })
    }

    /// A grid of marker dots that sways under a skin: `events` events at about 47,000 a second.
    ///
    /// Dots switch pixels on at their front edge and off at their back edge; some events are noise.
    /// The same events on every machine.
    pub fn synthetic(events: usize) -> Self {
        const COLUMNS: u32 = 12;
        const ROWS: u32 = 9;
        const RADIUS: i32 = 7;
        let sensor = Sensor::new(346, 260);
        let mut random = Random::new(20);
        let mut out = Vec::with_capacity(events);
        let mut t_us = 0;
        for _ in 0..events {
            t_us += random.below(43) as i64;
            let event = if random.below(20) == 0 {
                let (x, y) = (random.below(346) as u16, random.below(260) as u16);
                Event::new(t_us, x, y, random.below(2) == 0)
            } else {
                let dot = random.below((COLUMNS * ROWS).into()) as u32;
                // A triangular sway of 12 pixels in 80 ms, in integers.
                let phase = (t_us % 80_000) as i32;
                let (shift, right) = if phase < 40_000 {
                    (phase * 12 / 40_000, true)
                } else {
                    ((80_000 - phase) * 12 / 40_000, false)
                };
                let front = random.below(2) == 0;
                let dy = random.below(2 * RADIUS as u64 + 1) as i32 - RADIUS;
                let half = RADIUS - dy.abs() / 2 + random.below(3) as i32 - 1;
                let dx = if front == right { half } else { -half };
                let x = 20 + 27 * (dot % COLUMNS) as i32 + shift + dx;
                let y = 18 + 27 * (dot / COLUMNS) as i32 + shift / 3 + dy;
                Event::new(t_us, x as u16, y as u16, front)
            };
            out.push(event);
        }
        Self { name: "synthetic dots".to_owned(), sensor, events: out }
    }

    /// `events` events of one pixel at one time, where each event changes the row of every other.
    pub fn one_pixel(events: usize) -> Self {
        let sensor = Sensor::new(346, 260);
        let events = (0..events).map(|i| Event::new(0, 173, 130, i % 2 == 0)).collect();
        Self { name: "one pixel at one time".to_owned(), sensor, events }
    }

    /// The first window that holds exactly `count` events within `span_us`, ends included.
    pub fn first_window(&self, count: usize, span_us: i64) -> Option<&[Event]> {
        let mut start = 0;
        for (end, event) in self.events.iter().enumerate() {
            while self.events[start].t_us < event.t_us - span_us {
                start += 1;
            }
            if end + 1 - start == count {
                return Some(&self.events[start..=end]);
            }
        }
        None
    }
}

/// The recordings that exist, else the synthetic stream; prints which on standard error.
pub fn recordings() -> Vec<Recording> {
    let found: Vec<Recording> =
        ["tactile_dots", "davis346"].into_iter().filter_map(Recording::load).collect();
    if found.is_empty() {
        eprintln!("no recordings at MEISSNER_SHARED or ../shared: a synthetic stream of moving dots instead");
        return vec![Recording::synthetic(20_000)];
    }
    let names: Vec<&str> = found.iter().map(|r| r.name.as_str()).collect();
    eprintln!("recordings: {}", names.join(", "));
    found
}

/// The window of 7,006 events, of `tactile_dots` if that exists; prints which.
///
/// # Panics
/// If the recording is another one and has no such window.
pub fn window() -> Recording {
    let recording = Recording::load("tactile_dots").unwrap_or_else(|| Recording::synthetic(2 * WINDOW));
    let events = recording.first_window(WINDOW, SPAN_US).expect("a window with 7,006 events").to_vec();
    eprintln!("window: {WINDOW} events of {}", recording.name);
    Recording { events, ..recording }
}
