use std::fs;
use std::time::Duration;

use meissner::Sensor;

use super::{Lane, LaneError, LaneOptions};
use crate::check::check;
use crate::engine::Network;
use crate::harness::{FINGER, Node, STREAM, frame_network, header, network, recording};
use crate::message::Counter;

/// Events of a message.
const LEN: usize = 100;

#[test]
fn events_that_do_not_fit_are_dropped_as_whole_messages_and_the_others_are_predicted_on_exactly() {
    let (sensor, events) = recording(40 * LEN);
    let mut node = Node::start(sensor, 1, 250, None);
    for (number, message) in events.chunks(LEN).enumerate() {
        node.take(number as u64, number * LEN, message);
        if number % 8 == 7 {
            node.predict();
        }
    }
    // More than the queue can ever take.
    node.take(40, 40 * LEN, &[events[40 * LEN - 1]; 251]);
    node.predict();
    let mut all = events.clone();
    all.extend([events[40 * LEN - 1]; 251]);
    let found = check(&node.record(all.len() as u64), &network(), sensor, &all).unwrap();
    assert!(found.dropped["overload"] >= 251, "{found:?}");
    assert_eq!(found.accepted + found.dropped["overload"], found.sent);
}

#[test]
fn a_message_that_cannot_be_read_is_counted_with_the_events_that_it_claims() {
    let (sensor, events) = recording(3 * LEN);
    let mut node = Node::start(sensor, 1, 1000, None);
    node.take(0, 0, &events[..LEN]);
    node.take_malformed(1, LEN, LEN);
    node.take(2, 2 * LEN, &events[2 * LEN..]);
    node.predict();
    let found = check(&node.record(3 * LEN as u64), &network(), sensor, &events).unwrap();
    assert_eq!((found.accepted, found.dropped["malformed"]), (200, 100));
}

#[test]
fn a_killed_node_goes_on_from_its_newest_state_and_has_lost_what_came_after_it() {
    kill(&network());
}

#[test]
fn so_does_one_that_runs_a_frame_network() {
    kill(&frame_network());
}

fn kill(network: &Network) {
    let (sensor, events) = recording(60 * LEN);
    let folder = tempfile::tempdir().unwrap();
    let mut node = Node::running(network.clone(), sensor, 1, 10_000, Some(folder.path()));
    let mut state = None;
    for (number, message) in events.chunks(LEN).enumerate().take(30) {
        node.take(number as u64, number * LEN, message);
        node.predict();
        // The node is killed later than its last state is written.
        if number < 20 {
            state = node.lane.collect().or(state);
        }
    }
    let (path, state) = state.expect("a state was left");
    super::write(&path, &state).unwrap();
    let mut record = std::mem::take(&mut node.lines);
    drop(node);

    let mut node = Node::running(network.clone(), sensor, 2, 10_000, Some(folder.path()));
    for (number, message) in events.chunks(LEN).enumerate().skip(40) {
        node.take(number as u64, number * LEN, message);
        node.predict();
    }
    record.extend(node.record(60 * LEN as u64));
    let found = check(&record, network, sensor, &events).unwrap();
    assert_eq!((found.lives, found.predictions), (2, 50));
    let down = found.dropped["down"];
    assert!((2000..2200).contains(&down) && found.accepted + down == 6000, "{found:?}");
}

#[test]
fn a_node_that_ended_in_order_goes_on_without_a_gap() {
    let (sensor, events) = recording(20 * LEN);
    let folder = tempfile::tempdir().unwrap();
    let mut node = Node::start(sensor, 1, 10_000, Some(folder.path()));
    node.take(0, 0, &events[..10 * LEN]);
    node.predict();
    let mut record = std::mem::take(&mut node.lines);
    node.lane.close().unwrap();
    let mut node = Node::start(sensor, 2, 10_000, Some(folder.path()));
    node.take(1, 10 * LEN, &events[10 * LEN..]);
    node.predict();
    record.extend(node.record(20 * LEN as u64));
    let found = check(&record, &network(), sensor, &events).unwrap();
    assert_eq!((found.accepted, found.lives), (2000, 2));
    assert_eq!(
        node.lane.counters().find(|counter| counter.name == "predictions"),
        Some(Counter::new(FINGER, "predictions", 2))
    );
}

