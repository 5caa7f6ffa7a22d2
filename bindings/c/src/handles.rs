//! Handles: what C holds instead of pointers, and the values behind them.
//!
//! A handle is a number, not an address. It identifies a slot of a table and one of the slot's
//! successive values. So a call recognizes a handle that has ended. A call that begins while
//! another thread releases the handle finds the value or is refused. It never reads freed memory,
//! because slots stay.
//!
//! ```text
//! bits of a handle (64):  generation 36 | slot 24 | kind 4
//! call:     lock of the slot, without waiting -> the generation is that of the handle? -> value
//! release:  next generation -> waits for the lock -> takes the value
//! ```

use std::marker::PhantomData;
use std::process;
use std::ptr;
use std::sync::atomic::{AtomicU32, AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, OnceLock, PoisonError, TryLockError};

use crate::status::{Failure, Status, call};

const KIND_BITS: u32 = 4;
pub(crate) const SLOT_BITS: u32 = if usize::BITS == 64 { 24 } else { 16 };
const GENERATIONS: usize = usize::MAX >> (KIND_BITS + SLOT_BITS);
/// The generation of a new slot: no processor maps such an address, so a read of it stops the
/// program.
const FIRST: usize = GENERATIONS / 4 + 1;
/// Slots of the first chunk; each later chunk has twice as many as the one before.
pub(crate) const CHUNK: usize = 16;
pub(crate) const CHUNKS: usize = (SLOT_BITS - CHUNK.ilog2()) as usize;

/// The values of one kind of handle. The handles are pointers to `H` for C. One thread at a time
/// uses a value.
pub(crate) struct Handles<H, T> {
    kind: usize,
    /// Whether the values have threads, which a forked child does not have.
    has_threads: bool,
    /// Name of such a handle in messages.
    name: &'static str,
    /// Chunks are made when they are needed, and stay.
    chunks: [OnceLock<Box<[Slot<T>]>>; CHUNKS],
    free: Mutex<Free>,
    pointers: PhantomData<fn(*const H)>,
}

struct Slot<T> {
    generation: AtomicUsize,
    /// The process that made the value. In a forked child, another thread's lock is never freed.
    process: AtomicU32,
    /// Poisoned after a call that did not return: the value may then be in any state.
    value: Mutex<Option<Box<T>>>,
}

/// Slots without a value.
struct Free {
    left: Vec<usize>,
    /// Number of slots that have ever had a value.
    used: usize,
}

impl<H, T: Send> Handles<H, T> {
    /// A table. `kind` is 1 to 15 and different for each table.
    pub(crate) const fn new(kind: usize, name: &'static str) -> Self {
        Self {
            kind,
            has_threads: false,
            name,
            chunks: [const { OnceLock::new() }; CHUNKS],
            free: Mutex::new(Free { left: Vec::new(), used: 0 }),
            pointers: PhantomData,
        }
    }

    /// A table of values that have threads: in a forked child, every call is refused.
    pub(crate) const fn with_threads(kind: usize, name: &'static str) -> Self {
        let mut made = Self::new(kind, name);
        made.has_threads = true;
        made
    }

    /// Makes a handle of `value`.
    pub(crate) fn add(&self, value: T) -> Result<*mut H, Failure> {
        let mut free = self.free.lock().unwrap_or_else(PoisonError::into_inner);
        let index = match free.left.pop() {
            Some(index) => index,
            None if free.used < CHUNK * ((1 << CHUNKS) - 1) => {
                free.used += 1;
                free.used - 1
            }
            None => {
                let text = format!("{}: expected at most {} at a time", self.name, free.used);
                return Err(Failure::new(Status::MEISSNER_MEMORY_LIMIT, text));
            }
        };
        drop(free);
        let (chunk, place) = place(index);
        let slots = self.chunks[chunk].get_or_init(|| (0..CHUNK << chunk).map(|_| Slot::new()).collect());
        let slot = &slots[place];
        slot.process.store(process::id(), Ordering::Relaxed);
        slot.value.clear_poison();
        *slot.value.lock().unwrap_or_else(PoisonError::into_inner) = Some(Box::new(value));
        let generation = slot.generation.load(Ordering::Relaxed);
        let number = (generation << SLOT_BITS | index) << KIND_BITS | self.kind;
        Ok(ptr::without_provenance_mut(number))
    }

    /// Runs `body` on the value of `handle`; refuses if another call is using it.
    pub(crate) fn with<R>(
        &self,
        handle: *const H,
        body: impl FnOnce(&mut T) -> Result<R, Failure>,
    ) -> Result<R, Failure> {
        let (slot, generation) = self.find(handle)?;
        body(self.hold(slot, generation)?.as_mut().ok_or_else(|| self.ended())?)
    }

    /// As [`Self::with`], for a `body` that cannot fail.
    pub(crate) fn act(&self, handle: *const H, body: impl FnOnce(&mut T)) -> Result<(), Failure> {
        self.with(handle, |value| {
            body(value);
            Ok(())
        })
    }

    /// Ends `handle` and returns its value; refuses, without a change, if another call uses it.
    pub(crate) fn take(&self, handle: *const H) -> Result<T, Failure> {
        let (slot, generation) = self.find(handle)?;
        let mut value = self.hold(slot, generation)?;
        // A release that began meanwhile takes the value.
        if !slot.end(generation) {
            return Err(self.ended());
        }
        let value = value.take().ok_or_else(|| self.ended());
        self.give_back(handle);
        Ok(*value?)
    }

