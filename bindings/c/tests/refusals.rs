//! A call that is refused for an argument changes neither a handle nor the caller's memory.
#![allow(unsafe_code, reason = "what is tested takes raw pointers")]

use std::collections::BTreeSet;
use std::ffi::{CStr, c_char};
use std::path::Path;
use std::ptr::{null, null_mut};

use meissner_c::meissner_status::{
    MEISSNER_BUFFER_TOO_SMALL as SMALL, MEISSNER_INVALID_ARGUMENT as INVALID,
    MEISSNER_INVALID_SNAPSHOT as NO_SNAPSHOT, MEISSNER_OK as OK,
};
use meissner_c::*;

/// Content of the caller's memory, which no refused call may change. Read as a struct, it states
/// too large a size.
const MARK: u64 = 0xaaaa_aaaa_aaaa_aaaa;
const ROOM: usize = 4096;

const DESCRIPTION: &str = "[network]\nname = \"x\"\n";
const NOT_UTF8: &CStr = c"\xff";
const OUTPUTS: usize = 3;

struct Scene {
    network: *mut meissner_network,
    of_frames: *mut meissner_network,
    engine: *mut meissner_engine,
    frames: *mut meissner_frames,
    input: *mut meissner_input,
    live: *mut meissner_live,
    room: Vec<u64>,
}

/// The state of a scene's handles, as far as a program can see it.
#[derive(PartialEq)]
struct State(Vec<Vec<u8>>);

fn struct_of<T>(size: usize) -> T {
    assert!(size <= size_of::<T>());
    // SAFETY: zeros are a value of every struct, and the first field of each is its size.
    unsafe {
        let mut made: T = std::mem::zeroed();
        (&raw mut made).cast::<usize>().write(size);
        made
    }
}

/// The bytes that `write` writes to a struct.
fn bytes_of<T>(write: impl FnOnce(*mut T) -> meissner_status) -> Vec<u8> {
    let mut made: T = struct_of(size_of::<T>());
    assert_eq!(write(&raw mut made), OK);
    // SAFETY: the requested structs have no padding.
    unsafe { std::slice::from_raw_parts((&raw const made).cast(), size_of::<T>()) }.to_vec()
}

fn snapshot(write: impl Fn(*mut u8, usize, *mut usize) -> meissner_status) -> Vec<u8> {
    let mut length = 0;
    assert_eq!(write(null_mut(), 0, &raw mut length), SMALL);
    let mut bytes = vec![0; length];
    assert_eq!(write(bytes.as_mut_ptr(), length, &raw mut length), OK);
    bytes
}

impl Scene {
    fn new() -> Self {
        let mut scene = Self {
            network: null_mut(),
            of_frames: null_mut(),
            engine: null_mut(),
            frames: null_mut(),
            input: null_mut(),
            live: null_mut(),
            room: vec![MARK; ROOM],
        };
        let mut values = [0.0; OUTPUTS];
        // SAFETY: every pointer is valid.
        unsafe {
            let (network, of_frames) = (&raw mut scene.network, &raw mut scene.of_frames);
            assert_eq!(meissner_network_open(c"tactip-past".as_ptr(), null(), null(), network), OK);
            assert_eq!(meissner_network_open(c"slip-lstm".as_ptr(), null(), null(), of_frames), OK);
            assert_eq!(meissner_engine_new(scene.network, 40, 30, null(), &raw mut scene.engine), OK);
            assert_eq!(meissner_frames_new(scene.of_frames, null(), &raw mut scene.frames), OK);
            for i in 0..50_u16 {
                let (t_us, x, y) = (i64::from(i) * 90, i % 40, i % 30);
                assert_eq!(meissner_engine_push(scene.engine, t_us, x, y, 1, null_mut()), OK);
            }
            assert_eq!(meissner_engine_predict(scene.engine, values.as_mut_ptr(), OUTPUTS, null_mut()), OK);
            let (input, live) = (&raw mut scene.input, &raw mut scene.live);
            assert_eq!(meissner_live_new(scene.engine, null(), input, live), OK);
        }
        scene
    }

