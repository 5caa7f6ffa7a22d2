//! The signals that ask the program to end: SIGINT (Ctrl-C), SIGTERM, and SIGHUP (its terminal is
//! gone) unless SIGHUP is ignored from the start, as by `nohup`.
//!
//! At first, each signal ends the program at once with exit status [`STATUS`]. A subcommand that
//! works on a stream calls [`listen`] once it has results to keep. From then on the first signal is
//! a request: [`requested`] is true, and every wait of this module ends. The second signal ends the
//! program at once or, if data must not be lost ([`hold`]), as soon as the data is written. The
//! third ends it at once.
//!
//! On platforms other than Unix, nothing is requested, and signals have their default effect.

/// Exit status of a program that was ended by a signal.
pub const STATUS: u8 = 130;

#[cfg(unix)]
mod output;

#[cfg(not(unix))]
pub use other::*;
#[cfg(unix)]
pub use output::{Output, output};
#[cfg(unix)]
pub use unix::*;

#[cfg(unix)]
mod unix {
    use std::fs::File;
    use std::io::{self, BufReader, Read, stdin};
    use std::net::{TcpListener, TcpStream, UdpSocket};
    use std::os::fd::{AsFd, OwnedFd};
    use std::os::unix::net::{UnixListener, UnixStream};
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::{Arc, Mutex, MutexGuard, OnceLock, PoisonError, TryLockError};
    use std::thread;
    use std::time::Duration;

    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use rustix::io::Errno;
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM};
    use signal_hook::{flag, low_level};

    use super::STATUS;

    static SIGNALS: OnceLock<Signals> = OnceLock::new();

    /// Locked while there is data that must not be lost.
    static HELD: Mutex<()> = Mutex::new(());

    /// Time between two checks whether the end of the program is held.
    const NAP: Timespec = Timespec { tv_sec: 0, tv_nsec: 10_000_000 };

    struct Signals {
        /// Whether a signal ends the program at once: before [`listen`].
        at_once: Arc<AtomicBool>,
        /// Whether a signal came.
        asked: Arc<AtomicBool>,
        /// Readable from the first signal on, because it is never read.
        woken: UnixStream,
        /// A byte for each signal, for the thread that counts them.
        counted: Mutex<Option<UnixStream>>,
    }

    /// Data that must not be lost is to be written: see [`hold`].
    #[derive(Debug)]
    pub struct Hold(#[expect(dead_code, reason = "it is held")] MutexGuard<'static, ()>);

    /// Standard input. A request ends it with an error.
    pub type Input = BufReader<Awaited>;

    /// A file with reads that also wait for signals.
    #[derive(Debug)]
    pub struct Awaited(File);

    /// Makes signals end the program with [`STATUS`], if it can.
    pub fn install() {
        let signals = || {
            let (at_once, asked) = (Arc::new(AtomicBool::new(true)), Arc::new(AtomicBool::new(false)));
            let ((woken, wake), (counted, count)) = (UnixStream::pair()?, UnixStream::pair()?);
            for signal in [SIGINT, SIGTERM, SIGHUP] {
                if signal == SIGHUP && is_ignored(SIGHUP) {
                    continue;
                }
                flag::register_conditional_shutdown(signal, STATUS.into(), Arc::clone(&at_once))?;
                flag::register(signal, Arc::clone(&asked))?;
                low_level::pipe::register(signal, wake.try_clone()?)?;
                low_level::pipe::register(signal, count.try_clone()?)?;
            }
            Ok::<_, io::Error>(Signals { at_once, asked, woken, counted: Mutex::new(Some(counted)) })
        };
        if let Ok(signals) = signals() {
            let _ = SIGNALS.set(signals);
        }
    }

    /// Whether the process was started with `signal` ignored; false if the system does not tell.
    fn is_ignored(signal: i32) -> bool {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let ignored = status.lines().find_map(|line| line.strip_prefix("SigIgn:"));
        let ignored = ignored.and_then(|mask| u64::from_str_radix(mask.trim(), 16).ok());
        ignored.is_some_and(|mask| mask >> (signal - 1) & 1 == 1)
    }

    /// Makes the first signal from now on a request; if this fails, the signal still ends the
    /// program.
    pub fn listen() {
        let Some(signals) = SIGNALS.get() else { return };
        let counted = signals.counted.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(counted) = counted
            && thread::Builder::new().name("signals".to_owned()).spawn(|| count(counted)).is_ok()
        {
            signals.at_once.store(false, Ordering::SeqCst);
        }
    }

    /// Ends the program at the second signal once nothing is [held](hold), or at the third.
    fn count(mut signals: UnixStream) {
        let mut two = [0; 2];
        if signals.read_exact(&mut two).is_err() {
            return;
        }
        while let Err(TryLockError::WouldBlock) = HELD.try_lock() {
            let third = poll(&mut [PollFd::new(&signals, PollFlags::IN)], Some(&NAP));
            if third.is_ok_and(|ready| ready > 0) {
                break;
            }
        }
        low_level::exit(STATUS.into());
    }

    /// Makes the second signal wait until the result is dropped. A thread may hold once.
    pub fn hold() -> Hold {
        Hold(HELD.lock().unwrap_or_else(PoisonError::into_inner))
    }

    /// Whether a signal has asked the program to end.
    pub fn requested() -> bool {
        SIGNALS.get().is_some_and(|signals| signals.asked.load(Ordering::Relaxed))
    }

    /// Waits for `time`, or until the program is asked to end.
    pub fn sleep(time: Duration) {
        let (Some(signals), Ok(timeout)) = (SIGNALS.get(), Timespec::try_from(time)) else {
            std::thread::sleep(time);
            return;
        };
        // An interrupted wait may also be shorter.
        let _ = poll(&mut [PollFd::new(&signals.woken, PollFlags::IN)], Some(&timeout));
    }

    /// Standard input.
    ///
    /// # Errors
    /// Its handle cannot be duplicated.
    pub fn input() -> io::Result<Input> {
        Ok(awaited(File::from(stdin().as_fd().try_clone_to_owned()?)))
    }

    /// `file`, which may be a pipe or a serial port.
    pub fn awaited(file: File) -> BufReader<Awaited> {
        BufReader::new(Awaited(file))
    }

    /// A connection over TCP or a local socket.
    pub type Socket = OwnedFd;

    /// The bytes that `socket` receives.
    pub fn received(socket: Socket) -> Input {
        awaited(File::from(socket))
    }

    /// A connection to the server at `address`: `HOST:PORT`, or the path of a local socket, which
    /// begins with `/`.
    ///
    /// # Errors
    /// No server listens there.
    pub fn connect(address: &str) -> io::Result<Socket> {
        if address.starts_with('/') {
            return Ok(UnixStream::connect(address)?.into());
        }
        without_delay(TcpStream::connect(address)?)
    }

    /// The first connection that a client makes to `address`, which is as for [`connect`].
    ///
    /// # Errors
    /// The address cannot be used, or a signal asks the program to end.
    pub fn client(address: &str) -> io::Result<Socket> {
        if address.starts_with('/') {
            let listener = UnixListener::bind(address)?;
            let accepted = wait(&listener).and_then(|()| listener.accept());
            // No other client is accepted.
            std::fs::remove_file(address)?;
            return Ok(accepted?.0.into());
        }
        let listener = TcpListener::bind(address)?;
        wait(&listener)?;
        without_delay(listener.accept()?.0)
    }

    /// A connection that sends small pieces at once.
    fn without_delay(stream: TcpStream) -> io::Result<Socket> {
        stream.set_nodelay(true)?;
        Ok(stream.into())
    }

    /// The datagrams to `address` over UDP, one after the other; an empty one is the end.
    ///
    /// # Errors
    /// The address cannot be used.
    pub fn datagrams(address: &str) -> io::Result<Input> {
        // A datagram is read at once, and bytes that do not fit are lost: there is room for the
        // longest.
        let socket = File::from(OwnedFd::from(UdpSocket::bind(address)?));
        Ok(BufReader::with_capacity(1 << 16, Awaited(socket)))
    }

    impl Read for Awaited {
        fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
            wait(&self.0)?;
            self.0.read(bytes)
        }
    }

    /// Waits for something to read from `file`, the end or an error.
    fn wait(file: &impl AsFd) -> io::Result<()> {
        if SIGNALS.get().is_none() || (!requested() && is_ready(file, PollFlags::IN, None)?) {
            return Ok(());
        }
        // The kind is not `Interrupted`: readers would try again after it.
        Err(io::Error::other("interrupted"))
    }

    /// Waits for `file`, for `longest` or until a signal. Returns whether it is ready or has
    /// failed.
    pub(super) fn is_ready(file: &impl AsFd, what: PollFlags, longest: Option<Duration>) -> io::Result<bool> {
        let longest = longest.and_then(|longest| Timespec::try_from(longest).ok());
        // A wait with a limit continues after a request.
        let woken = SIGNALS.get().map(|signals| &signals.woken).filter(|_| longest.is_none());
        loop {
            let file = PollFd::new(file, what);
            let mut awaited = match woken {
                Some(woken) => [file, PollFd::new(woken, PollFlags::IN)],
                None => [file.clone(), file],
            };
            let number = if woken.is_some() { 2 } else { 1 };
            match poll(&mut awaited[..number], longest.as_ref()) {
                Err(Errno::INTR) => {}
                Err(error) => return Err(error.into()),
                Ok(_) if !awaited[0].revents().is_empty() => return Ok(true),
                Ok(_) if longest.is_some() || requested() => return Ok(false),
                Ok(_) => {}
            }
        }
    }
}

