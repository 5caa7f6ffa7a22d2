//! Sequences: folders in natural order, lists, single files, sizes that differ.

use std::fs;
use std::path::{Path, PathBuf};

use meissner_io::{Image, ImageSequence, IoError, Place, write_png};

fn image(path: &Path, width: usize, height: usize, value: u8) {
    write_png(path, width, height, &vec![value; width * height * 3]).unwrap();
}

fn names(sequence: &ImageSequence) -> Vec<&str> {
    sequence.paths().iter().map(|path| path.file_name().unwrap().to_str().unwrap()).collect()
}

#[test]
fn a_folder_is_read_in_natural_order_and_other_files_are_passed_over() {
    let folder = tempfile::tempdir().unwrap();
    for (value, name) in ["img1.png", "img2.PNG", "img10.png"].into_iter().enumerate() {
        image(&folder.path().join(name), 2, 1, value as u8);
    }
    fs::write(folder.path().join("img3.txt"), "no image").unwrap();
    fs::create_dir(folder.path().join("img4.png")).unwrap();
    let sequence = ImageSequence::open(folder.path()).unwrap();
    assert_eq!((sequence.len(), names(&sequence)), (3, vec!["img1.png", "img2.PNG", "img10.png"]));
    for (value, item) in sequence.enumerate() {
        assert_eq!(item.unwrap().1, Image { width: 2, height: 1, data: vec![value as u8; 6] });
    }
}

#[test]
fn a_list_gives_its_paths_in_its_order_relative_to_its_folder() {
    let folder = tempfile::tempdir().unwrap();
    fs::create_dir(folder.path().join("run 1")).unwrap();
    let absolute = folder.path().join("c.png");
    image(&folder.path().join("run 1/b.png"), 1, 1, 1);
    image(&folder.path().join("a.png"), 1, 1, 2);
    image(&absolute, 1, 1, 3);
    let list = folder.path().join("images.txt");
    let text =
        format!("\u{feff}# by hand\r\n  run 1/b.png \r\n\n# a.png\na.png\n{}\na.png", absolute.display());
    fs::write(&list, text).unwrap();
    let values: Vec<u8> = ImageSequence::open(&list).unwrap().map(|item| item.unwrap().1.data[0]).collect();
    assert_eq!(values, [1, 2, 3, 2]);
}

#[test]
fn one_image_is_a_sequence_of_one() {
    let folder = tempfile::tempdir().unwrap();
    let path = folder.path().join("touch");
    image(&path, 1, 1, 7);
    let items: Vec<(PathBuf, Image)> = ImageSequence::open(&path).unwrap().map(Result::unwrap).collect();
    assert_eq!(items, [(path, Image { width: 1, height: 1, data: vec![7; 3] })]);
}

#[test]
fn an_image_of_another_size_or_at_fault_is_an_error_and_the_next_is_read() {
    let folder = tempfile::tempdir().unwrap();
    let path = |name| folder.path().join(name);
    fs::write(path("1.png"), b"\x89PNG\r\n\x1a\n").unwrap();
    image(&path("2.png"), 2, 1, 1);
    image(&path("3.png"), 1, 2, 2);
    image(&path("4.png"), 2, 1, 3);
    let mut sequence = ImageSequence::open(folder.path()).unwrap();
    let error = sequence.next().unwrap().unwrap_err();
    assert!(matches!(&error, IoError::Content { path: at, .. } if *at == path("1.png")), "{error}");
    assert_eq!(sequence.next().unwrap().unwrap().1.data, [1; 6]);
    let error = sequence.next().unwrap().unwrap_err().to_string();
    let expected =
        format!("{}: expected 2x1 pixels as in the first image, found 1x2", path("3.png").display());
    assert_eq!(error, expected);
    assert_eq!(sequence.next().unwrap().unwrap().1.data, [3; 6]);
    assert!(sequence.next().is_none());
}

#[test]
fn what_names_no_image_is_refused() {
    let folder = tempfile::tempdir().unwrap();
    let error = ImageSequence::open(folder.path()).unwrap_err();
    assert!(matches!(error, IoError::Unfit { .. }), "{error}");
    let list = folder.path().join("list.txt");
    fs::write(&list, "# nothing\n").unwrap();
    assert!(matches!(ImageSequence::open(&list), Err(IoError::Unfit { .. })));
    fs::write(&list, b"a.png\n\x00\x01\n").unwrap();
    match ImageSequence::open(&list).unwrap_err() {
        IoError::Content { source, .. } => {
            let IoError::Malformed { place, actual, .. } = *source else { panic!("{source}") };
            assert_eq!((place, actual.as_str()), (Place::Line(2), "`\\x00\\x01`"));
        }
        error => panic!("{error}"),
    }
    let missing = ImageSequence::open(&folder.path().join("none"));
    assert!(matches!(missing, Err(IoError::File { action: "open", .. })));
}
