//! Truncations, flipped bits, absurd lengths and bombs: an error or a complete result, never a
//! panic.

use meissner_engine::Event;
use meissner_io::limits::{HEADER_BYTES, PACKET_BYTES};
use meissner_io::{Format, IoError, ReadOptions, Recording, StreamKind, decode, decode_with};
use proptest::prelude::*;

use meissner_io_tests::codecs::aedat4::{Compression, File, event_packet, header, outputs, vector};
use meissner_io_tests::codecs::{events, samples};

/// Checks that the result of a reader for `bytes` is complete, or an error that states briefly what
/// was expected. In a complete result, every event is inside the sensor, nothing is salvaged, and a
/// strict reader reads the same unless something was left out and counted. Returns how much was
/// read or counted.
fn sound(bytes: &[u8], options: ReadOptions, about: &str) -> Option<u64> {
    let Recording { format, sensor, events, other_streams, left_out, salvaged, .. } =
        match decode_with(bytes, options) {
            Ok(recording) => recording,
            Err(error) => {
                let text = error.to_string();
                assert!(text.contains("expected") && text.len() < 1000, "{about}: {text:.600}");
                return None;
            }
        };
    assert_eq!(salvaged, None, "{about}");
    let is_inside = |event: &Event| sensor.is_none_or(|sensor| sensor.contains(event.x, event.y));
    assert!(events.iter().all(is_inside), "{about}");
    let unplaced = other_streams.iter().any(|stream| stream.kind == StreamKind::Unplaced);
    match decode_with(bytes, options.strict(true)) {
        Ok(strict) => {
            assert!(left_out.is_empty() && !unplaced, "{about}: {left_out:?}");
            assert_eq!((strict.format, strict.sensor), (format, sensor), "{about}");
            assert!(strict.events == events && strict.other_streams == other_streams, "{about}");
        }
        Err(error) => assert!(!left_out.is_empty() || unplaced, "{about}: {error}"),
    }
    let counted = left_out.iter().map(|kind| kind.count);
    let others = other_streams.iter().map(|stream| stream.elements);
    Some(events.len() as u64 + counted.chain(others).sum::<u64>())
}

#[test]
fn a_file_cut_at_any_length_gives_an_error_or_whole_events_from_its_start() {
    for (format, bytes) in samples() {
        let whole = decode(&bytes).unwrap().events;
        for length in 0..bytes.len() {
            let cut = &bytes[..length];
            let _ = decode(cut);
            match decode_with(cut, format) {
                Ok(recording) => {
                    assert!(whole.starts_with(&recording.events), "{format} cut at {length}");
                }
                // Each error has a place. A file that is cut within its header may have no known
                // format or version.
                Err(IoError::Truncated { .. } | IoError::Malformed { .. } | IoError::Undecided { .. }) => {}
                Err(IoError::UnknownFormat { .. } | IoError::Unsupported { .. }) if length < 100 => {}
                Err(error) => panic!("{format} cut at {length}: {error}"),
            }
        }
    }
}

#[test]
fn a_file_that_says_its_length_gives_an_error_or_everything_wherever_it_is_cut() {
    for (format, bytes) in
        samples().into_iter().filter(|(f, _)| matches!(f, Format::Aedat4 | Format::Npy | Format::Mcap))
    {
        let whole = decode(&bytes).unwrap();
        for length in 0..bytes.len() {
            match decode_with(&bytes[..length], format) {
                // The table after the packets of AEDAT4 may be cut.
                Ok(recording) => assert!(format == Format::Aedat4 && recording == whole, "cut at {length}"),
                Err(error) => assert!(
                    matches!(error, IoError::Truncated { .. } | IoError::Malformed { .. }),
                    "cut at {length}: {error}"
                ),
            }
        }
    }
}

#[test]
fn any_flipped_bit_gives_an_error_or_a_recording() {
    for (format, mut bytes) in samples() {
        for bit in 0..bytes.len() * 8 {
            bytes[bit / 8] ^= 1 << (bit % 8);
            let about = format!("{format}, bit {bit}");
            sound(&bytes, ReadOptions::default(), &about);
            let counted = sound(&bytes, format.into(), &about);
            // At least 39 of 40 events. A packet contains many, and a header of EVT2 without its
            // end includes some.
            let has_many = matches!(format, Format::Evt2 | Format::Aedat4 | Format::Mcap);
            assert!(has_many || counted.is_none_or(|counted| counted >= 39), "{about}: {counted:?}");
            bytes[bit / 8] ^= 1 << (bit % 8);
        }
    }
}

#[test]
fn an_absurd_length_anywhere_gives_an_error_or_a_recording() {
    let lengths = [1_u64 << 63, u64::MAX, 0x7fff_ffff_7fff_ffff, 0x8000_0000_8000_0000, 0];
    for (format, bytes) in samples() {
        for at in 0..bytes.len().saturating_sub(8) {
            for length in lengths {
                for width in [2, 4, 8] {
                    let mut changed = bytes.clone();
                    changed[at..at + width].copy_from_slice(&length.to_le_bytes()[8 - width..]);
                    let about = format!("{format}, {length:#x} in {width} bytes at {at}");
                    sound(&changed, format.into(), &about);
                }
            }
        }
    }
}

