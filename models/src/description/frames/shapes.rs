//! Who reads whom, and shapes, costs and bounds, layer after layer in the order of the file.
//!
//! Enters: a [`File`]. Leaves: checked [`FrameLayer`]s; layers of which something was reported are left out.
//! Invariant: where nothing was reported, all layers are there, every one reads what stands above it, and the last one,
//! which predicts, depends on all.

use std::collections::BTreeMap;

use meissner_engine::frames::FrameShape;

use super::super::problem::{ProblemKind, Problems};
use super::super::table::Given;
use super::super::tensors::Needed;
use super::file::{File, FileLayer};
use super::layer::{FrameKind, FrameLayer};
use super::{FRAME, LONGEST_SIDE, MOST_CHANNELS};

/// Most values of one tensor: 256 MiB of f32.
const LARGEST_TENSOR: usize = 1 << 26;
/// Most parameters of a network, and most values that its layers write and keep: 1 GiB of f32 each.
const MOST_VALUES: usize = 1 << 28;

/// What is known about the frame or a layer's output.
#[derive(Clone, Copy, Debug)]
struct Known {
    shape: FrameShape,
    /// About the mean square of its values, where weights are drawn.
    square: f64,
}

struct Shapes<'a> {
    file: &'a File,
    problems: &'a mut Problems,
    names: BTreeMap<&'a str, usize>,
    /// Of the frame, then of each layer so far.
    known: Vec<Option<Known>>,
    /// What each layer so far reads: 0 is the frame, i + 1 is layer i.
    reads: Vec<[Option<usize>; 2]>,
    values: usize,
    parameters: usize,
}

/// Checks what the layers read against what is there.
pub(super) fn check(file: &File, problems: &mut Problems) -> Vec<FrameLayer> {
    let before = problems.0.len();
    let mut names = BTreeMap::new();
    for (i, layer) in file.layers.iter().enumerate().filter(|(_, layer)| !layer.name.is_empty()) {
        let first: usize = *names.entry(layer.name.as_str()).or_insert(i);
        if first != i {
            let kind = ProblemKind::DuplicateName { first: file.layers[first].line };
            problems.add(layer.line, Some(&layer.name), kind);
        }
    }
    let frame = file.input.as_ref().and_then(|input| input.shape);
    let known = vec![frame.map(|shape| Known { shape, square: 1.0 })];
    let values = frame.map_or(0, FrameShape::values);
    let mut shapes = Shapes { file, problems, names, known, reads: Vec::new(), values, parameters: 0 };
    let mut layers = Vec::new();
    for layer in &file.layers {
        let checked = shapes.layer(layer);
        shapes.known.push(checked.as_ref().map(|c| Known { shape: c.output, square: c.mean_square() }));
        layers.extend(checked);
    }
    let reads = shapes.reads;
    if file.layers.is_empty() && problems.0.is_empty() {
        problems.add(1, None, ProblemKind::MissingLayer { expected: "at least one" });
    }
    output_names(file, &layers, problems);
    // Where a kind is unknown or a reference failed, what nothing reads may be meant to be read.
    if problems.0.len() == before && file.layers.iter().all(|layer| layer.kind.is_some()) {
        report_unused(file, &reads, problems);
        check_tensors(&layers, problems);
    }
    layers
}

