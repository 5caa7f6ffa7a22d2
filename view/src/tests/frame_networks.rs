//! Networks over pictures, readings and frames of events: sessions show the values of an engine
//! that computes everything, from any earlier position of the cursor.

use std::sync::Arc;

use meissner_engine::frames::{FrameEngine, FrameOptions, Skip};
use meissner_engine::representations::{TactileForm, TactileWindow};
use meissner_models::{AnyDescription, FrameDescription, FrameSource};

use super::frames::{json, prediction, section, time};
use super::{after, clock};
use crate::frames::{Content, Frame, FrameSensor, Frames, ShippedFrames};
use crate::{Input, Networks, Session, Truth};

fn description(network: &str) -> FrameDescription {
    match AnyDescription::shipped(network) {
        Some(AnyDescription::Frames(description)) => description,
        _ => panic!("{network} is no shipped frame network"),
    }
}

fn session(network: &str, items: Vec<Frame>, live: bool) -> Session<Frames> {
    let description = description(network);
    let networks = ShippedFrames { source: *description.source(), shape: description.input() };
    let (name, truth) = ("frames".to_owned(), Truth::default());
    let input = Input { name, sensor: FrameSensor::default(), events: items, live, truth };
    let mut session = Session::new(input, Box::new(networks), network, clock).expect("a session");
    session.command(r#"{"do": "pause"}"#).expect("a command");
    session
}

/// An engine that skips nothing, with the network that a session has.
fn whole(network: &str) -> FrameEngine {
    let description = description(network);
    let networks = ShippedFrames { source: *description.source(), shape: description.input() };
    let framed = networks.load(network).expect("a network").network;
    let options = FrameOptions::new().with_skip(Skip::Nothing);
    FrameEngine::with_options(Arc::clone(&framed.network), options).expect("an engine")
}

fn seek(session: &mut Session<Frames>, event: usize) -> Vec<u8> {
    after(session, &format!(r#"{{"do": "seek_event", "event": {event}}}"#))
}

/// A picture in which a blob of this radius brightens.
fn picture(number: i64, radius: i32) -> Frame {
    let pixel = |at: i32| {
        let (x, y) = (at % 320 - 150 - number as i32, at / 320 - 100);
        if x * x + y * y < radius * radius { [150, 120, 90] } else { [100, 100, 100] }
    };
    let content = Content::Picture((0..320 * 240).flat_map(pixel).collect());
    Frame { t_us: 40_000 * number, begins: number == 0, content }
}

#[test]
fn pictures_show_forces_of_full_computation_from_wherever_one_comes() {
    let pictures: Vec<_> = [0, 12, 20, 20, 7].into_iter().zip(0..).map(|(r, n)| picture(n, r)).collect();
    let mut session = session("canf-plain", pictures.clone(), false);
    let mut engine = whole("canf-plain");
    let FrameSource::Picture(settings) = *description("canf-plain").source() else { panic!("pictures") };
    let images = settings.image_normalisation().expect("checked");
    let Content::Picture(rest) = &pictures[0].content else { panic!("a picture") };
    let mut planes = vec![0.0; 3 * 320 * 240];
    for at in [4, 2, 5] {
        let frame = seek(&mut session, at);
        let Content::Picture(rgb) = &pictures[at - 1].content else { panic!("a picture") };
        let (_, mut shown) = (time(&frame), section(&frame, "PICT"));
        assert_eq!((shown.u32(), shown.u32(), shown.0), (320, 240, &rgb[..]));
        images.apply(rgb, settings.difference.then_some(&rest[..]), &mut planes).expect("a picture");
        engine.push(&planes).expect("a frame");
        let mut expected = engine.predict().expect("a prediction").values.to_vec();
        settings.force_normalisation().expect("checked").apply(&mut expected);
        let mut forces = section(&frame, "FORC");
        assert_eq!((forces.u32(), forces.u32()), (320, 240));
        let centre = [forces.f32(), forces.f32()];
        let (threshold, area) = (forces.f32(), forces.f32());
        let pressed = expected.iter().filter(|&&force| force > threshold).count();
        assert_eq!(centre[0].is_nan(), pressed == 0, "{centre:?}");
        for force in expected {
            assert_eq!(forces.f32().to_bits(), force.to_bits());
        }
        let [shown, _] = prediction(&frame)[..] else { panic!("area and force") };
        assert!((f32::from_bits(shown) - pressed as f32 * area).abs() < 1e-3 * (1.0 + area * pressed as f32));
    }
}

#[test]
fn pixels_that_changed_are_marked_and_the_rest_is_kept() {
    let pictures: Vec<_> = [0, 12, 12].into_iter().zip([0, 1, 1]).map(|(r, n)| picture(n, r)).collect();
    let mut session = session("canf-plain", pictures, false);
    let of = |frame: &[u8]| {
        let (mut changed, mut layers) = (section(frame, "DIFF"), section(frame, "LAYR"));
        assert_eq!((changed.u32(), changed.u32()), (320, 240));
        let marked: u32 = (0..320 * 240 / 32).map(|_| changed.u32().count_ones()).sum();
        let counts: Vec<_> = (0..layers.u32()).map(|_| [layers.u32(), layers.u32(), layers.u32()]).collect();
        (marked, counts)
    };
    let (marked, counts) = of(&seek(&mut session, 2));
    // A disc of radius 12.
    assert!((400..500).contains(&marked), "{marked}");
    assert!(counts[0][0] > 0 && counts[0][1] > 60_000, "{counts:?}");
    assert!(counts.iter().all(|&[computed, kept, _]| computed < kept || computed + kept == 0), "{counts:?}");
    let (marked, counts) = of(&seek(&mut session, 3));
    assert_eq!(marked, 0);
    assert!(counts.iter().all(|&[computed, ..]| computed == 0), "{counts:?}");
}

#[test]
fn other_networks_keep_the_reference_and_agree_with_full_computation() {
    let pictures: Vec<_> = [0, 15, 9].into_iter().zip(0..).map(|(r, n)| picture(n, r)).collect();
    let mut session = session("canf-plain", pictures, false);
    seek(&mut session, 3);
    let other = after(&mut session, r#"{"do": "network", "name": "canf"}"#);
    assert_eq!(time(&other).0, 3);
    let there = after(&mut session, r#"{"do": "network", "name": "canf-plain"}"#);
    let again = seek(&mut session, 3);
    assert_eq!(prediction(&there), prediction(&again));
    let compared = after(&mut session, r#"{"do": "compare", "on": true}"#);
    let compared = &json(&compared, "INFO")["compared"];
    assert_eq!(compared["layers"][0]["rows"], 320 * 240);
    assert_eq!(compared["layers"][0]["differ"], 0);
}

/// Readings, one of which does not continue those before it.
fn readings(count: i64, gap: i64) -> Vec<Frame> {
    let value = |n: i64, e: usize| 3000.0 + 7.0 * ((n * (e as i64 % 5 + 1)) % 31) as f32 - 9.0 * e as f32;
    let reading = |n: i64| Frame {
        t_us: 10_000 * n,
        begins: n == 0 || n == gap,
        content: Content::Reading(std::array::from_fn(|e| value(n, e))),
    };
    (0..count).map(reading).collect()
}

#[test]
fn a_window_of_readings_is_the_same_from_wherever_one_comes() {
    let items = readings(40, 20);
    let mut session = session("slip-lstm", items.clone(), false);
    let FrameSource::Electrodes(of) = *description("slip-lstm").source() else { panic!("electrodes") };
    let expected = |end: usize| {
        let window = TactileWindow::new(of.steps, of.sampling, of.scaling, TactileForm::Reading);
        let (mut window, mut engine) = (window.expect("a window"), whole("slip-lstm"));
        let mut values = None;
        for item in &items[..end] {
            if item.begins {
                window.reset();
            }
            let Content::Reading(reading) = &item.content else { panic!("a reading") };
            if let Some(sequence) = window.push(reading).expect("finite") {
                engine.reset();
                engine.push_slice(sequence.values).expect("frames");
                let bits = engine.predict().expect("finite").values.iter().map(|value| value.to_bits());
                values = Some(bits.collect::<Vec<_>>());
            }
        }
        values
    };
    assert!(expected(4).is_none());
    let frame = seek(&mut session, 4);
    assert!(prediction(&frame).iter().all(|&bits| f32::from_bits(bits).is_nan()));
    for end in [40, 10, 19, 25, 11, 12] {
        let frame = seek(&mut session, end);
        assert_eq!(Some(prediction(&frame)), expected(end), "{end}");
        let mut shown = section(&frame, "ELEC");
        assert_eq!(shown.u32() as usize, end);
    }
    let compared = after(&mut session, r#"{"do": "compare", "on": true}"#);
    assert_eq!(json(&compared, "INFO")["compared"]["layers"][0]["differ"], 0);
    // Another network with another scaling and form, at the same place.
    let there = after(&mut session, r#"{"do": "network", "name": "slip-best"}"#);
    assert_eq!(time(&there).0, 12);
    let step = after(&mut session, r#"{"do": "step", "events": 1}"#);
    let back = after(&mut session, r#"{"do": "step", "events": -1}"#);
    assert_ne!(prediction(&step), prediction(&back));
    assert_eq!(prediction(&there), prediction(&back));
}

#[test]
fn a_network_that_remembers_returns_to_states_and_begins_anew() {
    let frame = |n: i64| Frame {
        t_us: 10_000 * n,
        begins: n == 0 || n == 120,
        content: Content::Events((0..40).map(|i| (((n * 37 + i * 211) % 26_450) as u32, 0.25)).collect()),
    };
    let items: Vec<_> = (0..200).map(frame).collect();
    let mut session = session("force-lstm", items.clone(), false);
    let mut engine = whole("force-lstm");
    let expected: Vec<_> = items
        .iter()
        .map(|item| {
            if item.begins {
                engine.reset();
            }
            let Content::Events(values) = &item.content else { panic!("events") };
            let mut dense = vec![0.0; 2 * 115 * 115];
            values.iter().for_each(|&(at, value)| dense[at as usize] = value);
            engine.push(&dense).expect("a frame");
            engine.predict().expect("finite").values.iter().map(|value| value.to_bits()).collect::<Vec<_>>()
        })
        .collect();
    for at in [200, 100, 65, 119, 121, 64, 1] {
        let frame = seek(&mut session, at);
        assert_eq!(prediction(&frame), expected[at - 1], "{at}");
        let mut shown = section(&frame, "SPAR");
        assert_eq!((shown.u32(), shown.u32(), shown.u32()), (2, 115, 115));
        assert_eq!(shown.0.len(), 40 * 8);
    }
    seek(&mut session, 150);
    let compared = after(&mut session, r#"{"do": "compare", "on": true}"#);
    assert_eq!(json(&compared, "INFO")["compared"]["layers"][0]["differ"], 0);
}

#[test]
fn live_pictures_are_followed_and_old_ones_are_forgotten() {
    let mut session = session("canf-plain", Vec::new(), true);
    session.command(r#"{"do": "pause"}"#).expect("a command");
    let small = |n: i64| Frame { t_us: n, begins: false, content: Content::Picture(Vec::new()) };
    session.push((0..1001).map(small).collect());
    let frame = session.step(1e9).expect("a frame");
    assert_eq!(json(&frame, "INFO")["forgotten"], 500);
    // The pictures have another size: the session reports it and continues.
    let frame = seek(&mut session, 2);
    assert!(json(&frame, "INFO")["error"].as_str().is_some_and(|error| !error.is_empty()));
}

#[test]
fn networks_are_those_that_read_the_same_input() {
    let of = |network: &str| {
        let description = description(network);
        ShippedFrames { source: *description.source(), shape: description.input() }.names()
    };
    assert_eq!(of("canf"), ["canf", "canf-live", "canf-plain"]);
    assert_eq!(of("slip-best"), ["slip-best", "slip-lstm", "slip-regularised", "slip-tuned"]);
    assert!(of("force-lstm").contains(&"force-tdnn".to_owned()));
    assert!(!of("force-lstm").contains(&"event-frame-cnn".to_owned()));
}
