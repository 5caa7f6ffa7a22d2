//! The header of an AEDAT4 file: its compression, streams, and the position of the packets.

use meissner_engine::Sensor;
use roxmltree::{Document, Node, ParsingOptions};

use super::packet::{Compression, Table};
use crate::bytes::Bytes;
use crate::error::{IoError, shown};
use crate::format::beginning;
use crate::limits::HEADER_BYTES;
use crate::recording::{StreamKind, StreamSummary};

/// First bytes of a file.
pub(crate) const MAGIC: &[u8] = b"#!AER-DAT4.0\r\n";

/// The incomplete part if a file ends before its packet table.
const BEFORE_TABLE: &str = "the recording before its packet table";

/// The content of a file's header.
#[derive(Clone, Debug)]
pub(super) struct Header {
    pub(super) compression: Compression,
    pub(super) streams: Vec<Stream>,
    /// Byte of the file at which the first packet starts.
    pub(super) packets: usize,
    /// Byte of the file at which the packet table starts, if there is one.
    pub(super) table: Option<usize>,
    /// Whether the file ends before the position of its packet table.
    pub(super) is_cut: bool,
    /// Whether its buffer has no name; the buffer of the packet table then has none either.
    pub(super) is_unnamed: bool,
}

impl Header {
    /// Reads the magic number and the header at the start of `file`, which has `length` bytes; with
    /// `salvage`, the file may end before its packet table.
    pub(super) fn parse(file: Bytes<'_>, length: u64, salvage: bool) -> Result<Self, IoError> {
        file.magic(MAGIC)?;
        Self::after_magic(file, MAGIC.len(), length, salvage)
    }

    /// The number of bytes of the header at `start` after its size field.
    pub(super) fn size(file: Bytes<'_>, start: usize) -> Result<u64, IoError> {
        let size = u64::from(file.u32("size of the header", start)?);
        if size > HEADER_BYTES {
            return Err(file.too_large("header", start, HEADER_BYTES, size, false));
        }
        Ok(size)
    }

    /// Reads the header at `start`.
    pub(super) fn after_magic(
        file: Bytes<'_>,
        start: usize,
        length: u64,
        salvage: bool,
    ) -> Result<Self, IoError> {
        let what = "header";
        let packets = start + 4 + Self::size(file, start)? as usize;
        let data = file.get(what, start, packets - start)?;
        let content = Bytes { data, origin: file.place(start), ..file };
        match Table::root(content, what, *b"IOHE") {
            Ok(root) => Self::of_table(file, (root, content), length, packets, salvage),
            Err(error) => {
                // Some writers omit the name. A buffer that can be read is a header.
                let unnamed = Table::of_any_name(content, what)
                    .and_then(|root| Self::of_table(file, (root, content), length, packets, salvage));
                match unnamed {
                    Ok(header) => Ok(Self { is_unnamed: true, ..header }),
                    Err(cut @ IoError::Truncated { what: BEFORE_TABLE, .. }) => Err(cut),
                    Err(_) => Err(error),
                }
            }
        }
    }

    /// Reads the `root` table of the header's `content`. The packets start after it.
    fn of_table(
        file: Bytes<'_>,
        (root, content): (Table<'_>, Bytes<'_>),
        length: u64,
        packets: usize,
        salvage: bool,
    ) -> Result<Self, IoError> {
        let start = MAGIC.len();
        let compression = match root.field(0)?.map_or(0, i32::from_le_bytes) {
            0 => Compression::None,
            1 | 2 => Compression::Lz4,
            3 | 4 => Compression::Zstd,
            other => return Err(file.malformed("compression", start, "0 to 4", other)),
        };
        let (table, is_cut) = match root.field(1)?.map_or(-1, i64::from_le_bytes) {
            -1 => (None, false),
            at => match Self::table(file, length, packets, at) {
                Err(IoError::Truncated { .. }) if salvage => (None, true),
                table => (Some(table?), false),
            },
        };
        let (xml_at, xml) = root.vector(2, 1)?;
        let streams = parse_streams(Bytes { data: xml, origin: content.place(xml_at), ..file })?;
        Ok(Self { compression, streams, packets, table, is_cut, is_unnamed: false })
    }

