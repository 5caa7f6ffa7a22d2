//! The view of a network for tables and pictures: a row for each layer, its inputs, and bands.
//!
//! Input: a description of either kind. Output: a [`View`].

use std::fmt;
use std::fmt::Write;

use meissner_engine::Aggregation;

use crate::description::filters;
use crate::description::frames::{FRAME, FrameDescription, FrameKind, FrameLayer};
use crate::description::{Cost, CostUnit, Description, FieldStart, Layer, LayerKind, Needed, ReceptiveField};

#[cfg_attr(not(feature = "svg"), expect(dead_code, reason = "only SVG shows all of it"))]
pub(crate) struct View<'a> {
    pub(crate) name: &'a str,
    /// Text below the name of a picture.
    pub(crate) about: String,
    /// Lines above a table, each with a word for it.
    pub(crate) head: Vec<(&'static str, String)>,
    /// Headings of the last two columns of a table.
    pub(crate) headings: [&'static str; 2],
    pub(crate) foot: Vec<String>,
    pub(crate) input: Input,
    pub(crate) bands: Vec<String>,
    pub(crate) rows: Vec<Row<'a>>,
}

#[cfg_attr(not(feature = "svg"), expect(dead_code, reason = "only SVG shows all of it"))]
pub(crate) struct Input {
    pub(crate) name: &'static str,
    pub(crate) word: &'static str,
    pub(crate) about: &'static str,
    pub(crate) shape: String,
    pub(crate) band: Option<usize>,
}

#[cfg_attr(not(feature = "svg"), expect(dead_code, reason = "only SVG shows all of it"))]
pub(crate) struct Row<'a> {
    pub(crate) name: &'a str,
    pub(crate) kind: String,
    pub(crate) from: &'a str,
    /// Its second input, and the mark of the connection in a table and in pictures.
    pub(crate) joins: Option<(&'a str, [&'static str; 2])>,
    /// Shapes of its input and its output.
    pub(crate) shapes: [String; 2],
    pub(crate) parameters: usize,
    /// The last two columns of a table.
    pub(crate) columns: [String; 2],
    pub(crate) fill: &'static str,
    pub(crate) band: Option<usize>,
}

/// Fill of boxes, by kind of layer.
const CONVOLUTION: &str = "#cfe3f7";
const POOLING: &str = "#f8dfc4";
const READOUT: &str = "#f5e9b8";
const DENSE: &str = "#d5ecd0";
const RECURRENT: &str = "#e4d6f2";

impl Description {
    pub(crate) fn view(&self) -> View<'_> {
        let graph = self.graph_summary();
        let mut head = vec![
            ("network", self.name().to_owned()),
            ("window", format!("{} us, at most {} events", self.span_us(), self.capacity())),
            ("graph", graph.to_string()),
        ];
        if let Some([x, y]) = self.place() {
            head.push(("input", format!("polarity, and place in a cell of {x} x {y}")));
        }
        if graph.scale.is_none() {
            head.push(("normalised", "per graph: batch only".to_owned()));
        }
        if !self.filters().is_empty() {
            head.push(("filters", filters::line(self.filters())));
        }
        head.push(("output", self.labelled_outputs()));
        let events = self.layers().iter().filter(|layer| layer.level == Some(0));
        let cost: usize = events.map(|layer| layer.cost.multiply_adds).sum();
        let mut foot = vec![
            sizes(self.parameters(), &self.needed()),
            format!("an event's row through the event level: {cost} multiply-adds"),
        ];
        if !self.head().is_empty() {
            let cost: usize = self.head().iter().map(|layer| layer.multiply_adds).sum();
            let fewer = "fewer where the readout changed in part";
            foot.push(format!("a prediction through the head: {cost} multiply-adds, {fewer}"));
        }
        if self.levels() > 1 {
            let assumed = "the cells that touch one; edges of events can reach further";
            foot.push(format!("in-edges of cells are an assumption: {assumed}"));
        }
        let mut bands = vec![format!("level 0: events, {graph}")];
        for layer in self.layers() {
            if let LayerKind::Pool { cell, .. } = &layer.kind {
                bands.push(format!("level {}: cells of {cell}", bands.len()));
            }
        }
        View {
            name: self.name(),
            about: format!(
                "{} parameters, window {} ms",
                count(self.parameters()),
                self.span_us() as f64 / 1000.0
            ),
            head,
            headings: ["multiply-adds a row", "receptive field of a row"],
            foot,
            input: Input {
                name: "events",
                word: if self.place().is_some() { "polarity, place" } else { "polarity" },
                about: match self.place() {
                    None => "polarity of each event: -1 or 1",
                    Some(_) => {
                        "polarity of each event: -1 or 1; its place in a cell along each axis: -1 to 1"
                    }
                },
                shape: format!("{} channel{}", self.inputs(), if self.inputs() == 1 { "" } else { "s" }),
                band: Some(0),
            },
            bands,
            rows: self.layers().iter().map(row).chain(self.head().iter().map(head_row)).collect(),
        }
    }
}

