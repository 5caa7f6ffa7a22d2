//! Inputs of another kind than the reader's, told by their first bytes.

use std::io::BufReader;

use meissner_io::{
    CsvEvents, ElectrodeSettings, Electrodes, Format, ImageSequence, IoError, Kind, decode, read,
};

use crate::support::samples;

/// The starts of files that nothing here reads, with a word of their name and one of the advice.
const FOREIGN: &[(&[u8], &str, &str)] = &[
    #[cfg(not(feature = "hdf5"))]
    (b"\x89HDF\r\n\x1a\n\0\0", "HDF5", "h5py"),
    (b"\x1f\x8b\x08\0", "gzip", "gunzip"),
    (b"BZh91AY", "bzip2", "bunzip2"),
    (b"\xfd7zXZ\0\0", "xz", "unxz"),
    (b"\x28\xb5\x2f\xfd\0", "Zstandard", "unzstd"),
    (b"PK\x03\x04\x14\0", "zip", "unzip"),
    (b"#ROSBAG V2.0\n", "ROS bag", "rosbags"),
    (b"\x89MCAP0\r\n", "MCAP", "mcap"),
    (b"SQLite format 3\0", "SQLite", "rosbags"),
    (b"#!AER-DAT1.0\r\n", "AEDAT 1", "DV"),
    (b"#!AER-DAT3.0\r\n", "AEDAT 3.0", "DV"),
    (b"MATLAB 5.0 MAT-file, Platform", "MATLAB", "loadmat"),
    (b"\0\0\0\x18ftypmp42", "video", "ffmpeg"),
    (b"RIFF\x10\0\0\0AVI LIST", "video", "ffmpeg"),
    (b"% format EVT21;height=320;width=320\n% end\n", "EVT 2.1", "metavision_file_to_csv"),
];

/// A text of electrodes with a row.
fn electrodes() -> String {
    let names: Vec<String> = (1..=24).map(|e| format!("ff_e{e}")).collect();
    format!("{}\n{}\n", names.join(","), ["3500"; 24].join(","))
}

fn found(error: &IoError) -> Kind {
    match error {
        IoError::OtherKind { found, .. } => *found,
        error => panic!("{error}"),
    }
}

fn found_in_file(error: &IoError) -> Kind {
    match error {
        IoError::Content { source, .. } => found(source),
        error => panic!("{error}"),
    }
}

#[test]
fn a_format_that_is_not_read_is_named_with_what_converts_it() {
    for &(start, name, instead) in FOREIGN {
        let bytes = [start, &[0x80; 100]].concat();
        let messages = [
            CsvEvents::new(&bytes[..]).next().unwrap().unwrap_err().to_string(),
            CsvEvents::new(BufReader::with_capacity(3, &bytes[..])).next().unwrap().unwrap_err().to_string(),
            Electrodes::new(&bytes[..], ElectrodeSettings::default())
                .next()
                .unwrap()
                .unwrap_err()
                .to_string(),
        ];
        // What is packed is looked into.
        let whole = (!["gzip", "zip"].contains(&name)).then(|| decode(&bytes).unwrap_err().to_string());
        for message in messages.into_iter().chain(whole) {
            assert!(message.contains(name) && message.contains(instead), "{name}: {message}");
        }
    }
}

#[test]
fn a_binary_recording_in_place_of_text_is_named() {
    for (format, bytes) in samples().into_iter().filter(|(format, _)| *format != Format::Csv) {
        assert_eq!(Kind::of(&bytes), Some(Kind::Events(format)));
        let mut text = CsvEvents::new(&bytes[..]);
        let error = text.next().unwrap().unwrap_err();
        // The marks of N-MNIST are all of its bytes, and a line is only some of them.
        if format != Format::Nmnist {
            assert_eq!(found(&error), Kind::Events(format), "{error}");
        }
        assert!(text.next().is_none() || format == Format::Nmnist);
    }
}

#[test]
fn events_electrodes_and_pictures_are_told_apart_by_each_others_readers() {
    let electrodes = electrodes();
    assert_eq!(found(&decode(electrodes.as_bytes()).unwrap_err()), Kind::Electrodes);
    let error = CsvEvents::new(electrodes.as_bytes()).next().unwrap().unwrap_err();
    assert_eq!(found(&error), Kind::Electrodes);
    let picture = b"P5 1 1 255\n\x07";
    assert!(matches!(found(&decode(picture).unwrap_err()), Kind::Picture(_)));

    for text in ["t,x,y,p\n1,2,3,1\n", "1,2,3,1\n", "0.003811000 96 133 0\n"] {
        let error =
            Electrodes::new(text.as_bytes(), ElectrodeSettings::default()).next().unwrap().unwrap_err();
        assert_eq!(found(&error), Kind::Events(Format::Csv), "{text}");
    }
    let folder = tempfile::tempdir().unwrap();
    assert_eq!(found(&read(folder.path()).unwrap_err()), Kind::Folder);
    let path = folder.path().join("input");
    for (format, bytes) in samples() {
        std::fs::write(&path, bytes).unwrap();
        assert_eq!(Kind::of_file(&path).unwrap(), Some(Kind::Events(format)));
        let error = ImageSequence::open(&path).unwrap_err();
        assert_eq!(found_in_file(&error), Kind::Events(format), "{error}");
    }
    std::fs::write(&path, electrodes).unwrap();
    let error = ImageSequence::open(&path).unwrap_err();
    assert_eq!(found_in_file(&error), Kind::Electrodes, "{error}");
}

#[test]
fn a_list_of_pictures_is_no_recording() {
    for text in ["a/b.png\n", "a,b,c,d.png\n", "one two three four.png\n", "# pictures\n1.png\n"] {
        assert_eq!(Kind::of(text.as_bytes()), None, "{text}");
    }
}
