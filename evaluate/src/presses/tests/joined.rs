//! Labels joined with presses.

use std::fmt::Write;

use meissner_io::ReadOptions;
use meissner_models::Weights;
use safetensors::SafeTensors;

use super::{Folder, SENSOR, kinds, odd};
use crate::prepare::labelled_presses;
use crate::presses::{OddityKind, OffsetSource, Options, Presses};
use crate::streams::Streams;

fn times(presses: &Presses, press: usize) -> Vec<i64> {
    presses.rows_of(press).iter().map(|row| row.t_us).collect()
}

#[test]
fn a_row_a_recording_holds_at_its_end_and_its_class_throughout() {
    let folder = Folder::three();
    folder.file("labels.csv", "recording,roll_deg,material\npress0,1,a\npress1.es,2,b\npress2,3,a\n");
    let presses = folder.read();
    assert_eq!(kinds(&presses), []);
    assert_eq!(times(&presses, 1), [1_100_000]);
    assert!(presses.rows_of(1)[0].whole);
    let [roll, material] = ["roll", "material"].map(|name| presses.label(name).expect("a label"));
    assert_eq!(presses.at(1, roll, 1_100_000), Some(2.0));
    assert_eq!(presses.at(1, roll, 1_050_000), None);
    assert_eq!(presses.at(1, material, 1_000_000), Some(1.0));
    assert_eq!(presses.labels[material].classes, ["a", "b"]);
    assert_eq!(presses.labels[roll].unit.as_deref(), Some("deg"));
}

#[test]
fn instants_are_interpolated_up_to_the_longest_gap() {
    let folder = Folder::new();
    folder.press("long.es", [0, 1_000_000], 500, 0);
    folder.file("labels.csv", "recording,t_ms,x_mm,class\nlong,0,1,a\nlong,80,3,b\nlong,900,5,b\n");
    let presses = folder.read();
    assert_eq!(presses.at(0, 0, 40_000), Some(2.0));
    assert_eq!(presses.at(0, 1, 30_000), Some(0.0));
    assert_eq!(presses.at(0, 1, 50_000), Some(1.0));
    assert_eq!(presses.at(0, 0, 80_000), Some(3.0));
    assert_eq!(presses.at(0, 0, 500_000), None, "the gap is longer than 100 ms");
    assert_eq!(presses.at(0, 0, 950_000), None, "behind the last one");
}

#[test]
fn names_are_those_of_files_or_places_with_or_without_extension() {
    let folder = Folder::new();
    folder.press("wood/a.es", [0, 100_000], 200, 1).press("steel/a.es", [0, 100_000], 200, 2);
    folder.press("wood/b.csv", [0, 100_000], 200, 3).press("wood/deeper/c.es", [0, 100_000], 200, 4);
    folder.file("labels.csv", "recording,x\nwood/a,1\nsteel\\a.es,2\n./wood/b.csv,3\nb,3\na,4\nc,5\n");
    let presses = folder.read();
    let names: Vec<&str> = presses.recordings.iter().map(|recording| recording.name.as_str()).collect();
    assert_eq!(names, ["steel/a.es", "wood/a.es", "wood/b.csv"]);
    assert_eq!(presses.rows.iter().map(|row| row.values[0]).collect::<Vec<_>>(), [2.0, 1.0, 3.0]);
    let expected = [
        OddityKind::PassedOver,
        OddityKind::UnknownRecording,
        OddityKind::AmbiguousRecording,
        OddityKind::Repeated,
    ];
    assert_eq!(kinds(&presses), expected);
}

#[test]
fn poses_join_where_they_are_during_a_press_and_at_its_ends_between_their_neighbours() {
    let folder = Folder::three();
    // A pose every 40 ms, shifted by 20 ms against the presses.
    let poses = (0..60).map(|i| format!("{},{}\n", i * 40_000 - 20_000, i * 40)).collect::<Vec<_>>().concat();
    folder.file("labels.csv", &format!("t_us,z_mm\n{poses}"));
    let presses = folder.read();
    assert_eq!(presses.offset.source, OffsetSource::SensorClock);
    assert_eq!(times(&presses, 0), [0, 20_000, 60_000, 100_000]);
    let values: Vec<f64> = presses.rows_of(0).iter().map(|row| row.values[0]).collect();
    assert_eq!(values, [20.0, 40.0, 80.0, 120.0]);
    assert_eq!(times(&presses, 1), [1_000_000, 1_020_000, 1_060_000, 1_100_000]);
}