/// A Zstandard frame of `blocks` times 128 KiB of zeros, four bytes a block, with a window of
/// `window`.
fn zstd_bomb(blocks: usize, window: u8) -> Vec<u8> {
    let mut frame = vec![0x28, 0xb5, 0x2f, 0xfd, 0x00, window];
    for block in 1..=blocks {
        let repeated = u32::from(block == blocks) | 1 << 1 | (128 << 10) << 3;
        frame.extend(&repeated.to_le_bytes()[..3]);
        frame.push(0);
    }
    frame
}

/// A window of 1 MiB.
const MIB: u8 = 10 << 3;

#[test]
fn a_packet_that_unpacks_beyond_the_bound_is_refused() {
    let lz4 = Compression::Lz4.pack(&vec![0; PACKET_BYTES as usize + 1]);
    for (compression, bomb) in [(Compression::Zstd, zstd_bomb(513, MIB)), (Compression::Lz4, lz4)] {
        let mut file = File::new(compression, None);
        file.packets.push((0, bomb));
        let error = decode(&file.bytes()).unwrap_err();
        assert!(
            matches!(error, IoError::TooLarge { limit: PACKET_BYTES, at_least: true, .. }),
            "{compression:?}: {error}"
        );
    }
}

#[test]
fn packets_that_unpack_beyond_the_bound_together_are_refused() {
    // Well-formed packets, each within the bound: empty vectors followed by zeros.
    let mut content = vector(*b"EVTS", 0, &vec![0; 40 << 20]);
    let length = content.len() as u32 - 4;
    content[..4].copy_from_slice(&length.to_le_bytes());
    let mut file = File::new(Compression::Zstd, None);
    file.push(0, &content);
    decode(&file.bytes()).unwrap();
    file.packets.push(file.packets[0].clone());
    file.packets.push(file.packets[0].clone());
    let error = decode(&file.bytes()).unwrap_err();
    assert!(matches!(error, IoError::TooLarge { what: "decompressed packet", .. }), "{error}");
}

#[test]
fn a_window_beyond_the_bound_is_refused() {
    // 2^41 bytes, the largest size that a frame can request.
    let mut file = File::new(Compression::Zstd, None);
    file.packets.push((0, zstd_bomb(1, 0xff)));
    let error = decode(&file.bytes()).unwrap_err();
    assert!(matches!(error, IoError::Malformed { what: "compressed packet", .. }), "{error}");
}

#[test]
fn a_bomb_in_the_packet_table_is_not_unpacked() {
    let mut file = File::new(Compression::Zstd, None);
    file.push(0, &event_packet(&events()));
    file.table = Some(vector(*b"FTAB", 0, &vec![0; PACKET_BYTES as usize * 2]));
    assert_eq!(decode(&file.bytes()).unwrap().events, events());
}

#[test]
fn a_vector_that_promises_more_than_its_packet_holds_is_refused() {
    let mut file = File::new(Compression::Lz4, None);
    file.push(0, &vector(*b"EVTS", u32::MAX, &[0; 64]));
    let error = decode(&file.bytes()).unwrap_err();
    let expected = u64::from(u32::MAX) * 16;
    assert!(matches!(error, IoError::Truncated { expected: e, actual: 64, .. } if e == expected), "{error}");
}

#[test]
fn absurd_lengths_in_the_container_are_refused() {
    let xml = outputs("");
    let mut long_header = header(0, &xml, -1);
    long_header[14..18].copy_from_slice(&u32::MAX.to_le_bytes());
    let error = decode(&long_header).unwrap_err();
    assert!(matches!(error, IoError::TooLarge { limit: HEADER_BYTES, .. }), "{error}");

    let error = decode(&header(0, &xml, i64::MAX)).unwrap_err();
    assert!(matches!(error, IoError::Truncated { expected: 0x7fff_ffff_ffff_ffff, .. }), "{error}");
    let error = decode(&header(0, &xml, i64::MIN)).unwrap_err();
    assert!(matches!(error, IoError::Malformed { what: "position of the packet table", .. }), "{error}");

    for (size, truncated) in [(i32::MAX, true), (-1, false), (i32::MIN, false)] {
        let mut file = File::new(Compression::Lz4, None);
        file.table = None;
        let mut bytes = file.bytes();
        bytes.extend(0_i32.to_le_bytes());
        bytes.extend(size.to_le_bytes());
        let error = decode(&bytes).unwrap_err();
        assert_eq!(matches!(error, IoError::Truncated { what: "packet", .. }), truncated, "{error}");
    }
}

