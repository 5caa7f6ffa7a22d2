//! Pictures of a network: text in the DOT language, and, with the feature `svg`, SVG.

#[cfg(feature = "svg")]
pub(crate) use drawn::svg;

use super::view::View;

/// The DOT text of `view`: a cluster for each level, dashed edges for second inputs.
pub(crate) fn dot(view: &View<'_>) -> String {
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
    for row in &view.rows {
        let name = quoted(row.name);
        lines.push(format!("  {} -> {name};", quoted(row.from)));
        lines.extend(row.joins.map(|(joins, [_, mark])| {
            format!("  {} -> {name} [style = dashed, label = {}];", quoted(joins), quoted(mark))
        }));
    }
    lines.push("}\n".to_owned());
    lines.join("\n")
}

/// The boxes of a band, or the boxes without a band.
fn members(view: &View<'_>, band: Option<usize>) -> impl Iterator<Item = String> {
    let input = &view.input;
    let label = quoted(&format!("{}\n{}", input.name, input.word));
    let input =
        (input.band == band).then(|| format!("{} [shape = oval, label = {label}];", quoted(input.name)));
    let rows = view.rows.iter().filter(move |row| row.band == band).map(|row| {
        let label = format!("{}\n{}\n{}", row.name, row.kind, row.shapes.join(" -> "));
        format!("{} [label = {}];", quoted(row.name), quoted(&label))
    });
    input.into_iter().chain(rows)
}

fn quoted(text: &str) -> String {
    format!("\"{}\"", text.replace('\\', "\\\\").replace('"', "\\\"").replace('\n', "\\n"))
}

#[cfg(feature = "svg")]
mod drawn {
    use std::iter::once;

    use meissner_plot::{Network, Node, Panel, page};

    use crate::inspect::view::{View, grouped};

    /// The SVG picture of `view`.
    pub(crate) fn svg(view: &View<'_>) -> String {
        let input = Node {
            name: view.input.name,
            kind: view.input.about.to_owned(),
            shape: with_commas(&view.input.shape),
            fill: "#ffffff",
            band: view.input.band,
            from: None,
            joins: None,
        };
        let boxes = view.rows.iter().map(|row| {
            let parameters =
                (row.parameters > 0).then(|| format!(", {} parameters", grouped(row.parameters as u64)));
            let shape = with_commas(&row.shapes.join(" \u{2192} ")) + &parameters.unwrap_or_default();
            Node {
                name: row.name,
                kind: row.kind.clone(),
                shape,
                fill: row.fill,
                band: row.band,
                from: Some(row.from),
                joins: row.joins.map(|(joins, [_, mark])| (joins, mark)),
            }
        });
        let network = Network { bands: view.bands.clone(), boxes: once(input).chain(boxes).collect() };
        page(view.name, &view.about, &[vec![Panel::Network(network)]])
    }

    /// A shape with a comma between thousands.
    fn with_commas(shape: &str) -> String {
        let words = shape.split(' ').map(|word| word.parse().map_or_else(|_| word.to_owned(), grouped));
        words.collect::<Vec<_>>().join(" ")
    }
}
