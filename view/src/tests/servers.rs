//! Clients of all kinds: a page, garbage, a hundred at once, one that never reads, half-open ones.

use std::io::{Read, Write};
use std::net::{SocketAddr, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use tungstenite::{Message, WebSocket, client::IntoClientRequest};

use meissner_engine::{Event, Sensor};

use super::frames::{json, prediction, section};
use super::{after, press, session};
use crate::frame::sections;
use crate::sensors::{Report, Sensors, State};
use crate::server::Server;
use crate::{Networks, Shipped};

fn server() -> Server {
    Server::open(0).expect("a free port")
}

fn connect(server: &Server) -> TcpStream {
    let stream = TcpStream::connect(server.address()).expect("it listens");
    stream.set_read_timeout(Some(Duration::from_secs(5))).expect("a time");
    stream
}

/// The answer to bytes.
fn ask(server: &Server, bytes: &[u8]) -> String {
    let mut stream = connect(server);
    // A server that refuses may close before everything is written.
    let _ = stream.write_all(bytes);
    let mut answer = Vec::new();
    let _ = stream.read_to_end(&mut answer);
    String::from_utf8_lossy(&answer).into_owned()
}

fn get(server: &Server, path: &str, host: &str) -> String {
    ask(server, format!("GET {path} HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes())
}

fn token(server: &Server) -> String {
    server.url().split_once("token=").expect("the address has a token").1.to_owned()
}

/// A WebSocket, or the status of the refusal.
fn page(server: &Server, origin: Option<&str>, token: &str) -> Result<WebSocket<TcpStream>, u16> {
    let address = server.address();
    let mut request =
        format!("ws://{address}/socket?token={token}").into_client_request().expect("a request");
    if let Some(origin) = origin {
        request.headers_mut().insert("Origin", origin.parse().expect("a header"));
    }
    match tungstenite::client(request, connect(server)) {
        Ok((socket, _)) => Ok(socket),
        Err(tungstenite::HandshakeError::Failure(tungstenite::Error::Http(response))) => {
            Err(response.status().as_u16())
        }
        Err(error) => panic!("{error}"),
    }
}

fn own(server: &Server) -> WebSocket<TcpStream> {
    page(server, Some(&format!("http://{}", server.address())), &token(server)).expect("a page")
}

/// The next binary message.
fn frame(socket: &mut WebSocket<TcpStream>) -> Vec<u8> {
    loop {
        if let Message::Binary(bytes) = socket.read().expect("a message") {
            return bytes.to_vec();
        }
    }
}

/// Whether `what` becomes true in a few seconds.
fn soon(mut what: impl FnMut() -> bool) -> bool {
    let deadline = Instant::now() + Duration::from_secs(8);
    while Instant::now() < deadline {
        if what() {
            return true;
        }
        thread::sleep(Duration::from_millis(5));
    }
    false
}

#[test]
fn a_page_loads_its_files_and_gets_facts_before_frames() {
    let server = server();
    let host = server.address().to_string();
    for (path, kind) in [
        (format!("/?token={}", token(&server)), "text/html"),
        ("/main.js".to_owned(), "text/javascript"),
        ("/style.css".to_owned(), "text/css"),
        ("/icon.svg".to_owned(), "image/svg+xml"),
    ] {
        let answer = get(&server, &path, &host);
        assert!(answer.starts_with("HTTP/1.1 200 OK\r\n") && answer.contains(kind), "{path}: {answer}");
        assert!(answer.contains("Content-Security-Policy: default-src 'none'"), "{path}");
    }
    let mut session = session(press(), "tactigraph-past");
    server.hub().publish(after(&mut session, r#"{"do": "seek_event", "event": 500}"#));
    server.hub().set_facts(session.facts());
    let mut socket = own(&server);
    let tags =
        |bytes: &[u8]| sections(bytes).expect("a frame").into_iter().map(|(tag, _)| tag).collect::<Vec<_>>();
    assert_eq!(tags(&frame(&mut socket)), [*b"FACT"]);
    assert!(tags(&frame(&mut socket)).contains(b"EVNT"));
    socket.send(Message::text(r#"{"do": "play"}"#)).expect("it is connected");
    let command = server.hub().command_within(Duration::from_secs(5));
    assert_eq!(command.as_deref(), Some(r#"{"do": "play"}"#));
}

#[test]
fn nobody_comes_in_with_another_host_origin_or_token() {
    let server = server();
    let (address, token) = (server.address(), token(&server));
    let path = format!("/?token={token}");
    for host in ["evil.example", "127.0.0.1", "127.0.0.1:1", "", "localhost:80@evil.example"] {
        assert!(get(&server, &path, host).starts_with("HTTP/1.1 403"), "{host}");
    }
    assert!(get(&server, &path, &format!("localhost:{}", address.port())).starts_with("HTTP/1.1 200"));
    for path in ["/", "/?token=", "/?token=0", &format!("/?token={token}0"), &format!("/?tokens={token}")] {
        assert!(get(&server, path, &address.to_string()).starts_with("HTTP/1.1 403"), "{path}");
    }
    for path in ["/../Cargo.toml", "//etc/passwd", "/nothing", "/%2e%2e/lib.rs"] {
        assert!(get(&server, path, &address.to_string()).starts_with("HTTP/1.1 404"), "{path}");
    }
    let own = format!("http://{address}");
    for origin in
        [None, Some("null"), Some("http://evil.example"), Some("https://127.0.0.1"), Some("file://")]
    {
        assert_eq!(page(&server, origin, &token).err(), Some(403), "{origin:?}");
    }
    assert_eq!(page(&server, Some(&own), "wrong").err(), Some(403));
    assert!(page(&server, Some(&own), &token).is_ok());
    assert!(server.address().ip().is_loopback());
}

#[test]
fn what_is_no_request_is_refused() {
    let server = server();
    let host = server.address();
    let twice = format!("GET / HTTP/1.1\r\nHost: {host}\r\nHost: evil.example\r\n\r\n");
    for (bytes, status) in [
        (&b"\0\x01\x02\xff\xfe\r\n\r\n"[..], 400),
        (b"GET\r\n\r\n", 400),
        (b"GET / HTTP/9.9\r\n\r\n", 400),
        (b"\x16\x03\x01\x02\0\x01\0\x01\xfc\x03\x03\r\n\r\n", 400),
        (twice.as_bytes(), 403),
        (&vec![b'a'; 20_000], 400),
        (format!("POST / HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes(), 405),
        (format!("GET /socket HTTP/1.1\r\nHost: {host}\r\n\r\n").as_bytes(), 400),
    ] {
        let answer = ask(&server, bytes);
        // A reset may discard the answer if more was sent than read.
        let refused = answer.starts_with(&format!("HTTP/1.1 {status}"));
        assert!(refused || (bytes.len() > 10_000 && answer.is_empty()), "{bytes:?}: {answer}");
    }
}

#[test]
fn a_message_that_is_too_long_or_broken_ends_its_client_alone() {
    let server = server();
    let mut good = own(&server);
    let mut long = own(&server);
    let _ = long.send(Message::text("x".repeat(1 << 20)));
    let mut broken = own(&server);
    broken.get_mut().write_all(&[0xff; 64]).expect("it is connected");
    assert!(soon(|| server.hub().clients().0 == 1), "{:?}", server.hub().clients());
    server.hub().publish(b"MSN1".to_vec());
    assert_eq!(frame(&mut good), b"MSN1");
    assert_eq!(server.hub().command(), None);
}

#[test]
fn of_a_hundred_clients_some_get_frames_and_the_others_are_refused() {
    let server = server();
    let address = server.address();
    let (origin, token) = (format!("http://{address}"), token(&server));
    let mut pages = Vec::new();
    let mut refused = 0;
    for _ in 0..100 {
        match page(&server, Some(&origin), &token) {
            Ok(socket) => pages.push(socket),
            Err(status) => {
                assert_eq!(status, 503);
                refused += 1;
            }
        }
    }
    assert_eq!((pages.len(), refused), (16, 84));
    server.hub().publish(b"MSN1".to_vec());
    for socket in &mut pages {
        assert_eq!(frame(socket), b"MSN1");
    }
    drop(pages);
    assert!(soon(|| server.hub().clients().0 == 0), "places are free again");
    drop(own(&server));
}

#[test]
fn half_open_connections_make_room_after_a_while() {
    let server = server();
    let idle: Vec<TcpStream> = (0..80).map(|_| connect(&server)).collect();
    for mut stream in &idle {
        let _ = stream.write_all(b"GET / HTTP/1.1\r\nHo");
    }
    let host = server.address().to_string();
    assert!(soon(|| get(&server, "/main.js", &host).starts_with("HTTP/1.1 200")));
}

#[test]
fn a_client_that_never_reads_keeps_nobody_waiting() {
    let server = server();
    let slow = own(&server);
    let mut quick = own(&server);
    let big = [b"MSN1".to_vec(), vec![0; 4 << 20]].concat();
    let mut longest = Duration::ZERO;
    for _ in 0..20 {
        assert!(soon(|| server.hub().wants_frame()));
        let copy = big.clone();
        let begun = Instant::now();
        server.hub().publish(copy);
        longest = longest.max(begun.elapsed());
        assert_eq!(frame(&mut quick).len(), big.len());
    }
    assert!(longest < Duration::from_millis(100), "{longest:?}");
    assert!(soon(|| server.hub().clients().0 == 1), "the slow one is given up");
    drop(slow);
}

#[test]
fn without_a_page_no_frame_is_wanted_and_after_the_end_nobody_listens() {
    let server = server();
    let address: SocketAddr = server.address();
    assert!(!server.hub().wants_frame());
    let socket = own(&server);
    assert!(soon(|| server.hub().wants_frame()));
    drop(server);
    assert!(soon(|| TcpStream::connect_timeout(&address, Duration::from_millis(100)).is_err()));
    drop(socket);
}

/// A frame after reports of twenty sensors, once this one is selected.
fn reported(socket: &mut WebSocket<TcpStream>, sensors: &mut Sensors, selected: u32) -> Vec<u8> {
    socket.get_mut().set_read_timeout(Some(Duration::from_millis(60))).expect("a time");
    for _ in 0..200 {
        for i in 0..20_u16 {
            let values = [f32::from(i), 0.5];
            let (state, dropped) = if i == 7 { (State::Behind, 3) } else { (State::Fresh, 0) };
            let report = Report { elapsed_us: 5000, values: &values, took_us: 100.0, ..Report::default() };
            sensors.report(usize::from(i), &Report { state, dropped, ..report });
        }
        if let Ok(Message::Binary(bytes)) = socket.read() {
            let mut tips = section(&bytes, "TIPS");
            if (tips.u32(), tips.u32()) == (20, selected) {
                return bytes.to_vec();
            }
        }
    }
    panic!("sensor {selected} was not selected")
}

#[test]
fn sensors_are_side_by_side_and_a_page_selects_one() {
    let server = server();
    let mut socket = own(&server);
    let named: Vec<_> = (0..20).map(|i| (format!("{i:02}.npy"), Sensor::new(34 + i, 34))).collect();
    let chosen = Shipped.load("tactigraph-past").expect("a network");
    let mut sensors = Sensors::new(server, &named, 1000, "tactigraph-past", &chosen);
    for i in 0..20_i64 {
        (0..3000).for_each(|n| sensors.event(i as usize, Event::new(n + i, 1, 2, n % 2 == 0)));
    }
    // A sensor that does not exist is ignored.
    sensors.event(20, Event::new(0, 0, 0, true));
    sensors.report(20, &Report::default());
    let facts = json(&frame(&mut socket), "FACT");
    assert_eq!((&facts["kind"], &facts["controls"]), (&"sensors".into(), &false.into()));
    assert_eq!(facts["sensors"][19], serde_json::json!({"name": "19.npy", "size": [53, 34]}));
    let first = reported(&mut socket, &mut sensors, 0);
    socket.send(Message::text(r#"{"do": "select", "sensor": 7}"#)).expect("it is connected");
    let shown = reported(&mut socket, &mut sensors, 7);
    assert_eq!(prediction(&first), [0.0_f32, 0.5].map(f32::to_bits));
    assert_eq!(prediction(&shown), [7.0_f32, 0.5].map(f32::to_bits));
    assert_eq!(json(&first, "INFO")["queue"], serde_json::json!([0, 0]));
    assert!(json(&shown, "INFO")["queue"][1].as_u64() >= Some(3));
    // Events of the newest millisecond, and a few of a sensor that is not selected.
    assert_eq!(section(&shown, "EVNT").0.len(), 1001 * 8);
    let mut tips = section(&shown, "TIPS");
    assert_eq!((tips.u32(), tips.u32(), tips.u32()), (20, 7, 2));
    for i in 0..20_u16 {
        assert_eq!(tips.u32(), u32::from(i == 7));
        assert_eq!((tips.f32(), tips.f32(), tips.f32()), (100.0, 100.0, 100.0));
        assert_eq!((tips.f64(), tips.f64() > 0.0, tips.f64()), (3000.0, i == 7, 0.0));
        assert_eq!((tips.f32(), tips.f32()), (f32::from(i), 0.5));
        let events = tips.u32();
        assert_eq!(events, 400);
        for n in (0..events).rev() {
            assert_eq!((tips.u16(), tips.u16(), tips.u32() >> 1), (1, 2, n));
        }
    }
}
