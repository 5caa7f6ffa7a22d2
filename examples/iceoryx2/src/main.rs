//! The processes: a driver, an inference, and a controller's side.

mod infer;
mod watch;

use std::io::{Write, stdout};
use std::path::PathBuf;
use std::process::ExitCode;
use std::time::Duration;

use clap::{Parser, Subcommand};
use iceoryx2::prelude::{LogLevel, set_log_level_from_env_or};
use meissner_engine::Sensor;
use meissner_iceoryx2::channel::BUFFER;
use meissner_iceoryx2::driver::Driver;
use meissner_iceoryx2::wire::SLICE;
use meissner_io::ReadOptions;
use meissner_packets::{AnyNetwork, FeedOptions, PacketError, failed, feed};
use meissner_run::error::chain;
use meissner_run::interrupt;
use meissner_run::source::Source;
use meissner_run::text::sensor;
use serde::Serialize;

/// Longest wait until an end is noticed.
const NAP: Duration = Duration::from_millis(100);

/// Events and predictions between the processes of one host, in shared memory
#[derive(Parser)]
#[command(version)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
    /// Name that the processes share
    #[arg(long, global = true, default_value = "meissner")]
    name: String,
}

#[derive(Subcommand)]
enum Command {
    /// Publish the events of a recording at real speed, or of a live stream
    Drive {
        /// A recording, or `-`, tcp://HOST:PORT, tcp-listen://HOST:PORT, udp://HOST:PORT; without
        /// it, the embedded recording
        source: Option<PathBuf>,
        /// Columns and rows of the sensor, where the source does not name them
        #[arg(long, value_name = "WIDTHxHEIGHT", value_parser = sensor)]
        sensor: Option<Sensor>,
        /// Seconds of a recording per second
        #[arg(long, default_value_t = 1.0, value_parser = speed)]
        speed: f64,
        /// Wait for this many subscribers before the first event
        #[arg(long, default_value_t = 0)]
        subscribers: usize,
    },
    /// Take events, publish predictions
    Infer {
        /// Shipped network over events or frames of them, or file of a description
        #[arg(default_value = "tactigraph-past")]
        network: String,
        /// File with weights, instead of the shipped ones
        #[arg(long)]
        weights: Option<PathBuf>,
        /// Slices of at most 1024 events that may wait; where there are more, the oldest are lost
        #[arg(long, default_value_t = BUFFER)]
        buffer: usize,
        /// End when a driver ends
        #[arg(long)]
        once: bool,
    },
    /// Take predictions, as a controller does, and measure how long they took
    Watch {
        /// Print each prediction as a line of JSON
        #[arg(long)]
        print: bool,
        /// End when a driver ends
        #[arg(long)]
        once: bool,
    },
}

fn speed(text: &str) -> Result<f64, String> {
    let speed = text.parse().ok().filter(|speed: &f64| speed.is_finite() && *speed > 0.0);
    speed.ok_or_else(|| format!("expected a number above 0, got {text}"))
}

fn main() -> ExitCode {
    let Arguments { command, name } = Arguments::parse();
    interrupt::install();
    interrupt::listen();
    // Refusals of iceoryx2 arrive as errors; IOX2_LOG_LEVEL shows their causes.
    set_log_level_from_env_or(LogLevel::Fatal);
    match run(command, &name) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("error: {}", chain(&error));
            ExitCode::FAILURE
        }
    }
}

fn run(command: Command, name: &str) -> Result<(), PacketError> {
    match command {
        Command::Drive { source, sensor, speed, subscribers } => {
            let source = Source::open(source.as_deref(), &ReadOptions::default(), sensor.is_some(), false)?;
            let mut driver = Driver::new(name, source.sensor(sensor)?)?;
            while driver.subscribers() < subscribers && !interrupt::requested() {
                interrupt::sleep(Duration::from_millis(1));
            }
            let is_live = source.is_live();
            let [every, max_wait] = [0, 50].map(Duration::from_millis);
            let options = FeedOptions { is_live, speed, every, max_wait, max_events: SLICE };
            feed(source, options, interrupt::requested, |events, due| driver.publish(events, due))?;
            print(&driver.end()?)
        }
        Command::Infer { network, weights, buffer, once } => {
            let network = AnyNetwork::named(&network, weights.as_deref())?;
            print(&infer::infer(name, network, buffer, once)?)
        }
        Command::Watch { print: lines, once } => print(&watch::watch(name, once, lines)?),
    }
}

/// One line of JSON.
fn print(result: &impl Serialize) -> Result<(), PacketError> {
    let line = serde_json::to_string(result).map_err(failed("output"))?;
    writeln!(stdout(), "{line}").map_err(failed("output"))
}
