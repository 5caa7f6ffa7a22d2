//! A description file in its written form: values are typed and in range, references are not
//! resolved.
//!
//! Input: the whole file's table. Output: a [`File`]; reported values are `None` or replaced.

use std::ops::RangeInclusive;

use meissner_engine::{
    Aggregation, Candidates, Fraction, GraphRule, Lifetime, Network, Normalisation, Position, Reach,
};
use meissner_kernels::{Activation, SplineConv};
use toml::de::DeValue;

use super::convolution::KINDS as CONVOLUTIONS;
use super::document::{HEAD, LAYER, ParsedLayer, layers, output};
use super::frames::{FrameKind, read_head};
use super::layer::{Cell, LayerKind, activations};
use super::table::{NAME, Spanned, Table, integer, name};
use super::{Description, filters};

/// The name by which layers refer to the input of a network.
pub(super) const EVENTS: &str = "events";
const REFERENCE: &str = "the name of a layer, or \"events\"";
const CELL: &str = "two fractions of the sensor along x and y, such as [\"16/346\", \"12/260\"]";
/// The kinds of layers. Each convolution is also a kind, short for a block with it.
const KINDS: [&str; 4 + CONVOLUTIONS.len()] =
    ["block", CONVOLUTIONS[0].0, CONVOLUTIONS[1].0, "pool", "readout", "dense"];
const DEFAULT_SPAN_US: i64 = 150_000;
const DEFAULT_CAPACITY: i64 = 32_768;
/// The ranges that the engine accepts.
const SPANS_US: RangeInclusive<i64> = 1..=Network::MAX_SPAN_US;
const CAPACITIES: RangeInclusive<i64> = 1..=Network::MAX_CAPACITY as i64;
const NEIGHBOURS: RangeInclusive<i64> = 1..=Network::MAX_NEIGHBOURS as i64;
/// The ranges that the kernels accept.
const CHANNELS: RangeInclusive<i64> = 1..=SplineConv::MAX_CHANNELS as i64;

#[derive(Debug)]
pub(super) struct File {
    /// The network without layers and names of outputs.
    pub(super) network: Description,
    pub(super) layers: Vec<ParsedLayer<FileKind>>,
    /// The layers that read the readout instead of dense layers; empty with dense layers.
    pub(super) head: Vec<ParsedLayer<FrameKind>>,
    pub(super) outputs: Option<Spanned<Vec<String>>>,
}

/// The keys of a `[[layer]]` table that depend on its kind.
#[derive(Debug)]
pub(super) struct FileKind {
    /// The computation; the number of grids of a readout is not known yet.
    pub(super) kind: LayerKind,
    /// Channels of a block, cells of a readout's grid, values of a dense layer; `None` if reported,
    /// and for a pooling.
    pub(super) outputs: Option<usize>,
    /// Line of the key `time` or `by_time`, if it changes the computation.
    pub(super) time: Option<usize>,
}

/// Reads the file whose table is `root`; every error becomes a problem.
pub(super) fn read(root: &mut Table<'_, '_>) -> File {
    let mut network = Description {
        name: String::new(),
        span_us: DEFAULT_SPAN_US,
        capacity: DEFAULT_CAPACITY as usize,
        normalisation: Normalisation::Fixed,
        place: None,
        graph: GraphRule { reach: Reach::Knn { k: 1 }, candidates: Candidates::All },
        scale: 1.0,
        filters: Vec::new(),
        layers: Vec::new(),
        head: Vec::new(),
        outputs: Vec::new(),
        units: Vec::new(),
    };
    if let Some(mut table) = root.table("network", "a table with the network's name") {
        network.name = table.value("name", NAME, None, name);
        network.span_us = table.integer("span_us", SPANS_US, Some(DEFAULT_SPAN_US));
        network.capacity = table.size("capacity", CAPACITIES, Some(DEFAULT_CAPACITY));
        let choices = [("fixed", Normalisation::Fixed), ("per-graph", Normalisation::PerGraph)];
        network.normalisation = table.option("normalisation", &choices);
        network.place = table.optional("place", CELL, cell).map(|given| given.value);
        table.finish();
    }
    if let Some(table) = root.table("graph", "a table with the rule of the event graph") {
        graph(table, &mut network);
    }
    network.filters = filters::read(root);
    let output = output(root);
    network.units = output.units;
    let layers = layers(root, LAYER, EVENTS, REFERENCE, &KINDS, |word, table, layer| {
        keys(word, table, layer, &network);
    });
    let head = read_head(root, HEAD, EVENTS);
    File { network, layers, head, outputs: output.names }
}

fn graph(mut table: Table<'_, '_>, network: &mut Description) {
    match table.choice("kind", &[("knn", true), ("radius", false)]) {
        Some(true) => network.graph.reach = Reach::Knn { k: table.size("k", NEIGHBOURS, None) },
        Some(false) => {
            let r = table.positive("r", |r| (r * r).is_finite());
            network.graph.reach = Reach::Radius { r, max: table.size("max", NEIGHBOURS, None) };
        }
        // The keys of an unknown kind are unknown.
        None => table.ignore(&["k", "r", "max"]),
    }
    match table.choice("candidates", &[("all", false), ("past", true)]) {
        Some(true) => {
            let lifetimes = [("window", Lifetime::Window), ("frozen", Lifetime::Frozen)];
            let lifetime = table.choice("lifetime", &lifetimes).unwrap_or(Lifetime::Window);
            network.graph.candidates = Candidates::Past(lifetime);
        }
        Some(false) => table.inapplicable("lifetime", "candidates = \"past\""),
        None => table.ignore(&["lifetime"]),
    }
    if network.normalisation == Normalisation::PerGraph
        && network.graph.candidates == Candidates::Past(Lifetime::Frozen)
        && let Some(line) = table.line_of("lifetime")
    {
        let expected = "\"window\" with normalisation = \"per-graph\", which can change every row";
        table.refuse(line, "lifetime", expected, "\"frozen\"");
    }
    network.scale = scale(&mut table, network.normalisation);
    table.finish();
}

