//! Predictions as rows of a table, and the headings of the table.

use std::path::Path;

use meissner_models::systems::contact_area::{Centroid, ContactReport};
use meissner_models::systems::slip;
use meissner_run::answer::Answer;
use meissner_run::provenance::ModelCard;
use meissner_run::run::{ElectrodePrediction, PicturePrediction, Prediction};
use meissner_run::text::grouped;
use meissner_run::training::Output;

use crate::text::cell;

/// Maximum number of columns of values: a line of 80 characters has room for so many.
const MAX_COLUMNS: usize = 2;
/// Largest number of columns of values over electrodes.
const MAX_ELECTRODE_COLUMNS: usize = 3;
/// Width of a column of values.
const WIDTH: usize = 11;
/// The heading of the column that states how unlike a window or frame is to those of the training.
const UNLIKE: &str = "unlike";
/// The mark before a value outside the range of the training, and of input unlike the training's.
pub(super) const OUTSIDE: &str = "*";

/// The table of a kind of input.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum TableKind {
    Events,
    Frames,
    Electrodes,
    /// With the columns of a baseline, or without.
    Pictures(bool),
    Reports,
}

/// The names of a network's values.
pub(super) struct Columns {
    kind: TableKind,
    /// Whether there are several inputs, each of which is named.
    several: bool,
    /// Whether the size of the input is known, so that the finished part can be shown.
    sized: bool,
    names: Vec<String>,
    outputs: Vec<Output>,
    has_classes: bool,
    classes: Vec<String>,
    /// Width of the column of a class over electrodes.
    class_width: usize,
}

/// A row before its conversion to text, because few of the predictions on a file are shown.
pub(super) struct Row {
    /// The part of the input that had been taken.
    pub(super) taken: u64,
    values: Shown,
    figures: Figures,
}

/// The values that a row shows.
enum Shown {
    Nothing,
    /// Number and probability of the class.
    Class(usize, f32),
    /// The first values, and their total number.
    Values([f32; MAX_COLUMNS], usize),
}

/// The other columns, by kind of input.
enum Figures {
    Events {
        time_ms: Option<f64>,
        nodes: u64,
        unlike: Option<f32>,
        rows: u64,
        update_us: f64,
    },
    Frames {
        time_ms: f64,
        unlike: Option<f32>,
        events: u64,
        update_us: f64,
    },
    Report {
        input: usize,
        times_ms: [f64; 3],
        unlike: Option<f32>,
        state: &'static str,
        waited_us: f64,
    },
    /// The complete row, which is always shown.
    Text(String),
}

impl Row {
    fn of_text(taken: u64, text: String) -> Self {
        Self { taken, values: Shown::Nothing, figures: Figures::Text(text) }
    }
}

impl Columns {
    pub(super) fn new(kind: TableKind, card: &ModelCard, inputs: usize, sized: bool) -> Self {
        let (names, outputs) = (card.headings(), card.outputs.clone());
        let has_classes = card.classes.is_some();
        let classes = card.classes.clone().unwrap_or_default();
        let longest = classes.iter().map(|class| slip::word(class, &classes).len()).max();
        let class_width = longest.unwrap_or(0).max(8);
        Self { kind, several: inputs > 1, sized, names, outputs, has_classes, classes, class_width }
    }

    /// The headings of the table.
    pub(super) fn headings(&self) -> String {
        let most = if self.kind == TableKind::Electrodes { MAX_ELECTRODE_COLUMNS } else { MAX_COLUMNS };
        let names = || row_of(self.names.iter().take(most).map(|name| format!("  {name:>WIDTH$}")));
        let values = || {
            if self.has_classes {
                format!("  {:>WIDTH$}  {:>WIDTH$}", "class", "probability")
            } else {
                names()
            }
        };
        let done = if self.sized { "done" } else { "taken" };
        match self.kind {
            TableKind::Events => {
                let (time, update) = ("time (ms)", "update (us)");
                let values = values();
                format!(
                    "{done:>5}  {time:>9}{values}  {UNLIKE:>6}  {:>6}  {:>7}  {update:>11}",
                    "nodes", "rows"
                )
            }
            TableKind::Frames => {
                let (time, update) = ("time (ms)", "update (us)");
                format!("{done:>5}  {time:>13}{}  {UNLIKE:>6}  {:>8}  {update:>11}", values(), "events")
            }
            TableKind::Electrodes => {
                let values = if self.has_classes {
                    let width = self.class_width;
                    format!("  {:>width$}  {:>11}  {:>width$}", "class", "probability", "decision")
                } else {
                    names()
                };
                format!("{:>7}  {:>9}{values}  {UNLIKE:>6}  {:>11}", "line", "time (s)", "update (us)")
            }
            TableKind::Pictures(baseline) => {
                let columns = "area (mm2) force (N) median (N) centroid (px) unlike";
                let (area, centroid) = ("baseline area (mm2)", "centroid (px)");
                let baseline = if baseline { format!(" {area:>19} {centroid:>13}") } else { String::new() };
                format!("{:<15} {columns}{baseline} {:>11}", "image", "update (us)")
            }
            TableKind::Reports => {
                let (state, behind, age, waited) = ("state", "behind ms", "age ms", "waited us");
                let (values, input) = (values(), if self.several { " in " } else { "" });
                format!(
                    "{input}{:>9}{values} {UNLIKE:>6}  {state:>6}  {behind:>9}  {age:>6}  {waited:>9}",
                    "time (ms)"
                )
            }
        }
    }

