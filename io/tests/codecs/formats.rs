//! The format by content, name and extension; other kinds of input; refusals of encoders.

use std::fs;
use std::io::{self, BufReader, Write};
use std::path::Path;

use meissner_engine::{Event, Sensor};
use meissner_io::{
    CsvEvents, ElectrodeSettings, Electrodes, Format, ImageSequence, IoError, Kind, Place, UnknownName,
    decode, detect, encode, read, write,
};

use meissner_io_tests::codecs::{SENSOR, events, samples};

#[test]
fn every_format_is_told_by_its_content() {
    for (format, bytes) in samples() {
        assert_eq!(detect(&bytes), Some(format));
        assert_eq!(decode(&bytes).unwrap().format, format);
    }
}

#[test]
fn digits_on_34_pixels_are_not_taken_for_text_nor_text_for_digits() {
    assert_eq!(detect(&[0, 33, 0x80, 0, 1]), Some(Format::Nmnist));
    assert_eq!(detect(b"1,2,3,1\n12"), Some(Format::Csv));
    assert_eq!(detect(b"# sensor 3x4\n"), Some(Format::Csv));
    assert_eq!(detect(b"t,x,y,p\n"), Some(Format::Csv));
}

#[test]
fn what_is_no_recording_is_refused_with_its_first_bytes() {
    for bytes in [&b""[..], b"\x7fELF\x02\x01\x01", b"a line of prose", &[0, 34, 0, 0, 0], &[0; 6]] {
        assert_eq!(detect(bytes), None);
        assert!(matches!(decode(bytes), Err(IoError::UnknownFormat { .. })));
    }
    let error = decode(b"\x7fELF\x02").unwrap_err().to_string();
    assert!(error.ends_with(r"found 5 bytes starting with `\x7fELF\x02`"), "{error}");
}

#[test]
fn a_header_that_is_cut_is_an_error_of_its_own_format() {
    let error = decode(b"% evt 3.0\n% geometry 12").unwrap_err();
    assert_eq!(
        error.to_string(),
        "EVT3: the header's last line, which has no line feed, at byte 10 is cut short: expected 14 bytes, found 13"
    );
}

#[test]
fn names_are_read_back() {
    for format in Format::ALL {
        assert_eq!(format.to_string().parse::<Format>().unwrap(), format);
    }
    let error = "hdf6".parse::<Format>().unwrap_err().to_string();
    assert_eq!(
        error,
        "unknown format: expected aedat4, aedat3, aedat2, evt2, evt21, evt3, dat, es, nmnist, csv, npy, hdf5 or mcap, found `hdf6`"
    );
}

#[test]
fn an_output_has_the_format_of_its_extension() {
    let of = |name| Format::from_path(Path::new(name));
    assert_eq!(of("a/b.CSV").unwrap(), Format::Csv);
    assert_eq!(of("b.npy").unwrap(), Format::Npy);
    assert_eq!(of("b.dat").unwrap(), Format::Dat);
    assert_eq!(of("b.raw").unwrap(), Format::Evt3);
    assert_eq!(of("b.evt2").unwrap(), Format::Evt2);
    for format in Format::ALL.into_iter().filter(|f| f.is_writable()) {
        assert_eq!(Format::from_path(&Path::new("b").with_extension(format.extension())).unwrap(), format);
    }
    assert!(matches!(of("b"), Err(UnknownName { .. })));
    assert!(matches!(of("b.h6"), Err(UnknownName { actual, .. }) if actual == "h6"));
}

