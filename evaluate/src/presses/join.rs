//! Joins rows of a table with presses.
//!
//! Input: a table, and recordings with the offset of their clocks. Output: rows by press and time,
//! each time of a press once. Rows without a press are counted with the reason.

use std::ops::Range;

use meissner_io::{LabelClock, LabelTable, LabelValues};
use meissner_run::text::grouped;

use super::names::{Miss, Names};
use super::odd::{Odd, OddityKind};
use super::offset::Offsets;
use super::scan::PressRecording;

/// The values of all labels at a time of a press.
#[derive(Clone, Debug, PartialEq)]
pub struct Row {
    /// Index of the recording.
    pub press: usize,
    /// The time on the sensor's clock, in microseconds.
    pub t_us: i64,
    /// Whether the table has no time for it: a class holds for the whole press, a number for its
    /// end, at `t_us`.
    pub whole: bool,
    /// The value of each label: a number, the index of a class, or NaN where it is missing.
    pub values: Vec<f64>,
}

/// The inputs of a join.
pub(super) struct Join<'a> {
    pub(super) table: &'a LabelTable,
    pub(super) recordings: &'a [PressRecording],
    pub(super) names: &'a Names<'a>,
    pub(super) offsets: &'a Offsets,
    /// Poses that are further apart are not interpolated between.
    pub(super) max_gap_us: i64,
}

