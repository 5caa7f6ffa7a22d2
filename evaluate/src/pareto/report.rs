//! Results of a study, with the keys of the JSON report.
//!
//! Input: measurements. Output: the Pareto front, and each network's fastest setting within some
//! error. A time is the ratio to the exact network times the exact network's own time, so that a
//! machine that is slower during one setting moves no point.

use meissner_kernels::Isa;
use meissner_run::fingerprint::Fingerprint;
use meissner_run::provenance::{Header, InputCard};
use serde::{Serialize, Serializer};

use super::measurement::{EXACT, Measurement};
use super::task_error::ErrorKind;

/// Results of all networks.
#[derive(Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Report {
    pub header: Header,
    pub system: &'static str,
    /// Unit of the times: "event", "window", "picture" or "recording".
    pub unit: &'static str,
    pub data: DataReport,
    /// Repeats of each measurement of time.
    pub repeats: u32,
    /// Instruction set of the kernels.
    pub isa: &'static str,
    /// Remarks, for people.
    pub notes: Vec<String>,
    /// The error by which settings are compared.
    pub compared: Compared,
    pub networks: Vec<NetworkReport>,
    pub fastest_within: Vec<Fastest>,
    /// The same in a paragraph.
    #[serde(rename = "words")]
    pub summary: String,
}

/// The data, and the part of it that is timed.
#[derive(Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct DataReport {
    pub name: String,
    /// Number of recordings, or of presses.
    pub recordings: u64,
    /// Number of events, windows, pictures or recordings.
    pub size: u64,
    /// Number of these that are timed in each repeat.
    pub timed: u64,
    pub fingerprint: String,
}

/// The error by which settings are compared.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Compared {
    /// Error of the task.
    Task(ErrorKind),
    /// Error against the exact outputs, as a share of their RMS.
    RelativeRms,
}

impl Serialize for Compared {
    /// Writes a word; errors of a task state their kind themselves.
    fn serialize<S: Serializer>(&self, s: S) -> Result<S::Ok, S::Error> {
        s.serialize_str(match self {
            Self::Task(_) => "task_error",
            Self::RelativeRms => "relative_rms",
        })
    }
}

impl Compared {
    /// The first kind of error that all settings have; else the error against exact outputs.
    pub(super) fn of(networks: &[NetworkReport]) -> Self {
        let settings = || networks.iter().flat_map(|network| &network.settings);
        let kind = |setting: &SettingReport| setting.measurement.task.first().map(|task| task.kind);
        let first = settings().next().and_then(kind);
        first
            .filter(|_| settings().all(|setting| kind(setting) == first))
            .map_or(Self::RelativeRms, Self::Task)
    }

    fn text(self, error: f64) -> String {
        match self {
            Self::Task(kind) => kind.text(error),
            Self::RelativeRms if error == 0.0 => "0".to_owned(),
            Self::RelativeRms => format!("{error:.1e}"),
        }
    }

    /// The same with its unit, in a sentence.
    fn in_words(self, error: f64) -> String {
        match self {
            Self::Task(kind) => format!("{} {}", kind.text(error), kind.unit()),
            Self::RelativeRms => self.text(error),
        }
    }
}

/// Results of a network.
#[derive(Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct NetworkReport {
    pub network: String,
    pub weights: String,
    pub fingerprint: String,
    /// The settings, the exact one first.
    pub settings: Vec<SettingReport>,
}

/// Results of a setting.
#[derive(Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct SettingReport {
    pub setting: String,
    /// The compared time, in microseconds.
    pub us: f64,
    /// Time of the exact setting as a multiple of `us`.
    pub speed_up: f64,
    /// The compared error.
    pub error: f64,
    /// 95 % interval of the error; `None` without labels, and for a single press or recording.
    pub interval_95: Option<(f64, f64)>,
    /// Whether no other setting beats it.
    pub on_front: bool,
    #[serde(flatten)]
    pub measurement: Measurement,
}

