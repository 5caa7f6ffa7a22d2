use std::sync::OnceLock;
use std::time::Duration;

use meissner::{Event, Sensor};
use meissner_packets::{AnyNetwork, LiveOptions, LiveSensor};

use crate::check::check;
use crate::infer::counters;
use crate::message::{Counter, LossHeader, PredictionHeader};
use crate::record::Line;
use crate::source::StreamOptions;

/// A small network, made once.
fn network() -> AnyNetwork {
    static NETWORK: OnceLock<AnyNetwork> = OnceLock::new();
    NETWORK.get_or_init(|| AnyNetwork::named("tactigraph-past", None).unwrap()).clone()
}

/// The sensor and the first events of the embedded recording.
fn recording(events: usize) -> (Sensor, Vec<Event>) {
    let (sensor, mut all) = StreamOptions { runs: 1, ..StreamOptions::default() }.recorded().unwrap();
    all.truncate(events);
    (sensor, all)
}

/// A record with a gap, over 1000 events of which 900 arrived.
fn record() -> Vec<Line> {
    let (geometry, events) = recording(1000);
    let options = LiveOptions { network: network(), capacity: 10_000, every: Duration::ZERO, states: None };
    let (mut sensor, _) = LiveSensor::start("finger", 7, geometry, &options).unwrap();
    let (mut lines, deadline) = (Vec::new(), Duration::from_mins(2));
    for number in [0, 1, 2, 4, 5, 6, 7, 8, 9] {
        let place = (number, 100 * number, 100);
        let packet = &events[100 * number as usize..][..100];
        for gap in sensor.take(place, Some(packet), [0; 2]).unwrap() {
            let header = LossHeader { sensor: "finger".to_owned(), stream: 7, order: lines.len() as u64 };
            lines.push(Line::Loss { header, boot: 1, gap });
        }
        let asked = sensor.ask(deadline);
        let predicted = sensor.answer(&asked, deadline).unwrap().expect("news");
        let (order, place) = (lines.len() as u64, predicted.place);
        let header = PredictionHeader {
            sensor: "finger".to_owned(),
            stream: 7,
            boot: 1,
            number: order,
            order,
            next: place.next,
            accepted: place.accepted,
            t_us: predicted.t_us,
            nodes: predicted.nodes as u64,
            fresh: predicted.fresh,
            events_sent_ns: 0,
            events_received_ns: 0,
            sent_ns: 0,
        };
        lines.push(Line::Prediction { header, recorded_ns: 0, values: predicted.values.to_vec() });
    }
    let mut counters = counters(&sensor);
    counters.push(Counter::new("finger", "events_sent", 1000));
    lines.push(Line::Counters { boot: 1, counters });
    lines
}

fn refusal(lines: &[Line]) -> String {
    let (sensor, events) = recording(1000);
    check(lines, &network(), sensor, &events).unwrap_err().to_string()
}

#[test]
fn a_complete_record_is_accepted_in_any_order_of_its_lines() {
    let (sensor, events) = recording(1000);
    let mut lines = record();
    let found = check(&lines, &network(), sensor, &events).unwrap();
    assert_eq!((found.sent, found.accepted, found.predictions), (1000, 900, 9));
    assert_eq!(found.dropped["link"], 100);
    // The last counts stay last: they are those of the end.
    let last = lines.pop().unwrap();
    lines.reverse();
    lines.push(last);
    assert_eq!(check(&lines, &network(), sensor, &events).unwrap(), found);
}

#[test]
fn a_value_with_another_bit_is_found() {
    for place in [0, 8] {
        let mut lines = record();
        let predictions = lines.iter_mut().filter_map(|line| match line {
            Line::Prediction { values, .. } => Some(values),
            _ => None,
        });
        let values = predictions.into_iter().nth(place).unwrap();
        values[1] = f32::from_bits(values[1].to_bits() ^ 1);
        assert!(refusal(&lines).contains("finger: up to event"), "{}", refusal(&lines));
    }
}

#[test]
fn an_event_that_nobody_accounts_for_is_found() {
    let mut lines = record();
    lines.retain(|line| !matches!(line, Line::Loss { .. }));
    assert_eq!(refusal(&lines), "finger: up to event 500: expected 500 accepted events, got 400");

    let missed = Line::Missed { input: "losses".to_owned(), messages: 1, reason: "link".to_owned() };
    lines.push(missed);
    assert!(refusal(&lines).ends_with("got 400; the record lacks messages: 1 of losses"));

    // The last prediction: the events after the one before are neither predicted on nor dropped.
    let mut lines = record();
    lines.remove(lines.len() - 2);
    assert_eq!(refusal(&lines), "finger: expected 1000 events, of 1000, got 900");
}

#[test]
fn a_wrong_count_is_found() {
    for (name, reason) in [
        ("events_sent", ""),
        ("events_known", ""),
        ("events_accepted", ""),
        ("events_dropped", "link"),
        ("events_dropped", "queue"),
    ] {
        let mut lines = record();
        let Some(Line::Counters { counters, .. }) = lines.last_mut() else { panic!("the counts are last") };
        let is_it = |counter: &&mut Counter| counter.name == name && counter.reason == reason;
        counters.iter_mut().find(is_it).unwrap().value += 1;
        assert!(refusal(&lines).contains("expected"), "{name} {reason}");
    }
    let mut lines = record();
    lines.pop();
    assert_eq!(refusal(&lines), "finger: the source has told no count");
}

#[test]
fn a_sensor_of_which_only_the_source_speaks_is_found() {
    let lines = [Line::Counters { boot: 1, counters: vec![Counter::new("finger", "events_sent", 5)] }];
    assert_eq!(refusal(&lines), "finger: nothing is said of its 5 events");
}
