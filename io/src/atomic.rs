//! Files that are replaced as a whole.
//!
//! Enters: what is to be in the file. Leaves: the file with it. Invariant: whenever the program or the machine stops, the file
//! is the former one or the new one, whole; what is beside it is at most a temporary file that nothing reads.

use std::fs::{self, File, OpenOptions};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

use crate::IoError;

/// Temporary files of this process so far.
static COUNT: AtomicU64 = AtomicU64::new(0);

/// Puts what `write` writes in the place of the file at `path`, which need not exist; a link stays one.
///
/// It is written beside it, in the same folder, brought to the disk, and given its name then; on Unix the folder is brought
/// to the disk, too. A temporary file (`.NAME.PROCESS-COUNT.tmp`) stays behind only where the program is stopped from
/// outside.
///
/// # Errors
/// [`IoError::File`] where the temporary file cannot be created or written, where `write` gives an error, or where the
/// name cannot be given: the former file is as it was then.
pub fn replace_file(
    path: &Path,
    write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), IoError> {
    let fail = |action| move |source| IoError::File { action, path: path.to_owned(), source };
    let target = fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let temporary = beside(&target).map_err(fail("create"))?;
    let file = OpenOptions::new().write(true).create_new(true).open(&temporary).map_err(fail("create"))?;
    let written = fill(file, write).and_then(|()| fs::rename(&temporary, &target));
    if written.is_err() {
        // What stopped the writing is told; that the rest stays is not.
        let _ = fs::remove_file(&temporary);
    }
    written.and_then(|()| sync_folder(&target)).map_err(fail("write"))
}

/// A name in the folder of `path` that no other temporary file has.
fn beside(path: &Path) -> io::Result<PathBuf> {
    let name = path.file_name().ok_or_else(|| io::Error::from(io::ErrorKind::InvalidInput))?;
    let (process, count) = (std::process::id(), COUNT.fetch_add(1, Ordering::Relaxed));
    Ok(path.with_file_name(format!(".{}.{process}-{count}.tmp", name.to_string_lossy())))
}

/// Writes the file and brings it to the disk.
fn fill(file: File, write: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>) -> io::Result<()> {
    let mut out = BufWriter::with_capacity(1 << 16, file);
    write(&mut out)?;
    out.into_inner().map_err(io::IntoInnerError::into_error)?.sync_all()
}

/// Brings the name of a file to the disk.
fn sync_folder(path: &Path) -> io::Result<()> {
    if cfg!(unix) {
        let folder = path.parent().filter(|folder| !folder.as_os_str().is_empty());
        File::open(folder.unwrap_or(Path::new(".")))?.sync_all()?;
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use std::error::Error;
    use std::io::Write;

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
}
