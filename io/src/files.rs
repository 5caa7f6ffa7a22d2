//! Files as wholes: replacing a file in one step, reading up to a bound, and listing a folder in natural order.

use std::cmp::Ordering;
use std::fs::{self, File, FileType, OpenOptions};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{self, AtomicU64};

use crate::error::{IoError, Place};

/// Number of temporary files of this process so far.
static COUNT: AtomicU64 = AtomicU64::new(0);

/// Most bytes that are read of what may have no end.
const ENDLESS_BYTES: u64 = 1 << 31;

/// Replaces the file at `path`, which need not exist, with the bytes that `write` writes; a symbolic link stays a link, and the
/// file keeps its permissions.
///
/// The bytes go to a temporary file in the same folder (`.NAME.PROCESS-COUNT.tmp`), which is synced to the disk and then
/// renamed; on Unix the folder is synced too. If the program or the machine stops at any time, the file has its former or
/// its new content, and at most the temporary file is left over.
///
/// # Errors
/// [`IoError::Unfit`] where `path` is neither free nor a regular file nor a link to one; [`IoError::File`] where the file may not
/// be written, where the temporary file cannot be created, written or renamed, or where `write` gives an error. The former file is
/// then unchanged.
pub fn replace_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), IoError> {
    let fail = |action| IoError::file(action, path);
    let target = target(path)?;
    let (temporary, file) = temporary(&target).map_err(fail("create"))?;
    let permitted = match fs::metadata(&target) {
        Ok(former) => file.set_permissions(former.permissions()),
        Err(_) => Ok(()),
    };
    let written = permitted.and_then(|()| fill(file, write)).and_then(|()| fs::rename(&temporary, &target));
    if written.is_err() {
        // The caller gets the error of the writing, not one of the clean-up.
        let _ = fs::remove_file(&temporary);
    }
    written.and_then(|()| sync_folder(&target)).map_err(fail("write"))
}

/// Checks that [`replace_file`] can replace the file at `path`, before the work whose result it is for. Nothing is changed.
///
/// # Errors
/// As [`replace_file`].
pub fn check_replaceable(path: &Path) -> Result<(), IoError> {
    let (temporary, _) = temporary(&target(path)?).map_err(IoError::file("create", path))?;
    fs::remove_file(temporary).map_err(IoError::file("create", path))
}

/// Writes the file at `path` with [`replace_file`]; what is no file, such as a device or a pipe, is written to as it is.
///
/// # Errors
/// As [`replace_file`].
pub fn write_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), IoError> {
    if !is_special(path) {
        return replace_file(path, write);
    }
    let file = OpenOptions::new().write(true).open(path).map_err(IoError::file("open", path))?;
    let mut out = BufWriter::with_capacity(1 << 16, file);
    write(&mut out).and_then(|()| out.flush()).map_err(IoError::file("write", path))
}

/// Checks that [`write_file`] can write the file at `path`, before the work whose result it is for. Nothing is changed.
///
/// # Errors
/// As [`replace_file`].
pub fn check_writable(path: &Path) -> Result<(), IoError> {
    if is_special(path) { Ok(()) } else { check_replaceable(path) }
}

/// The bytes of the file at `path`, which may be a device or a pipe: `limit` at most. If it does not begin with `start`, these are
/// only as many bytes as `start` has.
///
/// # Errors
/// [`IoError::File`] where it cannot be read; [`IoError::Content`] where it has more, of which one byte is read.
pub fn read_file(path: &Path, start: &[u8], limit: u64) -> Result<Vec<u8>, IoError> {
    let mut file = File::open(path).map_err(IoError::file("open", path))?;
    let mut bytes = Vec::new();
    let mut read = |bytes: &mut Vec<u8>, most| {
        Read::by_ref(&mut file).take(most).read_to_end(bytes).map_err(IoError::file("read", path))
    };
    read(&mut bytes, start.len() as u64)?;
    if bytes != start {
        return Ok(bytes);
    }
    read(&mut bytes, limit.saturating_add(1).saturating_sub(start.len() as u64))?;
    let actual = bytes.len() as u64;
    if actual > limit {
        let (format, what, place, unit) = ("file", "content", Place::Byte(0), "bytes");
        let large = IoError::TooLarge { format, what, place, unit, limit, actual, at_least: true };
        return Err(IoError::content(path)(large));
    }
    Ok(bytes)
}

/// The bytes of the file at `path`: all of a regular file, and at most 2 GiB of what may have no end, such as a device or a pipe.
///
/// # Errors
/// As [`read_file`].
pub fn read_whole(path: &Path) -> Result<Vec<u8>, IoError> {
    let has_end = fs::metadata(path).is_ok_and(|there| there.is_file());
    read_file(path, b"", if has_end { u64::MAX } else { ENDLESS_BYTES })
}

/// Whether `path` is there and neither a file nor a folder: a device, a pipe or a socket.
fn is_special(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir())
}

/// The file that [`replace_file`] replaces for `path`: behind a link, the file that it leads to.
fn target(path: &Path) -> Result<PathBuf, IoError> {
    let found = match fs::metadata(path) {
        // A file that may not be written is not replaced.
        Ok(there) if there.is_file() => {
            let writable = OpenOptions::new().append(true).open(path);
            return writable.and_then(|_| fs::canonicalize(path)).map_err(IoError::file("write", path));
        }
        Ok(there) => kind(there.file_type()),
        Err(_) if fs::symlink_metadata(path).is_ok_and(|there| there.is_symlink()) => {
            "a link that leads to none"
        }
        Err(_) => return Ok(path.to_owned()),
    };
    Err(IoError::unfit(path, "a file to replace, or none", found))
}

/// What something is that is no file.
fn kind(kind: FileType) -> &'static str {
    #[cfg(unix)]
    {
        use std::os::unix::fs::FileTypeExt;
        if kind.is_fifo() {
            return "a pipe";
        }
        if kind.is_socket() {
            return "a socket";
        }
        if kind.is_char_device() || kind.is_block_device() {
            return "a device";
        }
    }
    if kind.is_dir() { "a folder" } else { "something else" }
}

/// A new temporary file in the folder of `path`, with its path.
fn temporary(path: &Path) -> io::Result<(PathBuf, File)> {
    let name = path.file_name().ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?;
    // A name may have 255 bytes.
    let name: String = name.to_string_lossy().chars().take(50).collect();
    let (process, count) = (std::process::id(), COUNT.fetch_add(1, atomic::Ordering::Relaxed));
    let path = path.with_file_name(format!(".{name}.{process}-{count}.tmp"));
    let file = OpenOptions::new().write(true).create_new(true).open(&path)?;
    Ok((path, file))
}

/// Writes the file and syncs it to the disk.
fn fill(file: File, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 16, file);
    write(&mut out)?;
    out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
}

/// Syncs the name of a file to the disk, where the file system can do that for a folder.
fn sync_folder(path: &Path) -> io::Result<()> {
    if cfg!(unix) {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        return match File::open(folder.unwrap_or(Path::new(".")))?.sync_all() {
            Err(error) if error.kind() == io::ErrorKind::InvalidInput => Ok(()),
            synced => synced,
        };
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
                assert!(error.contains("expected a file to replace") && error.ends_with(found), "{error}");
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
