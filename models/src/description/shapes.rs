//! Levels, channels, costs and receptive fields, layer after layer in the order of evaluation.
//!
//! Enters: a [`File`] and its [`Wiring`]. Leaves: checked [`Layer`]s, without the layers that have problems. Invariant: where
//! no problem was reported, all layers are there, the levels are a chain, and the engine accepts the layers.

use meissner_engine::frames::FrameShape;
use meissner_engine::{Network, Reach};

use super::convolution::TooLarge;
use super::file::{EVENTS, File, FileKind, FileLayer};
use super::frames::{self, FrameLayer};
use super::layer::{Cell, Cost, FieldStart, FieldStep, Layer, LayerKind, Per, ReceptiveField};
use super::problem::{ProblemKind, Problems};
use super::table::Given;
use super::tensors::{LARGEST_TENSOR, Needed};
use super::wiring::{Source, Wiring};

/// Most parameters of a network: 1 GiB of f32.
const MOST_PARAMETERS: usize = 1 << 28;

/// The known properties of a layer's output.
#[derive(Clone, Copy, Debug)]
enum Output {
    /// A feature: a row for each node of a level.
    Feature { level: usize, channels: Option<usize>, hops: usize, index: usize },
    /// One vector.
    Values { outputs: Option<usize> },
    /// A problem of it was reported.
    Unknown,
}

/// A level: the events, or the cells of a pooling.
#[derive(Debug)]
struct Level {
    /// Layer that starts it.
    pool: Option<usize>,
    cell: Option<Cell>,
    /// Features so far.
    features: usize,
    /// Hops and cells of the levels below, from the nearest down.
    below: Vec<FieldStep>,
}

struct Shapes<'a> {
    file: &'a File,
    wiring: &'a Wiring,
    problems: &'a mut Problems,
    outputs: Vec<Output>,
    levels: Vec<Level>,
}

/// Checks the layers and their inputs.
pub(super) fn check(file: &File, wiring: &Wiring, problems: &mut Problems) -> Vec<Layer> {
    let events = Level { pool: None, cell: None, features: 1, below: Vec::new() };
    let outputs = vec![Output::Unknown; file.layers.len()];
    let mut shapes = Shapes { file, wiring, problems, outputs, levels: vec![events] };
    let layers: Vec<Layer> = wiring.order.iter().filter_map(|&i| shapes.layer(i)).collect();
    shapes.parameters(&layers);
    shapes.output_names();
    layers
}

