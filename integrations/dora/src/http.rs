//! A server of one page, for a collector of metrics in the same network.
//!
//! One request at a time, of a bounded length and time; whatever else is asked than `GET /metrics` is answered with 404.

use std::io::{self, Read, Write};
use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

/// Longest request.
const LONGEST: usize = 8192;

/// Longest wait for a part of a request, or for the reader of an answer.
const PATIENCE: Duration = Duration::from_secs(1);

/// Serves `page` at `address` in a thread of its own, for as long as the process lives.
///
/// # Errors
/// The address cannot be used.
pub(crate) fn serve(
    address: &str,
    page: impl Fn() -> String + Send + 'static,
) -> io::Result<std::net::SocketAddr> {
    let listener = TcpListener::bind(address)?;
    let bound = listener.local_addr()?;
    thread::spawn(move || {
        for client in listener.incoming().flatten() {
            // A client that has gone gets no answer; the next one is served.
            let _ = answer(client, &page);
        }
    });
    Ok(bound)
}

fn answer(mut client: TcpStream, page: impl Fn() -> String) -> io::Result<()> {
    client.set_read_timeout(Some(PATIENCE))?;
    client.set_write_timeout(Some(PATIENCE))?;
    let mut request = Vec::new();
    let mut part = [0; 1024];
    let began = Instant::now();
    let is_whole = |request: &[u8]| request.windows(4).any(|end| end == b"\r\n\r\n");
    while !is_whole(&request) && request.len() < LONGEST && began.elapsed() < PATIENCE {
        match client.read(&mut part)? {
            0 => break,
            length => request.extend_from_slice(&part[..length]),
        }
    }
    let asked = request.starts_with(b"GET /metrics ") || request.starts_with(b"GET /metrics?");
    let (status, body) = if asked { ("200 OK", page()) } else { ("404 Not Found", String::new()) };
    // The type that OpenMetrics has: the text ends with its mark.
    let kind = "application/openmetrics-text; version=1.0.0; charset=utf-8";
    let length = body.len();
    let head = format!(
        "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\nConnection: close\r\n\r\n"
    );
    client.write_all(head.as_bytes())?;
    client.write_all(body.as_bytes())
}

#[cfg(test)]
mod tests {
    use std::io::{Read, Write};
    use std::net::TcpStream;

    use super::serve;

    fn ask(address: std::net::SocketAddr, request: &[u8]) -> String {
        let mut client = TcpStream::connect(address).unwrap();
        client.write_all(request).unwrap();
        let mut answer = String::new();
        client.read_to_string(&mut answer).unwrap();
        answer
    }

    #[test]
    fn the_page_is_served_and_nothing_else() {
        let address = serve("127.0.0.1:0", || "text".to_owned()).unwrap();
        let answer = ask(address, b"GET /metrics HTTP/1.1\r\nHost: x\r\n\r\n");
        assert!(answer.starts_with("HTTP/1.1 200 OK\r\n") && answer.ends_with("\r\n\r\ntext"), "{answer}");
        for request in [&b"GET / HTTP/1.1\r\n\r\n"[..], b"\r\n\r\n", b"POST /metrics HTTP/1.1\r\n\r\n"] {
            assert!(ask(address, request).starts_with("HTTP/1.1 404 "));
        }
        // One that says nothing does not keep the others waiting for ever.
        let _silent = TcpStream::connect(address).unwrap();
        assert!(ask(address, b"GET /metrics HTTP/1.1\r\n\r\n").ends_with("text"));
    }
}
