//! The processes together: predictions against a single process, floods, killed processes, other
//! versions.

use std::io::{BufRead, BufReader};
use std::process::{Child, Command, Output, Stdio};
use std::sync::mpsc::{Receiver, channel};
use std::thread;
use std::time::{Duration, Instant};

use iceoryx2::prelude::ZeroCopySend;
use meissner_engine::{Engine, Event, Network, Sensor};
use meissner_iceoryx2::channel::Channel;
use meissner_iceoryx2::driver::{Driver, events_of, predictions_of};
use meissner_iceoryx2::wire::{EventRecord, PredictionHeader, SliceHeader, check, check_records};
use meissner_io::ReadOptions;
use meissner_run::model::Model;
use meissner_run::source::Source;
use rustix::process::{Pid, Signal, kill_process};
use serde_json::Value;

const NETWORK: &str = "tactigraph-past";
/// Longest wait for another process, because test machines may be busy.
const PATIENCE: Duration = Duration::from_mins(2);

/// A process of this program. It is killed with the test.
struct Process {
    child: Child,
    /// Its lines for people.
    told: Receiver<String>,
}

impl Process {
    fn start(arguments: &[&str]) -> Self {
        let mut command = Command::new(env!("CARGO_BIN_EXE_meissner-iceoryx2"));
        command.args(arguments).stdout(Stdio::piped()).stderr(Stdio::piped());
        let mut child = command.spawn().expect("the program starts");
        let lines = BufReader::new(child.stderr.take().expect("it is piped")).lines();
        let (sender, told) = channel();
        thread::spawn(move || lines.map_while(Result::ok).try_for_each(|line| sender.send(line)));
        Self { child, told }
    }

    /// Waits for a line that contains `text`.
    fn told(&self, text: &str) -> String {
        let until = Instant::now() + PATIENCE;
        loop {
            let left = until.saturating_duration_since(Instant::now());
            let line =
                self.told.recv_timeout(left).unwrap_or_else(|_| panic!("expected a line with {text:?}"));
            if line.contains(text) {
                return line;
            }
        }
    }

    fn signal(&self, signal: Signal) {
        let pid = Pid::from_raw(self.child.id() as i32).expect("a process");
        kill_process(pid, signal).expect("it is there");
    }

    /// The lines of its output as JSON.
    fn output(self) -> Vec<Value> {
        let Output { stdout, status, .. } = self.child.wait_with_output().expect("it ends");
        assert!(status.success(), "{status}");
        let text = String::from_utf8(stdout).expect("text");
        text.lines().map(|line| serde_json::from_str(line).expect("JSON")).collect()
    }
}

/// A name that no other test uses.
fn name(test: &str) -> String {
    format!("meissner-test-{}-{test}", std::process::id())
}

fn network() -> Network {
    Model::named(NETWORK, None, false).expect("a shipped network").network
}

fn embedded() -> (Sensor, Vec<Event>) {
    let source = Source::open(None, &ReadOptions::default(), false, true).expect("it is embedded");
    let sensor = source.sensor(None).expect("it names it");
    (sensor, source.map(|event| event.expect("a good recording")).collect())
}

/// The bits that a single process predicts after these events.
fn single(engine: &mut Engine, events: &[Event]) -> Vec<u32> {
    engine.push_slice(events);
    bits(engine.predict().expect("a number").values)
}

fn bits(values: &[f32]) -> Vec<u32> {
    values.iter().map(|value| value.to_bits()).collect()
}

fn values(prediction: &Value) -> Vec<u32> {
    let values = prediction["values"].as_array().expect("values").iter();
    // The text has as many digits as an f32 needs.
    bits(&values.map(|value| value.as_f64().expect("a number") as f32).collect::<Vec<_>>())
}

fn number(of: &Value, key: &str) -> u64 {
    of[key].as_u64().unwrap_or_else(|| panic!("expected a count {key} in {of}"))
}

