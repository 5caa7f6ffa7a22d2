//! Tests of parts of readers and writers that no recording reaches.

mod electrodes_header {
    use crate::electrodes::header::{electrode, unit_of_time};

    #[test]
    fn electrodes_are_known_by_the_end_of_their_names() {
        assert_eq!(electrode("ff_e1"), Some(("ff_e", 0)));
        assert_eq!(electrode("e24"), Some(("e", 23)));
        assert_eq!(electrode("th electrode_7"), Some(("th electrode_", 6)));
        for name in ["", "e", "e0", "e25", "device3", "ff_e", "7", "time3", "é1"] {
            assert_eq!(electrode(name), None, "{name}");
        }
    }

    #[test]
    fn a_time_without_a_unit_is_in_seconds() {
        assert_eq!(unit_of_time("t"), Some(1.0));
        assert_eq!(unit_of_time("timestamp_us"), Some(1e-6));
        assert_eq!(unit_of_time("time_h"), None);
        assert_eq!(unit_of_time("s"), None);
    }
}

mod files {
    use std::error::Error;
    use std::fs;
    use std::io::{self, Write};
    use std::path::Path;

    use proptest::prelude::*;

    use crate::error::IoError;
    use crate::files::*;

    fn names(folder: &Path) -> Vec<String> {
        let entries = fs::read_dir(folder).expect("the folder is there");
        let name = |entry: io::Result<fs::DirEntry>| entry.expect("readable").file_name();
        entries.map(|entry| name(entry).to_string_lossy().into_owned()).collect()
    }

    #[test]
    fn a_file_is_created_and_replaced_whole() {
        let folder = tempfile::tempdir().expect("a place for temporary files");
        let path = folder.path().join("state");
        for content in [vec![1; 200_000], vec![2; 7], vec![]] {
            replace_file(&path, |out| out.write_all(&content)).expect("a place to write to");
            assert_eq!(fs::read(&path).expect("written"), content);
            assert_eq!(names(folder.path()), ["state"]);
        }
    }

    #[test]
    fn what_fails_half_way_leaves_the_former_file_as_it_was() {
        let folder = tempfile::tempdir().expect("a place for temporary files");
        let path = folder.path().join("state");
        fs::write(&path, "former").expect("a place to write to");
        let failed = replace_file(&path, |out| {
            out.write_all(&vec![7; 100_000])?;
            assert_eq!(fs::read(&path).expect("there"), b"former", "while it is written, too");
            Err(io::Error::other("the disk is full"))
        });
        let error = failed.expect_err("the disk is full");
        let source = error.source().expect("why").to_string();
        assert!(
            error.to_string().starts_with("cannot write ") && source == "the disk is full",
            "{error}: {source}"
        );
        assert_eq!(fs::read(&path).expect("there"), b"former");
        assert_eq!(names(folder.path()), ["state"]);
    }

    #[test]
    fn a_name_that_cannot_be_given_is_an_error_that_leaves_nothing_behind() {
        let folder = tempfile::tempdir().expect("a place for temporary files");
        let path = folder.path().join("taken");
        fs::create_dir(&path).expect("a place to write to");
        assert!(replace_file(&path, |out| out.write_all(b"new")).is_err(), "a folder has the name");
        assert!(replace_file(&folder.path().join("none/state"), |out| out.write_all(b"new")).is_err());
        assert!(replace_file(Path::new("/"), |out| out.write_all(b"new")).is_err());
        assert_eq!(names(folder.path()), ["taken"]);
    }

    #[cfg(unix)]
    #[test]
    fn behind_a_link_the_file_is_replaced_and_the_link_stays() {
        let folder = tempfile::tempdir().expect("a place for temporary files");
        let (file, link) = (folder.path().join("file"), folder.path().join("link"));
        fs::write(&file, "former").expect("a place to write to");
        std::os::unix::fs::symlink(&file, &link).expect("links can be made");
        replace_file(&link, |out| out.write_all(b"new")).expect("a place to write to");
        assert_eq!(fs::read(&file).expect("there"), b"new");
        assert!(fs::symlink_metadata(&link).expect("there").is_symlink());
    }

