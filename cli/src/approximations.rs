//! Approximations that are asked for: which there are, where each takes effect, and what the reports say of them.
//!
//! Filters stand in front of the engine; fewer neighbours change the network before it runs; a
//! tolerance is the engine's; a stale readout stands behind it. Without any, everything is exact and reports say nothing.

use std::io::{self, Write};

use meissner_engine::EngineError;
use meissner_engine::filters::RateLimit;
use meissner_pipeline::PipelineError;
use meissner_pipeline::approximations::{ApproximationReport, Approximations, FilteredEvents};
use meissner_pipeline::text::grouped;
use meissner_pipeline::time::span_us;

use crate::args::APPROXIMATIONS;
use crate::error::CliError;

/// What makes results cheaper and less exact.
#[derive(Clone, Debug, Default, clap::Args)]
pub(crate) struct ApproximationArgs {
    /// Keep the values of a row or pixel that changes by at most X.
    ///
    /// X bounds the change in every channel. Without this option every change counts, and results are exact. Networks
    /// over events: a row of a spline block that has just entered is always stored, and pooled maxima and the readout
    /// are exact over stored rows, so that no error grows with time. Rows that are computed once on arrival (the event
    /// level of tactigraph-frozen and tactigraph-past) stay exact.
    #[arg(long, value_name = "X", value_parser = number, help_heading = APPROXIMATIONS)]
    pub(crate) tolerance: Option<f32>,
    /// Let each node of the event graph read only its first K neighbours.
    #[arg(long, value_name = "K", value_parser = clap::value_parser!(u8).range(1..), help_heading = APPROXIMATIONS)]
    pub(crate) neighbours: Option<u8>,
    /// Drop events as noise where no neighbouring pixel fired in the TIME before.
    ///
    /// The neighbours are the 8 pixels around the event. The contact-angle paper uses 1250us. Filters act in this
    /// order: --activity-filter, --refractory, --rate-limit, --stride. They act before late events, and events outside
    /// the sensor, are dropped.
    #[arg(long = "activity-filter", value_name = "TIME", value_parser = span_us, help_heading = APPROXIMATIONS)]
    pub(crate) activity_filter_us: Option<i64>,
    /// Drop events of a pixel within TIME of its last event that was kept.
    #[arg(long = "refractory", value_name = "TIME", value_parser = span_us, help_heading = APPROXIMATIONS)]
    pub(crate) refractory_us: Option<i64>,
    /// Thin events evenly above this rate, in events per second.
    ///
    /// Bursts of up to 1 ms at that rate pass.
    #[arg(long, value_name = "RATE", help_heading = APPROXIMATIONS,
          value_parser = clap::value_parser!(u64).range(1..=RateLimit::HIGHEST))]
    pub(crate) rate_limit: Option<u64>,
    /// Keep every Nth event, and drop the others.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = APPROXIMATIONS)]
    pub(crate) stride: Option<u32>,
    /// Recompute a prediction only after N more accepted events.
    ///
    /// Until then the last prediction stands, with its time. With --stale-time as well, a prediction is recomputed as
    /// soon as either is reached.
    #[arg(long, value_name = "N", help_heading = APPROXIMATIONS,
          value_parser = clap::value_parser!(u64).range(1..=i64::MAX as u64))]
    pub(crate) stale_events: Option<u64>,
    /// Recompute a prediction only after TIME of stream time.
    #[arg(long = "stale-time", value_name = "TIME", value_parser = span_us, help_heading = APPROXIMATIONS)]
    pub(crate) stale_us: Option<i64>,
}

impl ApproximationArgs {
    /// The options that only networks over events know, and whether each was given.
    pub(crate) fn given(&self) -> [(&'static str, bool); 7] {
        [
            ("--neighbours", self.neighbours.is_some()),
            ("--activity-filter", self.activity_filter_us.is_some()),
            ("--refractory", self.refractory_us.is_some()),
            ("--rate-limit", self.rate_limit.is_some()),
            ("--stride", self.stride.is_some()),
            ("--stale-events", self.stale_events.is_some()),
            ("--stale-time", self.stale_us.is_some()),
        ]
    }

    /// The first of those given that remember events or predictions beside the engine.
    pub(crate) fn remembers(&self) -> Option<&'static str> {
        let [.., activity, refractory, rate, stride, stale_events, stale_us] = self.given();
        let remembering = [activity, refractory, rate, stride, stale_events, stale_us];
        remembering.into_iter().find(|(_, given)| *given).map(|(option, _)| option)
    }

    /// Them, without the command line.
    pub(crate) fn values(&self) -> Approximations {
        let Self { tolerance, neighbours, activity_filter_us, refractory_us, .. } = *self;
        let Self { rate_limit, stride, stale_events, stale_us, .. } = *self;
        Approximations {
            tolerance,
            neighbours,
            activity_filter_us,
            refractory_us,
            rate_limit,
            stride,
            stale_events,
            stale_us,
        }
    }
}

/// Writes a line for each approximation of `report`.
pub(crate) fn write(report: &ApproximationReport, out: &mut impl Write) -> io::Result<()> {
    let mut lines = Vec::new();
    for FilteredEvents { name, passed, dropped } in &report.filters {
        let all = passed + dropped;
        let (name, dropped, all) = (name.replace('_', " "), grouped(*dropped), grouped(all));
        lines.push(format!("{name} dropped {dropped} of {all} events"));
    }
    if let Some(neighbours) = report.neighbours {
        lines.push(format!("at most {neighbours} neighbours an event"));
    }
    if let Some((tolerance, rows)) = report.tolerance.zip(report.rows_within_tolerance) {
        lines.push(format!("{} recomputed rows within {tolerance} kept their values", grouped(rows)));
    }
    if let Some(stale) = report.stale_predictions {
        lines.push(format!("{} predictions stood and were not computed", grouped(stale)));
    }
    lines.iter().try_for_each(|line| writeln!(out, "approximate  {line}"))
}

/// Reads a finite number of at least 0.
pub(crate) fn number(text: &str) -> Result<f32, String> {
    let number = text.parse().ok().filter(|number: &f32| number.is_finite() && *number >= 0.0);
    number.ok_or_else(|| "expected a finite number of at least 0, such as 0.01".to_owned())
}

/// `error`, with the option that the engine's error is about.
pub(crate) fn with_option(error: PipelineError) -> CliError {
    match error {
        PipelineError::Engine(EngineError::Option { what: "neighbours of a node", expected, found }) => {
            CliError::Option { option: "--neighbours", expected, found }
        }
        error => error.into(),
    }
}
