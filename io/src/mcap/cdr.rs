//! Messages of ROS 2 in CDR: a value lies at a multiple of its size, counted from the end of the
//! four bytes that give the byte order.

use crate::bytes::Bytes;
use crate::error::IoError;

/// Bytes before the values.
const START: usize = 4;

/// The values of a message, one after the other.
pub(super) struct Cdr<'a> {
    bytes: Bytes<'a>,
    at: usize,
    is_big: bool,
}

impl<'a> Cdr<'a> {
    /// The values of `message`.
    pub(super) fn new(message: Bytes<'a>) -> Result<Self, IoError> {
        let is_big = match message.get("start of a message", 0, START)? {
            [0, 0, ..] => true,
            [0, 1, ..] => false,
            other => {
                let found = format!("{:#04x}{:02x}", other[0], other[1]);
                return Err(message.malformed(
                    "representation of a message",
                    0,
                    "CDR (0x0000 or 0x0001)",
                    found,
                ));
            }
        };
        Ok(Self { bytes: message, at: START, is_big })
    }

    /// The bytes of the message.
    pub(super) fn bytes(&self) -> Bytes<'a> {
        self.bytes
    }

    /// The byte of the next value.
    pub(super) fn place(&self) -> usize {
        self.at
    }

    fn take<const N: usize>(&mut self) -> Result<[u8; N], IoError> {
        let at = (self.at - START).next_multiple_of(N) + START;
        let mut taken = self.bytes.array("value of a message", at)?;
        self.at = at + N;
        if self.is_big {
            taken.reverse();
        }
        Ok(taken)
    }

    pub(super) fn u8(&mut self) -> Result<u8, IoError> {
        self.take().map(u8::from_le_bytes)
    }

    pub(super) fn u16(&mut self) -> Result<u16, IoError> {
        self.take().map(u16::from_le_bytes)
    }

    pub(super) fn u32(&mut self) -> Result<u32, IoError> {
        self.take().map(u32::from_le_bytes)
    }

    pub(super) fn i32(&mut self) -> Result<i32, IoError> {
        self.take().map(i32::from_le_bytes)
    }

    pub(super) fn u64(&mut self) -> Result<u64, IoError> {
        self.take().map(u64::from_le_bytes)
    }

    /// A sequence of bytes.
    pub(super) fn sequence(&mut self, what: &'static str) -> Result<Bytes<'a>, IoError> {
        let length = self.u32()? as usize;
        let (start, data) = (self.at, self.bytes.get(what, self.at, length)?);
        self.at += length;
        Ok(Bytes { data, ..self.bytes.after(start) })
    }

    /// A text, without the zero at its end.
    pub(super) fn text(&mut self) -> Result<&'a [u8], IoError> {
        let text = self.sequence("text of a message")?.data;
        Ok(text.strip_suffix(b"\0").unwrap_or(text))
    }

    /// Skips a `std_msgs/msg/Header`.
    pub(super) fn header(&mut self) -> Result<(), IoError> {
        self.i32()?;
        self.u32()?;
        self.text().map(|_| ())
    }
}

/// An `event_camera_msgs/msg/EventPacket`.
pub(super) struct EventPacket<'a> {
    pub(super) width: u32,
    pub(super) height: u32,
    /// Its number: a gap is a loss.
    pub(super) seq: u64,
    /// Nanoseconds.
    pub(super) time_base: u64,
    pub(super) encoding: &'a [u8],
    pub(super) is_bigendian: bool,
    pub(super) events: Bytes<'a>,
}

impl<'a> EventPacket<'a> {
    pub(super) fn parse(message: Bytes<'a>) -> Result<Self, IoError> {
        let mut cdr = Cdr::new(message)?;
        cdr.header()?;
        let (height, width) = (cdr.u32()?, cdr.u32()?);
        let (seq, time_base) = (cdr.u64()?, cdr.u64()?);
        let encoding = cdr.text()?;
        let is_bigendian = cdr.u8()? != 0;
        let events = cdr.sequence("events of a packet")?;
        Ok(Self { width, height, seq, time_base, encoding, is_bigendian, events })
    }
}

/// Values that are written one after the other.
pub(super) struct Writer(Vec<u8>);

impl Writer {
    pub(super) fn new() -> Self {
        Self(vec![0, 1, 0, 0])
    }

    pub(super) fn put<const N: usize>(&mut self, value: [u8; N]) {
        self.0.resize((self.0.len() - START).next_multiple_of(N) + START, 0);
        self.0.extend(value);
    }

    pub(super) fn sequence(&mut self, bytes: &[u8]) {
        self.put((bytes.len() as u32).to_le_bytes());
        self.0.extend(bytes);
    }

    pub(super) fn text(&mut self, text: &str) {
        self.put((text.len() as u32 + 1).to_le_bytes());
        self.0.extend(text.as_bytes());
        self.0.push(0);
    }

    /// A `std_msgs/msg/Header` of this time in microseconds.
    pub(super) fn header(&mut self, t_us: u64) {
        // Its seconds overflow in 2038.
        let seconds = i32::try_from(t_us / 1_000_000).unwrap_or(i32::MAX);
        self.put(seconds.to_le_bytes());
        self.put(((t_us % 1_000_000) as u32 * 1000).to_le_bytes());
        self.text("");
    }

    pub(super) fn end(self) -> Vec<u8> {
        self.0
    }
}
