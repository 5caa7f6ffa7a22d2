//! A description file as it is written: values are typed and in range, references are not resolved.
//!
//! Enters: a [`Document`]. Leaves: a [`File`], with `None` for whatever was reported as a problem.

use std::ops::RangeInclusive;

use meissner_engine::{Candidates, Fraction, GraphRule, Lifetime, Network, Normalisation, Position, Reach};
use meissner_kernels::{Activation, SplineConv};
use toml::de::DeValue;

use super::convolution::{ConvolutionKind, KINDS, SPLINE};
use super::document::{Document, LAYER, NAME, name};
use super::frames;
use super::layer::activation_word;
use super::problem::Problems;
use super::table::{Given, Table, integer};

/// The input of a network: the name that layers refer to it by.
pub(super) const EVENTS: &str = "events";
/// The tables of a frame network that reads the readout.
const HEAD: &str = "head";
/// Default length of the window: 150 ms.
const DEFAULT_SPAN_US: i64 = 150_000;
/// Default of the most events of a window.
const DEFAULT_CAPACITY: i64 = 32_768;
/// The ranges that the engine accepts.
const SPANS_US: RangeInclusive<i64> = 1..=Network::LONGEST_SPAN_US;
const CAPACITIES: RangeInclusive<i64> = 1..=Network::LARGEST_CAPACITY as i64;
const NEIGHBOURS: RangeInclusive<i64> = 1..=Network::MOST_NEIGHBOURS as i64;
/// The ranges that the kernels accept.
const CHANNELS: RangeInclusive<i64> = 1..=SplineConv::MOST_CHANNELS as i64;

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
    /// The layers that read the readout in place of dense layers; empty for a network with dense layers.
    pub(super) head: Vec<frames::FileLayer>,
    pub(super) outputs: Option<Given<Vec<String>>>,
    pub(super) unit: String,
}

/// A `[[layer]]` table.
#[derive(Debug)]
pub(super) struct FileLayer {
    pub(super) name: String,
    pub(super) line: usize,
    /// Its input; `None` is the layer before it.
    pub(super) from: Option<Given<String>>,
    /// Prefix of its tensors.
    pub(super) weights: String,
    pub(super) kind: FileKind,
}

/// The keys of a `[[layer]]` table that depend on its kind.
#[derive(Debug)]
pub(super) enum FileKind {
    Block {
        conv: Option<ConvolutionKind>,
        /// The word for its convolution.
        word: &'static str,
        channels: Option<usize>,
        skip: Option<Given<String>>,
        norm: bool,
    },
    Pool {
        cell: Option<[Fraction; 2]>,
        time: Option<Given<Fraction>>,
        position: Position,
        scale: Option<f32>,
    },
    Readout {
        grid: Option<[usize; 2]>,
        by_time: bool,
    },
    Dense {
        outputs: Option<usize>,
        bias: bool,
        activation: Activation,
    },
    /// A kind or a convolution that was reported.
    Unknown,
}

/// Reads `document`; whatever is wrong goes to `problems`.
pub(super) fn read(document: &Document<'_>, problems: &mut Problems) -> File {
    let [network, graph, output] = document.tables(
        [
            ("network", "a table with the network's name"),
            ("graph", "a table with the rule of the event graph"),
            ("output", "a table with the prediction's names and unit"),
        ],
        &[HEAD],
        problems,
    );
    let mut file = File {
        name: String::new(),
        span_us: DEFAULT_SPAN_US,
        capacity: DEFAULT_CAPACITY as usize,
        normalisation: Normalisation::Fixed,
        graph: None,
        scale: None,
        layers: Vec::new(),
        head: Vec::new(),
        outputs: None,
        unit: String::new(),
    };
    if let Some(table) = network {
        file.network(document.open(table, problems));
    }
    if let Some(table) = graph {
        file.graph(document.open(table, problems));
    }
    let output = document.output(output, problems);
    (file.outputs, file.unit) = (output.names, output.unit);
    for table in document.layers(LAYER, problems) {
        let (layer, name) = document.layer(table, EVENTS, problems);
        file.layers.push(read_layer(layer, name, table.line(), file.normalisation));
    }
    for table in document.layers(HEAD, problems) {
        let (layer, name) = document.layer(table, EVENTS, problems);
        file.head.push(frames::read_layer(layer, name, table.line(), "the readout"));
    }
    file
}

