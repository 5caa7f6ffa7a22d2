//! The truth about the inputs of results: values over time.

use meissner_io::{LabelClock, LabelTable, LabelValues};

use crate::words::{file_name, shown_unit};

/// The true values of one quantity over time.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Truth {
    /// The input, as the header of a result names it; `None`: any input.
    pub input: Option<String>,
    /// The output of the network.
    pub output: String,
    /// Its unit, if known.
    pub unit: Option<String>,
    /// Times of the sensor in microseconds, ascending, with values.
    pub points: Vec<(f64, f64)>,
}

/// All known truths.
#[derive(Clone, Debug, Default)]
pub struct Truths(Vec<Truth>);

impl Truths {
    /// Adds the values of a quantity. Points are put in order of time.
    pub fn add(&mut self, mut truth: Truth) {
        truth.points.retain(|(t_us, value)| t_us.is_finite() && value.is_finite());
        truth.points.sort_by(|a, b| a.0.total_cmp(&b.0));
        self.0.push(truth);
    }

    /// Adds the numbers of a table of labels with times of the sensor. Returns whether there were
    /// any.
    pub fn add_table(&mut self, table: &LabelTable) -> bool {
        if table.clock != Some(LabelClock::Sensor) {
            return false;
        }
        let mut recordings: Vec<Option<&str>> = match &table.recordings {
            Some(recordings) => recordings.iter().map(|name| Some(name.as_str())).collect(),
            None => vec![None],
        };
        recordings.sort_unstable();
        recordings.dedup();
        let before = self.0.len();
        for label in &table.labels {
            let LabelValues::Numbers(values) = &label.values else { continue };
            for &recording in &recordings {
                let is_of = |row: usize| {
                    recording.is_none() || table.recordings.as_ref().map(|of| of[row].as_str()) == recording
                };
                let rows = (0..values.len()).filter(|&row| is_of(row));
                let points = rows.filter_map(|row| Some((table.times_us[row]? as f64, values[row])));
                self.add(Truth {
                    input: recording.map(str::to_owned),
                    output: label.name.clone(),
                    unit: label.unit.clone(),
                    points: points.collect(),
                });
            }
        }
        self.0.len() > before
    }

    /// The true values of an output for an input, in the unit that is shown.
    pub(crate) fn of(&self, input: &str, output: &str, unit: &str) -> Option<Vec<(f64, f64)>> {
        let is_same = |name: &str| name == input || file_name(name) == file_name(input);
        let truth = self.0.iter().find(|truth| {
            truth.output.eq_ignore_ascii_case(output) && truth.input.as_deref().is_none_or(is_same)
        })?;
        let (shown, _) = shown_unit(unit);
        let (of_truth, factor) = truth.unit.as_deref().map_or((shown, 1.0), shown_unit);
        // Values in another unit could not be compared with the shown ones.
        (of_truth.eq_ignore_ascii_case(shown) && !truth.points.is_empty())
            .then(|| truth.points.iter().map(|&(t_us, value)| (t_us, factor * value)).collect())
    }
}

/// The value at a time, between its neighbours; `None` before the first and after the last.
pub(crate) fn value_at(points: &[(f64, f64)], t_us: f64) -> Option<f64> {
    let after = points.partition_point(|point| point.0 < t_us);
    let &(right, high) = points.get(after)?;
    if right == t_us {
        return Some(high);
    }
    let &(left, low) = points.get(after.checked_sub(1)?)?;
    Some(low + (high - low) * (t_us - left) / (right - left))
}
