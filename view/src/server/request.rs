//! The head of a request, read with limits, and the decision about it.

use std::io::{self, Read};
use std::net::TcpStream;
use std::time::{Duration, Instant};

use tungstenite::handshake::derive_accept_key;

use super::assets;

/// Maximum bytes of a head.
const MAX_HEAD: usize = 8 << 10;
/// Maximum number of headers of a request.
const MAX_HEADERS: usize = 64;
/// Maximum time for a complete head.
const HEAD_TIME: Duration = Duration::from_secs(3);

/// The rules for accepted requests.
#[derive(Debug)]
pub(super) struct Gate {
    hosts: [String; 2],
    token: String,
}

/// The answer to a request.
#[derive(Debug, PartialEq, Eq)]
pub(super) enum Answer {
    /// A file of the page, without its content for HEAD.
    File { name: &'static str, content: &'static [u8], head: bool },
    /// A WebSocket, with the key of the answer.
    Socket { accept: String },
    /// A refusal: status and reason.
    Refused(u16, &'static str),
}

impl Gate {
    pub(super) fn new(port: u16, token: String) -> Self {
        Self { hosts: ["127.0.0.1", "localhost"].map(|host| format!("{host}:{port}")), token }
    }

    /// The answer to the request with this head.
    pub(super) fn answer(&self, head: &[u8]) -> Answer {
        let mut headers = [httparse::EMPTY_HEADER; MAX_HEADERS];
        let mut request = httparse::Request::new(&mut headers);
        if !matches!(request.parse(head), Ok(httparse::Status::Complete(_))) {
            return Answer::Refused(400, "not a request of HTTP/1.1");
        }
        let header = |name: &str| {
            let mut of = request.headers.iter().filter(|header| header.name.eq_ignore_ascii_case(name));
            let value = of.next().and_then(|header| std::str::from_utf8(header.value).ok());
            // A repeated header is refused, because two readers may use different values.
            value.filter(|_| of.next().is_none())
        };
        let has = |name: &str, word: &str| {
            header(name).is_some_and(|list| list.split(',').any(|of| of.trim().eq_ignore_ascii_case(word)))
        };
        let (method, target) = (request.method.unwrap_or_default(), request.path.unwrap_or_default());
        // A foreign name for this address does not give access to it.
        if !header("host").is_some_and(|host| self.hosts.iter().any(|own| own == host)) {
            return Answer::Refused(403, "the host is not this machine");
        }
        let (path, query) = target.split_once('?').unwrap_or((target, ""));
        let has_token =
            query.split('&').filter_map(|pair| pair.strip_prefix("token=")).any(|token| self.knows(token));
        match path {
            "/socket" => {
                let origins = self.hosts.iter().map(|host| format!("http://{host}"));
                let own = header("origin").is_some_and(|origin| origins.into_iter().any(|own| own == origin));
                if method != "GET" || !has("upgrade", "websocket") || !has("connection", "upgrade") {
                    return Answer::Refused(400, "expected a WebSocket");
                }
                if !own || !has_token {
                    return Answer::Refused(403, "the origin is not this page, or the token is wrong");
                }
                match header("sec-websocket-key") {
                    Some(key) if key.len() == 24 && header("sec-websocket-version") == Some("13") => {
                        Answer::Socket { accept: derive_accept_key(key.as_bytes()) }
                    }
                    _ => Answer::Refused(400, "expected a WebSocket of version 13"),
                }
            }
            _ if !matches!(method, "GET" | "HEAD") => Answer::Refused(405, "expected GET or HEAD"),
            "/" if !has_token => {
                Answer::Refused(403, "open the address that the program printed, with its token")
            }
            _ => match assets::file(path) {
                Some((name, content)) => Answer::File { name, content, head: method == "HEAD" },
                None => Answer::Refused(404, "no such file"),
            },
        }
    }

    /// Whether `token` is the token. The time does not depend on the number of right bytes.
    fn knows(&self, token: &str) -> bool {
        let (own, given) = (self.token.as_bytes(), token.as_bytes());
        own.len() == given.len() && own.iter().zip(given).fold(0, |odd, (a, b)| odd | (a ^ b)) == 0
    }
}

/// Reads the head of a request, and nothing after it.
///
/// # Errors
/// The head is too long or too slow, something follows it, or the connection fails.
pub(super) fn head(stream: &mut TcpStream) -> io::Result<Vec<u8>> {
    let deadline = Instant::now() + HEAD_TIME;
    let mut head = Vec::new();
    let mut part = [0; 1024];
    loop {
        let left = deadline.saturating_duration_since(Instant::now());
        if left.is_zero() {
            return Err(io::ErrorKind::TimedOut.into());
        }
        stream.set_read_timeout(Some(left))?;
        let count = stream.read(&mut part)?;
        if count == 0 {
            return Err(io::ErrorKind::UnexpectedEof.into());
        }
        head.extend_from_slice(&part[..count]);
        if head.ends_with(b"\r\n\r\n") {
            return Ok(head);
        }
        // Browsers wait for the answer before they send more.
        if head.len() > MAX_HEAD || head.windows(4).any(|end| end == b"\r\n\r\n") {
            return Err(io::ErrorKind::InvalidData.into());
        }
    }
}
