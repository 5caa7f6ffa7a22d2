//! A description as a table of aligned columns.

use std::fmt;

use super::summary::Summary;
use crate::description::frames::{FrameDescription, FrameLayer};
use crate::description::{
    AnyDescription, Cost, Description, FieldStart, Layer, LayerKind, Per, ReceptiveField,
};

/// Columns of a table over events.
const EVENT_HEADINGS: [&str; 7] =
    ["layer", "kind", "reads", "shape", "parameters", "multiply-adds a row", "receptive field of a row"];
/// Columns of a table over frames.
const FRAME_HEADINGS: [&str; 7] = ["layer", "kind", "reads", "shape", "parameters", "multiply-adds", "state"];

impl fmt::Display for Description {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let summary = self.summary();
        head(&summary, f)?;
        aligned(EVENT_HEADINGS, self.layers().iter().map(row).chain(self.head().iter().map(head_row)), f)?;
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
        LayerKind::Block { skip: Some(skip), .. } => format!("{} + {skip}", layer.from),
        _ => layer.from.clone(),
    };
    let cost = match layer.kind {
        LayerKind::Pool { .. } | LayerKind::Readout { .. } => "maxima only".to_owned(),
        _ => layer.cost.to_string(),
    };
    [
        layer.name.clone(),
        layer.kind.to_string(),
        reads,
        format!("{} -> {}", layer.inputs, layer.outputs),
        layer.parameters.to_string(),
        cost,
        layer.field.to_string(),
    ]
}

/// The row of a layer of the head. All of it is evaluated for a prediction, which depends on the whole window.
fn head_row(layer: &FrameLayer) -> [String; 7] {
    let cost = Cost { multiply_adds: layer.multiply_adds, in_edges: None, per: Per::Prediction };
    let field = ReceptiveField { steps: Vec::new(), from: FieldStart::Window };
    let [name, kind, reads, shape, parameters, ..] = frame_row(layer);
    [name, kind, reads, shape, parameters, cost.to_string(), field.to_string()]
}

impl fmt::Display for FrameDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let summary = self.summary();
        writeln!(f, "network    {}", summary.name)?;
        writeln!(f, "input      {}", summary.input)?;
        writeln!(f, "frames     {}", summary.source)?;
        writeln!(f, "output     {} ({}), {}\n", summary.outputs.join(", "), summary.unit, summary.output)?;
        aligned(FRAME_HEADINGS, self.layers().iter().map(frame_row), f)?;
        writeln!(f, "\nparameters {} trained, {} values in all", summary.parameters, summary.values)?;
        write!(
            f,
            "a frame: {} multiply-adds, {} values kept to the next",
            summary.multiply_adds, summary.state
        )
    }
}

fn frame_row(layer: &FrameLayer) -> [String; 7] {
    [
        layer.name.clone(),
        layer.kind.to_string(),
        layer.with().map_or_else(|| layer.from.clone(), |with| format!("{}, {with}", layer.from)),
        format!("{} -> {}", layer.input, layer.output),
        layer.parameters.to_string(),
        layer.multiply_adds.to_string(),
        layer.state.to_string(),
    ]
}

impl fmt::Display for AnyDescription {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Events(description) => description.fmt(f),
            Self::Frames(description) => description.fmt(f),
        }
    }
}

/// Columns that every terminal has.
const WIDTH: usize = 80;

/// Writes headings and rows in columns as wide as their content. Where they are wider than a terminal, the columns are split
/// into several tables with an empty line between them. Each table has the first column.
fn aligned<const N: usize>(
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
