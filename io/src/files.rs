//! Files as wholes: replacing a file in one step, and listing a folder in natural order.

use std::cmp::Ordering;
use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::atomic::{self, AtomicU64};

use crate::error::IoError;

/// Number of temporary files of this process so far.
static COUNT: AtomicU64 = AtomicU64::new(0);

/// Replaces the file at `path`, which need not exist, with the bytes that `write` writes; a symbolic link stays a link.
///
/// The bytes go to a temporary file in the same folder (`.NAME.PROCESS-COUNT.tmp`), which is synced to the disk and then
/// renamed; on Unix the folder is synced too. If the program or the machine stops at any time, the file has its former or
/// its new content, and at most the temporary file is left over.
///
/// # Errors
/// [`IoError::File`] where the temporary file cannot be created, written or renamed, or where `write` gives an error. The
/// former file is then unchanged.
pub fn replace_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), IoError> {
    let fail = |action| IoError::file(action, path);
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let temporary = beside(&target).map_err(fail("create"))?;
    let file = OpenOptions::new().write(true).create_new(true).open(&temporary).map_err(fail("create"))?;
    let written = fill(file, write).and_then(|()| fs::rename(&temporary, &target));
    if written.is_err() {
        // The caller gets the error of the writing, not one of the clean-up.
        let _ = fs::remove_file(&temporary);
    }
    written.and_then(|()| sync_folder(&target)).map_err(fail("write"))
}

/// A unique name for a temporary file in the folder of `path`.
fn beside(path: &Path) -> io::Result<PathBuf> {
    let name = path.file_name().ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?;
    let (process, count) = (std::process::id(), COUNT.fetch_add(1, atomic::Ordering::Relaxed));
    Ok(path.with_file_name(format!(".{}.{process}-{count}.tmp", name.to_string_lossy())))
}

/// Writes the file and syncs it to the disk.
fn fill(file: File, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 16, file);
    write(&mut out)?;
    out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
}

/// Syncs the name of a file to the disk.
fn sync_folder(path: &Path) -> io::Result<()> {
    if cfg!(unix) {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        File::open(folder.unwrap_or(Path::new(".")))?.sync_all()?;
    }
    Ok(())
}

/// The entries of a folder in natural order of their names.
pub(crate) fn entries(folder: &Path) -> Result<Vec<PathBuf>, IoError> {
    let listed = fs::read_dir(folder).and_then(|entries| entries.map(|entry| Ok(entry?.path())).collect());
    let mut paths: Vec<PathBuf> = listed.map_err(IoError::file("list", folder))?;
    let name = |path: &'_ PathBuf| path.file_name().unwrap_or_default().as_encoded_bytes().to_vec();
    paths.sort_by(|a, b| compare(&name(a), &name(b)));
    Ok(paths)
}

/// Compares two names: runs of digits by value (`img2` before `img10`), other bytes one by one; names that are equal so far
/// (`img1`, `img01`) byte by byte. A total order; O(length), numbers of any length.
fn compare(a: &[u8], b: &[u8]) -> Ordering {
    let parts = |name| <[u8]>::chunk_by(name, |x: &u8, y: &u8| x.is_ascii_digit() && y.is_ascii_digit());
    let order = |(x, y): (&[u8], &[u8])| match (number(x), number(y)) {
        (Some(m), Some(n)) => m.len().cmp(&n.len()).then_with(|| m.cmp(n)),
        _ => x.cmp(y),
    };
    let unequal = parts(a).zip(parts(b)).map(order).find(|order| order.is_ne());
    unequal.unwrap_or_else(|| parts(a).count().cmp(&parts(b).count()).then_with(|| a.cmp(b)))
}

/// The digits of a run of digits without leading zeros; `None`: it is no such run.
fn number(part: &[u8]) -> Option<&[u8]> {
    let zeros = part.iter().take_while(|&&b| b == b'0').count();
    part[0].is_ascii_digit().then(|| &part[zeros..])
}

#[cfg(test)]
mod tests {
    use std::error::Error;
    use std::io::Write;

    use proptest::prelude::*;

    use super::*;

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
