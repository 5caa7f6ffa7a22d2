//! The header of an AEDAT4 file: its compression, the streams it declares, and the position of the packets.

use meissner_engine::Sensor;
use roxmltree::{Document, Node, ParsingOptions};

use super::packet::{Compression, Table};
use crate::bytes::Bytes;
use crate::error::{IoError, Place, beginning, shown};
use crate::format::Format;
use crate::limits::HEADER_BYTES;
use crate::recording::StreamKind;

/// First bytes of a file.
pub(crate) const MAGIC: &[u8] = b"#!AER-DAT4.0\r\n";

/// The content of a file's header.
pub(super) struct Header {
    pub(super) compression: Compression,
    pub(super) streams: Vec<Stream>,
    /// Byte of the file at which the first packet starts.
    pub(super) packets: usize,
    /// Byte of the file at which the packet table starts, if there is one.
    pub(super) table: Option<usize>,
    /// Whether the file ends before the place of its packet table.
    pub(super) is_cut: bool,
}

impl Header {
    /// Reads the magic number and the header at the start of `file`; with `salvage`, the file may end before its packet table.
    pub(super) fn parse(file: Bytes<'_>, salvage: bool) -> Result<Self, IoError> {
        let (format, what, start) = (file.format, "header", MAGIC.len());
        let magic = file.get("magic", 0, start)?;
        if magic != MAGIC {
            return Err(file.malformed("magic", 0, shown(MAGIC), shown(magic)));
        }
        let size = file.u32("size of the header", start)?;
        if u64::from(size) > HEADER_BYTES {
            let (place, limit, actual) = (file.place(start), HEADER_BYTES, u64::from(size));
            return Err(IoError::TooLarge { format, what, place, limit, actual, at_least: false });
        }
        let length = 4 + size as usize;
        let content = Bytes::new(format, file.get(what, start, length)?, file.place(start));
        let root = Table::root(content, what, *b"IOHE")?;
        let compression = match root.i32(0, 0)? {
            0 => Compression::None,
            1 | 2 => Compression::Lz4,
            3 | 4 => Compression::Zstd,
            other => return Err(file.malformed("compression", start, "0 to 4", other.to_string())),
        };
        let packets = start + length;
        let (table, is_cut) = match root.i64(1, -1)? {
            -1 => (None, false),
            at => match Self::table(file, packets, at) {
                Err(IoError::Truncated { .. }) if salvage => (None, true),
                table => (Some(table?), false),
            },
        };
        let (xml_at, xml) = root.vector(2, 1)?;
        let streams = parse_streams(format, xml, content.place(xml_at))?;
        Ok(Self { compression, streams, packets, table, is_cut })
    }

    /// The position of the packet table, which the recorder writes last: a file that ends before it is cut short.
    fn table(file: Bytes<'_>, packets: usize, at: i64) -> Result<usize, IoError> {
        let position = u64::try_from(at).ok().filter(|&at| at >= packets as u64);
        let Some(position) = position else {
            let expected = format!("-1, or {packets} and above");
            return Err(file.malformed(
                "position of the packet table",
                MAGIC.len(),
                expected,
                at.to_string(),
            ));
        };
        if position > file.len() as u64 {
            return Err(IoError::Truncated {
                format: file.format,
                what: "the recording before its packet table",
                place: Place::Byte(0),
                expected: position,
                actual: file.len() as u64,
            });
        }
        Ok(position as usize)
    }
}

/// Most nodes of the XML; a stream takes about thirty.
const NODES: u32 = 1 << 16;

/// A stream that the header declares.
pub(super) struct Stream {
    pub(super) id: i32,
    pub(super) name: String,
    pub(super) kind: StreamKind,
    pub(super) sensor: Option<Sensor>,
}

/// The streams that the XML at `place` of the file declares, in its order.
///
/// `<dv><node name="outInfo"><node name="ID"><attr key="typeIdentifier">EVTS</attr>..<node name="info"><attr
/// key="sizeX">346</attr>..`: a node for each stream, named by the number in the headers of its packets.
fn parse_streams(format: Format, xml: &[u8], place: Place) -> Result<Vec<Stream>, IoError> {
    let malformed =
        |what, expected: &str, actual: String| IoError::malformed(format, what, place, expected, actual);
    let text =
        std::str::from_utf8(xml).map_err(|e| malformed("XML of the streams", "UTF-8", e.to_string()))?;
    // The parser copies and compares all name spaces for each element: 64 KiB of them take a minute.
    if text.contains("xmlns") {
        return Err(malformed("XML of the streams", "no name spaces", "`xmlns`".to_owned()));
    }
    let options = ParsingOptions { nodes_limit: NODES, ..ParsingOptions::default() };
    let document = Document::parse_with_options(text, options)
        .map_err(|e| malformed("XML of the streams", "well-formed XML", beginning(&e.to_string(), 200)))?;
    let Some(root) = document.descendants().find(|node| is_node(*node, "outInfo")) else {
        return Err(malformed("XML of the streams", "a node outInfo", "none".to_owned()));
    };

    let mut streams: Vec<Stream> = Vec::new();
    for node in root.children().filter(|node| node.has_tag_name("node")) {
        let id = node.attribute("name").unwrap_or_default();
        let id = id
            .parse()
            .map_err(|_| malformed("number of a stream", "an integer of 32 bits", shown(id.as_bytes())))?;
        if streams.iter().any(|stream| stream.id == id) {
            return Err(malformed("number of a stream", "a number once", format!("{id} twice")));
        }
        let Some(identifier) = attr(node, "typeIdentifier") else {
            return Err(malformed(
                "type of a stream",
                "an attr typeIdentifier",
                format!("none in stream {id}"),
            ));
        };
        let kind = match identifier {
            "EVTS" => StreamKind::Events,
            "FRME" => StreamKind::Frames,
            "IMUS" => StreamKind::Imu,
            "TRIG" => StreamKind::Triggers,
            _ => StreamKind::Other,
        };
        let side = |key| {
            let text = node.children().find(|n| is_node(*n, "info")).and_then(|info| attr(info, key));
            text.map(|text| match text.parse() {
                // Coordinates are i16.
                Ok(side) if (1..=1 << 15).contains(&side) => Ok(side),
                _ => Err(malformed("size of a sensor", "1 to 32768 pixels", shown(text.as_bytes()))),
            })
            .transpose()
        };
        let sensor = side("sizeX")?.zip(side("sizeY")?).map(|(width, height)| Sensor { width, height });
        let name = attr(node, "originalOutputName").unwrap_or(identifier).to_owned();
        streams.push(Stream { id, name, kind, sensor });
    }
    Ok(streams)
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
