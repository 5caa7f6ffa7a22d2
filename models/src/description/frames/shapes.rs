//! The inputs of layers, and shapes, costs and bounds, layer after layer in the order of the file.
//!
//! Input: a [`Stack`] of layers. Output: checked [`FrameLayer`]s, except those with problems.
//! Invariant: without problems, the output contains all layers, each reads layers above it, and the
//! last depends on all.

use meissner_engine::frames::FrameShape::{self, Image, Vector};

use super::layer::{FrameKind, FrameLayer, MAX_CHANNELS, MAX_SIDE};
use crate::description::document::ParsedLayer;
use crate::description::problem::{ProblemKind, Problems};
use crate::description::references::{Reads, Scope, check_names, references, report_unused};
use crate::description::table::Spanned;
use crate::description::tensors::{MAX_TENSOR, Needed};

/// Maximum number of parameters of a network, and of values that its layers write and keep: 1 GiB
/// of f32 each.
const MAX_VALUES: usize = 1 << 28;

/// The two shapes, as named in messages.
const IMAGE: &str = "an image";
const VECTOR: &str = "a vector (an image becomes one in a flatten layer)";

/// Layers in the order of the file.
#[derive(Clone, Copy, Debug)]
pub(in crate::description) struct Stack<'a> {
    pub(in crate::description) layers: &'a [ParsedLayer<FrameKind>],
    pub(in crate::description) scope: Scope<'a>,
    /// The shape of the input; `None` if a problem of it was reported.
    pub(in crate::description) shape: Option<FrameShape>,
    pub(in crate::description) state: bool,
    pub(in crate::description) names: Option<&'a Spanned<Vec<String>>>,
    /// Whether a predicted image has a name for each channel instead of for each value.
    pub(in crate::description) by_channel: bool,
}

/// The known properties of the frame or of a layer's output.
#[derive(Clone, Copy, Debug)]
struct Known {
    shape: FrameShape,
    /// Approximate mean square of its values, for drawn weights.
    square: f64,
}

/// A key that refers to an input, its line, and the node of the input.
type Reference = (&'static str, usize, usize);

struct Shapes<'a> {
    stack: Stack<'a>,
    problems: &'a mut Problems,
    /// Properties of the frame, then of each layer so far.
    known: Vec<Option<Known>>,
    values: usize,
    parameters: usize,
}

pub(in crate::description) fn check(stack: Stack<'_>, problems: &mut Problems) -> Vec<FrameLayer> {
    let before = problems.0.len();
    let reads = references(stack.layers, stack.scope, problems);
    let known = vec![stack.shape.map(|shape| Known { shape, square: 1.0 })];
    let values = stack.shape.map_or(0, FrameShape::values);
    let mut shapes = Shapes { stack, problems, known, values, parameters: 0 };
    let mut layers = Vec::new();
    for (layer, &reads) in stack.layers.iter().zip(&reads) {
        let checked = shapes.layer(layer, reads);
        shapes.known.push(checked.as_ref().map(|c| Known { shape: c.output, square: c.mean_square() }));
        layers.extend(checked);
    }
    let Some(last) = stack.layers.last() else {
        if problems.0.is_empty() {
            problems.add(1, None, ProblemKind::MissingLayer { expected: "at least one" });
        }
        return layers;
    };
    if let Some(checked) = layers.last().filter(|checked| checked.line == last.line) {
        let expected = match checked.output {
            Image { channels, .. } if stack.by_channel => channels,
            output => output.values(),
        };
        check_names(stack.names, &last.name, expected, problems);
    }
    // With an unknown kind or reference, a layer that seems unused may be meant to be read.
    if problems.0.len() == before && stack.layers.iter().all(|layer| layer.kind.is_some()) {
        report_unused(stack.layers, &reads, stack.layers.len() - 1, |_| false, problems);
    }
    layers
}

