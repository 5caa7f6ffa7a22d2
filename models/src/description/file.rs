//! A description file as it is written: tables and keys typed and in range, nothing resolved yet.
//!
//! Enters: text. Leaves: a [`File`], with `None` for whatever was reported as a problem.

use std::ops::RangeInclusive;

use meissner_engine::{Candidates, Fraction, GraphRule, Lifetime, Network, Normalisation, Position, Reach};
use meissner_kernels::{Activation, SplineConv};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

use super::problem::{ProblemKind, Problems};
use super::table::{Given, Lines, Table, integer, shown};

/// The input of a network: the name that layers refer to it by.
pub(super) const EVENTS: &str = "events";
/// Length of the window where a file does not say: 150 ms.
const DEFAULT_SPAN_US: i64 = 150_000;
/// Most events of a window where a file does not say.
const DEFAULT_CAPACITY: i64 = 32_768;
/// What the engine accepts.
const SPANS_US: RangeInclusive<i64> = 1..=Network::LONGEST_SPAN_US;
const CAPACITIES: RangeInclusive<i64> = 1..=Network::LARGEST_CAPACITY as i64;
const NEIGHBOURS: RangeInclusive<i64> = 1..=Network::MOST_NEIGHBOURS as i64;
/// What the kernels accept.
const CHANNELS: RangeInclusive<i64> = 1..=SplineConv::MOST_CHANNELS as i64;
const KERNELS: RangeInclusive<i64> = 1..=SplineConv::LARGEST_KERNEL as i64;
/// More layers than anyone writes; keeps drawings and searches small.
const MOST_LAYERS: usize = 1024;
/// Longest name of a network, a layer or an output.
const LONGEST_NAME: usize = 80;

/// A file's tables.
#[derive(Debug)]
pub(super) struct File {
    pub(super) name: String,
    pub(super) span_us: i64,
    pub(super) capacity: usize,
    pub(super) normalisation: Normalisation,
    pub(super) graph: Option<GraphRule>,
    pub(super) scale: Option<f32>,
    pub(super) layers: Vec<FileLayer>,
    pub(super) outputs: Option<Given<Vec<String>>>,
    pub(super) unit: String,
}

/// A `[[layer]]` table.
#[derive(Debug)]
pub(super) struct FileLayer {
    pub(super) name: String,
    pub(super) line: usize,
    /// What it reads; `None` is the layer before it.
    pub(super) from: Option<Given<String>>,
    /// Prefix of its tensors.
    pub(super) weights: String,
    pub(super) kind: FileKind,
}

/// What a `[[layer]]` table says beyond its name and input.
#[derive(Debug)]
pub(super) enum FileKind {
    Spline {
        channels: Option<usize>,
        kernel: Option<[usize; 3]>,
        skip: Option<Given<String>>,
        root: bool,
        bias: bool,
        norm: bool,
        elu: bool,
    },
    Pool {
        cell: Option<[Fraction; 2]>,
        time: Option<Given<Fraction>>,
        position: Position,
        scale: Option<f32>,
    },
    Readout {
        grid: Option<[usize; 2]>,
    },
    Dense {
        outputs: Option<usize>,
        bias: bool,
        activation: Activation,
    },
    /// A kind that was reported.
    Unknown,
}

