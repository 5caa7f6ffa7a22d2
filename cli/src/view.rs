//! `meissner view`: a network over a recording or live events, on a page in a browser.

use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use meissner_engine::Sensor;
use meissner_models::DEFAULT_NETWORK;
use meissner_run::bench::BenchInput;
use meissner_run::model::{Model, describe};
use meissner_run::{interrupt, press};
use meissner_view::bystander::Bystander;
use meissner_view::server::Server;
use meissner_view::watch::{Waiting, clock, watch};
use meissner_view::{Chosen, Input, Own, Session, Truth};
use serde::Serialize;

use crate::args::{JsonArgs, NETWORK, NetworkWeights, OUTPUT, PartArgs, ReadArgs};
use crate::error::CliError;
use crate::output::print;
use crate::stderr::tell;

/// Examples, at the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner view
  meissner view touch.aedat4 --network tactigraph
  meissner view udp://127.0.0.1:5000 --sensor 346x260
  meissner view touch.aedat4 --no-browser --port 8080";

/// `meissner view`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct ViewArgs {
    /// Recording or live events, as of `run` [default: a small built-in recording].
    ///
    /// The page is on this machine alone (127.0.0.1), and its address has a token: whoever does not
    /// know it sees nothing. No network is needed, and nothing leaves the machine.
    #[arg(value_name = "INPUT")]
    recording: Option<PathBuf>,
    #[command(flatten)]
    read: ReadArgs,
    #[command(flatten)]
    part: PartArgs,
    /// A shipped network, or a description file (.toml) [default: tactigraph-past].
    ///
    /// The page can switch between the shipped networks and this one.
    #[arg(long, value_name = "NETWORK", help_heading = NETWORK)]
    network: Option<String>,
    #[command(flatten)]
    weights: NetworkWeights,
    /// Port of the page on 127.0.0.1; 0 is any free one.
    #[arg(long, value_name = "PORT", default_value_t = 0, help_heading = OUTPUT)]
    port: u16,
    /// Print the address of the page, and open no browser.
    #[arg(long, help_heading = OUTPUT)]
    no_browser: bool,
    #[command(flatten)]
    format: JsonArgs,
}

/// The address of the page, for programs.
#[derive(Serialize)]
struct Opened {
    url: String,
}

/// Serves the page until a signal ends the program.
pub(crate) fn view(args: &ViewArgs) -> Result<(), CliError> {
    let name = args.network.as_deref().unwrap_or(DEFAULT_NETWORK);
    let model = Model::named(name, args.weights.file(), args.weights.ignore_preparation)?;
    let stride = model.card.network.stride;
    let chosen = Chosen::new(model.network, &describe(name)?.0);
    let mut source = args.read.open(args.recording.as_deref(), args.part.part())?.every(stride);
    let sensor: Sensor = source.sensor(args.read.sensor)?;
    let truth = if args.recording.is_none() {
        let (names, rows) = press::truth_over_time();
        Truth { names, rows }
    } else {
        Truth::default()
    };
    let (live, events) = (source.is_live(), source.recorded_events()?);
    let input = Input { name: source.name.clone(), sensor, events, live, truth };
    let networks = Own { name: name.to_owned(), chosen };
    let session = Session::new(input, Box::new(networks), name, clock)?;
    let server = Server::open(args.port).map_err(|source| CliError::Port { port: args.port, source })?;
    let waiting = live.then(|| Waiting::read(source)).transpose()?;
    let url = server.url();
    print(args.format.json, &Opened { url: url.clone() }, |out| {
        writeln!(out, "{url}\n\nThe page is on this machine alone. Ctrl-C ends it.")
    })?;
    if !args.no_browser {
        open(&url);
    }
    watch(session, &server, waiting.as_deref(), interrupt::requested);
    Ok(())
}

/// The page for an engine that another command runs over `input`, with the network `name`.
///
/// # Errors
/// The port is in use.
pub(crate) fn bystander(
    port: u16,
    input: &BenchInput,
    name: &str,
    model: &Model,
) -> Result<Bystander, CliError> {
    let server = Server::open(port).map_err(|source| CliError::Port { port, source })?;
    tell(format_args!("page: {}", server.url()));
    let chosen = Chosen::new(model.network.clone(), &describe(name)?.0);
    let (input, sensor) = input.about();
    Ok(Bystander::new(server, input, sensor, name, &chosen))
}

/// Opens the page in the browser of whoever sits here, if anybody does.
fn open(url: &str) {
    let opener = if cfg!(target_os = "macos") {
        "open"
    } else if cfg!(windows) {
        "explorer"
    } else if std::env::var_os("DISPLAY").or_else(|| std::env::var_os("WAYLAND_DISPLAY")).is_some() {
        "xdg-open"
    } else {
        return;
    };
    // The address is printed too: where there is no browser, nothing is lost.
    let quiet = || Stdio::null();
    let _ = Command::new(opener).arg(url).stdin(quiet()).stdout(quiet()).stderr(quiet()).spawn();
}
