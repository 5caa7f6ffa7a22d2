//! Messages of event cameras in ROS 2.

use meissner_engine::{Event, Sensor};
use meissner_io::{EventPackets, Format, IoError, LeftOutKind, encode};
use proptest::prelude::*;

const SENSOR: Sensor = Sensor { width: 640, height: 480 };

/// The words of a file of these events, without its header.
fn words(events: &[Event]) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(Format::Evt3, Some(SENSOR), events, &mut bytes).expect("events that EVT3 can hold");
    let end = b"% end\n";
    let header = bytes.windows(end.len()).position(|window| window == end).expect("a header") + end.len();
    bytes.split_off(header)
}

fn events() -> impl Strategy<Value = Vec<Event>> {
    prop::collection::vec((0..40_000_i64, 0..640_u16, 0..480_u16, any::<bool>()), 0..200).prop_map(|found| {
        let mut now = 0;
        let event = |(step, x, y, on)| {
            now += step;
            Event::new(now, x, y, on)
        };
        found.into_iter().map(event).collect()
    })
}

proptest! {
    #[test]
    fn evt3_in_messages_that_end_after_any_word_gives_the_events(events in events(), cuts in prop::collection::vec(0..600_usize, 0..6)) {
        let words = words(&events);
        let mut cuts: Vec<usize> = cuts.into_iter().map(|cut| (2 * cut).min(words.len())).collect();
        cuts.extend([0, words.len()]);
        cuts.sort_unstable();
        let mut packets = EventPackets::new("evt3", SENSOR).expect("a known encoding");
        let mut found = Vec::new();
        for ends in cuts.windows(2) {
            found.extend_from_slice(packets.decode(7, &words[ends[0]..ends[1]]).expect("whole words"));
        }
        prop_assert_eq!(found, events);
    }

    #[test]
    fn mono_gives_the_events_after_the_time_base(events in events(), base_us in 0..1_000_000_000_000_u64) {
        let event = |e: &Event| {
            let bits = u64::from(e.on) << 63 | u64::from(e.y) << 48 | u64::from(e.x) << 32;
            // Times within a message span 4 s.
            bits | (e.t_us as u64 % 4_000_000 * 1000)
        };
        let bytes: Vec<u8> = events.iter().flat_map(|e| event(e).to_le_bytes()).collect();
        let mut packets = EventPackets::new("mono", SENSOR).expect("a known encoding");
        let expected: Vec<Event> =
            events.iter().map(|e| Event::new(base_us as i64 + e.t_us % 4_000_000, e.x, e.y, e.on)).collect();
        prop_assert_eq!(packets.decode(base_us * 1000, &bytes).expect("on the sensor"), &expected[..]);
    }

    #[test]
    fn any_bytes_give_events_on_the_sensor_or_an_error(bytes in prop::collection::vec(any::<u8>(), 0..300), evt3: bool, base: u64) {
        let mut packets = EventPackets::new(if evt3 { "evt3" } else { "mono" }, SENSOR).expect("a known encoding");
        for _ in 0..2 {
            if let Ok(events) = packets.decode(base, &bytes) {
                prop_assert!(events.iter().all(|event| SENSOR.contains(event.x, event.y)));
            }
        }
    }
}

#[test]
fn what_cannot_be_decoded_is_refused_and_what_is_outside_is_left_out() {
    let error = EventPackets::new("trigger", SENSOR).expect_err("no events");
    assert!(error.to_string().contains("\"trigger\""), "{error}");
    let mut mono = EventPackets::new("mono", SENSOR).expect("a known encoding");
    assert!(matches!(mono.decode(0, &[0; 12]), Err(IoError::Truncated { .. })));
    let outside = (480_u64 << 48).to_le_bytes();
    assert!(mono.decode(0, &outside).expect("left out").is_empty());
    let left_out = mono.left_out();
    assert_eq!((left_out[0].kind, left_out[0].count), (LeftOutKind::OutsideSensor, 1));
    assert_eq!(mono.decode(0, &[0; 8]).expect("the corner"), [Event::new(0, 0, 0, false)]);
}