/// Reads `text`; whatever is wrong goes to `problems`. `None` where it is not TOML.
pub(super) fn read(text: &str, problems: &mut Problems) -> Option<File> {
    let lines = Lines::new(text);
    let (document, errors) = DeTable::parse_recoverable(text);
    for error in &errors {
        let line = error.span().map_or(1, |span| lines.of(span.start));
        problems.add(line, None, ProblemKind::Syntax(error.message().to_owned()));
    }
    if !errors.is_empty() {
        return None;
    }
    let mut root = Table::new(document.get_ref(), &lines, 1, None, problems);
    let is_table = |value: &DeValue<'_>| value.is_table().then_some(());
    let network = root.required("network", "a table with the network's name", is_table);
    let graph = root.required("graph", "a table with the rule of the event graph", is_table);
    let output = root.required("output", "a table with the prediction's names and unit", is_table);
    let layers = root.required("layer", "tables [[layer]]", |value| value.is_array().then_some(()));
    root.finish();

    let mut reader = FileReader { lines: &lines, normalisation: Normalisation::Fixed, problems };
    let table = |key: &str| document.get_ref().get(key).and_then(|v| Some((v.get_ref().as_table()?, v)));
    let mut file = File {
        name: String::new(),
        span_us: DEFAULT_SPAN_US,
        capacity: DEFAULT_CAPACITY as usize,
        normalisation: Normalisation::Fixed,
        graph: None,
        scale: None,
        layers: Vec::new(),
        outputs: None,
        unit: String::new(),
    };
    if let (Some(_), Some((network, at))) = (network, table("network")) {
        reader.network(network, at, &mut file);
    }
    if let (Some(_), Some((graph, at))) = (graph, table("graph")) {
        reader.graph(graph, at, &mut file);
    }
    if let (Some(_), Some((output, at))) = (output, table("output")) {
        reader.output(output, at, &mut file);
    }
    if layers.is_some()
        && let Some(layers) = document.get_ref().get("layer").and_then(|v| v.get_ref().as_array())
    {
        for layer in layers.iter().take(MOST_LAYERS) {
            file.layers.extend(reader.layer(layer));
        }
        if let Some(more) = layers.get(MOST_LAYERS) {
            let kind = ProblemKind::Value {
                key: "layer",
                expected: format!("at most {MOST_LAYERS} layers"),
                found: layers.len().to_string(),
            };
            reader.problems.add(lines.of(more.span().start), None, kind);
        }
    }
    Some(file)
}

struct FileReader<'a> {
    lines: &'a Lines,
    normalisation: Normalisation,
    problems: &'a mut Problems,
}

