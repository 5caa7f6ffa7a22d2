//! A pixel that fires all the time moves no shipped network by more than the network's mean error,
//! at any rate: each network states a filter that mutes the pixel. Events of the scene pass.
//!
//! Errors are the means on the pages of `models/train`, in the units of the outputs.

use std::sync::{Arc, LazyLock};

use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork};
use meissner_engine::{
    BatchEngine, Engine, Event, LatePolicy, Network, Normalisation, RestartPolicy, Search, Sensor,
};
use meissner_io::datasets::{EventDataset, NeutouchSet, Split};
use meissner_models::{AnyDescription, Card, Description, FrameDescription, Weights};
use meissner_run::frame_feed::{EmptyFrameLimit, FeedOptions, FeedOutput, FeedState, FrameFeed};
use meissner_run::press::Press;
use meissner_run::schedule::Every;
use meissner_simulator::grasp::Grasp;
use meissner_simulator::{Camera, CameraSettings, MarkerScene, MarkerTracks};
use meissner_tests::shared::shared;

/// The events of a sensor until predictions are read.
struct Scene {
    sensor: Sensor,
    events: Vec<Event>,
    end_us: i64,
}

impl Scene {
    fn new(sensor: Sensor, mut events: Vec<Event>, end_us: i64) -> Self {
        events.retain(|event| event.t_us <= end_us);
        Self { sensor, events, end_us }
    }

    /// The same with `rate` additional events per second of `pixel`. They come `stride` at once, so
    /// that a network that takes every `stride`th event still takes the same events of the other
    /// pixels.
    fn beside(&self, rate: i64, pixel: (u16, u16), stride: usize) -> Self {
        let first_us = self.events.first().map_or(0, |event| event.t_us);
        let more = (self.end_us - first_us) * rate / 1_000_000 / stride as i64;
        let mut events = self.events.clone();
        for i in 0..more {
            let t_us = first_us + i * stride as i64 * 1_000_000 / rate;
            let event = Event::new(t_us, pixel.0, pixel.1, i % 3 > 0);
            events.extend(std::iter::repeat_n(event, stride));
        }
        events.sort_by_key(|event| event.t_us);
        Self { events, ..*self }
    }

    /// The pixel with the most events, and three others.
    fn pixels(&self) -> [(u16, u16); 4] {
        let Sensor { width, height } = self.sensor;
        let mut counts = vec![0; usize::from(width) * usize::from(height)];
        for event in &self.events {
            counts[usize::from(event.y) * usize::from(width) + usize::from(event.x)] += 1;
        }
        let busiest = (0..counts.len()).max_by_key(|&pixel| counts[pixel]).expect("pixels");
        let busiest = ((busiest % usize::from(width)) as u16, (busiest / usize::from(width)) as u16);
        [busiest, (width / 2, height / 2), (width / 3, height / 3), (width * 3 / 4, height / 8)]
    }
}

/// The embedded press and release, until the deepest point.
static PRESS: LazyLock<Scene> = LazyLock::new(|| {
    let bytes = include_bytes!("../../run/assets/dome_press.evt3");
    let events = meissner_io::decode(bytes).expect("the press").events;
    let press = Press::embedded().expect("the press");
    Scene::new(Sensor::new(346, 260), events, press.end_us)
});

/// Pins that spread and shift, as those of a soft fingertip in a tap.
static TAP: LazyLock<Scene> = LazyLock::new(|| {
    let sensor = Sensor::new(128, 128);
    let times: Vec<i64> = (0..=20).map(|i| i * 10_000).collect();
    let pins = || (0..19).flat_map(|row| (0..19).map(move |column| (row, column)));
    let mut places = Vec::new();
    for &t_us in &times {
        let part = ((t_us - 20_000) as f32 / 150_000.0).clamp(0.0, 1.0);
        let depth = part * part * (3.0 - 2.0 * part);
        places.extend(pins().map(|(row, column)| {
            let from_centre = |i: i32| (i - 9) as f32 * 5.5;
            let (x, y) = (from_centre(column) + if row % 2 == 0 { 1.4 } else { -1.4 }, from_centre(row));
            [63.5 + x * (1.0 + 0.05 * depth) + 2.0 * depth, 63.5 + y * (1.0 + 0.05 * depth) - depth]
        }));
    }
    let tracks = MarkerTracks::new(times, pins().count(), places).expect("tracks");
    let settings = CameraSettings { threshold_on: 0.3, threshold_off: 0.3, ..CameraSettings::default() };
    let mut camera = Camera::new(sensor, settings, 5).expect("a camera");
    let mut events = Vec::new();
    tracks
        .film(&MarkerScene { ground: 0.2, ..MarkerScene::default() }, &mut camera, &mut events)
        .expect("a film");
    Scene::new(sensor, events.iter().map(|simulated| simulated.event).collect(), 200_000)
});

