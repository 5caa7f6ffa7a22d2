//! A network over events or other items, with a cursor in time that a page moves.
//!
//! Input: commands, live items, and calls of [`Session::step`]. Output: frames. Invariant: after a
//! step, the engine is as if it had taken only the items before the cursor. A prediction was read
//! before and after the newest item, so a frame shows as recomputed only what one item changed.

mod compare;
mod history;
mod shown;

use meissner_engine::{Event, Sensor};

use crate::clock::Clock;
use crate::command::Command;
use crate::error::ViewError;
use crate::events::EventGraph;
use crate::latency::Latency;
use crate::networks::{Chosen, Networks};
use crate::series::Series;
use crate::subject::{Item, Subject};
use crate::truth::Truth;
use compare::Comparison;
use history::History;

/// Slowest and fastest speed.
const SPEEDS: [f64; 2] = [1e-6, 1e6];

/// The input of a session: by default, events of a sensor.
#[derive(Clone, Debug)]
pub struct Input<P = Sensor, I = Event> {
    /// Name, for people.
    pub name: String,
    /// The sensor.
    pub sensor: P,
    /// The events, or other items, so far.
    pub events: Vec<I>,
    /// Whether more items will come ([`Session::push`]).
    pub live: bool,
    /// The truth, if known.
    pub truth: Truth,
}

impl Default for Input {
    fn default() -> Self {
        let sensor = Sensor::new(1, 1);
        Self { name: String::new(), sensor, events: Vec::new(), live: false, truth: Truth::default() }
    }
}

/// The reason of the cursor's motion.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Course {
    /// To the due position, while the session plays.
    Due,
    /// To a requested position.
    Asked,
}

/// A network over items, by default events, with a cursor.
pub struct Session<S: Subject = EventGraph> {
    name: String,
    sensor: S::Sensor,
    live: bool,
    truth: Truth,
    networks: Box<dyn Networks<S::Network> + Send>,
    clock: Clock,
    network: String,
    chosen: Chosen<S::Network>,
    subject: S,
    history: History<S::Item>,
    latency: Latency,
    series: Series,
    comparison: Comparison,
    /// The target of the cursor; the engine may need several steps to reach it.
    target: usize,
    course: Course,
    playing: bool,
    speed: f64,
    /// Time of the clock and stream time at which playing began or was last delayed.
    anchor: (f64, f64),
    /// The newest prediction, and the time of the push and prediction of its event.
    prediction: Vec<f32>,
    unlike: Option<f32>,
    took_us: Option<f64>,
    error: Option<String>,
    /// Whether anything has changed since the last frame.
    changed: bool,
    facts: u64,
    queue: Option<(u64, u64)>,
}

impl<S: Subject> Session<S> {
    /// A session before the first item of `input`, playing, with the network called `network`.
    ///
    /// # Errors
    /// The network cannot be loaded, or the engine refuses it.
    pub fn new(
        input: Input<S::Sensor, S::Item>,
        networks: Box<dyn Networks<S::Network> + Send>,
        network: &str,
        clock: Clock,
    ) -> Result<Self, ViewError> {
        let Input { name, sensor, events, live, truth } = input;
        let chosen = networks.load(network)?;
        let mut subject = S::new(&chosen, &sensor)?;
        if let Some(first) = events.first() {
            subject.learn(first);
        }
        let history = History::new(events);
        let length_us = (!live).then(|| history.end_us());
        Ok(Self {
            latency: Latency::default(),
            series: Series::new(length_us),
            comparison: Comparison::default(),
            network: network.to_owned(),
            target: 0,
            course: Course::Due,
            playing: true,
            speed: if live { 1.0 } else { S::Item::SPEED },
            anchor: (clock(), 0.0),
            prediction: Vec::new(),
            unlike: None,
            took_us: None,
            error: None,
            changed: true,
            facts: 0,
            queue: None,
            name,
            sensor,
            live,
            truth,
            networks,
            clock,
            chosen,
            subject,
            history,
        })
    }

