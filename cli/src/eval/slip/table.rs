//! The report for people: shares in percent.

use std::io::{self, Write};

use meissner_models::systems::slip::{CLASSES, ObjectSet};

use super::report::{Judged, NetworkReport, Report};
use crate::eval::text::{NONE, confusion, spread};
use crate::slip::Scheme;
use crate::text::{Table, percent};
use meissner_pipeline::text::grouped;

/// Why the two schemes of cross-validation differ.
const WHY: [&str; 3] = [
    "The two differ because of what stands beside a held-out window: by window, its neighbours of the same recording",
    "are in training, and a press changes slowly, so that almost the same window has been seen; by recording, none of",
    "them has.",
];

/// Writes everything.
pub(super) fn write(out: &mut impl Write, report: &Report) -> io::Result<()> {
    let data = &report.data;
    let (recordings, readings) = (grouped(data.recordings as u64), grouped(data.readings as u64));
    writeln!(out, "data         {}: {recordings} recordings, {readings} readings", data.folder)?;
    writeln!(out, "windows      consecutive and without overlap, as the paper cuts them")?;
    for (i, network) in report.networks.iter().enumerate() {
        let (title, NetworkReport { network, weights, .. }) = (if i == 0 { "networks" } else { "" }, network);
        writeln!(out, "{title:<12} {network}: {weights}")?;
    }
    data.notes.iter().try_for_each(|note| writeln!(out, "note         {note}"))?;
    if report.networks.iter().any(|network| !network.sets.is_empty()) {
        accuracies(out, report)?;
        figures(out, report)?;
        confusions(out, report)?;
    }
    cross_validation(out, report)
}

/// The sets that some network is judged on.
fn sets(report: &Report) -> Vec<ObjectSet> {
    let judged = |set: &ObjectSet| report.networks.iter().any(|network| network.on(*set).is_some());
    ObjectSet::ALL.into_iter().filter(judged).collect()
}

/// Accuracies of networks on sets, with those of others.
fn accuracies(out: &mut impl Write, report: &Report) -> io::Result<()> {
    let sets = sets(report);
    let mut headings = vec!["accuracy (%)"];
    headings.extend(sets.iter().map(|set| set.name()));
    let mut table = Table::new(&headings);
    let mut trained_on = false;
    for network in report.networks.iter().filter(|network| !network.sets.is_empty()) {
        let cell = |set: &ObjectSet| {
            network.on(*set).map_or_else(String::new, |on| {
                trained_on |= on.trained_on;
                let mark = if on.trained_on { "*" } else { "" };
                let accuracy = on.judged.accuracy;
                let std = accuracy.std.map_or_else(String::new, |std| format!(" +- {}", percent(std)));
                format!("{}{std}{mark}", percent(accuracy.mean))
            })
        };
        let cells: Vec<_> = sets.iter().map(cell).collect();
        table.row(std::iter::once(network.network.clone()).chain(cells));
    }
    for reference in &report.references {
        let cell = |set: &ObjectSet| {
            let accuracy = reference.reference.accuracy(*set);
            let decimals = reference.reference.decimals;
            accuracy.map_or_else(|| NONE.to_owned(), |share| format!("{:.decimals$}", 100.0 * share))
        };
        table.row(std::iter::once(reference.name.to_owned()).chain(sets.iter().map(cell)));
    }
    writeln!(out)?;
    table.write(out)?;
    for reference in &report.references {
        writeln!(out, "  {}: {}", reference.name, reference.about)?;
    }
    if trained_on { writeln!(out, "  *: trained on") } else { Ok(()) }
}

const FIGURES: [&str; 10] =
    ["windows", "trainings", "accuracy (%)", "std", "precision", "std", "recall", "std", "F1", "std"];

fn cells(judged: &Judged) -> impl Iterator<Item = String> {
    let counts = [grouped(judged.windows), judged.trainings.to_string()];
    let figures = [judged.accuracy, judged.precision, judged.recall, judged.f1].map(spread);
    counts.into_iter().chain(figures.into_iter().flatten())
}

/// All figures of networks on sets.
fn figures(out: &mut impl Write, report: &Report) -> io::Result<()> {
    let mut headings = vec!["network, set"];
    headings.extend(FIGURES);
    let mut table = Table::new(&headings);
    for network in &report.networks {
        for on in &network.sets {
            let mark = if on.trained_on { " (trained on)" } else { "" };
            let name = format!("{}, {}{mark}", network.network, on.set);
            table.row(std::iter::once(name).chain(cells(&on.judged)));
        }
    }
    writeln!(out)?;
    table.write(out)
}

/// A confusion matrix for each network and set.
fn confusions(out: &mut impl Write, report: &Report) -> io::Result<()> {
    for network in &report.networks {
        for on in &network.sets {
            writeln!(
                out,
                "\n{} on {}: true class by row, predicted by column, percent of the row",
                network.network, on.set
            )?;
            confusion(out, &CLASSES, "windows", &on.judged.confusion, on.judged.trainings)?;
        }
    }
    Ok(())
}

/// Cross-validation by recording beside that by window.
fn cross_validation(out: &mut impl Write, report: &Report) -> io::Result<()> {
    let validated: Vec<_> = report.networks.iter().filter(|n| !n.cross_validation.is_empty()).collect();
    if validated.is_empty() {
        return Ok(());
    }
    let mut table = Table::new(&[
        "cross-validation, accuracy (%)",
        "by recording",
        "std",
        "seeds",
        "folds",
        "by window (the paper's way)",
        "std",
        "seeds",
        "folds",
    ]);
    for network in validated {
        let cells = [Scheme::Recordings, Scheme::Windows].into_iter().flat_map(|scheme| {
            let Some(validation) = network.validated(scheme) else { return vec![NONE.to_owned(); 4] };
            let judged = &validation.judged;
            let folds: usize = judged.each.iter().map(|one| one.files.len()).sum();
            let [mean, std] = spread(judged.accuracy);
            vec![mean, std, judged.trainings.to_string(), folds.to_string()]
        });
        table.row(std::iter::once(network.network.clone()).chain(cells));
    }
    writeln!(out)?;
    table.write(out)?;
    WHY.iter().try_for_each(|line| writeln!(out, "  {line}"))
}