#[test]
fn xml_that_expands_or_nests_without_end_is_refused() {
    let entities = r#"<!DOCTYPE d [<!ENTITY a "aaaaaaaaaa"><!ENTITY b "&a;&a;&a;&a;&a;&a;">]><dv>&b;</dv>"#;
    let deep = "<a>".repeat(20_000);
    let closed = format!("{}{}", "<a>".repeat(9_000), "</a>".repeat(9_000));
    for xml in [entities, &deep, &closed] {
        let error = decode(&header(0, xml, -1)).unwrap_err();
        assert!(matches!(error, IoError::Malformed { what: "XML of the streams", .. }), "{error}");
    }
}

/// If a parser compares each attribute or name space with all previous ones, its time and memory
/// grow with the square of the header.
#[test]
fn xml_of_nothing_but_attributes_or_name_spaces_takes_no_more_than_seconds() {
    let longest = HEADER_BYTES as usize - 100;
    let repeated = |item: &dyn Fn(usize) -> String, bytes: usize| {
        (0..)
            .map(item)
            .scan(0, |sum, item| {
                *sum += item.len();
                (*sum < bytes).then_some(item)
            })
            .collect::<String>()
    };
    let attributes = format!("<dv{}/>", repeated(&|i| format!(" a{i:x}=''"), longest));
    let spaces = repeated(&|i| format!(" xmlns:a{i:x}='b'"), longest / 2);
    let spaces = format!("<dv{spaces}>{}</dv>", repeated(&|_| "<a xmlns:z='y'/>".to_owned(), longest / 2));
    for (xml, is_refused) in [(attributes, false), (spaces, true)] {
        let start = std::time::Instant::now();
        let error = decode(&header(0, &xml, -1)).err();
        let refused = matches!(error, Some(IoError::Malformed { what: "XML of the streams", .. }));
        assert_eq!((refused, error.is_some()), (is_refused, is_refused), "{error:?}");
        assert!(start.elapsed() < std::time::Duration::from_secs(5), "{:?}", start.elapsed());
    }
}

#[test]
fn packets_of_many_streams_are_told_apart_in_seconds() {
    // As many streams as a header declares, and empty packets of the last of them.
    let node = |id: i32| format!("<node name=\"{id}\"><attr key=\"typeIdentifier\">X</attr></node>");
    let mut bytes = header(0, &outputs(&(0..1_000).map(node).collect::<String>()), -1);
    let packet = [999_i32.to_le_bytes(), [0; 4]].concat();
    bytes.extend(packet.repeat(4_000_000));
    let start = std::time::Instant::now();
    let recording = decode(&bytes).unwrap();
    assert!(start.elapsed() < std::time::Duration::from_secs(10), "{:?}", start.elapsed());
    assert_eq!(recording.other_streams.len(), 1);
    assert_eq!(recording.other_streams[0].packets, 4_000_000);
}

#[test]
fn messages_quote_what_a_file_says_in_part() {
    let long = "9".repeat(50_000);
    let xml = |streams: &str| header(0, &outputs(streams), -1);
    let node = format!(r#"<node name="{long}"/>"#);
    let size = format!(
        r#"<node name="0"><attr key="typeIdentifier">EVTS</attr>
           <node name="info"><attr key="sizeX">{long}</attr></node></node>"#
    );
    let descr = format!("{{'descr': [('t', '{long}')], }}");
    let npy = [&b"\x93NUMPY\x01\0"[..], &(descr.len() as u16).to_le_bytes(), descr.as_bytes()].concat();
    let texts = [
        format!("% evt {long}\n"),
        format!("% evt 2.0\n% geometry {long}x2\n"),
        format!("% Version {long}\n"),
        format!("# sensor {}x2\n1,2,3,4\n", &long[..4000]),
        format!("{},{long}\n", &long[..4000]),
    ];
    let files = [xml(&node), xml(&size), xml(&format!("<a{long}>")), npy];
    for bytes in files.into_iter().chain(texts.map(String::into_bytes)) {
        let error = decode(&bytes).unwrap_err();
        assert!(error.to_string().len() < 500, "{} bytes: {error:.600}", error.to_string().len());
    }
}

proptest! {
    #[test]
    fn noise_behind_any_start_gives_an_error_or_a_recording(
        sample in 0..samples().len(),
        keep in 0.0..1.0_f64,
        noise in prop::collection::vec(any::<u8>(), 0..300),
    ) {
        let (format, mut bytes) = samples().swap_remove(sample);
        bytes.truncate((bytes.len() as f64 * keep) as usize);
        bytes.extend(noise);
        let _ = decode(&bytes);
        let _ = decode_with(&bytes, format);
    }

    #[test]
    fn noise_is_an_error_or_a_recording_of_any_format(noise in prop::collection::vec(any::<u8>(), 0..300)) {
        let _ = decode(&noise);
        for format in Format::ALL {
            let _ = decode_with(&noise, format);
        }
    }
}