/// A grasp of a bolt, until it is held.
static GRASP: LazyLock<Scene> = LazyLock::new(|| {
    let mut solver = Grasp::solver().expect("a solver");
    let (events, _) = Grasp::drawn(2, 0).film(&mut solver, CameraSettings::default()).expect("a film");
    let events = events.iter().map(|simulated| simulated.event).collect();
    Scene::new(Sensor::new(115, 115), events, 250_000)
});

/// A shipped network, and every how many events it takes one.
struct Subject {
    name: &'static str,
    stride: usize,
    network: Shipped,
}

enum Shipped {
    Events(Arc<Network>, Normalisation),
    Frames(Box<FrameDescription>, Arc<FrameNetwork>),
}

impl Subject {
    fn new(name: &'static str) -> Self {
        let weights = Weights::shipped(name).expect("shipped weights");
        let stride = Card::shipped(name).expect("a card").stride;
        let network = match AnyDescription::shipped(name).expect("a shipped network") {
            AnyDescription::Events(description) => {
                let network = description.network(&weights).expect("its weights");
                Shipped::Events(Arc::new(network), description.normalisation())
            }
            AnyDescription::Frames(description) => {
                let parts = description.network_parts(&weights).expect("its weights");
                let network = FrameNetwork::new(parts, Convolution::Kn2row).expect("a network");
                Shipped::Frames(Box::new(description), Arc::new(network))
            }
        };
        Self { name, stride, network }
    }

    /// Its prediction at the end of `scene`, and the number of events that its filter drops.
    fn says(&self, scene: &Scene) -> (Vec<f32>, u64) {
        let taken = scene.events.iter().copied().step_by(self.stride);
        match &self.network {
            Shipped::Events(network, Normalisation::PerGraph) => from_scratch(network, scene, taken),
            Shipped::Events(network, _) => of_events(network, scene, taken),
            Shipped::Frames(description, network) => of_frames(description, network, scene, taken),
        }
    }

    /// Its prediction for `scene`, all of whose events pass its filter.
    fn expected(&self, scene: &Scene) -> Vec<f32> {
        let (expected, filtered) = self.says(scene);
        assert_eq!(filtered, 0, "{}: what is seen passes", self.name);
        expected
    }
}

fn from_scratch(
    network: &Arc<Network>,
    scene: &Scene,
    events: impl Iterator<Item = Event>,
) -> (Vec<f32>, u64) {
    let engine = BatchEngine::new(Arc::clone(network), scene.sensor).expect("pixels");
    let mut engine = engine.with_search(Search::Grid);
    events.for_each(|event| _ = engine.push(event));
    engine.advance(scene.end_us);
    let values = engine.predict().expect("numbers").values.to_vec();
    (values, engine.event_counters().filtered)
}

fn of_events(network: &Arc<Network>, scene: &Scene, events: impl Iterator<Item = Event>) -> (Vec<f32>, u64) {
    let mut engine = Engine::new(Arc::clone(network), scene.sensor).expect("pixels");
    engine.push_all(events);
    engine.advance(scene.end_us);
    let values = engine.predict().expect("numbers").values.to_vec();
    (values, engine.event_counters().filtered)
}

fn of_frames(
    description: &FrameDescription,
    network: &Arc<FrameNetwork>,
    scene: &Scene,
    events: impl Iterator<Item = Event>,
) -> (Vec<f32>, u64) {
    let mut engine = FrameEngine::new(Arc::clone(network)).expect("a network");
    let options = FeedOptions {
        late: LatePolicy::Drop,
        restart: RestartPolicy::Keep,
        every: Every::End,
        silence: EmptyFrameLimit::new(None, 0),
        keeps: false,
    };
    let begin = FeedState::beginning(0);
    let feed = FrameFeed::new(description, scene.sensor, options, Some(&begin)).expect("frames");
    let (mut feed, mut filtered) = (feed.expect("frames of events"), 0);
    let mut take = |output: FeedOutput<'_>| match output {
        FeedOutput::Frame { values, .. } => engine.push(values),
        _ => Ok(()),
    };
    for event in events {
        let outcome = feed.push(event, &mut take).expect("frames");
        filtered +=
            u64::from(outcome == meissner_engine::Outcome::Dropped(meissner_engine::DropReason::Filtered));
    }
    feed.advance(scene.end_us, &mut take).expect("frames");
    feed.finish(&mut take).expect("frames");
    (engine.predict().expect("numbers").values.to_vec(), filtered)
}

/// Rates just below and above the rate that a pixel may keep without end, and far above.
const RATES: [i64; 5] = [90, 150, 1_000, 16_000, 200_000];