    fn state(&self) -> State {
        // SAFETY: every pointer is valid.
        unsafe {
            let layers =
                |count: usize| vec![meissner_layer_counters { computed: 0, kept: 0, unchanged: 0 }; count];
            let text = |layers: Vec<meissner_layer_counters>| format!("{layers:?}").into_bytes();
            let count = |network| {
                let mut info: meissner_network_info = struct_of(size_of::<meissner_network_info>());
                assert_eq!(meissner_network_describe(network, &raw mut info), OK);
                info.layers as usize
            };
            let mut of_engine = layers(count(self.network));
            let (pointer, length) = (of_engine.as_mut_ptr(), of_engine.len());
            assert_eq!(meissner_engine_layer_counters(self.engine, pointer, length), OK);
            let mut of_frames = layers(count(self.of_frames));
            let (pointer, length) = (of_frames.as_mut_ptr(), of_frames.len());
            assert_eq!(meissner_frames_layer_counters(self.frames, pointer, length), OK);
            State(vec![
                snapshot(|bytes, room, length| meissner_engine_snapshot(self.engine, bytes, room, length)),
                snapshot(|bytes, room, length| meissner_frames_snapshot(self.frames, bytes, room, length)),
                bytes_of(|counters| meissner_engine_counters(self.engine, counters)),
                bytes_of(|counters| meissner_live_counters(self.live, counters)),
                text(of_engine),
                text(of_frames),
            ])
        }
    }
}

impl Drop for Scene {
    fn drop(&mut self) {
        // SAFETY: the handles are not used again.
        unsafe {
            meissner_live_release(self.live);
            meissner_input_release(self.input);
            meissner_frames_release(self.frames);
            meissner_engine_release(self.engine);
            meissner_network_release(self.of_frames);
            meissner_network_release(self.network);
        }
    }
}

fn error_text() -> String {
    // SAFETY: the text is read before another call fails.
    unsafe { CStr::from_ptr(meissner_error_text()) }.to_string_lossy().into_owned()
}

/// Pointers to `T`: NULL, and a misaligned one.
fn bad<T>(room: *mut u64) -> [*mut T; 2] {
    [null_mut(), room.cast::<T>().wrapping_byte_add(1)]
}

/// Pointers that are refused for a struct: NULL, a misaligned one, and one to a struct without a
/// size.
fn bad_struct<T>(room: *mut u64) -> [*mut T; 3] {
    static NO_SIZE: [u64; 32] = [0; 32];
    let [none, misaligned] = bad(room);
    [none, misaligned, NO_SIZE.as_ptr().cast_mut().cast()]
}

