//! Events that arrive over sockets, as text and as records of 16 bytes; recordings that are sent.

use std::io::{BufRead, BufReader, Read, Write};
use std::net::{TcpListener, TcpStream, UdpSocket};
use std::process::{Child, Output};
use std::thread;
use std::time::Duration;

use meissner_engine::Event;
use meissner_io::record;

use crate::support::{argument, command, lines, meissner, meissner_reading, message, text};

/// Events that grow out of the middle of 64 x 64 pixels.
fn events() -> Vec<Event> {
    (0..800_i64)
        .map(|i| Event::new(i * 50, (32 + i * 7 % 29 - 14) as u16, (32 + i % 31 - 15) as u16, i % 3 > 0))
        .collect()
}

fn as_text(events: &[Event]) -> Vec<u8> {
    let line = |e: &Event| format!("{},{},{},{}\n", e.t_us, e.x, e.y, u8::from(e.on));
    events.iter().map(line).collect::<String>().into_bytes()
}

fn as_records(events: &[Event]) -> Vec<u8> {
    events.iter().flat_map(|&event| record(event)).collect()
}

/// `meissner run` on this input.
fn run(input: &str) -> Vec<String> {
    ["run", input, "--sensor", "64x64", "--every", "5ms", "--json"].map(str::to_owned).to_vec()
}

fn started(arguments: &[String]) -> Child {
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let mut command = command(&arguments);
    command.stdout(std::process::Stdio::piped()).stderr(std::process::Stdio::piped());
    command.spawn().expect("the program starts")
}

/// The predictions, without their run times.
fn values(output: &Output) -> Vec<(serde_json::Value, serde_json::Value)> {
    let (predictions, _) = lines(output);
    predictions.iter().map(|line| (line["t_us"].clone(), line["value"].clone())).collect()
}

/// The predictions for the same events in a file.
fn expected() -> Vec<(serde_json::Value, serde_json::Value)> {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("events.csv");
    std::fs::write(&path, as_text(&events())).expect("it can be written");
    let arguments = run(argument(&path));
    let found = values(&meissner(&arguments.iter().map(String::as_str).collect::<Vec<_>>()));
    assert!(found.len() >= 8, "{found:?}");
    found
}

#[test]
fn records_on_standard_input_give_the_predictions_of_a_text() {
    let arguments = run("-");
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    assert_eq!(values(&meissner_reading(&arguments, &as_records(&events()))), expected());
    let mut cut = as_records(&events());
    cut.truncate(cut.len() - 3);
    let output = meissner_reading(&arguments, &cut);
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("the last record at byte 12784"), "{}", message(&output));
    let mut out_of_step = as_records(&events());
    out_of_step.remove(100);
    let output = meissner_reading(&arguments, &out_of_step);
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("end of a record"), "{}", message(&output));
}

#[test]
fn a_server_is_read_over_tcp() {
    for bytes in [as_text(&events()), as_records(&events())] {
        let server = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let child = started(&run(&format!("tcp://{}", server.local_addr().expect("it is bound"))));
        let mut client = server.accept().expect("the program connects").0;
        // In pieces that end anywhere.
        for piece in bytes.chunks(1_001) {
            client.write_all(piece).expect("the program reads");
        }
        drop(client);
        assert_eq!(values(&child.wait_with_output().expect("it ends")), expected());
    }
}

#[test]
fn a_client_is_read_over_tcp() {
    let address = free_address();
    let child = started(&run(&format!("tcp-listen://{address}")));
    let mut client = connected(&address);
    client.write_all(&as_records(&events())).expect("the program reads");
    drop(client);
    assert_eq!(values(&child.wait_with_output().expect("it ends")), expected());
}

#[test]
fn datagrams_are_read_until_an_empty_one() {
    for form in [as_text, as_records] {
        let address = free_address();
        let child = started(&run(&format!("udp://{address}")));
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        socket.connect(&address).expect("an address");
        let whole: Vec<Vec<u8>> = events().chunks(80).map(form).collect();
        // Nobody listens before the program starts: a system that knows this refuses the next send.
        while socket.send(&whole[0]).is_err() || {
            thread::sleep(Duration::from_millis(20));
            socket.take_error().expect("a socket").is_some()
        } {}
        for piece in &whole[1..] {
            socket.send(piece).expect("the program reads");
        }
        socket.send(&[]).expect("the program reads");
        assert_eq!(values(&child.wait_with_output().expect("it ends")), expected());
    }
}

