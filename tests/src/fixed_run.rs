//! One run that never changes: shipped networks over events, made-up networks over frames, and one
//! hash of all bits of their predictions.
//!
//! The hashes may change only if semantics or weights are changed on purpose.

use std::hash::Hasher;
use std::sync::Arc;

use fnv::FnvHasher;
use meissner_engine::frames::{Convolution, FrameEngine, FrameNetwork, FrameOptions};
use meissner_engine::{Batch, Engine, Event, Options, Search, Sensor, Stream};
use meissner_kernels::{Isa, WinogradTile};
use meissner_models::{Description, Weights};

use meissner_verify::Random;
use meissner_verify::frame_networks::{self, Style};

/// The result of [`of_events`], on every machine, instruction set and number of threads.
pub const EVENTS_EXPECTED: u64 = 0x8460_5536_0831_6e1f;
/// The result of [`of_frames`].
pub const FRAMES_EXPECTED: u64 = 0x65ab_181e_afc4_7072;
/// The result of [`of_press`]; `.ci/wasm` reads it here.
pub const PRESS_EXPECTED: u64 = 0xc81b_886b_a0f0_2234;

const SENSOR: Sensor = Sensor { width: 120, height: 90 };
/// Pooled and frozen, over all and over the past, with and without a head.
const NETWORKS: [&str; 6] =
    ["graphres", "tactigraph", "tactigraph-frozen", "tactigraph-past", "digits-all", "digits-past"];
const EVENTS: i64 = 1_200;
/// Events between predictions.
const EVERY: usize = 150;

/// How predictions over events are computed.
#[derive(Clone, Copy, Debug)]
pub enum Mode {
    /// Only the rows that each event changes.
    Incremental {
        /// The instruction set.
        isa: Isa,
        /// Whether two threads share the rows of blocks with many.
        two_threads: bool,
    },
    /// From scratch, on so many threads.
    Batch {
        /// Threads.
        threads: usize,
    },
}

/// FNV-1a over 64 bits (Fowler, Noll and Vo), with the same values on every machine.
fn add(hasher: &mut FnvHasher, values: &[f32]) {
    values.iter().for_each(|value| hasher.write(&value.to_bits().to_le_bytes()));
}

/// A blob that moves over the sensor in twice the span of the networks for digits, and noise.
fn events() -> Vec<Event> {
    let mut random = Random::new(9);
    (0..EVENTS)
        .map(|i| {
            let spread = if random.below(10) == 0 { 60 } else { 12 };
            let mut pixel = |centre: u64, extent: u64| ((centre + random.below(spread)) % extent) as u16;
            Event::new(i * 500, pixel(i as u64 / 24, 120), pixel(20 + i as u64 / 40, 90), i % 3 == 0)
        })
        .collect()
}

/// The hash of all predictions over events.
///
/// # Panics
/// If a shipped network cannot run.
pub fn of_events(mode: Mode) -> u64 {
    let events = events();
    let mut hash = FnvHasher::default();
    for name in NETWORKS {
        let weights = Weights::shipped(name).expect("shipped weights");
        let network = Description::shipped(name).expect("a shipped network").network(&weights);
        let network = network.expect("the weights fit");
        match mode {
            Mode::Incremental { isa, two_threads } => {
                let options = Options::new().with_isa(isa).with_two_threads(two_threads);
                let mut engine = Engine::with_options(network, SENSOR, options).expect("exact");
                for chunk in events.chunks(EVERY) {
                    engine.push_slice(chunk);
                    add(&mut hash, engine.predict().expect("finite").values);
                }
            }
            Mode::Batch { threads } => {
                let batch =
                    Batch::new(network, SENSOR).expect("the sensor has pixels").with_search(Search::Grid);
                let streams: Vec<Stream<'_>> =
                    (1..=events.len() / EVERY).map(|n| Stream::new(&events[..n * EVERY])).collect();
                let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
                for prediction in pool.install(|| batch.with_parallel_rows(true).predict_all(&streams)) {
                    add(&mut hash, &prediction.expect("finite"));
                }
            }
        }
    }
    hash.finish()
}

/// The hash of the prediction after each event of the press that comes with the program.
///
/// # Panics
/// If the recording cannot be read, or the network cannot run.
pub fn of_press(isa: Isa) -> u64 {
    let press = meissner_io::decode(include_bytes!("../../run/assets/dome_press.evt3")).expect("a recording");
    let weights = Weights::shipped("tactigraph-past").expect("shipped weights");
    let network = Description::shipped("tactigraph-past").expect("a shipped network").network(&weights);
    let (network, sensor) = (network.expect("the weights fit"), press.sensor.expect("it names its sensor"));
    let mut engine = Engine::with_options(network, sensor, Options::new().with_isa(isa)).expect("exact");
    let mut hash = FnvHasher::default();
    for event in press.events {
        engine.push(event);
        add(&mut hash, engine.predict().expect("finite").values);
    }
    hash.finish()
}

/// The hash of all outputs over frames, of networks of every style with every kind of convolution.
///
/// # Panics
/// If a network cannot run.
pub fn of_frames(isa: Isa, two_threads: bool) -> u64 {
    let image = [2, 12, 16];
    let styles = [
        Style::Classifier,
        Style::UNet { squeeze: true },
        Style::ConvolutionsThenLstm,
        Style::ConvLstm { hidden: 5, peepholes: true },
        Style::Delays,
        Style::Committee { vector: false },
    ];
    let tiles = [
        Convolution::Direct,
        Convolution::Winograd(WinogradTile::Two),
        Convolution::Winograd(WinogradTile::Four),
        Convolution::Kn2row,
    ];
    let frames = frame_networks::sequence(12, image, 5);
    let mut hash = FnvHasher::default();
    for (style, convolution) in styles.into_iter().flat_map(|style| tiles.map(|tile| (style, tile))) {
        let parts = frame_networks::network(style, image, 16, 7);
        let network = Arc::new(FrameNetwork::new(parts, convolution).expect("consistent"));
        let options = FrameOptions::new().with_isa(isa).with_two_threads(two_threads);
        let mut engine = FrameEngine::with_options(network, options).expect("an engine");
        for frame in &frames {
            engine.push(frame).expect("a frame");
            add(&mut hash, engine.predict().expect("finite").values);
        }
    }
    hash.finish()
}