impl FileReader<'_> {
    fn table<'t, 'i>(
        &'t mut self,
        table: &'t DeTable<'i>,
        at: &Spanned<DeValue<'i>>,
        layer: Option<String>,
    ) -> Table<'t, 'i> {
        Table::new(table, self.lines, self.lines.of(at.span().start), layer, self.problems)
    }

    fn network(&mut self, table: &DeTable<'_>, at: &Spanned<DeValue<'_>>, file: &mut File) {
        let mut table = self.table(table, at, None);
        if let Some(name) = table.required("name", NAME, name) {
            file.name = name.value;
        }
        file.span_us = table.integer("span_us", SPANS_US, Some(DEFAULT_SPAN_US)).unwrap_or(DEFAULT_SPAN_US);
        file.capacity = table
            .integer("capacity", CAPACITIES, Some(DEFAULT_CAPACITY))
            .unwrap_or(DEFAULT_CAPACITY) as usize;
        let choices = [("fixed", Normalisation::Fixed), ("per-graph", Normalisation::PerGraph)];
        file.normalisation = table
            .choice("normalisation", &choices, Some(Normalisation::Fixed))
            .unwrap_or(Normalisation::Fixed);
        table.finish();
        self.normalisation = file.normalisation;
    }

    fn graph(&mut self, table: &DeTable<'_>, at: &Spanned<DeValue<'_>>, file: &mut File) {
        let normalisation = self.normalisation;
        let mut table = self.table(table, at, None);
        let reach = match table.choice("kind", &[("knn", true), ("radius", false)], None) {
            Some(true) => table.integer("k", NEIGHBOURS, None).map(|k| Reach::Knn { k: k as usize }),
            Some(false) => {
                let r = table.positive("r", |r| (r * r).is_finite());
                let max = table.integer("max", NEIGHBOURS, None);
                r.zip(max).map(|(r, max)| Reach::Radius { r, max: max as usize })
            }
            None => {
                // Without a kind there is no telling which of these keys belong.
                table.optional("k", "", |_| Some(()));
                table.optional("r", "", |_| Some(()));
                table.optional("max", "", |_| Some(()));
                None
            }
        };
        let candidates = match table.choice("candidates", &[("all", false), ("past", true)], None) {
            Some(true) => {
                let lifetimes = [("window", Lifetime::Window), ("frozen", Lifetime::Frozen)];
                table.choice("lifetime", &lifetimes, None).map(Candidates::Past)
            }
            past_unknown => {
                let lifetime = table.optional("lifetime", "", |_| Some(()));
                if let (Some(_), Some(lifetime)) = (past_unknown, lifetime) {
                    let with = "candidates = \"past\"";
                    table.report(lifetime.line, ProblemKind::Inapplicable { key: "lifetime", with });
                }
                past_unknown.map(|_| Candidates::All)
            }
        };
        if normalisation == Normalisation::PerGraph
            && candidates == Some(Candidates::Past(Lifetime::Frozen))
            && let Some(line) = table.line_of("lifetime")
        {
            let expected = "\"window\" with normalisation = \"per-graph\", which can change every row";
            table.refuse(line, "lifetime", expected, "\"frozen\"".to_owned());
        }
        file.scale = scale(&mut table, normalisation);
        table.finish();
        file.graph = reach.zip(candidates).map(|(reach, candidates)| GraphRule { reach, candidates });
    }

    fn output(&mut self, table: &DeTable<'_>, at: &Spanned<DeValue<'_>>, file: &mut File) {
        let mut table = self.table(table, at, None);
        let expected = "the predicted values' names, such as [\"roll\", \"pitch\"]";
        file.outputs = table.required("names", expected, |value| {
            let names: Option<Vec<String>> = value.as_array()?.iter().map(|v| name(v.get_ref())).collect();
            names.filter(|names| !names.is_empty())
        });
        if let Some(unit) = table.required("unit", "the predicted values' unit, such as \"rad\"", name) {
            file.unit = unit.value;
        }
        table.finish();
    }

    fn layer(&mut self, value: &Spanned<DeValue<'_>>) -> Option<FileLayer> {
        let line = self.lines.of(value.span().start);
        let Some(contents) = value.get_ref().as_table() else {
            let kind = ProblemKind::Value {
                key: "layer",
                expected: "a table [[layer]]".to_owned(),
                found: shown(value.get_ref()),
            };
            self.problems.add(line, None, kind);
            return None;
        };
        let normalisation = self.normalisation;
        let known_name = contents.get("name").and_then(|v| name(v.get_ref()));
        let mut table = self.table(contents, value, known_name);
        let layer_name = table.required("name", NAME, name);
        if let Some(given) = layer_name.as_ref().filter(|given| given.value == EVENTS) {
            let expected = "another name than that of the network's input";
            table.refuse(given.line, "name", expected, format!("{EVENTS:?}"));
        }
        let kinds = [("spline", 0), ("pool", 1), ("readout", 2), ("dense", 3)];
        let kind = table.choice("kind", &kinds, None);
        let from = table.optional("from", "the name of a layer, or \"events\"", name);
        let kind = match kind {
            Some(0) => spline(&mut table),
            Some(1) => pool(&mut table, normalisation),
            Some(2) => FileKind::Readout { grid: grid(&mut table) },
            Some(3) => dense(&mut table),
            _ => FileKind::Unknown,
        };
        let name_or_empty = layer_name.map(|given| given.value).unwrap_or_default();
        let weights = match kind {
            FileKind::Spline { .. } | FileKind::Dense { .. } => {
                table.optional("weights", "the prefix of the layer's tensor names", name)
            }
            _ => None,
        };
        // Of an unknown kind there is no telling which keys belong.
        if !matches!(kind, FileKind::Unknown) {
            table.finish();
        }
        let weights = weights.map_or_else(|| name_or_empty.clone(), |given| given.value);
        Some(FileLayer { name: name_or_empty, line, from, weights, kind })
    }
}

fn spline(table: &mut Table<'_, '_>) -> FileKind {
    let expected = "a kernel size from 1 to 64, or two or three of them along x, y (and t)";
    FileKind::Spline {
        channels: table.integer("channels", CHANNELS, None).map(|v| v as usize),
        kernel: table.required("kernel", expected, kernel).map(|given| given.value),
        skip: table.optional("skip", "the name of a layer, or \"events\"", name),
        root: table.boolean("root", false),
        bias: table.boolean("bias", false),
        norm: table.boolean("norm", true),
        elu: table.boolean("elu", true),
    }
}

