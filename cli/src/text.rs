//! Numbers and tables of text reports.

mod folded;

use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::Path;

pub(crate) use folded::Folded;

/// Largest width of a line: the columns of a small terminal.
pub(crate) const WIDTH: usize = 80;

/// Microseconds with few decimals: none from 1,000 on, one from 100 on, otherwise two.
pub(crate) fn duration(us: f64) -> String {
    let decimals = match us {
        1000.0.. => 0,
        100.0.. => 1,
        _ => 2,
    };
    format!("{us:.decimals$}")
}

/// The cell of a missing value.
pub(crate) const NONE: &str = "-";

/// The cell of `value`, if there is one.
pub(crate) fn cell<T>(value: Option<T>, text: impl FnOnce(T) -> String) -> String {
    value.map_or_else(|| NONE.to_owned(), text)
}

/// `bytes` in units of 2^20.
pub(crate) fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// `share` in percent.
pub(crate) fn percent(share: f64) -> String {
    format!("{:.2}", 100.0 * share)
}

/// An interval of shares in percent.
pub(crate) fn interval((low, high): (f64, f64)) -> String {
    format!("{} to {}", percent(low), percent(high))
}

/// The last part of a path, or the path itself if it has no parts.
pub(crate) fn file_name(path: &str) -> &str {
    Path::new(path).file_name().and_then(OsStr::to_str).unwrap_or(path)
}

/// A table with indented lines. The first column is aligned to the left, the others to the right,
/// two spaces apart.
#[derive(Default)]
pub(crate) struct Table {
    rows: Vec<Vec<String>>,
    /// Whether all columns are aligned to the left.
    left_aligned: bool,
}

impl Table {
    /// A table with these headings.
    pub(crate) fn new(headings: &[&str]) -> Self {
        Self { rows: vec![headings.iter().map(|&h| h.to_owned()).collect()], left_aligned: false }
    }

    /// Writes an empty line, then a table of `rows`.
    pub(crate) fn section<R: IntoIterator<Item = String>>(
        out: &mut dyn Write,
        headings: &[impl AsRef<str>],
        rows: impl IntoIterator<Item = R>,
    ) -> io::Result<()> {
        let mut table = Self::new(&headings.iter().map(AsRef::as_ref).collect::<Vec<_>>());
        rows.into_iter().for_each(|row| table.row(row));
        writeln!(out)?;
        table.write(out)
    }

    /// Aligns all columns to the left.
    pub(crate) fn left_aligned(self) -> Self {
        Self { left_aligned: true, ..self }
    }

    /// Appends a row.
    pub(crate) fn row(&mut self, cells: impl IntoIterator<Item = String>) {
        self.rows.push(cells.into_iter().collect());
    }

    /// All lines. A table wider than [`WIDTH`] is split into several tables with an empty line
    /// between them, each with the first column.
    pub(crate) fn lines(&self) -> Vec<String> {
        let columns = self.rows.iter().map(Vec::len).max().unwrap_or(0);
        let width = |c: usize| self.rows.iter().filter_map(|r| r.get(c)).map(|s| s.chars().count()).max();
        let widths: Vec<usize> = (0..columns).map(|c| width(c).unwrap_or(0)).collect();
        let first = 2 + widths.first().copied().unwrap_or(0);
        let mut blocks: Vec<Vec<usize>> = Vec::new();
        let mut taken = 0;
        for (c, &width) in widths.iter().enumerate().skip(1) {
            match blocks.last_mut() {
                Some(block) if taken + 2 + width <= WIDTH => block.push(c),
                _ => {
                    blocks.push(vec![c]);
                    taken = first;
                }
            }
            taken += 2 + width;
        }
        if blocks.is_empty() {
            blocks.push(Vec::new());
        }
        let line = |row: &Vec<String>, block: &[usize]| {
            let cell = |c: usize| row.get(c).map_or("", String::as_str);
            let mut line = format!("  {:<1$}", cell(0), first - 2);
            for &c in block {
                let (text, width) = (cell(c), widths[c]);
                let padding = " ".repeat(width - text.chars().count());
                let (before, after) =
                    if self.left_aligned { ("", padding.as_str()) } else { (padding.as_str(), "") };
                line.extend(["  ", before, text, after]);
            }
            line.truncate(line.trim_end().len());
            line
        };
        let lines =
            blocks.iter().map(|block| self.rows.iter().map(|row| line(row, block)).collect::<Vec<_>>());
        lines.collect::<Vec<_>>().join(&String::new())
    }

    /// Writes all rows.
    pub(crate) fn write(&self, out: &mut dyn Write) -> io::Result<()> {
        self.lines().iter().try_for_each(|line| writeln!(out, "{line}"))
    }
}

#[cfg(test)]
mod tests {
    use super::Table;

    #[test]
    fn a_table_that_is_wider_than_a_terminal_becomes_several_with_the_same_first_column() {
        let headings: Vec<String> = (0..12).map(|i| format!("heading {i}")).collect();
        let mut table = Table::new(&headings.iter().map(String::as_str).collect::<Vec<_>>());
        table.row((0..12).map(|i| i.to_string()));
        let lines = table.lines();
        assert!(lines.len() == 5 && lines[2].is_empty(), "{lines:?}");
        assert!(lines.iter().all(|line| line.chars().count() <= 80), "{lines:?}");
        assert!(lines[3].starts_with("  heading 0") && lines[3].ends_with("heading 11"), "{lines:?}");
        let words = lines.join(" ");
        assert!(headings.iter().all(|heading| words.contains(heading.as_str())), "{lines:?}");
    }

    #[test]
    fn columns_are_as_wide_as_their_widest_cell() {
        let mut table = Table::new(&["layer", "rows"]);
        table.row(["a".to_owned(), "12,345".to_owned()]);
        let mut text = Vec::new();
        table.write(&mut text).expect("a vector takes everything");
        assert_eq!(String::from_utf8_lossy(&text), "  layer    rows\n  a      12,345\n");
    }
}
