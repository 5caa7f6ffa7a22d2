//! Writers of AEDAT 2.0 and 3.1 for the tests.

use meissner_engine::{Event, Sensor};

/// A file of AEDAT 2.0 with these lines after the first, and these pairs of address and time.
pub(crate) fn aedat2(lines: &[&str], records: &[[u32; 2]]) -> Vec<u8> {
    let mut bytes = b"#!AER-DAT2.0\r\n".to_vec();
    bytes.extend(lines.iter().flat_map(|line| format!("# {line}\r\n").into_bytes()));
    bytes.extend(records.iter().flatten().flat_map(|word| word.to_be_bytes()));
    bytes
}

/// The header's line that names a DAVIS346, and the last line.
pub(crate) const DAVIS346: [&str; 2] =
    ["AEChip: eu.seebetter.ini.chips.davis.Davis346B", "End of ASCII Header"];

/// The records of `events` of a DAVIS with this sensor.
pub(crate) fn davis_records(sensor: Sensor, events: &[Event]) -> Vec<[u32; 2]> {
    let address = |e: &Event| {
        let (x, y) = (sensor.width - 1 - e.x, sensor.height - 1 - e.y);
        u32::from(y) << 22 | u32::from(x) << 12 | u32::from(e.on) << 11
    };
    events.iter().map(|e| [address(e), e.t_us as u32]).collect()
}

/// The records of `events` of a DVS128.
pub(crate) fn dvs128_records(events: &[Event]) -> Vec<[u32; 2]> {
    let address = |e: &Event| u32::from(127 - e.y) << 8 | u32::from(127 - e.x) << 1 | u32::from(!e.on);
    events.iter().map(|e| [address(e), e.t_us as u32]).collect()
}

/// The header of AEDAT 3.1 with one source.
pub(crate) fn aedat3_header(source: u16, chip: &str) -> Vec<u8> {
    let start = "#Start-Time: 2017-03-21 14:12:03 (TZ+0100)";
    format!("#!AER-DAT3.1\r\n#Format: RAW\r\n#Source {source}: {chip}\r\n{start}\r\n#!END-HEADER\r\n")
        .into_bytes()
}

/// A packet of AEDAT 3.1: type, source, bytes of an event, overflows of the clock, and the events.
pub(crate) fn aedat3_packet(kind: i16, source: i16, size: i32, overflows: i32, content: &[u8]) -> Vec<u8> {
    let number = content.len() as i32 / size.max(1);
    let mut bytes = [kind.to_le_bytes(), source.to_le_bytes()].concat();
    for value in [size, 4, overflows, number, number, number] {
        bytes.extend(value.to_le_bytes());
    }
    bytes.extend(content);
    bytes
}

/// The content of a packet of `events`, all valid, within one period of the clock.
pub(crate) fn aedat3_events(events: &[Event]) -> Vec<u8> {
    let event = |e: &Event| {
        let data = u32::from(e.x) << 17 | u32::from(e.y) << 2 | u32::from(e.on) << 1 | 1;
        [data.to_le_bytes(), (e.t_us as u32 & 0x7fff_ffff).to_le_bytes()].concat()
    };
    events.iter().flat_map(event).collect()
}

/// A file of AEDAT 3.1 of a DAVIS346: a packet for every so many events, and where the clock passes its end.
pub(crate) fn aedat3(events: &[Event], most: usize) -> Vec<u8> {
    let mut bytes = aedat3_header(1, "DAVIS346");
    for period in events.chunk_by(|a, b| a.t_us >> 31 == b.t_us >> 31) {
        for packet in period.chunks(most) {
            let overflows = (packet[0].t_us >> 31) as i32;
            bytes.extend(aedat3_packet(1, 1, 8, overflows, &aedat3_events(packet)));
        }
    }
    bytes
}
