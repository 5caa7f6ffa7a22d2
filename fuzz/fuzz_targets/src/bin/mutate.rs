//! Mutates the corpora and counts the outcomes, with time and memory of the worst input.
//!
//! `mutate [TARGET..] [--count N] [--seed N] [--seconds N]`: without targets all of them, without a
//! count 100,000 inputs of each. A panic, an input of more than 10 s, or of more than 1 GiB ends
//! the program, and the input is written to a file. Input `i` depends only on the seed and `i`.
#![allow(unsafe_code, reason = "a global allocator cannot be written without; this one only counts")]

use std::alloc::{GlobalAlloc, Layout, System};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::process::ExitCode;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use meissner_fuzz::{Mutator, TARGETS, Target, Verdict, corpus};

/// Longest time of an input.
const MAX: Duration = Duration::from_secs(10);
/// Maximum memory of an input, in bytes.
const MAX_BYTES: usize = 1 << 30;

/// The system's allocator, counted.
struct Counting;

/// Bytes allocated and not freed.
static HELD: AtomicUsize = AtomicUsize::new(0);
/// Maximum of `HELD` since the last reset.
static PEAK: AtomicUsize = AtomicUsize::new(0);

fn hold(bytes: usize) {
    let held = HELD.fetch_add(bytes, Ordering::Relaxed) + bytes;
    PEAK.fetch_max(held, Ordering::Relaxed);
}