/// A connection to a server that is about to start.
pub(crate) fn connected(address: &str) -> TcpStream {
    loop {
        match TcpStream::connect(address) {
            Ok(client) => return client,
            Err(_) => thread::sleep(Duration::from_millis(5)),
        }
    }
}

/// An address that was free a moment ago.
pub(crate) fn free_address() -> String {
    let found = TcpListener::bind("127.0.0.1:0").expect("a free port").local_addr();
    found.expect("it is bound").to_string()
}

#[test]
fn a_recording_is_sent_as_text_and_as_records_at_its_speed() {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().join("events.csv");
    let stated = [b"# sensor 64x64\n".to_vec(), as_text(&events())].concat();
    std::fs::write(&path, &stated).expect("it can be written");
    for (more, expected) in [(&[][..], stated), (&["--records"], as_records(&events()))] {
        let server = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let address = format!("tcp://{}", server.local_addr().expect("it is bound"));
        let receiver = thread::spawn(move || {
            let mut found = Vec::new();
            server.accept().expect("the program connects").0.read_to_end(&mut found).expect("it sends");
            found
        });
        let begun = std::time::Instant::now();
        let output = meissner(&[&["send", argument(&path), &address, "--speed", "0.5"], more].concat());
        assert!(message(&output).contains("800 events"), "{}", message(&output));
        assert!(begun.elapsed() >= Duration::from_micros(799 * 100), "at half speed");
        assert!(receiver.join().expect("it received") == expected);
        let printed = meissner(&[&["send", argument(&path), "-", "--speed", "1000"], more].concat());
        assert!(printed.stdout == expected && text(&printed).is_ascii() || more.len() == 1);
    }
}

