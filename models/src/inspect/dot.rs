//! A description's graph in the DOT language: a cluster for each level, skips dashed.

use std::fmt::Write;

use super::table::kind;
use crate::{Description, Layer, LayerKind};

impl Description {
    /// The graph in the DOT language of Graphviz.
    ///
    /// # Panics
    /// Never: it is written to a string.
    pub fn to_dot(&self) -> String {
        let mut dot = String::new();
        self.write_dot(&mut dot).expect("writing to a string does not fail");
        dot
    }

    fn write_dot(&self, dot: &mut String) -> std::fmt::Result {
        writeln!(dot, "digraph {} {{", quoted(self.name()))?;
        writeln!(dot, "  rankdir = TB;\n  node [shape = box, fontname = \"sans-serif\"];")?;
        for level in 0..self.levels() {
            writeln!(dot, "  subgraph cluster_{level} {{")?;
            writeln!(dot, "    label = {};", quoted(&self.level_label(level)))?;
            if level == 0 {
                writeln!(dot, "    \"events\" [shape = oval, label = \"events\\npolarity\"];")?;
            }
            for layer in self.layers().iter().filter(|layer| layer.level == Some(level)) {
                write_node(dot, "    ", layer)?;
            }
            writeln!(dot, "  }}")?;
        }
        for layer in self.layers().iter().filter(|layer| layer.level.is_none()) {
            write_node(dot, "  ", layer)?;
        }
        for layer in self.layers() {
            writeln!(dot, "  {} -> {};", quoted(&layer.from), quoted(&layer.name))?;
            if let LayerKind::Spline { skip: Some(skip), .. } = &layer.kind {
                let (skip, name) = (quoted(skip), quoted(&layer.name));
                writeln!(dot, "  {skip} -> {name} [style = dashed, label = \"+\"];")?;
            }
        }
        writeln!(dot, "}}")
    }

    /// What the rows of a level are.
    pub(super) fn level_label(&self, level: usize) -> String {
        let starts =
            |layer: &&Layer| matches!(layer.kind, LayerKind::Pool { .. }) && layer.level == Some(level);
        match self.layers().iter().find(starts).map(|layer| &layer.kind) {
            Some(LayerKind::Pool { cell, .. }) => format!("level {level}: cells of {cell}"),
            _ => format!("level {level}: events, {}", self.graph_summary()),
        }
    }
}

fn write_node(dot: &mut String, indent: &str, layer: &Layer) -> std::fmt::Result {
    let label = format!("{}\n{}\n{} -> {}", layer.name, kind(layer), layer.inputs, layer.outputs);
    writeln!(dot, "{indent}{} [label = {}];", quoted(&layer.name), quoted(&label))
}

/// A quoted identifier or label.
fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n"))
}
