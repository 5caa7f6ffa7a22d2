//! The loop: in each cycle the state of the robot, a prediction by the deadline, and a target.
//!
//! Enters: a live engine, a robot, the period and the deadline. Leaves: the timing of all cycles. Nothing is allocated.

use std::io::{self, ErrorKind};
use std::net::UdpSocket;
use std::time::Duration;

use meissner::Event;
use meissner::live::{Live, LiveError, Predictor};
use thiserror::Error;

use crate::datagrams::{STATE_BYTES, State, Target};
use crate::feed::Feed;
use crate::law::Levelling;
use crate::metered::Meter;
use crate::realtime::{now, sleep_until};
use crate::tap::Phase;
use crate::timing::{Cycle, Timing};
use crate::wrist::Wrist;

/// What the loop controls.
pub trait Robot {
    /// Its newest state.
    ///
    /// # Errors
    /// It cannot be reached.
    fn state(&mut self) -> io::Result<State>;

    /// Sets its target.
    ///
    /// # Errors
    /// It cannot be reached.
    fn aim(&mut self, target: Target) -> io::Result<()>;
}

/// A fingertip at the other end of a socket.
#[derive(Debug)]
pub struct Remote {
    socket: UdpSocket,
    newest: State,
}

impl Remote {
    /// A fingertip that takes targets at `address`.
    ///
    /// # Errors
    /// The address cannot be used.
    pub fn connect(address: &str) -> io::Result<Self> {
        // The unspecified address of the other end's family.
        let socket = UdpSocket::bind("0.0.0.0:0").and_then(|socket| socket.connect(address).map(|()| socket));
        let socket = socket.or_else(|_| {
            UdpSocket::bind("[::]:0").and_then(|socket| socket.connect(address).map(|()| socket))
        })?;
        socket.set_nonblocking(true)?;
        Ok(Self { socket, newest: State::default() })
    }
}

/// Nobody may listen yet, or any more: the next datagram may find someone.
fn unless_alone<T>(result: io::Result<T>) -> io::Result<Option<T>> {
    match result {
        Ok(value) => Ok(Some(value)),
        Err(error) if matches!(error.kind(), ErrorKind::ConnectionRefused | ErrorKind::WouldBlock) => {
            Ok(None)
        }
        Err(error) => Err(error),
    }
}

impl Robot for Remote {
    fn state(&mut self) -> io::Result<State> {
        let mut bytes = [0; STATE_BYTES];
        while let Some(length) = unless_alone(self.socket.recv(&mut bytes))? {
            self.newest = State::read(&bytes[..length]).unwrap_or(self.newest);
        }
        Ok(self.newest)
    }

    fn aim(&mut self, target: Target) -> io::Result<()> {
        unless_alone(self.socket.send(&target.bytes())).map(|_| ())
    }
}

/// A wrist beside a recording, on which it has no effect: always in a hold, at rest.
#[derive(Clone, Copy, Debug, Default)]
pub struct Alone {
    /// It follows the targets.
    pub wrist: Wrist,
}

impl Robot for Alone {
    fn state(&mut self) -> io::Result<State> {
        Ok(State { phase: Phase::Hold, ..State::default() })
    }

    fn aim(&mut self, target: Target) -> io::Result<()> {
        self.wrist.aim(target.angles);
        self.wrist.turn(1e-3);
        Ok(())
    }
}

/// When cycles begin, and by when their predictions should be at hand.
#[derive(Clone, Copy, Debug)]
pub struct Rhythm {
    /// Time of [`now`] when the first cycle is due.
    pub start: Duration,
    /// Time between two cycles.
    pub period: Duration,
    /// From when a cycle is due until its prediction should be at hand.
    pub deadline: Duration,
    /// Most cycles.
    pub most: u64,
}

/// Why the loop ended early.
#[derive(Debug, Error)]
#[non_exhaustive]
pub enum ControlError {
    /// A prediction failed.
    #[error(transparent)]
    Live(#[from] LiveError),
    /// The robot cannot be reached.
    #[error("the robot cannot be reached")]
    Robot(#[from] io::Error),
}

/// Runs cycles until the feed has ended, and at most those of `rhythm`. Adds their timing to `timing`.
///
/// # Errors
/// A prediction fails, or the robot cannot be reached.
pub fn run<P: Predictor<Input = Event>>(
    live: &mut Live<P>,
    meter: &Meter,
    feed: &Feed,
    robot: &mut dyn Robot,
    rhythm: Rhythm,
    timing: &mut Timing,
) -> Result<(), ControlError> {
    let mut law = Levelling::default();
    let mut due = rhythm.start;
    for cycle in 0..rhythm.most {
        sleep_until(due);
        let (woke, computed) = (now(), meter.read());
        let state = robot.state()?;
        let deadline = due + rhythm.deadline;
        let prediction = live.predict(deadline.saturating_sub(now()))?;
        let (answered, fresh) = (now(), prediction.fresh);
        let angles = law.target(&state, prediction.values);
        robot.aim(Target { cycle, angles })?;
        let computed = meter.read().saturating_sub(computed);
        let fed_late = feed.late();
        timing.record(&Cycle { due, woke, answered, deadline, fresh, computed, fed_late });
        if feed.has_ended() {
            break;
        }
        due += rhythm.period;
    }
    Ok(())
}
