//! `meissner view`: the address that it prints, the page behind it, and its end.

use std::io::{Read, Write};
use std::net::TcpStream;

use crate::signals::Running;
use crate::support::{file, meissner, message};

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
fn networks_over_frames_have_the_page_too() {
    let names = (1..=24).map(|e| format!("ff_e{e}")).collect::<Vec<_>>().join(",");
    let row = ["3000"; 24].join(",");
    let (_readings, csv) = file("readings.csv", format!("{names}\n{row}\nnone\n{row}\n"));
    let (_video, raw) = file("still.rgb", vec![100; 2 * 3 * 320 * 240]);
    let (csv, raw) = (csv.to_str().expect("text"), raw.to_str().expect("text"));
    for input in [
        &[csv, "--network", "slip-lstm"][..],
        &["-", "--network", "slip-best"],
        &[raw, "--network", "canf-plain", "--video", "320x240@25"],
        &["--network", "force-lstm"],
    ] {
        let mut running = Running::new(&[&["view", "--no-browser", "--json"], input].concat());
        let url = running.line()["url"].as_str().expect("an address").to_owned();
        assert!(get(&url).contains("<title>Meissner</title>"), "{input:?}");
        running.signal("INT");
        assert_eq!(running.status().code(), Some(130), "{input:?}");
    }
}

#[test]
fn what_a_network_over_frames_does_not_read_is_refused() {
    let (_picture, small) = file("small.ppm", b"P6\n2 2\n255\n____________");
    let small = small.to_str().expect("text");
    for (arguments, status, expected) in [
        (&["--network", "canf", small][..], 1, "320x240"),
        (&["--network", "canf", "--reference", small, small], 1, "320x240"),
        (&["--network", "slip-lstm"], 2, "INPUT"),
        (&["--network", "force-lstm", "--video", "320x240"], 2, "--video"),
        (&["--reference", small], 2, "--reference"),
    ] {
        let refused = meissner(&[&["view", "--no-browser"], arguments].concat());
        assert_eq!(refused.status.code(), Some(status), "{arguments:?}: {}", message(&refused));
        assert!(message(&refused).contains(expected), "{arguments:?}: {}", message(&refused));
    }
}

#[test]
fn a_play_and_a_run_have_a_page_beside_their_output() {
    let press = concat!(env!("CARGO_MANIFEST_DIR"), "/../run/assets/dome_press.evt3");
    for arguments in [
        &["play", press, press, "--limit", "2000", "--speed", "10", "--json", "--view"][..],
        &["run", press, "--limit", "2000", "--json", "--view"],
        &["run", press, "--limit", "2000", "--network", "force-lstm", "--json", "--view"],
    ] {
        let shown = meissner(arguments);
        assert!(shown.status.success(), "{arguments:?}: {}", message(&shown));
        assert!(message(&shown).contains("page: http://127.0.0.1:"), "{arguments:?}: {}", message(&shown));
        // Nobody watches, and predictions are the same.
        let alone = meissner(&arguments[..arguments.len() - 1]);
        let values = |output: &std::process::Output| {
            let text = String::from_utf8_lossy(&output.stdout).into_owned();
            let value =
                |line: &str| serde_json::from_str::<serde_json::Value>(line).expect("JSON")["value"].clone();
            text.lines().map(value).rfind(|value| !value.is_null())
        };
        assert_eq!(values(&shown).is_some(), values(&alone).is_some());
        if arguments[0] == "run" {
            assert_eq!(values(&shown), values(&alone), "{arguments:?}");
        }
    }
    let refused = meissner(&["run", press, "--network", "canf", "--view"]);
    assert!(message(&refused).contains("--view"), "{}", message(&refused));
}

#[test]
fn a_port_that_is_taken_and_a_network_over_frames_without_input_are_refused() {
    let taken = std::net::TcpListener::bind("127.0.0.1:0").expect("a port");
    let port = taken.local_addr().expect("an address").port().to_string();
    let refused = meissner(&["view", "--no-browser", "--port", &port]);
    assert!(message(&refused).contains(&format!("--port {port}")), "{}", message(&refused));
    let refused = meissner(&["view", "--no-browser", "--network", "canf"]);
    assert!(message(&refused).contains("canf"), "{}", message(&refused));
}
