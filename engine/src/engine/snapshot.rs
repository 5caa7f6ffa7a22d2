//! An engine's state, in memory and as bytes.
//!
//! The bytes contain only the data that cannot be recomputed: clock, counters, the window's events
//! in order of arrival; with `frozen`, each event's rows and number of in-edges still in the
//! window; with a tolerance, every row. A restored engine runs its own structural stages over the
//! events, so its slots, edges, cells and maxima are consistent whatever the bytes contain.
//!
//! This is sufficient: a neighbourhood is a prefix of a total order, so the remaining in-edges of a
//! `frozen` node are a prefix over the window. Values follow from the window or are stored. With a
//! tolerance every row is computed again: a row with unchanged inputs gets its former values, which
//! are within the tolerance of the stored ones, so the stored values stay.

use std::borrow::Cow;
use std::sync::Arc;

use super::Engine;
use crate::admission::LatePolicy;
use crate::counters::{EventCounters, LayerCounters, PredictionCounters};
use crate::metric::Node;
use crate::restart::CONFIRMING;
use crate::snapshot::{Content, Kind, Reader, SnapshotOf, Stored, Writer, check_network, differs};
use crate::{EngineError, Event, Sensor};

/// Properties that a state depends on besides events: only an engine with equal properties restores
/// it.
struct Origin<'a> {
    fingerprint: u64,
    name: Cow<'a, str>,
    sensor: Sensor,
    tolerance: f32,
    late: u8,
}

impl Origin<'_> {
    fn read(from: &mut Reader<'_>) -> Result<Self, EngineError> {
        Ok(Self {
            fingerprint: from.u64("network")?,
            name: from.text("network's name")?.into(),
            sensor: Sensor::new(from.u16("sensor's columns")?, from.u16("sensor's rows")?),
            tolerance: f32::from_bits(from.u32("tolerance")?),
            late: from.u8("late policy")?,
        })
    }
}

/// Bytes per event.
const EVENT: usize = 13;
/// Bytes per pixel that a filter remembers.
const PIXEL: usize = 12;

impl Stored for Engine {
    const KIND: Kind = Kind::Events;

    fn to_bytes_with(&self, note: &[u8]) -> Vec<u8> {
        self.to_bytes_with(note)
    }
}

impl Engine {
    /// A copy of the current state, to return to.
    pub fn snapshot(&self) -> SnapshotOf<Self> {
        SnapshotOf(Content::Copy(Box::new(self.clone())))
    }

    /// Returns to the state of `snapshot`, counters included. Later predictions have the same bits.
    /// Options that do not affect results (all but tolerance and late policy) remain this engine's.
    ///
    /// # Errors
    /// [`EngineError::Snapshot`] for an unequal network ([`crate::Network::fingerprint`]), another
    /// sensor, tolerance or late policy, or held events that this engine's restart policy would not
    /// hold; for bytes, the errors of [`Self::restore_bytes`]. The state is then unchanged.
    pub fn restore(&mut self, snapshot: &SnapshotOf<Self>) -> Result<(), EngineError> {
        let other = match &snapshot.0 {
            Content::Copy(engine) => engine,
            Content::Bytes(bytes) => return self.restore_bytes(bytes),
        };
        self.check_origin(&other.origin())?;
        let mut watch = self.watch;
        if !watch.hold(other.held(), other.now_us()) {
            return Err(differs("restart policy", self.options.restart, other.options.restart));
        }
        let mut restored = Self::clone(other);
        restored.watch = watch;
        restored.step.run_as(&self.step);
        for (log, own) in restored.log.layers.iter_mut().zip(&self.log.layers) {
            log.rows = own.rows.clone().map(|mut own| {
                own.clear();
                log.rows.take().unwrap_or(own)
            });
        }
        *self = Self { network: Arc::clone(&self.network), options: self.options, ..restored };
        Ok(())
    }

    /// Encodes the state for [`Self::restore_bytes`]: 13 bytes per event; with `frozen` in-edges,
    /// one more byte and the event's rows; with a tolerance, every row. The first call computes
    /// [`crate::Network::fingerprint`].
    pub fn to_bytes(&self) -> Vec<u8> {
        self.to_bytes_with(&[])
    }