#[cfg(not(unix))]
#[allow(missing_docs, clippy::missing_errors_doc, reason = "as on Unix")]
mod other {
    use std::fs::File;
    use std::io::{self, BufReader, Read, Write, stdin};
    use std::net::{TcpListener, TcpStream, UdpSocket};
    use std::time::Duration;

    pub type Input = BufReader<Box<dyn Read + Send>>;

    pub type Output<F> = F;

    #[derive(Debug)]
    pub struct Hold(());

    pub fn hold() -> Hold {
        Hold(())
    }

    pub fn output<F: Write>(file: F) -> Output<F> {
        file
    }

    pub fn install() {}

    pub fn listen() {}

    pub fn requested() -> bool {
        false
    }

    pub fn sleep(time: Duration) {
        std::thread::sleep(time);
    }

    pub fn input() -> io::Result<Input> {
        Ok(BufReader::new(Box::new(stdin())))
    }

    pub fn awaited(file: File) -> Input {
        BufReader::new(Box::new(file))
    }

    pub type Socket = TcpStream;

    pub fn received(socket: Socket) -> Input {
        BufReader::new(Box::new(socket))
    }

    pub fn connect(address: &str) -> io::Result<Socket> {
        without_delay(TcpStream::connect(address)?)
    }

    pub fn client(address: &str) -> io::Result<Socket> {
        without_delay(TcpListener::bind(address)?.accept()?.0)
    }

    fn without_delay(stream: TcpStream) -> io::Result<Socket> {
        stream.set_nodelay(true)?;
        Ok(stream)
    }

    pub fn datagrams(address: &str) -> io::Result<Input> {
        struct Datagrams(UdpSocket);

        impl Read for Datagrams {
            fn read(&mut self, bytes: &mut [u8]) -> io::Result<usize> {
                self.0.recv(bytes)
            }
        }

        Ok(BufReader::with_capacity(1 << 16, Box::new(Datagrams(UdpSocket::bind(address)?))))
    }
}
