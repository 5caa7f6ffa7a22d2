//! The records of MCAP: chunks unpacked, and each message with its topic.

use std::collections::BTreeMap;

use crate::aedat4::packet::{Compression, Inflater};
use crate::bytes::Bytes;
use crate::error::{IoError, Place};
use crate::format::beginning;
use crate::recording::{Salvage, StreamKind};

/// First and last bytes of a file.
pub(crate) const MAGIC: &[u8] = b"\x89MCAP0\r\n";
/// Bytes before the content of a record: opcode and length.
pub(crate) const RECORD_HEADER: usize = 9;
/// Longest name of a topic or a type that is kept, in characters.
const NAME: usize = 200;

/// Opcodes.
pub(crate) mod op {
    pub(crate) const HEADER: u8 = 0x01;
    pub(crate) const FOOTER: u8 = 0x02;
    pub(crate) const SCHEMA: u8 = 0x03;
    pub(crate) const CHANNEL: u8 = 0x04;
    pub(crate) const MESSAGE: u8 = 0x05;
    pub(crate) const CHUNK: u8 = 0x06;
    pub(crate) const MESSAGE_INDEX: u8 = 0x07;
    pub(crate) const CHUNK_INDEX: u8 = 0x08;
    pub(crate) const STATISTICS: u8 = 0x0b;
    pub(crate) const DATA_END: u8 = 0x0f;
}

/// Content of the messages of a topic.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Content {
    /// `event_camera_msgs/msg/EventPacket`.
    Packet,
    /// `dvs_msgs/msg/EventArray` and its like.
    EventArray,
    /// A picture.
    Image(Picture),
    /// Samples of an inertial measurement unit.
    Imu,
    /// Anything else.
    Other,
}

/// The form of a picture's message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) struct Picture {
    /// Whether it holds the file of an image instead of pixels.
    pub(crate) is_file: bool,
    /// Encoding of its fields.
    pub(crate) encoding: Encoding,
}

/// Encoding of the fields of a message.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Encoding {
    /// CDR, as in ROS 2.
    Cdr,
    Json,
    Protobuf,
}

impl Content {
    /// Content of messages of the type `schema` in `encoding`.
    fn of(schema: &str, encoding: &str) -> Self {
        let encoding = match encoding {
            "cdr" => Some(Encoding::Cdr),
            "json" => Some(Encoding::Json),
            "protobuf" => Some(Encoding::Protobuf),
            _ => None,
        };
        let picture =
            |is_file| encoding.map_or(Self::Other, |e| Self::Image(Picture { is_file, encoding: e }));
        let is_cdr = encoding == Some(Encoding::Cdr);
        // ROS 1 has no part between package and name.
        match &*schema.replace("/msg/", "/") {
            "event_camera_msgs/EventPacket" if is_cdr => Self::Packet,
            "dvs_msgs/EventArray" | "prophesee_event_msgs/EventArray" if is_cdr => Self::EventArray,
            "sensor_msgs/Image" if is_cdr => picture(false),
            "sensor_msgs/CompressedImage" if is_cdr => picture(true),
            "foxglove.RawImage" if !is_cdr => picture(false),
            "foxglove.CompressedImage" if !is_cdr => picture(true),
            "sensor_msgs/Imu" => Self::Imu,
            _ => Self::Other,
        }
    }

    /// The kind of a stream of such messages.
    pub(super) fn kind(self) -> StreamKind {
        match self {
            Self::Packet | Self::EventArray => StreamKind::Events,
            Self::Image(_) => StreamKind::Frames,
            Self::Imu => StreamKind::Imu,
            Self::Other => StreamKind::Other,
        }
    }
}

/// Name of a topic, and content of its messages.
pub(crate) type Topic = (String, Content);

/// A message.
pub(crate) struct Message<'a> {
    /// Index of its topic.
    pub(crate) topic: usize,
    pub(crate) data: Bytes<'a>,
}

/// A record.
pub(crate) struct Record<'a> {
    pub(crate) op: u8,
    pub(crate) content: Bytes<'a>,
}

impl<'a> Record<'a> {
    /// The record at byte `at`.
    pub(crate) fn at(bytes: Bytes<'a>, at: usize) -> Result<Self, IoError> {
        let header = bytes.get("record before the end of the data", at, RECORD_HEADER)?;
        let length = u64::from_le_bytes(crate::bytes::array(&header[1..]));
        // No slice can be longer.
        let length = usize::try_from(length).unwrap_or(usize::MAX);
        let start = at + RECORD_HEADER;
        let data = bytes.get("record", start, length)?;
        Ok(Self { op: header[0], content: Bytes { data, ..bytes.after(start) } })
    }

