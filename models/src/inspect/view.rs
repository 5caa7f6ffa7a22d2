//! The content of a picture of a network: boxes in order, the inputs of each, and the bands that group them.
//!
//! Enters: a description of either kind. Leaves: a [`View`], and from it text in the DOT language and an SVG picture.

use std::iter::once;

use meissner_plot::{Panel, page};

use crate::description::frames::{FRAME, FrameDescription, FrameKind, FrameLayer};
use crate::description::{AnyDescription, Description, Layer, LayerKind};

/// A network as a picture shows it.
pub(super) struct View<'a> {
    pub(super) name: &'a str,
    /// Below the name.
    pub(super) about: String,
    pub(super) input: Input,
    /// Label of each band.
    pub(super) bands: Vec<String>,
    pub(super) nodes: Vec<Node<'a>>,
}

/// The box of the network's input.
pub(super) struct Input {
    pub(super) name: &'static str,
    /// One word about it.
    pub(super) word: String,
    /// One line about it.
    pub(super) about: String,
    pub(super) shape: String,
    pub(super) band: Option<usize>,
}

/// The box of a layer.
pub(super) struct Node<'a> {
    pub(super) name: &'a str,
    pub(super) kind: String,
    /// Of its input and its output.
    pub(super) shapes: [String; 2],
    /// `None` for a kind of layer without parameters.
    pub(super) parameters: Option<usize>,
    pub(super) fill: &'static str,
    pub(super) band: Option<usize>,
    pub(super) from: &'a str,
    /// Its second input, and the mark of the connection.
    pub(super) joins: Option<(&'a str, &'static str)>,
}

/// Fill of boxes, by kind of layer.
const CONVOLUTION: &str = "#cfe3f7";
const POOLING: &str = "#f8dfc4";
const READOUT: &str = "#f5e9b8";
const DENSE: &str = "#d5ecd0";
const RECURRENT: &str = "#e4d6f2";

impl Description {
    pub(super) fn view(&self) -> View<'_> {
        View {
            name: self.name(),
            about: format!("{} parameters, window {} ms", self.parameters(), self.span_us() as f64 / 1000.0),
            input: Input {
                name: "events",
                word: "polarity".to_owned(),
                about: "polarity of each event: -1 or 1".to_owned(),
                shape: "1 channel".to_owned(),
                band: Some(0),
            },
            bands: (0..self.levels()).map(|level| self.level_label(level)).collect(),
            nodes: self.layers().iter().map(node).chain(self.head().iter().map(frame_node)).collect(),
        }
    }

    /// The label of a level, which names its rows.
    fn level_label(&self, level: usize) -> String {
        let starts =
            |layer: &&Layer| matches!(layer.kind, LayerKind::Pool { .. }) && layer.level == Some(level);
        match self.layers().iter().find(starts).map(|layer| &layer.kind) {
            Some(LayerKind::Pool { cell, .. }) => format!("level {level}: cells of {cell}"),
            _ => format!("level {level}: events, {}", self.graph_summary()),
        }
    }
}

fn node(layer: &Layer) -> Node<'_> {
    let (fill, has_parameters) = match layer.kind {
        LayerKind::Block { .. } => (CONVOLUTION, true),
        LayerKind::Pool { .. } => (POOLING, false),
        LayerKind::Readout { .. } => (READOUT, false),
        LayerKind::Dense { .. } => (DENSE, true),
    };
    let joins = match &layer.kind {
        LayerKind::Block { skip: Some(skip), .. } => Some((skip.as_str(), "+")),
        _ => None,
    };
    Node {
        name: &layer.name,
        kind: layer.kind.to_string(),
        shapes: [layer.inputs.to_string(), layer.outputs.to_string()],
        parameters: has_parameters.then_some(layer.parameters),
        fill,
        band: layer.level,
        from: &layer.from,
        joins,
    }
}

impl AnyDescription {
    pub(super) fn view(&self) -> View<'_> {
        match self {
            Self::Events(description) => description.view(),
            Self::Frames(description) => description.view(),
        }
    }
}

