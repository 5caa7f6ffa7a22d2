//! How punctual the loop was, and whose fault a missed deadline is.
//!
//! Enters: the times of each cycle. Leaves: counts and histograms. Recording allocates nothing.
//!
//! A deadline is *missed* unless a prediction that covers every event of the queue is at hand by then. The first of these causes that
//! applies is counted:
//!
//! | cause | when |
//! |---|---|
//! | [`Cause::WakeUp`] | the loop was woken so late that less than half of its time to the deadline was left |
//! | [`Cause::Processor`] | the engine's thread was computing for less than nine tenths of the time from the call to the answer: it waited for a processor |
//! | [`Cause::Backlog`] | the feed brought events that late, or the cycle before was missed by one of these three: work had piled up |
//! | [`Cause::Engine`] | none of these: the engine had a processor and the work of one cycle, and needed longer |

use std::fmt;
use std::time::Duration;

use hdrhistogram::Histogram;

/// Upper bounds of the rows of the printed histogram, in microseconds.
const ROWS_US: [u64; 11] = [5, 10, 20, 50, 100, 200, 500, 900, 2000, 10_000, u64::MAX];
/// Most cycles that are named.
const NAMED: usize = 32;
/// Longest time that the histograms distinguish, in nanoseconds: 10 s.
const LONGEST_NS: u64 = 10_000_000_000;

/// The times of a cycle.
#[derive(Clone, Copy, Debug)]
pub struct Cycle {
    /// When it should begin.
    pub due: Duration,
    /// When it began.
    pub woke: Duration,
    /// When the prediction was at hand.
    pub answered: Duration,
    /// When the prediction should be at hand.
    pub deadline: Duration,
    /// Whether it covers every event.
    pub fresh: bool,
    /// For how long the engine's thread computed between `woke` and `answered`.
    pub computed: Duration,
    /// How late the feed was with the newest events, as far as it knows.
    pub fed_late: Duration,
}

/// Why a deadline was missed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// The operating system woke the loop too late.
    WakeUp,
    /// The operating system let the engine's thread wait for a processor.
    Processor,
    /// The operating system had let a thread wait before, and its work was not done yet.
    Backlog,
    /// The engine needed longer.
    Engine,
}

/// Causes with what they mean, in the order of [`Timing::missed`].
const CAUSES: [(Cause, &str); 4] = [
    (Cause::WakeUp, "the operating system woke the loop late"),
    (Cause::Processor, "the engine's thread waited for a processor"),
    (Cause::Backlog, "work had piled up while a thread waited"),
    (Cause::Engine, "of the engine"),
];

impl Cycle {
    /// Why the deadline was missed, after a cycle that was missed by `before`; `None` if it was not.
    pub fn missed(&self, before: Option<Cause>) -> Option<Cause> {
        if self.fresh && self.answered <= self.deadline {
            return None;
        }
        let [left, most] = [self.woke, self.due].map(|from| self.deadline.saturating_sub(from));
        let waited = self.answered.saturating_sub(self.woke);
        Some(if 2 * left < most {
            Cause::WakeUp
        } else if 10 * self.computed < 9 * waited {
            Cause::Processor
        } else if 2 * self.fed_late > most || before.is_some_and(|before| before != Cause::Engine) {
            Cause::Backlog
        } else {
            Cause::Engine
        })
    }
}

/// Counts and histograms of cycles.
#[derive(Clone, Debug)]
pub struct Timing {
    /// Cycles.
    pub cycles: u64,
    /// Cycles that missed their deadline, by [`Cause`] in its order.
    pub missed: [u64; 4],
    /// Numbers of the first cycles that missed their deadline because of the engine. Over a recording the work of a cycle is the same in
    /// every run: what the engine is to blame for returns.
    pub of_engine: Vec<u64>,
    /// Why the newest cycle missed its deadline, if it did.
    before: Option<Cause>,
    /// From when a cycle was due until it began, in nanoseconds.
    pub wake_ns: Histogram<u64>,
    /// From the beginning of a cycle until the prediction was at hand.
    pub answer_ns: Histogram<u64>,
    /// Computing time of the engine's thread between the two.
    pub computed_ns: Histogram<u64>,
}

impl Default for Timing {
    fn default() -> Self {
        let histogram =
            || Histogram::new_with_bounds(1, LONGEST_NS, 3).expect("the bounds are constants that fit");
        Self {
            cycles: 0,
            missed: [0; 4],
            of_engine: Vec::with_capacity(NAMED),
            before: None,
            wake_ns: histogram(),
            answer_ns: histogram(),
            computed_ns: histogram(),
        }
    }
}

impl Timing {
    /// Records a cycle.
    pub fn record(&mut self, cycle: &Cycle) {
        let put = |histogram: &mut Histogram<u64>, time: Duration| {
            histogram.saturating_record(u64::try_from(time.as_nanos()).unwrap_or(u64::MAX));
        };
        self.cycles += 1;
        put(&mut self.wake_ns, cycle.woke.saturating_sub(cycle.due));
        put(&mut self.answer_ns, cycle.answered.saturating_sub(cycle.woke));
        put(&mut self.computed_ns, cycle.computed);
        self.before = cycle.missed(self.before);
        if let Some(cause) = self.before {
            self.missed[cause as usize] += 1;
            if cause == Cause::Engine && self.of_engine.len() < NAMED {
                self.of_engine.push(self.cycles);
            }
        }
    }
}

