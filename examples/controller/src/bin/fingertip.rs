//! The simulated fingertip in real time: sends events and state over UDP, takes wrist targets.
//!
//! ```text
//! cargo run --release -p meissner-controller --bin fingertip
//! ```
use std::error::Error;
use std::io::ErrorKind;
use std::net::{SocketAddr, UdpSocket};
use std::thread;
use std::time::{Duration, Instant};

use clap::Parser;
use meissner::Event;
use meissner::io::record;
use meissner_simulator::plants::{Fingertip, Surface, TAP_US, TICK_US, WristTarget, presses};

/// Greatest number of records in a datagram: 1,400 bytes are passed on in one piece.
const MAX_RECORDS: usize = 87;

/// A simulated soft dome on a wrist, which taps a tilted plane every 0.8 s.
///
/// Events go to the controller as records of 16 bytes; it sends targets and receives states.
#[derive(Debug, Parser)]
struct Arguments {
    /// Where to send events.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:5000")]
    events: String,
    /// Where to take targets. The state goes back to where they come from.
    #[arg(long, value_name = "HOST:PORT", default_value = "127.0.0.1:5001")]
    targets: String,
    /// Taps before the end.
    #[arg(long, default_value_t = 24)]
    taps: u32,
    /// Roll and pitch of the plane in degrees; without them it jumps and turns.
    #[arg(long, value_names = ["ROLL", "PITCH"], num_args = 2, allow_negative_numbers = true)]
    plane: Option<Vec<f64>>,
    /// Seed of the camera's noise.
    #[arg(long, default_value_t = 1)]
    seed: u64,
}

/// The sockets.
struct Link {
    events: UdpSocket,
    targets: UdpSocket,
    /// The sender of the newest target, and its cycle.
    controller: Option<(SocketAddr, u64)>,
    bytes: Vec<u8>,
}

impl Link {
    fn new(arguments: &Arguments) -> Result<Self, Box<dyn Error>> {
        let (events, targets) = (UdpSocket::bind("0.0.0.0:0")?, UdpSocket::bind(&arguments.targets)?);
        events.connect(&arguments.events)?;
        targets.set_nonblocking(true)?;
        Ok(Self { events, targets, controller: None, bytes: Vec::new() })
    }

    /// Sends events. Nobody may listen.
    fn send(&mut self, events: &[Event]) {
        for events in events.chunks(MAX_RECORDS) {
            self.bytes.clear();
            events.iter().for_each(|&event| self.bytes.extend_from_slice(&record(event)));
            drop(self.events.send(&self.bytes));
        }
    }

    /// The newest target since the previous call.
    fn target(&mut self) -> std::io::Result<Option<WristTarget>> {
        let mut newest = None;
        let mut bytes = [0; WristTarget::BYTES + 1];
        loop {
            match self.targets.recv_from(&mut bytes) {
                Ok((length, from)) => {
                    let Some(target) = WristTarget::read(&bytes[..length]) else { continue };
                    // Another controller starts its count from 0.
                    let is_old = |(address, cycle)| address == from && cycle > target.cycle;
                    if !self.controller.is_some_and(is_old) {
                        self.controller = Some((from, target.cycle));
                        newest = Some(target);
                    }
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => return Ok(newest),
                // The system's answer to a state that nobody received.
                Err(error) if error.kind() == ErrorKind::ConnectionRefused => {}
                Err(error) => return Err(error),
            }
        }
    }
}

fn main() -> Result<(), Box<dyn Error>> {
    let arguments = Arguments::parse();
    let surface = match arguments.plane.as_deref() {
        Some(&[roll, pitch]) => Surface::Fixed([roll, pitch].map(f64::to_radians)),
        _ => Surface::Course,
    };
    let mut link = Link::new(&arguments)?;
    eprintln!("computing the presses of the dome");
    let mut tip = Fingertip::new(presses(), surface, arguments.seed)?;
    let mut events = Vec::new();
    // The first tap begins once there is a controller.
    eprintln!("waiting for a controller at {}", arguments.targets);
    while link.target()?.is_none() {
        thread::sleep(Duration::from_millis(1));
    }
    let (start, mut lag) = (Instant::now(), Duration::ZERO);
    let tick = Duration::from_micros(TICK_US.unsigned_abs());
    println!(" tap  plane, wrist (roll, pitch in degrees)   error");
    for number in 0..i64::from(arguments.taps) * TAP_US / TICK_US {
        if number * TICK_US % TAP_US == 0 {
            let ([a, b], [c, d]) = (tip.plane().map(f64::to_degrees), tip.state().wrist.map(f64::to_degrees));
            let (tap, error) = (tip.state().tap, tip.error().to_degrees());
            println!("{tap:>4}  {a:>6.2} {b:>6.2}   {c:>6.2} {d:>6.2}           {error:>6.2}");
        }
        let due = start + tick * (number as u32 + 1);
        // Fixed images are filmed while there is time.
        while Instant::now() < due && tip.film_ahead()? {}
        thread::sleep(due.saturating_duration_since(Instant::now()));
        if let Some(target) = link.target()? {
            tip.aim(target.angles);
        }
        tip.tick();
        events.clear();
        tip.take(&mut events)?;
        link.send(&events);
        if let Some((address, _)) = link.controller {
            drop(link.targets.send_to(&tip.state().bytes(), address));
        }
        lag = lag.max(due.elapsed());
    }
    // The end of the events.
    drop(link.events.send(&[]));
    println!("events were sent at most {:.1} ms late", lag.as_secs_f64() * 1e3);
    Ok(())
}
