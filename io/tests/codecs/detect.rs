//! Formats by content, by name and by file extension.

use std::path::Path;

use meissner_io::{Format, IoError, UnknownName, decode, detect};

use crate::support::samples;

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
        "unknown format: expected aedat4, aedat3, aedat2, evt2, evt3, dat, es, nmnist, csv, npy or hdf5, found `hdf6`"
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
