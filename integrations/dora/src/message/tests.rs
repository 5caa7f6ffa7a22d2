use dora_node_api::{DoraArray, Parameter};
use meissner::{Event, Sensor};

use super::{
    Counter, EventsHeader, Loss, MessageError, PredictionHeader, counters_array, events_array, loss_array,
    metadata, read_counters, read_events, read_losses, read_values, values_array,
};

#[test]
fn what_was_written_is_read_back_with_every_bit() {
    let events = [Event::new(i64::MIN, 0, u16::MAX, true), Event::new(7, 3, 4, false)];
    let mut read = Vec::new();
    read_events(&DoraArray::from(events_array(&events)), &mut read).unwrap();
    assert_eq!(read, events);
    read_events(&DoraArray::from(events_array(&[])), &mut read).unwrap();
    assert_eq!(read.len(), 2);

    let values = [f32::MIN_POSITIVE / 2.0, -0.0, 1.0 + f32::EPSILON];
    let read = read_values(&DoraArray::from(values_array(&values))).unwrap();
    assert_eq!(read.map_bits(), values.to_vec().map_bits());

    let loss = Loss { from: 3, until: u64::MAX, reason: "link".to_owned() };
    assert_eq!(read_losses(&DoraArray::from(loss_array(&loss))).unwrap(), [loss]);
    let counters =
        [Counter::new("a", "predictions", 4), Counter::with_reason("b", "events_dropped", "queue", 5)];
    assert_eq!(read_counters(&DoraArray::from(counters_array(&counters))).unwrap(), counters);

    let header = PredictionHeader {
        sensor: "finger".to_owned(),
        stream: 5,
        boot: 6,
        number: 7,
        order: 8,
        next: 9,
        accepted: 8,
        t_us: None,
        nodes: 3,
        fresh: true,
        events_sent_ns: 1,
        events_received_ns: 2,
        sent_ns: 3,
    };
    let mut entries = header.metadata();
    entries.extend(metadata(
        [("boot", 6), ("number", 7), ("sent_ns", 3)].map(|(k, v)| (k, Parameter::Integer(v))),
    ));
    assert_eq!(PredictionHeader::read(&entries), Ok(header));
}

trait MapBits {
    fn map_bits(self) -> Vec<u32>;
}

impl MapBits for Vec<f32> {
    fn map_bits(self) -> Vec<u32> {
        self.into_iter().map(f32::to_bits).collect()
    }
}

#[test]
fn what_is_no_message_of_events_is_refused_with_what_was_expected() {
    let mut entries = metadata(
        [("boot", 1), ("number", 2), ("first", 3), ("sent_ns", 4), ("width", 5)]
            .map(|(key, value)| (key, Parameter::Integer(value))),
    );
    let refused = EventsHeader::read(&entries).unwrap_err().to_string();
    assert_eq!(refused, "metadata `height`: expected an integer, got nothing");
    for (height, fits) in [(0, false), (-1, false), (65_536, false), (65_535, true)] {
        entries.insert("height".to_owned(), Parameter::Integer(height));
        let read = EventsHeader::read(&entries);
        assert_eq!(read.is_ok(), fits, "{read:?}");
    }
    assert_eq!(EventsHeader::read(&entries).unwrap().sensor, Sensor::new(5, 65_535));

    let floats = DoraArray::from(values_array(&[1.0]));
    let mut events = Vec::new();
    assert!(matches!(read_events(&floats, &mut events), Err(MessageError::Array { .. })));
    let counters = DoraArray::from(counters_array(&[]));
    assert!(matches!(read_events(&counters, &mut events), Err(MessageError::Array { .. })));
    assert!(matches!(read_values(&counters), Err(MessageError::Array { .. })));
}
