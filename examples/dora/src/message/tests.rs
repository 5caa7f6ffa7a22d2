use dora_node_api::{DoraArray, Parameter};
use meissner::{Event, Sensor};
use meissner_packets::{Gap, Reason};

use super::{
    Counter, EventsHeader, MessageError, PredictionHeader, Stamp, events_array, metadata, read, read_events,
    read_texts, read_values, texts_array, values_array,
};

#[test]
fn what_was_written_is_read_back_with_every_bit() {
    let events = [Event::new(i64::MIN, 0, u16::MAX, true), Event::new(7, 3, 4, false)];
    let mut found = Vec::new();
    read_events(&DoraArray::from(events_array(&events)), &mut found).unwrap();
    assert_eq!(found, events);
    read_events(&DoraArray::from(events_array(&[])), &mut found).unwrap();
    assert_eq!(found.len(), 2);

    let values = [f32::MIN_POSITIVE / 2.0, -0.0, 1.0 + f32::EPSILON];
    let found = read_values(&DoraArray::from(values_array(&values))).unwrap();
    assert_eq!(found.map_bits(), values.to_vec().map_bits());

    let gap = Gap { from: 3, until: u64::MAX, packets: 2, reason: Reason::Link };
    assert_eq!(read_texts::<Gap>(&DoraArray::from(texts_array(&[gap]))).unwrap(), [gap]);
    let counters =
        [Counter::new("a", "predictions", 4), Counter::with_reason("b", "events_dropped", "queue", 5)];
    assert_eq!(read_texts::<Counter>(&DoraArray::from(texts_array(&counters))).unwrap(), counters);

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
    let mut entries = metadata(&header);
    entries.extend(metadata(&Stamp { boot: 6, number: 7, sent_ns: 3 }));
    assert_eq!(read::<PredictionHeader>(&entries).unwrap(), header);
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
    let mut entries: dora_node_api::MetadataParameters =
        [("first", 3), ("width", 5)].map(|(key, value)| (key.to_owned(), Parameter::Integer(value))).into();
    let refused = read::<EventsHeader>(&entries).unwrap_err().to_string();
    assert_eq!(refused, "metadata: missing field `height`");
    for (height, fits) in [(0, false), (-1, false), (65_536, false), (65_535, true)] {
        entries.insert("height".to_owned(), Parameter::Integer(height));
        let header = read::<EventsHeader>(&entries);
        assert_eq!(header.is_ok(), fits, "{header:?}");
    }
    assert_eq!(read::<EventsHeader>(&entries).unwrap().sensor(), Sensor::new(5, 65_535));

    let floats = DoraArray::from(values_array(&[1.0]));
    let mut events = Vec::new();
    assert!(matches!(read_events(&floats, &mut events), Err(MessageError::Array { .. })));
    let counters = DoraArray::from(texts_array::<Counter>(&[]));
    assert!(matches!(read_events(&counters, &mut events), Err(MessageError::Array { .. })));
    assert!(matches!(read_values(&counters), Err(MessageError::Array { .. })));
}
