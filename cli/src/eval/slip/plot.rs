//! The picture of `eval slip --svg`: accuracies of all networks and references on each set as bars, then a confusion matrix
//! for each network (row) and set (column).

use meissner_models::systems::slip::{CLASSES, ObjectSet};
use meissner_pipeline::text::grouped;
use meissner_plot::{Bar, Bars, Matrix, Panel, page};

use crate::text::file_name;
use meissner_evaluate::slip::{NetworkReport, Report, SetReport};

/// The picture, as the text of a file.
pub(super) fn svg(report: &Report) -> String {
    let about = format!(
        "{}: {} recordings, {} readings; confusion matrices: percent of the true class",
        file_name(&report.data.folder),
        grouped(report.data.recordings as u64),
        grouped(report.data.readings as u64)
    );
    let networks = || report.networks.iter().filter(|network| !network.sets.is_empty());
    let sets = ObjectSet::ALL.into_iter().filter(|&set| networks().any(|network| network.on(set).is_some()));
    let sets: Vec<ObjectSet> = sets.collect();
    let group = |&set: &ObjectSet| {
        let trained_on = networks().filter_map(|network| network.on(set)).any(|on| on.trained_on);
        format!("{set}{}", mark(trained_on))
    };
    let series = |network: &NetworkReport| {
        let bar = |on: &SetReport| Bar { mean: on.judged.accuracy.mean, std: on.judged.accuracy.std };
        (network.network.clone(), sets.iter().map(|&set| network.on(set).map(bar)).collect())
    };
    let references = report.references.iter().map(|other| {
        let name = format!("{} (reference)", other.name);
        (name, sets.iter().map(|&set| other.reference.accuracy(set)).collect())
    });
    let bars = Bars {
        groups: sets.iter().map(group).collect(),
        series: networks().map(series).collect(),
        references: references.collect(),
        note: "error bars: one standard deviation over trainings".to_owned(),
    };
    let matrix = |network: &NetworkReport, on: &SetReport| {
        Panel::Matrix(Matrix {
            title: format!("{}, {}{}", network.network, on.set, mark(on.trained_on)),
            about: accuracy(on),
            classes: &CLASSES,
            counts: on.judged.confusion.rows().map(<[u64]>::to_vec).collect(),
        })
    };
    let matrices = |network: &NetworkReport| {
        sets.iter().filter_map(|&set| network.on(set)).map(|on| matrix(network, on)).collect()
    };
    let rows: Vec<Vec<Panel<'_>>> =
        std::iter::once(vec![Panel::Bars(bars)]).chain(networks().map(matrices)).collect();
    page("Direction of slip", &about, &rows)
}

fn mark(trained_on: bool) -> &'static str {
    if trained_on { " (trained on)" } else { "" }
}

/// The line below the title of a matrix.
fn accuracy(on: &SetReport) -> String {
    let judged = &on.judged;
    let std = judged.accuracy.std.map_or_else(String::new, |std| format!(" \u{b1} {:.2}", 100.0 * std));
    let trainings = if judged.trainings == 1 { "training" } else { "trainings" };
    format!(
        "{:.2}{std} %, {} {trainings}, {} windows",
        100.0 * judged.accuracy.mean,
        judged.trainings,
        grouped(judged.windows)
    )
}
