//! MCAP, the container of ROS 2 and Foxglove: the events of a topic, from and to bytes.
//!
//! ```text
//! \x89MCAP0\r\n    then records: opcode (u8), length (u64), content
//! header           profile, library
//! schema, channel  the name of a message's type; a topic with its schema and encoding
//! message          channel, time (ns), content
//! chunk            records, compressed together (LZ4 or Zstandard frame, or neither)
//! data end         CRC-32 of all before it; then a summary, the footer and the first bytes again
//! ```
//!
//! | type of a message, in CDR | read as |
//! |---|---|
//! | `event_camera_msgs/msg/EventPacket` | events ([`EventPackets`](crate::EventPackets)) |
//! | `dvs_msgs`, `prophesee_event_msgs`: `msg/EventArray` | events: x, y, time, polarity of each |
//! | images, see `images` | pictures ([`ImageSequence`](crate::ImageSequence)) |
//!
//! The writer writes a topic `/events` of packets in `mono`, which contains every event exactly and
//! has no state. The summary is not read, because a killed recorder leaves none. Source: the
//! specification at <https://mcap.dev/spec>, the definitions of the messages, and that of CDR (OMG
//! DDS-RTPS).
//!
//! Invariants: an unpacked chunk has at most [`PACKET_BYTES`](crate::limits::PACKET_BYTES), and a
//! file has at most as many events as [`limits`](crate::limits) allows. A chunk or data section
//! with a wrong checksum is refused, and so is a file without its end, unless it is salvaged.

pub(crate) mod cdr;
pub(crate) mod images;
pub(crate) mod records;
mod streams;
pub(crate) mod write;

use crate::bytes::Bytes;
use crate::error::IoError;
use crate::format::Format;
use crate::options::ReadOptions;
use crate::recording::Recording;
use records::Container;
use streams::Streams;

/// The events of the file `bytes`; with `salvage`, those of the complete records.
pub(crate) fn decode(bytes: &[u8], options: ReadOptions) -> Result<Recording, IoError> {
    let file = Bytes::file(Format::Mcap.name(), bytes);
    let mut streams = Streams::new(options, bytes.len());
    let mut container = Container::default();
    let salvaged =
        container.walk(file, options.salvage, &mut |container, message| streams.take(container, &message))?;
    Ok(Recording { salvaged, ..streams.recording()? })
}
