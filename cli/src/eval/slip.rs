//! `meissner eval slip`: accuracies of networks for the direction of slip, on seen and unseen
//! objects.

use std::io::{self, Write};

use meissner_evaluate::NetworkReport;
use meissner_evaluate::slip::{Report, SetReport, SlipFigures, evaluate};
use meissner_evaluate::trainings::Scheme;
use meissner_models::systems::slip::{CLASSES, ObjectSet, WORDS};
use meissner_plot::{Bar, Bars, Panel, page, percent};
use meissner_run::text::grouped;

use super::{OutputArgs, accuracy_of, confusion, doubts, matrix, networks, spread, write};
use crate::error::CliError;
use crate::tasks::SlipTask;
use crate::text::{NONE, Table, cell, columns, file_name};

/// At the end of the long help.
const METHOD: &str = "\
How it judges:
  Recordings are cut into consecutive windows that do not overlap, as in the paper and in the files of `prepare slip`. The `sampling` of a description is ignored. The prediction for a window is the class with the largest output. Accuracy is the share of windows with the right class. Precision, recall and F1 are means over the classes that are true or predicted at least once, with equal weights. A class that is never predicted has precision and F1 0. Each figure has a mean and a sample standard deviation over the trainings (- for one training). Confusion matrices are shares over all trainings. The number of windows is that of one training.
  input unlike the training: the part of the predictions, and of bad ones, whose last readings are farther from those of the training than 999 of 1,000 of its own. A bad prediction is of a wrong class.

