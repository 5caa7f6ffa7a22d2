//! Which promises a soak breaks.
//!
//! Enters: what was measured. Leaves: the same with ratios, memory after warm-up, and a sentence for each broken promise.

use super::report::{Calls, Checkpoint, Memory, PartReport, Ratio, Report, median};
use meissner_pipeline::latency::Quantiles;
use meissner_pipeline::text::grouped;

/// With fewer checkpoints, warm-up and end are not told apart.
const FEWEST: usize = 20;

/// `report` with what follows from it; resident memory may grow by `memory_growth` percent.
pub(super) fn judged(report: Report, memory_growth: u32) -> Report {
    let memory = memory(&report.checkpoints);
    let mut broken: Vec<String> = report.checkpoints.iter().filter_map(differs).collect();
    if report.disturbances.returns_that_differ > 0 {
        let count = grouped(report.disturbances.returns_that_differ);
        broken.push(format!(
            "expected the same prediction behind the return of a state, found other bits {count} times"
        ));
    }
    if let Some(memory) = memory.filter(|memory| memory.growth_percent > f64::from(memory_growth)) {
        broken.push(format!(
            "expected resident memory to grow by at most {memory_growth} % after warm-up, found {:.1} %: {} to {} bytes",
            memory.growth_percent,
            grouped(memory.warm_bytes),
            grouped(memory.end_bytes)
        ));
    }
    let ratio = Some(ratios(&report.first, &report.last));
    Report { ratio, memory, broken, ..report }
}

fn differs(row: &Checkpoint) -> Option<String> {
    (!row.equal).then(|| {
        let (events, compared) = (grouped(row.events), grouped(row.compared as u64));
        format!("expected the bits of the batch over {compared} events behind event {events}, found others")
    })
}

/// The end against the most of the warm-up; none where it is not known, or too short to tell.
fn memory(rows: &[Checkpoint]) -> Option<Memory> {
    if rows.len() < FEWEST {
        return None;
    }
    let resident = |rows: &[Checkpoint]| rows.iter().filter_map(|row| row.resident_bytes).collect::<Vec<_>>();
    let warm_bytes = resident(&rows[..warm_up(rows)]).into_iter().max()?;
    let end_bytes = median(resident(&rows[rows.len() - rows.len().div_ceil(10)..]))?;
    let growth_percent = 100.0 * (end_bytes as f64 / warm_bytes as f64 - 1.0);
    Some(Memory { warm_bytes, end_bytes, growth_percent })
}

/// Checkpoints of the warm-up: a fifth, or more until the largest batch, which takes most of the memory, at most half.
fn warm_up(rows: &[Checkpoint]) -> usize {
    let most = rows.iter().map(|row| row.compared).max();
    let largest = rows.iter().position(|row| Some(row.compared) == most).map_or(0, |at| at + 1);
    largest.max(rows.len() / 5).min(rows.len() / 2)
}

fn ratios(first: &PartReport, last: &PartReport) -> Calls<Option<Ratio>> {
    let of = |first: Option<Quantiles>, last: Option<Quantiles>| {
        first.zip(last).map(|(first, last)| Ratio { p50: last.p50 / first.p50, p99: last.p99 / first.p99 })
    };
    let (first, last) = (&first.latency_us, &last.latency_us);
    Calls { push: of(first.push, last.push), predict: of(first.predict, last.predict) }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use super::judged;
    use crate::soak::report::{Checkpoint, Disturbances, Part, Report};
    use crate::soak::subject::{Checked, Timed};
    use meissner_pipeline::provenance::{Header, ModelCard};

    /// A run of `count` checkpoints that keeps every promise.
    fn report(count: u64) -> Report {
        let checked = Checked { t_us: Some(5), nodes: 7, bits: vec![1, 2], compared: 9, equal: true };
        let mut timed = Timed::new();
        timed.push.record(Duration::from_micros(2));
        timed.predict.record(Duration::from_micros(3));
        let row = |i| Checkpoint::new(100 * (i + 1), &checked, &timed, Some(1_000_000 + i), Duration::ZERO);
        let part = |us| {
            let mut timed = Timed::new();
            timed.push.record(Duration::from_micros(us));
            let mut part = Part::new();
            part.add(&row(0), &timed);
            part.report()
        };
        Report {
            recordings: Vec::new(),
            rounds: 0,
            header: Header::default(),
            card: ModelCard::default(),
            sensor: [1, 1],
            isa: "",
            seed: 1,
            every: 1,
            events: 100 * count,
            accepted: 100 * count,
            warnings: Vec::new(),
            disturbances: Disturbances::default(),
            first: part(10),
            last: part(30),
            ratio: None,
            memory: None,
            peak_resident_bytes: None,
            seconds: 0.0,
            broken: Vec::new(),
            checkpoints: (0..count).map(row).collect(),
        }
    }

    #[test]
    fn a_run_that_keeps_every_promise_breaks_none() {
        let judged = judged(report(40), 10);
        assert!(judged.broken.is_empty(), "{:?}", judged.broken);
        assert!(judged.memory.is_some_and(|memory| memory.growth_percent < 0.1));
    }

    #[test]
    fn other_bits_at_a_single_checkpoint_are_told_with_their_place() {
        let mut report = report(40);
        report.checkpoints[16].equal = false;
        let broken = judged(report, 10).broken;
        assert_eq!(broken.len(), 1);
        assert!(broken[0].contains("over 9 events behind event 1,700"), "{broken:?}");
    }

    #[test]
    fn other_bits_behind_a_returned_state_are_told() {
        let mut report = report(3);
        report.disturbances.returns_that_differ = 2;
        let broken = judged(report, 10).broken;
        assert!(broken.len() == 1 && broken[0].contains("2 times"), "{broken:?}");
    }

    #[test]
    fn memory_that_grows_after_warm_up_is_told_and_memory_of_the_warm_up_is_not() {
        let grown = |from: usize, percent| {
            let mut report = report(40);
            report.checkpoints[from..].iter_mut().for_each(|row| row.resident_bytes = Some(1_120_000));
            judged(report, percent).broken
        };
        assert!(grown(7, 10).is_empty());
        assert!(grown(20, 10)[0].contains("at most 10 % after warm-up, found 12.0 %"), "{:?}", grown(20, 10));
        assert!(grown(20, 15).is_empty());
    }

    #[test]
    fn the_largest_batch_belongs_to_the_warm_up_where_it_is_in_the_first_half() {
        let grown = |largest: usize| {
            let mut report = report(40);
            report.checkpoints[largest].compared = 90;
            report.checkpoints[largest..].iter_mut().for_each(|row| row.resident_bytes = Some(2_000_000));
            judged(report, 10).broken.len()
        };
        assert_eq!([0, 8, 19, 20, 30].map(grown), [0, 0, 0, 1, 1]);
    }

    #[test]
    fn memory_is_not_judged_over_few_checkpoints_or_where_it_is_not_known() {
        assert_eq!(judged(report(19), 0).memory, None);
        let mut unknown = report(40);
        unknown.checkpoints.iter_mut().for_each(|row| row.resident_bytes = None);
        assert_eq!(judged(unknown, 0).memory, None);
    }

    #[test]
    fn latencies_are_ratios_and_break_nothing() {
        let judged = judged(report(40), 10);
        let ratio = judged.ratio.expect("there are ratios");
        assert!(ratio.push.is_some_and(|push| (push.p50 - 3.0).abs() < 0.01), "{ratio:?}");
        assert_eq!(ratio.predict, None);
        assert!(judged.broken.is_empty());
    }
}