impl FrameDescription {
    pub(super) fn view(&self) -> View<'_> {
        View {
            name: self.name(),
            about: format!(
                "{} parameters, {} multiply-adds a frame",
                self.parameters(),
                self.multiply_adds()
            ),
            input: Input {
                name: FRAME,
                word: self.source().word().to_owned(),
                about: self.source().word().to_owned(),
                shape: self.input().to_string(),
                band: None,
            },
            bands: Vec::new(),
            nodes: self.layers().iter().map(frame_node).collect(),
        }
    }
}

fn frame_node(layer: &FrameLayer) -> Node<'_> {
    let (fill, has_parameters) = match layer.kind {
        FrameKind::Conv { .. } | FrameKind::UpConv { .. } | FrameKind::SqueezeExcite { .. } => {
            (CONVOLUTION, true)
        }
        FrameKind::MaxPool | FrameKind::AveragePool { .. } | FrameKind::GlobalAverage | FrameKind::Sum => {
            (POOLING, false)
        }
        FrameKind::ConvLstm { .. } | FrameKind::Lstm { .. } => (RECURRENT, true),
        FrameKind::Delay { .. } => (RECURRENT, false),
        FrameKind::Concat { .. } | FrameKind::Flatten => (READOUT, false),
        FrameKind::Dense { .. } => (DENSE, true),
    };
    Node {
        name: &layer.name,
        kind: layer.kind.to_string(),
        shapes: [layer.input.to_string(), layer.output.to_string()],
        parameters: has_parameters.then_some(layer.parameters),
        fill,
        band: None,
        from: &layer.from,
        joins: layer.with().map(|with| (with, "with")),
    }
}

/// The SVG picture of `view`.
pub(super) fn svg(view: &View<'_>) -> String {
    let input = meissner_plot::Node {
        name: view.input.name,
        kind: view.input.about.clone(),
        shape: view.input.shape.clone(),
        fill: "#ffffff",
        band: view.input.band,
        from: None,
        joins: None,
    };
    let boxes = view.nodes.iter().map(|node| {
        let parameters = node.parameters.map(|parameters| format!(", {parameters} parameters"));
        meissner_plot::Node {
            name: node.name,
            kind: node.kind.clone(),
            shape: node.shapes.join(" \u{2192} ") + &parameters.unwrap_or_default(),
            fill: node.fill,
            band: node.band,
            from: Some(node.from),
            joins: node.joins,
        }
    });
    let network =
        meissner_plot::Network { bands: view.bands.clone(), boxes: once(input).chain(boxes).collect() };
    page(view.name, &view.about, &[vec![Panel::Network(network)]])
}

/// The DOT text of `view`: a cluster for each level, dashed edges for second inputs.
pub(super) fn dot(view: &View<'_>) -> String {
    let mut lines = vec![
        format!("digraph {} {{", quoted(view.name)),
        "  rankdir = TB;".to_owned(),
        "  node [shape = box, fontname = \"sans-serif\"];".to_owned(),
    ];
    for (band, label) in view.bands.iter().enumerate() {
        lines.push(format!("  subgraph cluster_{band} {{"));
        lines.push(format!("    label = {};", quoted(label)));
        lines.extend(members(view, Some(band)).map(|line| format!("    {line}")));
        lines.push("  }".to_owned());
    }
    lines.extend(members(view, None).map(|line| format!("  {line}")));
    for node in &view.nodes {
        let name = quoted(node.name);
        lines.push(format!("  {} -> {name};", quoted(node.from)));
        lines.extend(node.joins.map(|(joins, mark)| {
            format!("  {} -> {name} [style = dashed, label = {}];", quoted(joins), quoted(mark))
        }));
    }
    lines.push("}\n".to_owned());
    lines.join("\n")
}

/// The boxes of a band, or of none.
fn members(view: &View<'_>, band: Option<usize>) -> impl Iterator<Item = String> {
    let input = &view.input;
    let label = quoted(&format!("{}\n{}", input.name, input.word));
    let input =
        (input.band == band).then(|| format!("{} [shape = oval, label = {label}];", quoted(input.name)));
    let nodes = view.nodes.iter().filter(move |node| node.band == band).map(|node| {
        let label = format!("{}\n{}\n{}", node.name, node.kind, node.shapes.join(" -> "));
        format!("{} [label = {}];", quoted(node.name), quoted(&label))
    });
    input.into_iter().chain(nodes)
}

/// A quoted identifier or label.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n"))
}
