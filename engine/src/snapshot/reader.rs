//! Decodes the bytes of a snapshot. Each value has a name for error messages.

use std::fmt::Display;

use super::format::{CHECKSUM, COUNT_LIMIT, HEADER, Kind, MAGIC, VERSION};
use crate::{EngineError, fingerprint};

/// The remaining content of a snapshot.
#[derive(Debug)]
pub(crate) struct Reader<'a> {
    /// Everything but the checksum.
    bytes: &'a [u8],
    at: usize,
}

impl<'a> Reader<'a> {
    /// The content of `bytes`, a snapshot of `kind`; checks version, length and checksum. O(bytes).
    pub(crate) fn open(bytes: &'a [u8], kind: Kind) -> Result<Self, EngineError> {
        Ok(parts(bytes, Some(kind))?.0)
    }

    /// The error for the last value read, which has `bytes` bytes.
    pub(crate) fn refuse(
        &self,
        what: impl Display,
        bytes: usize,
        expected: impl Display,
        found: impl Display,
    ) -> EngineError {
        refused(what, self.at - bytes, expected, found)
    }

    fn take(&mut self, what: impl Display, bytes: usize) -> Result<&'a [u8], EngineError> {
        let left = &self.bytes[self.at..];
        let Some(taken) = left.get(..bytes) else {
            return Err(refused(what, self.at, format!("{bytes} bytes"), left.len()));
        };
        self.at += bytes;
        Ok(taken)
    }

    pub(crate) fn u8(&mut self, what: impl Display) -> Result<u8, EngineError> {
        Ok(self.take(what, 1)?[0])
    }

    pub(crate) fn u16(&mut self, what: impl Display) -> Result<u16, EngineError> {
        Ok(u16::from_le_bytes(array(self.take(what, 2)?)))
    }

    pub(crate) fn u32(&mut self, what: impl Display) -> Result<u32, EngineError> {
        Ok(u32::from_le_bytes(array(self.take(what, 4)?)))
    }

    pub(crate) fn u64(&mut self, what: impl Display) -> Result<u64, EngineError> {
        Ok(u64::from_le_bytes(array(self.take(what, 8)?)))
    }

    pub(crate) fn i64(&mut self, what: impl Display) -> Result<i64, EngineError> {
        Ok(i64::from_le_bytes(array(self.take(what, 8)?)))
    }

    pub(crate) fn flag(&mut self, what: impl Display) -> Result<bool, EngineError> {
        match self.u8(&what)? {
            flag @ 0..=1 => Ok(flag == 1),
            other => Err(self.refuse(what, 1, "0 or 1", other)),
        }
    }

    /// Reads counts; they must be small enough to be increased for as long as any engine runs.
    pub(crate) fn counts<const N: usize>(&mut self, what: impl Display) -> Result<[u64; N], EngineError> {
        let mut counts = [0; N];
        for count in &mut counts {
            *count = self.u64(&what)?;
            if *count >= COUNT_LIMIT {
                return Err(self.refuse(what, 8, "a count below 2^56", *count));
            }
        }
        Ok(counts)
    }

    /// The number of following items of at least `each` bytes: at most `most`, not truncated.
    pub(crate) fn length(
        &mut self,
        what: impl Display,
        most: usize,
        each: usize,
    ) -> Result<usize, EngineError> {
        let length = self.u64(&what)?;
        let left = (self.bytes.len() - self.at).checked_div(each).unwrap_or(usize::MAX);
        match usize::try_from(length) {
            Ok(length) if length <= most.min(left) => Ok(length),
            _ => Err(self.refuse(what, 8, format!("at most {}", most.min(left)), length)),
        }
    }

    /// Reads a number that must equal `expected`.
    pub(crate) fn exactly(&mut self, what: impl Display, expected: usize) -> Result<(), EngineError> {
        let found = self.u64(&what)?;
        if found == expected as u64 { Ok(()) } else { Err(self.refuse(what, 8, expected, found)) }
    }

    pub(crate) fn text(&mut self, what: impl Display) -> Result<String, EngineError> {
        let length = self.length(&what, usize::MAX, 1)?;
        Ok(String::from_utf8_lossy(self.take(what, length)?).into_owned())
    }

    /// Reads values, which must all be finite.
    pub(crate) fn values(&mut self, what: impl Display, to: &mut [f32]) -> Result<(), EngineError> {
        let start = self.at;
        let bytes = self.take(&what, to.len().saturating_mul(4))?;
        for (i, (to, from)) in to.iter_mut().zip(bytes.chunks_exact(4)).enumerate() {
            let value = f32::from_bits(u32::from_le_bytes(array(from)));
            if !value.is_finite() {
                return Err(refused(format!("{what}, value {i}"), start + 4 * i, "a finite number", value));
            }
            *to = value;
        }
        Ok(())
    }

    /// Checks that nothing is left.
    pub(crate) fn end(self) -> Result<(), EngineError> {
        let left = self.bytes.len() - self.at;
        if left == 0 { Ok(()) } else { Err(refused("end", self.at, "no more bytes", left)) }
    }
}