    /// Adds live items to the end of the history. If the history is very long, the oldest half is
    /// forgotten: the cursor cannot go back there.
    pub fn push(&mut self, items: Vec<S::Item>) {
        if items.is_empty() {
            return;
        }
        if self.history.is_new() {
            self.subject.learn(&items[0]);
        }
        let most = items[0].kept();
        self.history.extend(items);
        if self.history.len() > most {
            let forgotten = self.history.forget(most / 2);
            self.target = self.target.saturating_sub(forgotten);
            if self.history.cursor == 0 {
                self.restart();
            }
        }
        self.changed = true;
    }

    /// Sets the number of events that wait in front of the session, and of events that were lost
    /// there.
    pub fn set_queue(&mut self, waiting: u64, lost: u64) {
        self.changed |= self.queue != Some((waiting, lost));
        self.queue = Some((waiting, lost));
    }

    /// Carries out a [`Command`] in JSON.
    ///
    /// # Errors
    /// It is not a command, or it cannot be carried out. Nothing changes then.
    pub fn command(&mut self, text: &str) -> Result<(), ViewError> {
        let command = serde_json::from_str(text).map_err(ViewError::from);
        let done = command.and_then(|command| self.perform(command));
        self.error = done.as_ref().err().map(ToString::to_string);
        self.changed = true;
        done
    }

    fn perform(&mut self, command: Command) -> Result<(), ViewError> {
        match command {
            Command::Play => {
                if self.history.cursor == self.history.len() && !self.live {
                    self.go_to(0);
                }
                self.playing = true;
                self.set_anchor();
            }
            Command::Pause => {
                self.playing = false;
                if self.course == Course::Due {
                    self.target = self.history.cursor;
                }
            }
            Command::Seek { t_us } => {
                let t_us = finite("seek", t_us)?;
                self.go_to(self.history.until_us(t_us));
            }
            Command::SeekEvent { event } => {
                let event = finite("seek_event", event)?;
                self.go_to(event.max(0.0) as usize);
            }
            Command::Step { events } => {
                let events = finite("step", events)?;
                self.playing = false;
                self.go_to((self.history.cursor as f64 + events).max(0.0) as usize);
            }
            Command::Speed { times } => {
                let times = finite("speed", times)?;
                if !(SPEEDS[0]..=SPEEDS[1]).contains(&times) {
                    let expected = "a factor from 1e-6 to 1e6";
                    return Err(ViewError::Value { command: "speed", expected, found: times });
                }
                self.speed = times;
                self.set_anchor();
            }
            Command::Network { name } => self.choose(&name)?,
            Command::Compare { on } => self.comparison.switch(on),
            Command::Show | Command::Select { .. } => {}
        }
        Ok(())
    }

    fn choose(&mut self, name: &str) -> Result<(), ViewError> {
        let chosen = self.networks.load(name)?;
        let mut subject = S::new(&chosen, &self.sensor)?;
        subject.inherit(&self.subject);
        self.subject = subject;
        (self.chosen, self.network) = (chosen, name.to_owned());
        self.latency = Latency::default();
        self.series.clear();
        self.history.forget_states();
        self.comparison.forget();
        self.prediction.clear();
        self.facts += 1;
        let cursor = std::mem::take(&mut self.history.cursor);
        self.go_to(cursor);
        Ok(())
    }

    /// Starts again, without items.
    fn restart(&mut self) {
        // The engine was already made with the same arguments.
        if let Err(error) = self.subject.begin() {
            self.error = Some(error.to_string());
        }
        self.history.cursor = 0;
        self.prediction.clear();
        self.took_us = None;
    }

    /// Moves the cursor to just after `event` items; the next steps carry it out.
    fn go_to(&mut self, event: usize) {
        self.target = event.min(self.history.len());
        // A prediction is read before the newest item, so this item is taken again.
        let before = self.target.saturating_sub(1);
        let returns = self.target <= self.history.cursor;
        if let Some(first) = self.subject.depends_from(self.history.first(before)) {
            if returns || first > self.history.cursor {
                self.restart();
                self.history.cursor = first;
            }
        } else if returns || self.history.has_state_between(self.history.cursor, before) {
            self.restore(before);
        }
        self.course = if self.history.cursor == self.target { Course::Due } else { Course::Asked };
        self.set_anchor();
    }

    /// Returns to the last known state at or before `event`.
    fn restore(&mut self, event: usize) {
        let Some((cursor, bytes)) = self.history.state_before(event) else { return self.restart() };
        // The engine computes again, so that the next item shows only its own changes.
        match self.subject.restore(bytes) {
            Ok(()) => self.history.cursor = cursor,
            Err(_) => self.restart(),
        }
    }

