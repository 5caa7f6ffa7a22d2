//! Disturbances of an engine between events, at random distances.
//!
//! Enters: a seed. Leaves: disturbances. Invariant: a shuffled deck of eight is dealt to its end before it is shuffled again,
//! so that each kind comes once or twice in eight.

use meissner_kernels::random::Random;

/// A disturbance between two events.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Disturbance {
    /// Nothing happens for a while.
    Silence,
    /// A silence, and time is moved on to its middle.
    Advance,
    /// The state is written as bytes, and a new engine goes on from them.
    Bytes,
    /// A snapshot is taken in memory, events follow that are to be forgotten, and the engine returns to the snapshot.
    Snapshot {
        /// Events between snapshot and return.
        detour: u64,
    },
    /// All events are forgotten.
    Reset,
}

/// Upper bound of the events between a snapshot and the return to it.
const DETOUR: u64 = 3_000;

/// An endless sequence of disturbances.
#[derive(Debug)]
pub(super) struct Deck {
    random: Random,
    mean: u64,
    /// Events until the next one.
    left: u64,
    cards: [Disturbance; 8],
    dealt: usize,
}

impl Deck {
    /// Random disturbances, on average one every `mean` events.
    pub(super) fn new(mut random: Random, mean: u64) -> Self {
        use Disturbance::{Advance, Bytes, Reset, Silence, Snapshot};
        let snapshot = Snapshot { detour: 0 };
        let cards = [Silence, Silence, Advance, Bytes, Bytes, snapshot, snapshot, Reset];
        let left = distance(&mut random, mean);
        Self { random, mean, left, dealt: cards.len(), cards }
    }

    /// Counts an event. Returns the disturbance that is due before it.
    pub(super) fn after_an_event(&mut self) -> Option<Disturbance> {
        if self.left > 0 {
            self.left -= 1;
            return None;
        }
        self.left = distance(&mut self.random, self.mean);
        if self.dealt == self.cards.len() {
            self.dealt = 0;
            // Fisher and Yates.
            for i in (1..self.cards.len()).rev() {
                self.cards.swap(i, self.random.below(i as u64 + 1) as usize);
            }
        }
        self.dealt += 1;
        Some(match self.cards[self.dealt - 1] {
            Disturbance::Snapshot { .. } => Disturbance::Snapshot { detour: 1 + self.random.below(DETOUR) },
            card => card,
        })
    }
}

/// Number of events without a disturbance: uniform, `mean` - 1 on average.
fn distance(random: &mut Random, mean: u64) -> u64 {
    random.below(2 * mean - 1)
}

#[cfg(test)]
mod tests {
    use super::{Deck, Disturbance};
    use meissner_kernels::random::Random;

    fn disturbances(seed: u64, events: u64) -> Vec<(u64, Disturbance)> {
        let mut deck = Deck::new(Random::new(seed), 100);
        (0..events)
            .filter_map(|event| deck.after_an_event().map(|disturbance| (event, disturbance)))
            .collect()
    }

    #[test]
    fn they_come_as_often_as_asked_for_and_are_determined_by_the_seed() {
        let all = disturbances(7, 100_000);
        assert!((900..1_100).contains(&all.len()), "{}", all.len());
        assert_eq!(all, disturbances(7, 100_000));
        assert_ne!(all, disturbances(8, 100_000));
    }

    #[test]
    fn each_deck_holds_each_kind() {
        for deck in disturbances(1, 100_000).chunks_exact(8) {
            let count = |is: fn(&Disturbance) -> bool| deck.iter().filter(|(_, card)| is(card)).count();
            assert_eq!(count(|card| matches!(card, Disturbance::Silence)), 2);
            assert_eq!(count(|card| matches!(card, Disturbance::Advance)), 1);
            assert_eq!(count(|card| matches!(card, Disturbance::Bytes)), 2);
            assert_eq!(count(|card| matches!(card, Disturbance::Snapshot { detour: 1.. })), 2);
            assert_eq!(count(|card| matches!(card, Disturbance::Reset)), 1);
        }
    }

    #[test]
    fn one_at_every_event_is_possible() {
        let mut deck = Deck::new(Random::new(1), 1);
        assert!((0..100).all(|_| deck.after_an_event().is_some()));
    }
}
