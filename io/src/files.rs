//! Whole files: replacing in one step, reading up to a bound, listing in natural order.

use std::cmp::Ordering;
use std::fs::{self, File, FileType, OpenOptions};
use std::io::{self, BufWriter, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{self, AtomicU64};

use crate::error::{IoError, Place};

/// Number of temporary files of this process so far.
pub(crate) static COUNT: AtomicU64 = AtomicU64::new(0);

/// Maximum bytes that are read from an input that may have no end.
pub(crate) const ENDLESS_BYTES: u64 = 1 << 31;

/// Replaces the file at `path`, which need not exist, with the bytes that `write` writes; a
/// symbolic link stays a link, and the file keeps its permissions.
///
/// The bytes go to a temporary file in the same folder (`.NAME.PROCESS-COUNT.tmp`), which is synced
/// to the disk and then renamed; on Unix the folder is synced too. If the program or the machine
/// stops at any time, the file has its former or its new content.
///
/// # Errors
/// [`IoError::Unfit`] if `path` exists and is neither a regular file nor a link to one;
/// [`IoError::File`] if the file may not be written, if the temporary file cannot be created,
/// written or renamed, or if `write` gives an error. The former file is then unchanged.
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
        // The caller gets the error of writing, not an error of the clean-up.
        let _ = fs::remove_file(&temporary);
    }
    written.and_then(|()| sync_folder(&target)).map_err(fail("write"))
}

/// Checks in advance that [`replace_file`] can replace the file at `path`; changes nothing.
///
/// # Errors
/// As [`replace_file`].
pub fn check_replaceable(path: &Path) -> Result<(), IoError> {
    let (temporary, _) = temporary(&target(path)?).map_err(IoError::file("create", path))?;
    fs::remove_file(temporary).map_err(IoError::file("create", path))
}

/// Writes the file at `path` with [`replace_file`]; a device or a pipe is written to directly.
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

/// Checks in advance that [`write_file`] can write the file at `path`; changes nothing.
///
/// # Errors
/// As [`replace_file`].
pub fn check_writable(path: &Path) -> Result<(), IoError> {
    if is_special(path) { Ok(()) } else { check_replaceable(path) }
}

/// The bytes of the file at `path`, which may be a device or a pipe: at most `limit`. If it does
/// not begin with `start`, returns only as many bytes as `start` has.
///
/// # Errors
/// [`IoError::File`] if it cannot be read; [`IoError::Content`] if it has more bytes.
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

/// The bytes of the file at `path`: all of a regular file, at most 2 GiB of a device or a pipe.
///
/// # Errors
/// As [`read_file`].
pub fn read_whole(path: &Path) -> Result<Vec<u8>, IoError> {
    let has_end = fs::metadata(path).is_ok_and(|there| there.is_file());
    read_file(path, b"", if has_end { u64::MAX } else { ENDLESS_BYTES })
}

/// Whether `path` exists and is neither a file nor a folder: a device, a pipe or a socket.
pub(crate) fn is_special(path: &Path) -> bool {
    fs::metadata(path).is_ok_and(|there| !there.is_file() && !there.is_dir())
}

/// The file that [`replace_file`] replaces for `path`: for a link, the file that it leads to.
pub(crate) fn target(path: &Path) -> Result<PathBuf, IoError> {
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
    Err(IoError::unfit(path, "a regular file, or none", found))
}

/// The kind of a path that is not a file.
pub(crate) fn kind(kind: FileType) -> &'static str {
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
pub(crate) fn temporary(path: &Path) -> io::Result<(PathBuf, File)> {
    let name = path.file_name().ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?;
    // A name may have 255 bytes.
    let name: String = name.to_string_lossy().chars().take(50).collect();
    let (process, count) = (std::process::id(), COUNT.fetch_add(1, atomic::Ordering::Relaxed));
    let path = path.with_file_name(format!(".{name}.{process}-{count}.tmp"));
    let file = OpenOptions::new().write(true).create_new(true).open(&path)?;
    Ok((path, file))
}

/// Writes the file and syncs it to the disk.
pub(crate) fn fill(file: File, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 16, file);
    write(&mut out)?;
    out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
}

/// Syncs the name of a file to the disk, if the file system can sync a folder.
pub(crate) fn sync_folder(path: &Path) -> io::Result<()> {
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

/// Compares two names: runs of digits by value (`img2` before `img10`), other bytes one by one;
/// equal names (`img1`, `img01`) byte by byte. A total order; O(length).
pub(crate) fn compare(a: &[u8], b: &[u8]) -> Ordering {
    let parts = |name| <[u8]>::chunk_by(name, |x: &u8, y: &u8| x.is_ascii_digit() && y.is_ascii_digit());
    let order = |(x, y): (&[u8], &[u8])| match (number(x), number(y)) {
        (Some(m), Some(n)) => m.len().cmp(&n.len()).then_with(|| m.cmp(n)),
        _ => x.cmp(y),
    };
    let unequal = parts(a).zip(parts(b)).map(order).find(|order| order.is_ne());
    unequal.unwrap_or_else(|| parts(a).count().cmp(&parts(b).count()).then_with(|| a.cmp(b)))
}

/// The digits of a run of digits without leading zeros; `None`: it is not such a run.
pub(crate) fn number(part: &[u8]) -> Option<&[u8]> {
    let zeros = part.iter().take_while(|&&b| b == b'0').count();
    part[0].is_ascii_digit().then(|| &part[zeros..])
}