impl fmt::Display for Timing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{} cycles, {} deadlines missed:", self.cycles, self.missed.iter().sum::<u64>())?;
        for (cause, text) in CAUSES {
            writeln!(f, "  {:>6} because {text}", self.missed[cause as usize])?;
        }
        if !self.of_engine.is_empty() {
            writeln!(f, "         in the cycles {:?}", self.of_engine)?;
        }
        let histograms = [&self.wake_ns, &self.answer_ns, &self.computed_ns];
        let row = |f: &mut fmt::Formatter<'_>, name: &str, cells: [String; 3]| {
            writeln!(f, "{name:>14} {:>10} {:>10} {:>10}", cells[0], cells[1], cells[2])
        };
        let names = ["woken late", "answer", "computing"];
        row(f, "us", names.map(str::to_owned))?;
        let counts = histograms.map(rows);
        let mut above = 0;
        for (i, bound_us) in ROWS_US.into_iter().enumerate() {
            let name =
                if bound_us == u64::MAX { format!("> {above}") } else { format!("{above} to {bound_us}") };
            row(f, &name, counts.map(|rows| rows[i].to_string()))?;
            above = bound_us;
        }
        for (name, quantile) in [("p50", 0.5), ("p99", 0.99), ("p99.9", 0.999), ("most", 1.0)] {
            let us = |histogram: &Histogram<u64>| histogram.value_at_quantile(quantile) as f64 / 1e3;
            row(f, name, histograms.map(|histogram| format!("{:.1}", us(histogram))))?;
        }
        Ok(())
    }
}

/// How many values belong to each row. The histogram's own counts between two values overlap where a bucket holds both.
fn rows(histogram: &Histogram<u64>) -> [u64; ROWS_US.len()] {
    let mut rows = [0; ROWS_US.len()];
    for step in histogram.iter_recorded() {
        let ns = histogram.lowest_equivalent(step.value_iterated_to());
        rows[ROWS_US.partition_point(|&us| us.saturating_mul(1000) < ns)] += step.count_at_value();
    }
    rows
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::{Cause, Cycle, Timing};

    const fn us(us: u64) -> Duration {
        Duration::from_micros(us)
    }

    const KEPT: Cycle = Cycle {
        due: us(1000),
        woke: us(1010),
        answered: us(1100),
        deadline: us(1800),
        fresh: true,
        computed: us(50),
        fed_late: us(0),
    };

    #[test]
    fn a_deadline_is_kept_by_a_fresh_answer_in_time() {
        assert_eq!(KEPT.missed(None), None);
        assert_ne!(Cycle { fresh: false, ..KEPT }.missed(None), None);
        assert_ne!(Cycle { answered: us(1801), ..KEPT }.missed(None), None);
    }

    #[test]
    fn an_engine_that_computed_nearly_all_the_time_is_to_blame() {
        let late = Cycle { answered: us(1810), fresh: false, ..KEPT };
        assert_eq!(Cycle { computed: us(720), ..late }.missed(None), Some(Cause::Engine));
        assert_eq!(Cycle { computed: us(719), ..late }.missed(None), Some(Cause::Processor));
        assert_eq!(Cycle { woke: us(1400), computed: us(410), ..late }.missed(None), Some(Cause::Engine));
        assert_eq!(Cycle { woke: us(1401), computed: us(409), ..late }.missed(None), Some(Cause::WakeUp));
    }

    #[test]
    fn work_that_piled_up_is_not_the_engines_until_a_deadline_is_kept() {
        let late = Cycle { answered: us(1810), fresh: false, computed: us(790), ..KEPT };
        assert_eq!(Cycle { fed_late: us(401), ..late }.missed(None), Some(Cause::Backlog));
        assert_eq!(late.missed(Some(Cause::Processor)), Some(Cause::Backlog));
        assert_eq!(late.missed(Some(Cause::Engine)), Some(Cause::Engine));
        let mut timing = Timing::default();
        for cycle in [Cycle { computed: us(1), ..late }, late, late, KEPT, late] {
            timing.record(&cycle);
        }
        assert_eq!((timing.missed, timing.of_engine), ([0, 1, 2, 1], vec![5]));
    }

    #[test]
    fn the_rows_of_the_printed_histogram_count_every_cycle_once() {
        let mut timing = Timing::default();
        for late in [1, 5, 6, 60, 900, 20_000] {
            let woke = KEPT.due + us(late);
            timing.record(&Cycle { woke, answered: woke + us(7), ..KEPT });
        }
        let text = timing.to_string();
        let rows = text.lines().filter(|line| line.contains(" to ") || line.trim_start().starts_with('>'));
        let counts = rows.map(|row| row.split_whitespace().rev().nth(2).and_then(|n| n.parse::<u64>().ok()));
        assert_eq!(counts.map(Option::unwrap).sum::<u64>(), 6, "{text}");
        assert!(text.contains("       2 because the operating system woke the loop late"), "{text}");
    }
}
