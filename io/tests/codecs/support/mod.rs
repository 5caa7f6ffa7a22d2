//! Bytes of every format, made here, and the strategies that the properties draw from.

pub(crate) mod aedat;
pub(crate) mod aedat4;

use std::io::{self, Read};

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, IoError, ReadOptions, Recording, decode_with, encode};
use proptest::prelude::*;

/// What a strict reader makes of `bytes`: nothing odd is left out.
pub(crate) fn strictly(bytes: &[u8]) -> Result<Recording, IoError> {
    decode_with(bytes, ReadOptions::default().strict(true))
}

/// A recording that every format but N-MNIST can hold, with all of its values told apart.
pub(crate) fn events() -> Vec<Event> {
    (0..40_u16).map(|i| Event::new(1000 + i64::from(i) * 700, i * 3, 200 - i * 5, i % 3 == 0)).collect()
}

/// The sensor of [`events`].
pub(crate) const SENSOR: Sensor = Sensor { width: 346, height: 260 };

/// The file that the encoder of `format` makes.
pub(crate) fn encoded(format: Format, sensor: Option<Sensor>, events: &[Event]) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(format, sensor, events, &mut bytes).expect("events that the format holds");
    bytes
}

/// A file of EVT2 with this header and these words.
pub(crate) fn evt2(header: &str, words: &[u32]) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    bytes
}

/// The words of `events`, each with a time word before it where one is due.
pub(crate) fn evt2_words(events: &[Event]) -> Vec<u32> {
    let mut words = Vec::new();
    let mut high = None;
    for event in events {
        let new = (event.t_us >> 6) as u32 & 0x0fff_ffff;
        if high != Some(new) {
            words.push(0x8000_0000 | new);
            high = Some(new);
        }
        let low = (event.t_us as u32 & 0x3f) << 22;
        words.push(u32::from(event.on) << 28 | low | u32::from(event.x) << 11 | u32::from(event.y));
    }
    words
}

/// A file of EVT3 with this header and these words.
pub(crate) fn evt3(header: &str, words: &[u16]) -> Vec<u8> {
    let mut bytes = header.as_bytes().to_vec();
    bytes.extend(words.iter().flat_map(|word| word.to_le_bytes()));
    bytes
}

/// The bytes of `events`, on 34 x 34 pixels and before 2^23 microseconds.
pub(crate) fn nmnist(events: &[Event]) -> Vec<u8> {
    let bytes = events.iter().flat_map(|e| {
        let [_, high, middle, low] = (e.t_us as u32).to_be_bytes();
        [e.x as u8, e.y as u8, high | u8::from(e.on) << 7, middle, low]
    });
    bytes.collect()
}

/// A small valid file of every format, and of every compression of AEDAT4.
pub(crate) fn samples() -> Vec<(Format, Vec<u8>)> {
    let all = events();
    let on_34: Vec<_> = all.iter().map(|e| Event { x: e.x % 34, y: e.y % 34, ..*e }).collect();
    let mut samples = vec![
        (Format::Evt2, evt2("% evt 2.0\n% geometry 346x260\n% end\n", &evt2_words(&all))),
        (Format::Nmnist, nmnist(&on_34)),
    ];
    for format in [Format::Evt3, Format::Dat, Format::Csv, Format::Npy] {
        samples.push((format, encoded(format, Some(SENSOR), &all)));
    }
    for compression in aedat4::Compression::ALL {
        samples.push((Format::Aedat4, aedat4::sample(compression)));
    }
    samples.push((Format::Es, encoded(Format::Es, Some(SENSOR), &all)));
    samples.push((Format::Aedat2, aedat::aedat2(&aedat::DAVIS346, &aedat::davis_records(SENSOR, &all))));
    samples.push((Format::Aedat3, aedat::aedat3(&all, 15)));
    samples
}

/// A text without a line feed that fails where more than `left` bytes of it are read.
pub(crate) struct Endless {
    pub(crate) left: u64,
}

impl Read for Endless {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        assert!(self.left >= buffer.len() as u64, "more is read than a line may have");
        self.left -= buffer.len() as u64;
        buffer.fill(b'1');
        Ok(buffer.len())
    }
}

/// Any event with a time of `times`, on `side` x `side` pixels.
pub(crate) fn any_event(times: impl Strategy<Value = i64>, side: u16) -> impl Strategy<Value = Event> {
    (times, 0..side, 0..side, any::<bool>()).prop_map(|(t, x, y, on)| Event::new(t, x, y, on))
}

/// Events in order of time from 0 to `most`, bursts and long silences both.
pub(crate) fn sorted_events(most: i64, side: u16) -> impl Strategy<Value = Vec<Event>> {
    let times = prop_oneof![0..=most, 0..=most.min(20_000)];
    prop::collection::vec(any_event(times, side), 0..60).prop_map(|mut events| {
        events.sort_by_key(|e| e.t_us);
        events
    })
}
