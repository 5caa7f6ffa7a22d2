//! The page and its frames on one port of the loopback address.
//!
//! Input: connections of browsers and of any other program on this machine. Output: the files of
//! the page by GET, and a WebSocket with frames one way and commands the other. Invariant: the
//! thread that makes frames never waits for a client, and makes no frame for which no client waits.
//!
//! Any page of a browser may open a connection to this machine. Therefore a request must name this
//! host, a WebSocket must come from this page (`Origin`), and the page and the WebSocket need a
//! random token that only the URL has. Requests, messages, clients and times are limited.

mod assets;
mod client;
mod hub;
mod request;
#[cfg(test)]
mod tests;

use std::io;
use std::net::{Ipv4Addr, SocketAddr, TcpListener, TcpStream};
use std::sync::Arc;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::thread;
use std::time::Duration;

pub use hub::Hub;

/// Maximum number of connections at a time; further ones are closed immediately.
const MAX_CONNECTIONS: usize = 64;
/// Stack of a connection's thread.
const STACK: usize = 512 << 10;

/// A server on the loopback address, until it is dropped.
#[derive(Debug)]
pub struct Server {
    address: SocketAddr,
    token: String,
    hub: Arc<Hub>,
}

impl Server {
    /// A server on `port` of 127.0.0.1; 0 is any free port.
    ///
    /// # Errors
    /// The port is in use, or the system has no random numbers.
    pub fn open(port: u16) -> io::Result<Self> {
        let listener = TcpListener::bind((Ipv4Addr::LOCALHOST, port))?;
        let address = listener.local_addr()?;
        let mut random = [0; 16];
        getrandom::fill(&mut random).map_err(|error| io::Error::other(error.to_string()))?;
        let token = format!("{:032x}", u128::from_le_bytes(random));
        let hub = Arc::new(Hub::new());
        let gate = request::Gate::new(address.port(), token.clone());
        let (open, accepting) = (Arc::new(AtomicUsize::new(0)), Arc::clone(&hub));
        thread::Builder::new().name("view: accept".to_owned()).spawn(move || {
            accept(&listener, &Arc::new(gate), &accepting, &open);
        })?;
        Ok(Self { address, token, hub })
    }

    /// The address of the socket.
    pub fn address(&self) -> SocketAddr {
        self.address
    }

    /// The address of the page, with the token.
    pub fn url(&self) -> String {
        format!("http://{}/?token={}", self.address, self.token)
    }

    /// The exchange of frames and commands.
    pub fn hub(&self) -> &Arc<Hub> {
        &self.hub
    }
}

impl Drop for Server {
    fn drop(&mut self) {
        self.hub.close();
        // This wakes the thread that waits for a connection.
        let _ = TcpStream::connect_timeout(&self.address, Duration::from_millis(200));
    }
}

fn accept(listener: &TcpListener, gate: &Arc<request::Gate>, hub: &Arc<Hub>, open: &Arc<AtomicUsize>) {
    loop {
        let accepted = listener.accept();
        if hub.is_closed() {
            return;
        }
        let Ok((stream, _)) = accepted else {
            // For example too many open files: after a while there are fewer.
            thread::sleep(Duration::from_millis(50));
            continue;
        };
        if open.fetch_add(1, Ordering::Relaxed) >= MAX_CONNECTIONS {
            open.fetch_sub(1, Ordering::Relaxed);
            continue;
        }
        let (gate, hub, closing) = (Arc::clone(gate), Arc::clone(hub), Arc::clone(open));
        let spawned =
            thread::Builder::new().name("view: client".to_owned()).stack_size(STACK).spawn(move || {
                // A client that breaks off does not affect the server.
                if let Err(error) = client::serve(stream, &gate, &hub) {
                    tracing::debug!("a client of the page: {error}");
                }
                closing.fetch_sub(1, Ordering::Relaxed);
            });
        if spawned.is_err() {
            open.fetch_sub(1, Ordering::Relaxed);
        }
    }
}
