//! The node with a camera on another implementation of DDS, Eclipse Cyclone DDS, in a network
//! namespace with only a loopback interface.
//!
//! `MEISSNER_CYCLONE` names a Python that has the package `cyclonedds`; `.ci/ros2` installs one.
//! Without it, or if no namespace can be made, these tests print their names and test nothing; with
//! `MEISSNER_REQUIRE_CYCLONE=1` they fail.

use std::io::{BufRead, BufReader, Write};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use meissner_engine::{Engine, Event, Network, Sensor};
use meissner_io::{Format, ReadOptions, encode};
use meissner_run::model::Model;
use meissner_run::source::Source;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::{Value, json};

/// Longest wait for another process, because test machines may be busy.
const PATIENCE: Duration = Duration::from_mins(1);
/// Sets the interface up, and holds the namespace.
const NETWORK: &str = "ip link set lo up && ip link set lo multicast on && ip route add 224.0.0.0/4 dev lo && echo up && exec sleep 600";
const CYCLONE: &str = r#"<CycloneDDS><Domain id="any"><General><Interfaces><NetworkInterface name="lo" multicast="true"/></Interfaces></General></Domain></CycloneDDS>"#;

/// A process and its output lines.
struct Process {
    child: Child,
    lines: Receiver<String>,
    /// Whether the lines come from its standard error; its standard output is then its final
    /// output.
    is_err: bool,
}

impl Process {
    fn start(command: &mut Command, is_err: bool) -> Self {
        command.stdin(Stdio::piped()).stdout(Stdio::piped());
        if is_err {
            command.stderr(Stdio::piped());
        }
        let mut child = command.spawn().expect("the program starts");
        let (sender, lines) = channel();
        let read = |pipe: Box<dyn std::io::Read + Send>| {
            let (lines, sender) = (BufReader::new(pipe).lines(), sender.clone());
            thread::spawn(move || lines.map_while(Result::ok).try_for_each(|line| sender.send(line)));
        };
        if is_err {
            read(Box::new(child.stderr.take().expect("it is piped")));
        } else {
            read(Box::new(child.stdout.take().expect("it is piped")));
        }
        Self { child, lines, is_err }
    }

