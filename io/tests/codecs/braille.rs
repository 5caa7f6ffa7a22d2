//! Presses on letters of braille: arrays in a `NumPy` archive.

use std::fs;

use meissner_engine::Event;
use meissner_io::datasets::{Contact, EventDataset, EventRecording, Split};
use proptest::prelude::*;

use crate::packed::zip;
use crate::shared_files::shared;
use meissner_io_tests::codecs::chain;

const CLASSES: [&str; 3] = ["space", "A", "B"];

/// Name, type, shape and values of each array.
#[derive(Clone, Debug)]
struct Made(Vec<(&'static str, &'static str, String, Vec<i64>)>);

/// A reading: time, taxel and value.
type Reading = (i64, i64, i64);

/// A press with contact at 1 s, 2.5 N at 1.1 s and the lift at 1.2 s: letter, number, test.
type Press<'a> = (&'a [Reading], [i64; 3]);

impl Made {
    fn new(presses: &[Press<'_>]) -> Self {
        let readings: Vec<Reading> = presses.iter().flat_map(|press| press.0).copied().collect();
        let mut start = vec![0];
        start.extend(presses.iter().scan(0, |end, press| {
            *end += press.0.len() as i64;
            Some(*end)
        }));
        let of = |part: usize| presses.iter().map(|press| press.1[part]).collect::<Vec<_>>();
        let list = |name, descr, values: Vec<i64>| (name, descr, format!("({},)", values.len()), values);
        let place = (0..81)
            .flat_map(|taxel| if taxel == 0 { [-1, -1] } else { [(taxel - 1) % 10, (taxel - 1) / 10] });
        let stamps = presses.iter().flat_map(|_| [1_000_000, 1_100_000, 1_200_000]).collect();
        Self(vec![
            list("t_us", "<i8", readings.iter().map(|reading| reading.0).collect()),
            list("taxel", "|u1", readings.iter().map(|reading| reading.1).collect()),
            list("adc", "<u2", readings.iter().map(|reading| reading.2).collect()),
            list("start", "<i8", start),
            list("letter", "|u1", of(0)),
            list("number", "|u1", of(1)),
            ("stamps_us", "<i8", format!("({}, 3)", presses.len()), stamps),
            list("test", "|b1", of(2)),
            ("place", "<i2", "(81, 2)".to_owned(), place.collect()),
            list("letters", "<U1", " AB".chars().map(|letter| i64::from(u32::from(letter))).collect()),
        ])
    }

    /// The same with a different array of this name.
    fn with(&self, name: &str, change: impl Fn(&mut (&'static str, &'static str, String, Vec<i64>))) -> Self {
        let mut other = self.clone();
        change(other.0.iter_mut().find(|array| array.0 == name).unwrap());
        other
    }

    /// The same with a different value at `i` of this array.
    fn value(&self, name: &str, i: usize, value: i64) -> Self {
        self.with(name, |array| array.3[i] = value)
    }

    fn files(&self) -> Vec<(String, Vec<u8>)> {
        let file = |(name, descr, shape, values): &(&str, &str, String, Vec<i64>)| {
            let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
            let width = if descr.ends_with("U1") { 4 } else { descr[2..].parse::<usize>().unwrap() };
            let content = values.iter().flat_map(|value| value.to_le_bytes()[..width].to_vec());
            let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
            bytes.extend((header.len() as u16).to_le_bytes());
            bytes.extend(header.as_bytes().iter().copied().chain(content));
            (format!("{name}.npy"), bytes)
        };
        self.0.iter().map(file).collect()
    }

    fn archive(&self) -> Vec<u8> {
        archive(&self.files())
    }

    fn read(&self) -> Result<Vec<EventRecording>, String> {
        read(&self.archive())
    }

    fn refusal(&self) -> String {
        self.read().unwrap_err()
    }
}

fn archive(files: &[(String, Vec<u8>)]) -> Vec<u8> {
    zip(files.iter().map(|(name, content)| (name.as_str(), content)))
}

fn read(archive: &[u8]) -> Result<Vec<EventRecording>, String> {
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("letters.npz"), archive).unwrap();
    let found = EventDataset::letters(folder.path(), &CLASSES);
    found.map(|set| set.recordings).map_err(|error| chain(&error))
}

/// Two presses; the first belongs to the training.
fn two() -> Made {
    let readings = [(1_000_000, 1, 1000), (1_000_100, 80, 1020), (1_015_700, 1, 900)];
    Made::new(&[(&readings, [1, 7, 0]), (&readings[..1], [0, 3, 1])])
}

