//! A control loop of 1 kHz over live predictions: a controller turns the wrist of a fingertip until
//! its dome stands upright on a plane. `src/bin/controller.rs` starts its threads.
#![forbid(unsafe_code)]
#![deny(clippy::print_stdout, clippy::print_stderr)]

use std::error::Error;
use std::io::{self, ErrorKind};
use std::net::UdpSocket;
use std::sync::atomic::{AtomicBool, Ordering};
use std::thread;
use std::time::{Duration, Instant};

use meissner::Event;
use meissner::io::{RECORD_BYTES, event_of};
use meissner::live::{Input, Live, Predictor};
use meissner_simulator::plants::{Angles, FingertipState, Phase, WristTarget};

/// The reason why a controller ended early.
pub type Failure = Box<dyn Error + Send + Sync>;

/// Share of the predicted angle by which the wrist is turned: below 1, single errors are averaged.
pub const GAIN: f64 = 0.8;

/// The law of levelling: the target of the wrist in radians; `None` if it stays. During a press the
/// wrist is braked, and the prediction is the angle by which the dome must still turn.
pub fn level(state: &FingertipState, predicted: &[f32]) -> Option<Angles> {
    let (Phase::Hold, &[roll, pitch]) = (state.phase, predicted) else { return None };
    Some([state.wrist[0] + GAIN * f64::from(roll), state.wrist[1] + GAIN * f64::from(pitch)])
}

/// The sensor's thread: datagrams of records into the queue, until an empty one or until `ended`.
///
/// # Errors
/// The socket fails, or the engine's thread has ended.
pub fn feed(socket: &UdpSocket, input: &mut Input, ended: &AtomicBool) -> Result<(), Failure> {
    socket.set_read_timeout(Some(Duration::from_millis(20)))?;
    let mut bytes = vec![0; 1 << 16];
    let mut events = Vec::with_capacity(bytes.len() / RECORD_BYTES);
    while !ended.load(Ordering::Acquire) {
        match socket.recv(&mut bytes) {
            Ok(0) => break,
            Ok(length) => {
                let (records, _) = bytes[..length].as_chunks::<RECORD_BYTES>();
                events.extend(records.iter().filter_map(|&record| event_of(record)));
                input.push_slice(&events)?;
                events.clear();
            }
            Err(error) if matches!(error.kind(), ErrorKind::WouldBlock | ErrorKind::TimedOut) => {}
            Err(error) => return Err(error.into()),
        }
    }
    ended.store(true, Ordering::Release);
    Ok(())
}

/// The punctuality of the loop, and the cost of overload.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Timing {
    /// Cycles.
    pub cycles: u64,
    /// Deadlines missed because the system woke the loop after half of the time to them.
    pub late: u64,
    /// Deadlines without a prediction that covers every event.
    pub stale: u64,
    /// Greatest number of events that had entered the queue and that a prediction did not cover.
    pub max_behind: u64,
    /// Longest time from the beginning of a cycle to its prediction.
    pub max_answer: Duration,
}

/// Runs cycles until `ended`, or the last of `cycles`: the newest state of the fingertip at the
/// other end of `robot`, a prediction by the deadline, a target. Nothing is allocated.
///
/// # Errors
/// A prediction fails, or the socket does.
pub fn run<P: Predictor<Input = Event>>(
    live: &mut Live<P>,
    robot: &UdpSocket,
    ended: &AtomicBool,
    [period, deadline]: [Duration; 2],
    cycles: u64,
) -> Result<Timing, Failure> {
    robot.set_nonblocking(true)?;
    let mut state = FingertipState::default();
    let mut target = WristTarget { cycle: 0, angles: [0.0; 2] };
    let (mut timing, mut due) = (Timing::default(), Instant::now());
    while timing.cycles < cycles && !ended.load(Ordering::Acquire) {
        due += period;
        thread::sleep(due.saturating_duration_since(Instant::now()));
        let woke = Instant::now();
        let mut bytes = [0; FingertipState::BYTES];
        while let Some(length) = unless_alone(robot.recv(&mut bytes))? {
            state = FingertipState::read(&bytes[..length]).unwrap_or(state);
        }
        let left = (due + deadline).saturating_duration_since(Instant::now());
        let prediction = live.predict(left)?;
        let answered = Instant::now();
        target.cycle = timing.cycles;
        target.angles = level(&state, prediction.values).unwrap_or(target.angles);
        unless_alone(robot.send(&target.bytes()))?;

        timing.cycles += 1;
        timing.max_behind = timing.max_behind.max(prediction.behind_events);
        timing.max_answer = timing.max_answer.max(answered - woke);
        let is_late = woke > due + deadline / 2;
        timing.late += u64::from(is_late);
        timing.stale += u64::from(!is_late && (!prediction.fresh || answered > due + deadline));
    }
    Ok(timing)
}

/// Perhaps nobody listens yet, or any more: the next datagram may find a receiver.
fn unless_alone<T>(result: io::Result<T>) -> io::Result<Option<T>> {
    let is_alone = |kind| matches!(kind, ErrorKind::ConnectionRefused | ErrorKind::WouldBlock);
    match result {
        Err(error) if is_alone(error.kind()) => Ok(None),
        result => result.map(Some),
    }
}
