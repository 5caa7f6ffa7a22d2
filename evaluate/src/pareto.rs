//! Run time against error: exact networks, and networks with each approximation.
//!
//! Input: networks with data. Output: a [`Report`] with times, work and errors of every setting,
//! and the settings that no other beats. Finished measurements are kept in a [`State`].

mod events;
mod grasps;
mod measurement;
mod pictures;
mod report;
mod settings;
mod slip;
mod state;
mod task_error;

use meissner_kernels::Isa;

use crate::error::{EvaluateError, RequestPart, Result};
pub use events::{AngleOptions, angle, events};
pub use grasps::force;
pub use measurement::{EXACT, Measurement, Numerical, Time, Timing};
pub use pictures::area;
pub use report::{Compared, DataReport, Fastest, NetworkReport, Report, SettingReport, pareto_front};
pub use slip::slip;
pub use state::{Key, State};
pub use task_error::{ErrorKind, TaskError};

/// The settings that are measured, and how often.
#[derive(Clone, Debug)]
pub struct Options {
    /// Events, windows, pictures or recordings of a repeat; `None`: 20,000, 400, 40 or 20.
    pub timed: Option<usize>,
    /// Repeats of each measurement of time; at least 1.
    pub repeats: u32,
    /// Parts of the "NETWORK, SETTING" to measure, in addition to the exact ones; empty for all.
    pub only: Vec<String>,
}

/// The networks of a system over one data set.
pub struct Study<'a> {
    system: &'static str,
    /// Unit of the times: "event", "window", "picture" or "recording".
    unit: &'static str,
    /// Requested number of these.
    asked: usize,
    data: DataReport,
    networks: Vec<NetworkStudy<'a>>,
    notes: Vec<String>,
}

struct NetworkStudy<'a> {
    /// The report, still without settings.
    report: NetworkReport,
    /// Names of the settings with their indices; the first is [`EXACT`].
    settings: Vec<(usize, String)>,
    /// Measures the setting with this index.
    measure: Box<dyn Fn(usize) -> Result<Measurement> + 'a>,
}

/// Progress of a study.
#[derive(Clone, Copy, Debug)]
pub enum Progress<'a> {
    /// The number of measurements that the state lacks.
    Missing(u64),
    /// The measurement of a setting begins.
    Started {
        /// Name of the network.
        network: &'a str,
        /// Name of the setting.
        setting: &'a str,
    },
    /// It is finished.
    Finished,
}

impl Study<'_> {
    /// Measures the settings that `options` ask for and `state` lacks, and reports all of them. An
    /// error of `progress` ends the run; finished measurements are in the state.
    ///
    /// # Errors
    /// No setting has such a name, a network cannot run, or the state cannot be written.
    pub fn run(
        mut self,
        options: &Options,
        state: &mut State,
        mut progress: impl FnMut(Progress<'_>) -> Result<()>,
    ) -> Result<Report> {
        self.choose(&options.only)?;
        let conditions = format!("{} timed, {} repeats, {}", self.asked, options.repeats, Isa::best().name());
        let key = |network: &NetworkReport, setting: &str| Key {
            system: self.system.to_owned(),
            network: network.network.clone(),
            weights: network.fingerprint.clone(),
            setting: setting.to_owned(),
            data: self.data.fingerprint.clone(),
            options: conditions.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        let keys = self
            .networks
            .iter()
            .flat_map(|network| network.settings.iter().map(|(_, setting)| key(&network.report, setting)));
        progress(Progress::Missing(keys.filter(|key| state.find(key).is_none()).count() as u64))?;
        let mut networks = Vec::new();
        for NetworkStudy { report, settings, measure } in self.networks {
            let mut measured = Vec::new();
            for (index, setting) in settings {
                let key = key(&report, &setting);
                let measurement = if let Some(found) = state.find(&key) {
                    found.clone()
                } else {
                    progress(Progress::Started { network: &report.network, setting: &setting })?;
                    let measurement = state.add(key, measure(index)?)?;
                    progress(Progress::Finished)?;
                    measurement
                };
                measured.push((setting, measurement));
            }
            networks.push(report.with_settings(measured));
        }
        Ok(Report::new((self.system, self.unit), self.data, options.repeats, self.notes, networks))
    }

    /// Keeps the settings with one of `only` in their name, and their networks' exact ones.
    fn choose(&mut self, only: &[String]) -> Result<()> {
        let settings =
            self.networks.first().map(|network| network.settings.iter().map(|(_, name)| name.as_str()));
        let settings = settings.into_iter().flatten().collect::<Vec<_>>().join("; ");
        for NetworkStudy { report, settings, .. } in &mut self.networks {
            let is_asked = |(_, setting): &(usize, String)| {
                let name = format!("{}, {setting}", report.network);
                only.is_empty() || only.iter().any(|part| name.contains(part.as_str()))
            };
            let any = settings.iter().any(is_asked);
            settings.retain(|setting| is_asked(setting) || (any && setting.1 == EXACT));
        }
        self.networks.retain(|network| !network.settings.is_empty());
        if self.networks.is_empty() {
            let expected = format!("a part of \"NETWORK, SETTING\", with a setting such as {settings}");
            return Err(EvaluateError::request(RequestPart::Settings, expected, only.join("; ")));
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests;
