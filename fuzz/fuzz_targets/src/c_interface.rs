//! Bytes as calls of the C interface in any order, with pointers that may be NULL or misaligned,
//! lengths of any size within the memory, and structs that state any size. The values agree with an
//! engine of Rust bit for bit.
#![allow(unsafe_code, reason = "the interface takes raw pointers")]
#![allow(clippy::wildcard_imports, reason = "its names begin with its own")]

use std::mem::offset_of;
use std::ptr::{null, null_mut};
use std::sync::LazyLock;

use ::meissner_engine::{Engine, Event, LatePolicy, Network, Options, Outcome, Sensor};
use meissner_c::*;
use meissner_models::{Description, Weights, drawn_file};

use crate::Verdict;
use crate::oracle::Choices;
use crate::weights::NETWORK;

const OK: meissner_status = meissner_status::MEISSNER_OK;
const INVALID: meissner_status = meissner_status::MEISSNER_INVALID_ARGUMENT;
const SMALL: meissner_status = meissner_status::MEISSNER_BUFFER_TOO_SMALL;
const SENSOR: Sensor = Sensor { width: 12, height: 9 };
/// Maximum number of calls, and of events of a call.
const CALLS: usize = 100;
const EVENTS: usize = 24;
/// Bytes after every passed struct; the struct may state any size within them.
const ROOM: usize = 128;

static WEIGHTS: LazyLock<Vec<u8>> =
    LazyLock::new(|| drawn_file(&Description::parse(NETWORK).expect("a consistent description"), 1));

static RUST: LazyLock<Network> = LazyLock::new(|| {
    let weights = Weights::from_bytes(&WEIGHTS).expect("weights that were just written");
    Description::parse(NETWORK).expect("a consistent description").network(&weights).expect("its weights")
});

/// A struct of the interface in a longer memory, aligned or not.
#[repr(align(8))]
struct Room([u8; ROOM + 8]);

impl Room {
    /// A struct whose first field states `size`, followed by `fields`.
    fn new(size: usize, fields: &[u8]) -> Self {
        let mut room = [0; ROOM + 8];
        room[..8].copy_from_slice(&size.to_ne_bytes());
        room[8..8 + fields.len()].copy_from_slice(fields);
        Self(room)
    }

    fn pointer<T>(&mut self) -> *mut T {
        self.0.as_mut_ptr().cast()
    }
}

/// A size that a struct may state: any size within its memory.
fn size(choices: &mut Choices<'_>) -> usize {
    choices.within(0, ROOM)
}

/// A pointer to `values`, and whether the interface accepts it.
fn pointer<T>(choices: &mut Choices<'_>, values: &[T]) -> (*const T, bool) {
    match choices.byte() {
        0 => (null(), false),
        // Never read, because it is refused; a single byte is never misaligned.
        1 if align_of::<T>() > 1 => (values.as_ptr().wrapping_byte_add(1), false),
        _ => (values.as_ptr(), true),
    }
}

/// # Panics
/// If a promise is broken.
pub(crate) fn c_interface(bytes: &[u8]) -> Verdict {
    let mut choices = Choices::new(bytes);
    let (mut network, mut engine) = (null_mut(), null_mut());
    let (stated, late) = (size(&mut choices), choices.within(0, 2) as u32);
    let mut fields = [0; 16];
    fields[12..].copy_from_slice(&late.to_le_bytes());
    let mut options = Room::new(stated, &fields);
    // SAFETY: every pointer is valid for the length or the size that is stated.
    let status = unsafe {
        let description = NETWORK.as_ptr().cast();
        let weights = (WEIGHTS.as_ptr(), WEIGHTS.len());
        let result = &raw mut network;
        assert_eq!(
            meissner_network_from_bytes(description, NETWORK.len(), weights.0, weights.1, null(), result),
            OK
        );
        let status =
            meissner_engine_new(network, SENSOR.width, SENSOR.height, options.pointer(), &raw mut engine);
        meissner_network_release(network);
        status
    };
    // The field's first byte is read if the size reaches it; no version has a larger size.
    let known = size_of::<meissner_engine_options>();
    let read = if stated > offset_of!(meissner_engine_options, late) { late } else { 0 };
    if !(8..=known).contains(&stated) || read > 1 {
        assert_eq!((status, engine.is_null()), (INVALID, true));
        return Verdict::Refused;
    }
    assert_eq!(status, OK);
    let late = if read == 1 { LatePolicy::Clamp } else { LatePolicy::Drop };
    let rust = Engine::with_options(RUST.clone(), SENSOR, Options::new().with_late(late)).expect("an engine");
    let mut pair = Pair { engine, rust, now: 0, kept: None };
    for _ in 0..CALLS {
        if choices.is_empty() {
            break;
        }
        pair.step(&mut choices);
    }
    pair.predict(&mut choices);
    Verdict::Accepted
}

