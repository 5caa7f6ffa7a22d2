//! Levels, channels, costs and receptive fields, layer after layer in the order of evaluation.
//!
//! Input: a [`File`] and its [`Wiring`]. Output: checked [`Layer`]s, except those with problems.
//! Invariant: without problems, the output contains all layers, levels are a chain, and the engine
//! accepts them.

use meissner_engine::Aggregation;
use meissner_engine::frames::FrameShape;

use super::convolution::ConvolutionKind;
use super::document::ParsedLayer;
use super::file::{EVENTS, File, FileKind};
use super::frames::{self, FrameLayer};
use super::layer::{Cell, Cost, CostUnit, FieldStart, FieldStep, Layer, LayerKind, ReceptiveField};
use super::problem::{ProblemKind, Problems};
use super::references::{Scope, check_names};
use super::table::Spanned;
use super::tensors::{MAX_TENSOR, Needed};
use super::wiring::Wiring;

/// Maximum number of parameters of a network: 1 GiB of f32.
const MAX_PARAMETERS: usize = 1 << 28;

/// The known properties of a node's output.
#[derive(Clone, Copy, Debug)]
enum Output {
    /// A feature: a row for each node of a level.
    Feature {
        level: usize,
        channels: Option<usize>,
        hops: usize,
        index: usize,
    },
    Values(Option<usize>),
}

/// A level: the events, or the cells of a pooling.
#[derive(Debug)]
struct Level {
    /// The name of its rows in messages.
    name: String,
    cell: Option<Cell>,
    features: usize,
    /// Hops and cells of the levels below, from the nearest down.
    below: Vec<FieldStep>,
}

struct Shapes<'a> {
    file: &'a File,
    wiring: &'a Wiring,
    problems: &'a mut Problems,
    /// Output of each node; `None` if a problem of it was reported.
    outputs: Vec<Option<Output>>,
    levels: Vec<Level>,
}

pub(super) fn check(file: &File, wiring: &Wiring, problems: &mut Problems) -> Vec<Layer> {
    let mut outputs = vec![None; file.layers.len() + 1];
    outputs[0] = Some(Output::Feature { level: 0, channels: Some(file.network.inputs()), hops: 0, index: 0 });
    let events = Level { name: "the events".to_owned(), cell: None, features: 1, below: Vec::new() };
    let mut shapes = Shapes { file, wiring, problems, outputs, levels: vec![events] };
    let layers: Vec<Layer> = wiring.order.iter().filter_map(|&i| shapes.layer(i)).collect();
    if problems.0.is_empty() {
        report_size(&layers, problems);
    }
    let prediction = wiring.prediction.map(|i| &file.layers[i]);
    if let Some(ParsedLayer { name, kind: Some(kind), .. }) = prediction
        && let (LayerKind::Dense { .. }, Some(outputs)) = (&kind.kind, kind.outputs)
    {
        check_names(file.outputs.as_ref(), name, outputs, problems);
    }
    layers
}

/// Reports the first layer at which the network becomes too large.
fn report_size(layers: &[Layer], problems: &mut Problems) {
    let mut total = 0_usize;
    for layer in layers {
        total = total.saturating_add(layer.parameters);
        if total > MAX_PARAMETERS {
            let expected = format!("at most {MAX_PARAMETERS} parameters in the network up to this layer");
            let kind = ProblemKind::Extent { expected, found: total.to_string() };
            return problems.add(layer.line, Some(&layer.name), kind);
        }
    }
}