impl File {
    fn network(&mut self, mut table: Table<'_, '_>) {
        if let Some(name) = table.required("name", NAME, name) {
            self.name = name.value;
        }
        self.span_us = table.integer("span_us", SPANS_US, Some(DEFAULT_SPAN_US)).unwrap_or(DEFAULT_SPAN_US);
        self.capacity = table
            .integer("capacity", CAPACITIES, Some(DEFAULT_CAPACITY))
            .unwrap_or(DEFAULT_CAPACITY) as usize;
        let choices = [("fixed", Normalisation::Fixed), ("per-graph", Normalisation::PerGraph)];
        self.normalisation = table
            .choice("normalisation", &choices, Some(Normalisation::Fixed))
            .unwrap_or(Normalisation::Fixed);
        table.finish();
    }

    fn graph(&mut self, mut table: Table<'_, '_>) {
        let normalisation = self.normalisation;
        let reach = match table.choice("kind", &[("knn", true), ("radius", false)], None) {
            Some(true) => table.size("k", NEIGHBOURS, None).map(|k| Reach::Knn { k }),
            Some(false) => {
                let r = table.positive("r", |r| (r * r).is_finite());
                let max = table.size("max", NEIGHBOURS, None);
                r.zip(max).map(|(r, max)| Reach::Radius { r, max })
            }
            None => {
                // The keys of an unknown kind are unknown.
                table.ignore(&["k", "r", "max"]);
                None
            }
        };
        let candidates = match table.choice("candidates", &[("all", false), ("past", true)], None) {
            Some(true) => {
                let lifetimes = [("window", Lifetime::Window), ("frozen", Lifetime::Frozen)];
                table.choice("lifetime", &lifetimes, None).map(Candidates::Past)
            }
            Some(false) => {
                table.inapplicable("lifetime", "candidates = \"past\"");
                Some(Candidates::All)
            }
            None => {
                table.ignore(&["lifetime"]);
                None
            }
        };
        if normalisation == Normalisation::PerGraph
            && candidates == Some(Candidates::Past(Lifetime::Frozen))
            && let Some(line) = table.line_of("lifetime")
        {
            let expected = "\"window\" with normalisation = \"per-graph\", which can change every row";
            table.refuse(line, "lifetime", expected, "\"frozen\"".to_owned());
        }
        self.scale = scale(&mut table, normalisation);
        table.finish();
        self.graph = reach.zip(candidates).map(|(reach, candidates)| GraphRule { reach, candidates });
    }
}

fn read_layer(
    mut table: Table<'_, '_>,
    layer_name: String,
    line: usize,
    normalisation: Normalisation,
) -> FileLayer {
    let kinds = [("block", 0), (SPLINE, 1), ("pool", 2), ("readout", 3), ("dense", 4)];
    let kind = table.choice("kind", &kinds, None);
    let from = table.optional("from", "the name of a layer, or \"events\"", name);
    let kind = match kind {
        Some(0) => block(&mut table, None),
        Some(1) => block(&mut table, Some(SPLINE)),
        Some(2) => pool(&mut table, normalisation),
        Some(3) => FileKind::Readout { grid: grid(&mut table), by_time: table.boolean("by_time", false) },
        Some(4) => dense(&mut table),
        _ => FileKind::Unknown,
    };
    let weights = match kind {
        FileKind::Block { .. } | FileKind::Dense { .. } => {
            table.optional("weights", "the prefix of the layer's tensor names", name)
        }
        _ => None,
    };
    // The keys of an unknown kind are unknown.
    if !matches!(kind, FileKind::Unknown) {
        table.finish();
    }
    let weights = weights.map_or_else(|| layer_name.clone(), |given| given.value);
    FileLayer { name: layer_name, line, from, weights, kind }
}

/// A block with the convolution `word`, or the one that the table chooses.
fn block(table: &mut Table<'_, '_>, word: Option<&'static str>) -> FileKind {
    let words = KINDS.map(|(word, keys)| (word, (word, keys)));
    let chosen = match word {
        Some(word) => KINDS.into_iter().find(|&(known, _)| known == word),
        None => table.choice("conv", &words, None),
    };
    // Without a convolution it is unknown which keys belong to the table.
    let Some((word, keys)) = chosen else { return FileKind::Unknown };
    FileKind::Block {
        channels: table.size("channels", CHANNELS, None),
        conv: keys(table),
        word,
        skip: table.optional("skip", "the name of a layer, or \"events\"", name),
        norm: table.boolean("norm", true),
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
    let activations =
        [Activation::Identity, Activation::Relu, Activation::Elu].map(|kind| (activation_word(kind), kind));
    FileKind::Dense {
        outputs: table.size("outputs", CHANNELS, None),
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
    table.inapplicable(
        "scale",
        "normalisation = \"fixed\": per graph it is the largest difference over its edges",
    );
    Some(1.0)
}

fn fraction(value: &DeValue<'_>) -> Option<Fraction> {
    value.as_str()?.parse().ok()
}
