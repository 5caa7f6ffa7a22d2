//! The events that a source sends: a recording, once or several times, or what arrives on a stream.

use std::io;
use std::path::{Path, PathBuf};
use std::sync::mpsc::{Receiver, sync_channel};
use std::thread;

use clap::Args;
use meissner::io::ReadOptions;
use meissner::{Event, Sensor};
use meissner_pipeline::source::Source;
use meissner_pipeline::text::sensor;
use meissner_pipeline::{PipelineError, streams};

use crate::node::Failure;

/// Stream time between two runs of a recording, in microseconds.
const PAUSE_US: i64 = 10_000;

/// Events of a stream that wait to be sent; more wait in the operating system's buffers.
const WAITING: usize = 1 << 16;

/// Which events a source sends.
#[derive(Clone, Debug, Args)]
#[cfg_attr(test, derive(Default))]
pub(crate) struct StreamOptions {
    /// A recording, or a stream such as udp://HOST:PORT; without it, the embedded recording of a simulated press
    pub(crate) recording: Option<PathBuf>,
    /// Columns and rows of the sensor, for a recording or a stream that does not state them
    #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = sensor)]
    pub(crate) sensor: Option<Sensor>,
    /// How often a recording is sent, one run after the other; its times go on
    #[arg(long, default_value_t = 1)]
    pub(crate) runs: u32,
}

/// The events of a source.
pub(crate) enum Stream {
    /// All of them.
    Recorded(Vec<Event>),
    /// As they arrive; the end is that of the channel.
    Arriving(Receiver<Result<Event, PipelineError>>),
}

impl StreamOptions {
    /// The sensor's geometry and its events. Waits for the first event of a stream unless the geometry is given.
    ///
    /// # Errors
    /// The recording or the stream cannot be read, or its geometry is not known.
    pub(crate) fn open(&self) -> Result<(Sensor, Stream), Failure> {
        match self.recording.as_deref().filter(|path| streams::is_live(path)) {
            None => {
                let (sensor, events) = self.recorded()?;
                Ok((sensor, Stream::Recorded(events)))
            }
            Some(path) => arriving(path.to_owned(), self.sensor),
        }
    }

    /// All events of a recording.
    ///
    /// # Errors
    /// As [`Self::open`].
    pub(crate) fn recorded(&self) -> Result<(Sensor, Vec<Event>), PipelineError> {
        let source =
            Source::open(self.recording.as_deref(), &ReadOptions::default(), self.sensor.is_some(), false)?;
        let sensor = source.sensor(self.sensor)?;
        let events = source.collect::<Result<Vec<_>, _>>()?;
        Ok((sensor, repeated(&events, self.runs)))
    }
}

/// `events`, `runs` times; each run begins a pause after the end of the run before.
fn repeated(events: &[Event], runs: u32) -> Vec<Event> {
    let times = || events.iter().map(|event| event.t_us);
    let (Some(first), Some(last)) = (times().min(), times().max()) else { return Vec::new() };
    let span = last.saturating_sub(first).saturating_add(PAUSE_US);
    let run = |run: u32| {
        let later = span.saturating_mul(run.into());
        events.iter().map(move |&event| Event { t_us: event.t_us.saturating_add(later), ..event })
    };
    (0..runs).flat_map(run).collect()
}

/// Reads the stream `path` in a thread of its own, since a sender must also tell when nothing arrives.
fn arriving(path: PathBuf, asked: Option<Sensor>) -> Result<(Sensor, Stream), Failure> {
    let name = path.display().to_string();
    let (events, receiver) = sync_channel(WAITING);
    let (known, geometry) = sync_channel(1);
    let read = move || {
        let source = match open(&path, asked) {
            Ok((sensor, source)) => {
                // The other end is there: it waits for this.
                let _ = known.send(Ok(sensor));
                source
            }
            Err(error) => return drop(known.send(Err(error))),
        };
        for event in source {
            // The sender has ended.
            if events.send(event).is_err() {
                break;
            }
        }
    };
    thread::spawn(read);
    let ended = |_| Failure::File { path: name, source: io::Error::other("its reader has ended") };
    let sensor = geometry.recv().map_err(ended)??;
    Ok((sensor, Stream::Arriving(receiver)))
}

fn open(path: &Path, asked: Option<Sensor>) -> Result<(Sensor, Source), PipelineError> {
    let source = Source::open(Some(path), &ReadOptions::default(), asked.is_some(), false)?;
    Ok((source.sensor(asked)?, source))
}

#[cfg(test)]
mod tests {
    use meissner::Event;

    use super::{PAUSE_US, repeated};

    #[test]
    fn the_times_of_a_second_run_go_on_after_a_pause() {
        let events = [Event::new(5, 1, 1, true), Event::new(25, 2, 2, false)];
        let times: Vec<_> = repeated(&events, 3).iter().map(|event| event.t_us).collect();
        let later = 20 + PAUSE_US;
        assert_eq!(times, [5, 25, 5 + later, 25 + later, 5 + 2 * later, 25 + 2 * later]);
        assert!(repeated(&[], 3).is_empty() && repeated(&events, 0).is_empty());
    }
}
