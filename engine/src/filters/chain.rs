//! Filters in series.

use super::{BackgroundActivity, EventFilter, FilterCounters, RateLimit, Refractory, Stride, reports};
use crate::Event;

/// A filter of any kind.
#[derive(Clone, Debug)]
pub enum Filter {
    /// Every nth event.
    Stride(Stride),
    /// As many events as a rate allows.
    RateLimit(RateLimit),
    /// Events with a recent neighbour.
    BackgroundActivity(BackgroundActivity),
    /// At most one event of a pixel in a time.
    Refractory(Refractory),
}

/// Evaluates an expression for the filter inside a [`Filter`].
macro_rules! inner {
    ($any:ident, $filter:ident => $value:expr) => {
        match $any {
            Filter::Stride($filter) => $value,
            Filter::RateLimit($filter) => $value,
            Filter::BackgroundActivity($filter) => $value,
            Filter::Refractory($filter) => $value,
        }
    };
}

impl EventFilter for Filter {
    fn admit(&mut self, event: Event) -> bool {
        inner!(self, filter => filter.admit(event))
    }

    fn reset(&mut self) {
        inner!(self, filter => filter.reset());
    }

    fn counters(&self) -> FilterCounters {
        inner!(self, filter => filter.counters())
    }

    fn name(&self) -> &'static str {
        inner!(self, filter => filter.name())
    }
}

/// Filters in series: each sees what those before it passed. An empty chain passes everything.
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

    reports!("chain");
}
