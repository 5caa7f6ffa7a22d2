//! A description as a table of aligned columns.

use std::fmt;

use super::frames;
use super::summary::Summary;
use crate::description::{Cost, FieldStart, Per, ReceptiveField, activation_word};
use crate::{Description, FrameLayer, Layer, LayerKind};

const HEADINGS: [&str; 7] =
    ["layer", "kind", "reads", "shape", "parameters", "multiply-adds a row", "receptive field of a row"];

impl Description {
    /// What `meissner inspect` prints: the network's rule, a line for each layer, and the totals.
    pub fn to_table(&self) -> String {
        self.to_string()
    }
}

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let summary = self.summary();
        head(&summary, f)?;
        aligned(HEADINGS, self.layers().iter().map(row).chain(self.head().iter().map(head_row)), f)?;
        foot(self, &summary, f)
    }
}

fn head(summary: &Summary, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    writeln!(f, "network    {}", summary.name)?;
    writeln!(f, "window     {} us, at most {} events", summary.span_us, summary.capacity)?;
    writeln!(f, "graph      {}", summary.graph)?;
    if summary.graph.scale.is_none() {
        writeln!(f, "normalised per graph: batch only")?;
    }
    writeln!(f, "output     {} ({})\n", summary.outputs.join(", "), summary.unit)
}

fn foot(description: &Description, summary: &Summary, f: &mut fmt::Formatter<'_>) -> fmt::Result {
    writeln!(f, "\nparameters {} trained, {} values in all", summary.parameters, summary.values)?;
    let events = description.layers().iter().filter(|layer| layer.level == Some(0));
    let cost: usize = events.map(|layer| layer.cost.multiply_adds).sum();
    write!(f, "an event's row through the event level: {cost} multiply-adds")?;
    if !description.head().is_empty() {
        let cost: usize = description.head().iter().map(|layer| layer.multiply_adds).sum();
        write!(
            f,
            "\na prediction through the head: {cost} multiply-adds, fewer where the readout changed in part"
        )?;
    }
    if description.levels() > 1 {
        write!(
            f,
            "\nin-edges of cells are an assumption: the cells that touch one; edges of events can reach further"
        )?;
    }
    Ok(())
}

fn row(layer: &Layer) -> [String; 7] {
    let reads = match &layer.kind {
        LayerKind::Spline { skip: Some(skip), .. } => format!("{} + {skip}", layer.from),
        _ => layer.from.clone(),
    };
    let cost = match layer.kind {
        LayerKind::Pool { .. } | LayerKind::Readout { .. } => "maxima only".to_owned(),
        _ => layer.cost.to_string(),
    };
    [
        layer.name.clone(),
        kind(layer),
        reads,
        format!("{} -> {}", layer.inputs, layer.outputs),
        layer.parameters.to_string(),
        cost,
        layer.field.to_string(),
    ]
}

/// A layer of the head: all of it is evaluated for a prediction, which the whole window reaches.
fn head_row(layer: &FrameLayer) -> [String; 7] {
    let cost = Cost { multiply_adds: layer.multiply_adds, in_edges: None, per: Per::Prediction };
    let field = ReceptiveField { steps: Vec::new(), from: FieldStart::Window };
    let [name, kind, reads, shape, parameters, ..] = frames::row(layer);
    [name, kind, reads, shape, parameters, cost.to_string(), field.to_string()]
}

/// A layer's kind with its options, short.
pub(super) fn kind(layer: &Layer) -> String {
    match &layer.kind {
        LayerKind::Spline { kernel: [x, y, t], root, bias, norm, elu, .. } => {
            let mut text = format!("spline {x}x{y}x{t}");
            for (word, given) in
                [(" root", *root), (" bias", *bias), (" no norm", !*norm), (" no elu", !*elu)]
            {
                if given {
                    text.push_str(word);
                }
            }
            text
        }
        LayerKind::Pool { cell, .. } => format!("pool {cell}"),
        LayerKind::Readout { columns, rows, times: 1 } => format!("readout {columns}x{rows}"),
        LayerKind::Readout { columns, rows, times } => format!("readout {columns}x{rows}x{times}"),
        LayerKind::Dense { activation, .. } => format!("dense {}", activation_word(*activation)),
    }
}

/// Columns of a terminal that people can count on.
const WIDTH: usize = 80;

/// Writes headings and rows in columns as wide as they must be; where they are wider than a terminal, the columns stand in
/// several tables, each with the first column, and with an empty line between them.
pub(super) fn aligned<const N: usize>(
    headings: [&str; N],
    rows: impl Iterator<Item = [String; N]>,
    f: &mut fmt::Formatter<'_>,
) -> fmt::Result {
    let lines: Vec<[String; N]> = std::iter::once(headings.map(str::to_owned)).chain(rows).collect();
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
        for line in &lines {
            let cells = std::iter::once(&0).chain(block);
            let padded: Vec<String> = cells.map(|&c| format!("{:<1$}", line[c], widths[c])).collect();
            writeln!(f, "{}", padded.join("  ").trim_end())?;
        }
    }
    Ok(())
}
