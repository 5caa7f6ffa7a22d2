//! Recordings one after the other for ever.
//!
//! Enters: recordings, silences. Leaves: events, the stamps of a recording shifted by one number, so that it begins behind
//! the end of the one before. Invariant: within a recording, differences between stamps are those of the recording, silences
//! apart; at the end of time (292,000 years) stamps stay there.

use std::sync::Arc;

use meissner_engine::Event;

use meissner_models::random::Random;

/// Silences are below 2 to this power, in microseconds: some 9 minutes.
const LONGEST: u64 = 29;

/// A recording.
#[derive(Debug)]
pub(super) struct Tape {
    name: String,
    /// At least one, with times counted from the first.
    events: Vec<Event>,
}

impl Tape {
    /// `events`, which `name` tells where they are from; none where there are none.
    pub(super) fn new(name: String, mut events: Vec<Event>) -> Option<Self> {
        let begin = events.first()?.t_us;
        events.iter_mut().for_each(|event| event.t_us = event.t_us.saturating_sub(begin));
        Some(Self { name, events })
    }
}

/// Where the stream stands. A clone looks ahead.
#[derive(Clone, Debug)]
pub(super) struct Endless {
    tapes: Arc<[Tape]>,
    tape: usize,
    next: usize,
    shift_us: i64,
    newest_us: i64,
    /// Silence since the last event.
    silent_us: i64,
    rounds: u64,
    random: Random,
}

impl Endless {
    /// The stream over `tapes`, of which there is one at least, with silences between them from `random`.
    pub(super) fn new(tapes: Vec<Tape>, random: Random) -> Self {
        Self {
            tapes: tapes.into(),
            tape: 0,
            next: 0,
            shift_us: 0,
            newest_us: 0,
            silent_us: 0,
            rounds: 0,
            random,
        }
    }

    pub(super) fn names(&self) -> Vec<String> {
        self.tapes.iter().map(|tape| tape.name.clone()).collect()
    }

    /// How many recordings have begun after the first.
    pub(super) fn rounds(&self) -> u64 {
        self.rounds
    }

    /// Makes the next event later, by 1 us to some 9 minutes: all magnitudes are equally likely. The middle of the silence.
    pub(super) fn fall_silent(&mut self) -> i64 {
        let magnitude = 1 << self.random.below(LONGEST);
        let silence = (magnitude + self.random.below(magnitude)) as i64;
        self.shift_us = self.shift_us.saturating_add(silence);
        self.silent_us = self.silent_us.saturating_add(silence);
        self.newest_us.saturating_add(self.silent_us - silence / 2)
    }

    /// The next event.
    pub(super) fn next(&mut self) -> Event {
        if self.next == self.tapes[self.tape].events.len() {
            self.tape = (self.tape + 1) % self.tapes.len();
            self.next = 0;
            self.rounds += 1;
            self.shift_us = self.newest_us.saturating_add(self.silent_us);
            self.fall_silent();
        }
        let event = self.tapes[self.tape].events[self.next];
        self.next += 1;
        self.silent_us = 0;
        let t_us = event.t_us.saturating_add(self.shift_us);
        self.newest_us = self.newest_us.max(t_us);
        Event { t_us, ..event }
    }
}

#[cfg(test)]
mod tests {
    use super::{Endless, Tape};
    use meissner_engine::Event;
    use meissner_models::random::Random;

    fn tape(times: &[i64]) -> Tape {
        let events = times.iter().map(|&t| Event::new(t, 0, 0, true)).collect();
        Tape::new(String::new(), events).expect("there are events")
    }

    fn times(stream: &mut Endless, count: usize) -> Vec<i64> {
        (0..count).map(|_| stream.next().t_us).collect()
    }

    #[test]
    fn recordings_follow_one_another_round_and_round_behind_silences() {
        let mut stream = Endless::new(vec![tape(&[1_000, 1_010, 1_030]), tape(&[-5, 0])], Random::new(3));
        let t = times(&mut stream, 8);
        assert_eq!([t[0], t[1], t[2]], [0, 10, 30]);
        assert!(t[3] > t[2] && t[5] > t[4], "{t:?}");
        assert_eq!((t[4] - t[3], t[6] - t[5], t[7] - t[5]), (5, 10, 30));
        assert_eq!(stream.rounds(), 2);
    }

    #[test]
    fn a_silence_makes_what_follows_later_and_its_middle_is_in_it() {
        let mut stream = Endless::new(vec![tape(&[0, 10, 20])], Random::new(1));
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
        let mut stream = Endless::new(vec![tape(&[0, 50, 40])], Random::new(1));
        let t = times(&mut stream, 6);
        assert_eq!((t[4] - t[3], t[5] - t[3]), (50, 40));
        assert!(t[3] > t[1], "{t:?}");
    }

    #[test]
    fn a_recording_without_events_is_none() {
        assert!(Tape::new(String::new(), Vec::new()).is_none());
    }
}
