//! `meissner send`: sends a recording at real speed to another program, over a socket or standard
//! output.

#![expect(clippy::doc_markdown, reason = "these comments are the help text, which would show the backticks")]

use std::path::PathBuf;

use meissner_run::send::{SendOptions, SendSummary, send as send_events};
use meissner_run::streams;
use meissner_run::text::grouped;

use crate::args::{OUTPUT, PartArgs, QUEUE, ReadArgs, positive};
use crate::error::CliError;
use crate::stderr::tell;

/// Examples, at the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner send touch.aedat4 tcp-listen://127.0.0.1:5000
  meissner run tcp://127.0.0.1:5000 --every 1ms

  meissner run udp://127.0.0.1:5000 --sensor 346x260 --every event
  meissner send touch.aedat4 udp://127.0.0.1:5000 --records --speed 0.5

  meissner send touch.aedat4 dv-listen://127.0.0.1:7777";

/// `meissner send`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct SendArgs {
    /// The recording, or - for text on standard input.
    #[arg(value_name = "INPUT")]
    input: PathBuf,
    /// Receiver: tcp, tcp-listen, udp or dv-listen, with ://HOST:PORT; or -.
    ///
    /// tcp://HOST:PORT connects to a server, tcp-listen waits for the first client, and - is
    /// standard output. A receiver over TCP that is slow makes the sender wait; over UDP, events
    /// are lost. dv-listen sends packets of AEDAT4 as dv-processing's NetworkWriter does, and waits
    /// for a NetworkReader there, or with dv-listen:///PATH on a local socket.
    #[arg(value_name = "STREAM")]
    to: PathBuf,
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    part: PartArgs,
    /// Seconds of the recording that are sent in one second.
    #[arg(long, value_name = "X", value_parser = positive, default_value = "1", help_heading = QUEUE)]
    speed: f64,
    /// Send records of 16 bytes instead of lines of text.
    ///
    /// A record has the time in microseconds (8 bytes), column and row (2 each) and polarity (1),
    /// least significant byte first, and three bytes of 0. It names no sensor: the receiver needs
    /// --sensor.
    #[arg(long, help_heading = OUTPUT)]
    records: bool,
}

/// Sends the recording.
pub(crate) fn send(args: &SendArgs) -> Result<(), CliError> {
    let recording = args.read.read(&args.input, args.part.part())?;
    if args.records && streams::is_of_packets(&args.to) {
        return Err(CliError::usage("--records", "a stream of lines or records", &streams::name(&args.to)));
    }
    let options = SendOptions { speed: args.speed, records: args.records };
    let sent = send_events(&recording.events, args.read.sensor.or(recording.sensor), &args.to, options)?;
    let SendSummary { events, bytes, lag_us, seconds } = sent;
    let (to, events, bytes) = (args.to.display(), grouped(events), grouped(bytes));
    tell(format_args!("{to}: {events} events, {bytes} bytes in {seconds:.3} s; at most {lag_us:.0} us late"));
    Ok(())
}
