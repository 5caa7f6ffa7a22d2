//! All results, in the names of the JSON report.

use meissner_kernels::Isa;
use serde::Serialize;

use super::front::front;
use super::measurement::{EXACT, Measurement};
use super::study::{Measured, Study};
use super::words;
use crate::text::percent;
use meissner_pipeline::provenance::{Header, InputCard};

/// Everything.
#[derive(Debug, Serialize)]
pub(super) struct Report {
    /// What was measured on what; each of `networks` says what it is.
    pub(super) header: Header,
    pub(super) system: &'static str,
    pub(super) unit: &'static str,
    pub(super) data: DataReport,
    pub(super) repeats: u32,
    pub(super) isa: &'static str,
    pub(super) notes: Vec<String>,
    pub(super) compared: Compared,
    pub(super) networks: Vec<NetworkReport>,
    pub(super) fastest_within: Vec<Fastest>,
    pub(super) words: String,
}

/// The data, and how much of it is timed.
#[derive(Debug, Serialize)]
pub(super) struct DataReport {
    pub(super) name: String,
    pub(super) recordings: u64,
    pub(super) size: u64,
    pub(super) timed: u64,
    pub(super) fingerprint: String,
}

/// The error that settings are compared by.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub(super) enum Compared {
    /// Share of wrong answers.
    TaskError,
    /// Against the exact outputs, as a share of their RMS.
    RelativeRms,
}

#[derive(Debug, Serialize)]
pub(super) struct NetworkReport {
    pub(super) network: String,
    pub(super) weights: String,
    pub(super) fingerprint: String,
    /// The exact one first.
    pub(super) settings: Vec<SettingReport>,
}

#[derive(Debug, Serialize)]
pub(super) struct SettingReport {
    pub(super) setting: String,
    /// Microseconds as they are compared: the ratio times what the exact setting took.
    pub(super) us: f64,
    pub(super) speed_up: f64,
    pub(super) error: f64,
    pub(super) interval_95: Option<(f64, f64)>,
    pub(super) on_front: bool,
    #[serde(flatten)]
    pub(super) measurement: Measurement,
}

/// The fastest setting of a network whose error is little more than the exact one's.
#[derive(Debug, Serialize)]
pub(super) struct Fastest {
    pub(super) network: String,
    /// Most that its error may be above the exact one's, in the units of what is compared.
    pub(super) within: f64,
    pub(super) setting: String,
    pub(super) speed_up: f64,
    pub(super) error: f64,
}

impl Report {
    /// What times are compared as: the heading of a column and the title of an axis.
    pub(super) fn time_name(&self) -> String {
        format!("time per {} (us)", self.unit)
    }

    /// What errors are compared as: the heading of a column and the title of an axis.
    pub(super) fn error_name(&self) -> &'static str {
        let relative = |network: &NetworkReport| network.exact().measurement.numerical.relative_rms.is_some();
        match self.compared {
            Compared::TaskError => "wrong answers (%)",
            Compared::RelativeRms if self.networks.iter().all(relative) => "relative RMS error",
            Compared::RelativeRms => "RMS error",
        }
    }

    pub(super) fn new(study: &Study<'_>, measured: Vec<Measured>, repeats: u32) -> Self {
        let labels = |measured: &Measured| measured.settings.iter().all(|(_, m)| !m.task.is_empty());
        let compared = if measured.iter().all(labels) { Compared::TaskError } else { Compared::RelativeRms };
        let mut networks: Vec<NetworkReport> = measured.into_iter().map(NetworkReport::new).collect();
        match compared {
            Compared::TaskError => mark(networks.iter_mut().flat_map(|network| &mut network.settings)),
            Compared::RelativeRms => networks.iter_mut().for_each(|network| mark(&mut network.settings)),
        }
        let fastest_within = words::fastest(&networks, compared);
        let words = words::words(&networks, &fastest_within, compared);
        let data = &study.data;
        let input = InputCard::other(&data.name, study.system);
        Self {
            header: Header::of_many("pareto", input),
            system: study.system,
            unit: study.unit,
            data: DataReport {
                name: data.name.clone(),
                recordings: data.recordings,
                size: data.size,
                timed: data.timed,
                fingerprint: data.fingerprint.clone(),
            },
            repeats,
            isa: Isa::best().name(),
            notes: study.notes.clone(),
            compared,
            networks,
            fastest_within,
            words,
        }
    }
}

/// Marks the settings that no other one beats.
fn mark<'a>(settings: impl IntoIterator<Item = &'a mut SettingReport>) {
    let mut settings: Vec<&mut SettingReport> = settings.into_iter().collect();
    let points: Vec<(f64, f64)> = settings.iter().map(|setting| (setting.us, setting.error)).collect();
    front(&points).into_iter().for_each(|place| settings[place].on_front = true);
}

impl SettingReport {
    /// Its time as [`Report::time_name`] names it.
    pub(super) fn time_text(&self) -> String {
        format!("{:.*}", if self.us < 10.0 { 2 } else { 1 }, self.us)
    }

    /// Its error as [`Report::error_name`] names it.
    pub(super) fn error_text(&self, compared: Compared) -> String {
        match compared {
            Compared::TaskError => percent(self.error),
            Compared::RelativeRms if self.error == 0.0 => "0".to_owned(),
            Compared::RelativeRms => format!("{:.1e}", self.error),
        }
    }
}

impl NetworkReport {
    fn new(measured: Measured) -> Self {
        let exact_us = measured.settings.first().map_or(0.0, |(_, exact)| exact.timing.push_predict_us.mean);
        let report = |(setting, measurement): (String, Measurement)| {
            // The exact setting is as fast as itself, whatever the clock says.
            let ratio = if setting == EXACT { 1.0 } else { measurement.timing.ratio };
            let (error, interval_95) = measurement.error();
            SettingReport {
                us: exact_us * ratio,
                speed_up: 1.0 / ratio,
                error,
                interval_95,
                on_front: false,
                setting,
                measurement,
            }
        };
        Self {
            network: measured.network,
            weights: measured.weights,
            fingerprint: measured.fingerprint,
            settings: measured.settings.into_iter().map(report).collect(),
        }
    }

    /// The exact setting.
    pub(super) fn exact(&self) -> &SettingReport {
        &self.settings[0]
    }
}