/// The starts of files that no reader here reads, with a word of their name and one of the advice.
const FOREIGN: &[(&[u8], &str, &str)] = &[
    #[cfg(not(feature = "hdf5"))]
    (b"\x89HDF\r\n\x1a\n\0\0", "HDF5", "h5py"),
    (b"\x1f\x8b\x08\0", "gzip", "gunzip"),
    (b"BZh91AY", "bzip2", "bunzip2"),
    (b"\xfd7zXZ\0\0", "xz", "unxz"),
    (b"\x28\xb5\x2f\xfd\0", "Zstandard", "unzstd"),
    (b"PK\x03\x04\x14\0", "zip", "unzip"),
    (b"#ROSBAG V2.0\n", "ROS bag", "rosbags"),
    (b"SQLite format 3\0", "SQLite", "rosbags"),
    (b"#!AER-DAT1.0\r\n", "AEDAT 1", "DV"),
    (b"#!AER-DAT3.0\r\n", "AEDAT 3.0", "DV"),
    (b"MATLAB 5.0 MAT-file, Platform", "MATLAB", "loadmat"),
    (b"\0\0\0\x18ftypmp42", "video", "ffmpeg"),
    (b"RIFF\x10\0\0\0AVI LIST", "video", "ffmpeg"),
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
        // Packed content is unpacked.
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
        // N-MNIST is recognised by all of its bytes, and a line is only a part of them.
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

#[test]
fn json_is_no_table_of_events_or_electrodes_whatever_names_it_has() {
    let electrodes: Vec<String> = (1..=24).map(|i| format!("\"ff_e{i}\"")).collect();
    for text in [
        "[\"a\",\"t\",\"x\",\"y\",\"p\",\"b\"]\n".to_owned(),
        "[{\"name\":\"a\",\"sensor\":[1,2]}]\n".to_owned(),
        "{\"on\":1,\"off\":2}\n".to_owned(),
        format!("\n[\"a\",{},\"b\"]\n", electrodes.join(",")),
    ] {
        assert_eq!(Kind::of(text.as_bytes()), None, "{text}");
        assert_eq!(detect(text.as_bytes()), None, "{text}");
        assert!(matches!(decode(text.as_bytes()), Err(IoError::UnknownFormat { .. })), "{text}");
    }
}

/// The index and field of the refusal; also checks that nothing was written.
fn refusal(format: Format, sensor: Option<Sensor>, events: &[Event]) -> (usize, &'static str) {
    let mut bytes = Vec::new();
    let error = encode(format, sensor, events, &mut bytes).unwrap_err();
    assert!(bytes.is_empty());
    match error {
        IoError::CannotHold { index, field, .. } => (index, field),
        other => panic!("{other}"),
    }
}

#[test]
fn files_come_back_with_their_sensor() {
    let folder = tempfile::tempdir().unwrap();
    for format in Format::ALL.into_iter().filter(|format| format.is_writable()) {
        let path = folder.path().join("recording").with_extension(format.extension());
        write(&path, format, Some(SENSOR), &events()).unwrap();
        let recording = read(&path).unwrap();
        let sensor = (format != Format::Npy).then_some(SENSOR);
        assert_eq!((recording.format, recording.sensor, recording.events), (format, sensor, events()));
    }
}

#[test]
fn times_and_pixels_beyond_a_binary_format_are_refused_by_index_and_field() {
    let good = Event::new(0, 0, 0, true);
    for (format, most_t, side) in
        [(Format::Dat, (1_i64 << 32) - 1, 1_u16 << 14), (Format::Evt3, (1 << 40) - 1, 2048)]
    {
        let last = Event::new(most_t, side - 1, side - 1, true);
        encode(format, None, &[good, last], &mut io::sink()).unwrap();
        for (bad, field) in [
            (Event { t_us: -1, ..good }, "t_us"),
            (Event { t_us: most_t + 1, ..good }, "t_us"),
            (Event { x: side, ..good }, "x"),
            (Event { y: side, ..good }, "y"),
        ] {
            assert_eq!(refusal(format, None, &[good, bad]), (1, field));
        }
    }
}

#[test]
fn steps_back_that_a_reader_would_take_for_a_wrap_are_refused() {
    let at = |t_us| Event::new(t_us, 0, 0, true);
    let second = 1 << 24;
    assert_eq!(refusal(Format::Evt3, None, &[at(second + 5), at(second - 5)]), (1, "t_us"));
    assert_eq!(refusal(Format::Evt3, None, &[at(second - 1), at(second - 1 - (1 << 23))]), (1, "t_us"));
    assert_eq!(refusal(Format::Dat, None, &[at((1 << 31) + 7), at(7)]), (1, "t_us"));
    encode(Format::Dat, None, &[at((1 << 31) + 7), at(8)], &mut io::sink()).unwrap();
}

#[test]
fn events_beside_the_sensor_are_refused_by_every_encoder() {
    let bad = [Event::new(0, 3, 3, true), Event::new(0, 3, 4, true)];
    for format in Format::ALL.into_iter().filter(|format| format.is_writable()) {
        assert_eq!(refusal(format, Some(Sensor::new(4, 4)), &bad), (1, "y"));
    }
}

#[test]
fn a_sensor_that_a_header_cannot_name_is_refused() {
    for (format, sensor) in [
        (Format::Aedat4, Sensor::new(32_769, 10)),
        (Format::Evt3, Sensor::new(2049, 10)),
        (Format::Dat, Sensor::new(10, 20_000)),
        (Format::Csv, Sensor::new(0, 10)),
    ] {
        let error = encode(format, Some(sensor), &[], &mut io::sink()).unwrap_err();
        assert!(matches!(error, IoError::Unsupported { .. }), "{error}");
    }
}

#[test]
fn formats_that_are_only_read_are_refused() {
    for format in Format::ALL.into_iter().filter(|f| !f.is_writable()) {
        let error = encode(format, None, &[], &mut io::sink()).unwrap_err();
        let expected = format!(
            "unsupported: expected AEDAT4, CSV, npy, DAT, EVT3, ES or MCAP to be written, found {format}"
        );
        assert_eq!(error.to_string(), expected);
    }
}

#[test]
fn a_refused_write_leaves_the_file_as_it_was() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("kept.dat");
    fs::write(&path, "before").unwrap();
    write(&path, Format::Dat, None, &[Event::new(-1, 0, 0, true)]).unwrap_err();
    assert_eq!(fs::read(&path).unwrap(), b"before");
}

#[test]
fn a_file_that_is_not_there_is_named() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("absent.raw");
    let error = read(&path).unwrap_err();
    assert!(matches!(&error, IoError::File { action: "read", path: named, .. } if *named == path), "{error}");
    let error = write(&path.join("below"), Format::Csv, None, &[]).unwrap_err();
    assert!(matches!(error, IoError::File { action: "create", .. }), "{error}");
}

#[test]
fn a_stream_that_fails_is_refused_with_the_bytes_written() {
    struct Full(usize);
    impl Write for Full {
        fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
            let taken = bytes.len().min(self.0);
            self.0 -= taken;
            if taken == 0 { Err(io::ErrorKind::StorageFull.into()) } else { Ok(taken) }
        }
        fn flush(&mut self) -> io::Result<()> {
            Ok(())
        }
    }
    let error = encode(Format::Npy, None, &events(), &mut Full(200)).unwrap_err();
    assert!(matches!(error, IoError::Stream { action: "write", place: Place::Byte(200), .. }), "{error}");
}
