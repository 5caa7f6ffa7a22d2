//! Figures and matrices as text: shares in percent.

use std::io::{self, Write};

use meissner_models::metrics::{Confusion, MeanStd};

use crate::text::{Table, grouped, percent};

/// Stands where there is no figure.
pub(super) const NONE: &str = "-";

/// Mean and deviation in percent.
pub(super) fn spread(figure: MeanStd) -> [String; 2] {
    [percent(figure.mean), figure.std.map_or_else(|| NONE.to_owned(), percent)]
}

/// `confusion` of `classes` in percent of each row, with the sum of the row in what is counted.
pub(super) fn confusion(
    out: &mut impl Write,
    classes: &[&str],
    counted: &str,
    confusion: &Confusion,
) -> io::Result<()> {
    let mut headings = vec![""];
    headings.extend(classes);
    headings.push(counted);
    let mut table = Table::new(&headings);
    for (class, row) in classes.iter().zip(confusion.rows()) {
        let sum: u64 = row.iter().sum();
        let cell = |&count: &u64| match sum {
            0 => NONE.to_owned(),
            _ => format!("{:.1}", 100.0 * count as f64 / sum as f64),
        };
        let cells = row.iter().map(cell).chain([grouped(sum)]);
        table.row(std::iter::once((*class).to_owned()).chain(cells));
    }
    table.write(out)
}