#[test]
fn a_reading_that_changes_is_an_event_at_its_taxel_and_readings_of_a_batch_are_spread() {
    let readings = [
        // Before the part that is read: it only gives the former value of the taxel.
        (700_000, 2, 600),
        (1_000_000, 2, 700),
        (1_000_150, 11, 1023),
        (1_000_300, 11, 1023),
        (1_000_450, 80, 0),
        // 10 ms after the previous batch, into which it does not reach back.
        (1_010_000, 80, 1024),
        (1_010_100, 80, 1023),
        // After the part that is read.
        (1_500_000, 80, 3),
    ];
    let found = Made::new(&[(&readings, [2, 4, 1])]).read().unwrap().remove(0);
    // The halves of the skin, columns 0 to 4 and 5 to 9, are swapped in the archive.
    let expected = [
        Event::new(1_000_000 - 15_700 + 3_925, 6, 0, false),
        Event::new(1_000_000 - 15_700 + 7_850, 5, 1, true),
        Event::new(1_000_000, 4, 7, true),
        Event::new(1_005_000, 4, 7, false),
        Event::new(1_010_000, 4, 7, true),
    ];
    assert_eq!(found.events, expected);
    let contact = Contact { begin_us: 1_000_000, held_us: 1_100_000, lifted_us: 1_200_000 };
    assert_eq!((found.contact, found.begin_us()), (Some(contact), 1_000_000));
    assert_eq!((found.name.as_str(), found.class, found.split), ("test/B/4", 2, Split::Test));
}

#[test]
fn readings_whose_times_step_back_are_put_in_order() {
    let ordered = [(1_000_000, 1, 900), (1_000_000, 1, 800), (1_020_000, 1, 700), (1_040_000, 1, 600)];
    let mixed = [ordered[3], ordered[0], ordered[1], ordered[2]];
    assert_eq!(Made::new(&[(&mixed, [1, 0, 0])]).read(), Made::new(&[(&ordered, [1, 0, 0])]).read());
}