    /// The row of `prediction`.
    pub(super) fn row(&self, prediction: &Prediction<'_>) -> Row {
        match prediction {
            Prediction::Events(p) => {
                let time_ms = p.elapsed_us.map(|us| us as f64 / 1e3);
                let (nodes, rows) = (p.nodes as u64, p.rows.iter().sum());
                let figures =
                    Figures::Events { time_ms, nodes, unlike: p.unlike, rows, update_us: p.update_us };
                Row { taken: p.taken, values: self.values(p.value.0, p.answer.as_ref()), figures }
            }
            Prediction::Frames(p) => {
                let values = self.values(&means(p.value.0, self.names.len()), p.answer.as_ref());
                let (time_ms, unlike) = (p.elapsed_us as f64 / 1e3, p.unlike);
                let (events, update_us) = (p.events, p.update_us);
                let figures = Figures::Frames { time_ms, unlike, events, update_us };
                Row { taken: p.taken, values, figures }
            }
            Prediction::Report(p) => {
                let times_ms = [p.elapsed_us as f64, p.behind_us as f64, p.age_us].map(|us| us / 1e3);
                let (input, unlike, state, waited_us) = (p.input, p.unlike, p.state.name(), p.waited_us);
                let figures = Figures::Report { input, times_ms, unlike, state, waited_us };
                Row { taken: p.number, values: self.values(p.value.0, p.answer.as_ref()), figures }
            }
            Prediction::Electrodes(p) => Row::of_text(p.line, self.electrodes(p)),
            Prediction::Picture(p) => Row::of_text(p.taken, picture(p)),
            _ => Row::of_text(0, String::new()),
        }
    }

    /// The text of `row`. `total` is the size of the input.
    pub(super) fn text(&self, row: &Row, total: Option<u64>) -> String {
        let part = |total: u64| format!("{} %", row.taken * 100 / total.max(1));
        let done = || total.map_or_else(|| short(row.taken), part);
        let values = match row.values {
            Shown::Nothing => String::new(),
            Shown::Class(class, probability) => {
                format!("  {:>WIDTH$}  {probability:>WIDTH$.4}", self.classes[class])
            }
            Shown::Values(values, count) => self.columns(&values[..count], MAX_COLUMNS),
        };
        match &row.figures {
            Figures::Text(text) => text.clone(),
            &Figures::Events { time_ms, nodes, unlike, rows, update_us } => {
                let time = cell(time_ms, |ms| format!("{ms:.3}"));
                let (done, nodes, rows, unlike) = (done(), grouped(nodes), grouped(rows), marked(unlike));
                format!("{done:>5}  {time:>9}{values}  {unlike:>6}  {nodes:>6}  {rows:>7}  {update_us:>11.1}")
            }
            &Figures::Frames { time_ms, unlike, events, update_us } => {
                let (done, events, unlike) = (done(), grouped(events), marked(unlike));
                format!("{done:>5}  {time_ms:>13.3}{values}  {unlike:>6}  {events:>8}  {update_us:>11.1}")
            }
            &Figures::Report { input, times_ms: [time, behind, age], unlike, state, waited_us } => {
                let input = if self.several { format!("{input:>3} ") } else { String::new() };
                let unlike = marked(unlike);
                format!(
                    "{input}{time:>9.3}{values} {unlike:>6}  {state:>6}  {behind:>9.3}  {age:>6.3}  {waited_us:>9.1}"
                )
            }
        }
    }

