//! The signals that ask the program to end: SIGINT (Ctrl-C) and SIGTERM.
//!
//! At first, either signal ends the program at once with exit status [`STATUS`]. A subcommand that works on a stream
//! calls [`listen`] as soon as it has results to keep. From then on the first signal is a request: [`requested`]
//! returns true, and every wait in [`sleep`], for [`input`] or for an [`awaited`] file ends. The second signal ends the
//! program at once.
//!
//! On platforms other than Unix, nothing is requested, and signals have their default effect.

/// Exit status of a program that was ended by a signal.
pub const STATUS: u8 = 130;

#[cfg(not(unix))]
pub use other::{Input, awaited, client, datagrams, input, install, listen, received, requested, sleep};
#[cfg(unix)]
pub use unix::{Input, awaited, client, datagrams, input, install, listen, received, requested, sleep};

#[cfg(unix)]
mod unix {
    use std::fs::File;
    use std::io::{self, BufReader, Read, stdin};
    use std::net::{TcpListener, TcpStream, UdpSocket};
    use std::os::fd::{AsFd, OwnedFd};
    use std::os::unix::net::UnixStream;
    use std::sync::atomic::{AtomicBool, Ordering};
    use std::sync::{Arc, OnceLock};
    use std::time::Duration;

    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    use rustix::io::Errno;
    use signal_hook::consts::{SIGINT, SIGTERM};
    use signal_hook::{flag, low_level};

    use super::STATUS;

    static SIGNALS: OnceLock<Signals> = OnceLock::new();

    struct Signals {
        /// Whether a signal ends the program at once: before [`listen`], and again after the first signal that follows
        /// it.
        at_once: Arc<AtomicBool>,
        listens: AtomicBool,
        /// Readable from the first signal on, because it is never read.
        woken: UnixStream,
    }

    /// Standard input. A request ends it with an error.
    pub type Input = BufReader<Awaited>;

    /// A file that is waited for together with signals. A plain read would keep waiting after a signal.
    #[derive(Debug)]
    pub struct Awaited(File);

    /// Makes signals end the program with [`STATUS`]. If that fails, they keep their default effect.
    pub fn install() {
        let signals = || {
            let at_once = Arc::new(AtomicBool::new(true));
            let (woken, wake) = UnixStream::pair()?;
            for signal in [SIGINT, SIGTERM] {
                // In this order: the first signal sees the flag before it is set.
                flag::register_conditional_shutdown(signal, STATUS.into(), Arc::clone(&at_once))?;
                flag::register(signal, Arc::clone(&at_once))?;
                low_level::pipe::register(signal, wake.try_clone()?)?;
            }
            Ok::<_, io::Error>(Signals { at_once, listens: AtomicBool::new(false), woken })
        };
        if let Ok(signals) = signals() {
            let _ = SIGNALS.set(signals);
        }
    }

    /// Makes the first signal from now on a request.
    pub fn listen() {
        if let Some(signals) = SIGNALS.get() {
            signals.at_once.store(false, Ordering::SeqCst);
            signals.listens.store(true, Ordering::SeqCst);
        }
    }

    /// Whether a signal has asked the program to end.
    pub fn requested() -> bool {
        SIGNALS.get().is_some_and(|signals| {
            signals.listens.load(Ordering::Relaxed) && signals.at_once.load(Ordering::Relaxed)
        })
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

    /// What `stream` receives.
    pub fn received(stream: TcpStream) -> Input {
        awaited(File::from(OwnedFd::from(stream)))
    }

    /// The first connection over TCP that a client makes to `address`.
    ///
    /// # Errors
    /// The address cannot be used, or a signal asks the program to end.
    pub fn client(address: &str) -> io::Result<TcpStream> {
        let listener = TcpListener::bind(address)?;
        wait(&listener)?;
        Ok(listener.accept()?.0)
    }

    /// The datagrams to `address` over UDP, one after the other; an empty one is the end.
    ///
    /// # Errors
    /// The address cannot be used.
    pub fn datagrams(address: &str) -> io::Result<Input> {
        // A datagram is read at once, and what does not fit is lost: there is room for the longest.
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
        let Some(signals) = SIGNALS.get() else { return Ok(()) };
        loop {
            if requested() {
                // Not of the kind `Interrupted`: readers would try again after it.
                return Err(io::Error::other("interrupted"));
            }
            let mut awaited = [PollFd::new(file, PollFlags::IN), PollFd::new(&signals.woken, PollFlags::IN)];
            match poll(&mut awaited, None) {
                Err(Errno::INTR) => {}
                Err(error) => return Err(error.into()),
                Ok(_) if !awaited[0].revents().is_empty() => return Ok(()),
                Ok(_) => {}
            }
        }
    }
}

#[cfg(not(unix))]
mod other {
    use std::fs::File;
    use std::io::{self, BufReader, Read, stdin};
    use std::net::{TcpListener, TcpStream, UdpSocket};
    use std::time::Duration;

    /// Standard input or a socket.
    pub type Input = BufReader<Box<dyn Read + Send>>;

    /// Does nothing.
    pub fn install() {}

    /// Does nothing.
    pub fn listen() {}

    /// Never.
    pub fn requested() -> bool {
        false
    }

    /// Waits for `time`.
    pub fn sleep(time: Duration) {
        std::thread::sleep(time);
    }

    /// Standard input.
    ///
    /// # Errors
    /// Never.
    pub fn input() -> io::Result<Input> {
        Ok(BufReader::new(Box::new(stdin())))
    }

    /// `file`.
    pub fn awaited(file: File) -> Input {
        BufReader::new(Box::new(file))
    }

    /// What `stream` receives.
    pub fn received(stream: TcpStream) -> Input {
        BufReader::new(Box::new(stream))
    }

    /// The first connection over TCP that a client makes to `address`.
    ///
    /// # Errors
    /// The address cannot be used.
    pub fn client(address: &str) -> io::Result<TcpStream> {
        Ok(TcpListener::bind(address)?.accept()?.0)
    }

    /// The datagrams to `address` over UDP, one after the other; an empty one is the end.
    ///
    /// # Errors
    /// The address cannot be used.
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