impl Shapes<'_> {
    fn report(&mut self, line: usize, layer: &FileLayer, kind: ProblemKind) {
        self.problems.add(line, Some(&layer.name), kind);
    }

    /// What `given` refers to: 0 is the frame, i + 1 is layer i.
    fn refer(&mut self, layer: &FileLayer, key: &'static str, given: &Given<String>) -> Option<usize> {
        if given.value == FRAME {
            return Some(0);
        }
        let found = given.value.clone();
        match self.names.get(found.as_str()).copied() {
            Some(read) if read < self.reads.len() => Some(read + 1),
            Some(read) => {
                let line = self.file.layers[read].line;
                self.report(given.line, layer, ProblemKind::ForwardReference { key, found, line });
                None
            }
            None => {
                let kind = ProblemKind::UnknownReference { key, input: FRAME, found };
                self.report(given.line, layer, kind);
                None
            }
        }
    }

    /// What messages call the frame or a layer.
    fn describe(&self, read: usize) -> String {
        let shape = self.known[read].map_or_else(String::new, |known| format!(" ({})", known.shape));
        match read.checked_sub(1).map(|i| &self.file.layers[i]) {
            None => format!("{FRAME:?}{shape}"),
            Some(layer) => {
                let word = layer.kind.as_ref().map_or("unknown", FrameKind::word);
                format!("{word} layer {:?} on line {}{shape}", layer.name, layer.line)
            }
        }
    }

    /// Channels, rows and columns of what is read; reports a vector.
    fn image(
        &mut self,
        layer: &FileLayer,
        key: &'static str,
        line: usize,
        read: usize,
    ) -> Option<[usize; 3]> {
        match self.known[read]?.shape {
            FrameShape::Image { channels, height, width } => Some([channels, height, width]),
            FrameShape::Vector(_) => {
                let found = self.describe(read);
                self.report(line, layer, ProblemKind::ReferenceKind { key, expected: "an image", found });
                None
            }
        }
    }

    /// Number of values that are read; reports an image.
    fn vector(&mut self, layer: &FileLayer, key: &'static str, line: usize, read: usize) -> Option<usize> {
        match self.known[read]?.shape {
            FrameShape::Vector(values) => Some(values),
            FrameShape::Image { .. } => {
                let (found, expected) =
                    (self.describe(read), "a vector (an image becomes one in a flatten layer)");
                self.report(line, layer, ProblemKind::ReferenceKind { key, expected, found });
                None
            }
        }
    }

    fn layer(&mut self, layer: &FileLayer) -> Option<FrameLayer> {
        let read = match &layer.from {
            Some(given) => self.refer(layer, "from", given),
            None => Some(self.reads.len()),
        };
        let joined = layer.with.as_ref().and_then(|given| self.refer(layer, "with", given));
        self.reads.push([read, joined]);
        let (kind, read) = (layer.kind.clone()?, read?);
        let line = layer.from.as_ref().map_or(layer.line, |given| given.line);
        let output = self.output(layer, &kind, line, read, joined)?;
        let input = self.known[read]?;
        let other = joined.and_then(|joined| self.known[joined]).unwrap_or(input);
        let from = read.checked_sub(1).map_or(FRAME, |i| &self.file.layers[i].name).to_owned();
        let checked = FrameLayer {
            name: layer.name.clone(),
            line: layer.line,
            kind,
            from,
            input: input.shape,
            output,
            state: 0,
            parameters: 0,
            multiply_adds: 0,
            weights: layer.weights.clone(),
            reads: read,
            joins: joined,
            square: f64::midpoint(input.square, other.square),
        };
        self.bounded(layer, checked.counted())
    }

    /// Shape of what a layer of `kind` writes.
    fn output(
        &mut self,
        layer: &FileLayer,
        kind: &FrameKind,
        line: usize,
        read: usize,
        joined: Option<usize>,
    ) -> Option<FrameShape> {
        let image = |channels, height, width| FrameShape::Image { channels, height, width };
        let output = match *kind {
            FrameKind::Dense { outputs, .. } => {
                self.vector(layer, "from", line, read)?;
                FrameShape::Vector(outputs)
            }
            FrameKind::Lstm { hidden, .. } => {
                self.vector(layer, "from", line, read)?;
                FrameShape::Vector(hidden)
            }
            FrameKind::Delay { frames } => {
                FrameShape::Vector(self.vector(layer, "from", line, read)?.saturating_mul(frames))
            }
            FrameKind::Concat { ref with } => self.joined(layer, with, read, joined?)?,
            _ => {
                let [channels, height, width] = self.image(layer, "from", line, read)?;
                match *kind {
                    FrameKind::Conv { channels, .. } | FrameKind::ConvLstm { hidden: channels, .. } => {
                        image(channels, height, width)
                    }
                    FrameKind::UpConv { channels, .. } => image(channels, 2 * height, 2 * width),
                    FrameKind::MaxPool => image(channels, height / 2, width / 2),
                    FrameKind::AveragePool { size } => image(channels, height / size, width / size),
                    FrameKind::SqueezeExcite { reduction } => {
                        if channels < reduction {
                            let expected = format!("at most the {channels} channels of the image");
                            let found = reduction.to_string();
                            let kind = ProblemKind::Value { key: "reduction", expected, found };
                            self.report(layer.line, layer, kind);
                            return None;
                        }
                        image(channels, height, width)
                    }
                    FrameKind::Flatten => FrameShape::Vector(channels * height * width),
                    // A sum or a mean of each channel; the rest has been dealt with.
                    _ => FrameShape::Vector(channels),
                }
            }
        };
        let fits = match output {
            FrameShape::Vector(values) => values <= MOST_VALUES,
            FrameShape::Image { channels, height, width } => {
                let side = 1..=LONGEST_SIDE;
                channels <= MOST_CHANNELS && side.contains(&height) && side.contains(&width)
            }
        };
        if !fits {
            let expected = format!(
                "an output of at most {MOST_CHANNELS} channels and 1 to {LONGEST_SIDE} pixels a side, or at most \
                 {MOST_VALUES} values"
            );
            self.report(layer.line, layer, ProblemKind::Extent { expected, found: output.to_string() });
        }
        fits.then_some(output)
    }

    /// Shape of two images side by side, or of two vectors one behind the other.
    fn joined(&mut self, layer: &FileLayer, with: &str, read: usize, joined: usize) -> Option<FrameShape> {
        let line = layer.with.as_ref().map_or(layer.line, |given| given.line);
        let (channels, height, width) = match self.known[read]?.shape {
            FrameShape::Vector(values) => {
                let others = self.vector(layer, "with", line, joined)?;
                return Some(FrameShape::Vector(values.saturating_add(others)));
            }
            FrameShape::Image { channels, height, width } => (channels, height, width),
        };
        let [others, rows, columns] = self.image(layer, "with", line, joined)?;
        if [rows, columns] != [height, width] {
            let (expected, found) = (format!("{height} x {width}"), format!("{rows} x {columns}"));
            self.report(line, layer, ProblemKind::Size { reference: with.to_owned(), expected, found });
            return None;
        }
        Some(FrameShape::Image { channels: channels + others, height, width })
    }

    /// `checked`, unless with it the network is too large.
    fn bounded(&mut self, layer: &FileLayer, checked: FrameLayer) -> Option<FrameLayer> {
        let largest = checked.tensors().iter().map(Needed::values).max().unwrap_or(0);
        self.values = self.values.saturating_add(checked.output.values()).saturating_add(checked.state);
        self.parameters = self.parameters.saturating_add(checked.parameters);
        let bounds = [
            (largest, LARGEST_TENSOR, "weights in a tensor"),
            (self.parameters, MOST_VALUES, "parameters in the network up to this layer"),
            (self.values, MOST_VALUES, "values in the layers up to this one"),
        ];
        let exceeded = bounds.into_iter().find(|&(found, most, _)| found > most);
        let Some((found, most, what)) = exceeded else { return Some(checked) };
        let expected = format!("at most {most} {what}");
        self.report(layer.line, layer, ProblemKind::Extent { expected, found: found.to_string() });
        None
    }
}

