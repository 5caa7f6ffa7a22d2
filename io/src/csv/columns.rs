//! Which column holds what: by the header's names, or t, x, y, p where there is no header.

use meissner_engine::Event;

use super::field::{Refusal, bare, coordinate, polarity, shown, time};
use crate::names;

/// What a line can have wrong: which field, and how.
pub(super) type Fault = (&'static str, Refusal);

/// The columns t, x, y, p by index, and how many columns there are.
#[derive(Clone, Copy, Debug)]
pub(super) struct Columns {
    t: usize,
    x: usize,
    y: usize,
    p: usize,
    count: usize,
}

impl Columns {
    /// Columns t, x, y, p.
    pub(super) const PLAIN: Self = Self { t: 0, x: 1, y: 2, p: 3, count: 4 };

    /// Whether a line is a header: its first field starts as a name does.
    pub(super) fn is_header(line: &[u8]) -> bool {
        let first = line.split(|&b| b == b',').next().map(bare).unwrap_or_default();
        first.first().is_some_and(|b| b.is_ascii_alphabetic() || *b == b'_')
    }

    /// The columns that a header names.
    pub(super) fn from_header(line: &[u8]) -> Result<Self, Fault> {
        let names: Vec<_> = line.split(|&b| b == b',').map(|name| bare(name).to_ascii_lowercase()).collect();
        let find = |what, known: &[&str]| {
            let mut found =
                names.iter().enumerate().filter(|(_, name)| known.iter().any(|k| *name == k.as_bytes()));
            match (found.next(), found.next()) {
                (Some((index, _)), None) => Ok(index),
                _ => Err((what, Refusal::new(format!("one column of {}", known.join(", ")), line))),
            }
        };
        Ok(Self {
            t: find("column t of the header", names::TIME)?,
            x: find("column x of the header", names::X)?,
            y: find("column y of the header", names::Y)?,
            p: find("column p of the header", names::POLARITY)?,
            count: names.len(),
        })
    }

    /// The event of a line.
    pub(super) fn event(self, line: &[u8]) -> Result<Event, Fault> {
        let (mut t, mut x, mut y, mut p) = (&[][..], &[][..], &[][..], &[][..]);
        let mut count = 0;
        for (index, field) in line.split(|&b| b == b',').enumerate() {
            match index {
                _ if index == self.t => t = field,
                _ if index == self.x => x = field,
                _ if index == self.y => y = field,
                _ if index == self.p => p = field,
                _ => {}
            }
            count += 1;
        }
        if count != self.count {
            let expected = format!("{} fields", self.count);
            return Err(("line", Refusal { expected, actual: format!("{count} in {}", shown(line)) }));
        }
        Ok(Event {
            t_us: time(bare(t)).map_err(|refusal| ("time t", refusal))?,
            x: coordinate(bare(x)).map_err(|refusal| ("column x", refusal))?,
            y: coordinate(bare(y)).map_err(|refusal| ("row y", refusal))?,
            on: polarity(bare(p)).map_err(|refusal| ("polarity p", refusal))?,
        })
    }
}
