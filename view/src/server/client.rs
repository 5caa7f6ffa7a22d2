//! One connection: a file of the page, or a WebSocket with frames and commands.

use std::io::{self, ErrorKind, Read, Write};
use std::net::{Shutdown, TcpStream};
use std::time::{Duration, Instant};

use tungstenite::protocol::{Role, WebSocketConfig};
use tungstenite::{Bytes, Error, Message, WebSocket};

use super::hub::{Hub, Seen};
use super::request::{self, Answer, Gate};

/// Maximum bytes of a command.
const MAX_COMMAND: usize = 4 << 10;
/// Time within which a client must accept sent data.
const WRITE_TIME: Duration = Duration::from_secs(5);
/// Time between two pings of a client.
const PING: Duration = Duration::from_secs(5);
/// Time without an answer after which a client is dropped.
const SILENCE: Duration = Duration::from_secs(20);
/// Longest wait for a frame before a check for commands.
const FRAME_WAIT: Duration = Duration::from_millis(10);
/// Longest wait for a command before a check for frames.
const COMMAND_WAIT: Duration = Duration::from_millis(1);

/// The page may load its files and connect to this host, and nothing else.
const HEADERS: &str = "Content-Security-Policy: default-src 'none'; script-src 'self'; style-src 'self'; \
    img-src 'self' blob: data:; connect-src 'self' ws://127.0.0.1:* ws://localhost:*; worker-src 'self'; \
    base-uri 'none'; form-action 'none'; frame-ancestors 'none'\r\n\
    X-Content-Type-Options: nosniff\r\n\
    Referrer-Policy: no-referrer\r\n\
    Cross-Origin-Resource-Policy: same-origin\r\n\
    Cache-Control: no-store\r\n\
    Connection: close\r\n";

/// Serves a connection to its end.
///
/// # Errors
/// The client broke off, was too slow, or sent neither a request nor a message.
pub(super) fn serve(mut stream: TcpStream, gate: &Gate, hub: &Hub) -> io::Result<()> {
    stream.set_write_timeout(Some(WRITE_TIME))?;
    stream.set_nodelay(true)?;
    let head = match request::head(&mut stream) {
        Ok(head) => head,
        Err(error) if error.kind() == ErrorKind::InvalidData => return refuse(stream, 400, "not a request"),
        Err(error) => return Err(error),
    };
    match gate.answer(&head) {
        Answer::Refused(status, reason) => refuse(stream, status, reason),
        Answer::File { name, content, head } => {
            let kind = match name.rsplit_once('.').map_or("", |(_, kind)| kind) {
                "html" => "text/html; charset=utf-8",
                "css" => "text/css; charset=utf-8",
                "js" => "text/javascript; charset=utf-8",
                _ => "image/svg+xml",
            };
            respond(stream, "200 OK", kind, content, !head)
        }
        Answer::Socket { accept } => {
            let Some(_place) = hub.enter() else {
                return refuse(stream, 503, "too many pages are open");
            };
            let head = format!(
                "HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\n\
                 Sec-WebSocket-Accept: {accept}\r\n\r\n"
            );
            stream.write_all(head.as_bytes())?;
            stream.set_read_timeout(Some(COMMAND_WAIT))?;
            stream.set_write_timeout(Some(Duration::from_millis(100)))?;
            let config = WebSocketConfig::default()
                .max_message_size(Some(MAX_COMMAND))
                .max_frame_size(Some(MAX_COMMAND))
                .write_buffer_size(0);
            talk(WebSocket::from_raw_socket(stream, Role::Server, Some(config)), hub)
        }
    }
}

fn refuse(stream: TcpStream, status: u16, reason: &str) -> io::Result<()> {
    let word = match status {
        400 => "Bad Request",
        403 => "Forbidden",
        404 => "Not Found",
        405 => "Method Not Allowed",
        _ => "Service Unavailable",
    };
    let content = format!("{reason}\n");
    respond(stream, &format!("{status} {word}"), "text/plain; charset=utf-8", content.as_bytes(), true)
}

fn respond(mut stream: TcpStream, status: &str, kind: &str, content: &[u8], whole: bool) -> io::Result<()> {
    let length = content.len();
    write!(stream, "HTTP/1.1 {status}\r\nContent-Type: {kind}\r\nContent-Length: {length}\r\n{HEADERS}\r\n")?;
    if whole {
        stream.write_all(content)?;
    }
    stream.shutdown(Shutdown::Write)?;
    // A connection that is closed with unread bytes is reset, and the client may lose the answer.
    stream.set_read_timeout(Some(Duration::from_millis(500)))?;
    let _ = stream.read(&mut [0; 1024]);
    Ok(())
}

/// Sends frames and takes commands until either side ends.
fn talk(mut socket: WebSocket<TcpStream>, hub: &Hub) -> io::Result<()> {
    let mut seen = Seen::default();
    let (mut heard, mut asked) = (Instant::now(), Instant::now());
    while !hub.is_closed() {
        for bytes in hub.next(&mut seen, FRAME_WAIT) {
            send(&mut socket, Message::Binary(Bytes::from(bytes.to_vec())))?;
        }
        if asked.elapsed() > PING {
            asked = Instant::now();
            send(&mut socket, Message::Ping(Bytes::new()))?;
        }
        // One message per turn, so that a client that sends without pause still gets its frames.
        match socket.read() {
            Ok(Message::Text(text)) => hub.take(text.as_str().to_owned()),
            Ok(Message::Close(_)) => return Ok(()),
            Ok(_) => {}
            Err(error) if waits(&error) => {
                if heard.elapsed() > SILENCE {
                    return Err(ErrorKind::TimedOut.into());
                }
                continue;
            }
            Err(error) => return Err(io::Error::other(error)),
        }
        heard = Instant::now();
    }
    let _ = socket.close(None);
    let _ = socket.flush();
    Ok(())
}

fn waits(error: &Error) -> bool {
    matches!(error, Error::Io(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut))
}

/// Sends a complete message, or fails.
fn send(socket: &mut WebSocket<TcpStream>, message: Message) -> io::Result<()> {
    let deadline = Instant::now() + WRITE_TIME;
    let mut sent = socket.send(message);
    while let Err(error) = sent {
        if !waits(&error) || Instant::now() > deadline {
            return Err(io::Error::other(error));
        }
        sent = socket.flush();
    }
    Ok(())
}
