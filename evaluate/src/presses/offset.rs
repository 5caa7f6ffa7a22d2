//! From the host's clock to the sensor's: the offset, and where it comes from.

use std::path::Path;

use meissner_io::{LabelClock, LabelTable};

use super::clock::Drift;
use super::names::{Names, RECORDINGS};
use super::odd::{Odd, OddityKind};
use super::scan::{PressRecording, median};
use crate::error::{EvaluateError, RequestPart, Result};

/// If offsets spread more than this, the clocks restart with each recording.
const MAX_SPREAD_US: u64 = 1_000_000;
/// A smaller drift over a session is not reported.
pub(super) const DRIFT_US: f64 = 5_000.0;

/// The offset from a time of the labels to the sensor's.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Offset {
    /// The offset in microseconds; if each recording has its own, the value that is added to all of
    /// them.
    pub us: i64,
    /// Its source.
    pub source: OffsetSource,
}

/// The source of an offset.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[non_exhaustive]
pub enum OffsetSource {
    /// The labels have times of the sensor's clock, and no offset was given.
    SensorClock,
    /// No source: it is 0.
    Nothing,
    /// The caller.
    Given,
    /// The median of `first_us - host_us` of `recordings.csv`.
    Listed {
        /// Number of recordings in the list.
        recordings: usize,
        /// The largest of these differences minus the smallest.
        spread_us: u64,
    },
    /// `first_us - host_us` of each recording: their clocks restart, or these differences spread
    /// over more than a second.
    Each,
}

/// The offset of each recording.
pub(super) struct Offsets {
    pub(super) offset: Offset,
    each: Vec<Option<i64>>,
    /// Whether a caller who gives another offset changes all of them by the difference.
    pub(super) is_given: bool,
}

impl Offsets {
    /// The offset from a time of the labels to the time of `recording`.
    pub(super) fn of(&self, recording: usize) -> Option<i64> {
        if self.offset.source == OffsetSource::Each {
            self.each[recording]?.checked_add(self.offset.us)
        } else {
            Some(self.offset.us)
        }
    }

    /// The offset for times of `clock`; `across` states that these times must also identify the
    /// recording.
    pub(super) fn choose(
        folder: &Path,
        clock: Option<LabelClock>,
        across: bool,
        (recordings, names): (&[PressRecording], &Names<'_>),
        given: Option<i64>,
        odd: &mut Odd,
    ) -> Result<Self> {
        let mut each = vec![None; recordings.len()];
        let listed = folder.join(RECORDINGS);
        let mut spread_us = 0;
        if clock == Some(LabelClock::Host) && listed.is_file() {
            let points = read(&listed, names, &mut each)?;
            let (least, most) = (each.iter().flatten().min(), each.iter().flatten().max());
            spread_us = most.zip(least).map_or(0, |(most, least)| most.abs_diff(*least));
            if let Some(drift) = Drift::of(&points).filter(|drift| drift.matters(DRIFT_US))
                && spread_us <= MAX_SPREAD_US
            {
                odd.add(OddityKind::Drift, || format!("{} by {RECORDINGS}", drift_text(drift)));
            }
        }
        let known = each.iter().flatten().count();
        let overlaps = overlaps(recordings);
        let restart = overlaps.len() * 2 > recordings.len().saturating_sub(1) && !overlaps.is_empty();
        let is_added = restart && known > 0;
        let offset = match given {
            _ if is_added || (known > 0 && given.is_none() && spread_us > MAX_SPREAD_US) => {
                for (recording, _) in recordings.iter().zip(&each).filter(|(_, offset)| offset.is_none()) {
                    odd.add(OddityKind::NoHostTime, || recording.name.clone());
                }
                let offset = Offset { us: given.unwrap_or(0), source: OffsetSource::Each };
                return Ok(Self { offset, each, is_given: is_added });
            }
            Some(us) => Offset { us, source: OffsetSource::Given },
            None if known > 0 => {
                let all = each.iter().flatten().copied().collect();
                let source = OffsetSource::Listed { recordings: known, spread_us };
                Offset { us: median(all, i64::cmp).unwrap_or(0), source }
            }
            None if clock == Some(LabelClock::Host) => Offset { us: 0, source: OffsetSource::Nothing },
            None => Offset { us: 0, source: OffsetSource::SensorClock },
        };
        if let Some(&(before, after)) = overlaps.first().filter(|_| across) {
            let (before, after) = (&recordings[before].name, &recordings[after].name);
            if restart {
                let expected =
                    format!("recordings of one clock, or {RECORDINGS} with the time at which each began");
                let found =
                    format!("{} that overlap in time, such as {before} and {after}", overlaps.len() + 1);
                return Err(EvaluateError::request(RequestPart::Folder, expected, found));
            }
            odd.add_many(OddityKind::Overlap, overlaps.len() as u64, || {
                format!("{after}, which begins during {before}")
            });
        }
        Ok(Self { offset, each, is_given: true })
    }
}

/// The growth of an offset in words.
pub(super) fn drift_text(drift: Drift) -> String {
    let Drift { ppm, error_ppm, whole_us } = drift;
    format!("{ppm:.0} ppm (standard error {error_ppm:.0}), {:.1} ms over the session", whole_us / 1e3)
}

/// Reads the list of recordings at `path`: the offset of each, and its growth as points in time.
fn read(path: &Path, names: &Names<'_>, each: &mut [Option<i64>]) -> Result<Vec<(i64, i64)>> {
    let table = LabelTable::read(path)?;
    let first = table
        .label("first")
        .filter(|label| label.unit.as_deref() == Some("us") && label.classes().is_empty());
    let (Some(listed), Some(LabelClock::Host), Some(first)) = (&table.recordings, table.clock, first) else {
        let expected = format!("{} with the columns recording, first_us and host_us", path.display());
        return Err(EvaluateError::request(RequestPart::Folder, expected, "others"));
    };
    let mut points = Vec::new();
    for (row, name) in listed.iter().enumerate() {
        let (Ok(recording), Some(host_us), Some(first_us)) =
            (names.find(name), table.times_us[row], first.value(row))
        else {
            continue;
        };
        // Microseconds since 1970 have 51 bits.
        if let Some(offset) = (first_us as i64).checked_sub(host_us) {
            each[recording] = Some(offset);
            points.push((host_us, offset));
        }
    }
    Ok(points)
}

/// Pairs of recordings that overlap in time, the one that begins first in front. Copies do not
/// count.
fn overlaps(recordings: &[PressRecording]) -> Vec<(usize, usize)> {
    let mut order: Vec<usize> = (0..recordings.len()).filter(|&i| recordings[i].events > 0).collect();
    order.sort_by_key(|&i| (recordings[i].first_us, recordings[i].fingerprint, i));
    order.dedup_by_key(|i| (recordings[*i].first_us, recordings[*i].fingerprint));
    let mut longest: Option<usize> = None;
    let mut found = Vec::new();
    for i in order {
        if let Some(before) = longest.filter(|&before| recordings[i].first_us < recordings[before].last_us) {
            found.push((before, i));
        }
        if longest.is_none_or(|before| recordings[i].last_us > recordings[before].last_us) {
            longest = Some(i);
        }
    }
    found
}