fn pool(table: &mut Table<'_, '_>, normalisation: Normalisation) -> FileKind {
    let expected = "two fractions of the sensor along x and y, such as [\"16/346\", \"12/260\"]";
    let cell = table.required("cell", expected, |value| {
        let cell = value.as_array()?;
        let read = |i: usize| fraction(cell.get(i)?.get_ref());
        if cell.len() == 2 { Some([read(0)?, read(1)?]) } else { None }
    });
    FileKind::Pool {
        cell: cell.map(|given| given.value),
        time: table.optional("time", "a fraction of the span, such as \"1/3\"", fraction),
        position: table
            .choice(
                "position",
                &[("mean", Position::Mean), ("centre", Position::Centre)],
                Some(Position::Mean),
            )
            .unwrap_or(Position::Mean),
        scale: scale(table, normalisation),
    }
}

fn grid(table: &mut Table<'_, '_>) -> Option<[usize; 2]> {
    let expected = "columns and rows of the grid, such as [4, 4], at most 65536 cells";
    let grid = table.required("grid", expected, |value| {
        let grid = value.as_array()?;
        let read = |i: usize| integer(grid.get(i)?.get_ref()).filter(|v| (1..=1 << 16).contains(v));
        let [columns, rows] = if grid.len() == 2 { [read(0)?, read(1)?] } else { return None };
        (columns * rows <= 1 << 16).then_some([columns as usize, rows as usize])
    });
    grid.map(|given| given.value)
}

fn dense(table: &mut Table<'_, '_>) -> FileKind {
    let activations = [
        ("identity", Activation::Identity),
        ("relu", Activation::Relu),
        ("elu", Activation::Elu),
        ("sigmoid", Activation::Sigmoid),
        ("tanh", Activation::Tanh),
    ];
    FileKind::Dense {
        outputs: table.integer("outputs", CHANNELS, None).map(|v| v as usize),
        bias: table.boolean("bias", true),
        activation: table.choice("activation", &activations, Some(Activation::Identity)).unwrap_or_default(),
    }
}

/// The scale of a level's edge attributes; a placeholder where every graph has its own.
fn scale(table: &mut Table<'_, '_>, normalisation: Normalisation) -> Option<f32> {
    if normalisation == Normalisation::Fixed {
        // As f32 it must still be finite and above 0.
        let fits = |scale: f64| scale as f32 > 0.0 && (scale as f32).is_finite();
        return table.positive("scale", fits).map(|scale| scale as f32);
    }
    if let Some(given) = table.optional("scale", "", |_| Some(())) {
        let with = "normalisation = \"fixed\": per graph it is the largest difference over its edges";
        table.report(given.line, ProblemKind::Inapplicable { key: "scale", with });
    }
    Some(1.0)
}

const NAME: &str = "a name of 1 to 80 printable characters";

fn name(value: &DeValue<'_>) -> Option<String> {
    let name = value.as_str()?;
    let fits = (1..=LONGEST_NAME).contains(&name.chars().count()) && !name.chars().any(char::is_control);
    fits.then(|| name.to_owned())
}

fn fraction(value: &DeValue<'_>) -> Option<Fraction> {
    value.as_str()?.parse().ok()
}

fn kernel(value: &DeValue<'_>) -> Option<[usize; 3]> {
    let size = |v: &DeValue<'_>| integer(v).filter(|v| KERNELS.contains(v)).map(|v| v as usize);
    match value {
        DeValue::Array(sizes) => {
            let sizes: Vec<usize> = sizes.iter().map(|v| size(v.get_ref())).collect::<Option<_>>()?;
            match sizes[..] {
                [x, y] => Some([x, y, 1]),
                [x, y, t] => Some([x, y, t]),
                _ => None,
            }
        }
        _ => size(value).map(|k| [k; 3]),
    }
}
