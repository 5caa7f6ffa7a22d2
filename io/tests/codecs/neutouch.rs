//! The data set of a tactile skin: arrays in a zip archive.

use std::fs;

use meissner_engine::Event;
use meissner_io::datasets::{EventDataset, NeutouchSet, Split};
use proptest::prelude::*;

use crate::packed::zip;
use crate::shared_files::shared;
use meissner_io_tests::codecs::chain;

/// A file of version 1 with this type and shape.
fn npy(descr: &str, shape: &str, values: &[f32]) -> Vec<u8> {
    let header = format!("{{'descr': '{descr}', 'fortran_order': False, 'shape': {shape}, }}\n");
    let mut bytes = b"\x93NUMPY\x01\x00".to_vec();
    bytes.extend((header.len() as u16).to_le_bytes());
    bytes.extend(header.as_bytes());
    bytes.extend(values.iter().flat_map(|value| value.to_le_bytes()));
    bytes
}

/// An array of three bins with spikes at (taxel, index, bin).
fn array(spikes: &[(usize, usize, usize)]) -> Vec<u8> {
    let mut values = [0.0; 39 * 2 * 3];
    spikes.iter().for_each(|&(taxel, index, bin)| values[(taxel * 2 + index) * 3 + bin] = 1.0);
    npy("<f4", "(39, 2, 3)", &values)
}

fn read(set: NeutouchSet, archive: &[u8]) -> Result<EventDataset, String> {
    let folder = tempfile::tempdir().unwrap();
    let name = if set == NeutouchSet::Objects { "Ev-Objects.zip" } else { "Ev-Containers.zip" };
    fs::write(folder.path().join(name), archive).unwrap();
    EventDataset::neutouch(folder.path(), set).map_err(|error| chain(&error))
}

/// The message for an archive of objects with one array.
fn refusal(name: &str, content: Vec<u8>) -> String {
    read(NeutouchSet::Objects, &zip([(name, content)])).unwrap_err()
}

const ONE: &str = "Ev-Objects/train/sample_0_label_0.npy";

#[test]
fn a_spike_is_an_event_at_the_place_of_its_taxel_and_the_beginning_of_its_bin() {
    let spikes = [(38, 0, 2), (0, 1, 2), (0, 0, 2), (20, 1, 0)];
    let events = |set| read(set, &zip([(ONE, array(&spikes))])).unwrap().recordings.remove(0).events;
    // In the order of the taxels; for one taxel, rising pressure precedes falling pressure.
    let of_objects = [
        Event::new(0, 120, 178, false),
        Event::new(40_000, 0, 178, true),
        Event::new(40_000, 0, 178, false),
        Event::new(40_000, 240, 178, true),
    ];
    assert_eq!(events(NeutouchSet::Objects), of_objects);
    let of_containers: Vec<bool> = events(NeutouchSet::Containers).iter().map(|event| event.on).collect();
    assert_eq!(of_containers, [true, true, false, false], "rising pressure has the other index");
}

#[test]
fn recordings_come_by_split_then_by_class_and_then_by_number() {
    let one = || array(&[(1, 0, 1)]);
    let archive = zip([
        ("Ev-Objects/test/sample_3_label_0.npy", one()),
        ("Ev-Objects/train/sample_10_label_2.npy", one()),
        ("Ev-Objects/train/sample_9_label_2.npy", one()),
        ("Ev-Objects/train/sample_700_label_0.npy", one()),
        ("Ev-Objects/README", b"about".to_vec()),
        ("__MACOSX/train/._sample_9_label_2.npy", b"hidden".to_vec()),
        ("Ev-Objects/.DS_Store", b"hidden".to_vec()),
    ]);
    let set = read(NeutouchSet::Objects, &archive).unwrap();
    let found: Vec<_> = set.recordings.iter().map(|r| (r.name.as_str(), r.split, r.class)).collect();
    let expected = [
        ("train/sample_700_label_0", Split::Train, 0),
        ("train/sample_9_label_2", Split::Train, 2),
        ("train/sample_10_label_2", Split::Train, 2),
        ("test/sample_3_label_0", Split::Test, 0),
    ];
    assert_eq!(found, expected);
    let passed_over: Vec<_> = set.passed_over.iter().filter_map(|path| path.file_name()).collect();
    assert_eq!(passed_over, ["README"]);
}