    fn set_anchor(&mut self) {
        self.anchor = ((self.clock)(), self.history.time_of(self.target));
    }

    /// Goes on for at most about `budget_us` of the clock, and returns a frame if there is anything
    /// new to show.
    pub fn step(&mut self, budget_us: f64) -> Option<Vec<u8>> {
        self.go_on(budget_us).then(|| self.show())
    }

    /// As [`Self::step`], without a frame: returns whether there is anything new to
    /// [show](Self::show).
    pub fn go_on(&mut self, budget_us: f64) -> bool {
        let deadline = (self.clock)() + budget_us;
        if self.playing && self.course == Course::Due {
            self.follow();
        }
        if self.history.cursor < self.target {
            self.advance(deadline, budget_us);
            self.changed = true;
        }
        if self.playing && !self.live && self.history.cursor == self.history.len() {
            self.playing = false;
            self.changed = true;
        }
        let arrived = self.history.cursor == self.target;
        if arrived && self.course == Course::Asked {
            self.course = Course::Due;
            self.set_anchor();
        }
        if arrived && self.comparison.is_due(self.history.cursor, self.playing, self.clock) {
            let taken = self.history.taken();
            let is_known = self.history.forgotten == 0 || self.subject.depends_from(taken).is_some();
            let items = is_known.then_some(taken);
            self.comparison.compare(&self.subject, self.history.cursor, items, self.clock);
            self.changed = true;
        }
        self.changed
    }

    /// A frame of this moment.
    pub fn show(&mut self) -> Vec<u8> {
        self.changed = false;
        self.frame()
    }

    /// Sets the target to the position that is due now.
    fn follow(&mut self) {
        if self.live {
            self.target = self.history.len();
            return;
        }
        let (began, from_us) = self.anchor;
        let due_us = from_us + ((self.clock)() - began) * self.speed;
        self.target = self.target.max(self.history.until_us(due_us));
    }

    /// Takes items up to the target while there is time: one by one if that is fast enough, else
    /// in slices with a prediction after each.
    fn advance(&mut self, deadline: f64, budget_us: f64) {
        let waiting = self.target - self.history.cursor;
        let cost_us = self.latency.mean_us().unwrap_or(1.0);
        let slice = ((waiting as f64 * cost_us / budget_us.max(1.0)).ceil() as usize).clamp(1, 4096);
        while self.history.cursor + 1 < self.target {
            let end = (self.history.cursor + slice).min(self.target - 1);
            self.take(end);
            if (self.clock)() >= deadline {
                break;
            }
        }
        // The newest event on its own, so that its changes are visible.
        self.take(self.history.cursor + 1);
        if self.history.cursor < self.target && self.course == Course::Due && !self.live {
            // Too slow for this speed: the input waits, and no event is left out.
            self.anchor = ((self.clock)(), self.history.time_of(self.history.cursor));
            self.target = self.history.cursor;
        }
    }

    /// Takes the items up to `end` and reads a prediction.
    fn take(&mut self, end: usize) {
        let items = self.history.slice(end);
        let (one, start) = (items.len() == 1, (self.clock)());
        let predicted = self.subject.take(items);
        let took_us = (self.clock)() - start;
        let t_us = self.history.time_of(end) as i64;
        let is_read = matches!(predicted, Ok(Some(_)));
        match predicted {
            Ok(predicted) => {
                if let Some(predicted) = predicted {
                    self.unlike = predicted.unlike;
                    self.prediction.clear();
                    self.prediction.extend_from_slice(predicted.values);
                    self.series.add(t_us, &self.prediction);
                }
                self.error = None;
            }
            Err(error) => self.error = Some(error.to_string()),
        }
        self.took_us = (one && is_read).then_some(took_us);
        if one && is_read {
            self.latency.record(took_us);
        }
        self.history.cursor = end;
        if self.history.wants_state()
            && let Some(state) = self.subject.state()
        {
            self.history.keep_state(state);
        }
    }
}

fn finite(command: &'static str, value: f64) -> Result<f64, ViewError> {
    if value.is_finite() {
        return Ok(value);
    }
    Err(ViewError::Value { command, expected: "a finite number", found: value })
}