    fn electrodes(&self, p: &ElectrodePrediction<'_>) -> String {
        let time = cell(p.time_s, |s| format!("{s:.3}"));
        let values = match p.class.zip(p.probabilities) {
            Some((class, probabilities)) => {
                let probability = probabilities.0.iter().copied().fold(0.0, f32::max);
                let word = |class| slip::word(class, &self.classes);
                let (class, decision) = (word(class), p.decision.map_or("-", word));
                let width = self.class_width;
                format!("  {class:>width$}  {probability:>11.4}  {decision:>width$}")
            }
            None => self.columns(p.value.0, MAX_ELECTRODE_COLUMNS),
        };
        format!("{:>7}  {time:>9}{values}  {:>6}  {:>11.1}", p.line, marked(p.unlike), p.update_us)
    }

    /// The part of `values` that fits in a row.
    fn values(&self, values: &[f32], answer: Option<&Answer<'_>>) -> Shown {
        match answer.map(|answer| (answer, self.classes.iter().position(|class| class == answer.class))) {
            Some((answer, Some(class))) => Shown::Class(class, answer.probability()),
            _ if self.has_classes => Shown::Nothing,
            _ => {
                let first = std::array::from_fn(|i| values.get(i).copied().unwrap_or(0.0));
                Shown::Values(first, values.len().min(MAX_COLUMNS))
            }
        }
    }

    /// The first values in units for people; those outside the training's range are marked.
    fn columns(&self, values: &[f32], most: usize) -> String {
        let cells = self.outputs.iter().zip(values).take(most).map(|(output, &value)| {
            let mark = if output.is_outside(value) { OUTSIDE } else { "" };
            let digits = if output.is_in_radians() { 4 } else { 6 };
            let value = format!("{mark}{:.digits$}", output.shown(value.into()));
            format!("  {value:>WIDTH$}")
        });
        row_of(cells)
    }

    /// A line about the values that are not shown; `None` if all are.
    pub(super) fn left_out(&self) -> Option<String> {
        let all = self.names.len();
        let some = !self.has_classes && all > MAX_COLUMNS;
        let some = some && matches!(self.kind, TableKind::Events | TableKind::Reports);
        some.then(|| format!("({MAX_COLUMNS} of {all} outputs shown; --json has all of them)"))
    }
}

/// How unlike a window or frame is to those of the training, marked if it is.
fn marked(unlike: Option<f32>) -> String {
    cell(unlike, |unlike| {
        let mark = if unlike > 1.0 { OUTSIDE } else { "" };
        let digits = usize::from(unlike < 99.95);
        format!("{mark}{unlike:.digits$}")
    })
}

/// A count in at most five characters, up to 10^13.
fn short(count: u64) -> String {
    let steps = [(100_000, 1, ""), (10_000_000, 1_000, "k"), (10_000_000_000, 1_000_000, "M")];
    let step = steps.into_iter().find(|&(below, ..)| count < below).unwrap_or((0, 1_000_000_000, "G"));
    format!("{}{}", count / step.1, step.2)
}

fn row_of(cells: impl Iterator<Item = String>) -> String {
    cells.collect::<Vec<_>>().concat()
}

fn picture(p: &PicturePrediction<'_>) -> String {
    let name = p.image.map(|image| Path::new(image).file_name().unwrap_or_default().to_string_lossy());
    let name = name.or(p.picture.map(|number| number.to_string().into())).unwrap_or_default();
    let baseline = p.baseline.map_or_else(String::new, |baseline| {
        format!(" {:>19.3} {:>13}", baseline.area_mm2, place(baseline.centroid))
    });
    let ContactReport { area_mm2: area, force_n: force, median_force_n: median, centroid, .. } = p.contact;
    let (centroid, unlike, update_us) = (place(centroid), marked(p.unlike), p.update_us);
    format!(
        "{name:<15} {area:>10.3} {force:>9.4} {median:>10.4} {centroid:>13} {unlike:>6}{baseline} {update_us:>11.1}"
    )
}

fn place(centroid: Option<Centroid>) -> String {
    cell(centroid, |c| format!("{:.1}, {:.1}", c.x_px, c.y_px))
}

/// The first of `outputs` values, or for an image the means of the first channels.
fn means(values: &[f32], outputs: usize) -> Vec<f32> {
    let each = values.len() / outputs.max(1);
    let mean = |channel: &[f32]| channel.iter().map(|&v| f64::from(v)).sum::<f64>() / each as f64;
    values.chunks_exact(each.max(1)).take(MAX_COLUMNS).map(|channel| mean(channel) as f32).collect()
}