Trainings (--trainings): every *.safetensors file of the folder is a training, with metadata
  network           name of the network
  seed              whole number
  trained_on        \"Basic\": the other sets are unseen
  preparation       how its frames were made, as `prepare slip` writes it; it must
                    fit the description (optional)
  A file with no other key is a whole training. It is judged on the objects of all sets, and Basic is marked as trained on. A file with one of these keys is a fold of a cross-validation. It is judged only on the windows that it names:
  scheme            recordings or windows (optional)
  held_out          JSON list of recordings, such as [\"n/pen178\"]
                    (scheme recordings)
  held_out_windows  JSON list of [recording, window], counted from 0
                    (scheme windows)
  fold              whole number (optional)
  The folds of a network, seed and scheme give one accuracy together.

Logits (--logits), for all windows, in the order of `prepare slip`:
  For every whole training a tensor NETWORK.SEED, or NETWORK.shipped where the weights name no seed, of shape (windows, 7).

Examples:
  meissner eval slip biotac_dos/
  meissner eval slip biotac_dos/ --network slip-lstm --threads 2 --svg slip.svg
  meissner eval slip biotac_dos/ --trainings runs/ --json > slip.json
  meissner eval slip biotac_dos/ --network own.toml --trainings runs/";

/// `meissner eval slip`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD)]
pub(super) struct SlipArgs {
    #[command(flatten)]
    task: SlipTask,
    #[command(flatten)]
    output: OutputArgs,
}

pub(super) fn eval(args: &SlipArgs) -> Result<(), CliError> {
    let request = args.task.request();
    let judge = |workers: &_, done| evaluate(&args.task.data, request, workers, done);
    write(&args.output, svg, table, judge)
}

/// The reason why the two schemes of cross-validation differ.
const WHY: [&str; 3] = [
    "The two differ because of what stands beside a held-out window: by window, its neighbours of the same recording",
    "are in training, and a press changes slowly, so that almost the same window has been seen; by recording, none of",
    "them has.",
];

/// The report for people: shares in percent.
fn table(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let data = &report.data;
    let (recordings, readings) = (grouped(data.recordings as u64), grouped(data.readings as u64));
    writeln!(out, "data         {}: {recordings} recordings, {readings} readings", data.folder)?;
    writeln!(out, "windows      consecutive and without overlap, as the paper cuts them")?;
    networks(out, &report.networks, &data.notes)?;
    if report.networks.iter().any(|network| !network.result.sets.is_empty()) {
        accuracies(out, report)?;
        figures(out, report)?;
        doubts(
            out,
            judged(report).map(|(network, on)| {
                (format!("{network}, {}{}", on.set, mark(on.trained_on)), on.judged.mean.doubts)
            }),
        )?;
        confusions(out, report)?;
    }
    cross_validation(out, report)
}

/// The sets on which at least one network is judged.
fn sets(report: &Report) -> Vec<ObjectSet> {
    let judged = |set: &ObjectSet| report.networks.iter().any(|network| network.result.on(*set).is_some());
    ObjectSet::ALL.into_iter().filter(judged).collect()
}

/// The figures of each network on each set, with the name of the network.
fn judged(report: &Report) -> impl Iterator<Item = (&str, &SetReport)> {
    report.networks.iter().flat_map(|network| {
        let name = network.card.network.name.as_str();
        network.result.sets.iter().map(move |on| (name, on))
    })
}

/// Accuracies of networks on sets, with those of others.
fn accuracies(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let sets = sets(report);
    let names = sets.iter().map(|set| set.name());
    let headings: Vec<&str> = std::iter::once("accuracy (%)").chain(names).collect();
    let accuracy_on = |on: &SetReport| {
        let (mark, accuracy) = (if on.trained_on { "*" } else { "" }, on.judged.mean.scores.accuracy);
        let std = accuracy.std.map_or_else(String::new, |std| format!(" +- {}", percent(std)));
        format!("{}{std}{mark}", percent(accuracy.mean))
    };
    let own = report.networks.iter().filter(|network| !network.result.sets.is_empty()).map(|network| {
        let cells = sets.iter().map(|&set| network.result.on(set).map_or_else(String::new, accuracy_on));
        std::iter::once(network.card.network.name.clone()).chain(cells).collect::<Vec<_>>()
    });
    let others = report.references.iter().map(|other| {
        let cells = sets
            .iter()
            .map(|&set| cell(other.accuracy(set), |share| format!("{:.*}", other.decimals, 100.0 * share)));
        std::iter::once(other.name.to_owned()).chain(cells).collect()
    });
    Table::section(out, &headings, own.chain(others))?;
    for other in &report.references {
        writeln!(out, "  {}: {}", other.name, other.about)?;
    }
    if judged(report).any(|(_, on)| on.trained_on) { writeln!(out, "  *: trained on") } else { Ok(()) }
}

/// All figures of networks on sets.
fn figures(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let headings = columns(
        "network, set | windows | trainings | accuracy (%) | std | precision | std | recall | std | F1 | std",
    );
    let rows = judged(report).map(|(network, on)| {
        let name = format!("{network}, {}{}", on.set, mark(on.trained_on));
        let (windows, scores) = (on.judged.mean.windows, &on.judged.mean.scores);
        let scores = [scores.accuracy, scores.precision, scores.recall, scores.f1].map(spread);
        [name, grouped(windows), on.judged.trainings.to_string()]
            .into_iter()
            .chain(scores.into_iter().flatten())
    });
    Table::section(out, &headings, rows)
}

/// A confusion matrix for each network and set.
fn confusions(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    if judged(report).next().is_some() {
        writeln!(out, "\nclasses      {}", classes())?;
    }
    judged(report).try_for_each(|(network, SetReport { set, judged, .. })| {
        let name = format!("{network} on {set}");
        confusion(out, &name, &CLASSES, "windows", &judged.mean.confusion, judged.trainings)
    })
}

/// The classes in words.
fn classes() -> String {
    let words = CLASSES.iter().zip(WORDS).map(|(class, word)| format!("{class} {word}"));
    words.collect::<Vec<_>>().join(", ")
}

/// Cross-validation by recording, next to that by window.
fn cross_validation(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let validated = report.networks.iter().filter(|network| !network.result.cross_validation.is_empty());
    let rows: Vec<Vec<String>> = validated
        .map(|network| {
            let cells = [Scheme::Recordings, Scheme::Windows].into_iter().flat_map(|scheme| {
                let Some(validation) = network.result.validated(scheme) else {
                    return vec![NONE.to_owned(); 4];
                };
                let judged = &validation.judged;
                let folds: usize = judged.each.iter().map(|one| one.files.len()).sum();
                let [mean, std] = spread(judged.mean.scores.accuracy);
                vec![mean, std, judged.trainings.to_string(), folds.to_string()]
            });
            std::iter::once(network.card.network.name.clone()).chain(cells).collect()
        })
        .collect();
    if rows.is_empty() {
        return Ok(());
    }
    let headings = columns(
        "cross-validation, accuracy (%) | by recording | std | seeds | folds | \
         by window (the paper's way) | std | seeds | folds",
    );
    Table::section(out, &headings, rows)?;
    WHY.iter().try_for_each(|line| writeln!(out, "  {line}"))
}

/// The picture: accuracies of networks and references on each set as bars, then a confusion matrix
/// for each network (row) and set (column).
fn svg(report: &Report) -> String {
    let about = format!(
        "{}: {} recordings, {} readings; confusion matrices: percent of the true class\n{}",
        file_name(&report.data.folder),
        grouped(report.data.recordings as u64),
        grouped(report.data.readings as u64),
        classes()
    );
    let networks = || report.networks.iter().filter(|network| !network.result.sets.is_empty());
    let sets = sets(report);
    let group = |&set: &ObjectSet| {
        let trained_on = networks().filter_map(|network| network.result.on(set)).any(|on| on.trained_on);
        format!("{set}{}", mark(trained_on))
    };
    let series = |network: &NetworkReport<SlipFigures>| {
        let accuracy = |on: &SetReport| on.judged.mean.scores.accuracy;
        let bar = |on: &SetReport| Bar { mean: accuracy(on).mean, std: accuracy(on).std };
        (network.card.network.name.clone(), sets.iter().map(|&set| network.result.on(set).map(bar)).collect())
    };
    let references = report.references.iter().map(|other| {
        let name = format!("{} (reference)", other.name);
        (name, sets.iter().map(|&set| other.accuracy(set)).collect())
    });
    let bars = Bars {
        groups: sets.iter().map(group).collect(),
        series: networks().map(series).collect(),
        references: references.collect(),
        y_title: "accuracy (%)".to_owned(),
        note: "error bars: one standard deviation over trainings".to_owned(),
    };
    let panel = |network: &NetworkReport<SlipFigures>, on: &SetReport| {
        let title = format!("{}, {}{}", network.card.network.name, on.set, mark(on.trained_on));
        let (mean, trainings) = (&on.judged.mean, on.judged.trainings);
        let about = accuracy_of(mean.scores.accuracy, "", (trainings, "training"), (mean.windows, "windows"));
        matrix(title, about, &CLASSES, &mean.confusion)
    };
    let matrices = |network: &NetworkReport<SlipFigures>| {
        sets.iter().filter_map(|&set| network.result.on(set)).map(|on| panel(network, on)).collect()
    };
    let rows: Vec<Vec<Panel<'_>>> =
        std::iter::once(vec![Panel::Bars(bars)]).chain(networks().map(matrices)).collect();
    page("Direction of slip", &about, &rows)
}

fn mark(trained_on: bool) -> &'static str {
    if trained_on { " (trained on)" } else { "" }
}