impl Shapes<'_> {
    fn report(&mut self, line: usize, layer: &ParsedLayer<FrameKind>, kind: ProblemKind) {
        self.problems.add(line, Some(&layer.name), kind);
    }

    /// The name of the frame or of a layer in messages.
    fn describe(&self, read: usize) -> String {
        let shape = self.known[read].map_or_else(String::new, |known| format!(" ({})", known.shape));
        match read.checked_sub(1).map(|i| &self.stack.layers[i]) {
            None => format!("{:?}{shape}", self.stack.scope.input),
            Some(layer) => {
                let word = layer.kind.as_ref().map_or("unknown", FrameKind::word);
                format!("{word} layer {:?} on line {}{shape}", layer.name, layer.line)
            }
        }
    }

    fn refuse(
        &mut self,
        layer: &ParsedLayer<FrameKind>,
        (key, line, read): Reference,
        expected: &str,
    ) -> Option<FrameShape> {
        let found = self.describe(read);
        self.report(line, layer, ProblemKind::value(key, expected, found));
        None
    }

    fn layer(&mut self, layer: &ParsedLayer<FrameKind>, [read, joined]: Reads) -> Option<FrameLayer> {
        let (kind, read) = (layer.kind.clone()?, read?);
        let output = self.output(layer, &kind, ("from", layer.reading_line(), read), joined)?;
        let input = self.known[read]?;
        let other = joined.and_then(|joined| self.known[joined]).unwrap_or(input);
        let from = read.checked_sub(1).map_or(self.stack.scope.input, |i| &self.stack.layers[i].name);
        let checked = FrameLayer {
            name: layer.name.clone(),
            line: layer.line,
            kind,
            from: from.to_owned(),
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
        let checked = checked.counted();
        if checked.state > 0 && !self.stack.state {
            let expected = "a layer without state: predictions cannot depend on how often they are read";
            let found = format!("{:?}", checked.kind.word());
            self.report(layer.line, layer, ProblemKind::value("kind", expected, found));
        }
        self.bounded(layer, checked)
    }

    fn output(
        &mut self,
        layer: &ParsedLayer<FrameKind>,
        kind: &FrameKind,
        from: Reference,
        joined: Option<usize>,
    ) -> Option<FrameShape> {
        let input = self.known[from.2]?.shape;
        let output = match (kind, input) {
            (FrameKind::Concat { with }, _) => self.joined(layer, with, input, joined?)?,
            (&FrameKind::Dense { outputs, .. }, Vector(_)) => Vector(outputs),
            (&FrameKind::Lstm { hidden, .. }, Vector(_)) => Vector(hidden),
            (&FrameKind::Delay { frames }, Vector(values)) => Vector(values.saturating_mul(frames)),
            (FrameKind::Dense { .. } | FrameKind::Lstm { .. } | FrameKind::Delay { .. }, _) => {
                return self.refuse(layer, from, VECTOR);
            }
            (_, Vector(_)) => return self.refuse(layer, from, IMAGE),
            (kind, Image { channels, height, width }) => match *kind {
                FrameKind::Conv { channels, .. } | FrameKind::ConvLstm { hidden: channels, .. } => {
                    Image { channels, height, width }
                }
                FrameKind::UpConv { channels, .. } => {
                    Image { channels, height: 2 * height, width: 2 * width }
                }
                FrameKind::MaxPool => Image { channels, height: height / 2, width: width / 2 },
                FrameKind::AveragePool { size } => {
                    Image { channels, height: height / size, width: width / size }
                }
                FrameKind::SqueezeExcite { reduction } if channels < reduction => {
                    let expected = format!("at most the {channels} channels of the image");
                    let kind = ProblemKind::value("reduction", expected, reduction.to_string());
                    self.report(layer.line, layer, kind);
                    return None;
                }
                FrameKind::SqueezeExcite { .. } => input,
                FrameKind::Flatten => Vector(channels * height * width),
                // A sum or a mean of each channel; the other kinds are handled above.
                _ => Vector(channels),
            },
        };
        if fits(output) {
            return Some(output);
        }
        self.report(layer.line, layer, extent(output));
        None
    }

    /// Shape of two images or of two vectors, one after the other.
    fn joined(
        &mut self,
        layer: &ParsedLayer<FrameKind>,
        with: &str,
        input: FrameShape,
        joined: usize,
    ) -> Option<FrameShape> {
        let line = layer.second.as_ref().map_or(layer.line, |given| given.line);
        match (input, self.known[joined]?.shape) {
            (Vector(values), Vector(others)) => Some(Vector(values.saturating_add(others))),
            (Image { channels, height, width }, Image { channels: others, height: rows, width: columns }) => {
                if [rows, columns] == [height, width] {
                    return Some(Image { channels: channels + others, height, width });
                }
                let expected = format!("an image of {height} x {width} pixels");
                let found = format!("one of {rows} x {columns}");
                let kind = ProblemKind::Size { key: "with", reference: with.to_owned(), expected, found };
                self.report(line, layer, kind);
                None
            }
            (Vector(_), _) => self.refuse(layer, ("with", line, joined), VECTOR),
            (Image { .. }, _) => self.refuse(layer, ("with", line, joined), IMAGE),
        }
    }

    /// Returns `checked`, unless the network is too large with it.
    fn bounded(&mut self, layer: &ParsedLayer<FrameKind>, checked: FrameLayer) -> Option<FrameLayer> {
        let largest = checked.tensors().iter().map(Needed::values).max().unwrap_or(0);
        self.values = self.values.saturating_add(checked.output.values()).saturating_add(checked.state);
        self.parameters = self.parameters.saturating_add(checked.parameters);
        let bounds = [
            (largest, MAX_TENSOR, "weights in a tensor"),
            (self.parameters, MAX_VALUES, "parameters in the network up to this layer"),
            (self.values, MAX_VALUES, "values in the layers up to this one"),
        ];
        let exceeded = bounds.into_iter().find(|&(found, most, _)| found > most);
        let Some((found, most, what)) = exceeded else { return Some(checked) };
        let expected = format!("at most {most} {what}");
        self.report(layer.line, layer, ProblemKind::Extent { expected, found: found.to_string() });
        None
    }
}

/// The problem of an output of `shape` that does not [fit](fits).
pub(in crate::description) fn extent(shape: FrameShape) -> ProblemKind {
    let expected = format!(
        "an output of at most {MAX_CHANNELS} channels and 1 to {MAX_SIDE} pixels a side, or at most {MAX_VALUES} \
         values"
    );
    ProblemKind::Extent { expected, found: shape.to_string() }
}

pub(in crate::description) fn fits(shape: FrameShape) -> bool {
    match shape {
        Vector(values) => values <= MAX_VALUES,
        Image { channels, height, width } => {
            let side = 1..=MAX_SIDE;
            channels <= MAX_CHANNELS && side.contains(&height) && side.contains(&width)
        }
    }
}