impl Shapes<'_> {
    fn report(&mut self, line: usize, layer: &FileLayer, kind: ProblemKind) {
        self.problems.add(line, Some(&layer.name), kind);
    }

    fn output(&self, source: Source) -> Output {
        match source {
            Source::Events => Output::Feature { level: 0, channels: Some(1), hops: 0, index: 0 },
            Source::Layer(layer) => self.outputs[layer],
            Source::Unknown => Output::Unknown,
        }
    }

    /// `source`, as messages name it.
    fn describe(&self, source: Source) -> String {
        let Source::Layer(layer) = source else { return format!("{EVENTS:?}") };
        let layer = &self.file.layers[layer];
        let word = match layer.kind {
            FileKind::Block { word, .. } => word,
            FileKind::Pool { .. } => "pool",
            FileKind::Readout { .. } => "readout",
            FileKind::Dense { .. } => "dense",
            FileKind::Unknown => "unknown",
        };
        format!("{word} layer {:?} on line {}", layer.name, layer.line)
    }

    /// Whether `source` gives rows (`rows`) or a vector; reports where it is the other.
    fn reads(
        &mut self,
        layer: &FileLayer,
        key: &'static str,
        line: usize,
        source: Source,
        rows: bool,
    ) -> Option<Output> {
        let is_rows = match source {
            Source::Events => true,
            Source::Unknown => return None,
            Source::Layer(read) => match self.file.layers[read].kind {
                FileKind::Block { .. } | FileKind::Pool { .. } => true,
                FileKind::Readout { .. } | FileKind::Dense { .. } => false,
                FileKind::Unknown => return None,
            },
        };
        if is_rows == rows {
            return Some(self.output(source));
        }
        let expected =
            if rows { "\"events\", a block or a pool layer" } else { "the readout or a dense layer" };
        let found = self.describe(source);
        self.report(line, layer, ProblemKind::Value { key, expected: expected.to_owned(), found });
        None
    }

    fn layer(&mut self, i: usize) -> Option<Layer> {
        let file = self.file;
        let layer = &file.layers[i];
        let from = self.wiring.from[i];
        let line = layer.from.as_ref().map_or(layer.line, |given| given.line);
        let rows = match layer.kind {
            FileKind::Dense { .. } => false,
            FileKind::Unknown => return None,
            _ => true,
        };
        let read = self.reads(layer, "from", line, from, rows).unwrap_or(Output::Unknown);
        let checked = match &layer.kind {
            FileKind::Block { .. } => self.block(i, layer, read),
            FileKind::Pool { .. } => self.pool(i, layer, read),
            FileKind::Readout { .. } => self.readout(i, layer, read),
            FileKind::Dense { .. } => self.dense(i, layer, read),
            FileKind::Unknown => None,
        };
        checked.map(|layer| Layer { from: self.name(from), ..layer })
    }

    fn name(&self, source: Source) -> String {
        match source {
            Source::Layer(layer) => self.file.layers[layer].name.clone(),
            _ => EVENTS.to_owned(),
        }
    }

    /// A checked layer without the fields that depend on its kind.
    fn checked(layer: &FileLayer, kind: LayerKind, inputs: usize, outputs: usize) -> Layer {
        Layer {
            name: layer.name.clone(),
            line: layer.line,
            kind,
            from: String::new(),
            level: None,
            inputs,
            outputs,
            parameters: 0,
            cost: Cost { multiply_adds: 0, in_edges: None, per: Per::Row },
            field: ReceptiveField { steps: Vec::new(), from: FieldStart::Row },
            weights: layer.weights.clone(),
            reads: 0,
            adds: None,
        }
        .counted()
    }

    fn field(&self, level: usize, hops: usize) -> Vec<FieldStep> {
        let level = &self.levels[level];
        std::iter::once(FieldStep { hops, cell: level.cell }).chain(level.below.iter().cloned()).collect()
    }

    fn block(&mut self, i: usize, layer: &FileLayer, read: Output) -> Option<Layer> {
        let FileKind::Block { conv, channels, skip, norm, .. } = &layer.kind else { return None };
        let added = skip.as_ref().zip(self.wiring.skip[i]).map(|(given, source)| {
            let output = self.reads(layer, "skip", given.line, source, true);
            (given, output.unwrap_or(Output::Unknown))
        });
        let Output::Feature { level, channels: inputs, mut hops, index } = read else { return None };
        hops += 1;
        let mut adds = None;
        let mut adds_fit = true;
        if let Some((given, output)) = added {
            adds = self.skip(layer, given, level, *channels, output);
            adds_fit = adds.is_some();
            if let Output::Feature { hops: skipped, .. } = output {
                hops = hops.max(skipped);
            }
        }
        let feature = self.levels[level].features;
        self.levels[level].features += 1;
        self.outputs[i] = Output::Feature { level, channels: *channels, hops, index: feature };
        let (inputs, outputs, conv) = (inputs?, (*channels)?, conv.as_ref()?);
        if let Some(TooLarge { key, expected, found }) = conv.too_large(inputs, outputs) {
            self.report(layer.line, layer, ProblemKind::Value { key, expected, found });
        }
        if !adds_fit {
            return None;
        }
        let in_edges = match &self.levels[level].cell {
            Some(cell) => cell.grid_neighbours(),
            None => self.file.graph.map_or(0, |rule| Reach::most(rule.reach)),
        };
        let skip = skip.as_ref().map(|given| given.value.clone());
        let kind = LayerKind::Block { conv: conv.clone(), skip, norm: *norm };
        Some(Layer {
            level: Some(level),
            cost: Cost {
                multiply_adds: conv.multiply_adds(inputs, outputs, in_edges),
                in_edges: Some(in_edges),
                per: Per::Row,
            },
            field: ReceptiveField { steps: self.field(level, hops), from: FieldStart::Row },
            reads: index,
            adds,
            ..Self::checked(layer, kind, inputs, outputs)
        })
    }

    /// The feature that a skip adds, if its level and channels are the same as the layer's.
    fn skip(
        &mut self,
        layer: &FileLayer,
        given: &Given<String>,
        level: usize,
        channels: Option<usize>,
        output: Output,
    ) -> Option<usize> {
        let Output::Feature { level: found_level, channels: found, index, .. } = output else { return None };
        if found_level != level {
            let expected = format!("a layer over {}", self.level_name(level));
            let found = format!("{:?} over {}", given.value, self.level_name(found_level));
            self.report(given.line, layer, ProblemKind::Value { key: "skip", expected, found });
            return None;
        }
        let (expected, found) = (channels?, found?);
        if expected != found {
            let (expected, found) = (format!("{expected} channels"), found.to_string());
            let kind = ProblemKind::Size { key: "skip", reference: given.value.clone(), expected, found };
            self.report(given.line, layer, kind);
            return None;
        }
        Some(index)
    }

    fn level_name(&self, level: usize) -> String {
        match self.levels[level].pool {
            Some(pool) => format!("the cells of {:?}", self.file.layers[pool].name),
            None => "the events".to_owned(),
        }
    }

    fn pool(&mut self, i: usize, layer: &FileLayer, read: Output) -> Option<Layer> {
        let FileKind::Pool { cell, time, position, scale } = &layer.kind else { return None };
        if let Some(cell) = cell {
            let times = time.as_ref().map_or(1, |time| time.value.cells() + 1);
            let cells = cell[0].cells().saturating_mul(cell[1].cells()).saturating_mul(times);
            if cells > Network::MOST_CELLS {
                let expected = format!("a size that gives at most {} cells", Network::MOST_CELLS);
                let found = format!("{cells} cells");
                self.report(layer.line, layer, ProblemKind::Value { key: "cell", expected, found });
            }
        }
        let span_us = self.file.span_us;
        if let Some(time) = time
            && i128::from(span_us) * i128::from(time.value.numerator()) < i128::from(time.value.denominator())
        {
            let expected = format!("cells of at least 1 us of the span's {span_us}");
            let found = format!("\"{}\"", time.value);
            self.report(time.line, layer, ProblemKind::Value { key: "time", expected, found });
        }
        let Output::Feature { level: below, channels, hops, index } = read else { return None };
        if let Some(time) = time
            && below > 0
            && self.levels[below].cell.is_some_and(|cell| cell.time.is_none())
        {
            let expected = format!("no cells in time over {}, which have none", self.level_name(below));
            let found = format!("\"{}\"", time.value);
            self.report(time.line, layer, ProblemKind::Value { key: "time", expected, found });
        }
        let cell = cell.map(|cell| Cell { cell, time: time.as_ref().map(|time| time.value) });
        let level = self.levels.len();
        let below = self.field(below, hops);
        self.levels.push(Level { pool: Some(i), cell, features: 1, below });
        self.outputs[i] = Output::Feature { level, channels, hops: 0, index: 0 };
        let (channels, cell, scale) = (channels?, cell?, (*scale)?);
        let kind = LayerKind::Pool { cell, position: *position, scale };
        Some(Layer {
            level: Some(level),
            field: ReceptiveField { steps: self.field(level, 0), from: FieldStart::Row },
            reads: index,
            ..Self::checked(layer, kind, channels, channels)
        })
    }

    fn readout(&mut self, i: usize, layer: &FileLayer, read: Output) -> Option<Layer> {
        let FileKind::Readout { grid, by_time } = layer.kind else { return None };
        let Output::Feature { level, channels, hops, index } = read else { return None };
        let times = if by_time { self.times(layer) } else { Some(1) };
        let cells = grid.zip(times).map(|([columns, rows], times)| columns * rows * times);
        if let Some(found) = cells.filter(|&cells| cells > 1 << 16) {
            let (expected, found) = ("at most 65536 cells".to_owned(), format!("{found}"));
            self.report(layer.line, layer, ProblemKind::Value { key: "grid", expected, found });
        }
        let outputs = channels.zip(cells).map(|(channels, cells)| channels * cells);
        self.outputs[i] = Output::Values { outputs };
        let ([columns, rows], times, channels, outputs) = (grid?, times?, channels?, outputs?);
        let from = FieldStart::ReadoutCell { columns, rows };
        let kind = LayerKind::Readout { columns, rows, times };
        Some(Layer {
            cost: Cost { multiply_adds: 0, in_edges: None, per: Per::Prediction },
            field: ReceptiveField { steps: self.field(level, hops), from },
            reads: index,
            ..Self::checked(layer, kind, channels, outputs)
        })
    }

    /// Cells in time that a window can fill, where every pooling has the same.
    fn times(&mut self, layer: &FileLayer) -> Option<usize> {
        let mut sizes = self.levels[1..].iter().map(|level| level.cell.map(|cell| cell.time));
        let first = sizes.next().unwrap_or(Some(None))?;
        let same = sizes.all(|size| size == Some(first));
        let Some(size) = first.filter(|_| same) else {
            let kind =
                ProblemKind::Inapplicable { key: "by_time", with: "poolings over the same cells in time" };
            self.report(layer.line, layer, kind);
            return None;
        };
        Some(size.cells() + 1)
    }

    fn dense(&mut self, i: usize, layer: &FileLayer, read: Output) -> Option<Layer> {
        let FileKind::Dense { outputs, bias, activation } = layer.kind else { return None };
        self.outputs[i] = Output::Values { outputs };
        let Output::Values { outputs: inputs } = read else { return None };
        let (inputs, outputs) = (inputs?, outputs?);
        if inputs.saturating_mul(outputs) > LARGEST_TENSOR {
            let expected = format!("at most {LARGEST_TENSOR} weights");
            let found = format!("{inputs} x {outputs}");
            self.report(layer.line, layer, ProblemKind::Value { key: "outputs", expected, found });
        }
        let kind = LayerKind::Dense { bias, activation };
        Some(Layer {
            cost: Cost {
                multiply_adds: inputs.saturating_mul(outputs),
                in_edges: None,
                per: Per::Prediction,
            },
            field: ReceptiveField { steps: Vec::new(), from: FieldStart::Window },
            ..Self::checked(layer, kind, inputs, outputs)
        })
    }

    /// Reports the first layer with which the network is too large, if there are no other problems.
    fn parameters(&mut self, layers: &[Layer]) {
        if !self.problems.0.is_empty() {
            return;
        }
        let mut total = 0_usize;
        for layer in layers {
            total = total.saturating_add(layer.parameters);
            if total > MOST_PARAMETERS {
                let expected =
                    format!("at most {MOST_PARAMETERS} parameters in the network up to this layer");
                let line = self.file.layers.iter().find(|l| l.name == layer.name).map_or(1, |l| l.line);
                self.problems.add(
                    line,
                    Some(&layer.name),
                    ProblemKind::Extent { expected, found: total.to_string() },
                );
                return;
            }
        }
    }

    /// Compares the prediction's values with their names.
    fn output_names(&mut self) {
        let Some(layer) = self.wiring.prediction.map(|i| &self.file.layers[i]) else { return };
        let FileKind::Dense { outputs: Some(expected), .. } = layer.kind else { return };
        if let Some(names) = &self.file.outputs
            && names.value.len() != expected
        {
            let kind =
                ProblemKind::OutputNames { layer: layer.name.clone(), expected, found: names.value.len() };
            self.problems.add(names.line, None, kind);
        }
    }
}

