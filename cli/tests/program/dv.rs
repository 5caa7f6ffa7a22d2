//! Streams of AEDAT4 packets, as `dv-processing` sends and receives them.

use std::io::{Read, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Child, Output, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use meissner_engine::{Event, Sensor};
use meissner_io::{Aedat4Writer, Format};
use serde_json::Value;

use crate::support::{argument, command, lines, meissner, meissner_reading, message};

const SENSOR: Sensor = Sensor { width: 64, height: 64 };

fn events() -> Vec<Event> {
    (0..900_i64)
        .map(|i| Event::new(i * 50, (32 + i * 7 % 29 - 14) as u16, (32 + i % 31 - 15) as u16, i % 3 > 0))
        .collect()
}

/// The stream of these events: its beginning, and packets of 100 events each.
fn stream(events: &[Event]) -> (Vec<u8>, Vec<Vec<u8>>) {
    let mut all = Vec::new();
    let mut writer = Aedat4Writer::stream(&mut all, SENSOR).expect("memory");
    let mut ends = vec![writer.length() as usize];
    for some in events.chunks(100) {
        writer.write(some).expect("memory");
        ends.push(writer.length() as usize);
    }
    (all[..ends[0]].to_vec(), ends.windows(2).map(|ends| all[ends[0]..ends[1]].to_vec()).collect())
}

fn started(arguments: &[&str]) -> Child {
    let mut command = command(arguments);
    command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command.spawn().expect("the program starts")
}

/// Stops listening at once: after `drop` alone, a process that another test is starting would keep
/// the socket open until it runs.
fn close(server: TcpListener) {
    #[cfg(unix)]
    let _ = TcpStream::from(std::os::fd::OwnedFd::from(server)).shutdown(std::net::Shutdown::Both);
    #[cfg(not(unix))]
    drop(server);
}

/// The predictions, without their run times, and the number of refused items.
fn values(output: &Output) -> (Vec<(Value, Value)>, Value) {
    let (predictions, summary) = lines(output);
    let values = predictions.iter().map(|line| (line["t_us"].clone(), line["value"].clone())).collect();
    (values, summary["lines_refused"].clone())
}

/// The predictions for these events in a file.
fn expected(events: &[Event]) -> Vec<(Value, Value)> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("events.aedat4");
    meissner_io::write(&path, Format::Aedat4, Some(SENSOR), events).expect("it can be written");
    let (values, refused) = values(&meissner(&["run", argument(&path), "--every", "5ms", "--json"]));
    assert!(values.len() >= 8 && refused == 0, "{values:?}");
    values
}

#[test]
fn a_connection_that_is_cut_comes_back_and_the_cut_is_counted() {
    let server = TcpListener::bind("127.0.0.1:0").expect("a free port");
    let address = format!("dv://{}", server.local_addr().expect("it is bound"));
    let child = started(&["run", &address, "--every", "5ms", "--json", "--reconnect", "20s"]);
    let (greeting, packets) = stream(&events());
    let mut client = server.accept().expect("it connects").0;
    client.write_all(&[&greeting[..], &packets[..4].concat(), &packets[4][..50]].concat()).expect("it reads");
    // In the middle of the fifth packet.
    drop(client);
    let mut client = server.accept().expect("it connects again").0;
    client.write_all(&greeting).expect("it reads");
    for packet in &packets[5..] {
        client.write_all(packet).expect("it reads");
    }
    let end = Instant::now();
    // No server listens from now on: the program waits for twenty seconds, or for a signal.
    close(server);
    drop(client);
    let id = child.id().to_string();
    thread::sleep(Duration::from_millis(600));
    let _ = std::process::Command::new("kill").args(["-s", "INT", &id]).status();
    let mut output = child.wait_with_output().expect("it ends");
    assert!(end.elapsed() < Duration::from_secs(10));
    assert_eq!(output.status.code(), Some(130), "{}", message(&output));
    output.status = std::process::ExitStatus::default();
    let without: Vec<_> =
        events().into_iter().enumerate().filter(|(i, _)| i / 100 != 4).map(|(_, e)| e).collect();
    assert_eq!(values(&output), (expected(&without), Value::from(1)), "{}", message(&output));
    assert!(message(&output).contains("the connection was cut"), "{}", message(&output));
}