fn keys(
    word: &'static str,
    mut table: Table<'_, '_>,
    layer: &mut ParsedLayer<FileKind>,
    network: &Description,
) {
    let (mut outputs, mut time) = (None, None);
    let kind = match word {
        "pool" => {
            time = table.line_of("time");
            pool(&mut table, network)
        }
        "readout" => {
            let grid = table.known(grid);
            let by_time = table.boolean("by_time", false);
            time = table.line_of("by_time").filter(|_| by_time);
            outputs = grid.map(|[columns, rows]| columns * rows);
            let [columns, rows] = grid.unwrap_or([1, 1]);
            let aggregation =
                table.option("aggregation", &[("max", Aggregation::Max), ("sum", Aggregation::Sum)]);
            LayerKind::Readout { columns, rows, aggregation, times: 1 }
        }
        "dense" => {
            outputs = table.known(|table| table.size("outputs", CHANNELS, None));
            let bias = table.boolean("bias", true);
            let choices = activations([Activation::Identity, Activation::Relu, Activation::Elu]);
            LayerKind::Dense { bias, activation: table.option("activation", &choices) }
        }
        _ => {
            let named = CONVOLUTIONS.iter().find(|(kind, _)| *kind == word).map(|&(_, keys)| keys);
            let chosen = named.or_else(|| table.choice("conv", &CONVOLUTIONS));
            // Without a convolution it is unknown which keys belong to the table.
            let Some(keys) = chosen else { return };
            outputs = table.known(|table| table.size("channels", CHANNELS, None));
            let conv = keys(&mut table);
            layer.second = table.optional("skip", REFERENCE, name);
            let skip = layer.second.as_ref().map(|given| given.value.clone());
            LayerKind::Block { conv, skip, norm: table.boolean("norm", true) }
        }
    };
    if matches!(kind, LayerKind::Block { .. } | LayerKind::Dense { .. }) {
        layer.read_weights(&mut table);
    }
    table.finish();
    layer.kind = Some(FileKind { kind, outputs, time });
}

fn pool(table: &mut Table<'_, '_>, network: &Description) -> LayerKind {
    let cell = table.required("cell", CELL, cell);
    let time = table.optional("time", "a fraction of the span, such as \"1/3\"", fraction);
    let positions = [("mean", Position::Mean), ("centre", Position::Centre)];
    let position = table.option("position", &positions);
    let scale = scale(table, network.normalisation);
    if let Some(cell) = &cell {
        let times = time.as_ref().map_or(1, |time| time.value.cells() + 1);
        let [x, y] = cell.value.map(Fraction::cells);
        let cells = x.saturating_mul(y).saturating_mul(times);
        if cells > Network::MAX_CELLS {
            let expected = format!("a size that gives at most {} cells", Network::MAX_CELLS);
            table.refuse(table.line(), "cell", expected, format!("{cells} cells"));
        }
    }
    let whole = Fraction::new(1, 1).expect("a fraction");
    let time = time.map(|Spanned { value, line }| {
        let span_us = network.span_us;
        if i128::from(span_us) * i128::from(value.numerator()) < i128::from(value.denominator()) {
            let expected = format!("cells of at least 1 us of the span's {span_us}");
            table.refuse(line, "time", expected, format!("\"{value}\""));
        }
        value
    });
    LayerKind::Pool {
        cell: Cell { cell: cell.map_or([whole; 2], |given| given.value), time },
        position,
        scale,
    }
}

fn grid(table: &mut Table<'_, '_>) -> [usize; 2] {
    let expected = "columns and rows of the grid, such as [4, 4], at most 65536 cells";
    table.value("grid", expected, None, |value| {
        let [columns, rows] = &value.as_array()?[..] else { return None };
        let side = |value: &DeValue<'_>| integer(value).filter(|side| (1..=1 << 16).contains(side));
        let (columns, rows) = (side(columns.get_ref())?, side(rows.get_ref())?);
        (columns * rows <= 1 << 16).then_some([columns as usize, rows as usize])
    })
}

/// The scale of a level's edge attributes; a placeholder if every graph has its own.
fn scale(table: &mut Table<'_, '_>, normalisation: Normalisation) -> f32 {
    if normalisation == Normalisation::Fixed {
        // As f32 it must still be finite and above 0.
        return table.positive("scale", |scale| scale as f32 > 0.0 && (scale as f32).is_finite()) as f32;
    }
    let with = "normalisation = \"fixed\": per graph it is the largest difference over its edges";
    table.inapplicable("scale", with);
    1.0
}

fn cell(value: &DeValue<'_>) -> Option<[Fraction; 2]> {
    let [x, y] = &value.as_array()?[..] else { return None };
    Some([fraction(x.get_ref())?, fraction(y.get_ref())?])
}

fn fraction(value: &DeValue<'_>) -> Option<Fraction> {
    value.as_str()?.parse().ok()
}