    #[cfg(unix)]
    #[test]
    fn what_is_no_file_is_not_replaced_and_a_link_to_nothing_neither() {
        use std::os::unix::fs::{FileTypeExt, symlink};
        use std::os::unix::net::UnixListener;

        let folder = tempfile::tempdir().expect("a place for temporary files");
        let path = |name: &str| folder.path().join(name);
        symlink(path("nothing"), path("dangling")).expect("links can be made");
        symlink("/dev/null", path("device")).expect("links can be made");
        let _socket = UnixListener::bind(path("socket")).expect("sockets can be made");
        let made = std::process::Command::new("mkfifo").arg(path("fifo")).status();
        assert!(made.expect("there is such a program").success());
        for (name, found) in [
            ("dangling", "a link that leads to none"),
            ("device", "a device"),
            ("socket", "a socket"),
            ("fifo", "a pipe"),
            (".", "a folder"),
        ] {
            let refused = [
                check_replaceable(&path(name)),
                replace_file(&path(name), |_| panic!("{name} is not written")),
            ];
            for refused in refused {
                let error = refused.expect_err(name).to_string();
                assert!(
                    error.contains("expected a regular file, or none") && error.ends_with(found),
                    "{error}"
                );
            }
        }
        assert!(fs::symlink_metadata(path("fifo")).expect("there").file_type().is_fifo());
        assert!(fs::symlink_metadata("/dev/null").expect("there").file_type().is_char_device());
        assert!(!path("nothing").exists());
        write_file(&path("device"), |out| out.write_all(b"x")).expect("a device takes it");
        assert!(check_writable(&path("device")).is_ok() && check_writable(&path("dangling")).is_err());
        let mut there = names(folder.path());
        there.sort();
        assert_eq!(there, ["dangling", "device", "fifo", "socket"]);
    }

    #[cfg(unix)]
    #[test]
    fn a_file_keeps_its_permissions_and_a_long_name_is_no_hindrance() {
        use std::os::unix::fs::PermissionsExt;

        let folder = tempfile::tempdir().expect("a place for temporary files");
        let path = folder.path().join("n".repeat(255));
        fs::write(&path, "former").expect("a place to write to");
        fs::set_permissions(&path, fs::Permissions::from_mode(0o640)).expect("it is ours");
        check_replaceable(&path).expect("it can be replaced");
        assert_eq!(fs::read(&path).expect("there"), b"former");
        replace_file(&path, |out| out.write_all(b"new")).expect("a place to write to");
        assert_eq!(fs::read(&path).expect("there"), b"new");
        assert_eq!(fs::metadata(&path).expect("there").permissions().mode() & 0o777, 0o640);
        assert!(check_replaceable(&folder.path().join("none/state")).is_err(), "there is no such folder");
    }

    #[test]
    fn a_file_is_read_up_to_a_bound() {
        let folder = tempfile::tempdir().expect("a place for temporary files");
        let path = folder.path().join("file");
        fs::write(&path, [7; 100]).expect("a place to write to");
        assert_eq!(read_file(&path, b"\x07\x07", 100).expect("as long as the bound"), [7; 100]);
        assert_eq!(read_file(&path, b"\x07\x08\x09", 100).expect("it begins otherwise"), [7; 3]);
        assert!(matches!(read_file(&path, b"\x07", 99), Err(IoError::Content { .. })));
        assert!(!cfg!(unix) || read_file(Path::new("/dev/zero"), b"", 1000).is_err(), "it has no end");
    }

    #[test]
    fn numbers_in_names_count_by_value() {
        let sorted =
            ["a", "img", "img1", "img2", "img02b", "img10", "img010", "img11a9", "img11a10", "imh", "z1.5"];
        let mut names = sorted;
        names.reverse();
        names.sort_by(|a, b| compare(a.as_bytes(), b.as_bytes()));
        // `img010` and `img10` are the same number: then the bytes decide.
        let expected =
            ["a", "img", "img1", "img2", "img02b", "img010", "img10", "img11a9", "img11a10", "imh", "z1.5"];
        assert_eq!(names, expected);
    }

    #[test]
    fn numbers_beyond_64_bits_are_compared_too() {
        assert!(compare(b"99999999999999999999998", b"99999999999999999999999").is_lt());
        assert!(compare(b"99999999999999999999999", b"100000000000000000000000").is_lt());
    }

    proptest! {
        #[test]
        fn the_order_is_total(a in "[a-c0-2.]{0,6}", b in "[a-c0-2.]{0,6}", c in "[a-c0-2.]{0,6}") {
            let order = |x: &str, y: &str| compare(x.as_bytes(), y.as_bytes());
            prop_assert_eq!(order(&a, &b), order(&b, &a).reverse());
            prop_assert_eq!(order(&a, &b).is_eq(), a == b);
            if order(&a, &b).is_le() && order(&b, &c).is_le() {
                prop_assert!(order(&a, &c).is_le());
            }
        }
    }
}

