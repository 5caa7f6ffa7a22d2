//! Numbers and tables of text reports.

use std::ffi::OsStr;
use std::io::{self, Write};
use std::path::Path;

use meissner_plot::percent;

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

/// The headings in `text`, separated by ` | `.
pub(crate) fn columns(text: &str) -> Vec<&str> {
    text.split(" | ").collect()
}

/// `bytes` in units of 2^20.
pub(crate) fn mebibytes(bytes: u64) -> String {
    format!("{:.1} MiB", bytes as f64 / f64::from(1 << 20))
}

/// An interval of shares in percent.
pub(crate) fn interval((low, high): (f64, f64)) -> String {
    format!("{} to {}", percent(low), percent(high))
}

/// The last part of a path, or the path itself if it has no parts.
pub(crate) fn file_name(path: &str) -> &str {
    Path::new(path).file_name().and_then(OsStr::to_str).unwrap_or(path)
}

/// A table with indented lines: the first column aligned left, others right, two spaces apart.
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

/// Breaks lines of more than [`WIDTH`] characters between words. If a line begins with a key, the
/// rest is indented to the text after the key.
pub(crate) struct Folded<W: Write> {
    out: W,
    /// Whether lines are broken. Lines for programs are not.
    folds: bool,
    /// The line so far.
    line: Vec<u8>,
}

impl<W: Write> Folded<W> {
    /// Writes to `out`, and breaks long lines if the text is `for_people`.
    pub(crate) fn new(out: W, for_people: bool) -> Self {
        Self { out, folds: for_people, line: Vec::new() }
    }

    /// Stops breaking lines from here on.
    pub(crate) fn unfold(&mut self) {
        self.folds = false;
    }

    fn end_of_line(&mut self) -> io::Result<()> {
        let line = std::mem::take(&mut self.line);
        match str::from_utf8(&line) {
            Ok(text) if text.trim_end_matches('\n').chars().count() > WIDTH => {
                self.out.write_all(folded(text.trim_end_matches('\n')).as_bytes())
            }
            _ => self.out.write_all(&line),
        }
    }
}

impl<W: Write> Write for Folded<W> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if !self.folds {
            return self.out.write(bytes);
        }
        for part in bytes.split_inclusive(|&byte| byte == b'\n') {
            self.line.extend_from_slice(part);
            if part.ends_with(b"\n") {
                self.end_of_line()?;
            }
        }
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        let rest = std::mem::take(&mut self.line);
        self.out.write_all(&rest)?;
        self.out.flush()
    }
}

/// `line` in lines of at most [`WIDTH`] characters, if no word is longer. Each line has its end.
fn folded(line: &str) -> String {
    let start = line.len() - line.trim_start().len();
    let key = line[start..].find("  ").map(|end| start + end);
    let text = key.map(|end| end + line[end..].len() - line[end..].trim_start().len());
    let indent = text.map(|at| line[..at].chars().count()).filter(|&at| at <= WIDTH / 3).unwrap_or(start + 2);
    let (mut all, mut width) = (String::new(), 0);
    // Blanks between words are kept, except at the end of a line.
    for word in line.split_inclusive(' ') {
        let length = word.trim_end().chars().count();
        if width + length > WIDTH && width > indent && length > 0 {
            all.truncate(all.trim_end().len());
            all.push('\n');
            all.extend(std::iter::repeat_n(' ', indent));
            width = indent;
        }
        all.push_str(word);
        width += word.chars().count();
    }
    all.truncate(all.trim_end().len());
    all.push('\n');
    all
}