/// Calls with a refused argument: the function, what its message names, what it must return.
#[test]
#[expect(clippy::too_many_lines, reason = "a list of calls")]
fn a_refused_argument_changes_neither_handles_nor_memory() {
    let scene = Scene::new();
    let Scene { network, of_frames, engine, frames, input, live, .. } = scene;
    let room = scene.room.as_ptr().cast_mut();
    let (bytes, floats) = (room.cast::<u8>(), room.cast::<f32>());
    let before = scene.state();
    let mut called = BTreeSet::new();
    let mut refused = |function: &'static str, named: &str, expected: meissner_status, status| {
        called.insert(function);
        let text = error_text();
        assert_eq!(status, expected, "{function}, {named}: {text}");
        assert!(text.contains(named), "{function}, {named}: {text}");
        assert!(scene.room.iter().all(|&word| word == MARK), "{function} wrote although {text}");
        assert!(scene.state() == before, "{function} changed a handle although {text}");
    };
    // Calls `$function`, whose text must name `$named`.
    macro_rules! refuse {
        ($status:ident, $named:expr, $function:ident ( $($argument:expr),* $(,)? )) => {
            // SAFETY: the arguments that are not refused are valid.
            refused(stringify!($function), $named, $status, unsafe { $function($($argument),*) })
        };
    }
    let not_utf8 = NOT_UTF8.as_ptr();
    let name = c"tactip-past".as_ptr();
    let most = u64::MAX.to_string();

    // Networks.
    let options = || -> meissner_network_options { struct_of(size_of::<meissner_network_options>()) };
    let with = |change: fn(&mut meissner_network_options)| {
        let mut made = options();
        change(&mut made);
        made
    };
    let wrong = [
        ("size", meissner_network_options { size: 7, ..options() }),
        ("size", meissner_network_options { size: 4096, ..options() }),
        ("span", with(|options| options.span_us = -1)),
        (&most, with(|options| options.capacity = u64::MAX)),
        (&most, with(|options| options.neighbours = u64::MAX)),
        ("convolution", with(|options| options.convolution = 9)),
        ("ignore_preparation", with(|options| options.ignore_preparation = 7)),
    ];
    for result in bad(room) {
        refuse!(INVALID, "result", meissner_network_open(name, null(), null(), result));
        let (text, length) = (DESCRIPTION.as_ptr().cast(), DESCRIPTION.len());
        refuse!(INVALID, "result", meissner_network_from_bytes(text, length, bytes, 9, null(), result));
    }
    refuse!(INVALID, "network", meissner_network_open(null(), null(), null(), room.cast()));
    refuse!(INVALID, "network", meissner_network_open(not_utf8, null(), null(), room.cast()));
    refuse!(INVALID, "weights", meissner_network_open(name, not_utf8, null(), room.cast()));
    for (named, wrong) in &wrong {
        refuse!(INVALID, named, meissner_network_open(name, null(), wrong, room.cast()));
    }
    let misaligned = bad(room)[1];
    refuse!(INVALID, "options", meissner_network_open(name, null(), misaligned, room.cast()));
    let none: *const c_char = null();
    refuse!(INVALID, "description", meissner_network_from_bytes(none, 1, bytes, 9, null(), room.cast()));
    let text = bytes.cast::<c_char>();
    refuse!(INVALID, "UTF-8", meissner_network_from_bytes(text, 8, bytes, 8, null(), room.cast()));
    refuse!(INVALID, &most, meissner_network_from_bytes(text, usize::MAX, bytes, 9, null(), room.cast()));
    refuse!(INVALID, "weights", meissner_network_from_bytes(text, 8, null(), 9, null(), room.cast()));
    refuse!(INVALID, &most, meissner_network_from_bytes(text, 8, bytes, usize::MAX, null(), room.cast()));
    for length in bad(room) {
        refuse!(INVALID, "length", meissner_network_warnings(network, room.cast(), 8 * ROOM, length));
        refuse!(INVALID, "length", meissner_engine_warnings(engine, room.cast(), 8 * ROOM, length));
    }
    refuse!(INVALID, "text", meissner_network_warnings(network, null_mut(), 9, room.cast()));
    refuse!(INVALID, &most, meissner_network_warnings(network, room.cast(), usize::MAX, room.cast()));
    refuse!(INVALID, "network", meissner_network_warnings(null(), room.cast(), 8 * ROOM, room.cast()));
    refuse!(INVALID, "text", meissner_engine_warnings(engine, null_mut(), 9, room.cast()));
    refuse!(INVALID, &most, meissner_engine_warnings(engine, room.cast(), usize::MAX, room.cast()));
    refuse!(INVALID, "network", meissner_network_describe(null(), room.cast()));
    for info in bad_struct(room) {
        refuse!(INVALID, "info", meissner_network_describe(network, info));
    }
    refuse!(INVALID, "network", meissner_network_output(null(), 0, room.cast(), room.cast()));
    refuse!(INVALID, &most, meissner_network_output(network, usize::MAX, room.cast(), room.cast()));
    refuse!(INVALID, "name", meissner_network_output(network, 0, bad(room)[1], room.cast()));
    refuse!(INVALID, "unit", meissner_network_output(network, 0, room.cast(), bad(room)[1]));

    // Engines.
    let options = || -> meissner_engine_options { struct_of(size_of::<meissner_engine_options>()) };
    let wrong = [
        ("size", meissner_engine_options { size: 0, ..options() }),
        ("size", meissner_engine_options { size: usize::MAX, ..options() }),
        ("late", meissner_engine_options { late: 2, ..options() }),
        ("restart", meissner_engine_options { restart: 2, ..options() }),
        ("restart", meissner_engine_options { restart: 1 << 32, ..options() }),
        ("tolerance", meissner_engine_options { tolerance: -1.0, ..options() }),
        ("tolerance", meissner_engine_options { tolerance: f32::NAN, ..options() }),
    ];
    for (named, wrong) in &wrong {
        refuse!(INVALID, named, meissner_engine_new(network, 40, 30, wrong, room.cast()));
    }
    for result in bad(room) {
        refuse!(INVALID, "result", meissner_engine_new(network, 40, 30, null(), result));
        refuse!(INVALID, "result", meissner_engine_clone(engine, result));
    }
    refuse!(INVALID, "options", meissner_engine_new(network, 40, 30, bad(room)[1], room.cast()));
    refuse!(INVALID, "network", meissner_engine_new(null(), 40, 30, null(), room.cast()));
    refuse!(INVALID, "network", meissner_engine_new(engine.cast(), 40, 30, null(), room.cast()));
    refuse!(INVALID, "sensor", meissner_engine_new(network, 0, 30, null(), room.cast()));
    refuse!(INVALID, "sensor", meissner_engine_new(network, 40, 0, null(), room.cast()));
    // Pointers that are no engines.
    for no in [null_mut(), live.cast(), engine.wrapping_byte_add(1), room.cast::<meissner_engine>()] {
        refuse!(INVALID, "engine", meissner_engine_clone(no, room.cast()));
        refuse!(INVALID, "engine", meissner_engine_push(no, 9_000, 1, 1, 1, room.cast()));
        refuse!(INVALID, "engine", meissner_engine_push_events(no, room.cast(), 1, room.cast()));
        let (t_us, x, polarity) = (room.cast(), room.cast(), room.cast());
        refuse!(INVALID, "engine", meissner_engine_push_arrays(no, t_us, x, x, polarity, 1, room.cast()));
        refuse!(INVALID, "engine", meissner_engine_advance(no, 9_000));
        refuse!(INVALID, "engine", meissner_engine_predict(no, floats, OUTPUTS, room.cast()));
        refuse!(INVALID, "engine", meissner_engine_reset(no));
        refuse!(INVALID, "engine", meissner_engine_warnings(no, room.cast(), 99, room.cast()));
        refuse!(INVALID, "engine", meissner_engine_counters(no, room.cast()));
        refuse!(INVALID, "engine", meissner_engine_layer_counters(no, room.cast(), 99));
        refuse!(INVALID, "engine", meissner_engine_snapshot(no, bytes, 99, room.cast()));
        refuse!(INVALID, "engine", meissner_engine_restore(no, bytes, 99));
        refuse!(INVALID, "engine", meissner_live_new(no, null(), room.cast(), room.cast()));
    }
    let (misaligned, one) = (bad(room)[1], meissner_event { t_us: 9_000, x: 1, y: 1, polarity: 1 });
    refuse!(INVALID, "accepted", meissner_engine_push_events(engine, &raw const one, 1, misaligned));
    refuse!(INVALID, &most, meissner_engine_push_events(engine, &raw const one, usize::MAX, null_mut()));
    let (t_us, x, polarity) = (&raw const one.t_us, &raw const one.x, &raw const one.polarity);
    refuse!(INVALID, "accepted", meissner_engine_push_arrays(engine, t_us, x, x, polarity, 1, misaligned));
    let accepted = room.cast();
    for events in bad(room) {
        refuse!(INVALID, "events", meissner_engine_push_events(engine, events, 1, accepted));
        refuse!(INVALID, "events", meissner_input_push_events(input, events, 1));
    }
    for bad in bad(room) {
        refuse!(INVALID, "t_us", meissner_engine_push_arrays(engine, bad, x, x, polarity, 1, accepted));
        refuse!(INVALID, "t_us", meissner_input_push_arrays(input, bad, x, x, polarity, 1));
    }
    for bad in bad(room) {
        refuse!(INVALID, "x", meissner_engine_push_arrays(engine, t_us, bad, x, polarity, 1, accepted));
        refuse!(INVALID, "y", meissner_engine_push_arrays(engine, t_us, x, bad, polarity, 1, accepted));
        refuse!(INVALID, "x", meissner_input_push_arrays(input, t_us, bad, x, polarity, 1));
        refuse!(INVALID, "y", meissner_input_push_arrays(input, t_us, x, bad, polarity, 1));
    }
    refuse!(INVALID, "polarity", meissner_engine_push_arrays(engine, t_us, x, x, null(), 1, accepted));
    refuse!(INVALID, "polarity", meissner_input_push_arrays(input, t_us, x, x, null(), 1));
    let length = usize::MAX;
    refuse!(INVALID, &most, meissner_engine_push_arrays(engine, t_us, x, x, polarity, length, accepted));
    refuse!(INVALID, &most, meissner_input_push_arrays(input, t_us, x, x, polarity, length));
    refuse!(INVALID, &most, meissner_input_push_events(input, &raw const one, length));

    // Memory that predictions and counts are written to.
    for values in bad(room) {
        refuse!(INVALID, "values", meissner_engine_predict(engine, values, OUTPUTS, room.cast()));
        refuse!(INVALID, "values", meissner_frames_predict(frames, values, 99, room.cast()));
        refuse!(INVALID, "values", meissner_live_predict(live, u64::MAX, values, OUTPUTS, room.cast()));
    }
    for prediction in &bad_struct(room)[1..] {
        refuse!(INVALID, "prediction", meissner_engine_predict(engine, floats, OUTPUTS, *prediction));
        refuse!(INVALID, "prediction", meissner_frames_predict(frames, floats, 99, *prediction));
    }
    for timely in &bad_struct(room)[1..] {
        refuse!(INVALID, "timely", meissner_live_predict(live, u64::MAX, floats, OUTPUTS, *timely));
    }
    for length in 0..OUTPUTS {
        refuse!(SMALL, "values", meissner_engine_predict(engine, floats, length, room.cast()));
        refuse!(SMALL, "values", meissner_live_predict(live, u64::MAX, floats, length, room.cast()));
    }
    refuse!(SMALL, "values", meissner_frames_predict(frames, floats, 1, room.cast()));
    refuse!(INVALID, &most, meissner_engine_predict(engine, floats, usize::MAX, room.cast()));
    refuse!(INVALID, &most, meissner_frames_predict(frames, floats, usize::MAX, room.cast()));
    refuse!(INVALID, &most, meissner_live_predict(live, 0, floats, usize::MAX, room.cast()));
    for counters in bad_struct(room) {
        refuse!(INVALID, "counters", meissner_engine_counters(engine, counters));
        refuse!(INVALID, "counters", meissner_live_event_counters(live, counters));
    }
    for counters in bad_struct(room) {
        refuse!(INVALID, "counters", meissner_live_counters(live, counters));
    }
    for layers in bad(room) {
        refuse!(INVALID, "layers", meissner_engine_layer_counters(engine, layers, 99));
        refuse!(INVALID, "layers", meissner_frames_layer_counters(frames, layers, 99));
    }
    refuse!(SMALL, "layers", meissner_engine_layer_counters(engine, room.cast(), 1));
    refuse!(SMALL, "layers", meissner_frames_layer_counters(frames, room.cast(), 1));

    // Snapshots.
    for length in bad(room) {
        refuse!(INVALID, "length", meissner_engine_snapshot(engine, bytes, 8 * ROOM, length));
        refuse!(INVALID, "length", meissner_frames_snapshot(frames, bytes, 8 * ROOM, length));
    }
    let length = room.cast();
    refuse!(INVALID, "bytes", meissner_engine_snapshot(engine, null_mut(), 8 * ROOM, length));
    refuse!(INVALID, "bytes", meissner_frames_snapshot(frames, null_mut(), 8 * ROOM, length));
    refuse!(INVALID, &most, meissner_engine_snapshot(engine, bytes, usize::MAX, length));
    refuse!(INVALID, &most, meissner_frames_snapshot(frames, bytes, usize::MAX, length));
    refuse!(INVALID, "bytes", meissner_engine_restore(engine, null(), 99));
    refuse!(INVALID, "bytes", meissner_frames_restore(frames, null(), 99));
    refuse!(INVALID, &most, meissner_engine_restore(engine, bytes, usize::MAX));
    refuse!(INVALID, &most, meissner_frames_restore(frames, bytes, usize::MAX));
    refuse!(NO_SNAPSHOT, "snapshot", meissner_engine_restore(engine, bytes, 99));
    refuse!(NO_SNAPSHOT, "snapshot", meissner_frames_restore(frames, bytes, 99));

    // Frames.
    let options = || -> meissner_frames_options { struct_of(size_of::<meissner_frames_options>()) };
    let wrong = [
        ("size", meissner_frames_options { size: 1, ..options() }),
        ("size", meissner_frames_options { size: 4096, ..options() }),
        ("skip", meissner_frames_options { skip: 3, ..options() }),
        ("tolerance", meissner_frames_options { skip: 2, tolerance: -1.0, ..options() }),
        ("sparse", meissner_frames_options { sparse: 2, ..options() }),
        ("two_threads", meissner_frames_options { two_threads: 2, ..options() }),
    ];
    for (named, wrong) in &wrong {
        refuse!(INVALID, named, meissner_frames_new(of_frames, wrong, room.cast()));
    }
    for result in bad(room) {
        refuse!(INVALID, "result", meissner_frames_new(of_frames, null(), result));
    }
    refuse!(INVALID, "options", meissner_frames_new(of_frames, bad(room)[1], room.cast()));
    refuse!(INVALID, "network", meissner_frames_new(null(), null(), room.cast()));
    for values in bad(room) {
        refuse!(INVALID, "values", meissner_frames_push(frames, values, 1));
    }
    refuse!(INVALID, "values", meissner_frames_push(frames, floats, 1));
    refuse!(INVALID, &most, meissner_frames_push(frames, floats, usize::MAX));
    for no in [null_mut(), engine.cast::<meissner_frames>()] {
        refuse!(INVALID, "frames", meissner_frames_push(no, floats, 1));
        refuse!(INVALID, "frames", meissner_frames_predict(no, floats, 99, room.cast()));
        refuse!(INVALID, "frames", meissner_frames_reset(no));
        refuse!(INVALID, "frames", meissner_frames_layer_counters(no, room.cast(), 99));
        refuse!(INVALID, "frames", meissner_frames_snapshot(no, bytes, 99, room.cast()));
        refuse!(INVALID, "frames", meissner_frames_restore(no, bytes, 99));
    }

    // Live engines.
    let options = || -> meissner_live_options { struct_of(size_of::<meissner_live_options>()) };
    let wrong = [
        ("size", meissner_live_options { size: 0, ..options() }),
        ("size", meissner_live_options { size: 4096, ..options() }),
        (&*most, meissner_live_options { capacity: u64::MAX, ..options() }),
        (&*most, meissner_live_options { batch: u64::MAX, ..options() }),
        ("overload", meissner_live_options { overload: 4, ..options() }),
        ("stride", meissner_live_options { overload: 3, ..options() }),
        (&*most, meissner_live_options { ahead: u64::MAX, ..options() }),
    ];
    for (named, wrong) in &wrong {
        refuse!(INVALID, named, meissner_live_new(engine, wrong, room.cast(), room.cast()));
    }
    for side in bad(room) {
        refuse!(INVALID, "input", meissner_live_new(engine, null(), side, room.cast()));
    }
    for side in bad(room) {
        refuse!(INVALID, "live", meissner_live_new(engine, null(), room.cast(), side));
    }
    refuse!(INVALID, "options", meissner_live_new(engine, bad(room)[1], room.cast(), room.cast()));
    for no in [null_mut(), live.cast::<meissner_input>()] {
        refuse!(INVALID, "input", meissner_input_push_events(no, &raw const one, 1));
        refuse!(INVALID, "input", meissner_input_push_arrays(no, t_us, x, x, polarity, 1));
        refuse!(INVALID, "input", meissner_input_advance(no, 9_000));
    }
    for no in [null_mut(), input.cast::<meissner_live>()] {
        refuse!(INVALID, "live", meissner_live_predict(no, 0, floats, OUTPUTS, room.cast()));
        refuse!(INVALID, "live", meissner_live_counters(no, room.cast()));
        refuse!(INVALID, "live", meissner_live_event_counters(no, room.cast()));
        refuse!(INVALID, "live", meissner_live_close(no, room.cast()));
    }
    for engine in bad(room) {
        refuse!(INVALID, "engine", meissner_live_close(live, engine));
    }

    // No function is left out.
    let header = Path::new(env!("CARGO_MANIFEST_DIR")).join("include/meissner.h");
    let header = std::fs::read_to_string(header).expect("the header");
    let functions =
        header.lines().filter_map(|line| line.strip_prefix("enum meissner_status ")?.split_once('('));
    let functions: BTreeSet<&str> = functions.map(|(name, _)| name).collect();
    assert_eq!(called, functions);
}