impl Shapes<'_> {
    fn refuse(
        &mut self,
        layer: &ParsedLayer<FileKind>,
        line: usize,
        key: &'static str,
        expected: impl Into<String>,
        found: impl Into<String>,
    ) {
        self.problems.add(line, Some(&layer.name), ProblemKind::value(key, expected, found));
    }

    /// The known properties of the output of `node`, which must be rows if `rows`, else a vector;
    /// reports the opposite.
    fn reads(
        &mut self,
        layer: &ParsedLayer<FileKind>,
        (key, line): (&'static str, usize),
        node: Option<usize>,
        rows: bool,
    ) -> Option<Output> {
        let node = node?;
        let (is_rows, found) = match node.checked_sub(1).map(|i| &self.file.layers[i]) {
            None => (true, format!("{EVENTS:?}")),
            Some(read) => {
                let kind = &read.kind.as_ref()?.kind;
                let is_rows = matches!(kind, LayerKind::Block { .. } | LayerKind::Pool { .. });
                (is_rows, format!("{} layer {:?} on line {}", kind.word(), read.name, read.line))
            }
        };
        if is_rows == rows {
            return self.outputs[node];
        }
        let expected =
            if rows { "\"events\", a block or a pool layer" } else { "the readout or a dense layer" };
        self.refuse(layer, line, key, expected, found);
        None
    }

    fn layer(&mut self, i: usize) -> Option<Layer> {
        let file = self.file;
        let layer = &file.layers[i];
        let written = layer.kind.as_ref()?;
        let from = self.wiring.reads[i][0];
        let rows = !matches!(written.kind, LayerKind::Dense { .. });
        let read = self.reads(layer, ("from", layer.reading_line()), from, rows);
        let from = from.and_then(|node| node.checked_sub(1)).map_or(EVENTS, |i| &file.layers[i].name);
        let mut checked = Layer {
            name: layer.name.clone(),
            line: layer.line,
            kind: written.kind.clone(),
            from: from.to_owned(),
            level: None,
            inputs: 0,
            outputs: 0,
            parameters: 0,
            cost: Cost { multiply_adds: 0, in_edges: None, per: CostUnit::Row },
            field: ReceptiveField { steps: Vec::new(), from: FieldStart::Row },
            weights: layer.weights.clone(),
            reads: 0,
            adds: None,
        };
        match &written.kind {
            LayerKind::Block { conv, .. } => self.block(i, conv, read, &mut checked)?,
            LayerKind::Pool { cell, .. } => self.pool(i, *cell, read, &mut checked)?,
            LayerKind::Readout { columns, rows, aggregation, .. } => {
                self.readout(i, [*columns, *rows], *aggregation, read, &mut checked)?;
            }
            LayerKind::Dense { .. } => self.dense(i, read, &mut checked)?,
        }
        checked.parameters = checked.tensors().iter().map(Needed::parameters).sum();
        Some(checked)
    }

    fn field(&self, level: usize, hops: usize) -> Vec<FieldStep> {
        let level = &self.levels[level];
        std::iter::once(FieldStep { hops, cell: level.cell }).chain(level.below.iter().cloned()).collect()
    }

    /// The number of outputs of layer i in the file.
    fn written(&self, i: usize) -> Option<usize> {
        self.file.layers[i].kind.as_ref().and_then(|kind| kind.outputs)
    }

    fn block(
        &mut self,
        i: usize,
        conv: &ConvolutionKind,
        read: Option<Output>,
        checked: &mut Layer,
    ) -> Option<()> {
        let layer = &self.file.layers[i];
        let added = layer.second.as_ref().map(|given| {
            let output = self.reads(layer, ("skip", given.line), self.wiring.reads[i][1], true);
            (given, output)
        });
        let Some(Output::Feature { level, channels: inputs, mut hops, index }) = read else { return None };
        hops += 1;
        let channels = self.written(i);
        checked.adds = added.and_then(|(given, output)| self.skip(layer, given, level, channels, output));
        if let Some((_, Some(Output::Feature { hops: skipped, .. }))) = added {
            hops = hops.max(skipped);
        }
        let feature = self.levels[level].features;
        self.levels[level].features += 1;
        self.outputs[i + 1] = Some(Output::Feature { level, channels, hops, index: feature });
        (checked.level, checked.reads) = (Some(level), index);
        (checked.inputs, checked.outputs) = (inputs?, channels?);
        if let Some(problem) = conv.too_large(checked.inputs, checked.outputs) {
            self.problems.add(layer.line, Some(&layer.name), problem);
        }
        let most = || self.file.network.graph.reach.most();
        let in_edges = self.levels[level].cell.map_or_else(most, |cell| cell.grid_neighbours());
        checked.cost.multiply_adds = conv.multiply_adds(checked.inputs, checked.outputs, in_edges);
        checked.cost.in_edges = Some(in_edges);
        checked.field.steps = self.field(level, hops);
        (added.is_none() || checked.adds.is_some()).then_some(())
    }

    /// The feature that a skip adds, if its level and channels are the same as the layer's.
    fn skip(
        &mut self,
        layer: &ParsedLayer<FileKind>,
        given: &Spanned<String>,
        level: usize,
        channels: Option<usize>,
        output: Option<Output>,
    ) -> Option<usize> {
        let Some(Output::Feature { level: found_level, channels: found, index, .. }) = output else {
            return None;
        };
        if found_level != level {
            let expected = format!("a layer over {}", self.levels[level].name);
            let found = format!("{:?} over {}", given.value, self.levels[found_level].name);
            self.refuse(layer, given.line, "skip", expected, found);
            return None;
        }
        let (expected, found) = (channels?, found?);
        if expected != found {
            let (expected, found) = (format!("{expected} channels"), found.to_string());
            let kind = ProblemKind::Size { key: "skip", reference: given.value.clone(), expected, found };
            self.problems.add(given.line, Some(&layer.name), kind);
            return None;
        }
        Some(index)
    }

    fn pool(&mut self, i: usize, cell: Cell, read: Option<Output>, checked: &mut Layer) -> Option<()> {
        let layer = &self.file.layers[i];
        let Some(Output::Feature { level: below, channels, hops, index }) = read else { return None };
        let Level { name, cell: cells, .. } = &self.levels[below];
        if let (Some(time), Some(Cell { time: None, .. })) = (cell.time, cells) {
            let expected = format!("no cells in time over {name}, which have none");
            let line = layer.kind.as_ref().and_then(|kind| kind.time).unwrap_or(layer.line);
            self.refuse(layer, line, "time", expected, format!("\"{time}\""));
        }
        let (level, below) = (self.levels.len(), self.field(below, hops));
        let name = format!("the cells of {:?}", layer.name);
        self.levels.push(Level { name, cell: Some(cell), features: 1, below });
        self.outputs[i + 1] = Some(Output::Feature { level, channels, hops: 0, index: 0 });
        (checked.level, checked.reads) = (Some(level), index);
        (checked.inputs, checked.outputs) = (channels?, channels?);
        checked.field.steps = self.field(level, 0);
        Some(())
    }

    fn readout(
        &mut self,
        i: usize,
        [columns, rows]: [usize; 2],
        aggregation: Aggregation,
        read: Option<Output>,
        checked: &mut Layer,
    ) -> Option<()> {
        let layer = &self.file.layers[i];
        let Some(Output::Feature { level, channels, hops, index }) = read else { return None };
        if aggregation == Aggregation::Sum && level > 0 {
            self.refuse(layer, layer.line, "aggregation", "\"max\" above a pooling", "\"sum\"".to_owned());
        }
        let by_time = layer.kind.as_ref().is_some_and(|kind| kind.time.is_some());
        let times = if by_time { self.times(layer) } else { Some(1) };
        let cells = self.written(i).zip(times).map(|(cells, times)| cells * times);
        if let Some(found) = cells.filter(|&cells| cells > 1 << 16) {
            self.refuse(layer, layer.line, "grid", "at most 65536 cells", found.to_string());
        }
        let outputs = channels.zip(cells).map(|(channels, cells)| channels * cells);
        self.outputs[i + 1] = Some(Output::Values(outputs));
        (checked.inputs, checked.outputs, checked.reads) = (channels?, outputs?, index);
        checked.kind = LayerKind::Readout { columns, rows, aggregation, times: times? };
        checked.cost.per = CostUnit::Prediction;
        let from = FieldStart::ReadoutCell { columns, rows };
        checked.field = ReceptiveField { steps: self.field(level, hops), from };
        Some(())
    }

    /// Number of cells in time that a window can fill, if every pooling has the same.
    fn times(&mut self, layer: &ParsedLayer<FileKind>) -> Option<usize> {
        let mut sizes = self.levels.iter().filter_map(|level| level.cell).map(|cell| cell.time);
        if let Some(Some(size)) = sizes.next()
            && sizes.all(|other| other == Some(size))
        {
            return Some(size.cells() + 1);
        }
        let with = "poolings over the same cells in time";
        let kind = ProblemKind::Inapplicable { key: "by_time", with };
        self.problems.add(layer.line, Some(&layer.name), kind);
        None
    }

    fn dense(&mut self, i: usize, read: Option<Output>, checked: &mut Layer) -> Option<()> {
        let layer = &self.file.layers[i];
        let outputs = self.written(i);
        self.outputs[i + 1] = Some(Output::Values(outputs));
        let Some(Output::Values(inputs)) = read else { return None };
        let (inputs, outputs) = (inputs?, outputs?);
        let multiply_adds = inputs.saturating_mul(outputs);
        if multiply_adds > MAX_TENSOR {
            let expected = format!("at most {MAX_TENSOR} weights");
            self.refuse(layer, layer.line, "outputs", expected, format!("{inputs} x {outputs}"));
        }
        (checked.inputs, checked.outputs) = (inputs, outputs);
        checked.cost = Cost { multiply_adds, in_edges: None, per: CostUnit::Prediction };
        checked.field.from = FieldStart::Window;
        Some(())
    }
}

/// Checks the head of `file`, which reads the readout of `layers` as an image:
///
/// ```text
/// channels = (channels of a cell) (cells in time),   height = rows,   width = columns
/// ```
///
/// Leaves out layers with problems. Without problems, the engine accepts the layers as a head.
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
    let is_readout = |kind: &FileKind| matches!(kind.kind, LayerKind::Readout { .. });
    // A missing readout was reported.
    let Some(readout) = file.layers.iter().find(|layer| layer.kind.as_ref().is_some_and(is_readout)) else {
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
        scope: Scope { input: &readout.name, second: "with", place: "of a table [[head]]", above: true },
        shape,
        state: false,
        names: file.outputs.as_ref(),
        by_channel: false,
    };
    frames::check(stack, problems)
}

/// The image that a head reads from the readout `layer`.
fn image(layer: &Layer) -> Option<FrameShape> {
    let LayerKind::Readout { columns, rows, times, .. } = layer.kind else { return None };
    Some(FrameShape::Image { channels: layer.inputs.saturating_mul(times), height: rows, width: columns })
}
