//! Raw bytes of sensors: cut anywhere, read from the middle, with lost bytes.

use std::io::{BufReader, Read};

use meissner_engine::{Event, Sensor};
use meissner_io::{Format, IoError, LiveEvents, ReadOptions, decode};
use proptest::prelude::*;

use meissner_io_tests::codecs::{evt2, evt2_words, evt3, evt21, evt21_words};

const SENSOR: Sensor = Sensor { width: 1280, height: 720 };

/// Gives a given number of bytes at each read.
struct Pieces<'a> {
    bytes: &'a [u8],
    lengths: Box<dyn Iterator<Item = usize> + 'a>,
}

impl Read for Pieces<'_> {
    fn read(&mut self, to: &mut [u8]) -> std::io::Result<usize> {
        let length = self.lengths.next().unwrap_or(1).min(self.bytes.len()).min(to.len());
        let (now, later) = self.bytes.split_at(length);
        to[..length].copy_from_slice(now);
        self.bytes = later;
        Ok(length)
    }
}

/// The output of a raw stream: events, losses with their numbers of omitted events, and other odd
/// words.
#[derive(Debug, Default, PartialEq)]
struct Given {
    events: Vec<Event>,
    losses: Vec<u64>,
    odd: usize,
}

fn given(bytes: &[u8], format: Format, lengths: &[usize]) -> Given {
    let pieces = Pieces { bytes, lengths: Box::new(lengths.iter().copied().cycle()) };
    let input = BufReader::with_capacity(1 << 16, pieces);
    let mut given = Given::default();
    for item in LiveEvents::raw(input, format, ReadOptions::default().sensor(SENSOR)).expect("a raw format") {
        match item {
            Ok(event) => given.events.push(event),
            Err(IoError::Lost { events, .. }) => given.losses.push(events),
            Err(IoError::Word { .. }) => given.odd += 1,
            Err(error) => panic!("{error}"),
        }
    }
    given
}

/// A scene of `count` events: a moving edge of some rows, and pixels anywhere.
fn scene(count: usize, seed: u64) -> Vec<Event> {
    let mut state = seed | 1;
    let mut random = move |most: u64| {
        state ^= state << 13;
        state ^= state >> 7;
        state ^= state << 17;
        state % most
    };
    let (mut t_us, mut events) = (1_000_000, Vec::with_capacity(count));
    while events.len() < count {
        t_us += random(40) as i64;
        let (x, y, on) = (t_us as u64 / 500 % 1200, random(720), random(2) == 1);
        let (x, y) = if random(4) == 0 { (random(1280), random(720)) } else { (x, 300 + y / 20) };
        for i in 0..=random(6) {
            if x + i < 1280 {
                events.push(Event::new(t_us, (x + i) as u16, y as u16, on));
            }
        }
    }
    events
}

/// The words of EVT3 as a sensor sends them: both words of time every 16 us, vectors, and a row
/// when it changes.
fn sensor_words(events: &[Event]) -> Vec<u16> {
    let (mut words, mut y) = (Vec::new(), None);
    let mut now = events.first().map_or(0, |event| event.t_us);
    let mut rest = events;
    while let Some(&first) = rest.first() {
        while now < first.t_us {
            now = first.t_us.min((now / 16 + 1) * 16);
            words.extend([0x8000 | (now >> 12) as u16 & 0xfff, 0x6000 | now as u16 & 0xfff]);
        }
        if words.is_empty() {
            words.extend([0x8000 | (now >> 12) as u16 & 0xfff, 0x6000 | now as u16 & 0xfff]);
        }
        if y.replace(first.y) != Some(first.y) {
            words.push(first.y);
        }
        let is_same = |event: &&Event| (event.t_us, event.y, event.on) == (first.t_us, first.y, first.on);
        let run = rest.iter().zip(first.x..).take_while(|(e, x)| is_same(e) && e.x == *x).take(12).count();
        if run > 1 {
            words.extend([0x3000 | u16::from(first.on) << 11 | first.x, 0x4000 | ((1 << run) - 1)]);
        } else {
            words.push(0x2000 | u16::from(first.on) << 11 | first.x);
        }
        rest = &rest[run.max(1)..];
    }
    words
}

/// The scene as the bytes of each format, with a header or without.
fn streams(events: &[Event], header: bool) -> Vec<(Format, Vec<u8>)> {
    let with = |text: &'static str| if header { text } else { "" };
    let legacy = with("% evt 2.1\n% endianness legacy\n% geometry 1280x720\n% end\n");
    let little = with("% format EVT21;height=720;width=1280;endianness=little\n% end\n");
    vec![
        (Format::Evt3, evt3(with("% evt 3.0\n% geometry 1280x720\n% end\n"), &sensor_words(events))),
        (Format::Evt2, evt2(with("% evt 2.0\n% geometry 1280x720\n% end\n"), &evt2_words(events))),
        (Format::Evt21, evt21(legacy, &evt21_words(events), true)),
        (Format::Evt21, evt21(little, &evt21_words(events), false)),
    ]
}

/// Whether `part` is `all` with events left out.
fn is_part(part: &[Event], all: &[Event]) -> bool {
    let mut all = all.iter();
    part.iter().all(|event| all.any(|other| other == event))
}

#[test]
fn sensor_words_are_those_of_their_events() {
    let events = scene(5_000, 3);
    let bytes = evt3("% evt 3.0\n% end\n", &sensor_words(&events));
    assert_eq!(decode(&bytes).expect("EVT3").events, events);
}