/// The fastest setting of a network within some error of the exact one.
#[derive(Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct Fastest {
    pub network: String,
    /// Largest error above that of the exact setting, in the unit of the error.
    pub within: f64,
    /// The same in words.
    #[serde(skip)]
    pub bound: String,
    pub setting: String,
    pub speed_up: f64,
    pub error: f64,
}

impl Report {
    /// The report of `networks` of a system with the unit of its times.
    pub(super) fn new(
        (system, unit): (&'static str, &'static str),
        data: DataReport,
        repeats: u32,
        notes: Vec<String>,
        mut networks: Vec<NetworkReport>,
    ) -> Self {
        let compared = Compared::of(&networks);
        match compared {
            Compared::Task(_) => mark_front(networks.iter_mut().flat_map(|network| &mut network.settings)),
            Compared::RelativeRms => {
                networks.iter_mut().for_each(|network| mark_front(&mut network.settings));
            }
        }
        let fastest_within = fastest(&networks, compared);
        let summary = summary(&networks, &fastest_within, compared);
        let header = Header::of_many("pareto", InputCard::other(&data.name, system));
        let isa = Isa::best().name();
        Self { header, system, unit, data, repeats, isa, notes, compared, networks, fastest_within, summary }
    }

    /// Heading of the times that are compared.
    pub fn time_name(&self) -> String {
        format!("time per {} (us)", self.unit)
    }

    /// Heading of the errors that are compared.
    pub fn error_name(&self) -> &'static str {
        let relative = |network: &NetworkReport| network.exact().measurement.numerical.relative_rms.is_some();
        match self.compared {
            Compared::Task(kind) => kind.name(),
            Compared::RelativeRms if self.networks.iter().all(relative) => "relative RMS error",
            Compared::RelativeRms => "RMS error",
        }
    }
}

impl NetworkReport {
    /// The report of a network without settings.
    pub(super) fn new(network: String, weights: String, fingerprint: Fingerprint) -> Self {
        Self { network, weights, fingerprint: fingerprint.finish(), settings: Vec::new() }
    }

    /// The same with `settings`, the exact one first; none is on the front yet.
    pub(super) fn with_settings(mut self, settings: Vec<(String, Measurement)>) -> Self {
        let exact_us = settings.first().map_or(0.0, |(_, exact)| exact.timing.push_predict_us.mean);
        let report = |(setting, measurement): (String, Measurement)| {
            // The exact setting is as fast as itself, whatever the clock says.
            let ratio = if setting == EXACT { 1.0 } else { measurement.timing.ratio };
            let (error, interval_95) = measurement.error();
            let (us, speed_up, on_front) = (exact_us * ratio, 1.0 / ratio, false);
            SettingReport { setting, us, speed_up, error, interval_95, on_front, measurement }
        };
        self.settings = settings.into_iter().map(report).collect();
        self
    }

    /// The exact setting.
    pub fn exact(&self) -> &SettingReport {
        &self.settings[0]
    }
}

impl SettingReport {
    /// Its time, as a cell under [`Report::time_name`].
    pub fn time_text(&self) -> String {
        format!("{:.*}", if self.us < 10.0 { 2 } else { 1 }, self.us)
    }

    /// Its error, as a cell under [`Report::error_name`].
    pub fn error_text(&self, compared: Compared) -> String {
        compared.text(self.error)
    }
}

fn mark_front<'a>(settings: impl IntoIterator<Item = &'a mut SettingReport>) {
    let mut settings: Vec<&mut SettingReport> = settings.into_iter().collect();
    let points: Vec<(f64, f64)> = settings.iter().map(|setting| (setting.us, setting.error)).collect();
    pareto_front(&points).into_iter().for_each(|place| settings[place].on_front = true);
}