    /// Bytes of the record.
    pub(crate) fn len(&self) -> usize {
        RECORD_HEADER + self.content.len()
    }
}

/// The fields of a record, one after the other.
pub(super) struct Fields<'a> {
    bytes: Bytes<'a>,
    at: usize,
}

impl<'a> Fields<'a> {
    pub(super) fn new(bytes: Bytes<'a>) -> Self {
        Self { bytes, at: 0 }
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], IoError> {
        let taken = self.bytes.array("field of a record", self.at)?;
        self.at += N;
        Ok(taken)
    }

    fn u16(&mut self) -> Result<u16, IoError> {
        self.take().map(u16::from_le_bytes)
    }

    fn u32(&mut self) -> Result<u32, IoError> {
        self.take().map(u32::from_le_bytes)
    }

    fn u64(&mut self) -> Result<u64, IoError> {
        self.take().map(u64::from_le_bytes)
    }

    /// The beginning of a text that is kept.
    fn text(&mut self) -> Result<String, IoError> {
        let length = self.u32()? as usize;
        let text = self.bytes.get("text of a record", self.at, length)?;
        self.at += length;
        // A character has at most four bytes.
        Ok(beginning(&String::from_utf8_lossy(&text[..text.len().min(4 * NAME + 4)]), NAME))
    }

    fn rest(&self) -> Bytes<'a> {
        self.bytes.after(self.at)
    }
}

/// A chunk with its packed records.
pub(crate) struct Chunk<'a> {
    size: u64,
    crc: u32,
    compression: String,
    packed: Bytes<'a>,
    /// Bytes that the records should have.
    length: u64,
}

impl<'a> Chunk<'a> {
    /// The chunk of this content, which may be cut.
    pub(crate) fn parse(content: Bytes<'a>) -> Result<Self, IoError> {
        let mut fields = Fields::new(content);
        // Skips its first and last times.
        fields.take::<16>()?;
        let (size, crc, compression) = (fields.u64()?, fields.u32()?, fields.text()?);
        let length = fields.u64()?;
        Ok(Self { size, crc, compression, packed: fields.rest(), length })
    }

    /// The records, unpacked and checked.
    pub(crate) fn unpack<'b>(&'b self, inflater: &'b mut Inflater<'_>) -> Result<Bytes<'b>, IoError>
    where
        'a: 'b,
    {
        let length = usize::try_from(self.length).unwrap_or(usize::MAX);
        let packed = Bytes { data: self.packed.get("records of a chunk", 0, length)?, ..self.packed };
        let records = match &*self.compression {
            "" => packed,
            // Some writers name the compression of a chunk without records.
            _ if packed.data.is_empty() => packed,
            name @ ("lz4" | "zstd") => {
                inflater.compression = if name == "lz4" { Compression::Lz4 } else { Compression::Zstd };
                let at = if let Place::Byte(at) = packed.origin { at as usize } else { 0 };
                packed.packet(0, inflater.inflate(packed.data, at)?)
            }
            other => {
                let expected = "MCAP with chunks in lz4, in zstd or not compressed";
                return Err(IoError::Unsupported { expected, actual: format!("{other:?}") });
            }
        };
        if records.len() as u64 != self.size {
            let expected = format!("{} bytes", self.size);
            return Err(packed.malformed("unpacked chunk", 0, expected, records.len()));
        }
        check_crc(packed, "chunk", self.crc, records.data)?;
        Ok(records)
    }
}

/// Refuses `data` with another checksum than `stored`; 0: none was stored.
fn check_crc(at: Bytes<'_>, what: &'static str, stored: u32, data: &[u8]) -> Result<(), IoError> {
    let found = if stored == 0 { 0 } else { crc32fast::hash(data) };
    if found == stored {
        return Ok(());
    }
    Err(at.malformed(what, 0, format!("the stored CRC-32 {stored:#010x}"), format!("{found:#010x}")))
}

/// Topics that the records so far have declared.
#[derive(Clone, Debug, Default)]
pub(crate) struct Container {
    schemas: BTreeMap<u16, String>,
    /// The topic of each channel.
    channels: BTreeMap<u16, usize>,
    topics: Vec<Topic>,
    /// The index of each topic.
    places: BTreeMap<Topic, usize>,
}

