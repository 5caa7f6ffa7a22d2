//! Output with waits that signals end, as for input: a reader that stops does not keep the program
//! alive.
//!
//! Input: bytes for standard output, standard error or a connection. Output: the same bytes, in
//! order. A write waits for the reader until the program is asked to end. Then bytes that are not
//! taken at once are kept, and sent when the output is dropped, as long as the reader takes some
//! within [`PATIENCE`].

use std::fs::File;
use std::io::{self, Write};
use std::os::fd::AsFd;
use std::os::unix::fs::FileTypeExt;
use std::sync::atomic::{AtomicBool, Ordering};
use std::time::Duration;

use rustix::event::PollFlags;
use rustix::net::SendFlags;
use rustix::pipe::PIPE_BUF;

use super::unix::is_ready;

/// Longest wait, after the end, for a reader that takes nothing.
const PATIENCE: Duration = Duration::from_secs(1);

/// Whether a reader took nothing for [`PATIENCE`]: the program does not wait for a reader again.
static GIVEN_UP: AtomicBool = AtomicBool::new(false);

#[derive(Clone, Copy, Debug)]
enum Kind {
    /// A file, which takes everything at once.
    File,
    /// A socket, which reports how much it takes.
    Socket,
    /// A pipe or a terminal, which takes [`PIPE_BUF`] bytes if any; a write of more could wait.
    Pipe,
}

/// Standard output, standard error or a connection. Writes wait for its reader and for signals.
#[derive(Debug)]
pub struct Output<F: AsFd> {
    file: F,
    kind: Kind,
    /// Bytes that were not taken after the program was asked to end.
    kept: Vec<u8>,
}

/// `file` as an output. Nothing else may be buffered in it.
pub fn output<F: AsFd>(file: F) -> Output<F> {
    let about = file.as_fd().try_clone_to_owned().and_then(|file| File::from(file).metadata());
    let kind = match about.map(|about| about.file_type()) {
        Ok(kind) if kind.is_file() => Kind::File,
        Ok(kind) if kind.is_socket() => Kind::Socket,
        _ => Kind::Pipe,
    };
    Output { file, kind, kept: Vec::new() }
}

impl<F: AsFd> Output<F> {
    /// Writes some of `bytes` after a wait of `longest`; `None`: nothing is taken now.
    fn put(&self, bytes: &[u8], longest: Option<Duration>) -> io::Result<Option<usize>> {
        loop {
            if !matches!(self.kind, Kind::File) && !is_ready(&self.file, PollFlags::OUT, longest)? {
                return Ok(None);
            }
            let written = match self.kind {
                Kind::File => rustix::io::write(&self.file, bytes),
                Kind::Socket => {
                    rustix::net::send(&self.file, bytes, SendFlags::DONTWAIT | SendFlags::NOSIGNAL)
                }
                Kind::Pipe => rustix::io::write(&self.file, &bytes[..bytes.len().min(PIPE_BUF)]),
            };
            match written.map_err(io::Error::from) {
                Err(error) if error.kind() == io::ErrorKind::WouldBlock => {}
                Err(error) if error.kind() == io::ErrorKind::Interrupted => {}
                written => return written.map(Some),
            }
        }
    }

    fn send_kept(&mut self) -> io::Result<()> {
        let kept = std::mem::take(&mut self.kept);
        let mut rest = &kept[..];
        while !rest.is_empty() {
            let patience = if GIVEN_UP.load(Ordering::Relaxed) { Duration::ZERO } else { PATIENCE };
            let Some(sent) = self.put(rest, Some(patience))? else {
                // Reported once: if messages are not read either, one message would follow another.
                return if GIVEN_UP.swap(true, Ordering::Relaxed) {
                    Ok(())
                } else {
                    Err(io::Error::other(format!("nobody reads: {} bytes are left", rest.len())))
                };
            };
            rest = &rest[sent..];
        }
        Ok(())
    }
}

impl<F: AsFd> Write for Output<F> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        if self.kept.is_empty()
            && let Some(written) = self.put(bytes, None)?
        {
            return Ok(written);
        }
        self.kept.extend_from_slice(bytes);
        Ok(bytes.len())
    }

    fn flush(&mut self) -> io::Result<()> {
        Ok(())
    }
}

impl<F: AsFd> Drop for Output<F> {
    fn drop(&mut self) {
        if let Err(error) = self.send_kept() {
            tracing::warn!("output after the signal: {error}");
        }
    }
}
