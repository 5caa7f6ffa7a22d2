//! When an engine is compared with full recomputation, and what came of it.

use crate::clock::Clock;
use crate::facts::Compared;
use crate::subject::Subject;

/// While playing, comparisons take at most this share of the time.
const SHARE: f64 = 0.25;
/// Why there is no comparison of a very long live input.
const FORGOTTEN: &str = "its first events are forgotten, on which full recomputation depends";

/// Comparisons with full recomputation, while they are wanted.
#[derive(Debug, Default)]
pub(super) struct Comparison {
    on: bool,
    pub(super) newest: Option<Compared>,
    /// Time of the clock before which the next one does not begin while playing.
    next: f64,
}

impl Comparison {
    pub(super) fn is_on(&self) -> bool {
        self.on
    }

    pub(super) fn switch(&mut self, on: bool) {
        *self = Self { on, ..Self::default() };
    }

    /// Forgets what was compared.
    pub(super) fn forget(&mut self) {
        self.newest = None;
    }

    pub(super) fn is_due(&self, cursor: usize, playing: bool, clock: Clock) -> bool {
        let is_new = self.newest.as_ref().is_none_or(|newest| newest.event != cursor as u64);
        self.on && cursor > 0 && is_new && (!playing || clock() >= self.next)
    }

    /// Compares `subject` after `cursor` items, whose prediction has been read. `None`: some of
    /// them are not known any more.
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