#[test]
fn an_array_that_is_no_recording_is_refused_with_its_name_and_place() {
    let cases = [
        (array(&[]), "sample_0_label_0.npy: expected an array with spikes, found none"),
        (npy("<f4", "(38, 2, 1)", &[0.0; 76]), "expected the shape (39, 2, bins), found (38, 2, 1)"),
        (npy("<f4", "(39, 2)", &[0.0; 78]), "expected `,`"),
        (npy("<f4", "(39, 2, 1, 1)", &[0.0; 78]), "expected an array of 3 dimensions"),
        (npy("<f8", "(39, 2, 1)", &[0.0; 156]), "the type <f4"),
        (npy("<f4", "(39, 2, 2)", &[0.0; 78]), "expected 624 bytes of the shape [39, 2, 2], found 312"),
        (npy("<f4", "(39, 2, 18446744073709551615)", &[]), "expected 18446744073709551615 bytes"),
        (npy("<f4", "(39, 2, 0)", &[]), "expected an array with spikes"),
        (b"\x93NUMPY\x07\x00".to_vec(), "version 1, 2 or 3"),
        (Vec::new(), "byte 0"),
    ];
    for (content, expected) in cases {
        let message = refusal(ONE, content);
        assert!(message.contains("sample_0_label_0.npy") && message.contains(expected), "{message}");
    }
    for value in [0.5, -1.0, f32::NAN, f32::INFINITY] {
        let mut values = [0.0; 78];
        values[3] = value;
        let content = npy("<f4", "(39, 2, 1)", &values);
        let place = format!("byte {}: expected 0 or 1, found {value}", content.len() - 4 * (78 - 3));
        let message = refusal(ONE, content);
        assert!(message.contains(&place), "{message}, not {place}");
    }
    let fortran = String::from_utf8_lossy(&array(&[(0, 0, 0)])).replace("False", "True ");
    let message = refusal(ONE, [b"\x93", &fortran.as_bytes()["\u{fffd}".len()..]].concat());
    assert!(message.contains("fortran_order (False)") || message.contains("byte"), "{message}");
}

#[test]
fn a_name_of_another_kind_or_class_is_refused() {
    for name in [
        "train/sample_0_label_36.npy",
        "train/sample_0_label_-1.npy",
        "train/sample_0.npy",
        "valid/sample_0_label_0.npy",
        "sample_0_label_0.npy",
        "train/sample_x_label_0.npy",
    ] {
        let message = refusal(name, array(&[(0, 0, 0)]));
        assert!(
            message.contains(name) && message.contains("sample_<number>_label_<0 to 35>.npy"),
            "{message}"
        );
    }
}

#[test]
fn two_recordings_of_one_name_and_none_at_all_are_refused() {
    let one = || array(&[(0, 0, 0)]);
    let twice = zip([(ONE, one()), ("again/train/sample_0_label_0.npy", one())]);
    let message = read(NeutouchSet::Objects, &twice).unwrap_err();
    assert!(message.ends_with("found two of train/sample_0_label_0"), "{message}");
    let message = read(NeutouchSet::Objects, &zip([("README", b"about".to_vec())])).unwrap_err();
    assert!(message.ends_with("found none"), "{message}");
    let nowhere = EventDataset::neutouch("nowhere", NeutouchSet::Containers).unwrap_err().to_string();
    assert!(nowhere.contains("Ev-Containers.zip"), "{nowhere}");
}

#[test]
fn the_path_of_the_archive_does_as_that_of_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    let archive = folder.path().join("Ev-Objects.zip");
    fs::write(&archive, zip([(ONE, array(&[(0, 0, 0)]))])).unwrap();
    for path in [folder.path().to_owned(), archive.clone(), folder.path().join("Ev-Objects")] {
        let found = EventDataset::neutouch(&path, NeutouchSet::Objects).unwrap();
        assert_eq!(found.recordings.len(), 1, "{}", path.display());
    }
    let missing = folder.path().join("Ev-Containers");
    let message = EventDataset::neutouch(missing, NeutouchSet::Containers).unwrap_err().to_string();
    assert_eq!(message.matches("Ev-Containers").count(), 1, "{message}");
}