#[cfg(feature = "hdf5")]
mod hdf5_ecf {
    use proptest::prelude::*;

    use crate::hdf5::ecf::{RECORD, decode};

    /// The values of `values` in runs.
    fn runs<T: PartialEq>(values: &[T]) -> impl Iterator<Item = (&T, u16)> {
        values.chunk_by(PartialEq::eq).map(|run| (&run[0], run.len() as u16))
    }

    /// The chunk of `events` (t, x, y, on) in order of time, with this layout, in the form of the
    /// vendor's coder.
    fn encoded(events: &[(u64, u16, u16, bool)], layout: u32) -> Vec<u8> {
        let mut chunk = ((events.len() as u32) << 2 | layout).to_le_bytes().to_vec();
        let times: Vec<_> = events.iter().map(|event| event.0).collect();
        let mut now = times.first().copied().unwrap_or(0);
        chunk.extend(now.to_le_bytes());
        for (&t_us, run) in runs(&times) {
            let mut step = t_us - now;
            now = t_us;
            if step >= 15 {
                while step > 0 {
                    chunk.push(0xf0 | (step & 15) as u8);
                    step >>= 4;
                }
            }
            chunk.push((step as u8) << 4 | run.min(15) as u8);
            if run >= 15 {
                chunk.extend(run.to_le_bytes());
            }
        }
        if layout == 2 {
            let mut words: Vec<_> = events
                .iter()
                .map(|&(_, x, y, on)| u32::from(y) << 12 | u32::from(x) << 1 | u32::from(on))
                .collect();
            words.resize(words.len().next_multiple_of(4), 0);
            for four in words.as_chunks().0 {
                let &[a, b, c, d] = four;
                let three = [a << 8 | b & 0xff, b >> 8 << 16 | c & 0xffff, c >> 16 << 24 | d];
                chunk.extend(three.iter().flat_map(|word| word.to_le_bytes()));
            }
            return chunk;
        }
        let rows: Vec<_> = events.iter().map(|event| event.2).collect();
        for (row, run) in runs(&rows) {
            chunk.extend((row << 5 | run.min(31)).to_le_bytes());
            if run >= 31 {
                chunk.extend(run.to_le_bytes());
            }
        }
        if layout == 1 {
            let mut words: Vec<_> = events.iter().map(|&(_, x, _, on)| x << 1 | u16::from(on)).collect();
            words.resize(words.len().next_multiple_of(4), 0);
            for four in words.as_chunks().0 {
                let &[a, b, c, d] = four;
                let three = [a << 4 | b & 0xf, b >> 4 << 8 | c & 0xff, c >> 8 << 12 | d];
                chunk.extend(three.iter().flat_map(|word| word.to_le_bytes()));
            }
            return chunk;
        }
        let mut columns = events.iter().map(|event| event.1).peekable();
        while let Some(column) = columns.next() {
            let mut word = column << 5;
            for step in 1..=5 {
                if columns.next_if_eq(&(column + step)).is_some() {
                    word |= 1 << (5 - step);
                }
            }
            chunk.extend(word.to_le_bytes());
        }
        let polarities: Vec<_> = events.iter().map(|event| event.3).collect();
        for (&on, run) in runs(&polarities) {
            chunk.push(u8::from(on) << 7 | run.min(127) as u8);
            if run >= 127 {
                chunk.extend(run.to_le_bytes());
            }
        }
        chunk
    }

    fn records(events: &[(u64, u16, u16, bool)]) -> Vec<u8> {
        let record = |&(t_us, x, y, on): &(u64, u16, u16, bool)| {
            let mut record = [0; RECORD];
            record[..2].copy_from_slice(&x.to_le_bytes());
            record[2..4].copy_from_slice(&y.to_le_bytes());
            record[4] = on.into();
            record[8..].copy_from_slice(&t_us.to_le_bytes());
            record
        };
        events.iter().flat_map(record).collect()
    }

