//! Streams on which events arrive: standard input, TCP and UDP.
//!
//! Input: the name of a stream. Output: its bytes, as they arrive, until a signal.
//!
//! | name | stream |
//! |---|---|
//! | `-` | standard input |
//! | `tcp://HOST:PORT` | a connection to a server |
//! | `tcp-listen://HOST:PORT` | the first connection of a client |
//! | `udp://HOST:PORT` | datagrams to this address |
//! | `dv://HOST:PORT`, `dv-listen://HOST:PORT` | as `tcp`, with packets of `dv-processing` |
//! | `dv:///PATH`, `dv-listen:///PATH` | the same over a local socket |
//!
//! A datagram contains complete lines or records, and an empty one ends the stream. Incomplete ones
//! are refused and counted.
//!
//! Back-pressure: unread bytes wait in the operating system's buffers. If these are full, a writer
//! to standard input or over TCP waits; over UDP, datagrams are lost and cannot be counted.

use std::io::{self, BufRead, Read, Write};
use std::net::{ToSocketAddrs, UdpSocket};
use std::path::Path;
use std::time::Duration;

use meissner_io::limits::LINE_BYTES;

use crate::error::{Result, RunError};
use crate::interrupt;

/// Name of standard input, for messages.
pub const STDIN_NAME: &str = "standard input";

/// Whether `path` means standard input.
pub fn is_stdin(path: &Path) -> bool {
    path == Path::new("-")
}