/// Content and note of a snapshot of `kind` (or any); checks version, length and checksum.
fn parts(bytes: &[u8], kind: Option<Kind>) -> Result<(Reader<'_>, &[u8]), EngineError> {
    let mut reader = Reader { bytes, at: 0 };
    let magic = reader.take("first bytes", MAGIC.len())?;
    if magic != MAGIC {
        return Err(refused("first bytes", 0, MAGIC.escape_ascii(), magic.escape_ascii()));
    }
    let version = reader.u32("format version")?;
    if version != VERSION {
        return Err(differs("format version", VERSION, version));
    }
    let found = reader.u32("kind")?;
    if let Some(kind) = kind.filter(|&kind| kind as u32 != found) {
        return Err(differs("state of", Kind::name(kind as u32), Kind::name(found)));
    }
    let length = reader.u64("length")?;
    if length != bytes.len() as u64 || bytes.len() < HEADER + 8 + CHECKSUM {
        return Err(refused("length", HEADER - 8, format!("{} bytes", bytes.len()), length));
    }
    let (rest, checksum) = bytes.split_at(bytes.len() - CHECKSUM);
    let (computed, stored) = (fingerprint::of_bytes(rest), u64::from_le_bytes(array(checksum)));
    if stored != computed {
        let hexadecimal = |word| format!("{word:#018x}");
        return Err(refused("checksum", rest.len(), hexadecimal(computed), hexadecimal(stored)));
    }
    let (rest, length) = rest.split_at(rest.len() - 8);
    let length = u64::from_le_bytes(array(length));
    let most = rest.len() - HEADER;
    if length > most as u64 {
        return Err(refused("length of the note", rest.len(), format!("at most {most}"), length));
    }
    let (content, note) = rest.split_at(rest.len() - length as usize);
    Ok((Reader { bytes: content, at: HEADER }, note))
}

/// The note in a snapshot of any kind (see [`crate::Engine::to_bytes_with`]), checked as a whole.
/// O(bytes).
///
/// # Errors
/// [`EngineError::Snapshot`] for another version; [`EngineError::SnapshotBytes`] for damaged bytes.
pub fn snapshot_note(bytes: &[u8]) -> Result<&[u8], EngineError> {
    Ok(parts(bytes, None)?.1)
}

/// Converts a slice of N bytes to an array.
fn array<const N: usize>(bytes: &[u8]) -> [u8; N] {
    let mut array = [0; N];
    array.copy_from_slice(bytes);
    array
}

fn refused(what: impl Display, at: usize, expected: impl Display, found: impl Display) -> EngineError {
    EngineError::SnapshotBytes {
        what: what.to_string(),
        at,
        expected: expected.to_string(),
        found: found.to_string(),
    }
}

/// Refuses a state of a network with another fingerprint; a network is (fingerprint, name).
pub(crate) fn check_network(own: (u64, &str), found: (u64, &str)) -> Result<(), EngineError> {
    let of = |(fingerprint, name): (u64, &str)| format!("{name:?} with fingerprint {fingerprint:#018x}");
    if own.0 == found.0 { Ok(()) } else { Err(differs("network", of(own), of(found))) }
}

/// The error if engine and snapshot differ in a property that they must share.
pub(crate) fn differs(what: &'static str, expected: impl Display, found: impl Display) -> EngineError {
    EngineError::Snapshot { what, expected: expected.to_string(), found: found.to_string() }
}
