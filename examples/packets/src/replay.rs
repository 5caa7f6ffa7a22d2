//! The single process that predictions are compared with.
//!
//! Input: all events of a stream, the gaps, and each prediction with the number of the event up to
//! which it covers the stream. Output: the first difference. After a restart of the predicting
//! process, its gaps go back to the last event of the restored state, and so does this engine.

use meissner_engine::{EngineError, Event, Predictor, Sensor};
use meissner_run::RunError;

use crate::coverage::Gap;
use crate::network::{AnyEngine, AnyNetwork};

/// An engine that gets only the accepted events of a stream.
pub struct Replay<'a> {
    network: &'a AnyNetwork,
    sensor: Sensor,
    events: &'a [Event],
    engine: AnyEngine,
    /// Number of the next event.
    next: u64,
    /// Gaps in order, without overlaps.
    gaps: Vec<Gap>,
}

impl<'a> Replay<'a> {
    /// `network` over the stream of these `events` of `sensor`.
    ///
    /// # Errors
    /// The network does not fit the sensor.
    pub fn new(network: &'a AnyNetwork, sensor: Sensor, events: &'a [Event]) -> Result<Self, RunError> {
        let engine = network.engine(sensor)?;
        Ok(Self { network, sensor, events, engine, next: 0, gaps: Vec::new() })
    }

    /// The gaps so far.
    pub fn gaps(&self) -> &[Gap] {
        &self.gaps
    }

    /// Takes a gap. A gap that begins before the known events comes from a restored process, which
    /// knows nothing after its restored state.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn lose(&mut self, gap: Gap) -> Result<(), RunError> {
        self.gaps.retain(|known| known.from < gap.from);
        if let Some(last) = self.gaps.last_mut() {
            last.until = last.until.min(gap.from);
        }
        if gap.from < self.next {
            self.engine = self.network.engine(self.sensor)?;
            self.next = 0;
            self.advance(gap.from)?;
        }
        self.gaps.push(gap);
        Ok(())
    }

    /// Compares a prediction that covers the events before number `next`, of which `accepted` were
    /// accepted, with the engine's prediction: values, time of the newest event, events in the
    /// window.
    ///
    /// # Errors
    /// The expected and the found value.
    pub fn compare(
        &mut self,
        (next, accepted): (u64, u64),
        (values, t_us, nodes): (&[f32], Option<i64>, u64),
    ) -> Result<(), String> {
        let most = self.events.len() as u64;
        if next < self.next || next > most {
            return Err(format!("expected a prediction up to event {} to {most}, got {next}", self.next));
        }
        self.advance(next).map_err(|error| error.to_string())?;
        let expected = next - self.lost_before(next);
        if accepted != expected {
            return Err(format!("up to event {next}: expected {expected} accepted events, got {accepted}"));
        }
        let own = self.engine.predict().map_err(|error| error.to_string())?;
        let is_equal = own.values.iter().map(|value| value.to_bits()).eq(values.iter().map(|v| v.to_bits()));
        if (true, t_us, nodes) != (is_equal, own.t_us, own.nodes as u64) {
            return Err(format!(
                "up to event {next}: expected {:?} of {} events at {:?}, got {values:?} of {nodes} at {t_us:?}",
                own.values, own.nodes, own.t_us
            ));
        }
        Ok(())
    }

    /// The number of accepted events among `sent`, if each is covered by a prediction or lost.
    ///
    /// # Errors
    /// The expected and the found value.
    pub fn end(&self, sent: u64) -> Result<u64, String> {
        let mut covered = self.next;
        for gap in &self.gaps {
            if gap.from > covered {
                return Err(format!("events {covered} to {} are neither predicted on nor dropped", gap.from));
            }
            covered = covered.max(gap.until);
        }
        if covered != sent || sent > self.events.len() as u64 {
            return Err(format!("expected {sent} events, of {}, got {covered}", self.events.len()));
        }
        Ok(sent - self.lost_before(sent))
    }

    /// Events that were lost before the event of this number.
    fn lost_before(&self, next: u64) -> u64 {
        let gaps = self.gaps.iter().filter(|gap| gap.from < next);
        gaps.map(|gap| gap.until.min(next) - gap.from).sum()
    }

    /// Gives the engine the accepted events before the event of this number.
    fn advance(&mut self, next: u64) -> Result<(), EngineError> {
        for number in self.next..next {
            let place = self.gaps.partition_point(|gap| gap.until <= number);
            if self.gaps.get(place).is_none_or(|gap| number < gap.from) {
                self.engine.push(&self.events[number as usize])?;
            }
        }
        self.next = self.next.max(next);
        Ok(())
    }
}
