//! AEDAT4 as it arrives: a stream of `dv-processing` over a socket, or a file through a pipe.
//!
//! A network stream has the bytes of a file that was not closed, without its magic number: the
//! header, then packets. Source: the output of `dv-processing` 2.0.4.

use std::collections::VecDeque;
use std::io::{BufRead, Read};

use meissner_engine::{Event, Sensor};

use super::header::{Header, MAGIC};
use super::packet::PREFIX;
use super::{Container, PACKET_HEADER, SIZE};
use crate::bytes::Bytes;
use crate::error::{IoError, Place};
use crate::format::Format;
use crate::limits::PACKET_BYTES;
use crate::options::ReadOptions;
use crate::recording::StreamKind;

const NAME: &str = Format::Aedat4.name();

/// Events of packets as they arrive.
///
/// A packet with odd events gives an [`IoError::Datagram`] for the first odd event, and its other
/// events.
#[derive(Debug)]
pub(crate) struct PacketEvents<R> {
    input: R,
    options: ReadOptions,
    /// `None` before the header.
    container: Option<Container>,
    /// The sensors of the streams of events.
    sensors: Vec<Option<Sensor>>,
    /// The position of the next byte.
    at: u64,
    /// Number of packets so far.
    number: u64,
    ready: VecDeque<Result<Event, IoError>>,
    ended: bool,
}

impl<R: BufRead> PacketEvents<R> {
    /// The events of `input`. Nothing is read before the first call of `next`.
    pub(crate) fn new(input: R, options: ReadOptions) -> Self {
        let options = options.strict(false);
        let (container, sensors, ready) = (None, Vec::new(), VecDeque::new());
        Self { input, options, container, sensors, at: 0, number: 0, ready, ended: false }
    }

    /// The sensor that the header names, after the header was read.
    pub(crate) fn sensor(&self) -> Option<Sensor> {
        *self.sensors.get(self.options.stream_number() - 1)?
    }

    /// The next `length` bytes, or fewer at the end.
    fn read(&mut self, length: u64) -> Result<Vec<u8>, IoError> {
        let mut bytes = Vec::new();
        let read = self.input.by_ref().take(length).read_to_end(&mut bytes);
        let (format, action, place) = (NAME, "read", Place::Byte(self.at));
        read.map_err(|source| IoError::Stream { format, action, place, source })?;
        self.at += bytes.len() as u64;
        Ok(bytes)
    }

    /// Reads the header, with or without the magic number before it.
    fn begin(&mut self) -> Result<Container, IoError> {
        let mut bytes = self.read(PREFIX as u64)?;
        let mut start = 0;
        if bytes == MAGIC[..PREFIX] {
            start = MAGIC.len();
            bytes.extend(self.read(start as u64)?);
            Bytes::file(NAME, &bytes).magic(MAGIC)?;
        }
        let size = Header::size(Bytes::file(NAME, &bytes), start)?;
        bytes.extend(self.read(size)?);
        // The length of the file is not known.
        let mut header = Header::after_magic(Bytes::file(NAME, &bytes), start, u64::MAX, false)?;
        for stream in &mut header.streams {
            // The engine counts events outside the sensor.
            let sensor = stream.sensor.take();
            if stream.summary.kind == StreamKind::Events {
                self.sensors.push(sensor);
            }
        }
        Container::new(header, 0, self.options)
    }

    /// Reads a packet, if the stream has not ended.
    fn advance(&mut self, container: &mut Container) -> Result<(), IoError> {
        let place = Place::Byte(self.at);
        let mut bytes = if container.header.table.is_some_and(|table| self.at >= table as u64) {
            Vec::new()
        } else {
            self.read(PACKET_HEADER as u64)?
        };
        if bytes.is_empty() {
            self.ended = true;
            return container.end();
        }
        let header = Bytes { format: NAME, data: &bytes, origin: place };
        let size = header.i32("header of a packet", 4)?;
        let size = u64::try_from(size).map_err(|_| header.malformed(SIZE, 4, "0 and above", size))?;
        if size > PACKET_BYTES {
            return Err(header.too_large("packet", 4, PACKET_BYTES, size, false));
        }
        bytes.extend(self.read(size)?);
        self.number += 1;
        let packet = Bytes { format: NAME, data: &bytes, origin: place };
        let recording = container.read(packet, false)?;
        if !recording.left_out.is_empty() {
            let mut strict = Container { strict: true, ..container.clone() };
            if let Err(source) = strict.read(packet, false) {
                self.ready
                    .push_back(Err(IoError::Datagram { number: self.number, source: Box::new(source) }));
            }
        }
        self.ready.extend(recording.events.into_iter().map(Ok));
        Ok(())
    }
}

impl<R: BufRead> Iterator for PacketEvents<R> {
    type Item = Result<Event, IoError>;

    fn next(&mut self) -> Option<Self::Item> {
        loop {
            if let Some(ready) = self.ready.pop_front() {
                return Some(ready);
            }
            if self.ended {
                return None;
            }
            let read = match self.container.take() {
                None => self.begin().map(|container| self.container = Some(container)),
                Some(mut container) => {
                    let read = self.advance(&mut container);
                    self.container = Some(container);
                    read
                }
            };
            if let Err(error) = read {
                self.ended = true;
                return Some(Err(error));
            }
        }
    }
}