#[test]
fn the_offset_is_the_median_of_the_list_beside_the_recordings() {
    let folder = Folder::three();
    let host = 1_717_000_000_000_000_i64;
    folder.file(
        "recordings.csv",
        &format!(
            "recording,first_us,last_us,events,host_us\npress0.es,0,100000,200,{}\n\
             press1.es,1000000,1100000,200,{}\npress2.es,2000000,2100000,200,{}\n",
            host + 3_000,
            host + 1_000_000,
            host + 1_999_000
        ),
    );
    let pose = |i: i64| format!("{},{}\n", host + i * 50_000, i % 7);
    folder.file("poses.csv", &format!("host_us,z\n{}", (0..60).map(pose).collect::<String>()));
    let options = Options { labels: Some(folder.path().join("poses.csv")), ..Options::default() };
    let presses = folder.try_read(&options).expect("they join");
    assert_eq!(presses.offset.us, -host);
    assert_eq!(presses.offset.source, OffsetSource::Listed { recordings: 3, spread_us: 4_000 });
    assert_eq!(times(&presses, 2), [2_000_000, 2_050_000, 2_100_000]);
    let given = Options { offset_us: Some(10_000 - host), ..options };
    let presses = folder.try_read(&given).expect("they join");
    assert_eq!(times(&presses, 2), [2_000_000, 2_010_000, 2_060_000, 2_100_000]);
}

#[test]
fn clocks_that_restart_with_each_recording_have_offsets_of_their_own() {
    let folder = Folder::new();
    let host = 1_717_000_000_000_000_i64;
    let mut list = "recording,first_us,last_us,events,host_us\n".to_owned();
    for i in 0..3 {
        folder.press(&format!("press{i}.es"), [5, 100_005], 200, i);
        writeln!(list, "press{i}.es,5,100005,200,{}", host + i * 1_000_000).expect("a text takes everything");
    }
    let pose = |i: i64| format!("{},{}\n", host + i * 50_000, i);
    folder.file("labels.csv", &format!("host_us,z\n{}", (0..60).map(pose).collect::<String>()));
    let refusal = folder.refusal(&Options::default());
    assert!(refusal.contains("recordings of one clock, or recordings.csv"), "{refusal}");
    folder.file("recordings.csv", &list);
    let presses = folder.read();
    assert_eq!(presses.offset.source, OffsetSource::Each);
    let values = |press| presses.rows_of(press).iter().map(|row| row.values[0]).collect::<Vec<_>>();
    assert_eq!(values(0), [0.0, 1.0, 2.0]);
    assert_eq!(values(2), [40.0, 41.0, 42.0]);
}

#[test]
fn times_that_can_only_count_from_the_first_event_do_so() {
    let folder = Folder::new();
    folder.press("a.es", [5_000_000, 5_200_000], 200, 0).press("b.es", [9_000_000, 9_200_000], 200, 1);
    folder.file("labels.csv", "recording,t_ms,x\na,100,1\nb,150,2\n");
    let presses = folder.read();
    assert_eq!(presses.rows.iter().map(|row| row.t_us).collect::<Vec<_>>(), [5_100_000, 9_150_000]);
    assert_eq!(odd(&presses, OddityKind::RelativeTimes).count, 2);
}