    /// Ends `handle` and drops its value when no call uses it any more. Ignores NULL, handles that
    /// have ended and pointers that are no handles.
    pub(crate) fn release(&self, handle: *const H) {
        let Ok((slot, generation)) = self.find(handle) else { return };
        // From here on no call begins. Only a call that is already inside can finish.
        if !slot.end(generation) {
            return;
        }
        let is_ours = slot.process.load(Ordering::Relaxed) == process::id();
        let value = match slot.value.try_lock() {
            // The thread that holds the value, or that would have to end, is not in this process.
            Err(TryLockError::WouldBlock) if !is_ours => return,
            Ok(_) if self.has_threads && !is_ours => return,
            Err(TryLockError::WouldBlock) => slot.value.lock().unwrap_or_else(PoisonError::into_inner).take(),
            Err(TryLockError::Poisoned(poisoned)) => poisoned.into_inner().take(),
            Ok(mut value) => value.take(),
        };
        self.give_back(handle);
        call(|| {
            drop(value);
            Ok(())
        });
    }

    /// The slot of a handle, and the generation that the handle states.
    fn find(&self, handle: *const H) -> Result<(&Slot<T>, usize), Failure> {
        let number = handle.addr();
        if number == 0 {
            return Err(Failure::argument(self.name, "a handle", "NULL"));
        }
        let (chunk, place) = place(index(handle));
        let slots = self.chunks.get(chunk).and_then(OnceLock::get);
        match slots.and_then(|slots| slots.get(place)) {
            Some(slot) if number % (1 << KIND_BITS) == self.kind => {
                Ok((slot, number >> (KIND_BITS + SLOT_BITS)))
            }
            _ => {
                let text = format!("{handle:p}, which is none");
                Err(Failure::argument(self.name, format!("a handle of this kind ({})", self.name), text))
            }
        }
    }

    /// The value of a slot, for one call.
    fn hold<'a>(
        &self,
        slot: &'a Slot<T>,
        generation: usize,
    ) -> Result<MutexGuard<'a, Option<Box<T>>>, Failure> {
        let is_there = || slot.generation.load(Ordering::Acquire) == generation;
        if self.has_threads && slot.process.load(Ordering::Relaxed) != process::id() {
            return Err(if is_there() { forked(self.name) } else { self.ended() });
        }
        let found = slot.value.try_lock();
        if !is_there() {
            return Err(self.ended());
        }
        match found {
            Ok(value) => Ok(value),
            Err(TryLockError::WouldBlock) => {
                let text = format!("{}: another thread is using this handle", self.name);
                Err(Failure::new(Status::MEISSNER_BUSY, text))
            }
            Err(TryLockError::Poisoned(_)) => {
                let text = "a fault in the library during an earlier call; release this handle";
                Err(Failure::new(Status::MEISSNER_PANICKED, format!("{}: {text}", self.name)))
            }
        }
    }

    /// The slot may hold another value from now on.
    fn give_back(&self, handle: *const H) {
        self.free.lock().unwrap_or_else(PoisonError::into_inner).left.push(index(handle));
    }

    fn ended(&self) -> Failure {
        let text = format!("{}: expected a handle, found one that was closed or released", self.name);
        Failure::new(Status::MEISSNER_CLOSED, text)
    }
}

impl<H, T: Send + Clone> Handles<H, T> {
    /// A copy of the value of `handle`. Any number of threads may request it at once.
    pub(crate) fn get(&self, handle: *const H) -> Result<T, Failure> {
        let (slot, generation) = self.find(handle)?;
        // The lock is held only for a copy.
        let value = slot.value.lock().unwrap_or_else(PoisonError::into_inner);
        let is_there = slot.generation.load(Ordering::Acquire) == generation;
        value.as_deref().filter(|_| is_there).cloned().ok_or_else(|| self.ended())
    }
}

impl<T> Slot<T> {
    fn new() -> Self {
        Self { generation: AtomicUsize::new(FIRST), process: AtomicU32::new(0), value: Mutex::new(None) }
    }

    /// Ends `generation`. Returns whether it was the slot's current generation.
    fn end(&self, generation: usize) -> bool {
        let next = if generation == GENERATIONS { 0 } else { generation + 1 };
        self.generation.compare_exchange(generation, next, Ordering::AcqRel, Ordering::Acquire).is_ok()
    }
}

/// The failure of a call that needs threads of the process that forked this one.
pub(crate) fn forked(name: &str) -> Failure {
    let expected = "one that was made in this process, after the fork";
    let text =
        format!("{name}: expected {expected}, found one with threads of the process that forked this one");
    Failure::new(Status::MEISSNER_FORKED, text)
}

/// Index of a handle's slot.
pub(crate) fn index<H>(handle: *const H) -> usize {
    handle.addr() >> KIND_BITS & ((1 << SLOT_BITS) - 1)
}

/// Chunk of a slot, and its index in the chunk.
pub(crate) fn place(index: usize) -> (usize, usize) {
    let chunk = (index / CHUNK + 1).ilog2();
    (chunk as usize, index - CHUNK * ((1 << chunk) - 1))
}