#[test]
fn predictions_of_three_processes_are_those_of_one_bit_for_bit() {
    let name = name("equal");
    let watch = Process::start(&["watch", "--name", &name, "--print", "--once"]);
    watch.told("ready");
    let infer = Process::start(&["infer", NETWORK, "--name", &name, "--once"]);
    infer.told("ready");
    let drive = Process::start(&["drive", "--name", &name, "--speed", "0.5", "--subscribers", "1"]);
    let published = drive.output().remove(0);
    let summary = infer.output().remove(0);
    let mut predictions = watch.output();
    let watched = predictions.pop().expect("a summary");

    let (sensor, events) = embedded();
    assert_eq!(number(&published, "events"), events.len() as u64);
    let lost = number(&summary["lost"]["queue"], "events");
    assert_eq!(lost + number(&summary, "events"), events.len() as u64, "{summary}");
    assert_eq!(number(&watched, "predictions"), predictions.len() as u64);
    // A busy machine may lose slices here too: arrived slices are compared, and the missing ones
    // are known.
    let mut arrived = events;
    for gap in summary["gaps"].as_array().expect("gaps").iter().rev() {
        let [from, until] = ["from", "until"].map(|end| number(&gap[1], end) as usize);
        drop(arrived.drain(from..until));
    }
    let mut engine = Engine::new(network(), sensor).expect("the sensor fits");
    let mut done = 0;
    for prediction in &predictions {
        let taken = number(prediction, "taken") as usize;
        assert_eq!(values(prediction), single(&mut engine, &arrived[done..taken]), "after {taken} events");
        assert_eq!(number(prediction, "nodes"), engine.nodes() as u64);
        done = taken;
    }
    assert!(predictions.len() > 20, "{}", predictions.len());
    assert_eq!(done, arrived.len());
}

#[test]
fn a_flood_loses_the_oldest_slices_and_each_is_counted() {
    let name = name("flood");
    let infer = Process::start(&["infer", NETWORK, "--name", &name, "--buffer", "4", "--once"]);
    infer.told("ready");
    let watch = Process::start(&["watch", "--name", &name, "--print", "--once"]);
    watch.told("ready");
    let (sensor, events) = embedded();
    let mut driver = Driver::new(&name, sensor).expect("nobody else drives");
    while driver.subscribers() == 0 {
        thread::sleep(Duration::from_millis(1));
    }
    driver.publish(&events[..100], Instant::now()).expect("a slice");
    infer.told("a driver has started");
    // While the process is stopped, 29 slices come; it can hold 3 and the end.
    infer.signal(Signal::STOP);
    thread::sleep(Duration::from_millis(100));
    for slice in events[100..].chunks(100).take(29) {
        driver.publish(slice, Instant::now()).expect("a driver never waits");
    }
    driver.end().expect("the end");
    infer.signal(Signal::CONT);
    let summary = infer.output().remove(0);
    let overflow = &summary["lost"]["queue"];
    let (taken, lost) = (number(&summary, "events") as usize, number(overflow, "events") as usize);
    assert_eq!(taken + lost, 3000, "{summary}");
    assert!(lost >= 2400 && lost == 100 * number(overflow, "packets") as usize, "{summary}");
    // It may have been stopped while it took a slice: the gaps name the missing events.
    let mut arrived = events[..3000].to_vec();
    for gap in summary["gaps"].as_array().expect("gaps").iter().rev() {
        assert_eq!(gap[1]["reason"], "queue");
        let [from, until] = ["from", "until"].map(|end| number(&gap[1], end) as usize);
        drop(arrived.drain(from..until));
    }
    assert_eq!(arrived.len(), taken);
    let mut predictions = watch.output();
    predictions.pop();
    let last = predictions.last().expect("a prediction");
    assert_eq!(number(last, "lost") as usize, lost);
    let mut engine = Engine::new(network(), sensor).expect("the sensor fits");
    assert_eq!(values(last), single(&mut engine, &arrived));
}