    proptest! {
        /// Time steps around the lengths at which the encoding changes, runs of all lengths, and
        /// neighbours in a row.
        #[test]
        fn every_layout_comes_back(
            bursts in prop::collection::vec(
                (
                    prop_oneof![0..20_u64, Just(1 << 40), 0..100_000_u64],
                    0..2048_u16, 0..2048_u16, any::<bool>(),
                    prop_oneof![1..7_usize, 1..200_usize],
                    0..4_u16,
                ),
                0..20,
            ),
            begin in 0..1_u64 << 62,
        ) {
            let mut now = begin;
            let mut events = Vec::new();
            for (step, x, y, on, length, gap) in bursts {
                now += step;
                let column = |i: usize| (x + gap * i as u16) % 2048;
                events.extend((0..length).map(|i| (now, column(i), y, on)));
            }
            for layout in 0..3 {
                prop_assert_eq!(decode(&encoded(&events, layout)).unwrap(), records(&events), "layout {}", layout);
            }
        }

        #[test]
        fn any_bytes_give_records_or_an_error(chunk in prop::collection::vec(any::<u8>(), 0..80), count in 0..40_u32) {
            let chunk = [&((count << 2) | (count % 3)).to_le_bytes()[..], &chunk].concat();
            if let Ok(records) = decode(&chunk) {
                prop_assert_eq!(records.len(), count as usize * RECORD);
            }
        }
    }
}

mod packed {
    use std::io;

    use crate::error::IoError;
    use crate::packed::read_bounded;

    #[test]
    fn a_device_without_an_end_is_read_up_to_the_bound_and_refused() {
        let mut bytes = Vec::new();
        assert!(read_bounded(&[7; 100][..], 100, &mut bytes).expect("memory").is_ok());
        let error = read_bounded(io::repeat(0), 1 << 20, &mut bytes).expect("memory").expect_err("no end");
        assert!(matches!(error, IoError::TooLarge { limit: 1_048_576, at_least: true, .. }), "{error}");
        assert!(bytes.capacity() < 4 << 20);
    }
}

mod text {
    use crate::text::Number;

    fn scaled(text: &str, power: i32) -> Option<i128> {
        Number::parse(text.as_bytes()).and_then(|number| number.scaled(power))
    }

    #[test]
    fn an_exponent_moves_the_point_and_the_noise_of_a_float_is_no_decimal() {
        let number = |text: &'static str| Number::parse(text.as_bytes()).expect("a number");
        for (text, decimals, is_whole) in [
            ("1.9999999949504854e-06", 20, false),
            ("1.010000000000000047e-03", 5, false),
            ("1.049999999999999935e-03", 5, false),
            ("1.200000000000000000e+01", 0, true),
            ("9.999999999999999999e+00", 0, false),
            ("1.234500000000000000e+03", 1, false),
            ("12e-1", 1, false),
            ("120e-1", 0, true),
            ("0.000000000000000000e+00", 0, true),
            ("0.003000", 6, false),
            ("12.0", 1, true),
        ] {
            assert_eq!((number(text).decimals(), number(text).is_whole()), (decimals, is_whole), "{text}");
        }
    }

    #[test]
    fn digits_beyond_microseconds_round_to_the_nearest_and_halves_away_from_zero() {
        for (text, power, expected) in [
            ("0.003811000", 6, 3811),
            ("0.0038114999999999", 6, 3811),
            ("0.0038115", 6, 3812),
            ("-0.0038115", 6, -3812),
            ("12", 6, 12_000_000),
            ("1.5", 3, 1500),
            ("1499", -3, 1),
            ("1500.0", -3, 2),
            ("499", -3, 0),
            ("500", -3, 1),
            ("49", -3, 0),
            ("-500", -3, -1),
            ("1468940293.922985", 6, 1_468_940_293_922_985),
            ("1.9999999949504854e-06", 6, 2),
            ("1.000000000000000021e-03", 6, 1000),
            ("1.499999999999999999e-06", 6, 1),
            ("1.5E-6", 6, 2),
            ("-1.5e-06", 6, -2),
            ("4.9e-7", 6, 0),
            ("5e-7", 6, 1),
            ("5e-8", 6, 0),
            ("1.2e+01", 0, 12),
            ("2.5e+06", 0, 2_500_000),
            ("1589163005561252e-6", 6, 1_589_163_005_561_252),
            ("0e99999999999999999999", 6, 0),
            ("7e-99999999999999999999", 6, 0),
        ] {
            assert_eq!(scaled(text, power), Some(expected), "{text}");
        }
        assert_eq!(scaled(&"9".repeat(50), 0), None);
        assert_eq!(scaled("1e99999999999999999999", 0), None);
        for wrong in
            ["", "-", ".5", "1e", "e3", "1e+", "1e3.5", "1e3e3", "1.2.3", "0x1", "1,5", "+-1", "nan", "inf"]
        {
            assert!(Number::parse(wrong.as_bytes()).is_none(), "{wrong}");
        }
    }
}