    /// The position of the packet table, which is written last: a file that ends before it is cut.
    fn table(file: Bytes<'_>, length: u64, packets: usize, at: i64) -> Result<usize, IoError> {
        match u64::try_from(at) {
            Ok(position) if position > length => Err(file.truncated(BEFORE_TABLE, 0, position, false)),
            Ok(position) if position >= packets as u64 => Ok(position as usize),
            _ => {
                let expected = format!("-1, or {packets} and above");
                Err(file.malformed("position of the packet table", MAGIC.len(), expected, at))
            }
        }
    }
}

/// Maximum number of nodes of the XML; a stream needs about thirty.
const NODES: u32 = 1 << 16;

/// A stream that the header declares.
#[derive(Clone, Debug)]
pub(super) struct Stream {
    pub(super) id: i32,
    pub(super) sensor: Option<Sensor>,
    /// Its name and kind; nothing is counted yet.
    pub(super) summary: StreamSummary,
}

/// The streams that the XML declares, in its order; empty if it has no list of streams.
///
/// `<dv><node name="outInfo"><node name="ID"><attr key="typeIdentifier">EVTS</attr>..<node
/// name="info"><attr key="sizeX">346</attr>..`: a node for each stream, named by the number in the
/// headers of its packets.
fn parse_streams(xml: Bytes<'_>) -> Result<Vec<Stream>, IoError> {
    let what = "XML of the streams";
    let malformed = |what, expected, actual: String| xml.malformed(what, 0, expected, actual);
    if xml.data.trim_ascii().is_empty() {
        return Ok(Vec::new());
    }
    let text = str::from_utf8(xml.data).map_err(|e| malformed(what, "UTF-8", e.to_string()))?;
    // The parser compares all name spaces for each element: 64 KiB take a minute.
    if text.contains("xmlns") {
        return Err(malformed(what, "no name spaces", "`xmlns`".to_owned()));
    }
    let options = ParsingOptions { nodes_limit: NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options)
        .map_err(|e| malformed(what, "well-formed XML", beginning(&e.to_string(), 200)))?;
    let root = document.descendants().find(|node| is_node(*node, "outInfo"));
    if root.is_none() && !document.root_element().has_tag_name("dv") {
        return Err(malformed(what, "a node outInfo", "none".to_owned()));
    }

    let mut streams: Vec<Stream> = Vec::new();
    for node in root.iter().flat_map(Node::children).filter(|node| node.has_tag_name("node")) {
        let id = node.attribute("name").unwrap_or_default();
        let no_number = |_| malformed("number of a stream", "an integer of 32 bits", shown(id.as_bytes()));
        let id = id.parse().map_err(no_number)?;
        if streams.iter().any(|stream| stream.id == id) {
            return Err(malformed("number of a stream", "a number once", format!("{id} twice")));
        }
        let identifier = attr(node, "typeIdentifier").ok_or_else(|| {
            malformed("type of a stream", "an attr typeIdentifier", format!("none in stream {id}"))
        })?;
        let kind = kind_of(identifier.as_bytes());
        let info = node.children().find(|child| is_node(*child, "info"));
        let side = |key| match info.and_then(|info| attr(info, key)).map(|text| (text, text.parse())) {
            None => Ok(None),
            // Coordinates are i16.
            Some((_, Ok(side))) if (1..=1 << 15).contains(&side) => Ok(Some(side)),
            Some((text, _)) => {
                Err(malformed("size of a sensor", "1 to 32768 pixels", shown(text.as_bytes())))
            }
        };
        let sensor = side("sizeX")?.zip(side("sizeY")?).map(|(width, height)| Sensor { width, height });
        let name = attr(node, "originalOutputName").unwrap_or(identifier);
        streams.push(Stream { id, sensor, summary: StreamSummary::new(name, kind) });
    }
    Ok(streams)
}

/// The kind of a stream whose packets have this name.
pub(super) fn kind_of(name: &[u8]) -> StreamKind {
    match name {
        b"EVTS" => StreamKind::Events,
        b"FRME" => StreamKind::Frames,
        b"IMUS" => StreamKind::Imu,
        b"TRIG" => StreamKind::Triggers,
        _ => StreamKind::Other,
    }
}

fn is_node(node: Node<'_, '_>, name: &str) -> bool {
    node.has_tag_name("node") && node.attribute("name") == Some(name)
}

/// The text of the child `<attr key="KEY">`.
fn attr<'a>(node: Node<'a, '_>, key: &str) -> Option<&'a str> {
    let found =
        node.children().find(|child| child.has_tag_name("attr") && child.attribute("key") == Some(key));
    found?.text().map(str::trim)
}