/// One byte in 10,000 is lost: each loss is counted, and every event was really sent.
fn check_losses(seed: u64) -> Result<(), TestCaseError> {
    let events = scene(60_000, seed);
    for (format, mut bytes) in streams(&events, false) {
        // One byte in 10,000, anywhere in it except near its ends.
        let lost: Vec<usize> = (0..bytes.len() / 10_000)
            .map(|i| 10_000 * i + 2_000 + (seed.rotate_left(i as u32) % 6_000) as usize)
            .collect();
        for &at in lost.iter().rev() {
            bytes.remove(at);
        }
        let found = given(&bytes, format, &[1_400]);
        prop_assert!(is_part(&found.events, &events), "{}: an event that is none", format);
        prop_assert_eq!(found.losses.len(), lost.len(), "{}", format);
        let told: u64 = found.losses.iter().sum();
        let missing = events.len() - found.events.len();
        prop_assert!(missing <= lost.len() * 600, "{}: {} missing, {} told", format, missing, told);
    }
    Ok(())
}

/// Two words that were out of step looked like advancing time, one of them after an odd word.
#[test]
fn time_behind_an_odd_word_vouches_for_nothing_before_it() {
    check_losses(8_885_792_680_622_177_987).expect("no event that is none");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(200))]

    #[test]
    fn a_stream_gives_the_events_of_the_file_however_it_is_cut(
        seed: u64, count in 0usize..3_000, header: bool, lengths in prop::collection::vec(1usize..2_000, 1..20),
    ) {
        let events = scene(count, seed);
        for (format, bytes) in streams(&events, header) {
            let found = given(&bytes, format, &lengths);
            prop_assert_eq!((found.losses.len(), found.odd), (0, 0), "{}", format);
            prop_assert!(found.events == events, "{}: {} of {}", format, found.events.len(), events.len());
        }
    }

    #[test]
    fn a_stream_that_is_joined_in_the_middle_gives_the_events_from_there(seed: u64, share in 0.0f64..0.9) {
        let events = scene(6_000, seed);
        for (format, bytes) in streams(&events, false) {
            // At the start of a word, like a driver, and in EVT3 at any byte.
            let step = if format == Format::Evt3 { 1 } else { 8 };
            let at = (bytes.len() as f64 * share) as usize / step * step;
            let found = given(&bytes[at..], format, &[1_400]);
            prop_assert!(is_part(&found.events, &events), "{} from byte {}", format, at);
            let least = (events.len() as f64 * (1.0 - share) * 0.8) as usize;
            prop_assert!(found.events.len() >= least.saturating_sub(400), "{}: {}", format, found.events.len());
        }
    }
}

proptest! {
    // Each case loses a byte about 30 times in each format.
    #![proptest_config(ProptestConfig::with_cases(50))]

    #[test]
    fn every_lost_byte_is_counted_and_no_event_after_it_is_wrong(seed: u64) {
        check_losses(seed)?;
    }
}

proptest! {
    #[test]
    fn of_any_bytes_pieces_change_nothing_not_even_an_order(
        runs in prop::collection::vec((any::<u8>(), prop::collection::vec(any::<u8>(), 0..40), 1..40_usize), 1..60),
    ) {
        // Noise, and runs of a repeated word or of a text.
        let bytes: Vec<u8> = runs.into_iter().flat_map(|(kind, noise, count)| match kind % 3 {
            0 => noise,
            1 => noise.iter().copied().take(2).collect::<Vec<_>>().repeat(8 * count),
            _ => noise.iter().map(|byte| byte & 0x3f | 0x20).collect::<Vec<_>>().repeat(count),
        }).collect();
        for format in [Format::Evt2, Format::Evt21, Format::Evt3] {
            let items = |capacity| -> Vec<Result<Event, String>> {
                let input = BufReader::with_capacity(capacity, &bytes[..]);
                let items = LiveEvents::raw(input, format, ReadOptions::default().sensor(SENSOR));
                items.expect("a raw format").map(|item| item.map_err(|error| error.to_string())).collect()
            };
            let whole = items(1 << 16);
            prop_assert_eq!(&items(1), &whole, "{}", format);
            prop_assert_eq!(&items(1_400), &whole, "{}", format);
        }
    }
}

#[test]
fn padding_and_single_odd_words_are_left_out_alone() {
    let events = scene(400, 5);
    let mut words = sensor_words(&events);
    words.splice(200..200, [0x9999; 9]);
    words.splice(500..500, [0xb123]);
    let found = given(&evt3("", &words), Format::Evt3, &[64]);
    assert_eq!((found.events, found.losses.len()), (events, 0));
    assert!(found.odd >= 2, "{}", found.odd);
}

/// Endless odd words do not hold events forever, even if the time stands still.
#[test]
fn events_come_although_padding_never_ends() {
    let mut words = vec![0x8001, 0x6002, 0x0003];
    (0..4_000u16).for_each(|i| words.push(if i % 40 == 0 { 0x9999 } else { 0x2000 | (i % 640) }));
    let bytes = evt3("", &words);
    let read = std::cell::Cell::new(0);
    let lengths = std::iter::repeat_with(|| read.replace(read.get() + 100)).map(|_| 100);
    let pieces = Pieces { bytes: &bytes, lengths: Box::new(lengths) };
    let items = LiveEvents::raw(
        BufReader::with_capacity(100, pieces),
        Format::Evt3,
        ReadOptions::default().sensor(SENSOR),
    );
    let first = items.expect("a raw format").find(Result::is_ok);
    assert!(first.is_some() && read.get() < bytes.len() / 2, "{} of {} bytes", read.get(), bytes.len());
}

#[test]
fn other_formats_are_no_raw_streams() {
    let refused = LiveEvents::raw(&b""[..], Format::Csv, ReadOptions::default()).expect_err("a text");
    assert!(refused.to_string().contains("expected AEDAT4, EVT2, EVT2.1 or EVT3"), "{refused}");
}
