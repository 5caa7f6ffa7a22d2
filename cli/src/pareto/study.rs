//! Everything that is to be measured, and the loop that does it.

use super::args::Common;
use super::measurement::{EXACT, Measurement, Subject};
use super::state::{Key, State};
use crate::error::CliError;
use crate::progress::Tasks;

/// The networks of a system over one data set.
pub(super) struct Study<'a> {
    pub(super) system: &'static str,
    /// What times are of: event, window.
    pub(super) unit: &'static str,
    /// Events or windows that were asked to be timed.
    pub(super) asked: usize,
    pub(super) data: Data,
    pub(super) subjects: Vec<Box<dyn Subject + 'a>>,
    /// What a person should know.
    pub(super) notes: Vec<String>,
}

/// What it is measured on.
pub(super) struct Data {
    pub(super) name: String,
    pub(super) recordings: u64,
    /// Events or windows.
    pub(super) size: u64,
    /// Of these, timed in each repeat.
    pub(super) timed: u64,
    pub(super) fingerprint: String,
}

/// A network's measurements, the exact one first.
pub(super) struct Measured {
    pub(super) network: String,
    pub(super) weights: String,
    pub(super) fingerprint: String,
    pub(super) settings: Vec<(String, Measurement)>,
}

/// Measurements that are to be made.
struct Task {
    subject: usize,
    setting: usize,
    name: String,
}

impl Study<'_> {
    /// Measures all settings that `common` asks for and `state` does not have.
    pub(super) fn run(&self, common: &Common, state: &mut State) -> Result<Vec<Measured>, CliError> {
        let tasks = self.tasks(common)?;
        let options = common.options(self.asked);
        let keys: Vec<Key> = tasks.iter().map(|task| self.key(task, &options)).collect();
        let missing = keys.iter().filter(|key| state.find(key).is_none()).count();
        let progress = Tasks::new(missing as u64, common.prints_json());
        let mut measured: Vec<Measured> =
            self.subjects.iter().map(|subject| Measured::of(&**subject)).collect();
        for (task, key) in tasks.into_iter().zip(keys) {
            let found = if let Some(found) = state.find(&key) {
                found.clone()
            } else {
                let subject = &self.subjects[task.subject];
                progress.start(format!("{}, {}", subject.network(), task.name));
                let found = state.add(key, subject.measure(task.setting)?)?;
                progress.done();
                found
            };
            measured[task.subject].settings.push((task.name, found));
        }
        progress.finish();
        measured.retain(|measured| !measured.settings.is_empty());
        Ok(measured)
    }

    /// All settings that `--only` leaves, and the exact one wherever a network has any.
    fn tasks(&self, common: &Common) -> Result<Vec<Task>, CliError> {
        let mut tasks = Vec::new();
        let mut found = false;
        for (place, subject) in self.subjects.iter().enumerate() {
            let names = subject.settings();
            let asked = |name: &str| common.asks_for(&format!("{}, {name}", subject.network()));
            let any = names.iter().any(|name| asked(name));
            found |= any;
            let wanted =
                names.into_iter().enumerate().filter(|(_, name)| asked(name) || (any && name == EXACT));
            tasks.extend(wanted.map(|(setting, name)| Task { subject: place, setting, name }));
        }
        if found {
            return Ok(tasks);
        }
        let all: Vec<String> = self.subjects.first().map(|subject| subject.settings()).unwrap_or_default();
        let expected = format!("a part of \"NETWORK, SETTING\", with a setting such as {}", all.join("; "));
        Err(CliError::Option { option: "--only", expected, found: common.only.join("; ") })
    }

    fn key(&self, task: &Task, options: &str) -> Key {
        let subject = &self.subjects[task.subject];
        Key {
            system: self.system.to_owned(),
            network: subject.network().to_owned(),
            weights: subject.fingerprint().to_owned(),
            setting: task.name.clone(),
            data: self.data.fingerprint.clone(),
            options: options.to_owned(),
            version: env!("CARGO_PKG_VERSION").to_owned(),
        }
    }
}

impl Measured {
    fn of(subject: &dyn Subject) -> Self {
        Self {
            network: subject.network().to_owned(),
            weights: subject.weights().to_owned(),
            fingerprint: subject.fingerprint().to_owned(),
            settings: Vec::new(),
        }
    }
}
