//! Run time against error: networks exactly, and with each approximation.
//!
//! Enters: networks with data ([`angle`], [`events`](fn@events), [`slip`]). Leaves: a [`Report`] with times, work and errors of every
//! setting of every network, and the settings that no other one beats. Finished measurements are kept in a [`State`] and not
//! repeated.

mod event_network;
mod frame_network;
mod measurement;
mod report;
mod settings;
mod state;
mod studies;

use meissner_kernels::Isa;

use crate::error::{EvaluateError, RequestPart};
pub use measurement::{EXACT, Measurement, Numerical, TaskError, Time, Timing};
pub use report::{Compared, DataReport, Fastest, NetworkReport, Report, SettingReport, pareto_front};
use state::Key;
pub use state::State;
pub use studies::{AngleOptions, angle, events, slip};

/// What is measured, and how often.
#[derive(Clone, Debug)]
pub struct Options {
    /// About how many events are timed in each repeat, or windows of frame networks; `None` for 20,000 events or 400 windows.
    pub timed: Option<usize>,
    /// Repeats of each measurement of time; at least 1.
    pub repeats: u32,
    /// Only settings with one of these in "NETWORK, SETTING" are measured, and the exact ones; empty for all settings.
    pub only: Vec<String>,
}

/// The networks of a system over one data set.
pub struct Study<'a> {
    system: &'static str,
    /// Unit of the times: "event" or "window".
    unit: &'static str,
    /// Number of events or windows that were asked for.
    asked: usize,
    data: DataReport,
    networks: Vec<NetworkStudy<'a>>,
    notes: Vec<String>,
}

/// A network with its settings.
struct NetworkStudy<'a> {
    name: String,
    /// Source of the weights.
    weights: String,
    /// Fingerprint of network and weights.
    fingerprint: String,
    /// Names of the settings; the first is [`EXACT`].
    settings: Vec<String>,
    /// Measures the setting with this index.
    measure: Box<dyn Fn(usize) -> Result<Measurement, EvaluateError> + 'a>,
}

/// Progress of a study.
#[derive(Clone, Copy, Debug)]
pub enum Progress<'a> {
    /// So many measurements are missing in the state.
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
    /// Measures the settings that `options` ask for and `state` lacks, and reports all of them.
    ///
    /// # Errors
    /// No setting has a name that was asked for, a network cannot run, or the state cannot be written.
    pub fn run(
        self,
        options: &Options,
        state: &mut State,
        mut progress: impl FnMut(Progress<'_>),
    ) -> Result<Report, EvaluateError> {
        let asked = self.asked(options)?;
        let conditions = format!("{} timed, {} repeats, {}", self.asked, options.repeats, Isa::best().name());
        let key = |network: &NetworkStudy<'_>, setting: usize| Key {
            system: self.system.to_owned(),
            network: network.name.clone(),
            weights: network.fingerprint.clone(),
            setting: network.settings[setting].clone(),
            data: self.data.fingerprint.clone(),
            options: conditions.clone(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        };
        let all = || self.networks.iter().zip(&asked);
        let keys = all().flat_map(|(network, asked)| asked.iter().map(|&setting| key(network, setting)));
        progress(Progress::Missing(keys.filter(|key| state.find(key).is_none()).count() as u64));
        let mut networks = Vec::new();
        for (network, asked) in all().filter(|(_, asked)| !asked.is_empty()) {
            let mut measured = Vec::new();
            for &setting in asked {
                let (key, name) = (key(network, setting), &network.settings[setting]);
                let measurement = if let Some(found) = state.find(&key) {
                    found.clone()
                } else {
                    progress(Progress::Started { network: &network.name, setting: name });
                    let measurement = state.add(key, (network.measure)(setting)?)?;
                    progress(Progress::Finished);
                    measurement
                };
                measured.push((name.clone(), measurement));
            }
            let (name, weights) = (network.name.clone(), network.weights.clone());
            networks.push(NetworkReport::new(name, weights, network.fingerprint.clone(), measured));
        }
        Ok(Report::new((self.system, self.unit), self.data, options.repeats, self.notes, networks))
    }

    /// Indices of the settings of each network that `options` ask for, with the exact one wherever there is any.
    fn asked(&self, options: &Options) -> Result<Vec<Vec<usize>>, EvaluateError> {
        let of_network = |network: &NetworkStudy<'_>| {
            let is_asked = |setting: &String| {
                let name = format!("{}, {setting}", network.name);
                options.only.is_empty() || options.only.iter().any(|part| name.contains(part.as_str()))
            };
            let any = network.settings.iter().any(is_asked);
            let settings = network.settings.iter().enumerate();
            let asked = settings.filter(|(_, name)| is_asked(name) || (any && *name == EXACT));
            asked.map(|(setting, _)| setting).collect::<Vec<_>>()
        };
        let asked: Vec<_> = self.networks.iter().map(of_network).collect();
        if asked.iter().all(Vec::is_empty) {
            let settings = self.networks.first().map_or_else(String::new, |n| n.settings.join("; "));
            let expected = format!("a part of \"NETWORK, SETTING\", with a setting such as {settings}");
            return Err(EvaluateError::request(RequestPart::Settings, expected, options.only.join("; ")));
        }
        Ok(asked)
    }
}