    /// The same with a note, which [`crate::snapshot_note`] returns and the checksum covers.
    pub fn to_bytes_with(&self, note: &[u8]) -> Vec<u8> {
        let mut to = Writer::new(Kind::Events);
        let Origin { fingerprint, name, sensor, tolerance, late } = self.origin();
        to.u64(fingerprint);
        to.text(&name);
        to.u16(sensor.width);
        to.u16(sensor.height);
        to.u32(tolerance.to_bits());
        to.u8(late);
        self.write_counters(&mut to);
        to.flag(self.newest_us.is_some());
        if let (Some(newest), Some(epoch)) = (self.newest_us, self.epoch_us()) {
            [epoch, self.admission.now(), newest - epoch].into_iter().for_each(|t| to.i64(t));
        }
        let window = &self.step.window;
        to.size(window.len());
        for Node { t, x, y, on } in window.slots().map(|slot| window.node(slot)) {
            write_event(&mut to, t, x, y, on);
        }
        if self.network.parts().graph.is_frozen() {
            // A node has at most 255 in-edges.
            window.slots().for_each(|slot| to.u8(self.step.graph.present(window, slot).count() as u8));
        }
        (0..self.network.levels()).for_each(|level| self.write_rows(level, &mut to));
        to.size(self.held().len());
        self.held().iter().for_each(|event| write_event(&mut to, event.t_us, event.x, event.y, event.on));
        self.write_filters(&mut to);
        to.finish(note)
    }

    /// Restores the state that [`Self::to_bytes`] wrote for an equal network, sensor, tolerance and
    /// late policy. Predictions have the bits as if that engine had continued; the next one
    /// computes, and counts, every row that is not stored. [`Self::feature`] returns rows from then
    /// on.
    ///
    /// Cost: that of pushing the window's events, and at most [`Self::state_bytes`] of memory once
    /// more.
    ///
    /// # Errors
    /// [`EngineError::Snapshot`] for another version, network, sensor, tolerance or policy;
    /// [`EngineError::SnapshotBytes`] for bytes that are truncated, changed or do not fit, or a
    /// stored row that is not finite. The state is then unchanged.
    pub fn restore_bytes(&mut self, bytes: &[u8]) -> Result<(), EngineError> {
        let mut from = Reader::open(bytes, Kind::Events)?;
        self.check_origin(&Origin::read(&mut from)?)?;
        let mut restored = Self::with_options(Arc::clone(&self.network), self.sensor, self.options)?;
        let events = restored.read_counters(&mut from)?;
        let now = restored.read_clock(&mut from, events)?;
        restored.read_window(&mut from, now)?;
        (0..self.network.levels()).try_for_each(|level| restored.read_rows(level, &mut from))?;
        restored.read_held(&mut from)?;
        restored.read_filters(&mut from)?;
        from.end()?;
        restored.step.stopwatch = self.step.stopwatch.clone();
        *self = restored;
        Ok(())
    }