impl Join<'_> {
    /// The rows of all presses, and the range of each press in them.
    pub(super) fn rows(&self, odd: &mut Odd) -> (Vec<Row>, Vec<Range<usize>>) {
        self.check_values(odd);
        let mut rows = match &self.table.recordings {
            Some(names) => self.named(names, odd),
            None => self.poses(odd),
        };
        rows.sort_by_key(|(row, _)| (row.press, row.t_us));
        rows.dedup_by(|(row, line), (kept, kept_line)| {
            let is_same = (row.press, row.t_us) == (kept.press, kept.t_us);
            if is_same {
                let bits = |row: &Row| row.values.iter().map(|value| value.to_bits()).collect::<Vec<_>>();
                let kind =
                    if bits(row) == bits(kept) { OddityKind::Repeated } else { OddityKind::Contradicts };
                odd.add(kind, || format!("line {line}, after line {kept_line}"));
            }
            is_same
        });
        let rows: Vec<Row> = rows.into_iter().map(|(row, _)| row).collect();
        let mut ranges = Vec::with_capacity(self.recordings.len());
        let mut end = 0;
        for (press, recording) in self.recordings.iter().enumerate() {
            let start = end;
            end += rows[start..].iter().take_while(|row| row.press == press).count();
            ranges.push(start..end);
            if start == end && recording.events > 0 {
                odd.add(OddityKind::Unlabelled, || recording.name.clone());
            }
        }
        self.check_constant(&rows, odd);
        (rows, ranges)
    }

    fn values(&self, row: usize) -> Vec<f64> {
        self.table.labels.iter().map(|label| label.value(row).unwrap_or(f64::NAN)).collect()
    }

    /// The rows of a table that names recordings, with their lines.
    fn named(&self, names: &[String], odd: &mut Odd) -> Vec<(Row, u64)> {
        let relative = self.relative(names);
        let mut rows = Vec::new();
        for (i, name) in names.iter().enumerate() {
            let line = self.table.lines[i];
            let press = match self.names.find(name) {
                Ok(press) => press,
                Err(Miss::Unreadable) => continue,
                Err(miss) => {
                    let (kind, near) = match miss {
                        Miss::Several => (OddityKind::AmbiguousRecording, None),
                        _ => (OddityKind::UnknownRecording, self.names.similar(name)),
                    };
                    let near = || near.map_or_else(String::new, |near| format!(" (similar: {near})"));
                    odd.add(kind, || format!("line {line}: {}{}", quoted(name), near()));
                    continue;
                }
            };
            let recording = &self.recordings[press];
            if recording.events == 0 {
                continue;
            }
            let Some(t_us) = self.table.times_us[i] else {
                rows.push((
                    Row { press, t_us: recording.last_us, whole: true, values: self.values(i) },
                    line,
                ));
                continue;
            };
            let added = match self.table.clock {
                Some(LabelClock::Host) => self.offsets.of(press),
                _ if relative => Some(recording.first_us),
                _ => Some(self.offsets.offset.us),
            };
            // A recording without an offset is reported once, by its name.
            let Some(added) = added else { continue };
            let on_sensor = t_us.checked_add(added).filter(|&t_us| self.is_near(recording, t_us));
            let Some(t_us) = on_sensor else {
                odd.add(OddityKind::Outside, || {
                    let PressRecording { name, first_us, last_us, .. } = recording;
                    let t_us = t_us.saturating_add(added);
                    format!("line {line}: {t_us} us, and {name} lasts from {first_us} to {last_us} us")
                });
                continue;
            };
            if relative {
                odd.add(OddityKind::RelativeTimes, || format!("line {line}"));
            }
            rows.push((Row { press, t_us, whole: false, values: self.values(i) }, line));
        }
        rows
    }

    /// Whether a time lies in a recording; its end may be silent.
    fn is_near(&self, recording: &PressRecording, t_us: i64) -> bool {
        let (first, last) = (recording.first_us, recording.last_us);
        (first.saturating_sub(self.max_gap_us)..=last.saturating_add(self.max_gap_us)).contains(&t_us)
    }

    /// Whether times on the sensor's clock count from the first event of their recording: no time
    /// lies in its recording as it is, but most do if they count from its first event.
    fn relative(&self, names: &[String]) -> bool {
        if self.table.clock != Some(LabelClock::Sensor) || self.offsets.offset.us != 0 {
            return false;
        }
        let (mut all, mut relative) = (0, 0);
        for (name, t_us) in names.iter().zip(&self.table.times_us) {
            let (Ok(press), Some(t_us)) = (self.names.find(name), *t_us) else { continue };
            let recording = &self.recordings[press];
            if recording.events == 0 {
                continue;
            }
            if self.is_near(recording, t_us) {
                return false;
            }
            all += 1;
            relative += usize::from(self.is_near(recording, t_us.saturating_add(recording.first_us)));
        }
        relative * 2 > all
    }

    /// The poses during each recording, and those at its ends, between their neighbours.
    fn poses(&self, odd: &mut Odd) -> Vec<(Row, u64)> {
        let order = self.ordered(odd);
        let times: Vec<i64> = order.iter().map(|&(t_us, _)| t_us).collect();
        let mut rows = Vec::new();
        for (press, recording) in self.recordings.iter().enumerate() {
            let Some(offset) = self.offsets.of(press).filter(|_| recording.events > 0) else { continue };
            // No pose has a time outside the range of the host's clock.
            let on_host = |t_us: i64| t_us.checked_sub(offset);
            let Some((first, last)) = on_host(recording.first_us).zip(on_host(recording.last_us)) else {
                continue;
            };
            let during = times.partition_point(|&t| t < first)..times.partition_point(|&t| t <= last);
            let mut add = |t_us: i64, values, line| {
                rows.push((Row { press, t_us: t_us.saturating_add(offset), whole: false, values }, line));
            };
            for end in [first, last] {
                if let Some((values, line)) = self.between(&order, &times, end) {
                    add(end, values, line);
                }
            }
            for &(t_us, row) in &order[during.clone()] {
                // There may be a pose exactly at an end.
                if t_us != first && t_us != last {
                    add(t_us, self.values(row), self.table.lines[row]);
                }
            }
            for pair in order[during].windows(2) {
                let gap = pair[1].0.abs_diff(pair[0].0);
                if gap > self.max_gap_us as u64 {
                    let line = self.table.lines[pair[1].1];
                    odd.add(OddityKind::PoseGap, || format!("{} us before line {line}", grouped(gap)));
                }
            }
        }
        rows
    }

    /// The times of the poses in order, with their rows; each time once.
    pub(super) fn ordered(&self, odd: &mut Odd) -> Vec<(i64, usize)> {
        let timed = self.table.times_us.iter().enumerate();
        let mut order: Vec<(i64, usize)> = timed.filter_map(|(row, t_us)| Some(((*t_us)?, row))).collect();
        for pair in order.windows(2).filter(|pair| pair[1].0 < pair[0].0) {
            let line = self.table.lines[pair[1].1];
            let step = pair[0].0.abs_diff(pair[1].0);
            odd.add(OddityKind::PosesStepBack, || format!("line {line}, by {} us", grouped(step)));
        }
        order.sort_by_key(|&(t_us, _)| t_us);
        order.dedup_by(|pose, kept| {
            let is_same = pose.0 == kept.0;
            if is_same {
                let lines = [pose, kept].map(|pose| self.table.lines[pose.1]);
                odd.add(OddityKind::Repeated, || format!("line {}, after line {}", lines[0], lines[1]));
            }
            is_same
        });
        order
    }

    /// The values at a time between poses that are near each other, and the line of the earlier
    /// pose: numbers are interpolated, and the class is that of the nearer pose.
    fn between(&self, order: &[(i64, usize)], times: &[i64], t_us: i64) -> Option<(Vec<f64>, u64)> {
        let after = times.partition_point(|&t| t < t_us);
        let &(to, next) = order.get(after)?;
        let line = self.table.lines[next];
        if to == t_us {
            return Some((self.values(next), line));
        }
        let &(from, before) = order.get(after.checked_sub(1)?)?;
        if to.abs_diff(from) > self.max_gap_us as u64 {
            return None;
        }
        let share = t_us.abs_diff(from) as f64 / to.abs_diff(from) as f64;
        let value = |label: &meissner_io::LabelColumn| {
            let (a, b) = (label.value(before).unwrap_or(f64::NAN), label.value(next).unwrap_or(f64::NAN));
            mixed(a, b, share, !label.classes().is_empty())
        };
        Some((self.table.labels.iter().map(value).collect(), self.table.lines[before]))
    }

    fn check_values(&self, odd: &mut Odd) {
        for label in &self.table.labels {
            for (row, text) in &label.refused {
                let line = self.table.lines[*row];
                odd.add(OddityKind::NotNumber, || format!("{}, line {line}: {text:?}", label.name));
            }
            let missing = (0..self.table.rows()).filter(|&row| {
                label.value(row).is_none() && label.refused.binary_search_by_key(&row, |odd| odd.0).is_err()
            });
            for row in missing {
                odd.add(OddityKind::Missing, || format!("{}, line {}", label.name, self.table.lines[row]));
            }
        }
    }

    fn check_constant(&self, rows: &[Row], odd: &mut Odd) {
        for (i, label) in self.table.labels.iter().enumerate() {
            let mut values = rows.iter().map(|row| row.values[i]).filter(|value| !value.is_nan());
            let Some(first) = values.next() else { continue };
            if rows.len() > 1 && values.all(|value| value == first) {
                odd.add(OddityKind::Constant, || match &label.values {
                    LabelValues::Numbers(_) => format!("{}, which is {first}", label.name),
                    LabelValues::Classes { names, .. } => {
                        format!("{}, which is {}", label.name, quoted(&names[first as usize]))
                    }
                });
            }
        }
    }
}

/// The value a `share` of the way from `a` to `b`: on the line between numbers, the nearer class.
pub(super) fn mixed(a: f64, b: f64, share: f64, is_class: bool) -> f64 {
    match is_class {
        true if share < 0.5 => a,
        true => b,
        false => a + share * (b - a),
    }
}

/// The start of a name from a table, in quotes.
fn quoted(name: &str) -> String {
    const MAX: usize = 40;
    match name.char_indices().nth(MAX) {
        Some((end, _)) => format!("{:?}..", &name[..end]),
        None => format!("{name:?}"),
    }
}
