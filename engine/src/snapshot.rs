//! Snapshots: states of engines, as copies and as little-endian bytes.
//!
//! ```text
//! "MEISSNER"   8 bytes
//! version      u32
//! kind         u32    1 an engine over events, 2 a frame engine
//! length       u64    of the whole, checksum included
//! content             engine/snapshot.rs, frames/step/snapshot.rs
//! note                bytes given by the caller
//! its length   u64
//! checksum     u64    FNV-1a of all before it
//! ```
//!
//! The checksum detects every change of a byte. Forged content with a valid checksum is checked
//! too: before allocation, counts against the remaining bytes and the engine's capacity, sizes
//! against the network. No value from the bytes is used as an index.

use std::fmt;
use std::fmt::Display;

use crate::{EngineError, fingerprint};

/// An engine that a snapshot can hold.
pub trait Stored: Clone {
    /// Its kind.
    const KIND: Kind;
    /// Encodes its state as bytes, with a note.
    fn to_bytes_with(&self, note: &[u8]) -> Vec<u8>;
}

/// The state of an engine of type `E` at one moment, as a copy or as bytes.
#[derive(Clone)]
#[must_use]
pub struct SnapshotOf<E>(pub(crate) Content<E>);

#[derive(Clone)]
pub(crate) enum Content<E> {
    Copy(Box<E>),
    /// Bytes whose header and checksum have been checked.
    Bytes(Vec<u8>),
}

impl<E: Stored> SnapshotOf<E> {
    /// The snapshot that `to_bytes` wrote. Whether it fits an engine is checked when restored.
    /// O(bytes).
    ///
    /// # Errors
    /// [`EngineError::Snapshot`] for another version or kind of engine;
    /// [`EngineError::SnapshotBytes`] for truncated or changed bytes.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, EngineError> {
        Reader::open(bytes, E::KIND)?;
        Ok(Self(Content::Bytes(bytes.to_vec())))
    }

    /// The snapshot as bytes, for [`Self::from_bytes`] or for an engine's `restore_bytes`.
    pub fn to_bytes(&self) -> Vec<u8> {
        match &self.0 {
            Content::Copy(engine) => engine.to_bytes_with(&[]),
            Content::Bytes(bytes) => bytes.clone(),
        }
    }
}

impl<E: fmt::Debug> fmt::Debug for SnapshotOf<E> {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.0 {
            Content::Copy(engine) => f.debug_tuple("Snapshot").field(engine).finish(),
            Content::Bytes(bytes) => write!(f, "Snapshot({} bytes)", bytes.len()),
        }
    }
}

const MAGIC: [u8; 8] = *b"MEISSNER";
/// Version, increased with every change of the format or of the order of a computation.
const VERSION: u32 = 2;
const HEADER: usize = 24;
const CHECKSUM: usize = 8;
/// Limit of counts in a snapshot: below it, they can grow, and be summed over layers, for two
/// thousand years at a million per second.
const COUNT_LIMIT: u64 = 1 << 56;

/// The kind of engine that a snapshot belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Events = 1,
    Frames = 2,
}

impl Kind {
    fn name(code: u32) -> String {
        match code {
            1 => "an engine over events".to_owned(),
            2 => "a frame engine".to_owned(),
            other => format!("kind {other}"),
        }
    }
}

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

    /// Reads counts; they must be small enough that no engine runs long enough to overflow them.
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

    /// Whether all bytes are read.
    pub(crate) fn is_done(&self) -> bool {
        self.at == self.bytes.len()
    }

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

#[derive(Debug)]
pub(crate) struct Writer {
    bytes: Vec<u8>,
}

impl Writer {
    pub(crate) fn new(kind: Kind) -> Self {
        let mut writer = Self { bytes: MAGIC.to_vec() };
        writer.u32(VERSION);
        writer.u32(kind as u32);
        writer.u64(0);
        writer
    }

    pub(crate) fn u8(&mut self, value: u8) {
        self.bytes.push(value);
    }

    pub(crate) fn flag(&mut self, value: bool) {
        self.u8(value.into());
    }

    pub(crate) fn u16(&mut self, value: u16) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(crate) fn u32(&mut self, value: u32) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(crate) fn u64(&mut self, value: u64) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(crate) fn i64(&mut self, value: i64) {
        self.bytes.extend(value.to_le_bytes());
    }

    pub(crate) fn counts<const N: usize>(&mut self, counts: [u64; N]) {
        counts.into_iter().for_each(|count| self.u64(count));
    }

    pub(crate) fn size(&mut self, size: usize) {
        self.u64(size as u64);
    }

    pub(crate) fn text(&mut self, text: &str) {
        self.size(text.len());
        self.bytes.extend(text.as_bytes());
    }

    /// Writes values without their number, which the reader knows.
    pub(crate) fn values(&mut self, values: &[f32]) {
        self.bytes.extend(values.iter().flat_map(|value| value.to_bits().to_le_bytes()));
    }

    /// Completes the snapshot with a note of the caller.
    pub(crate) fn finish(mut self, note: &[u8]) -> Vec<u8> {
        self.bytes.extend(note);
        self.size(note.len());
        let length = (self.bytes.len() + CHECKSUM) as u64;
        self.bytes[HEADER - 8..HEADER].copy_from_slice(&length.to_le_bytes());
        let checksum = fingerprint::of_bytes(&self.bytes);
        self.u64(checksum);
        self.bytes
    }
}
