//! The report for people: shares in percent, times in milliseconds.

use std::io::{self, Write};

use meissner_models::systems::digits::CLASSES;

use super::report::{Judged, Report, Way};
use crate::digits::seed_name;
use crate::eval::text::{NONE, confusion, spread};
use crate::text::{Table, percent};
use meissner_pipeline::text::grouped;

/// Most rows of the table of accuracies against time; the report as JSON has all times.
const MOST_TIMES: usize = 40;

/// Writes everything.
pub(super) fn write(out: &mut impl Write, report: &Report) -> io::Result<()> {
    let data = &report.data;
    let [recordings, train, test] = [data.recordings, data.train, data.test].map(|n| grouped(n as u64));
    writeln!(
        out,
        "data         {}: {recordings} recordings ({train} train, {test} test), {} events",
        data.folder,
        grouped(data.events)
    )?;
    let every = milliseconds(report.every_us);
    writeln!(out, "predictions  {}, every {every} ms and at the end of a recording", report.mode)?;
    for (i, network) in report.networks.iter().enumerate() {
        let title = if i == 0 { "networks" } else { "" };
        let stride = match network.stride {
            1 => String::new(),
            stride => format!("; one event of {stride}"),
        };
        writeln!(out, "{title:<12} {}: {}{stride}", network.network, network.weights)?;
    }
    data.notes.iter().try_for_each(|note| writeln!(out, "note         {note}"))?;
    let judged = judged(report);
    accuracies(out, &judged)?;
    seeds(out, &judged)?;
    against_time(out, report, &judged)?;
    for (name, judged) in &judged {
        writeln!(out, "\n{name}: true class by row, predicted by column, percent of the row")?;
        confusion(out, &CLASSES, "recordings", &judged.confusion, judged.trainings)?;
    }
    Ok(())
}

/// All figures with the name of the network and how it was judged.
fn judged(report: &Report) -> Vec<(String, &Judged)> {
    let mut all = Vec::new();
    for network in &report.networks {
        for way in Way::ALL {
            let judged = network.judged(way);
            all.extend(judged.map(|judged| (format!("{}, {}", network.network, way.name()), judged)));
        }
    }
    all
}

/// Microseconds in milliseconds, with the decimals that there are.
fn milliseconds(t_us: i64) -> String {
    (t_us as f64 / 1000.0).to_string()
}

/// An interval in percent.
fn interval((low, high): (f64, f64)) -> String {
    format!("{} to {}", percent(low), percent(high))
}

fn settled(t_us: Option<i64>) -> String {
    t_us.map_or_else(|| NONE.to_owned(), |t_us| format!("{:.1}", t_us as f64 / 1000.0))
}

fn accuracies(out: &mut impl Write, all: &[(String, &Judged)]) -> io::Result<()> {
    let mut table = Table::new(&[
        "at the end of a recording",
        "recordings",
        "seeds",
        "accuracy (%)",
        "std",
        "95 % interval",
        "half right for good by (ms)",
    ]);
    for (name, judged) in all {
        let [mean, std] = spread(judged.accuracy);
        table.row([
            name.clone(),
            grouped(judged.recordings),
            judged.trainings.to_string(),
            mean,
            std,
            interval(judged.interval_95),
            settled(judged.settled_us),
        ]);
    }
    writeln!(out)?;
    table.write(out)
}

/// Each seed, where there are several.
fn seeds(out: &mut impl Write, all: &[(String, &Judged)]) -> io::Result<()> {
    if all.iter().all(|(_, judged)| judged.trainings < 2) {
        return Ok(());
    }
    let mut table =
        Table::new(&["each seed", "files", "accuracy (%)", "95 % interval", "half right for good by (ms)"]);
    for (name, judged) in all {
        for one in &judged.each {
            table.row([
                format!("{name}, seed {}", seed_name(one.seed)),
                one.files.len().to_string(),
                percent(one.accuracy),
                interval(one.interval_95),
                settled(one.settled_us),
            ]);
        }
    }
    writeln!(out)?;
    table.write(out)
}

/// Accuracies at the times at which predictions are read, the last one always.
fn against_time(out: &mut impl Write, report: &Report, all: &[(String, &Judged)]) -> io::Result<()> {
    let mut headings = vec!["accuracy (%) after (ms)"];
    headings.extend(all.iter().map(|(name, _)| name.as_str()));
    let mut table = Table::new(&headings);
    let times = &report.times_us;
    let step = times.len().div_ceil(MOST_TIMES).max(1);
    for (i, &t_us) in times.iter().enumerate().filter(|(i, _)| (i + 1) % step == 0 || i + 1 == times.len()) {
        let cells = all.iter().map(|(_, judged)| percent(judged.accuracy_at[i].mean));
        table.row(std::iter::once(milliseconds(t_us)).chain(cells));
    }
    writeln!(out)?;
    table.write(out)
}
