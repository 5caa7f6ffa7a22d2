//! Reports and summary, for people and for programs.

use std::io::{self, Write};

use meissner_live::Timely;
use serde::Serialize;

use super::summary::Summary;
use super::tally::State;
use crate::answer::{Answer, Answers};
use crate::progress::Progress;
use crate::run::json::{JsonLines, Values};
use crate::run::lines::Lines;
use crate::run::table::quantiles;
use meissner_pipeline::latency::microseconds;
use meissner_pipeline::provenance::Header;
use meissner_pipeline::text::grouped;

/// Reasons for which the queue drops events; all others are the engine's.
const QUEUE_REASONS: [&str; 4] = ["oldest", "newest", "thinned", "filtered"];

/// Where results go, in whose words.
pub(super) struct Report<W: Write> {
    to: To<W>,
    answers: Answers,
}

enum To<W: Write> {
    Json(JsonLines<W>),
    People(Lines<W>),
}

#[derive(Serialize)]
struct Line<'a> {
    at_us: i64,
    t_us: Option<i64>,
    value: Values<'a>,
    #[serde(flatten)]
    answer: Option<Answer<'a>>,
    nodes: usize,
    state: State,
    behind_events: u64,
    behind_us: u64,
    age_us: f64,
    waited_us: f64,
}

#[derive(Serialize)]
struct LastLine<'a> {
    summary: &'a Summary<'a>,
}

/// When a report was due: its number from 1, its time, and that since the first event.
#[derive(Clone, Copy)]
pub(super) struct Due {
    pub(super) number: u64,
    pub(super) at_us: i64,
    pub(super) elapsed_us: i128,
}

impl<W: Write> Report<W> {
    /// JSON lines.
    pub(super) fn json(out: W, header: &Header, answers: Answers) -> io::Result<Self> {
        let mut lines = JsonLines::new(out, true);
        lines.header(header)?;
        Ok(Self { to: To::Json(lines), answers })
    }

    /// Headings for `answers`, and then some of `due` lines.
    pub(super) fn people(mut out: W, answers: Answers, due: u64) -> io::Result<Self> {
        let values = answers.headings();
        writeln!(
            out,
            "{:>9}{values}  {:>6}  {:>9}  {:>7}  {:>9}",
            "time (ms)", "state", "behind ms", "age ms", "waited us"
        )?;
        out.flush()?;
        let lines = Lines::new(out, Some(due), Progress::new(None, false));
        Ok(Self { to: To::People(lines), answers })
    }

    /// The line of a report.
    pub(super) fn line(&mut self, due: Due, timely: &Timely<'_>) -> io::Result<()> {
        let (state, age_us) = (State::of(timely), microseconds(timely.age));
        let &Timely { values, t_us, nodes, behind_events, behind_us, .. } = timely;
        let waited_us = microseconds(timely.waited);
        match &mut self.to {
            To::Json(lines) => lines.prediction(&Line {
                at_us: due.at_us,
                t_us,
                value: Values(values),
                answer: self.answers.of(values),
                nodes,
                state,
                behind_events,
                behind_us,
                age_us,
                waited_us,
            }),
            To::People(lines) => {
                let values = self.answers.columns(values);
                let (time, behind, age) = (due.elapsed_us as f64 / 1e3, behind_us as f64 / 1e3, age_us / 1e3);
                let state = state.name();
                let line =
                    format!("{time:>9.3}{values}  {state:>6}  {behind:>9.3}  {age:>7.3}  {waited_us:>9.1}");
                lines.line(due.number, line)
            }
        }
    }

    /// The end.
    pub(super) fn summary(&mut self, summary: &Summary<'_>) -> io::Result<()> {
        match &mut self.to {
            To::Json(lines) => lines.last(&LastLine { summary }),
            To::People(lines) => {
                let out = lines.end(summary.reports.made)?;
                if let Some(left_out) = self.answers.left_out() {
                    writeln!(out, "{left_out}")?;
                }
                table(out, summary)?;
                out.flush()
            }
        }
    }
}

fn table(out: &mut impl Write, summary: &Summary<'_>) -> io::Result<()> {
    let Summary { events, offered, delivered, queue, reports, latency_us, .. } = summary;
    let [events, offered, delivered] = [events, offered, delivered].map(|&count| grouped(count));
    let accepted = grouped(summary.accepted);
    writeln!(
        out,
        "\nevents       {events} taken, {offered} offered, {delivered} delivered, {accepted} accepted"
    )?;
    if summary.lines_refused > 0 {
        writeln!(out, "refused      {} lines that are no events", grouped(summary.lines_refused))?;
    }
    for (reason, &count) in summary.dropped.iter().filter(|&(_, &count)| count > 0) {
        let by_queue = if QUEUE_REASONS.contains(reason) { "by the queue: " } else { "" };
        writeln!(out, "dropped      {} {by_queue}{}", grouped(count), reason.replace('_', " "))?;
    }
    writeln!(
        out,
        "queue        {}: at most {} of {} events waited; the reader waited {:.1} ms, and was {:.1} ms behind at most",
        queue.overload.replace('_', " "),
        grouped(queue.high_water),
        grouped(queue.capacity.into()),
        queue.blocked_us / 1e3,
        summary.reader_lag_max_us / 1e3,
    )?;
    let counts = [reports.made, reports.due, reports.fresh, reports.behind, reports.old].map(grouped);
    let [made, due, fresh, behind, old] = counts;
    writeln!(out, "reports      {made} of {due} made: {fresh} fresh, {behind} behind, {old} old")?;
    writeln!(
        out,
        "deadline     passed by {} of them, by {:.1} us at most; asked for {:.1} us late at most",
        grouped(reports.past_deadline),
        reports.past_deadline_max_us,
        reports.asked_late_max_us
    )?;
    writeln!(out, "drained      {:.1} ms after the end", summary.drain_us / 1e3)?;
    if let Some(bytes) = summary.peak_resident_bytes {
        writeln!(
            out,
            "memory       at most {:.1} MiB, the recording included",
            bytes as f64 / f64::from(1 << 20)
        )?;
    }
    if let Some(verified) = &summary.verified {
        let events = grouped(verified.events as u64);
        let verdict = if verified.equal { "equals" } else { "DIFFERS from" };
        let ms = verified.batch_us / 1e3;
        writeln!(
            out,
            "verified     the last prediction {verdict} the batch over {events} accepted events ({ms:.0} ms)"
        )?;
    }
    summary
        .approximations
        .as_ref()
        .map_or(Ok(()), |approximations| crate::approximations::write(approximations, out))?;
    quantiles(out, &[("waited", latency_us.waited), ("age", latency_us.age), ("behind", latency_us.behind)])
}