#[test]
fn a_stream_that_is_not_connected_again_ends() {
    for reconnect in ["0s", "300ms"] {
        let server = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = format!("dv://{}", server.local_addr().expect("it is bound"));
        let child = started(&["run", &address, "--every", "5ms", "--json", "--reconnect", reconnect]);
        let (greeting, packets) = stream(&events());
        let mut client = server.accept().expect("it connects").0;
        close(server);
        client.write_all(&[greeting, packets.concat()].concat()).expect("it reads");
        drop(client);
        let output = child.wait_with_output().expect("it ends");
        assert_eq!(values(&output), (expected(&events()), Value::from(0)), "{}", message(&output));
    }
}

#[cfg(unix)]
#[test]
fn what_is_sent_over_a_local_socket_gives_the_predictions_of_the_file() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("events.aedat4");
    meissner_io::write(&path, Format::Aedat4, Some(SENSOR), &events()).expect("it can be written");
    let socket = folder.path().join("camera");
    let listen = format!("dv-listen://{}", argument(&socket));
    let sender = started(&["send", argument(&path), &listen, "--speed", "0.2"]);
    let begun = Instant::now();
    while !socket.exists() {
        assert!(begun.elapsed() < Duration::from_secs(20), "nobody listens");
        thread::sleep(Duration::from_millis(5));
    }
    let connect = format!("dv://{}", argument(&socket));
    let output = meissner(&["run", &connect, "--every", "5ms", "--json", "--reconnect", "0s"]);
    assert_eq!(values(&output), (expected(&events()), Value::from(0)), "{}", message(&output));
    let sent = sender.wait_with_output().expect("it ends");
    assert!(message(&sent).contains("900 events"), "{}", message(&sent));
    assert!(!socket.exists(), "nobody listens there any more");
}

#[test]
fn what_is_sent_is_a_header_and_packets_of_the_events() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("events.csv");
    meissner_io::write(&path, Format::Csv, Some(SENSOR), &events()).expect("it can be written");
    let address = TcpListener::bind("127.0.0.1:0").expect("a free port").local_addr().expect("it is bound");
    let sender = started(&["send", argument(&path), &format!("dv-listen://{address}"), "--speed", "10"]);
    let mut client = loop {
        match TcpStream::connect(address) {
            Ok(client) => break client,
            Err(_) => thread::sleep(Duration::from_millis(5)),
        }
    };
    let mut received = b"#!AER-DAT4.0\r\n".to_vec();
    client.read_to_end(&mut received).expect("it sends");
    assert!(sender.wait_with_output().expect("it ends").status.success());
    let recording = meissner_io::decode(&received).expect("a file that is not closed");
    assert_eq!((recording.sensor, recording.events), (Some(SENSOR), events()));

    let refused = meissner(&["send", argument(&path), "dv-listen://127.0.0.1:1", "--records"]);
    assert_eq!(refused.status.code(), Some(2), "{}", message(&refused));
    let (_folder, unknown) = crate::support::file("events.csv", "10,3,4,1\n");
    let refused = meissner(&["send", argument(&unknown), "dv-listen://127.0.0.1:1"]);
    assert!(message(&refused).contains("does not name its geometry"), "{}", message(&refused));
}

#[test]
fn a_file_of_aedat4_is_read_from_a_pipe_as_it_arrives() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("events.aedat4");
    meissner_io::write(&path, Format::Aedat4, Some(SENSOR), &events()).expect("it can be written");
    let bytes = std::fs::read(&path as &Path).expect("it was written");
    let run = ["run", "-", "--format", "aedat4", "--every", "5ms", "--json"];
    assert_eq!(values(&meissner_reading(&run, &bytes)), (expected(&events()), Value::from(0)));
    let unnamed = meissner_reading(&["run", "-"], &bytes);
    assert!(message(&unnamed).contains("--format aedat4 reads it"), "{}", message(&unnamed));
    let cut = meissner_reading(&run, &bytes[..bytes.len() / 2]);
    assert_eq!(cut.status.code(), Some(1), "{}", message(&cut));
    assert!(message(&cut).contains("cut short"), "{}", message(&cut));
    let other = meissner_reading(&run, "10,3,4,1\n20,3,4,1\n");
    assert_eq!(other.status.code(), Some(1), "{}", message(&other));
    assert!(message(&other).contains("AEDAT4: header"), "{}", message(&other));
}
