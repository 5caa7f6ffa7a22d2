//! A network as a table of aligned columns.

use std::fmt::{self, Write};

use super::view::View;

/// Columns that every terminal has.
const WIDTH: usize = 80;

impl fmt::Display for View<'_> {
    /// The lines above the table, the table and the lines below it.
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        for (word, text) in &self.head {
            writeln!(f, "{word:<10} {text}")?;
        }
        f.write_char('\n')?;
        let [cost, last] = self.headings;
        let headings = ["layer", "kind", "reads", "shape", "parameters", cost, last].map(str::to_owned);
        let rows = self.rows.iter().map(|row| {
            let joined = row.joins.map(|(joins, [mark, _])| format!("{mark} {joins}"));
            let [cost, last] = row.columns.clone();
            [
                row.name.to_owned(),
                row.kind.clone(),
                row.from.to_owned() + &joined.unwrap_or_default(),
                row.shapes.join(" -> "),
                row.parameters.to_string(),
                cost,
                last,
            ]
        });
        aligned(&std::iter::once(headings).chain(rows).collect::<Vec<_>>(), f)?;
        write!(f, "\n{}", self.foot.join("\n"))
    }
}

/// Writes `lines`, headings first, in aligned columns. Wider than a terminal, they are split into
/// tables that repeat the first column, with an empty line between.
fn aligned<const N: usize>(lines: &[[String; N]], f: &mut fmt::Formatter<'_>) -> fmt::Result {
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
        for line in lines {
            let cells = std::iter::once(&0).chain(block);
            let padded: Vec<String> = cells.map(|&c| format!("{:<1$}", line[c], widths[c])).collect();
            writeln!(f, "{}", padded.join("  ").trim_end())?;
        }
    }
    Ok(())
}
