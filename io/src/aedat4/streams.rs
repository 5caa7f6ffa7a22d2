//! The header's XML in, the declared streams out.
//!
//! `<dv><node name="outInfo"><node name="ID"><attr key="typeIdentifier">EVTS</attr>..<node name="info"><attr
//! key="sizeX">346</attr>..`: a node for each stream, its name the number that the packets carry.

use meissner_engine::Sensor;
use roxmltree::{Document, Node, ParsingOptions};

use crate::csv::shown;
use crate::error::{IoError, Place, beginning};
use crate::format::Format;
use crate::recording::StreamKind;

/// Nodes that the XML may have; a stream takes about thirty.
const NODES: u32 = 1 << 16;

/// A stream that the header declares.
pub(super) struct Stream {
    pub(super) id: i32,
    pub(super) name: String,
    pub(super) kind: StreamKind,
    pub(super) sensor: Option<Sensor>,
}

/// The streams that `xml`, at `place` of the file, declares, in its order.
pub(super) fn parse(format: Format, xml: &[u8], place: Place) -> Result<Vec<Stream>, IoError> {
    let malformed = |what, expected: &str, actual: String| IoError::Malformed {
        format,
        what,
        place,
        expected: expected.to_owned(),
        actual,
    };
    let text =
        std::str::from_utf8(xml).map_err(|e| malformed("XML of the streams", "UTF-8", e.to_string()))?;
    // Each element would copy and compare all that are declared around it: 64 KiB of them take a minute.
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
