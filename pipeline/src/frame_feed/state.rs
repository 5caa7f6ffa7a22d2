//! What a feed holds between two inputs: its clock, and the events that frames to come will show.
//!
//! Enters: a feed that was told to [keep](FrameFeed::keep) events. Leaves: a [`FeedState`], and a new feed that goes on from one:
//! over consecutive windows it begins with the open one, over a sliding window with the events of the span.

use std::collections::VecDeque;

use meissner_engine::representations::RepresentationError;
use meissner_engine::{Event, LatePolicy, Sensor};
use meissner_models::FrameDescription;
use serde::{Deserialize, Serialize};

use super::{FrameFeed, Frames};
use crate::schedule::Every;

/// What a feed holds between two inputs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct FeedState {
    /// Time of the first accepted event.
    pub epoch_us: i64,
    /// The newest time.
    pub now_us: i64,
    /// Accepted events so far.
    accepted: u64,
    /// When the open window begins, where windows are consecutive.
    open_us: Option<i64>,
    /// Time, column, row, polarity of the events of the open window or of the span.
    events: Vec<(i64, u16, u16, bool)>,
}

impl FeedState {
    /// What cannot be in a state that a feed on `sensor` has written: which part, what it should be, and what it is.
    pub fn fault(&self, sensor: Sensor) -> Option<(&'static str, String, String)> {
        let &Self { epoch_us, now_us, accepted, open_us, .. } = self;
        if now_us.checked_sub(epoch_us).is_none_or(|span_us| span_us < 0) {
            let expected = format!("from {epoch_us} to 2^63 behind it");
            return Some(("newest time in the note", expected, now_us.to_string()));
        }
        if let Some(open_us) = open_us.filter(|open_us| !(epoch_us..=now_us).contains(open_us)) {
            let expected = format!("from {epoch_us} to {now_us}");
            return Some(("open window in the note", expected, open_us.to_string()));
        }
        if accepted < self.events.len() as u64 {
            let expected = format!("at least {}, the events that are kept", self.events.len());
            return Some(("accepted events in the note", expected, accepted.to_string()));
        }
        let mut least_us = open_us.unwrap_or(epoch_us);
        for &(t_us, x, y, _) in &self.events {
            if !(least_us..=now_us).contains(&t_us) || !sensor.contains(x, y) {
                let expected = format!("from {least_us} to {now_us} us on {sensor}");
                return Some(("kept event in the note", expected, format!("{t_us} us at ({x}, {y})")));
            }
            least_us = t_us;
        }
        None
    }
}

/// Events that frames to come will show.
#[derive(Debug, Default)]
pub(super) struct KeptEvents {
    events: VecDeque<Event>,
}

impl KeptEvents {
    /// Notes an accepted event; before it, windows were completed or not.
    pub(super) fn note(&mut self, event: Event, completed: bool, span_us: Option<i64>) {
        if completed {
            self.events.clear();
        }
        self.events.push_back(event);
        let Some(span_us) = span_us else { return };
        let too_old = |first: &Event| event.t_us.saturating_sub(first.t_us) > span_us;
        while self.events.front().is_some_and(too_old) {
            self.events.pop_front();
        }
    }
}

impl FrameFeed {
    /// Keeps from now on what [`Self::state`] needs.
    pub fn keep(&mut self) {
        self.kept.get_or_insert_default();
    }

    /// What the feed holds; none before the first event, and where it was not told to keep it.
    pub fn state(&mut self) -> Option<FeedState> {
        let kept = self.kept.as_ref()?;
        let events = kept.events.iter().map(|e| (e.t_us, e.x, e.y, e.on)).collect();
        let open_us = match &mut self.frames {
            Frames::Counts { counts, .. } => counts.open().map(|frame| frame.start_us),
            Frames::Signed { windows, .. } => windows.open().map(|frame| frame.start_us),
            Frames::Sliding(_) => None,
        };
        Some(FeedState {
            epoch_us: self.gate.epoch_us()?,
            now_us: self.gate.now_us()?,
            accepted: self.before.saturating_add(self.gate.counters().accepted),
            open_us,
            events,
        })
    }

    /// As [`Self::new`], but going on from `state`.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn resume(
        description: &FrameDescription,
        sensor: Sensor,
        late: LatePolicy,
        every: Every,
        state: &FeedState,
    ) -> Result<Option<Self>, RepresentationError> {
        let Some(mut feed) = Self::beginning(description, sensor, late, every, state.open_us)? else {
            return Ok(None);
        };
        feed.keep();
        for &(t_us, x, y, on) in &state.events {
            let event = Event::new(t_us, x, y, on);
            match &mut feed.frames {
                Frames::Counts { counts, .. } => drop(counts.push(event, |_| {})),
                Frames::Signed { windows, .. } => drop(windows.push(event, |_| {})),
                Frames::Sliding(sliding) => drop(sliding.window.push(event)),
            }
            if let Some(kept) = &mut feed.kept {
                kept.events.push_back(event);
            }
        }
        if let Frames::Sliding(sliding) = &mut feed.frames {
            sliding.resume(state.epoch_us, state.now_us, state.accepted);
        }
        feed.gate.resume(state.epoch_us, state.now_us);
        feed.before = state.accepted;
        feed.shown_before = [feed.outside_crop(), feed.evicted()];
        Ok(Some(feed))
    }
}