    /// The next line that contains `text`.
    fn line(&self, text: &str) -> String {
        let until = Instant::now() + PATIENCE;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let line =
                self.lines.recv_timeout(left).unwrap_or_else(|_| panic!("expected a line with {text:?}"));
            if line.contains(text) {
                return line;
            }
        }
    }

    fn order(&mut self, order: &str) {
        writeln!(self.child.stdin.as_mut().expect("it is piped"), "{order}").expect("it reads");
    }

    fn signal(&self, signal: Signal) {
        kill_process(Pid::from_raw(self.child.id() as i32).expect("a process"), signal).expect("it is there");
    }

    /// Ends it by a signal; returns its final output.
    fn summary(mut self) -> Value {
        assert!(self.is_err);
        self.signal(Signal::INT);
        let out = self.child.stdout.take().expect("it is piped");
        assert!(self.child.wait().expect("it ends").success());
        serde_json::from_reader(out).expect("JSON")
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// A separate network with only a loopback interface.
struct Loopback(Process);

impl Loopback {
    /// `None` if the test cannot run here; prints its name then.
    fn new() -> Option<(Self, PathBuf)> {
        let python = std::env::var_os("MEISSNER_CYCLONE").map(PathBuf::from);
        let Some(python) = python else {
            assert!(std::env::var_os("MEISSNER_REQUIRE_CYCLONE").is_none(), "expected MEISSNER_CYCLONE");
            eprintln!("skipped: no MEISSNER_CYCLONE");
            return None;
        };
        let mut holder = Command::new("unshare");
        // Without root, a separate user namespace has the right.
        holder.args(["--map-root-user", "--net", "sh", "-c", NETWORK]);
        let holder = Process::start(&mut holder, false);
        holder.line("up");
        Some((Self(holder), python))
    }

    fn command(&self, program: impl AsRef<std::ffi::OsStr>) -> Command {
        let mut command = Command::new("nsenter");
        let target = self.0.child.id().to_string();
        command.args(["--preserve-credentials", "--user", "--net", "--target", &target]).arg(program);
        command.env("CYCLONEDDS_URI", CYCLONE);
        command
    }

    fn node(&self, arguments: &[&str]) -> Process {
        let mut command = self.command(env!("CARGO_BIN_EXE_meissner-ros2"));
        command.args(["--interface", "127.0.0.1"]).args(arguments).env_remove("ROS_DOMAIN_ID");
        let node = Process::start(&mut command, true);
        node.line("ready");
        node
    }

    fn camera(
        &self,
        python: &Path,
        packets: &Path,
        reliability: &str,
        period_ms: &str,
        kind: &str,
    ) -> Process {
        let mut command = self.command(python);
        command.arg(concat!(env!("CARGO_MANIFEST_DIR"), "/tests/camera.py")).arg(packets);
        command.args([reliability, period_ms, kind]);
        let camera = Process::start(&mut command, false);
        camera.line("matched");
        camera
    }
}

fn network(name: &str) -> Network {
    Model::named(name, None, false).expect("a shipped network").network
}

fn embedded() -> (Sensor, Vec<Event>) {
    let source = Source::open(None, &ReadOptions::default(), false, true).expect("it is embedded");
    let sensor = source.sensor(None).expect("it names it");
    (sensor, source.map(|event| event.expect("a good recording")).collect())
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for group in bytes.chunks(3) {
        let bits = group.iter().fold(0, |bits, &byte| bits << 8 | u32::from(byte)) << (8 * (3 - group.len()));
        for digit in 0..4 {
            let value = (bits >> (18 - 6 * digit)) as usize & 63;
            text.push(if digit <= group.len() { char::from(DIGITS[value]) } else { '=' });
        }
    }
    text
}

/// The words of these events; each packet states time and row again.
fn evt3(sensor: Sensor, events: &[Event]) -> Vec<u8> {
    let mut bytes = Vec::new();
    encode(Format::Evt3, Some(sensor), events, &mut bytes).expect("events that EVT3 can hold");
    let end = b"% end\n";
    let header = bytes.windows(end.len()).position(|window| window == end).expect("a header");
    bytes.split_off(header + end.len())
}

fn mono(events: &[Event], base_us: i64) -> Vec<u8> {
    let bits = |e: &Event| {
        u64::from(e.on) << 63
            | u64::from(e.y) << 48
            | u64::from(e.x) << 32
            | ((e.t_us - base_us) as u64 * 1000)
    };
    events.iter().flat_map(|event| bits(event).to_le_bytes()).collect()
}

/// Packets of these events: `lengths` are their numbers of events, in turn. Packets in `left_out`
/// are not in the list.
fn packets(
    encoding: &str,
    sensor: Sensor,
    events: &[Event],
    lengths: &[usize],
    left_out: &[usize],
) -> (Value, Vec<Vec<Event>>) {
    let (mut rest, mut parts) = (events, Vec::new());
    for &length in lengths.iter().cycle() {
        let (part, later) = rest.split_at(length.min(rest.len()));
        parts.push(part.to_vec());
        rest = later;
        if rest.is_empty() {
            break;
        }
    }
    let packet = |(seq, part): (usize, &Vec<Event>)| {
        let base_us = part.first().map_or(0, |event| event.t_us);
        let bytes = if encoding == "evt3" { evt3(sensor, part) } else { mono(part, base_us) };
        json!({
            "seq": seq, "width": sensor.width, "height": sensor.height, "encoding": encoding, "is_bigendian": false,
            "time_base": base_us * 1000, "events": base64(&bytes),
        })
    };
    let numbered = parts.iter().enumerate().filter(|(seq, _)| !left_out.contains(seq));
    (numbered.map(packet).collect(), parts)
}

fn saved(packets: &Value) -> tempfile::NamedTempFile {
    let mut file = tempfile::NamedTempFile::new().expect("a file");
    write!(file, "{packets}").expect("it can be written");
    file
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

fn values(prediction: &Value) -> Vec<u32> {
    let values = prediction["values"].as_array().expect("values").iter();
    let exact = |value: &Value| {
        let value = f64::from_bits(value.as_u64().expect("bits"));
        assert_eq!(f64::from(value as f32).to_bits(), value.to_bits());
        value as f32
    };
    bits(&values.map(exact).collect::<Vec<_>>())
}

fn number(of: &Value, key: &str) -> u64 {
    of[key].as_u64().unwrap_or_else(|| panic!("expected a count {key} in {of}"))
}

/// Runs node and camera up to the prediction for packet `last_seq`; the predictions in order, and
/// the summary. When the camera waits for the first time, the node is stopped until the camera
/// waits again.
fn run(node: Process, mut camera: Process, last_seq: usize) -> (Vec<Value>, Value) {
    node.line("connected");
    camera.order("go");
    let (mut predictions, mut waits): (Vec<Value>, _) = (Vec::new(), 0);
    while let Ok(line) = camera.lines.recv_timeout(PATIENCE) {
        let line: Value = serde_json::from_str(&line).expect("JSON");
        if line.get("waiting").is_some() {
            waits += 1;
            node.signal(if waits == 1 { Signal::STOP } else { Signal::CONT });
            if waits > 1 {
                // The node takes the packets that the operating system has kept before the camera
                // continues.
                thread::sleep(Duration::from_secs(1));
            }
            camera.order("on");
            continue;
        }
        let is_last = line["seq"] == last_seq;
        predictions.push(line);
        if is_last {
            break;
        }
    }
    drop(camera);
    (predictions, node.summary())
}

/// Compares with one process that takes only the arrived packets.
fn compare(predictions: &[Value], parts: &[Vec<Event>], sensor: Sensor) {
    let mut engine = Engine::new(network("tactigraph-past"), sensor).expect("the sensor fits");
    for prediction in predictions {
        let seq = number(prediction, "seq") as usize;
        engine.push_slice(&parts[seq]);
        let mut expected = bits(engine.predict().expect("a number").values);
        expected.push(0);
        assert_eq!(values(prediction), expected, "packet {seq}");
    }
}

/// Packets of a few events, and of more than 64 KB, which DDS sends in fragments.
const LENGTHS: &[usize] = &[1, 100, 0, 700, 20_000, 3, 2000];

#[test]
fn best_effort_packets_give_the_predictions_of_one_process_and_gaps_are_counted() {
    let Some((loopback, python)) = Loopback::new() else { return };
    let (sensor, events) = embedded();
    let left_out = [2, 5, 6];
    let (packets, parts) = packets("evt3", sensor, &events, LENGTHS, &left_out);
    let largest = parts.iter().map(|part| evt3(sensor, part).len()).max();
    assert!(largest > Some(65_536), "{largest:?}");
    let file = saved(&packets);
    let node = loopback.node(&[]);
    let camera = loopback.camera(&python, file.path(), "best_effort", "20", "vector");
    let (predictions, summary) = run(node, camera, parts.len() - 1);
    assert_eq!(predictions.len() as u64, number(&summary, "predictions"), "{summary}");
    assert_eq!(
        number(&summary, "packets") + number(&summary, "packets_lost"),
        parts.len() as u64,
        "{summary}"
    );
    assert_eq!(number(&summary, "packets_lost"), left_out.len() as u64, "{summary}");
    assert_eq!((number(&summary, "streams"), number(&summary, "packets_refused")), (1, 0));
    compare(&predictions, &parts, sensor);
}

#[test]
fn reliable_packets_all_arrive() {
    let Some((loopback, python)) = Loopback::new() else { return };
    let (sensor, events) = embedded();
    let (packets, parts) = packets("mono", sensor, &events, LENGTHS, &[]);
    let file = saved(&packets);
    let node = loopback.node(&["--reliable"]);
    let camera = loopback.camera(&python, file.path(), "reliable", "2", "vector");
    let (predictions, summary) = run(node, camera, parts.len() - 1);
    let seqs: Vec<u64> = predictions.iter().map(|prediction| number(prediction, "seq")).collect();
    assert_eq!(seqs, (0..parts.len() as u64).collect::<Vec<_>>());
    assert_eq!(
        (number(&summary, "packets_lost"), number(&summary, "events")),
        (0, events.len() as u64),
        "{summary}"
    );
    compare(&predictions, &parts, sensor);
}

#[test]
#[ignore = "RustDDS 0.15.1 ends its threads where SIGCONT interrupts their poll"]
fn a_node_that_stands_still_loses_packets_counts_them_and_predicts_from_the_others() {
    let Some((loopback, python)) = Loopback::new() else { return };
    let (sensor, events) = embedded();
    let (mut packets, parts) = packets("mono", sensor, &events, &[40], &[]);
    // Between the two, more packets come than the operating system keeps for a process.
    packets[30]["waits"] = true.into();
    packets[parts.len() - 20]["waits"] = true.into();
    let file = saved(&packets);
    let node = loopback.node(&["--depth", "8"]);
    let camera = loopback.camera(&python, file.path(), "best_effort", "0.2", "vector");
    let (predictions, summary) = run(node, camera, parts.len() - 1);
    let (taken, lost) = (number(&summary, "packets"), number(&summary, "packets_lost"));
    assert!(taken > 0 && lost > 0, "{summary}");
    let seq = |prediction: Option<&Value>| number(prediction.expect("predictions"), "seq");
    let (first, last) = (seq(predictions.first()), seq(predictions.last()));
    assert_eq!(taken + lost, last - first + 1, "{summary}");
    assert_eq!(predictions.len() as u64, taken, "{summary}");
    compare(&predictions, &parts, sensor);
}

#[test]
fn what_is_no_packet_is_refused_and_a_network_of_many_values_sends_arrays() {
    let Some((loopback, python)) = Loopback::new() else { return };
    let (sensor, events) = embedded();
    let part = &events[..50];
    let good = |seq: u64, encoding: &str, width: u32, bytes: &[u8]| {
        json!({
            "seq": seq, "width": width, "height": sensor.height, "encoding": encoding, "is_bigendian": false,
            "time_base": 0, "events": base64(bytes),
        })
    };
    let width = u32::from(sensor.width);
    let bytes = mono(part, 0);
    let packets = json!([
        good(0, "trigger", width, &bytes),
        good(1, "mono", 0, &bytes),
        good(2, "mono", 70_000, &bytes),
        good(3, "mono", width, &bytes[..13]),
        good(4, "mono", width, &bytes),
    ]);
    let file = saved(&packets);
    let node = loopback.node(&["digits-past"]);
    let mut camera = loopback.camera(&python, file.path(), "best_effort", "20", "array");
    node.line("connected");
    camera.order("go");
    let prediction: Value = serde_json::from_str(&camera.line("values")).expect("JSON");
    drop(camera);
    let summary = node.summary();
    assert_eq!((number(&summary, "packets_refused"), number(&summary, "packets")), (4, 1), "{summary}");
    let mut engine = Engine::new(network("digits-past"), sensor).expect("the sensor fits");
    engine.push_slice(part);
    assert_eq!(values(&prediction), bits(engine.predict().expect("a number").values));
}
