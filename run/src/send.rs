//! Sends a recording to another program, each event at its due time, like a sensor.
//!
//! Input: events, and the name of a stream ([`crate::streams`]). Output: lines of text, records or
//! packets of AEDAT4 ([`meissner_io::LiveEvents`]). An event whose time steps back is sent with the
//! one before.

use std::io::{self, Write};
use std::path::Path;
use std::time::{Duration, Instant};

use meissner_engine::{Event, Sensor};
use meissner_io::{Aedat4Writer, Format, RECORD_BYTES, record};
use serde::Serialize;

use crate::clock::Clock;
use crate::error::{Result, RunError};
use crate::streams::{self, Receiver};
use crate::{interrupt, latency};

/// Maximum bytes of a datagram: a network transmits this size in one piece.
const DATAGRAM: usize = 1400;
/// Shortest wait: events are sent in small batches, as by a camera.
const NAP: Duration = Duration::from_micros(100);
/// The same for packets, each of which has its own header.
const PACKET_NAP: Duration = Duration::from_millis(1);
/// Number of events that are sent between two checks for signals.
const BATCH: usize = 1 << 13;

/// Options for sending events.
#[derive(Clone, Copy, Debug)]
pub struct SendOptions {
    /// Seconds of stream time per second.
    pub speed: f64,
    /// Whether events are sent as records instead of lines of text. A stream of packets has
    /// neither.
    pub records: bool,
}

/// Summary of the sent events.
#[derive(Clone, Copy, Debug, Serialize)]
#[expect(missing_docs, reason = "the keys of the JSON report")]
pub struct SendSummary {
    pub events: u64,
    pub bytes: u64,
    /// Longest time from the due time of an event until it was sent, in microseconds.
    pub lag_us: f64,
    /// Seconds from the first event to the end.
    pub seconds: f64,
}

/// Sends `events` of `sensor` to the stream `to`. Ends early if the program is asked to end.
///
/// # Errors
/// The stream cannot be opened, or has no reader any more; packets need a sensor.
pub fn send(
    events: &[Event],
    sensor: Option<Sensor>,
    to: &Path,
    options: SendOptions,
) -> Result<SendSummary> {
    let failed = |source| {
        if streams::is_stdin(to) {
            RunError::Output(source)
        } else {
            RunError::file("write", streams::name(to), source)
        }
    };
    let mut out = if streams::is_of_packets(to) {
        let name = streams::name(to);
        let unknown = || RunError::NoGeometry { recording: name, format: Format::Aedat4.to_string() };
        let sensor = sensor.ok_or_else(unknown)?;
        // A receiver of packets takes bytes.
        let Receiver::Bytes(out) = streams::receiver(to)? else { unreachable!("of packets") };
        Sender::Packets(Aedat4Writer::stream(out, sensor).map_err(failed)?)
    } else {
        let mut pieces = Pieces::new(streams::receiver(to)?);
        if let (Some(sensor), false) = (sensor, options.records) {
            pieces.put(format_args!("# sensor {sensor}\n")).map_err(failed)?;
        }
        Sender::Pieces { pieces, records: options.records }
    };
    interrupt::listen();
    let started = Instant::now();
    let clock = Clock::new(started, events.first().map_or(0, |event| event.t_us), options.speed);
    let (mut rest, mut lag, mut number) = (events, Duration::ZERO, 0);
    while !rest.is_empty() && !interrupt::requested() {
        let now = Instant::now();
        let now_us = clock.stream_us(now);
        let due = rest.iter().take_while(|event| event.t_us <= now_us).count();
        let (sent, later) = rest.split_at(due);
        rest = later;
        // After a slow receiver, many events are due.
        for some in sent.chunks(BATCH).take_while(|_| !interrupt::requested()) {
            out.put(some).map_err(failed)?;
            number += some.len() as u64;
        }
        out.flush().map_err(failed)?;
        if let Some(event) = sent.first() {
            lag = lag.max(now.saturating_duration_since(clock.at(event.t_us)));
        }
        let next = rest.first().map_or(now, |event| clock.at(event.t_us));
        interrupt::sleep(next.saturating_duration_since(Instant::now()).max(out.nap()));
    }
    let bytes = out.end().map_err(failed)?;
    let (lag_us, seconds) = (latency::microseconds(lag), started.elapsed().as_secs_f64());
    Ok(SendSummary { events: number, bytes, lag_us, seconds })
}

/// The form in which events are sent.
enum Sender {
    /// Lines or records.
    Pieces { pieces: Pieces, records: bool },
    /// Packets of AEDAT4.
    Packets(Aedat4Writer<Box<dyn Write>>),
}

impl Sender {
    /// Shortest wait.
    fn nap(&self) -> Duration {
        match self {
            Self::Pieces { .. } => NAP,
            Self::Packets(_) => PACKET_NAP,
        }
    }

    fn put(&mut self, events: &[Event]) -> io::Result<()> {
        match self {
            Self::Packets(packets) => packets.write(events),
            Self::Pieces { pieces, records } => events.iter().try_for_each(|&event| {
                let Event { t_us, x, y, on } = event;
                if *records {
                    pieces.put_bytes(&record(event))
                } else {
                    pieces.put(format_args!("{t_us},{x},{y},{}\n", u8::from(on)))
                }
            }),
        }
    }

    fn flush(&mut self) -> io::Result<()> {
        match self {
            Self::Packets(_) => Ok(()),
            Self::Pieces { pieces, .. } => pieces.flush(),
        }
    }

    /// Sends the remaining bytes and the end; returns the total number of bytes.
    fn end(self) -> io::Result<u64> {
        match self {
            Self::Packets(packets) => Ok(packets.length()),
            Self::Pieces { pieces, .. } => pieces.end(),
        }
    }
}

/// Bytes to send, in pieces that end with a line or a record.
struct Pieces {
    receiver: Receiver,
    piece: Vec<u8>,
    sent: u64,
}

impl Pieces {
    fn new(receiver: Receiver) -> Self {
        Self { receiver, piece: Vec::with_capacity(DATAGRAM + RECORD_BYTES), sent: 0 }
    }

    fn put_bytes(&mut self, bytes: &[u8]) -> io::Result<()> {
        if self.piece.len() + bytes.len() > DATAGRAM {
            self.flush()?;
        }
        self.piece.extend_from_slice(bytes);
        Ok(())
    }

    fn put(&mut self, line: std::fmt::Arguments<'_>) -> io::Result<()> {
        self.put_bytes(line.to_string().as_bytes())
    }

    /// Sends the added bytes.
    fn flush(&mut self) -> io::Result<()> {
        if self.piece.is_empty() {
            return Ok(());
        }
        match &mut self.receiver {
            Receiver::Bytes(out) => out.write_all(&self.piece).and_then(|()| out.flush())?,
            Receiver::Datagrams(socket) => drop(socket.send(&self.piece)?),
        }
        self.sent += self.piece.len() as u64;
        self.piece.clear();
        Ok(())
    }

    /// Sends the remaining bytes and the end; returns the total number of bytes.
    fn end(mut self) -> io::Result<u64> {
        self.flush()?;
        if let Receiver::Datagrams(socket) = &self.receiver {
            socket.send(&[])?;
        }
        Ok(self.sent)
    }
}
