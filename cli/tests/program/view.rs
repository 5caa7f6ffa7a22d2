//! `meissner view`: the address that it prints, the page behind it, and its end.

use std::io::{Read, Write};
use std::net::TcpStream;

use crate::signals::Running;
use crate::support::{meissner, message};

/// The answer to a request of the path and query of `url`.
fn get(url: &str) -> String {
    let rest = url.strip_prefix("http://").expect("an address");
    let (host, path) = rest.split_once('/').expect("a path");
    let mut stream = TcpStream::connect(host).expect("it listens");
    write!(stream, "GET /{path} HTTP/1.1\r\nHost: {host}\r\n\r\n").expect("it reads");
    let mut answer = String::new();
    stream.read_to_string(&mut answer).expect("text");
    answer
}

#[test]
fn it_prints_the_address_of_a_page_and_a_signal_ends_it() {
    for input in [&[][..], &["-", "--sensor", "8x8"]] {
        let arguments = [&["view", "--no-browser", "--json"], input].concat();
        let mut running = Running::new(&arguments);
        let url = running.line()["url"].as_str().expect("an address").to_owned();
        assert!(url.starts_with("http://127.0.0.1:"), "{url}");
        assert!(get(&url).contains("<title>Meissner</title>"));
        running.signal("INT");
        assert_eq!(running.status().code(), Some(130));
    }
}

#[test]
fn a_port_that_is_taken_and_a_network_over_frames_are_refused() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = taken.local_addr().expect("an address").port().to_string();
    let refused = meissner(&["view", "--no-browser", "--port", &port]);
    assert!(message(&refused).contains(&format!("--port {port}")), "{}", message(&refused));
    let refused = meissner(&["view", "--no-browser", "--network", "canf"]);
    assert!(message(&refused).contains("canf"), "{}", message(&refused));
}