impl FrameDescription {
    pub(crate) fn view(&self) -> View<'_> {
        let word = self.source().word();
        let mut head = vec![
            ("network", self.name().to_owned()),
            ("input", self.input().to_string()),
            ("frames", self.source().to_string()),
        ];
        if !self.filters().is_empty() {
            head.push(("filters", filters::line(self.filters())));
        }
        head.push(("output", format!("{}, {}", self.labelled_outputs(), self.output())));
        View {
            name: self.name(),
            about: format!(
                "{} parameters, {} multiply-adds a frame",
                count(self.parameters()),
                count(self.multiply_adds())
            ),
            head,
            headings: ["multiply-adds", "state"],
            foot: vec![
                sizes(self.parameters(), &self.needed()),
                format!(
                    "a frame: {} multiply-adds, {} values kept to the next",
                    self.multiply_adds(),
                    self.state()
                ),
            ],
            input: Input { name: FRAME, word, about: word, shape: self.input().to_string(), band: None },
            bands: Vec::new(),
            rows: self.layers().iter().map(frame_row).collect(),
        }
    }
}

/// A whole number with a comma between thousands.
pub fn grouped(number: u64) -> String {
    let digits = number.to_string();
    let comma = |i: usize| i > 0 && (digits.len() - i).is_multiple_of(3);
    digits.char_indices().flat_map(|(i, c)| comma(i).then_some(',').into_iter().chain([c])).collect()
}

fn count(count: usize) -> String {
    grouped(count as u64)
}

fn sizes(parameters: usize, tensors: &[Needed]) -> String {
    let values: usize = tensors.iter().map(Needed::values).sum();
    format!("parameters {parameters} trained, {values} values in all")
}

fn row(layer: &Layer) -> Row<'_> {
    let fill = match layer.kind {
        LayerKind::Block { .. } => CONVOLUTION,
        LayerKind::Pool { .. } => POOLING,
        LayerKind::Readout { .. } => READOUT,
        LayerKind::Dense { .. } => DENSE,
    };
    let joins = match &layer.kind {
        LayerKind::Block { skip: Some(skip), .. } => Some((skip.as_str(), [" +", "+"])),
        _ => None,
    };
    let cost = match layer.kind {
        LayerKind::Readout { aggregation: Aggregation::Sum, .. } => "sums only".to_owned(),
        LayerKind::Pool { .. } | LayerKind::Readout { .. } => "maxima only".to_owned(),
        LayerKind::Block { .. } | LayerKind::Dense { .. } => layer.cost.to_string(),
    };
    Row {
        name: &layer.name,
        kind: layer.kind.to_string(),
        from: &layer.from,
        joins,
        shapes: [layer.inputs.to_string(), layer.outputs.to_string()],
        parameters: layer.parameters,
        columns: [cost, layer.field.to_string()],
        fill,
        band: layer.level,
    }
}