/// Takes the messages of a file.
pub(crate) type See<'s> = dyn FnMut(&Container, Message<'_>) -> Result<(), IoError> + 's;

impl Container {
    pub(crate) fn topic(&self, index: usize) -> &Topic {
        &self.topics[index]
    }

    /// Shows every message of `file` to `see`. With `salvage`, the messages before the cut, if it
    /// is cut.
    ///
    /// # Errors
    /// The errors of the file, and of `see`.
    pub(crate) fn walk(
        &mut self,
        file: Bytes<'_>,
        salvage: bool,
        see: &mut See<'_>,
    ) -> Result<Option<Salvage>, IoError> {
        file.magic(MAGIC)?;
        let mut inflater = Inflater::new(Compression::None, file);
        let (mut at, mut has_ended) = (MAGIC.len(), false);
        loop {
            let record = match Record::at(file, at) {
                Ok(record) => record,
                Err(_) if salvage && has_ended => return Ok(Some(file.salvage("the summary", at))),
                Err(_) if salvage => return self.cut(file, at, see).map(Some),
                Err(error) => return Err(error),
            };
            match record.op {
                // The summary repeats earlier records.
                op if has_ended && op != op::FOOTER => {}
                op::FOOTER => break,
                op::CHUNK => {
                    let chunk = Chunk::parse(record.content)?;
                    self.records(chunk.unpack(&mut inflater)?, see)?;
                }
                op::DATA_END => {
                    let crc = Fields::new(record.content).u32()?;
                    check_crc(record.content, "data section", crc, &file.data[..at])?;
                    has_ended = true;
                }
                _ => self.take(&record, see)?,
            }
            at += record.len();
        }
        let end = at + Record::at(file, at)?.len();
        match file.after(end).magic(MAGIC) {
            Err(_) if salvage => Ok(Some(file.salvage("the end of the file", end))),
            checked => checked.map(|()| None),
        }
    }

    /// Takes the records of an unpacked chunk.
    pub(super) fn records(&mut self, records: Bytes<'_>, see: &mut See<'_>) -> Result<(), IoError> {
        let mut at = 0;
        while at < records.len() {
            let record = Record::at(records, at)?;
            self.take(&record, see)?;
            at += record.len();
        }
        Ok(())
    }

    /// Takes the complete records of a cut chunk that is not compressed; returns the omitted part.
    fn cut(&mut self, file: Bytes<'_>, at: usize, see: &mut See<'_>) -> Result<Salvage, IoError> {
        let rest = file.after(at);
        let mut salvaged = file.salvage("the last record", at);
        if rest.data.first() == Some(&op::CHUNK)
            && rest.len() > RECORD_HEADER
            && let Ok(chunk) = Chunk::parse(rest.after(RECORD_HEADER))
            && chunk.compression.is_empty()
        {
            let mut at = 0;
            while let Ok(record) = Record::at(chunk.packed, at) {
                self.take(&record, see)?;
                at += record.len();
            }
            salvaged = chunk.packed.salvage("the last record", at);
        }
        Ok(salvaged)
    }

    /// Takes a record that is not a chunk.
    pub(super) fn take(&mut self, record: &Record<'_>, see: &mut See<'_>) -> Result<(), IoError> {
        let mut fields = Fields::new(record.content);
        match record.op {
            op::SCHEMA => {
                self.schemas.insert(fields.u16()?, fields.text()?);
            }
            op::CHANNEL => {
                let (channel, schema) = (fields.u16()?, fields.u16()?);
                let (name, encoding) = (fields.text()?, fields.text()?);
                let content = match self.schemas.get(&schema) {
                    Some(schema) => Content::of(schema, &encoding),
                    None => Content::Other,
                };
                let topic = (name, content);
                let place = self.places.get(&topic).copied().unwrap_or(self.topics.len());
                if place == self.topics.len() {
                    self.topics.push(topic.clone());
                    self.places.insert(topic, place);
                }
                self.channels.insert(channel, place);
            }
            op::MESSAGE => {
                let channel = fields.u16()?;
                // Skips its number, and the times when it was logged and published.
                fields.take::<20>()?;
                let Some(&topic) = self.channels.get(&channel) else {
                    let expected = "one that a record before it declares";
                    return Err(record.content.malformed("channel of a message", 0, expected, channel));
                };
                see(self, Message { topic, data: fields.rest() })?;
            }
            _ => {}
        }
        Ok(())
    }
}