/// Indices of the points (time, error) that no other beats, by time, error, index. O(n log n).
///
/// A point beats another if it is at most as large in both and smaller in one. Equal points are on
/// the front together. Points that are not finite are left out.
pub fn pareto_front(points: &[(f64, f64)]) -> Vec<usize> {
    let mut order: Vec<usize> =
        (0..points.len()).filter(|&i| points[i].0.is_finite() && points[i].1.is_finite()).collect();
    order.sort_by(|&a, &b| {
        let ((ta, ea), (tb, eb)) = (points[a], points[b]);
        ta.total_cmp(&tb).then(ea.total_cmp(&eb)).then(a.cmp(&b))
    });
    let mut last: Option<(f64, f64)> = None;
    // All points before are at most as slow: a point must be better than the best, or equal to it.
    order.retain(|&i| {
        let stays = last.is_none_or(|last| points[i].1 < last.1 || points[i] == last);
        if stays {
            last = Some(points[i]);
        }
        stays
    });
    order
}

/// Bounds above an error of `exact`, and their descriptions.
fn bounds(compared: Compared, exact: f64) -> [(f64, String); 3] {
    match compared {
        Compared::Task(kind) if kind.is_share() => {
            [0.005, 0.01, 0.02].map(|within| (within, format!("within {} points", 100.0 * within)))
        }
        Compared::Task(_) => {
            [5.0, 10.0, 25.0].map(|percent| (percent / 100.0 * exact, format!("within {percent} % more")))
        }
        Compared::RelativeRms => {
            [1e-3, 1e-2, 1e-1].map(|within| (within, format!("within {within} of their RMS")))
        }
    }
}

/// A smaller speed-up counts as none: clocks do not resolve it.
const NOTICEABLE: f64 = 1.02;

/// Each network's fastest setting within each bound, the exact one included.
pub(super) fn fastest(networks: &[NetworkReport], compared: Compared) -> Vec<Fastest> {
    let mut all = Vec::new();
    for network in networks {
        let exact = network.exact().error;
        for (within, bound) in bounds(compared, exact) {
            // Differences of shares such as 0.11 - 0.1 exceed 0.01 in the last bit.
            let most = exact + within + 1e-12;
            let faster = |setting: &SettingReport| setting.setting == EXACT || setting.speed_up >= NOTICEABLE;
            let fits = network.settings.iter().filter(|setting| setting.error <= most && faster(setting));
            let fastest = fits.reduce(|best, other| if other.us < best.us { other } else { best });
            all.extend(fastest.map(|fastest| Fastest {
                network: network.network.clone(),
                within,
                bound,
                setting: fastest.setting.clone(),
                speed_up: fastest.speed_up,
                error: fastest.error,
            }));
        }
    }
    all
}

pub(super) fn summary(networks: &[NetworkReport], fastest: &[Fastest], compared: Compared) -> String {
    let sentence = |network: &NetworkReport| {
        let own = fastest.iter().filter(|fastest| fastest.network == network.network);
        let parts: Vec<String> = own.map(|fastest| part(fastest, network.exact(), compared)).collect();
        let (name, error) = (&network.network, compared.in_words(network.exact().error));
        let exact = match compared {
            Compared::Task(ErrorKind::WrongAnswers) => {
                format!("{name} is wrong in {error} of its answers when it is exact")
            }
            Compared::Task(ErrorKind::OneMinusIou) => {
                format!("{name} lacks {error} to an IoU of 1 when it is exact")
            }
            Compared::Task(ErrorKind::SquaredForce) => {
                format!("{name} has a mean squared error of {error} when it is exact")
            }
            Compared::Task(ErrorKind::AbsoluteForce) => {
                format!("{name} has a mean absolute error of {error} when it is exact")
            }
            Compared::RelativeRms => format!("{name} against its exact outputs"),
        };
        format!("{exact}: {}.", parts.join("; "))
    };
    networks.iter().map(sentence).collect::<Vec<_>>().join(" ")
}

fn part(fastest: &Fastest, exact: &SettingReport, compared: Compared) -> String {
    let Fastest { bound, setting, speed_up, .. } = fastest;
    if *setting == exact.setting {
        return format!("{bound} nothing is faster");
    }
    let error = compared.in_words(fastest.error);
    format!("{bound} the fastest is {setting}, {speed_up:.2} times as fast ({error})")
}