#[test]
fn the_file_for_training_is_read_by_what_reads_labels_along_time() {
    let folder = Folder::three();
    folder.press("press3.es", [3_000_000, 3_100_000], 200, 0); // the content of press0
    folder.file(
        "labels.csv",
        "recording,t_us,roll_deg,x_mm,material,side\npress0,50000,180,1,a,l\npress0,100000,90,2,a,l\n\
         press1,1100000,0,,b,r\npress1,1050000,9,3,b,r\npress2,2100000,0,1,a,r\npress3,3100000,7,7,a,l\n",
    );
    let presses = folder.read();
    let (notes, prepared) = labelled_presses(&presses, 2).expect("it can be written");
    assert_eq!(notes.len(), 2, "{notes:?}");
    assert!(notes[0].starts_with("copies of other recordings are left out: 1"), "{notes:?}");
    assert!(notes[1].starts_with("instants that lack a number are left out: 1"), "{notes:?}");
    let bytes = prepared.file.into_bytes();
    let streams = Streams::from_bytes(&bytes).expect("it is read");
    assert_eq!(streams.sensor(), SENSOR);
    assert_eq!(streams.parts().iter().map(|part| part.len()).collect::<Vec<_>>(), [200; 3]);
    let labels = streams.labels(0).expect("there are labels");
    assert_eq!(labels.t_us, [50_000, 100_000]);
    assert_eq!(labels.values, [("roll", &[180.0, 90.0][..]), ("x", &[1.0, 2.0][..])]);
    assert_eq!(streams.labels(1).expect("there are labels").t_us, [1_050_000]);

    let metadata = Weights::from_bytes(&bytes).expect("a valid file").metadata().clone();
    assert_eq!(metadata["classes"], r#"["a","b"]"#);
    assert_eq!(metadata["classes.side"], r#"["l","r"]"#);
    assert_eq!(metadata["units"], r#"{"roll":"deg","x":"mm"}"#);
    assert_eq!(metadata["recordings"], r#"["press0.es","press1.es","press2.es"]"#);
    let file = SafeTensors::deserialize(&bytes).expect("a valid file");
    let integers = |name: &str| {
        let tensor = file.tensor(name).unwrap_or_else(|error| panic!("{name}: {error}"));
        tensor.data().as_chunks().0.iter().map(|&bytes| i64::from_le_bytes(bytes)).collect::<Vec<_>>()
    };
    assert_eq!(integers("label"), [0, 1, 0]);
    assert_eq!(integers("label.side"), [0, 1, 1]);
    assert_eq!(integers("fold"), [0, 0, 1]);
    assert!(labelled_presses(&presses, 4).is_err(), "there are three presses");
}

#[test]
fn what_cannot_be_joined_is_a_named_error() {
    let options = Options::default();
    let folder = Folder::three();
    let message = folder.refusal(&options);
    assert!(message.contains("a table of labels") && message.contains("no such file"), "{message}");
    folder.file("labels.csv", "recording,x\nother,1\n");
    let message = folder.refusal(&options);
    assert!(message.contains("labels of recordings such as press0.es"), "{message}");
    folder.file("labels.csv", "host_s,x\n1717000000.5,1\n1717000001.5,1\n");
    let message = folder.refusal(&options);
    assert!(message.contains("an offset that puts poses into recordings"), "{message}");
    folder.file("labels.csv", "recording,x\npress0,1,2\n");
    let message = folder.refusal(&options);
    assert!(message.contains("labels.csv") && message.contains("line 2"), "{message}");

    let empty = Folder::new();
    empty.file("labels.csv", "recording,x\na,1\n").file("notes.txt", "nothing").file("a.bag", "#ROSBAG V2.0");
    let message = empty.refusal(&options);
    assert!(message.contains("recordings of events in"), "{message}");
    assert!(message.contains("a.bag") && !message.contains("notes.txt"), "{message}");
}

#[test]
fn a_strict_reader_refuses_a_recording_that_cannot_be_read() {
    let folder = Folder::three();
    folder
        .file("press3.aedat4", "#!AER-DAT4.0\r\ncut")
        .file("labels.csv", "recording,x\npress0,1\npress3,2\n");
    let presses = folder.read();
    let unreadable = odd(&presses, OddityKind::Unreadable);
    assert!(unreadable.first.starts_with("press3.aedat4: "), "{unreadable}");
    let read = ReadOptions::default().strict(true);
    let message = folder.refusal(&Options { read, ..Options::default() });
    assert!(message.contains("press3.aedat4"), "{message}");
}