#[test]
fn presses_come_by_split_class_and_number_and_one_that_was_not_felt_stays() {
    let one = [(1_000_000, 1, 1000)];
    let presses: [Press<'_>; 4] =
        [(&one, [0, 10, 1]), (&one, [2, 10, 0]), (&[], [2, 9, 0]), (&one, [1, 10, 0])];
    let found = Made::new(&presses).read().unwrap();
    let names: Vec<_> = found.iter().map(|press| (press.name.as_str(), press.events.len())).collect();
    assert_eq!(names, [("train/A/10", 1), ("train/B/9", 0), ("train/B/10", 1), ("test/space/10", 1)]);
    assert_eq!(found[1].begin_us(), 1_000_000);
}

#[test]
fn integers_of_any_width_and_order_and_another_order_of_letters_are_read() {
    let wide = |array: &mut (&str, &'static str, String, Vec<i64>)| array.1 = "<i8";
    let other = two().with("taxel", wide).with("letter", wide).with("test", wide).with("place", wide);
    assert_eq!(other.read(), two().read());
    let letters = two().with("letters", |array| array.3.reverse()).read().unwrap();
    assert_eq!(letters.iter().map(|press| press.class).collect::<Vec<_>>(), [1, 2], "by name");
}

#[test]
fn an_archive_may_be_named_by_its_path_and_have_other_files() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("more.npz");
    let mut files = two().files();
    files.push(("about.txt".to_owned(), b"about".to_vec()));
    fs::write(&path, archive(&files)).unwrap();
    let found = EventDataset::letters(&path, &CLASSES).unwrap();
    assert_eq!((found.recordings.len(), found.passed_over), (2, vec![path.join("about.txt")]));
    let missing = EventDataset::letters(folder.path(), &CLASSES).unwrap_err().to_string();
    assert!(missing.contains("letters.npz"), "{missing}");
}

#[test]
fn an_array_that_is_missing_or_twice_there_is_named() {
    let files = two().files();
    for i in 0..files.len() {
        let name = files[i].0.trim_end_matches(".npy");
        let mut fewer = files.clone();
        fewer.remove(i);
        let message = read(&archive(&fewer)).unwrap_err();
        assert!(
            message.ends_with(&format!("letters.npz: expected an array {name}, found none")),
            "{message}"
        );
        let mut more = files.clone();
        more.push(files[i].clone());
        let message = read(&archive(&more)).unwrap_err();
        assert!(message.ends_with(&format!("found two of {name}")), "{message}");
    }
    let message = read(b"PK").unwrap_err();
    assert!(message.contains("letters.npz: zip: archive at byte 2"), "{message}");
    assert!(read(&archive(&[])).unwrap_err().contains("an array t_us"));
}

#[test]
fn a_value_out_of_range_is_refused_with_its_array_and_byte() {
    for (name, i, value, expected) in [
        ("taxel", 1, 0, "expected 1 to 80, found 0"),
        ("taxel", 2, 81, "expected 1 to 80, found 81"),
        ("adc", 0, 1025, "expected 0 to 1024, found 1025"),
        ("t_us", 2, -599_000_001, "expected -599000000 to 601199999, found -599000001"),
        ("t_us", 0, 601_200_000, "expected -599000000 to 601199999, found 601200000"),
        ("t_us", 0, i64::MAX, "found 9223372036854775807"),
        ("start", 0, 1, "expected 0 to 0, found 1"),
        ("start", 1, 5, "expected 0 to 4, found 5"),
        ("start", 1, -1, "expected 0 to 4, found -1"),
        ("start", 2, 3, "expected 4 to 4, found 3"),
        ("letter", 0, 3, "expected 0 to 2, found 3"),
        ("test", 1, 2, "expected 0 to 1, found 2"),
        ("place", 3, 8, "expected 0 to 7, found 8"),
        ("place", 160, -1, "expected 0 to 9, found -1"),
        ("stamps_us", 0, -5, "expected 0 to 9007199254740991, found -5"),
        ("stamps_us", 1, 999_999, "expected 1000000 to 600999999, found 999999"),
        ("stamps_us", 5, i64::MIN, "found -9223372036854775808"),
        ("stamps_us", 5, 601_100_000, "expected 1100000 to 601099999, found 601100000"),
    ] {
        let changed = two().value(name, i, value);
        let message = changed.refusal();
        let array = changed.0.iter().position(|array| array.0 == name).unwrap();
        let (values, bytes) = (changed.0[array].3.len(), changed.files()[array].1.len());
        let width = match changed.0[array].1 {
            "|u1" | "|b1" => 1,
            "<i2" | "<u2" => 2,
            _ => 8,
        };
        let place = format!("{name}.npy: npy: value at byte {}", bytes - width * (values - i));
        assert!(message.contains(&place) && message.contains(expected), "{message}, not {place}: {expected}");
    }
}

#[test]
fn shapes_that_do_not_fit_each_other_are_refused() {
    let shape = |name, shape: &str, values: usize| {
        two().with(name, |array| {
            shape.clone_into(&mut array.2);
            array.3.resize(values, 0);
        })
    };
    for (changed, expected) in [
        (
            shape("taxel", "(3,)", 3),
            "taxel.npy: expected the shape [4] for 4 readings of 2 presses, found [3]",
        ),
        (shape("adc", "(5,)", 5), "adc.npy: expected the shape [4]"),
        (shape("start", "(2,)", 2), "start.npy: expected the shape [3]"),
        (shape("number", "(0,)", 0), "number.npy: expected the shape [2]"),
        (shape("stamps_us", "(2, 2)", 4), "stamps_us.npy: expected the shape [2, 3]"),
        (shape("test", "(3,)", 3), "test.npy: expected the shape [2]"),
        (shape("place", "(80, 2)", 160), "place.npy: npy: value at byte"),
        (shape("t_us", "(4,)", 3), "t_us.npy: npy: array at byte"),
        (shape("t_us", "(18446744073709551615,)", 3), "expected 18446744073709551615 bytes"),
        (shape("t_us", "(2, 2)", 4), "t_us.npy"),
        (shape("letters", "(1,)", 1), "letter.npy: npy: value at byte"),
        (two().with("adc", |array| array.1 = "<f2"), "integers before this, not `<f2`"),
        (two().with("t_us", |array| array.1 = "<f8"), "t_us.npy: npy: header at byte"),
        (two().with("letters", |array| array.1 = "<i4"), "the type <U1"),
    ] {
        let message = changed.refusal();
        assert!(message.contains(expected), "{message}, not {expected}");
    }
}

#[test]
fn letters_that_are_no_classes_and_two_presses_of_a_name_are_refused() {
    for code in [0x61, 0xd800, -1] {
        let message = two().value("letters", 2, code).refusal();
        assert!(message.contains("letters.npy: expected letters space, A, B, found \""), "{message}");
    }
    let one = [(1_000_000, 1, 1000)];
    let twice = Made::new(&[(&one, [1, 2, 0]), (&one, [0, 2, 0]), (&one, [1, 2, 0])]).refusal();
    assert!(twice.ends_with("expected one press of a name, found two of train/A/2"), "{twice}");
    assert!(Made::new(&[]).refusal().ends_with("expected presses, found none"));
}

#[test]
fn a_bomb_of_readings_is_refused_before_it_is_unpacked() {
    let mut files = two().files();
    files[0].1.resize((64 << 20) + 1, 0);
    let message = read(&archive(&files)).unwrap_err();
    assert!(message.contains("content at byte 0 is too large"), "{message}");
}

#[test]
fn a_million_presses_and_readings_of_a_press_are_the_most() {
    let many = 1 << 20;
    let resized = |names: &[&str], count: usize| {
        names.iter().fold(two(), |made, name| {
            made.with(name, |array| {
                array.2 = format!("({count},)");
                array.1 = if array.1 == "<U1" { array.1 } else { "|u1" };
                array.3 = vec![0; count];
            })
        })
    };
    let presses = resized(&["letter", "number", "test"], many + 1).refusal();
    assert!(presses.contains("letter.npy: expected at most 1048576 presses, found 1048577"), "{presses}");
    let made = resized(&["t_us", "adc", "taxel"], many + 3);
    let made = made.value("start", 1, 2).value("start", 2, many as i64 + 3);
    let readings = made.with("taxel", |array| array.3.fill(1)).refusal();
    let expected = "expected at most 1048576 readings of a press, found 1048577";
    assert!(readings.contains("start.npy") && readings.contains(expected), "{readings}");
}

/// The reader's steps for a press, one reading at a time and from the whole list before it.
fn twin(readings: &[Reading]) -> Vec<Event> {
    let is_first = |i: usize| i == 0 || readings[i].0 - readings[i - 1].0 >= 8_000;
    let firsts: Vec<usize> = (0..readings.len()).filter(|&i| is_first(i)).collect();
    let event = |i: usize| {
        let (_, taxel, adc) = readings[i];
        let batch = firsts.iter().rposition(|&first| first <= i).unwrap();
        let (first, end) = (firsts[batch], firsts.get(batch + 1).copied().unwrap_or(readings.len()));
        let arrival = readings[first].0;
        let since = batch.checked_sub(1).map_or(15_700, |before| arrival - readings[firsts[before]].0);
        let covered = since.min(15_700);
        let t_us = arrival - covered + covered * (i - first + 1) as i64 / (end - first) as i64;
        let before =
            readings[..i].iter().rfind(|reading| reading.1 == taxel).map_or(1024, |reading| reading.2);
        let x = [5, 6, 7, 8, 9, 0, 1, 2, 3, 4][(taxel - 1) as usize % 10];
        let is_event = before != adc && (800_000..=1_400_000).contains(&t_us);
        is_event.then(|| Event::new(t_us, x, (taxel - 1) as u16 / 10, adc < before))
    };
    (0..readings.len()).filter_map(event).collect()
}

proptest! {
    #[test]
    fn events_are_those_of_the_slow_way_and_their_times_do_not_descend(
        steps in prop::collection::vec((prop_oneof![0..300_i64, 7_990..8_010_i64, 10_000..40_000_i64], 1..12_i64, 1000..1003_i64), 0..60),
        begin in 700_000..1_400_000_i64,
    ) {
        let readings: Vec<Reading> = steps.iter().scan(begin, |t_us, &(step, taxel, adc)| {
            *t_us += step;
            Some((*t_us, taxel, adc))
        }).collect();
        let found = Made::new(&[(&readings, [1, 0, 0])]).read().unwrap().remove(0).events;
        prop_assert!(found.is_sorted_by_key(|event| event.t_us));
        prop_assert_eq!(found, twin(&readings));
    }

    #[test]
    fn changed_values_and_bytes_give_presses_or_an_error(
        array in 0..10_usize, i in 0..200_usize, value in any::<i64>(), at in 0..2_000_usize, byte in any::<u8>(),
    ) {
        let name = two().0[array].0;
        let values = two().0[array].3.len();
        let _ = two().value(name, i % values, value).read();
        let _ = two().value(name, i % values, value % 3).read();
        let mut files = two().files();
        let place = at % files[array].1.len();
        files[array].1[place] = byte;
        let _ = read(&archive(&files));
        files[array].1.truncate(place);
        prop_assert!(read(&archive(&files)).is_err());
        let mut bytes = two().archive();
        let place = at % bytes.len();
        bytes[place] = byte;
        let _ = read(&bytes);
        let _ = read(&bytes[..place]);
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_shared_set_is_1215_presses_of_which_135_are_for_evaluation() {
    let mut classes = vec!["space".to_owned()];
    classes.extend(('A'..='Z').map(String::from));
    let classes: Vec<&str> = classes.iter().map(String::as_str).collect();
    let found = EventDataset::letters(shared("data/braille"), &classes).unwrap();
    let presses = &found.recordings;
    let test = presses.iter().filter(|press| press.split == Split::Test).count();
    assert_eq!((presses.len(), test, found.passed_over.len()), (1215, 135, 0));
    assert!((0..27).all(|class| presses.iter().filter(|press| press.class == class).count() == 45));
    assert!(presses.iter().all(|press| press.events.is_sorted_by_key(|event| event.t_us)));
    // Pressure rises first.
    let until_held = presses.iter().flat_map(|press| {
        let held = press.contact.map(|contact| contact.held_us);
        press.events.iter().take_while(move |event| Some(event.t_us) <= held)
    });
    let [rising, all] = [until_held.clone().filter(|event| event.on).count(), until_held.count()];
    assert!(10 * rising > 6 * all, "{rising} of {all}");
}
