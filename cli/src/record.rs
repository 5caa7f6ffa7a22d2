//! `meissner record`: events of a live source into files of AEDAT4.

use std::io::{self, Write};
use std::path::PathBuf;
use std::sync::Arc;
use std::sync::atomic::Ordering;
use std::time::Instant;

use meissner_run::interrupt;
use meissner_run::record::{
    RecordOptions, RecordProgress, RecordSummary, RecordedFile, record as record_into,
};
use meissner_run::text::{grouped, span_us};

use crate::args::{JsonArgs, OUTPUT, PartArgs, ReadArgs};
use crate::error::CliError;
use crate::output::{self, Force, Out};
use crate::progress::Progress;
use crate::stderr::tell;

/// Examples, at the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner record dv://127.0.0.1:7777 --out monday.aedat4
  meissner record dv://127.0.0.1:7777 --out presses --split-on-silence 300ms
  cat /dev/video0 | meissner record - --format evt3 --sensor 320x320 --out presses --split-on-silence 300ms --activity-filter 2ms
  meissner record session.raw --out presses --split-on-silence 300ms";

/// `meissner record`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct RecordArgs {
    /// Live events, or a recording.
    ///
    /// As for `run`: - for standard input, tcp://HOST:PORT, tcp-listen://HOST:PORT, udp://HOST:PORT
    /// or dv://HOST:PORT. A recording can be split.
    #[arg(value_name = "SOURCE")]
    source: PathBuf,
    /// File to write (AEDAT4), or with --split-on-silence a folder.
    ///
    /// Events are written as they arrive, at least ten times a second: if the program is killed,
    /// what was written can be read. If the disk is full, the file keeps what was written before.
    #[arg(long, value_name = "FILE|FOLDER", help_heading = OUTPUT)]
    out: PathBuf,
    /// Write one file for each press: a silence of TIME ends it.
    ///
    /// The files are press-0001.aedat4 and so on, behind those that are there. A row for each is
    /// added to recordings.csv: least and greatest time in the sensor's microseconds, events, and
    /// the time of the host in Unix microseconds at which the first event arrived. A step of the
    /// sensor's clock by more than TIME ends a press too.
    #[arg(long = "split-on-silence", value_name = "TIME", value_parser = span_us, help_heading = OUTPUT)]
    silence_us: Option<i64>,
    /// Events without a neighbour's event within TIME before do not end a silence.
    ///
    /// Noise within a press is recorded, noise in a silence is not.
    #[arg(long = "activity-filter", value_name = "TIME", value_parser = span_us, requires = "silence_us", help_heading = OUTPUT)]
    activity_us: Option<i64>,
    #[command(flatten)]
    force: Force,
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    part: PartArgs,
    #[command(flatten)]
    format: JsonArgs,
}

/// Records until the source ends or a signal comes.
pub(crate) fn record(args: &RecordArgs) -> Result<(), CliError> {
    if args.silence_us.is_none() {
        output::check_result(&args.out, args.force)?;
    }
    let source = args.read.open(Some(&args.source), args.part.part())?;
    interrupt::listen();
    let sensor = source.sensor(args.read.sensor)?;
    let options = RecordOptions {
        silence_us: args.silence_us,
        activity_us: args.activity_us,
        replace: args.force.force,
    };
    let progress = Arc::new(RecordProgress::default());
    let bar = Progress::busy({
        let (progress, started) = (Arc::clone(&progress), Instant::now());
        move || {
            let events = progress.events.load(Ordering::Relaxed);
            let rate = (events as f64 / started.elapsed().as_secs_f64().max(1e-3)) as u64;
            let megabytes = progress.bytes.load(Ordering::Relaxed) as f64 / 1e6;
            let files = progress.files.load(Ordering::Relaxed);
            format!(
                "recording: {} events ({} a second), {files} files done, {megabytes:.1} MB",
                grouped(events),
                grouped(rate)
            )
        }
    });
    let is_split = args.silence_us.is_some();
    let closed = |file: &RecordedFile| {
        if is_split {
            tell(format_args!("{}", sentence(file)));
        }
    };
    let (summary, recorded) = record_into(source, sensor, &args.out, options, &progress, closed);
    bar.finish();
    output::print(args.format.json, &summary, |out| text(out, args, &summary))?;
    Ok(recorded?)
}

/// A file that is complete, as a sentence.
fn sentence(file: &RecordedFile) -> String {
    let seconds = file.last_us.saturating_sub(file.first_us) as f64 / 1e6;
    format!("{}: {} events in {seconds:.3} s", file.recording, grouped(file.events))
}

fn text(out: &mut Out, args: &RecordArgs, summary: &RecordSummary) -> io::Result<()> {
    let RecordSummary {
        recordings,
        events,
        bytes,
        outside_sensor,
        in_silence,
        earlier,
        lines_refused,
        seconds,
    } = summary;
    match (args.silence_us, &recordings[..]) {
        (None, [file]) => writeln!(out, "{}", sentence(file))?,
        _ => writeln!(out, "{}: {} presses", args.out.display(), grouped(recordings.len() as u64))?,
    }
    writeln!(out, "{} events, {} bytes, {seconds:.1} s", grouped(*events), grouped(*bytes))?;
    if let Some(host_us) = recordings.first().and_then(|file| file.host_us) {
        writeln!(
            out,
            "the first event, at {} us, arrived at {host_us} us of Unix time",
            recordings[0].first_us
        )?;
    }
    for (count, what) in [
        (outside_sensor, "events outside the sensor are left out"),
        (in_silence, "events in silences are left out"),
        (earlier, "events are earlier than one before them: some programs refuse such a file"),
        (lines_refused, "lines, words or connections were lost"),
    ] {
        if *count > 0 {
            writeln!(out, "{} {what}", grouped(*count))?;
        }
    }
    Ok(())
}
