//! The picture of `eval digits --svg`: for the test split and for the cross-validation a row with accuracies against time and
//! a confusion matrix for each network.

use meissner_models::systems::digits::CLASSES;
use meissner_pipeline::text::grouped;
use meissner_plot::{AccuracyCurve, Curves, Matrix, Panel, page};

use crate::text::file_name;
use meissner_evaluate::digits::{Judged, Protocol, Report};

/// The picture, as the text of a file.
pub(super) fn svg(report: &Report) -> String {
    let about = format!(
        "{}: {} recordings, {} events; confusion matrices at the end of a recording: percent of the true class",
        file_name(&report.data.folder),
        grouped(report.data.recordings as u64),
        grouped(report.data.events)
    );
    let rows: Vec<Vec<Panel<'_>>> =
        Protocol::ALL.into_iter().filter_map(|protocol| row(report, protocol)).collect();
    page("Digits, event by event", &about, &rows)
}

/// The panels of one protocol; `None` where no network was judged by it.
fn row(report: &Report, protocol: Protocol) -> Option<Vec<Panel<'static>>> {
    let (mut curves, mut matrices) = (Vec::new(), Vec::new());
    // The colour of a network is that of its place among all networks.
    for (colour, network) in report.networks.iter().enumerate() {
        let Some(judged) = network.judged(protocol) else { continue };
        let name = &network.network;
        curves.push(AccuracyCurve {
            name: format!("{name}, {:.1} %", 100.0 * judged.accuracy.mean),
            colour,
            accuracy: judged.accuracy_at.iter().map(|at| at.mean).collect(),
            interval: judged.interval_95_at.clone(),
        });
        matrices.push(Panel::Matrix(Matrix {
            title: format!("{name}, {}", protocol.name()),
            about: accuracy(judged),
            classes: &CLASSES,
            counts: judged.confusion.rows().map(<[u64]>::to_vec).collect(),
        }));
    }
    let is_empty = curves.is_empty();
    let curves = Panel::Curves(Curves {
        title: format!("Accuracy against time, {}", protocol.name()),
        about: "bands: 95 % intervals; after the end of a recording its last prediction stands".to_owned(),
        time_title: "time since the first event (ms)".to_owned(),
        times: report.times_us.iter().map(|&t_us| t_us as f64 / 1000.0).collect(),
        chance: 1.0 / CLASSES.len() as f64,
        curves,
    });
    (!is_empty).then(|| std::iter::once(curves).chain(matrices).collect())
}

/// The line below the title of a matrix.
fn accuracy(judged: &Judged) -> String {
    let std = judged.accuracy.std.map_or_else(String::new, |std| format!(" \u{b1} {:.2}", 100.0 * std));
    let (low, high) = judged.interval_95;
    let seeds = if judged.trainings == 1 { "seed" } else { "seeds" };
    format!(
        "{:.2}{std} % (95 %: {:.1} to {:.1}), {} {seeds}, {} recordings",
        100.0 * judged.accuracy.mean,
        100.0 * low,
        100.0 * high,
        judged.trainings,
        grouped(judged.recordings)
    )
}
