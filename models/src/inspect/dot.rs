//! A network in the DOT language: a cluster for each level, what is joined dashed.

use std::fmt::Write;

use super::view::{Node, View};
use crate::{AnyDescription, Description, FrameDescription};

impl Description {
    /// The graph in the DOT language of Graphviz.
    ///
    /// # Panics
    /// Never: it is written to a string.
    pub fn to_dot(&self) -> String {
        self.view().to_dot()
    }
}

impl FrameDescription {
    /// The layers in the DOT language of Graphviz.
    ///
    /// # Panics
    /// Never: it is written to a string.
    pub fn to_dot(&self) -> String {
        self.view().to_dot()
    }
}

impl AnyDescription {
    /// The network in the DOT language of Graphviz.
    ///
    /// # Panics
    /// Never: it is written to a string.
    pub fn to_dot(&self) -> String {
        match self {
            Self::Events(description) => description.to_dot(),
            Self::Frames(description) => description.to_dot(),
        }
    }
}

impl View<'_> {
    fn to_dot(&self) -> String {
        let mut dot = String::new();
        self.write_dot(&mut dot).expect("writing to a string does not fail");
        dot
    }

    fn write_dot(&self, dot: &mut String) -> std::fmt::Result {
        writeln!(dot, "digraph {} {{", quoted(self.name))?;
        writeln!(dot, "  rankdir = TB;\n  node [shape = box, fontname = \"sans-serif\"];")?;
        for (band, label) in self.bands.iter().enumerate() {
            writeln!(dot, "  subgraph cluster_{band} {{")?;
            writeln!(dot, "    label = {};", quoted(label))?;
            self.write_members(dot, "    ", Some(band))?;
            writeln!(dot, "  }}")?;
        }
        self.write_members(dot, "  ", None)?;
        for node in &self.nodes {
            writeln!(dot, "  {} -> {};", quoted(node.from), quoted(node.name))?;
            if let Some((joins, mark)) = node.joins {
                let (joins, name) = (quoted(joins), quoted(node.name));
                writeln!(dot, "  {joins} -> {name} [style = dashed, label = {}];", quoted(mark))?;
            }
        }
        writeln!(dot, "}}")
    }

    /// The boxes of a band, or of none.
    fn write_members(&self, dot: &mut String, indent: &str, band: Option<usize>) -> std::fmt::Result {
        if self.input.band == band {
            let (name, label) = (self.input.name, format!("{}\n{}", self.input.name, self.input.short));
            writeln!(dot, "{indent}{} [shape = oval, label = {}];", quoted(name), quoted(&label))?;
        }
        self.nodes.iter().filter(|node| node.band == band).try_for_each(|node| write_node(dot, indent, node))
    }
}

fn write_node(dot: &mut String, indent: &str, node: &Node<'_>) -> std::fmt::Result {
    let label = format!("{}\n{}\n{}", node.name, node.what, node.shapes.join(" -> "));
    writeln!(dot, "{indent}{} [label = {}];", quoted(node.name), quoted(&label))
}

/// A quoted identifier or label.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n"))
}