#[test]
fn a_bomb_is_refused_before_it_is_unpacked() {
    let message = refusal(ONE, vec![0; (64 << 20) + 1]);
    assert!(message.contains("content at byte 0 is too large") && message.contains("67108865"), "{message}");
    // Three entries of 40 MiB each share the bound of a short archive.
    let entries = ["train/sample_0_label_0.txt", "train/sample_1_label_0.txt", "train/sample_2_label_0.txt"];
    let archive = zip(entries.map(|name| (name, vec![0; 40 << 20])));
    let message = read(NeutouchSet::Objects, &archive).unwrap_err();
    assert!(message.contains("is too large"), "{message}");
}

#[test]
fn a_content_that_differs_from_its_directory_is_refused() {
    let good = zip([(ONE, array(&[(0, 0, 0)]))]);
    let directory = good.windows(4).position(|bytes| bytes == b"PK\x01\x02").unwrap();
    // CRC-32, size after decompression, and method of the directory's record.
    for (at, expected) in [(16, "CRC-32"), (24, "bytes with CRC-32"), (10, "a stored or deflated entry")] {
        let mut changed = good.clone();
        changed[directory + at] ^= 2;
        let message = read(NeutouchSet::Objects, &changed).unwrap_err();
        assert!(message.contains("zip: entry at byte 0") && message.contains(expected), "{message}");
    }
    let mut encrypted = good.clone();
    encrypted[directory + 8] |= 1;
    assert!(read(NeutouchSet::Objects, &encrypted).unwrap_err().contains("an encrypted entry"));
    let message = read(NeutouchSet::Objects, &good[..good.len() - 1]).unwrap_err();
    assert!(message.contains("Ev-Objects.zip") && message.contains("end record"), "{message}");
}

proptest! {
    #[test]
    fn damaged_archives_give_an_error_or_recordings(at in 0..600_usize, value in any::<u8>(), cut in 0..600_usize) {
        let mut archive = zip([(ONE, array(&[(0, 0, 0)])), ("train/sample_1_label_1.npy", array(&[(5, 1, 2)]))]);
        let (at, cut) = (at % archive.len(), cut % archive.len());
        archive[at] = value;
        let _ = read(NeutouchSet::Objects, &archive);
        let _ = read(NeutouchSet::Objects, &archive[..cut]);
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn the_shared_sets_are_720_objects_and_300_containers() {
    for (set, train, test, events) in
        [(NeutouchSet::Objects, 576, 144, 1_794_232), (NeutouchSet::Containers, 240, 60, 769_323)]
    {
        let found = EventDataset::neutouch(shared("data/neutouch"), set).unwrap();
        let recordings = &found.recordings;
        let count = |split| recordings.iter().filter(|recording| recording.split == split).count();
        assert_eq!((count(Split::Train), count(Split::Test), found.passed_over.len()), (train, test, 0));
        let of_class = |class| recordings.iter().filter(|recording| recording.class == class).count();
        assert!((0..set.classes()).all(|class| of_class(class) == (train + test) / set.classes()));
        assert_eq!(recordings.iter().map(|recording| recording.events.len()).sum::<usize>(), events);
        let in_order = |events: &[Event]| events.is_sorted_by_key(|event| event.t_us);
        assert!(recordings.iter().all(|recording| in_order(&recording.events)));
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn in_both_shared_sets_a_contact_begins_with_rising_pressure() {
    for set in [NeutouchSet::Objects, NeutouchSet::Containers] {
        let found = EventDataset::neutouch(shared("data/neutouch"), set).unwrap();
        let mut first = [0, 0];
        for recording in &found.recordings {
            let begin = recording.events[0].t_us;
            let early = recording.events.iter().take_while(|event| event.t_us - begin <= 40_000);
            early.for_each(|event| first[usize::from(event.on)] += 1);
        }
        assert!(2 * first[1] > 3 * first[0], "{set:?}: {first:?}");
    }
}