/// Compares the prediction's values, or channels, with their names.
fn output_names(file: &File, layers: &[FrameLayer], problems: &mut Problems) {
    let (Some(last), Some(checked), Some(names)) = (file.layers.last(), layers.last(), &file.output.names)
    else {
        return;
    };
    let expected = match checked.output {
        FrameShape::Vector(values) => values,
        FrameShape::Image { channels, .. } => channels,
    };
    if checked.line == last.line && names.value.len() != expected {
        let kind = ProblemKind::OutputNames { layer: last.name.clone(), expected, found: names.value.len() };
        problems.add(names.line, None, kind);
    }
}

/// Reports the layers that the last one does not depend on.
fn report_unused(file: &File, reads: &[[Option<usize>; 2]], problems: &mut Problems) {
    let mut used = vec![false; file.layers.len() + 1];
    used[file.layers.len()] = true;
    for (i, layer) in file.layers.iter().enumerate().rev() {
        if used[i + 1] {
            reads[i].iter().flatten().for_each(|&read| used[read] = true);
        } else {
            problems.add(layer.line, Some(&layer.name), ProblemKind::Unused);
        }
    }
}

/// Reports layers that would read one tensor.
fn check_tensors(layers: &[FrameLayer], problems: &mut Problems) {
    let mut readers: BTreeMap<String, &FrameLayer> = BTreeMap::new();
    for layer in layers {
        for tensor in layer.tensors() {
            let first = *readers.entry(tensor.name.clone()).or_insert(layer);
            if first.name != layer.name {
                let kind = ProblemKind::SharedTensor { tensor: tensor.name, other: first.name.clone() };
                problems.add(layer.line, Some(&layer.name), kind);
                break;
            }
        }
    }
}