/// The row of a layer of the head, which is evaluated completely for each prediction.
fn head_row(layer: &FrameLayer) -> Row<'_> {
    let cost = Cost { multiply_adds: layer.multiply_adds, in_edges: None, per: CostUnit::Prediction };
    let field = ReceptiveField { steps: Vec::new(), from: FieldStart::Window };
    Row { columns: [cost.to_string(), field.to_string()], ..frame_row(layer) }
}

fn frame_row(layer: &FrameLayer) -> Row<'_> {
    let fill = match layer.kind {
        FrameKind::Conv { .. } | FrameKind::UpConv { .. } | FrameKind::SqueezeExcite { .. } => CONVOLUTION,
        FrameKind::MaxPool | FrameKind::AveragePool { .. } | FrameKind::GlobalAverage | FrameKind::Sum => {
            POOLING
        }
        FrameKind::ConvLstm { .. } | FrameKind::Lstm { .. } | FrameKind::Delay { .. } => RECURRENT,
        FrameKind::Concat { .. } | FrameKind::Flatten => READOUT,
        FrameKind::Dense { .. } => DENSE,
    };
    Row {
        name: &layer.name,
        kind: layer.kind.to_string(),
        from: &layer.from,
        joins: layer.with().map(|with| (with, [",", "with"])),
        shapes: [layer.input.to_string(), layer.output.to_string()],
        parameters: layer.parameters,
        columns: [layer.multiply_adds.to_string(), layer.state.to_string()],
        fill,
        band: None,
    }
}

/// Columns that every terminal has.
const WIDTH: usize = 80;

impl fmt::Display for View<'_> {
    /// The lines above the table, the table and the lines below it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (word, text) in &self.head {
            writeln!(f, "{word:<10} {text}")?;
        }
        f.write_char('\n')?;
        let [cost, last] = self.headings;
        let headings = ["layer", "kind", "reads", "shape", "parameters", cost, last].map(str::to_owned);
        let rows = self.rows.iter().map(|row| {
            let joined = row.joins.map(|(joins, [mark, _])| format!("{mark} {joins}"));
            let [cost, last] = row.columns.clone();
            [
                row.name.to_owned(),
                row.kind.clone(),
                row.from.to_owned() + &joined.unwrap_or_default(),
                row.shapes.join(" -> "),
                row.parameters.to_string(),
                cost,
                last,
            ]
        });
        aligned(&std::iter::once(headings).chain(rows).collect::<Vec<_>>(), f)?;
        write!(f, "\n{}", self.foot.join("\n"))
    }
}

/// Writes `lines`, headings first, in aligned columns. If they are wider than a terminal, they are
/// split into tables that repeat the first column, with an empty line between.
fn aligned<const N: usize>(lines: &[[String; N]], f: &mut fmt::Formatter<'_>) -> fmt::Result {
    let widths: [usize; N] = std::array::from_fn(|column| {
        lines.iter().map(|line| line[column].chars().count()).max().unwrap_or(0)
    });
    let mut blocks: Vec<Vec<usize>> = Vec::new();
    let mut taken = 0;
    for column in 1..N {
        match blocks.last_mut() {
            Some(block) if taken + 2 + widths[column] <= WIDTH => block.push(column),
            _ => {
                blocks.push(vec![column]);
                taken = widths[0];
            }
        }
        taken += 2 + widths[column];
    }
    for (number, block) in blocks.iter().enumerate() {
        if number > 0 {
            writeln!(f)?;
        }
        for line in lines {
            let cells = std::iter::once(&0).chain(block);
            let padded: Vec<String> = cells.map(|&c| format!("{:<1$}", line[c], widths[c])).collect();
            writeln!(f, "{}", padded.join("  ").trim_end())?;
        }
    }
    Ok(())
}