#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Stream<'a> {
    Stdin,
    Connect(&'a str),
    Listen(&'a str),
    Datagrams(&'a str),
    /// A connection with packets of AEDAT4.
    DvConnect(&'a str),
    DvListen(&'a str),
}

pub(crate) fn stream(path: &Path) -> Option<Stream<'_>> {
    if is_stdin(path) {
        return Some(Stream::Stdin);
    }
    let (scheme, address) = path.to_str()?.split_once("://")?;
    match scheme {
        "tcp" => Some(Stream::Connect(address)),
        "tcp-listen" => Some(Stream::Listen(address)),
        "udp" => Some(Stream::Datagrams(address)),
        "dv" => Some(Stream::DvConnect(address)),
        "dv-listen" => Some(Stream::DvListen(address)),
        _ => None,
    }
}

/// Whether `path` names a stream, on which events arrive while they are read.
pub fn is_live(path: &Path) -> bool {
    stream(path).is_some()
}

/// Whether `path` names a stream of datagrams, each of which stands alone.
pub(crate) fn is_of_datagrams(path: &Path) -> bool {
    matches!(stream(path), Some(Stream::Datagrams(_)))
}

/// Whether `path` names a stream of AEDAT4 packets.
pub fn is_of_packets(path: &Path) -> bool {
    matches!(stream(path), Some(Stream::DvConnect(_) | Stream::DvListen(_)))
}

/// Default time for trying again a cut connection to the server `path`: iniVation's programs may be
/// restarted while their clients continue.
pub fn patience(path: &Path) -> Duration {
    if is_of_packets(path) { Duration::from_secs(5) } else { Duration::ZERO }
}

/// Whether `path` names a server, to which a connection can be made again.
pub(crate) fn is_of_server(path: &Path) -> bool {
    matches!(stream(path), Some(Stream::Connect(_) | Stream::DvConnect(_)))
}

/// The name of the stream or file `path`, for messages.
pub fn name(path: &Path) -> String {
    if is_stdin(path) { STDIN_NAME.to_owned() } else { path.display().to_string() }
}

/// The bytes of the stream that `path` names.
pub(crate) fn open(path: &Path) -> Result<interrupt::Input> {
    let opened = match stream(path) {
        Some(Stream::Stdin) => interrupt::input(),
        Some(Stream::Connect(address) | Stream::DvConnect(address)) => {
            interrupt::connect(address).map(interrupt::received)
        }
        Some(Stream::Listen(address) | Stream::DvListen(address)) => {
            interrupt::client(address).map(interrupt::received)
        }
        Some(Stream::Datagrams(address)) => interrupt::datagrams(address),
        None => Err(io::ErrorKind::NotFound.into()),
    };
    opened.map_err(|source| RunError::file("open", name(path), source))
}

/// The lines of the stream `path`. A datagram ends a line; one that is too long is cut.
pub(crate) fn lines(path: &Path) -> Result<Box<dyn BufRead + Send>> {
    if is_of_packets(path) {
        let source = io::Error::other("expected a stream of text, found one of AEDAT4 packets");
        return Err(RunError::file("read", name(path), source));
    }
    let input = open(path)?;
    Ok(if is_of_datagrams(path) { Box::new(DatagramLines::new(input)) } else { Box::new(input) })
}

/// The lines of datagrams.
pub(crate) struct DatagramLines<R> {
    input: R,
    /// The lines of the newest datagram, each with its end.
    lines: Vec<u8>,
    /// The number of bytes of them that were read.
    read: usize,
}

impl<R> DatagramLines<R> {
    pub(crate) fn new(input: R) -> Self {
        Self { input, lines: Vec::new(), read: 0 }
    }
}

impl<R: BufRead> BufRead for DatagramLines<R> {
    fn fill_buf(&mut self) -> io::Result<&[u8]> {
        if self.read == self.lines.len() {
            let datagram = self.input.fill_buf()?;
            self.lines.clear();
            self.read = 0;
            for line in datagram.split_inclusive(|&byte| byte == b'\n') {
                let line = line.strip_suffix(b"\n").unwrap_or(line);
                let is_long = line.len() as u64 >= LINE_BYTES;
                self.lines.extend_from_slice(if is_long { b"a line that is too long" } else { line });
                self.lines.push(b'\n');
            }
            let length = datagram.len();
            self.input.consume(length);
        }
        Ok(&self.lines[self.read..])
    }

    fn consume(&mut self, bytes: usize) {
        self.read += bytes;
    }
}

impl<R: BufRead> Read for DatagramLines<R> {
    fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
        let read = self.fill_buf()?.read(bytes)?;
        self.consume(read);
        Ok(read)
    }
}

/// The other end of a stream, for a program that sends.
pub(crate) enum Receiver {
    /// Takes bytes in order, and makes the sender wait.
    Bytes(Box<dyn Write>),
    /// Takes datagrams, or loses them.
    Datagrams(UdpSocket),
}

/// The receiver of the stream `path`: `-` is standard output, `udp://` the receiver's address.
pub(crate) fn receiver(path: &Path) -> Result<Receiver> {
    let opened = || -> io::Result<Receiver> {
        Ok(match stream(path) {
            Some(Stream::Stdin) => Receiver::Bytes(Box::new(interrupt::output(io::stdout()))),
            Some(Stream::Connect(address) | Stream::DvConnect(address)) => {
                Receiver::Bytes(Box::new(interrupt::output(interrupt::connect(address)?)))
            }
            Some(Stream::Listen(address) | Stream::DvListen(address)) => {
                Receiver::Bytes(Box::new(interrupt::output(interrupt::client(address)?)))
            }
            Some(Stream::Datagrams(address)) => {
                let to = address.to_socket_addrs()?.next().ok_or(io::ErrorKind::NotFound)?;
                // The sender must use the receiver's address family.
                let from = if to.is_ipv4() { "0.0.0.0:0" } else { "[::]:0" };
                let socket = UdpSocket::bind(from)?;
                socket.connect(to)?;
                Receiver::Datagrams(socket)
            }
            None => {
                let expected = "-, or HOST:PORT after tcp://, tcp-listen://, udp://, dv:// or dv-listen://";
                return Err(io::Error::other(format!("expected {expected}")));
            }
        })
    };
    opened().map_err(|source| RunError::file("open", name(path), source))
}
