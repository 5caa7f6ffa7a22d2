//! Filters one behind the other.

use super::{BackgroundActivity, EventFilter, FilterCounters, RateLimit, Refractory, Stride};
use crate::Event;

/// A filter of any kind.
#[derive(Clone, Debug)]
pub enum Filter {
    /// Every nth event.
    Stride(Stride),
    /// What a rate allows.
    RateLimit(RateLimit),
    /// What has a recent neighbour.
    BackgroundActivity(BackgroundActivity),
    /// At most one event of a pixel in a time.
    Refractory(Refractory),
}

impl Filter {
    fn get(&self) -> &dyn EventFilter {
        match self {
            Self::Stride(filter) => filter,
            Self::RateLimit(filter) => filter,
            Self::BackgroundActivity(filter) => filter,
            Self::Refractory(filter) => filter,
        }
    }

    fn get_mut(&mut self) -> &mut dyn EventFilter {
        match self {
            Self::Stride(filter) => filter,
            Self::RateLimit(filter) => filter,
            Self::BackgroundActivity(filter) => filter,
            Self::Refractory(filter) => filter,
        }
    }
}

impl EventFilter for Filter {
    fn admit(&mut self, event: Event) -> bool {
        self.get_mut().admit(event)
    }

    fn reset(&mut self) {
        self.get_mut().reset();
    }

    fn counters(&self) -> FilterCounters {
        self.get().counters()
    }

    fn name(&self) -> &'static str {
        self.get().name()
    }
}

/// Filters one behind the other: each sees what those before it let pass. Without any, everything passes.
#[derive(Clone, Debug, Default)]
pub struct Chain {
    filters: Vec<Filter>,
    counters: FilterCounters,
}

impl Chain {
    /// `filters`, the first of which sees every event.
    pub fn new(filters: Vec<Filter>) -> Self {
        Self { filters, counters: FilterCounters::default() }
    }

    /// The filters, in order.
    pub fn filters(&self) -> &[Filter] {
        &self.filters
    }
}

impl EventFilter for Chain {
    fn admit(&mut self, event: Event) -> bool {
        let passes = self.filters.iter_mut().all(|filter| filter.admit(event));
        self.counters.count(passes)
    }

    fn reset(&mut self) {
        self.filters.iter_mut().for_each(Filter::reset);
    }

    fn counters(&self) -> FilterCounters {
        self.counters
    }

    fn name(&self) -> &'static str {
        "chain"
    }
}
