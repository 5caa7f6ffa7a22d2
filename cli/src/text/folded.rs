//! Breaks long lines of text reports.

use std::io::{self, Write};

use super::WIDTH;

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

    /// Breaks no line from here on.
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

#[cfg(test)]
mod tests {
    use std::io::Write;

    use super::Folded;

    fn through(text: &str, for_people: bool) -> String {
        let mut out = Vec::new();
        let mut folded = Folded::new(&mut out, for_people);
        // In pieces, as formatted text comes.
        for piece in text.as_bytes().chunks(7) {
            folded.write_all(piece).expect("a vector takes everything");
        }
        folded.flush().expect("a vector takes everything");
        String::from_utf8(out).expect("text stays text")
    }

    #[test]
    fn a_long_line_goes_on_below_its_text_and_no_word_is_broken() {
        let text = format!("measured     {}end\nshort\n", "nineteen characters ".repeat(6));
        let folded = through(&text, true);
        assert!(folded.lines().all(|line| line.chars().count() <= 80), "{folded}");
        assert!(folded.lines().nth(1).is_some_and(|line| line.starts_with("             n")), "{folded}");
        assert!(folded.split_whitespace().eq(text.split_whitespace()));
        assert!(folded.ends_with("end\nshort\n"));
    }

    #[test]
    fn short_lines_long_words_and_text_for_programs_stay_as_they_are() {
        for text in ["a  b\n\n  c\nno end", &format!("{}\n", "x".repeat(100))] {
            assert_eq!(through(text, true), text);
        }
        let json = format!("{{\"a\": \"{}\"}}\n", "b ".repeat(100));
        assert_eq!(through(&json, false), json);
    }
}
