//! Times and results of comparisons of an engine with full recomputation.

use crate::clock::Clock;
use crate::facts::Compared;
use crate::subject::Subject;

/// While playing, comparisons take at most this share of the time.
const SHARE: f64 = 0.25;
/// The reason why there is no comparison for a very long live input.
const FORGOTTEN: &str = "its first events are forgotten, on which full recomputation depends";

/// Comparisons with full recomputation, while requested.
#[derive(Debug, Default)]
pub(super) struct Comparison {
    on: bool,
    pub(super) newest: Option<Compared>,
    /// Earliest time of the clock for the next comparison while playing.
    next: f64,
}

impl Comparison {
    pub(super) fn is_on(&self) -> bool {
        self.on
    }

    pub(super) fn switch(&mut self, on: bool) {
        *self = Self { on, ..Self::default() };
    }

    /// Forgets the comparison.
    pub(super) fn forget(&mut self) {
        self.newest = None;
    }

    pub(super) fn is_due(&self, cursor: usize, playing: bool, clock: Clock) -> bool {
        let is_new = self.newest.as_ref().is_none_or(|newest| newest.event != cursor as u64);
        self.on && cursor > 0 && is_new && (!playing || clock() >= self.next)
    }

    /// Compares `subject` after `cursor` items, whose prediction has been read. `None`: some of
    /// these items are forgotten.
    pub(super) fn compare<S: Subject>(
        &mut self,
        subject: &S,
        cursor: usize,
        items: Option<&[S::Item]>,
        clock: Clock,
    ) {
        let start = clock();
        let compared = items.ok_or_else(|| FORGOTTEN.to_owned());
        let compared = compared.and_then(|items| subject.compare(items).map_err(|error| error.to_string()));
        let batch_us = clock() - start;
        self.next = clock() + batch_us * (1.0 / SHARE - 1.0);
        let (layers, error) = match compared {
            Ok(layers) => (layers, None),
            Err(error) => (Vec::new(), Some(error)),
        };
        self.newest = Some(Compared { event: cursor as u64, batch_us, layers, error });
    }
}
