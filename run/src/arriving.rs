//! Events as they arrive on a stream, and a connection that is made again after it was cut.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, IoError, LiveEvents, ReadOptions};

use crate::error::{Result, RunError};
use crate::{interrupt, streams};

/// Time between two attempts to connect.
const PAUSE: Duration = Duration::from_millis(100);

/// The format of raw bytes on the stream `path`; `None`: a text or records.
pub(crate) fn raw_format(path: &Path, options: &ReadOptions) -> Option<Format> {
    let asked = options.format.filter(|&format| format != Format::Csv);
    asked.or_else(|| streams::is_of_packets(path).then_some(Format::Aedat4))
}

/// The events of a stream: from a text or records, unless `options` or the stream's name state a
/// format of raw bytes.
pub(crate) struct Arriving {
    path: PathBuf,
    options: ReadOptions,
    events: LiveEvents<interrupt::Input>,
    /// Time during which a connection that was cut is tried again.
    pub(crate) patience: Duration,
}

impl Arriving {
    /// Opens the stream `path`. A cut connection is its end.
    pub(crate) fn open(path: &Path, options: &ReadOptions) -> Result<Self> {
        let refused = |source| RunError::recording(&streams::name(path), source);
        let events = match raw_format(path, options) {
            Some(format) => LiveEvents::raw(streams::open(path)?, format, *options).map_err(refused)?,
            None if streams::is_of_datagrams(path) => {
                LiveEvents::of_datagrams(streams::open(path)?, options.text)
            }
            None => LiveEvents::new(streams::open(path)?, options.text),
        };
        Ok(Self { path: path.to_owned(), options: *options, events, patience: Duration::ZERO })
    }

    /// The name of the format, known after the first call of `next`.
    pub(crate) fn format(&self) -> &'static str {
        self.events.format()
    }

    /// The sensor that the stream names, once it was read.
    pub(crate) fn sensor(&self) -> Option<Sensor> {
        self.events.sensor()
    }

    /// Whether the stream was connected again after its end.
    fn is_back(&mut self) -> bool {
        if self.patience.is_zero() || !streams::is_of_server(&self.path) {
            return false;
        }
        let until = Instant::now() + self.patience;
        tracing::warn!("{}: the connection was cut: it is tried again", self.path.display());
        while !interrupt::requested() && Instant::now() < until {
            if let Ok(again) = Self::open(&self.path, &self.options) {
                self.events = again.events;
                return true;
            }
            interrupt::sleep(PAUSE);
        }
        false
    }
}

impl Iterator for Arriving {
    type Item = Result<Event, IoError>;

    fn next(&mut self) -> Option<Self::Item> {
        let item = self.events.next();
        let has_ended = matches!(item, None | Some(Err(IoError::Truncated { .. } | IoError::Stream { .. })));
        if has_ended && self.is_back() {
            return Some(Err(IoError::Cut));
        }
        item
    }
}