#[test]
fn a_state_of_another_life_of_the_source_is_not_used_and_a_damaged_one_is_refused() {
    let (sensor, events) = recording(LEN);
    let folder = tempfile::tempdir().unwrap();
    let mut node = Node::start(sensor, 1, 1000, Some(folder.path()));
    node.take(0, 0, &events);
    node.predict();
    node.lane.close().unwrap();
    let states = Some((folder.path().to_owned(), Duration::from_secs(1)));
    let options = LaneOptions { network: network(), capacity: 1000, every: Duration::ZERO, states };
    let known = |lane: &Lane| lane.counters().find(|counter| counter.name == "events_known").unwrap().value;
    for (stream, expected) in [(STREAM, 100), (STREAM + 1, 0)] {
        let (lane, refused) = Lane::start(FINGER, &header(sensor, stream, 5, 100), &options).unwrap();
        assert_eq!((known(&lane), refused), (expected, None));
    }
    let path = folder.path().join("finger.state");
    let mut bytes = fs::read(&path).unwrap();
    bytes[40] ^= 1;
    for damaged in [&bytes[..], &bytes[..bytes.len() / 2], b""] {
        fs::write(&path, damaged).unwrap();
        let (lane, refused) = Lane::start(FINGER, &header(sensor, STREAM, 5, 100), &options).unwrap();
        assert_eq!(known(&lane), 0);
        assert!(refused.is_some());
    }
}

#[test]
fn a_state_of_another_network_is_refused() {
    let (sensor, events) = recording(LEN);
    let networks = [network(), frame_network()];
    for (writer, reader) in networks.iter().zip(networks.iter().rev()) {
        let folder = tempfile::tempdir().unwrap();
        let mut node = Node::running(writer.clone(), sensor, 1, 1000, Some(folder.path()));
        node.take(0, 0, &events);
        node.predict();
        node.lane.close().unwrap();
        let states = Some((folder.path().to_owned(), Duration::ZERO));
        let options = LaneOptions { network: reader.clone(), capacity: 1000, every: Duration::ZERO, states };
        let (_, refused) = Lane::start(FINGER, &header(sensor, STREAM, 1, 100), &options).unwrap();
        assert!(refused.is_some());
    }
}

#[test]
fn a_sensor_without_the_pixels_of_the_frames_is_refused() {
    let options =
        LaneOptions { network: frame_network(), capacity: 1000, every: Duration::ZERO, states: None };
    let refused = Lane::start(FINGER, &header(Sensor::new(64, 64), STREAM, 0, 0), &options).err().unwrap();
    assert!(matches!(refused, LaneError::Network(_)), "{refused}");
}

#[test]
fn silence_asks_for_nothing_and_keeps_nothing() {
    let (sensor, events) = recording(LEN);
    let mut node = Node::start(sensor, 1, 1000, None);
    assert!(!node.lane.has_news());
    for number in 0..100 {
        node.take(number, 0, &[]);
    }
    node.predict();
    assert!(!node.lane.has_news() && node.lines.is_empty());
    node.take(100, 0, &events);
    assert!(node.lane.has_news());
    node.predict();
    for number in 101..200 {
        node.take(number, LEN, &[]);
    }
    node.predict();
    assert_eq!(node.lines.len(), 1);
    assert!(!node.lane.has_news());
    assert!(crate::kept::lock(&node.lane.desk).marks.len() <= 2);
}

#[test]
fn a_prediction_is_due_when_its_time_has_come_and_there_is_news() {
    let (sensor, events) = recording(2 * LEN);
    let hour = Duration::from_hours(1);
    let options = LaneOptions { network: network(), capacity: 1000, every: hour, states: None };
    let (mut lane, _) = Lane::start(FINGER, &header(sensor, STREAM, 0, 0), &options).unwrap();
    assert_eq!(lane.until_due(), Duration::MAX);
    lane.take(&header(sensor, STREAM, 0, 0), Some(&events[..LEN]), LEN, 0).unwrap().for_each(drop);
    assert_eq!(lane.until_due(), Duration::ZERO);
    let asked = lane.ask(hour);
    assert!(lane.answer(&asked, hour).unwrap().is_some_and(|predicted| predicted.fresh));
    assert_eq!(lane.until_due(), Duration::MAX);
    lane.take(&header(sensor, STREAM, 1, 100), Some(&events[LEN..]), LEN, 0).unwrap().for_each(drop);
    assert!(lane.until_due() > hour / 2 && lane.until_due() < hour);
}
