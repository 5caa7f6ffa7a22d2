//! Watches an engine that another thread runs at its own pace.
//!
//! Input: that engine, after any event. Output: a frame, if a page waits for one and the last
//! frame is old enough. Invariant: while no page waits, an event costs one load; the engine is only
//! read.

use meissner_engine::{Engine, Sensor};

use crate::facts::{Facts, Info};
use crate::frame::{FrameWriter, LIVE, PLAYING};
use crate::latency::Latency;
use crate::networks::Chosen;
use crate::pace::Pace;
use crate::scene;
use crate::series::Series;
use crate::server::Server;

/// While a page waits, the clock is read once in so many events, because a read takes tens of
/// nanoseconds.
const EVENTS: u32 = 64;

/// Shows an engine that another part of the program runs on a page.
#[derive(Debug)]
pub struct Bystander {
    server: Server,
    outputs: usize,
    series: Series,
    pace: Pace,
    /// Events since the clock was read, while a page waits.
    events: u32,
}

impl Bystander {
    /// Shows engines with the network `chosen`, called `name`, over `input`, on `server`'s page.
    pub fn new(server: Server, input: &str, sensor: Sensor, name: &str, chosen: &Chosen) -> Self {
        let mut to = FrameWriter::new();
        to.json(*b"FACT", &Facts::of(input, sensor, name, chosen));
        server.hub().set_facts(to.finish());
        let outputs = chosen.network.outputs();
        Self { server, outputs, series: Series::new(None), pace: Pace::default(), events: 0 }
    }

    /// Looks at `engine` if a page waits. The page shows the computed rows only with
    /// [`Options::record_rows`](meissner_engine::Options::record_rows).
    #[inline]
    pub fn look(&mut self, engine: &Engine) {
        if self.server.hub().wants_frame() {
            self.events += 1;
            if self.events >= EVENTS {
                self.events = 0;
                self.look_closer(engine);
            }
        }
    }

    #[cold]
    fn look_closer(&mut self, engine: &Engine) {
        if self.pace.is_due() {
            self.show(engine);
            self.pace.done();
        }
    }

    fn show(&mut self, engine: &Engine) {
        // Commands are discarded: a page does not control this engine.
        while self.server.hub().command().is_some() {}
        let counters = engine.counters();
        let epoch_us = engine.epoch_us().unwrap_or(0);
        let now_us = engine.now_us().map_or(0, |now_us| now_us - epoch_us);
        let values = engine.last_prediction();
        self.series.add(now_us, values);
        let mut to = FrameWriter::new();
        to.section(*b"TIME", |to| {
            let taken = counters.events.pushed as f64;
            [now_us as f64, now_us as f64, taken, taken].into_iter().for_each(|value| to.f64(value));
            to.f32(1.0);
            to.u32(PLAYING | LIVE);
        });
        scene::write(engine, &mut to);
        to.section(*b"PRED", |to| {
            to.count(self.outputs);
            to.count(engine.nodes());
            to.f32(engine.unlikeness().unwrap_or(f32::NAN));
            to.f32(f32::NAN);
            (0..self.outputs).for_each(|i| to.f32(values.get(i).copied().unwrap_or(f32::NAN)));
            (0..self.outputs).for_each(|_| to.f32(f32::NAN));
        });
        to.section(*b"SERS", |to| self.series.write(self.outputs, to));
        to.section(*b"LATE", |to| Latency::default().write(to));
        to.section(*b"WORK", |to| scene::work(&counters, to));
        to.json(*b"INFO", &Info::of(&counters.events));
        self.server.hub().publish(to.finish());
    }
}
