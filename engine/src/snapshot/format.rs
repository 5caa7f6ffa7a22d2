//! Constants of the format, and the kinds of engines that have snapshots.

pub(super) const MAGIC: [u8; 8] = *b"MEISSNER";
/// Version, increased with every change of the format or of the order of a computation.
pub(super) const VERSION: u32 = 2;
/// Bytes before the content.
pub(super) const HEADER: usize = 24;
/// Bytes after the content.
pub(super) const CHECKSUM: usize = 8;
/// Limit of counts in a snapshot: they can grow, and be summed over layers, for two thousand years
/// at a million per second.
pub(super) const COUNT_LIMIT: u64 = 1 << 56;

/// The kind of engine that a snapshot belongs to.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Events = 1,
    Frames = 2,
}

impl Kind {
    pub(super) fn name(code: u32) -> String {
        match code {
            1 => "an engine over events".to_owned(),
            2 => "a frame engine".to_owned(),
            other => format!("kind {other}"),
        }
    }
}
