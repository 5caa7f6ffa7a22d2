//! The controller: 1 kHz, events from UDP, predictions by a deadline, targets for a wrist.
//!
//!     cargo run --release -p meissner-controller --bin controller -- [CYCLES]
use std::net::UdpSocket;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::Duration;

use meissner::live::{Live, QueueOptions};
use meissner::{Description, Engine, Weights};
use meissner_controller::{Failure, feed, run};
use meissner_simulator::plants::FINGERTIP_SENSOR;

/// The address where records of 16 bytes arrive, and the address where the fingertip takes targets.
const EVENTS: &str = "127.0.0.1:5000";
const FINGERTIP: &str = "127.0.0.1:5001";
/// Time between two cycles, and from the due time of a cycle to the deadline of its prediction.
const RHYTHM: [Duration; 2] = [Duration::from_millis(1), Duration::from_micros(900)];

fn main() -> Result<(), Failure> {
    let cycles = std::env::args().nth(1).map_or(Ok(u64::MAX), |cycles| cycles.parse())?;
    let description = Description::shipped("tactigraph-past").ok_or("no such network")?;
    let weights = Weights::shipped("tactigraph-past").ok_or("no weights")?;
    let engine = Engine::new(description.network(&weights)?, FINGERTIP_SENSOR)?;
    let (events, robot) = (UdpSocket::bind(EVENTS)?, UdpSocket::bind("127.0.0.1:0")?);
    robot.connect(FINGERTIP)?;
    // If more events wait, the oldest make room. A prediction begins two batches before the
    // deadline, so short batches leave more time for events.
    let options = QueueOptions::new().with_capacity(1 << 16).with_batch(8);
    // A thread inherits its priority; a thread that waits for another has the higher priority.
    raise("the engine's thread", 60);
    let (mut input, mut live) = Live::spawn(engine, options)?;
    raise("the sensor's thread", 70);
    let ended = AtomicBool::new(false);
    let timing = thread::scope(|scope| {
        let feeding = scope.spawn(|| feed(&events, &mut input, &ended));
        raise("the loop", 80);
        let timing = run(&mut live, &robot, &ended, RHYTHM, cycles);
        ended.store(true, Ordering::Release);
        feeding.join().expect("the feed does not panic").and(timing)
    })?;
    println!("{timing:?}\n{:?}", live.counters());
    Ok(())
}

/// Requests a fixed priority; the loop runs without it if the system refuses.
#[cfg(target_os = "linux")]
fn raise(thread: &str, priority: u8) {
    use thread_priority::{RealtimeThreadSchedulePolicy, ThreadPriority, ThreadSchedulePolicy};
    let priority = ThreadPriority::Crossplatform(priority.try_into().expect("it is at most 99"));
    let policy = ThreadSchedulePolicy::Realtime(RealtimeThreadSchedulePolicy::Fifo);
    let this = thread_priority::thread_native_id();
    if let Err(refused) = thread_priority::set_thread_priority_and_policy(this, priority, policy) {
        println!("{thread} has no fixed priority: {refused}");
    }
}

#[cfg(not(target_os = "linux"))]
fn raise(_thread: &str, _priority: u8) {}
