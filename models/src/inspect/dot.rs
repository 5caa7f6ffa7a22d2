//! A network in the DOT language: a cluster for each level, dashed edges for second inputs.

use super::view::View;

/// The DOT text of `view`.
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