// SAFETY: every call goes to the system's allocator as it came; counting touches no memory.
unsafe impl GlobalAlloc for Counting {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        hold(layout.size());
        // SAFETY: the caller's promise about `layout` is the one that the allocator asks for.
        unsafe { System.alloc(layout) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        hold(layout.size());
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(layout) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // Both blocks may exist while one is copied to the other.
        hold(size);
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: as above, also about `block`, which this allocator gave with `layout`.
        unsafe { System.realloc(block, layout, size) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        HELD.fetch_sub(layout.size(), Ordering::Relaxed);
        // SAFETY: as above, also about `block`, which this allocator gave with `layout`.
        unsafe { System.dealloc(block, layout) }
    }
}

#[global_allocator]
static ALLOCATOR: Counting = Counting;

/// The running input, and its start.
static RUNNING: Mutex<Option<Running>> = Mutex::new(None);

struct Running {
    target: &'static str,
    index: u64,
    since: Instant,
    input: Vec<u8>,
}

/// The arguments of the command line.
struct Arguments {
    targets: Vec<Target>,
    count: u64,
    seed: u64,
    most: Duration,
}

impl Arguments {
    fn parse(mut words: impl Iterator<Item = String>) -> Result<Self, String> {
        let mut arguments = Self { targets: vec![], count: 100_000, seed: 1, most: Duration::MAX };
        while let Some(word) = words.next() {
            let mut number = || -> Result<u64, String> {
                let value = words.next().unwrap_or_default();
                value.parse().map_err(|_| format!("{word}: expected a number, found {value:?}"))
            };
            match word.as_str() {
                "--count" => arguments.count = number()?,
                "--seed" => arguments.seed = number()?,
                "--seconds" => arguments.most = Duration::from_secs(number()?),
                name => {
                    let Some(target) = TARGETS.into_iter().find(|target| target.name == name) else {
                        let names = TARGETS.map(|target| target.name).join(", ");
                        return Err(format!(
                            "expected one of {names}; --count, --seed, --seconds; found {name:?}"
                        ));
                    };
                    arguments.targets.push(target);
                }
            }
        }
        if arguments.targets.is_empty() {
            arguments.targets = TARGETS.into();
        }
        Ok(arguments)
    }
}

/// The outcome of a target's inputs.
#[derive(Default)]
struct Row {
    inputs: u64,
    accepted: u64,
    longest: Duration,
    bytes: usize,
    failures: Vec<String>,
}

/// Writes an input that broke a promise; returns the name of the file.
fn keep(target: &str, index: u64, input: &[u8]) -> String {
    let file = format!("failure-{target}-{index}");
    match std::fs::write(&file, input) {
        Ok(()) => file,
        Err(error) => format!("{file} ({error})"),
    }
}

/// Ends the program if an input does not finish.
fn watch() {
    loop {
        thread::sleep(Duration::from_secs(1));
        let running = RUNNING.lock().unwrap_or_else(PoisonError::into_inner);
        if let Some(running) = running.as_ref().filter(|running| running.since.elapsed() > 3 * MAX) {
            let file = keep(running.target, running.index, &running.input);
            eprintln!("{}: input {} has no end: {file}", running.target, running.index);
            std::process::exit(1);
        }
    }
}

fn run(target: Target, arguments: &Arguments) -> Result<Row, String> {
    let inputs = corpus::read(target.name).map_err(|e| format!("corpus of {}: {e}", target.name))?;
    let mutator = Mutator::new(&inputs, arguments.seed);
    // Objects that are made once do not count for an input.
    inputs.iter().for_each(|(_, bytes)| drop(catch_unwind(|| (target.run)(bytes))));
    let (start, mut row) = (Instant::now(), Row::default());
    for index in 0..arguments.count {
        if start.elapsed() > arguments.most || row.failures.len() > 20 {
            break;
        }
        let input = mutator.input(index);
        let since = Instant::now();
        *RUNNING.lock().unwrap_or_else(PoisonError::into_inner) =
            Some(Running { target: target.name, index, since, input: input.clone() });
        let before = HELD.load(Ordering::Relaxed);
        PEAK.store(before, Ordering::Relaxed);
        let verdict = catch_unwind(AssertUnwindSafe(|| (target.run)(&input)));
        let (elapsed, bytes) = (since.elapsed(), PEAK.load(Ordering::Relaxed).saturating_sub(before));
        row.inputs += 1;
        row.accepted += u64::from(matches!(verdict, Ok(Verdict::Accepted)));
        row.longest = row.longest.max(elapsed);
        row.bytes = row.bytes.max(bytes);
        if verdict.is_err() || elapsed > MAX || bytes > MAX_BYTES {
            let file = keep(target.name, index, &input);
            let panicked = if verdict.is_err() { "panicked, " } else { "" };
            row.failures.push(format!("{panicked}{elapsed:.1?}, {bytes} bytes: {file}"));
        }
    }
    *RUNNING.lock().unwrap_or_else(PoisonError::into_inner) = None;
    let rate = row.inputs as f64 / start.elapsed().as_secs_f64().max(1e-9);
    println!(
        "| {:14} | {:>9} | {:>9} | {:>9} | {:>10.2} | {:>11} | {:>9.0} |",
        target.name,
        row.inputs,
        row.accepted,
        row.inputs - row.accepted,
        row.longest.as_secs_f64() * 1e3,
        row.bytes >> 10,
        rate
    );
    Ok(row)
}

fn main() -> ExitCode {
    let arguments = match Arguments::parse(std::env::args().skip(1)) {
        Ok(arguments) => arguments,
        Err(message) => {
            eprintln!("{message}");
            return ExitCode::FAILURE;
        }
    };
    thread::spawn(watch);
    println!("| target         |    inputs |  accepted |   refused | longest ms | largest KiB |  inputs/s |");
    println!("|----------------|----------:|----------:|----------:|-----------:|------------:|----------:|");
    let mut failed = false;
    for &target in &arguments.targets {
        match run(target, &arguments) {
            Ok(row) => {
                row.failures.iter().for_each(|failure| eprintln!("{}: {failure}", target.name));
                failed |= !row.failures.is_empty();
            }
            Err(message) => {
                eprintln!("{message}");
                failed = true;
            }
        }
    }
    if failed { ExitCode::FAILURE } else { ExitCode::SUCCESS }
}
