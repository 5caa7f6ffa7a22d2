//! Recordings in an endless loop.
//!
//! Enters: recordings. Leaves: events. All stamps of a recording are shifted by one number, so that it begins after the end of
//! the recording before it. Invariant: within a recording, the differences between stamps are those of the recording, except
//! for inserted silences. Stamps saturate at the largest i64 (after 292,000 years).

use std::sync::Arc;

use meissner_engine::Event;
use meissner_kernels::random::Random;

use crate::error::VerifyError;

/// Silences are below 2 to this power, in microseconds: some 9 minutes.
const MAX: u64 = 29;

/// A recording with at least one event.
#[derive(Debug)]
pub struct Recording {
    name: String,
    /// Times count from the first event.
    events: Vec<Event>,
}

impl Recording {
    /// The recording called `name`.
    ///
    /// # Errors
    /// [`VerifyError::Empty`] without events.
    pub fn new(name: String, mut events: Vec<Event>) -> Result<Self, VerifyError> {
        let Some(begin) = events.first().map(|event| event.t_us) else {
            return Err(VerifyError::Empty(name));
        };
        events.iter_mut().for_each(|event| event.t_us = event.t_us.saturating_sub(begin));
        Ok(Self { name, events })
    }
}

/// The stream, at an event. A clone looks ahead.
#[derive(Clone, Debug)]
pub(super) struct Endless {
    recordings: Arc<[Recording]>,
    recording: usize,
    next: usize,
    shift_us: i64,
    newest_us: i64,
    /// Silence since the last event.
    silent_us: i64,
    rounds: u64,
    random: Random,
}

impl Endless {
    /// The stream over `recordings`, at least one, with random silences between them.
    pub(super) fn new(recordings: Vec<Recording>, random: Random) -> Self {
        Self {
            recordings: recordings.into(),
            recording: 0,
            next: 0,
            shift_us: 0,
            newest_us: 0,
            silent_us: 0,
            rounds: 0,
            random,
        }
    }

    pub(super) fn names(&self) -> Vec<String> {
        self.recordings.iter().map(|recording| recording.name.clone()).collect()
    }

    /// Number of recordings that have begun after the first.
    pub(super) fn rounds(&self) -> u64 {
        self.rounds
    }

    /// Delays the next event by 1 us to some 9 minutes; all magnitudes are equally likely. Returns the middle of the silence.
    pub(super) fn fall_silent(&mut self) -> i64 {
        let magnitude = 1 << self.random.below(MAX);
        let silence = (magnitude + self.random.below(magnitude)) as i64;
        self.shift_us = self.shift_us.saturating_add(silence);
        self.silent_us = self.silent_us.saturating_add(silence);
        self.newest_us.saturating_add(self.silent_us - silence / 2)
    }

    /// The next event.
    pub(super) fn next(&mut self) -> Event {
        if self.next == self.recordings[self.recording].events.len() {
            self.recording = (self.recording + 1) % self.recordings.len();
            self.next = 0;
            self.rounds += 1;
            self.shift_us = self.newest_us.saturating_add(self.silent_us);
            self.fall_silent();
        }
        let event = self.recordings[self.recording].events[self.next];
        self.next += 1;
        self.silent_us = 0;
        let t_us = event.t_us.saturating_add(self.shift_us);
        self.newest_us = self.newest_us.max(t_us);
        Event { t_us, ..event }
    }
}

#[cfg(test)]
mod tests {
    use super::{Endless, Recording};
    use crate::error::VerifyError;
    use meissner_engine::Event;
    use meissner_kernels::random::Random;

    fn recording(times: &[i64]) -> Recording {
        let events = times.iter().map(|&t| Event::new(t, 0, 0, true)).collect();
        Recording::new(String::new(), events).expect("there are events")
    }

    fn times(stream: &mut Endless, count: usize) -> Vec<i64> {
        (0..count).map(|_| stream.next().t_us).collect()
    }

    #[test]
    fn recordings_follow_one_another_in_a_loop_with_silences_between_them() {
        let mut stream =
            Endless::new(vec![recording(&[1_000, 1_010, 1_030]), recording(&[-5, 0])], Random::new(3));
        let t = times(&mut stream, 8);
        assert_eq!([t[0], t[1], t[2]], [0, 10, 30]);
        assert!(t[3] > t[2] && t[5] > t[4], "{t:?}");
        assert_eq!((t[4] - t[3], t[6] - t[5], t[7] - t[5]), (5, 10, 30));
        assert_eq!(stream.rounds(), 2);
    }

    #[test]
    fn a_silence_makes_what_follows_later_and_its_middle_is_in_it() {
        let mut stream = Endless::new(vec![recording(&[0, 10, 20])], Random::new(1));
        for _ in 0..1_000 {
            let before = stream.next().t_us;
            let middle = stream.fall_silent();
            let after = stream.clone().next().t_us;
            assert!(before <= middle && middle <= after, "{before} {middle} {after}");
            assert!(after - before < (1 << 30) + 20, "{before} {after}");
        }
    }

    #[test]
    fn a_stamp_that_steps_back_does_so_in_every_round() {
        let mut stream = Endless::new(vec![recording(&[0, 50, 40])], Random::new(1));
        let t = times(&mut stream, 6);
        assert_eq!((t[4] - t[3], t[5] - t[3]), (50, 40));
        assert!(t[3] > t[1], "{t:?}");
    }

    #[test]
    fn a_recording_without_events_is_refused() {
        assert!(
            matches!(Recording::new("empty".to_owned(), Vec::new()), Err(VerifyError::Empty(name)) if name == "empty")
        );
    }
}
