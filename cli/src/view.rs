//! `meissner view`: a network over a recording or live input, on a page in a browser.

mod frames;

use std::io::Write;
use std::path::PathBuf;
use std::process::{Command, Stdio};

use meissner_engine::Sensor;
use meissner_engine::frames::Convolution;
use meissner_models::DEFAULT_NETWORK;
use meissner_run::bench::BenchInput;
use meissner_run::model::{FrameModel, Model, describe, describe_any};
use meissner_run::{RunError, interrupt, press};
use meissner_view::bystander::Bystander;
use meissner_view::frames::{Frames, ShippedFrames};
use meissner_view::subject::Subject;
use meissner_view::watch::{Waiting, clock, watch};
use meissner_view::{Chosen, Input, Own, Session, Shipped, Truth};
use serde::Serialize;

use crate::args::{FRAMES, JsonArgs, NETWORK, NetworkWeights, OUTPUT, PartArgs, ReadArgs};
use crate::error::CliError;
use crate::kind::NetworkKind;
use crate::output::print;
use crate::page::serve;
use crate::run::{Video, video};
use crate::stderr::tell;

/// Examples, at the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner view
  meissner view touch.aedat4 --network tactigraph
  meissner view udp://127.0.0.1:5000 --sensor 346x260
  meissner view touch.aedat4 --no-browser --port 8080
  meissner view images/ --network canf
  meissner view readings.csv --network slip-best";

/// `meissner view`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct ViewArgs {
    /// Recording or live input, as of `run` [default: a small built-in recording].
    ///
    /// Events, and pictures or readings of electrodes for networks that read them. Pictures in
    /// files have no times: 25 a second are shown at a speed of 1.
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
    /// The page can switch between this one and the shipped networks that read the same input.
    #[arg(long, value_name = "NETWORK", help_heading = NETWORK)]
    network: Option<String>,
    #[command(flatten)]
    weights: NetworkWeights,
    /// Read INPUT as raw video: pictures without headers, as `run` does.
    #[arg(long, value_name = "WxH[@FPS][:PIXELS]", value_parser = video, help_heading = FRAMES)]
    video: Option<Video>,
    /// Picture without contact, for networks over differences [default: the first].
    #[arg(long, value_name = "IMAGE", help_heading = FRAMES)]
    reference: Option<PathBuf>,
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
    let (description, _) = describe_any(name)?;
    let kind = NetworkKind::of(&description);
    args.check(name, kind)?;
    if kind == NetworkKind::EventGraph { view_events(args, name) } else { view_frames(args, name, kind) }
}

fn view_events(args: &ViewArgs, name: &str) -> Result<(), CliError> {
    let model = Model::named(name, args.weights.file(), args.weights.ignore_preparation)?;
    let stride = model.card.network.stride;
    let chosen = Chosen::new(model.network, &describe(name)?.0);
    let mut source = args.read.open(args.recording.as_deref(), args.part.part())?.every(stride);
    let sensor: Sensor = source.sensor(args.read.sensor)?;
    let (live, events) = (source.is_live(), source.recorded_events()?);
    let input = Input { name: source.name.clone(), sensor, events, live, truth: args.truth() };
    let networks = Own { name: name.to_owned(), chosen, others: Shipped };
    let session: Session = Session::new(input, Box::new(networks), name, clock)?;
    args.serve(session, live.then_some(source))
}

fn view_frames(args: &ViewArgs, name: &str, kind: NetworkKind) -> Result<(), CliError> {
    let file = args.weights.file();
    let model = FrameModel::named(name, file, Convolution::Direct, args.weights.ignore_preparation)?;
    let path = |expected: &str| {
        let missing = || CliError::usage("INPUT", &format!("{expected}, as network {name} reads"), "none");
        args.recording.as_deref().ok_or_else(missing)
    };
    let opened = match kind {
        NetworkKind::Electrodes => frames::open_readings(path("CSV of 24 electrodes")?)?,
        NetworkKind::Pictures => {
            let path = path("a picture, a folder or a list of pictures, or a raw video")?;
            let video = args.video.map(|video| video.options(args.read.strict));
            frames::open_pictures(&model, path, video, args.reference.as_deref())?
        }
        _ => {
            let source = args.read.open(args.recording.as_deref(), args.part.part())?;
            let source = source.every(model.card.network.stride);
            let sensor = source.sensor(args.read.sensor)?;
            frames::open_events(&model, source, sensor)?
        }
    };
    let frames::Opened { name: input, sensor, live, mut items } = opened;
    let events = if live { Vec::new() } else { items.by_ref().collect::<Result<_, _>>()? };
    let input = Input { name: input, sensor, events, live, truth: args.truth() };
    let (source, shape) = (model.source, model.description.input());
    let chosen = Chosen::framed(model.network, &model.description, source);
    let networks = Own { name: name.to_owned(), chosen, others: ShippedFrames { source, shape } };
    let session = Session::<Frames>::new(input, Box::new(networks), name, clock)?;
    args.serve(session, live.then_some(items))
}

impl ViewArgs {
    /// Refuses options that do not apply to networks of `kind`.
    fn check(&self, name: &str, kind: NetworkKind) -> Result<(), CliError> {
        let given = [("--video", self.video.is_some()), ("--reference", self.reference.is_some())];
        match given.into_iter().find(|(_, given)| *given && kind != NetworkKind::Pictures) {
            None => Ok(()),
            Some((option, _)) => Err(CliError::Misfit {
                option: option.to_owned(),
                fits: NetworkKind::Pictures.name().to_owned(),
                network: name.to_owned(),
                kind: kind.name(),
            }),
        }
    }

    /// The truth about the embedded recording.
    fn truth(&self) -> Truth {
        if self.recording.is_some() {
            return Truth::default();
        }
        let (names, rows) = press::truth_over_time();
        Truth { names, rows }
    }

    /// Serves `session`, with the items that arrive from `live`, until a signal ends the program.
    fn serve<S>(
        &self,
        session: Session<S>,
        live: Option<impl Iterator<Item = Result<S::Item, RunError>> + Send + 'static>,
    ) -> Result<(), CliError>
    where
        S: Subject,
        S::Item: Send + 'static,
    {
        let server = serve(self.port)?;
        let waiting = live.map(Waiting::read).transpose()?;
        let url = server.url();
        print(self.format.json, &Opened { url: url.clone() }, |out| {
            writeln!(out, "{url}\n\nThe page is on this machine alone. Ctrl-C ends it.")
        })?;
        if !self.no_browser {
            open(&url);
        }
        watch(session, &server, waiting.as_deref(), interrupt::requested);
        Ok(())
    }
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
    let server = serve(port)?;
    tell(format_args!("page: {}", server.url()));
    let chosen = Chosen::new(model.network.clone(), &describe(name)?.0);
    let (input, sensor) = input.about();
    Ok(Bystander::new(server, input, sensor, name, &chosen))
}

/// Opens the page in the user's browser, if there is a user at this machine.
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
    // The address is also printed, so nothing is lost without a browser.
    let quiet = || Stdio::null();
    let _ = Command::new(opener).arg(url).stdin(quiet()).stdout(quiet()).stderr(quiet()).spawn();
}
