//! Commands, and what the cursor does.

use super::frames::{json, prediction, section, time};
use super::{after, clock, digits, line, press, session, wait_us};
use crate::{Networks, Session, Shipped};

const PLAYING: u32 = 1;
const AT_END: u32 = 2;

/// The parts of a frame that depend on the events alone.
fn picture(frame: &[u8]) -> Vec<&[u8]> {
    ["TIME", "EVNT", "NEAR", "WAVE", "CELL", "READ", "WORK"].map(|tag| section(frame, tag).0).to_vec()
}

#[test]
fn a_place_looks_the_same_whatever_was_there_before() {
    let of = |input, network| {
        let mut session = session(input, network);
        let count = time(&after(&mut session, r#"{"do": "seek", "t_us": 1e9}"#)).0;
        let place = count / 2;
        let seek = format!(r#"{{"do": "seek_event", "event": {place}}}"#);
        let from_the_end = after(&mut session, &seek);
        assert_eq!(time(&from_the_end).0, place);
        let back = after(&mut session, r#"{"do": "step", "events": -1}"#);
        assert_eq!(time(&back).0, place - 1);
        let there = after(&mut session, r#"{"do": "step", "events": 1}"#);
        let again = after(&mut session, &seek);
        for frame in [&there, &again] {
            // A restored state has counted its own predictions.
            assert_eq!(picture(frame)[..6], picture(&from_the_end)[..6]);
            assert_eq!(prediction(frame), prediction(&from_the_end));
        }
    };
    of(press(), "tactigraph-past");
    of(digits(line(1200), false), "digits-past");
}

#[test]
fn an_event_of_a_frozen_network_computes_one_row_a_layer_wherever_one_steps() {
    let mut session = session(press(), "tactigraph-past");
    after(&mut session, r#"{"do": "seek_event", "event": 20000}"#);
    for command in [
        r#"{"do": "step", "events": -1}"#,
        r#"{"do": "step", "events": 1}"#,
        r#"{"do": "seek_event", "event": 16385}"#,
    ] {
        let frame = after(&mut session, command);
        let mut wave = section(&frame, "WAVE");
        let layers = wave.u32();
        for _ in 0..layers {
            let (_, _, computed) = (wave.u32(), wave.u32(), wave.u32());
            assert_eq!(computed, 1, "{command}");
        }
    }
}

#[test]
fn it_plays_at_its_speed_and_ends_at_the_end() {
    let mut session = session(press(), "tactigraph-past");
    after(&mut session, r#"{"do": "speed", "times": 0.5}"#);
    session.command(r#"{"do": "play"}"#).expect("a command");
    wait_us(100_000.0);
    let frame = session.step(1e9).expect("it has gone on");
    let now_us = section(&frame, "TIME").f64();
    assert!((now_us - 50_000.0).abs() < 500.0, "{now_us}");
    assert_eq!(time(&frame).1 & PLAYING, PLAYING);
    wait_us(1e9);
    let frame = session.step(1e9).expect("it has gone on");
    assert_eq!(time(&frame).1 & (PLAYING | AT_END), AT_END);
    assert!(session.step(1e9).is_none(), "nothing more happens");
    // At the end, playing begins again from the start.
    let frame = after(&mut session, r#"{"do": "play"}"#);
    assert_eq!(time(&frame), (1, PLAYING));
}

#[test]
fn paused_it_stays() {
    let mut session = session(press(), "tactigraph-past");
    after(&mut session, r#"{"do": "seek_event", "event": 50}"#);
    wait_us(1e8);
    assert!(session.step(1e9).is_none());
    assert_eq!(time(&after(&mut session, r#"{"do": "show"}"#)).0, 50);
}

#[test]
fn another_network_runs_from_the_same_place() {
    let mut session = session(press(), "tactigraph-past");
    after(&mut session, r#"{"do": "seek_event", "event": 900}"#);
    let version = session.facts_version();
    let frame = after(&mut session, r#"{"do": "network", "name": "tactigraph"}"#);
    assert_eq!(time(&frame).0, 900);
    assert_eq!(session.facts_version(), version + 1);
    assert_eq!(json(&session.facts(), "FACT")["network"], "tactigraph");
}

#[test]
fn full_recomputation_has_the_same_bits_in_every_network() {
    for name in Shipped.names() {
        let chosen = Shipped.load(&name).expect("a network");
        let input = if name.starts_with("digits") { digits(line(400), false) } else { press() };
        let mut session = session(input, &name);
        session.command(r#"{"do": "compare", "on": true}"#).expect("a command");
        let frame = after(&mut session, r#"{"do": "seek_event", "event": 200}"#);
        let compared = &json(&frame, "INFO")["compared"];
        assert_eq!((compared["event"].as_u64(), &compared["error"]), (Some(200), &serde_json::Value::Null));
        let layers = compared["layers"].as_array().expect("layers");
        assert_eq!(layers.len(), chosen.network.layers().len() + 2);
        assert!(layers.iter().all(|layer| layer["differ"] == 0 && layer["rows"] != 0), "{name}: {layers:?}");
    }
}

#[test]
fn a_command_that_cannot_be_carried_out_changes_nothing_and_is_told() {
    let mut session = session(press(), "tactigraph-past");
    let before = after(&mut session, r#"{"do": "seek_event", "event": 100}"#);
    for wrong in [
        "",
        "{}",
        "[]",
        r#"{"do": "fly"}"#,
        r#"{"do": "seek"}"#,
        r#"{"do": "seek", "t_us": "soon"}"#,
        r#"{"do": "seek", "t_us": 1e999}"#,
        r#"{"do": "speed", "times": 0}"#,
        r#"{"do": "speed", "times": -1}"#,
        r#"{"do": "network", "name": "../../etc/passwd"}"#,
        r#"{"do": "network", "name": "canf"}"#,
        r#"{"do": "seek", "t_us": 1, "event": 1}"#,
    ] {
        assert!(session.command(wrong).is_err(), "{wrong}");
        let frame = session.step(1e9).expect("it is told");
        assert!(json(&frame, "INFO")["error"].is_string(), "{wrong}");
        assert_eq!(picture(&frame), picture(&before), "{wrong}");
    }
    for (far, event) in [("1e300", u64::MAX), ("-1e300", 0)] {
        let frame = after(&mut session, &format!(r#"{{"do": "seek", "t_us": {far}}}"#));
        let all = press().events.len() as u64;
        assert_eq!(time(&frame).0, event.min(all), "{far}");
        let frame = after(&mut session, &format!(r#"{{"do": "step", "events": {far}}}"#));
        assert_eq!(time(&frame).0, event.min(all), "{far}");
    }
}

#[test]
fn live_events_are_followed_and_wait_while_it_is_paused() {
    let mut session = Session::<crate::events::EventGraph>::new(
        digits(Vec::new(), true),
        Box::new(Shipped),
        "digits-past",
        clock,
    )
    .expect("a session");
    let events = line(600);
    assert_eq!(session.step(1e9).map(|frame| time(&frame).0), Some(0));
    session.push(events[..400].to_vec());
    assert_eq!(session.step(1e9).map(|frame| time(&frame).0), Some(400));
    after(&mut session, r#"{"do": "pause"}"#);
    session.push(events[400..].to_vec());
    assert_eq!(session.step(1e9).map(|frame| time(&frame).0), Some(400));
    let back = after(&mut session, r#"{"do": "step", "events": -200}"#);
    assert_eq!(time(&back).0, 200);
    session.command(r#"{"do": "play"}"#).expect("a command");
    assert_eq!(session.step(1e9).map(|frame| time(&frame).0), Some(600));
}

#[test]
fn an_endless_live_input_is_forgotten_from_its_start() {
    let mut session = Session::<crate::events::EventGraph>::new(
        digits(Vec::new(), true),
        Box::new(Shipped),
        "digits-frozen",
        clock,
    )
    .expect("a session");
    let events = vec![line(1)[0]; 1 << 20];
    for _ in 0..3 {
        session.push(events.clone());
    }
    let mut time = section(&after(&mut session, r#"{"do": "compare", "on": true}"#), "TIME").0.to_vec();
    time.truncate(32);
    assert_eq!(time[24..], (2.0 * f64::from(1 << 20)).to_le_bytes());
    assert_eq!(json(&after(&mut session, r#"{"do": "show"}"#), "INFO")["forgotten"], 1 << 20);
}

#[test]
fn an_input_without_events_is_shown() {
    let mut session = session(digits(Vec::new(), false), "digits-past");
    for command in
        [r#"{"do": "step", "events": 1}"#, r#"{"do": "seek", "t_us": 5}"#, r#"{"do": "compare", "on": true}"#]
    {
        assert_eq!(time(&after(&mut session, command)).0, 0);
    }
}

#[test]
fn a_place_that_was_asked_for_is_reached_though_it_takes_many_steps_and_though_it_is_paused() {
    let mut session = session(press(), "tactigraph-past");
    for (command, after) in [("play", 20_000), ("pause", 15_000)] {
        session.command(r#"{"do": "play"}"#).expect("a command");
        session.command(&format!(r#"{{"do": "seek_event", "event": {after}}}"#)).expect("a command");
        session.command(&format!(r#"{{"do": "{command}"}}"#)).expect("a command");
        // Without a budget, a step takes the minimum.
        let mut steps = 0;
        while section(&session.show(), "TIME").0[24 + 8 + 4] & 8 != 0 || steps == 0 {
            session.go_on(0.0);
            wait_us(1.0);
            steps += 1;
            assert!(steps < 100_000, "{command}");
        }
        assert_eq!(time(&session.show()).0, after);
    }
}
