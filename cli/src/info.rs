//! `meissner info`: the contents of a recording in numbers.

use std::io::{self, Write};
use std::path::PathBuf;

use meissner_engine::Event;
use meissner_io::Recording;
use serde::Serialize;

use crate::args::{JsonArgs, PartArgs, ReadArgs};
use crate::error::CliError;
use crate::output;
use crate::progress::Progress;
use meissner_run::left_out::{self, LeftOutSummary};
use meissner_run::losses::Salvaged;
use meissner_run::text::grouped;

const PEAK_US: i64 = 1_000;

/// `meissner info`.
#[derive(Debug, clap::Args)]
pub(crate) struct InfoArgs {
    /// Recording, or - for text on standard input.
    recording: PathBuf,
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    part: PartArgs,
    #[command(flatten)]
    format: JsonArgs,
}

/// The contents of a recording.
#[derive(Debug, Serialize)]
struct Info {
    format: String,
    /// Columns and rows; `None` if the recording does not state them.
    sensor: Option<[u16; 2]>,
    events: usize,
    on: usize,
    off: usize,
    first_t_us: Option<i64>,
    last_t_us: Option<i64>,
    /// Latest time minus earliest time.
    span_us: u64,
    /// Mean over the span; `None` for a span of 0.
    events_per_s: Option<f64>,
    /// Largest number of events within any millisecond.
    peak_events_per_ms: usize,
    /// Events that are earlier than an event before them.
    late: usize,
    /// Largest column and row of an event.
    largest_xy: Option<[u16; 2]>,
    other_streams: Vec<OtherStream>,
    /// Omitted data that is no event of the sensor, by kind.
    left_out: Vec<LeftOutSummary>,
    /// Facts that the recording does not state and that were assumed.
    assumed: Vec<&'static str>,
    #[serde(skip)]
    left_out_lines: Vec<String>,
    /// The part that was left out; `None` if the recording is complete.
    salvaged: Option<Salvaged>,
}

#[derive(Debug, Serialize)]
struct OtherStream {
    name: String,
    kind: String,
    packets: u64,
    elements: u64,
}

/// Prints the contents of the recording.
pub(crate) fn info(args: &InfoArgs) -> Result<(), CliError> {
    let progress = Progress::busy(|| "reading".to_owned());
    let recording = args.read.read(&args.recording, args.part.part())?;
    let info = Info::of(&Recording { sensor: recording.sensor.or(args.read.sensor), ..recording });
    progress.finish();
    output::print(args.format.json, &info, |out| info.write(out))
}

impl Info {
    fn of(recording: &Recording) -> Self {
        let events = &recording.events;
        let mut times: Vec<i64> = events.iter().map(|e| e.t_us).collect();
        let late = late(events);
        times.sort_unstable();
        let span_us = times.first().zip(times.last()).map_or(0, |(first, last)| last.abs_diff(*first));
        let on = events.iter().filter(|e| e.on).count();
        Self {
            format: recording.format.to_string(),
            sensor: recording.sensor.map(|s| [s.width, s.height]),
            events: events.len(),
            on,
            off: events.len() - on,
            first_t_us: times.first().copied(),
            last_t_us: times.last().copied(),
            span_us,
            events_per_s: (span_us > 0).then(|| events.len() as f64 / (span_us as f64 / 1e6)),
            peak_events_per_ms: peak(&times),
            late,
            largest_xy: events.iter().map(|e| [e.x, e.y]).reduce(|a, b| [a[0].max(b[0]), a[1].max(b[1])]),
            other_streams: recording
                .other_streams
                .iter()
                .map(|stream| OtherStream {
                    name: stream.name.clone(),
                    kind: stream.kind.to_string(),
                    packets: stream.packets,
                    elements: stream.elements,
                })
                .collect(),
            left_out: recording.left_out.iter().map(LeftOutSummary::from).collect(),
            assumed: recording.assumed.clone(),
            left_out_lines: recording.left_out.iter().map(left_out::sentence).collect(),
            salvaged: Salvaged::of(recording),
        }
    }

    fn write(&self, out: &mut impl Write) -> io::Result<()> {
        writeln!(out, "format      {}", self.format)?;
        match self.sensor {
            Some([width, height]) => writeln!(out, "sensor      {width} x {height} pixels")?,
            None => writeln!(out, "sensor      not named: `run` needs --sensor WxH")?,
        }
        let count = |n: usize| grouped(n as u64);
        writeln!(out, "events      {} ({} on, {} off)", count(self.events), count(self.on), count(self.off))?;
        if let (Some(first), Some(last)) = (self.first_t_us, self.last_t_us) {
            writeln!(out, "time        {first} to {last} us: {:.6} s", self.span_us as f64 / 1e6)?;
        }
        if let Some(rate) = self.events_per_s {
            let mean = grouped(rate.round() as u64);
            writeln!(
                out,
                "rate        {mean} events/s in the mean, at most {} in 1 ms",
                count(self.peak_events_per_ms)
            )?;
        }
        if let Some([x, y]) = self.largest_xy {
            writeln!(out, "pixels      up to x = {x}, y = {y}")?;
        }
        writeln!(out, "late        {} events earlier than one before them", count(self.late))?;
        for stream in &self.other_streams {
            let OtherStream { name, kind, packets, elements } = stream;
            writeln!(
                out,
                "also holds  {name}: {} {kind} in {} packets, not decoded",
                grouped(*elements),
                grouped(*packets)
            )?;
        }
        for left_out in &self.left_out_lines {
            writeln!(out, "left out    {left_out}")?;
        }
        for assumed in &self.assumed {
            writeln!(out, "assumed     {assumed}")?;
        }
        if let Some(salvaged) = &self.salvaged {
            writeln!(out, "salvaged    {salvaged}")?;
        }
        Ok(())
    }
}

/// The number of events that are earlier than an event before them.
pub(crate) fn late(events: &[Event]) -> usize {
    let mut newest = i64::MIN;
    let is_late = |event: &&Event| {
        let late = event.t_us < newest;
        newest = newest.max(event.t_us);
        late
    };
    events.iter().filter(is_late).count()
}

/// The largest number of the ascending `times` that are less than [`PEAK_US`] apart.
pub(crate) fn peak(times: &[i64]) -> usize {
    let mut first = 0;
    let mut most = 0;
    for (i, &t) in times.iter().enumerate() {
        while t.abs_diff(times[first]) >= PEAK_US.unsigned_abs() {
            first += 1;
        }
        most = most.max(i + 1 - first);
    }
    most
}