    fn origin(&self) -> Origin<'_> {
        Origin {
            fingerprint: self.network.fingerprint(),
            name: self.network.name().into(),
            sensor: self.sensor,
            // Turns -0 into 0.
            tolerance: self.tolerance() + 0.0,
            late: code(self.options.late),
        }
    }

    fn check_origin(&self, found: &Origin<'_>) -> Result<(), EngineError> {
        let own = self.origin();
        check_network((own.fingerprint, &own.name), (found.fingerprint, &found.name))?;
        if found.sensor != own.sensor {
            return Err(differs("sensor", own.sensor, found.sensor));
        }
        if found.tolerance.to_bits() != own.tolerance.to_bits() {
            return Err(differs("tolerance", own.tolerance, found.tolerance));
        }
        if found.late != own.late {
            let name = |code| {
                [LatePolicy::Drop, LatePolicy::Clamp].get(usize::from(code)).map_or("unknown", |p| p.name())
            };
            return Err(differs("late policy", name(own.late), name(found.late)));
        }
        Ok(())
    }

    fn write_counters(&self, to: &mut Writer) {
        // Only a network with filters counts the events that they drop: `write_filters`.
        let [counts @ .., _] = self.admission.counters().to_array();
        to.counts(counts);
        to.size(self.log.layers.len());
        self.log.layers.iter().for_each(|log| to.counts(log.counters.to_array()));
        to.counts(self.log.predictions.to_array());
    }

    fn read_counters(&mut self, from: &mut Reader<'_>) -> Result<EventCounters, EngineError> {
        let mut counts = EventCounters::default().to_array();
        let [taken @ .., _] = &mut counts;
        *taken = from.counts("count of events")?;
        let events = EventCounters::from_array(counts);
        from.exactly("number of layers", self.log.layers.len())?;
        for (log, counted) in self.log.layers.iter_mut().zip(&mut self.recomputed) {
            log.counters = LayerCounters::from_array(from.counts("count of rows")?);
            *counted = log.counters.recomputed;
        }
        self.log.predictions = PredictionCounters::from_array(from.counts("count of predictions")?);
        Ok(events)
    }

    /// Reads the current time, relative to the epoch; `None` before the first event.
    fn read_clock(
        &mut self,
        from: &mut Reader<'_>,
        counters: EventCounters,
    ) -> Result<Option<i64>, EngineError> {
        *self.admission.counters_mut() = counters;
        let mut clock = None;
        if from.flag("whether there is a clock")? {
            let epoch = from.i64("epoch")?;
            let now = from.i64("newest time")?;
            if now < 0 || epoch.checked_add(now).is_none() {
                let expected = "a time from the epoch on that fits 64 bits";
                return Err(from.refuse("newest time", 8, expected, now));
            }
            let newest = from.i64("newest event")?;
            if !(0..=now).contains(&newest) {
                return Err(from.refuse("newest event", 8, format!("0 to {now}"), newest));
            }
            self.admission.resume(epoch, epoch + now);
            self.newest_us = Some(epoch + newest);
            clock = Some(now);
        }
        Ok(clock)
    }

    fn read_window(&mut self, from: &mut Reader<'_>, now: Option<i64>) -> Result<(), EngineError> {
        let parts = self.network.parts();
        let frozen = parts.graph.is_frozen();
        let most = if now.is_some() { parts.capacity } else { 0 };
        let count = from.length("number of events", most, EVENT + usize::from(frozen))?;
        let now = now.unwrap_or(0);
        let mut earliest = now.saturating_sub(parts.span_us).max(0);
        let mut nodes = Vec::with_capacity(count);
        for i in 0..count {
            let t = from.i64(format_args!("time of event {i}"))?;
            let newest = self.newest_us.zip(self.epoch_us()).map_or(0, |(newest, epoch)| newest - epoch);
            if !(earliest..=newest).contains(&t) || (i + 1 == count && t != newest) {
                let expected = format!("{earliest} to {newest}, the last at its end");
                return Err(from.refuse(format_args!("time of event {i}"), 8, expected, t));
            }
            earliest = t;
            let (x, y, on) = self.read_pixel(from, format_args!("event {i}"))?;
            nodes.push(Node { t, x, y, on });
        }
        for (i, node) in nodes.into_iter().enumerate() {
            if frozen {
                let known = from.u8(format_args!("in-edges of event {i}"))?;
                let found = self.step.enter_known(node, known.into());
                if found != usize::from(known) {
                    let expected = format!("at most {found}");
                    return Err(from.refuse(format_args!("in-edges of event {i}"), 1, expected, known));
                }
            } else {
                self.step.enter_known(node, usize::MAX);
            }
        }
        Ok(())
    }

    /// Reads the pixel and the polarity of the event called `what`.
    fn read_pixel(
        &self,
        from: &mut Reader<'_>,
        what: std::fmt::Arguments<'_>,
    ) -> Result<(u16, u16, bool), EngineError> {
        let (x, y) = self.read_place(from, what)?;
        Ok((x, y, from.flag(format_args!("polarity of {what}"))?))
    }

    /// Reads the pixel called `what`.
    fn read_place(
        &self,
        from: &mut Reader<'_>,
        what: std::fmt::Arguments<'_>,
    ) -> Result<(u16, u16), EngineError> {
        let x = from.u16(format_args!("column of {what}"))?;
        let y = from.u16(format_args!("row of {what}"))?;
        if !self.sensor.contains(x, y) {
            let expected = format!("a pixel of {}", self.sensor);
            return Err(from.refuse(what, 4, expected, format_args!("({x}, {y})")));
        }
        Ok((x, y))
    }

    fn read_held(&mut self, from: &mut Reader<'_>) -> Result<(), EngineError> {
        let most = if self.newest_us.is_some() { CONFIRMING - 1 } else { 0 };
        let count = from.length("number of held events", most, EVENT)?;
        let mut held = Vec::with_capacity(count);
        for i in 0..count {
            let t_us = from.i64(format_args!("time of held event {i}"))?;
            let (x, y, on) = self.read_pixel(from, format_args!("held event {i}"))?;
            held.push(Event { t_us, x, y, on });
        }
        let now_us = self.admission.now_us();
        if !self.watch.hold(&held, now_us) {
            let expected = "times that the clock does not agree with, of one run";
            return Err(from.refuse("held events", count * EVENT, expected, format_args!("{count} others")));
        }
        Ok(())
    }

    /// Writes the count of events that the network's filters dropped, and the filters' state;
    /// nothing if it has no filters.
    fn write_filters(&self, to: &mut Writer) {
        let filters = self.admission.filters();
        if filters.is_empty() {
            return;
        }
        to.u64(self.admission.counters().filtered);
        for pixels in filters.remembered(self.now_us().unwrap_or(i64::MIN)) {
            to.size(pixels.len());
            for (x, y, t_us) in pixels {
                to.i64(t_us);
                to.u16(x);
                to.u16(y);
            }
        }
    }

    fn read_filters(&mut self, from: &mut Reader<'_>) -> Result<(), EngineError> {
        if self.admission.filters().is_empty() {
            return Ok(());
        }
        [self.admission.counters_mut().filtered] = from.counts("count of filtered events")?;
        let pixels = usize::from(self.sensor.width) * usize::from(self.sensor.height);
        let mut remembered = Vec::with_capacity(self.network.filters().len());
        for filter in self.network.filters() {
            let count = from.length(format_args!("pixels of {filter:?}"), pixels, PIXEL)?;
            let mut times = Vec::with_capacity(count);
            for i in 0..count {
                let t_us = from.i64(format_args!("time of pixel {i} of {filter:?}"))?;
                let (x, y) = self.read_place(from, format_args!("pixel {i} of {filter:?}"))?;
                times.push((x, y, t_us));
            }
            remembered.push(times);
        }
        assert!(self.admission.filters_mut().remember(&remembered), "as many filters, pixels of the sensor");
        Ok(())
    }

    /// Whether a level's rows are stored because they depend on the past; whether some may be
    /// missing.
    fn stores_rows(&self, level: usize) -> (bool, bool) {
        let on_arrival = level == 0 && self.network.parts().graph.is_frozen();
        (on_arrival || self.tolerance() > 0.0, !on_arrival)
    }

    fn write_rows(&self, level: usize, to: &mut Writer) {
        let (true, some_wait) = self.stores_rows(level) else { return };
        let (rows, activations) = (self.step.rows(level), &self.step.activations[level]);
        to.size(rows.len());
        for feature in 1..self.network.channels(level).len() {
            for &row in &rows {
                let stored = activations.stored(feature, row);
                if some_wait {
                    to.flag(stored.is_some());
                }
                match stored {
                    Some(values) => to.values(values),
                    None if some_wait => {}
                    None => to.values(activations.feature(feature).slice(row as usize)),
                }
            }
        }
    }

    fn read_rows(&mut self, level: usize, from: &mut Reader<'_>) -> Result<(), EngineError> {
        let (true, some_wait) = self.stores_rows(level) else { return Ok(()) };
        let rows = self.step.rows(level);
        from.exactly(format_args!("number of rows of level {level}"), rows.len())?;
        let activations = &mut self.step.activations[level];
        for (b, block) in self.network.level(level).blocks.iter().enumerate() {
            for (i, &row) in rows.iter().enumerate() {
                let what = format_args!("row {i} of layer {:?}", block.name);
                if !some_wait || from.flag(what)? {
                    from.values(what, activations.stored_mut(b + 1, row))?;
                }
            }
        }
        Ok(())
    }
}

fn write_event(to: &mut Writer, t: i64, x: u16, y: u16, on: bool) {
    to.i64(t);
    to.u16(x);
    to.u16(y);
    to.flag(on);
}

fn code(late: LatePolicy) -> u8 {
    match late {
        LatePolicy::Drop => 0,
        LatePolicy::Clamp => 1,
    }
}