impl Layer {
    fn counted(mut self) -> Self {
        self.parameters = self.tensors().iter().map(Needed::parameters).sum();
        self
    }
}

/// Checks the head of `file`, which reads the readout of `layers` as an image:
///
/// ```text
/// channels = (channels of a cell) (cells in time),   height = rows,   width = columns
/// ```
///
/// Layers with problems are left out. Without problems, the engine accepts the layers as the head of the network.
pub(super) fn check_head(file: &File, layers: &[Layer], problems: &mut Problems) -> Vec<FrameLayer> {
    if file.head.is_empty() {
        return Vec::new();
    }
    for layer in file.head.iter().filter(|layer| !layer.name.is_empty()) {
        if let Some(first) = file.layers.iter().find(|first| first.name == layer.name) {
            let kind = ProblemKind::DuplicateName { first: first.line };
            problems.add(layer.line, Some(&layer.name), kind);
        }
    }
    // A missing readout was reported.
    let Some(readout) = file.layers.iter().find(|layer| matches!(layer.kind, FileKind::Readout { .. }))
    else {
        return Vec::new();
    };
    let image = layers.iter().find(|layer| layer.line == readout.line).and_then(image);
    let shape = image.filter(|&image| frames::fits(image));
    if let Some(image) = image
        && shape.is_none()
    {
        problems.add(readout.line, Some(&readout.name), frames::extent(image));
    }
    let stack = frames::Stack {
        layers: &file.head,
        input: &readout.name,
        shape,
        place: "of a table [[head]]",
        state: false,
        names: file.outputs.as_ref(),
        by_channel: false,
    };
    frames::check(stack, problems)
}

/// The image that a head reads of the readout `layer`.
fn image(layer: &Layer) -> Option<FrameShape> {
    let LayerKind::Readout { columns, rows, times } = layer.kind else { return None };
    Some(FrameShape::Image { channels: layer.inputs.saturating_mul(times), height: rows, width: columns })
}