/// The same engine behind either interface.
struct Pair {
    engine: *mut meissner_engine,
    rust: Engine,
    now: i64,
    /// A snapshot.
    kept: Option<Vec<u8>>,
}

impl Drop for Pair {
    fn drop(&mut self) {
        // SAFETY: the handle is not used again.
        unsafe { meissner_engine_release(self.engine) };
    }
}

impl Pair {
    fn step(&mut self, choices: &mut Choices<'_>) {
        match choices.byte() {
            0..60 => self.push(choices),
            60..110 => self.push_events(choices),
            110..150 => self.push_arrays(choices),
            150..170 => {
                let t_us = self.time(choices);
                // SAFETY: the handle is valid.
                assert_eq!(unsafe { meissner_engine_advance(self.engine, t_us) }, OK);
                self.rust.advance(t_us);
            }
            170..180 => {
                // SAFETY: the handle is valid.
                assert_eq!(unsafe { meissner_engine_reset(self.engine) }, OK);
                self.rust.reset();
            }
            180..200 => self.counters(choices),
            200..215 => self.snapshot(choices),
            215..230 => self.restore(choices),
            _ => self.predict(choices),
        }
    }

    fn time(&mut self, choices: &mut Choices<'_>) -> i64 {
        self.now = match choices.byte() {
            step @ 0..220 => self.now.saturating_add(step.into()),
            step @ 220..250 => self.now.saturating_sub(step.into()),
            250.. => choices.u64() as i64,
        };
        self.now
    }

    fn event(&mut self, choices: &mut Choices<'_>) -> meissner_event {
        let t_us = self.time(choices);
        let [x, y] = [choices.byte() % 14, choices.byte() % 10].map(u16::from);
        meissner_event { t_us, x, y, polarity: choices.byte() as i8 }
    }

    fn rust_push(&mut self, event: meissner_event) -> bool {
        self.rust.push(Event::new(event.t_us, event.x, event.y, event.polarity > 0)) == Outcome::Accepted
    }

    fn push(&mut self, choices: &mut Choices<'_>) {
        let event = self.event(choices);
        let meissner_event { t_us, x, y, polarity } = event;
        let mut accepted = false;
        // SAFETY: the handle and the pointer are valid.
        let status = unsafe { meissner_engine_push(self.engine, t_us, x, y, polarity, &raw mut accepted) };
        assert_eq!((status, accepted), (OK, self.rust_push(event)));
    }

    fn events(&mut self, choices: &mut Choices<'_>) -> Vec<meissner_event> {
        (0..choices.within(0, EVENTS)).map(|_| self.event(choices)).collect()
    }

    fn push_events(&mut self, choices: &mut Choices<'_>) {
        let events = self.events(choices);
        let (pointer, valid) = pointer(choices, &events);
        let (mut count, misaligned) = (usize::MAX, choices.byte() == 0);
        let accepted = (&raw mut count).wrapping_byte_add(misaligned.into());
        // SAFETY: the handle is valid, and each pointer is, or is refused.
        let status = unsafe { meissner_engine_push_events(self.engine, pointer, events.len(), accepted) };
        assert_eq!(status == OK, count != usize::MAX, "a count is written only where events were taken");
        self.pushed(status, (valid || events.is_empty()) && !misaligned, &events);
    }