#[test]
fn a_stream_that_cannot_be_opened_is_named() {
    let refused = meissner(&["run", "udp://256.0.0.1:1", "--sensor", "8x8"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(message(&refused).contains("udp://256.0.0.1:1"), "{}", message(&refused));
    let refused = meissner(&["send", "-", "http://x"]);
    assert_eq!(refused.status.code(), Some(1));
    assert!(message(&refused).contains("expected -, or HOST:PORT after tcp://"), "{}", message(&refused));
}

#[test]
fn a_play_of_what_arrives_reports_while_the_sender_lives_and_ends_as_a_run_does() {
    let address = free_address();
    let mut child = started(
        &["play", &format!("tcp-listen://{address}"), "--sensor", "64x64", "--overload", "block"]
            .into_iter()
            .chain(["--report-every", "2ms", "--deadline", "1s", "--verify", "--json"])
            .map(str::to_owned)
            .collect::<Vec<_>>(),
    );
    let mut client = connected(&address);
    let all = as_records(&events());
    let (first, rest) = all.split_at(400 * 16);
    client.write_all(first).expect("the program reads");
    // The sender is silent, and the reports continue.
    let mut out = BufReader::new(child.stdout.take().expect("it is piped"));
    let mut said = String::new();
    while said.lines().filter(|line| line.contains("\"at_us\"")).count() < 20 {
        assert!(out.read_line(&mut said).expect("it is text") > 0, "{said}");
    }
    client.write_all(rest).expect("the program reads");
    drop(client);
    out.read_to_string(&mut said).expect("it is text");
    assert!(child.wait().expect("it ends").success());
    let lines: Vec<serde_json::Value> =
        said.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect();
    let (summary, reports) = (&lines[lines.len() - 1]["summary"], &lines[1..lines.len() - 1]);
    assert_eq!([&summary["events"], &summary["accepted"]], [800, 800], "{summary}");
    assert_eq!(summary["reports"]["due"], reports.len(), "{summary}");
    assert_eq!(summary["verified"]["equal"], true);
    let last = expected().pop().expect("there are predictions");
    assert_eq!(summary["final"]["t_us"], last.0);
    assert_eq!(summary["final"]["value"], last.1);
}

#[test]
fn a_play_takes_no_more_than_its_limit_from_a_stream() {
    let play = ["play", "-", "--sensor", "64x64", "--limit", "100", "--report-every", "1ms", "--json"];
    let (_, summary) = lines(&meissner_reading(&play, &as_text(&events())));
    assert_eq!([&summary["events"], &summary["offered"]], [100, 100], "{summary}");
    let (reports, summary) = lines(&meissner_reading(&play, b""));
    assert!(reports.is_empty() && summary["events"] == 0, "{summary}");
}

/// The output of `meissner run` for these datagrams, followed by the empty one, with the arguments
/// `more`.
fn of_datagrams(datagrams: &[Vec<u8>], more: &[&str]) -> Output {
    let address = free_address();
    let arguments = ["run", &format!("udp://{address}"), "--every", "event", "--json"];
    let more = more.iter().copied().chain(["--sensor", "64x64"]);
    let child = started(&arguments.into_iter().chain(more).map(str::to_owned).collect::<Vec<_>>());
    let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
    socket.connect(&address).expect("an address");
    // A blank line is not an event. A system that knows that nobody listens refuses the next send.
    while socket.send(b"\n").is_err() || {
        thread::sleep(Duration::from_millis(20));
        socket.take_error().expect("a socket").is_some()
    } {}
    for datagram in datagrams {
        socket.send(datagram).expect("the program reads");
    }
    socket.send(&[]).expect("the program reads");
    child.wait_with_output().expect("it ends")
}

/// The times of the accepted events, and the number of refused items.
fn taken(output: &Output) -> (Vec<Option<i64>>, u64) {
    let (predictions, summary) = lines(output);
    let times = predictions.iter().map(|line| line["t_us"].as_i64()).collect();
    (times, summary["lines_refused"].as_u64().expect("a count"))
}

#[test]
fn a_datagram_of_records_that_is_not_whole_is_counted_and_the_others_stand_alone() {
    let record = |t_us| record(Event::new(t_us, 3, 4, false)).to_vec();
    let times = |times: &[i64]| times.iter().copied().map(Some).collect::<Vec<_>>();
    for odd in [vec![7], vec![0; 5], record(1 << 20)[..10].to_vec(), vec![0xff; 16], vec![0xff; 3]] {
        let datagrams = [record(10), odd.clone(), [record(20), record(30)].concat(), record(40)];
        assert_eq!(taken(&of_datagrams(&datagrams, &[])), (times(&[10, 20, 30, 40]), 1), "{odd:?}");
    }
    // One byte too many before, between or after records: its position cannot be known.
    for at in [0, 16, 32] {
        let mut shifted = [record(20), record(30)].concat();
        shifted.insert(at, 0);
        let datagrams = [record(10), shifted, record(40)];
        assert_eq!(taken(&of_datagrams(&datagrams, &[])), (times(&[10, 40]), 1), "a byte at {at}");
    }
    // A record that is not an event does not affect the records beside it.
    let datagrams = [[record(10), vec![0xff; 16], record(20)].concat()];
    assert_eq!(taken(&of_datagrams(&datagrams, &[])), (times(&[10, 20]), 1));
}

#[test]
fn a_line_does_not_go_on_in_the_next_datagram_and_a_long_one_is_counted() {
    let times = |times: &[i64]| times.iter().copied().map(Some).collect::<Vec<_>>();
    let datagram = |text: &str| text.as_bytes().to_vec();
    for (texts, expected, refused) in [
        (vec!["10,3,4,1\n", "1", "20,3,4,1\n"], times(&[10, 20]), 1),
        // Also before there was an event, and with the header in a separate datagram.
        (vec!["1", "t,x,y,p\n", "20,3,4,1\n30,3,4,1"], times(&[20, 30]), 1),
        (vec!["x,y,p,t\n3,4,1,10\n", "3,4,", "3,4,1,20\n"], times(&[10, 20]), 1),
        (vec!["10,3,4,1\n", &"9".repeat(5_000), "20,3,4,1\n"], times(&[10, 20]), 1),
        (vec![&("9".repeat(60_000) + "\n10,3,4,1\n"), "20,3,4,1\n"], times(&[10, 20]), 1),
        (vec!["%PDF-1.7 or so\n", "#!AER-DAT2.0\n", "10,3,4,1\n"], times(&[10]), 1),
    ] {
        let datagrams: Vec<Vec<u8>> = texts.iter().map(|text| datagram(text)).collect();
        let output = of_datagrams(&datagrams, &[]);
        assert_eq!(taken(&output), (expected, refused), "{texts:?}: {}", message(&output));
        assert!(message(&output).contains("datagram "), "{}", message(&output));
    }
}

#[test]
fn any_number_of_datagrams_may_be_no_events_but_none_with_strict() {
    let (bad, good) = (b"oh no\n".to_vec(), b"10,3,4,1\n".to_vec());
    let mut datagrams = vec![bad.clone(); 150];
    datagrams.push(good.clone());
    assert_eq!(taken(&of_datagrams(&datagrams, &[])), (vec![Some(10)], 150));
    let output = of_datagrams(&[good, bad], &["--strict"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(message(&output).contains("datagram 3"), "{}", message(&output));
}

#[test]
fn a_socket_that_waits_for_the_name_of_the_sensor_says_so() {
    let address = free_address();
    let child =
        started(&["run".to_owned(), format!("tcp-listen://{address}"), "--every".into(), "event".into()]);
    let mut client = connected(&address);
    client.write_all(b"# sensor 64x64\n10,3,4,1\n").expect("the program reads");
    drop(client);
    let output = child.wait_with_output().expect("it ends");
    let said = message(&output);
    assert!(
        output.status.success() && said.contains("waits for the first event") && said.contains("--sensor"),
        "{said}"
    );
}

/// The events as the raw bytes of EVT3, with a header or without.
fn as_evt3(header: bool) -> Vec<u8> {
    let mut bytes = Vec::new();
    let sensor = Some(meissner_engine::Sensor::new(64, 64));
    meissner_io::encode(meissner_io::Format::Evt3, sensor, &events(), &mut bytes).expect("they fit");
    let end = bytes.windows(6).position(|window| window == b"% end\n").expect("a header") + 6;
    bytes.split_off(if header { 0 } else { end })
}

#[test]
fn raw_bytes_of_a_sensor_give_the_predictions_of_a_text_from_a_pipe_a_socket_and_datagrams() {
    let with = |input: &str| [run(input), vec!["--format".to_owned(), "evt3".to_owned()]].concat();
    for bytes in [as_evt3(true), as_evt3(false)] {
        let arguments = with("-");
        let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
        assert_eq!(values(&meissner_reading(&arguments, &bytes)), expected());

        let server = TcpListener::bind("127.0.0.1:0").expect("a free port");
        let child = started(&with(&format!("tcp://{}", server.local_addr().expect("it is bound"))));
        let mut client = server.accept().expect("the program connects").0;
        bytes.chunks(333).for_each(|piece| client.write_all(piece).expect("the program reads"));
        drop(client);
        assert_eq!(values(&child.wait_with_output().expect("it ends")), expected());

        let address = free_address();
        let child = started(&with(&format!("udp://{address}")));
        let socket = UdpSocket::bind("127.0.0.1:0").expect("a free port");
        socket.connect(&address).expect("an address");
        let mut pieces = bytes.chunks(1_400);
        let first = pieces.next().expect("there are events");
        while socket.send(first).is_err() || {
            thread::sleep(Duration::from_millis(20));
            socket.take_error().expect("a socket").is_some()
        } {}
        for piece in pieces {
            socket.send(piece).expect("the program reads");
        }
        socket.send(&[]).expect("the program reads");
        assert_eq!(values(&child.wait_with_output().expect("it ends")), expected());
    }
}

#[test]
fn lost_bytes_of_a_raw_stream_are_counted_and_the_stream_goes_on() {
    let mut bytes = as_evt3(false);
    let whole = bytes.len();
    for at in [2 * whole / 3, whole / 3] {
        bytes.remove(at);
    }
    let arguments = run("-");
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).chain(["--format", "evt3"]).collect();
    let output = meissner_reading(&arguments, &bytes);
    let (predictions, summary) = lines(&output);
    assert_eq!(summary["lines_refused"], 2, "{}", message(&output));
    assert!(message(&output).contains("EVT3: bytes were lost before byte"), "{}", message(&output));
    assert!(predictions.len() > 6, "{}", predictions.len());
    let strict = meissner_reading(&[&arguments[..], &["--strict"]].concat(), &bytes);
    assert_eq!(strict.status.code(), Some(1));
    let refused = meissner_reading(&["run", "-", "--sensor", "64x64", "--format", "npy"], &bytes);
    assert!(message(&refused).contains("expected AEDAT4, EVT2, EVT2.1 or EVT3"), "{}", message(&refused));
    // A named text is refused if most of its lines are not events.
    let lines = "no event\n".repeat(200);
    let refused = meissner_reading(&["run", "-", "--sensor", "64x64", "--format", "csv"], &lines);
    assert_eq!(refused.status.code(), Some(1), "{}", message(&refused));
}