#[test]
fn killed_processes_are_replaced_and_what_follows_is_right() {
    let name = name("killed");
    let (sensor, events) = embedded();
    let watch = Process::start(&["watch", "--name", &name, "--print"]);
    watch.told("ready");
    let first = Process::start(&["infer", NETWORK, "--name", &name]);
    first.told("ready");
    // A driver that is killed in the middle leaves its place behind.
    let killed = Process::start(&["drive", "--name", &name, "--speed", "0.01", "--subscribers", "1"]);
    first.told("a driver has started");
    killed.signal(Signal::KILL);
    drop(killed.child.wait_with_output());
    let mut driver = Driver::new(&name, sensor).expect("the place of a dead driver is free");
    driver.publish(&events[..500], Instant::now()).expect("a slice");
    first.told("a driver has started");
    // An inference that is killed leaves its memory, its place and its publisher behind.
    first.signal(Signal::KILL);
    drop(first.child.wait_with_output());
    driver.publish(&events[500..700], Instant::now()).expect("a driver does not need anybody");
    let second = Process::start(&["infer", NETWORK, "--name", &name, "--once"]);
    second.told("ready");
    driver.publish(&events[700..900], Instant::now()).expect("a slice");
    let published = driver.end().expect("the end");
    assert_eq!(published.events, 900);
    let summary = second.output().remove(0);
    assert_eq!(number(&summary["lost"]["down"], "events"), 700, "{summary}");
    assert_eq!(number(&summary, "events"), 200);

    thread::sleep(Duration::from_millis(300));
    watch.signal(Signal::INT);
    let mut predictions = watch.output();
    let watched = predictions.pop().expect("a summary");
    assert_eq!((number(&watched, "origins"), number(&watched, "missing")), (2, 0), "{watched}");
    let last = predictions.last().expect("predictions");
    assert_eq!((number(last, "taken"), number(last, "lost"), number(last, "run")), (200, 700, published.run));
    let mut engine = Engine::new(network(), sensor).expect("the sensor fits");
    assert_eq!(values(last), single(&mut engine, &events[700..900]));
}

#[test]
fn a_second_driver_and_a_second_inference_are_refused_while_the_first_live() {
    let name = name("second");
    let _first = Driver::new(&name, Sensor::new(4, 4)).expect("nobody else drives");
    let second = Driver::new(&name, Sensor::new(4, 4)).expect_err("there is one");
    assert!(second.to_string().ends_with("cannot publish to it"), "{second}");
    let first = Process::start(&["infer", NETWORK, "--name", &name]);
    first.told("ready");
    let second = Process::start(&["infer", NETWORK, "--name", &name]);
    second.told("cannot publish to it");
    first.signal(Signal::TERM);
    assert_eq!(number(&first.output()[0], "events"), 0);
}

/// An event of another version, of the same size.
#[derive(Clone, Copy, Debug, ZeroCopySend)]
#[repr(C)]
#[type_name("meissner_event_2")]
struct OtherRecord {
    bits: [u64; 2],
}