    fn push_arrays(&mut self, choices: &mut Choices<'_>) {
        let events = self.events(choices);
        let t_us: Vec<i64> = events.iter().map(|event| event.t_us).collect();
        let x: Vec<u16> = events.iter().map(|event| event.x).collect();
        let y: Vec<u16> = events.iter().map(|event| event.y).collect();
        let polarity: Vec<i8> = events.iter().map(|event| event.polarity).collect();
        let (t_us, first) = pointer(choices, &t_us);
        let (x, second) = pointer(choices, &x);
        let (y, third) = pointer(choices, &y);
        let (polarity, fourth) = pointer(choices, &polarity);
        // SAFETY: the handle is valid, and each pointer is, or is refused.
        let status = unsafe {
            meissner_engine_push_arrays(self.engine, t_us, x, y, polarity, events.len(), null_mut())
        };
        self.pushed(status, first && second && third && fourth || events.is_empty(), &events);
    }

    /// After a push of `events` that was taken or refused as a whole.
    fn pushed(&mut self, status: meissner_status, taken: bool, events: &[meissner_event]) {
        assert_eq!(status, if taken { OK } else { INVALID });
        if taken {
            events.iter().for_each(|&event| {
                self.rust_push(event);
            });
        }
    }

    fn predict(&mut self, choices: &mut Choices<'_>) {
        let (mut values, room) = ([f32::NAN; 4], choices.within(0, 4));
        let (stated, wanted) = (size(choices), choices.flag());
        let mut prediction = Room::new(stated, &[]);
        let of = if wanted { prediction.pointer() } else { null_mut() };
        // SAFETY: the handle is valid, `values` has that room, and the struct is as long as stated.
        let status = unsafe { meissner_engine_predict(self.engine, values.as_mut_ptr(), room, of) };
        if wanted && stated < 8 {
            assert_eq!(status, INVALID);
        } else if room == 0 {
            assert_eq!(status, SMALL);
        } else {
            let expected = self.rust.predict().expect("finite weights");
            assert_eq!((status, values[0].to_bits()), (OK, expected.values[0].to_bits()));
            let written = 8..stated.clamp(8, size_of::<meissner_prediction>());
            let rest = if wanted { written.end } else { 8 };
            assert!(prediction.0[rest..].iter().all(|&byte| byte == 0), "no byte beyond the stated size");
        }
    }

    fn counters(&mut self, choices: &mut Choices<'_>) {
        let stated = size(choices);
        let mut counters = Room::new(stated, &[]);
        // SAFETY: the handle is valid, and the struct is as long as it states.
        let status = unsafe { meissner_engine_counters(self.engine, counters.pointer()) };
        assert_eq!(status, if stated < 8 { INVALID } else { OK });
        if stated >= 16 {
            let pushed = u64::from_ne_bytes(std::array::from_fn(|i| counters.0[8 + i]));
            assert_eq!(pushed, self.rust.counters().events.pushed);
        }
    }

    fn snapshot(&mut self, choices: &mut Choices<'_>) {
        let (mut bytes, mut length) = (vec![0_u8; usize::from(choices.u16()) % 8192], 0);
        // SAFETY: the handle and the pointers are valid.
        let status = unsafe {
            meissner_engine_snapshot(self.engine, bytes.as_mut_ptr(), bytes.len(), &raw mut length)
        };
        let expected = self.rust.to_bytes();
        assert_eq!(length, expected.len());
        assert_eq!(status, if bytes.len() < length { SMALL } else { OK });
        if status == OK {
            bytes.truncate(length);
            assert!(bytes == expected, "the bytes of the engine's own snapshot");
            self.kept = Some(bytes);
        }
    }

    fn restore(&mut self, choices: &mut Choices<'_>) {
        let Some(bytes) = &self.kept else { return };
        let (mut bytes, damaged) = (bytes.clone(), choices.option(Choices::u16));
        if let Some(at) = damaged {
            let at = usize::from(at) % bytes.len();
            bytes[at] ^= 1 << (at % 8);
        }
        // SAFETY: the handle and the pointer are valid.
        let status = unsafe { meissner_engine_restore(self.engine, bytes.as_ptr(), bytes.len()) };
        if damaged.is_some() {
            assert_eq!(status, meissner_status::MEISSNER_INVALID_SNAPSHOT);
        } else {
            assert_eq!(status, OK);
            self.rust.restore_bytes(&bytes).expect("a snapshot of this engine");
        }
    }
}