/// One pixel that fires all the time moves the values of `name` at the end of `scene` by no more
/// than their errors, in the mean over some pixels.
fn holds(name: &'static str, scene: &Scene, errors: &[f32]) {
    let subject = Subject::new(name);
    let expected = subject.expected(scene);
    for rate in RATES {
        let (mut moved, mut most) = (0.0, 0.0_f32);
        for pixel in scene.pixels() {
            let (found, filtered) = subject.says(&scene.beside(rate, pixel, subject.stride));
            assert!(rate < 1_000 || filtered > 0, "{name}, {rate} a second of {pixel:?}: {filtered} dropped");
            for ((found, expected), error) in found.iter().zip(&expected).zip(errors) {
                let by = (found - expected).abs() / error;
                moved += by / (scene.pixels().len() * errors.len()) as f32;
                most = most.max(by);
            }
        }
        assert!(moved <= 1.0, "{name}, {rate} events a second: {moved} of its errors, at most {most}");
        assert!(most <= 3.0, "{name}, {rate} events a second: at most {most} of its errors");
    }
}

fn radians(degrees: f32) -> [f32; 2] {
    [degrees.to_radians(); 2]
}

#[test]
fn a_hot_pixel_moves_the_angles_of_no_network_for_the_dome_by_more_than_its_mean_error() {
    // The error of `tactigraph-past` with the lamp on, and less than 0.3 degrees.
    for (name, degrees) in [
        ("tactigraph-past", 0.189),
        ("tactigraph-frozen", 0.529),
        ("tactigraph", 0.738),
        ("graphres", 0.926),
        ("graphres-published", 1.46),
        ("event-frame-cnn", 0.232),
    ] {
        holds(name, &PRESS, &radians(degrees));
    }
}

#[test]
fn a_hot_pixel_moves_no_network_for_the_tactip_by_more_than_its_mean_error() {
    for (name, mm, degrees) in [
        ("tactip-past", 0.036, 0.276),
        ("tactip", 0.046, 0.397),
        ("tactip-shear", 0.066, 0.578),
        ("tactip-frames", 0.055, 0.376),
    ] {
        holds(name, &TAP, &[mm, degrees, degrees]);
    }
}

#[test]
fn a_hot_pixel_moves_no_network_for_forces_by_more_than_its_mean_error() {
    for (name, newtons) in [
        ("force-graph", 0.090),
        ("force-lstm", 0.072),
        ("force-cnnlstm", 0.098),
        ("force-convlstm", 0.147),
        ("force-tdnn", 0.375),
    ] {
        holds(name, &GRASP, &[newtons]);
    }
}

/// With one pixel that fires all the time, `name` predicts another class for at most the `share` of
/// `recordings` that it does not recognise, plus half a recording.
fn recognises(name: &'static str, sensor: Sensor, recordings: &[Vec<Event>], share: f64, rates: &[i64]) {
    let subject = Subject::new(name);
    let class = |values: Vec<f32>| {
        (0..values.len()).max_by(|&a, &b| values[a].total_cmp(&values[b])).expect("classes")
    };
    let scenes = recordings.iter().map(|events| {
        let scene = Scene::new(sensor, events.clone(), events.last().expect("events").t_us);
        let expected = class(subject.expected(&scene));
        (scene, expected)
    });
    let scenes: Vec<_> = scenes.collect();
    for &rate in rates {
        let is_other = |(scene, expected): &&(Scene, usize)| {
            let [_, pixel, ..] = scene.pixels();
            class(subject.says(&scene.beside(rate, pixel, subject.stride)).0) != *expected
        };
        let others = scenes.iter().filter(is_other).count();
        let most = share * recordings.len() as f64 + 0.5;
        assert!(others as f64 <= most, "{name}, {rate} a second: {others} of {}", recordings.len());
    }
}

/// Every `every`th of the recordings for tests.
fn of_tests(data: EventDataset, every: usize) -> Vec<Vec<Event>> {
    let tests = data.recordings.into_iter().filter(|recording| recording.split == Split::Test);
    tests.step_by(every).map(|recording| recording.events).collect()
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn a_hot_pixel_changes_no_more_digits_than_are_misread_without_it() {
    let data = EventDataset::nmnist(shared("data/nmnist")).expect("the recordings");
    let recordings = of_tests(data, 25);
    for name in ["digits-past", "digits-frozen", "digits-all"] {
        recognises(name, Sensor::new(34, 34), &recordings, 0.04, &RATES);
    }
}

#[test]
#[cfg_attr(no_shared, ignore = "no ../shared")]
fn a_hot_taxel_changes_no_more_objects_and_letters_than_are_mistaken_without_it() {
    // A taxel that fires 90 times a second fires like a pressed one.
    let fast = &RATES[1..4];
    for (name, set, share) in
        [("touch-objects", NeutouchSet::Objects, 0.1), ("touch-containers", NeutouchSet::Containers, 0.2)]
    {
        let data = EventDataset::neutouch(shared("data/neutouch"), set).expect("the recordings");
        recognises(name, Sensor::new(241, 357), &of_tests(data, 4), share, fast);
    }
    let outputs = Description::shipped("touch-letters").expect("a network").outputs().0.to_vec();
    let names: Vec<&str> = outputs.iter().map(String::as_str).collect();
    let data = EventDataset::letters(shared("data/braille"), &names).expect("the presses");
    // 11 of 40 such presses are misread.
    recognises("touch-letters", Sensor::new(10, 8), &of_tests(data, 8), 0.275, fast);
}