#[test]
fn another_version_is_refused_with_both_types_and_garbage_is_refused_and_counted() {
    let name = name("version");
    let other: Channel<OtherRecord, SliceHeader> = Channel::open(&events_of(&name)).expect("it is free");
    let text = Driver::new(&name, Sensor::new(4, 4)).expect_err("another version").to_string();
    assert!(
        text.contains("expected meissner_event_1 of 16 bytes")
            && text.contains("got meissner_event_2 of 16 bytes"),
        "{text}"
    );
    drop(other);

    let infer = Process::start(&["infer", NETWORK, "--name", &name, "--once"]);
    infer.told("ready");
    let garbage = Channel::<EventRecord, SliceHeader>::open(&events_of(&name)).expect("the same types");
    let garbage = garbage.sender(4).expect("nobody else drives");
    let header = SliceHeader { run: 1, width: 240, height: 180, ..SliceHeader::default() };
    let good = EventRecord::from(Event::new(1, 2, 3, true));
    garbage.publish(header, 1, |_| good).expect("a slice");
    let bad = EventRecord { polarity: 77, zero: [1, 2, 3], ..good };
    garbage.publish(SliceHeader { sequence: 1, first_event: 1, ..header }, 2, |_| bad).expect("a slice");
    garbage.publish(SliceHeader { width: 0, ..header }, 1, |_| good).expect("a slice");
    let outside = EventRecord::from(Event::new(2, 9999, 3, true));
    garbage.publish(SliceHeader { sequence: 2, first_event: 3, ..header }, 1, |_| outside).expect("a slice");
    garbage
        .publish(SliceHeader { sequence: 3, first_event: 4, end: 1, ..header }, 0, |_| good)
        .expect("the end");
    infer.told("polarity 0 or 1 and three zeros, got 77 and [1, 2, 3]");
    infer.told("expected a sensor with pixels, got 0x180");
    let summary = infer.output().remove(0);
    assert_eq!(number(&summary["lost"]["malformed"], "packets"), 2, "{summary}");
    assert_eq!((number(&summary, "events"), number(&summary, "accepted")), (2, 1));
    assert_eq!(number(&summary["dropped"], "outside_sensor"), 1);
    assert_eq!(number(&summary["lost"]["queue"], "packets"), 0);
}

#[test]
fn settings_out_of_range_are_refused() {
    let name = predictions_of(&name("settings"));
    for buffer in [0, 257] {
        let channel: Channel<f32, PredictionHeader> = Channel::open(&name).expect("it is free");
        let error = channel.receiver(buffer).expect_err("out of range").to_string();
        assert_eq!(error, format!("buffer: expected 1 to 256 slices, got {buffer}"));
    }
}

#[test]
fn a_record_is_that_of_meissner_send() {
    let event = Event::new(-513, 3, 4, true);
    let EventRecord { t_us, x, y, polarity, zero } = event.into();
    let mut bytes = t_us.to_le_bytes().to_vec();
    bytes.extend([x.to_le_bytes(), y.to_le_bytes()].concat());
    bytes.push(polarity as u8);
    bytes.extend(zero);
    assert_eq!(bytes, meissner_io::record(event));
    assert_eq!(EventRecord::from(event).event(), Some(event));
}

#[test]
fn no_byte_belongs_to_no_field() {
    assert_eq!(size_of::<EventRecord>(), 16);
    assert_eq!(size_of::<SliceHeader>(), 5 * 8 + 2 * 2 + 4);
    assert_eq!(size_of::<PredictionHeader>(), 12 * 8);
}

#[test]
fn garbage_is_refused_with_its_reason() {
    let header = SliceHeader { width: 4, height: 4, ..SliceHeader::default() };
    let good = EventRecord::from(Event::new(1, 2, 3, false));
    let end = |end| SliceHeader { end, ..header };
    assert_eq!(check(&header, 3).expect("a slice"), Sensor::new(4, 4));
    assert_eq!(check(&end(1), 0).expect("an end"), Sensor::new(4, 4));
    for (header, events, found) in [
        (SliceHeader { height: 0, ..header }, 1, "4x0"),
        (header, 0, "0 events with end = 0"),
        (end(1), 1, "1 events with end = 1"),
        (end(2), 0, "0 events with end = 2"),
    ] {
        let error = check(&header, events).expect_err("garbage").to_string();
        assert!(error.ends_with(&format!("got {found}")), "{error}");
    }
    assert!(check_records(&[good; 3]).is_ok());
    for (bad, found) in [
        (EventRecord { zero: [0, 7, 0], ..good }, "0 and [0, 7, 0]"),
        (EventRecord { polarity: -1, ..good }, "-1 and [0, 0, 0]"),
    ] {
        let error = check_records(&[good, bad]).expect_err("garbage").to_string();
        let expected = format!("record 1: expected polarity 0 or 1 and three zeros, got {found}");
        assert_eq!(error, expected);
    }
}
