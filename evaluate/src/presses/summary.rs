//! Presses in numbers.

use std::collections::BTreeSet;

use meissner_engine::Sensor;

use super::Presses;
use super::scan::{PressRecording, median};

/// Presses in numbers.
#[derive(Clone, Debug, PartialEq)]
pub struct Summary {
    /// Recordings that can be read.
    pub recordings: usize,
    /// Recordings with events and labels.
    pub presses: usize,
    /// Events of all recordings.
    pub events: u64,
    /// The sensors, each once.
    pub sensors: Vec<Sensor>,
    /// The median of the recordings' durations.
    pub median_us: Option<u64>,
    /// The median of the recordings' events per second.
    pub median_rate: Option<f64>,
    /// Labelled instants.
    pub rows: usize,
    /// Each label.
    pub labels: Vec<LabelSummary>,
}

/// The values of a label over all rows.
#[derive(Clone, Debug, PartialEq)]
pub struct LabelSummary {
    /// Its name.
    pub name: String,
    /// Its unit.
    pub unit: Option<String>,
    /// Rows with a value.
    pub count: usize,
    /// Different values.
    pub distinct: usize,
    /// Least, mean, greatest value and standard deviation; `None` for classes, and without values.
    pub spread: Option<[f64; 4]>,
    /// Each class with its rows and its presses; none for numbers.
    pub classes: Vec<ClassCount>,
}

/// How often a class occurs.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct ClassCount {
    /// Its name.
    pub name: String,
    /// Rows of the class.
    pub rows: usize,
    /// Presses with such a row.
    pub presses: usize,
}

impl Presses {
    /// The presses in numbers. O(rows log rows) a label.
    pub fn summary(&self) -> Summary {
        let filled = || self.recordings.iter().filter(|recording| recording.events > 0);
        let sizes: BTreeSet<(u16, u16)> = self
            .recordings
            .iter()
            .filter_map(|r| r.sensor.map(|sensor| (sensor.width, sensor.height)))
            .collect();
        Summary {
            recordings: self.recordings.len(),
            presses: self.labelled().count(),
            events: self.recordings.iter().map(|recording| recording.events).sum(),
            sensors: sizes.into_iter().map(|(width, height)| Sensor::new(width, height)).collect(),
            median_us: median(filled().map(PressRecording::duration_us).collect(), u64::cmp),
            median_rate: median(filled().filter_map(PressRecording::rate).collect(), f64::total_cmp),
            rows: self.rows.len(),
            labels: (0..self.labels.len()).map(|label| self.label_summary(label)).collect(),
        }
    }

    fn label_summary(&self, index: usize) -> LabelSummary {
        let label = &self.labels[index];
        let with = self.rows.iter().map(|row| (row.press, row.values[index]));
        let with: Vec<(usize, f64)> = with.filter(|(_, value)| !value.is_nan()).collect();
        let mut values: Vec<f64> = with.iter().map(|(_, value)| *value).collect();
        values.sort_by(f64::total_cmp);
        let count = values.len();
        let spread =
            values.first().zip(values.last()).filter(|_| !label.is_class()).map(|(&least, &most)| {
                let mean = values.iter().sum::<f64>() / count as f64;
                let variance = values.iter().map(|value| (value - mean).powi(2)).sum::<f64>() / count as f64;
                [least, mean, most, variance.sqrt()]
            });
        values.dedup();
        let class = |(class, name): (usize, &String)| {
            let rows = with.iter().filter(|(_, value)| *value == class as f64).map(|(press, _)| *press);
            let presses: BTreeSet<usize> = rows.clone().collect();
            ClassCount { name: name.clone(), rows: rows.count(), presses: presses.len() }
        };
        LabelSummary {
            name: label.name.clone(),
            unit: label.unit.clone(),
            count,
            distinct: values.len(),
            spread,
            classes: label.classes.iter().enumerate().map(class).collect(),
        }
    }
}
