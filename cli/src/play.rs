//! `meissner play`: plays recordings at real speed, or a stream, through bounded queues, with
//! reports by their deadlines.

use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Duration;

use meissner_engine::filters::{BackgroundActivity, Chain, Filter, RateLimit, Refractory};
use meissner_engine::{EngineError, Sensor};
use meissner_live::{Overload, QueueOptions, cores};
use meissner_run::mcap;
use meissner_run::model::describe;
use meissner_run::play::{Play, PlayInput, PlayOptions};
use meissner_run::provenance::{InputCard, ModelCard};
use meissner_run::streams;
use meissner_run::text::span_us;
use meissner_view::Chosen;

use crate::args::{INPUT, Input, JsonArgs, OUTPUT, PREDICTIONS, QUEUE, REUSES, length, period, positive};
use crate::error::CliError;
use crate::given::Given;
use crate::output::LogArgs;
use crate::page;
use crate::predictions::{About, Report, TableKind};

/// Plays the recordings as `args` say, and writes the reports to standard output.
pub(crate) fn play(args: &PlayArgs, given: &Given) -> Result<(), CliError> {
    check(args, given)?;
    let model = args.input.model()?;
    let mut inputs = vec![args.open(args.input.recording.as_deref(), &model.card)?];
    for other in &args.others {
        inputs.push(args.open(Some(other), &model.card)?);
    }
    let cards = inputs.iter().map(|PlayInput { source, sensor, .. }| {
        InputCard::events(&source.name, &source.format, *sensor, source.recorded())
    });
    let cards = cards.collect();
    let sensors: Vec<_> = inputs.iter().map(|input| input.sensor).collect();
    let named: Vec<_> = inputs.iter().map(|input| (input.source.name.clone(), input.sensor)).collect();
    let network = args.input.network();
    let chosen = Chosen::new(model.network.clone(), &describe(network)?.0);
    let page = page::sensors(args.view, &named, model.network.parts().span_us, network, &chosen)?;
    let policy = inputs[0].overload.name().replace('_', " ");
    let play = Play::new(&model, inputs, args.options())?;
    let about = About {
        command: "play",
        json: args.format.json,
        live: true,
        inputs: cards,
        card: &model.card,
        mode: format!("live, {} s of stream time a second, queue: {policy}", args.speed),
        frames: None,
        table: TableKind::Reports,
        total: play.reports(),
    };
    let log = args.log.begin(&model.card, &sensors, args.input.recording.is_none() && sensors.len() == 1)?;
    let mut report = Report::begin(about)?;
    let (ended, logged) = mcap::observe(log, &mut report, |observer| {
        page::observe(page, observer, |observer| play.run(observer))
    });
    let mut ended = ended?;
    if let [Err(_)] = ended[..]
        && let Some(Err(error)) = ended.pop()
    {
        return Err(error.into());
    }
    report.end_play(&ended)?;
    for summary in ended {
        if summary?.verified.is_some_and(|verified| !verified.equal) {
            return Err(CliError::NotEqual);
        }
    }
    Ok(logged?)
}

/// Refuses cores that do not exist, streams among several inputs, and approximations that
/// `--verify` cannot check.
fn check(args: &PlayArgs, given: &Given) -> Result<(), CliError> {
    args.log.check()?;
    let there = cores();
    if let Some(core) = args.pin.iter().find(|core| !there.contains(core)) {
        return Err(CliError::usage("--pin", &format!("cores of {there:?}"), &core.to_string()));
    }
    let mut all = args.input.recording.iter().chain(&args.others);
    if let Some(stream) = all.find(|path| streams::is_live(path)) {
        let name = streams::name(stream);
        if !args.others.is_empty() {
            return Err(CliError::usage("INPUT", "recordings, if there are several", &name));
        }
        if args.repeat > 1 {
            return Err(CliError::usage("--repeat", "a recording", &name));
        }
    }
    match given.first(REUSES).filter(|_| args.verify) {
        None => Ok(()),
        Some(option) => Err(CliError::usage(
            "--verify",
            "predictions that are exact over the accepted events",
            &format!("{option}, with which they are not"),
        )),
    }
}

/// Examples, at the end of the long help.
const EXAMPLES: &str = "\
Examples:
  meissner play touch.aedat4 --network tactigraph-past --deadline 2ms
  meissner play burst.raw --sensor 640x480 --overload filter:1250us --verify
  meissner play burst.raw --sensor 640x480 --overload drop-newest --speed 0.1
  meissner play thumb.dat index.dat ring.dat --pin 0,1 --report-every 1ms --deadline 3ms
  meissner play thumb.dat index.dat ring.dat --repeat 100 --view 8080
  meissner play udp://127.0.0.1:5000 --sensor 346x260 --report-every 1ms --deadline 500us";

/// `meissner play`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = EXAMPLES)]
pub(crate) struct PlayArgs {
    #[command(flatten)]
    pub(crate) input: Input,
    /// Recordings of other sensors, played at the same time.
    ///
    /// Each input has an engine in a thread of its own, with its own queue and counters, and a
    /// thread that offers its events. All engines share one copy of the weights. Recordings begin
    /// together, whatever their times. An input whose engine fails ends there; the others go on,
    /// and the exit status is 1. A stream can only be played alone.
    #[arg(value_name = "OTHER")]
    pub(crate) others: Vec<PathBuf>,
    /// Play each recording N times, one after the other, without a reset.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u32).range(1..),
          help_heading = INPUT)]
    pub(crate) repeat: u32,
    /// Speed of the recording: 1 is real time, 0.5 is half as fast.
    ///
    /// Events of a stream are taken when they arrive. The time of its first event is that of its
    /// arrival; from there, X seconds of stream time are taken to pass in a second.
    #[arg(long, value_name = "X", default_value_t = 1.0, value_parser = positive, help_heading = QUEUE)]
    pub(crate) speed: f64,
    /// Capacity of the queue between the reader and the engine, in events.
    ///
    /// The reader and the engine each have a thread.
    #[arg(long, value_name = "N", default_value_t = 1 << 16, help_heading = QUEUE,
          value_parser = clap::value_parser!(u32).range(1..=QueueOptions::MAX as i64))]
    pub(crate) queue: u32,
    /// Policy when events arrive faster than the engine takes them.
    ///
    /// block: the reader waits until half of the queue is free, and falls behind real time.
    /// drop-oldest, drop-newest: when the queue is full, the oldest waiting event or the new event
    /// is dropped. thin:N: only every Nth event enters. filter:TIME: an event enters only if one of
    /// the 8 pixels around it fired within TIME before. refractory:TIME: an event enters only if it
    /// is at least TIME after the last event of its pixel. rate:N: at most N events enter per
    /// second.
    ///
    /// The last four policies become active when the queue is more than half full, and inactive
    /// when it is at most a quarter full. They drop the newest event when the queue is full. Every
    /// dropped event is counted by reason. The filters among the approximations (--activity-filter
    /// and others) act before the queue, at all times.
    #[arg(long, value_name = "POLICY", default_value = "drop-oldest", help_heading = QUEUE)]
    pub(crate) overload: Policy,
    /// Shortest time between two packets of events from a recording, on the wall clock.
    ///
    /// A sensor sends what it has in packets. A packet wakes two threads: with many inputs on few
    /// cores, 1ms leaves time for the engines.
    #[arg(long, value_name = "TIME", default_value = "100us", value_parser = period, help_heading = QUEUE)]
    pub(crate) packet: Duration,
    /// Cores that the engines' threads are pinned to, in turn, such as 0,1.
    ///
    /// Without this option, the system places them.
    #[arg(long, value_name = "CORES", value_delimiter = ',', help_heading = QUEUE)]
    pub(crate) pin: Vec<usize>,
    /// Compute while no event waits and no report is due.
    ///
    /// Reports then wait less for their predictions, and more is computed in total. Predictions
    /// have the same bits, unless an approximation depends on when they are read.
    #[arg(long, help_heading = PREDICTIONS)]
    pub(crate) ahead: bool,
    /// Stream time between two reports.
    ///
    /// Reports are due at the first event's time + TIME, + 2 TIME and so on, up to the first due
    /// time at or after the last event. They are due on the wall clock: every report is made,
    /// however far the engine lags. On a stream, reports are due until it ends; no event leaves the
    /// window before a later one has arrived.
    #[arg(long, value_name = "TIME", default_value = "10ms", value_parser = period, help_heading = PREDICTIONS)]
    pub(crate) report_every: Duration,
    /// Longest wait for the prediction of a report.
    ///
    /// A prediction is fresh if it covers every event that has entered the queue. If the engine
    /// cannot finish in time, it predicts from the events that it has taken (behind). If the report
    /// has no prediction of its own by the deadline, it repeats the newest earlier one (old). Each
    /// report says how far it is behind, and its age.
    #[arg(long, value_name = "TIME", default_value = "5ms", value_parser = length, help_heading = PREDICTIONS)]
    pub(crate) deadline: Duration,
    /// Check the last prediction against a full recomputation, bit for bit.
    ///
    /// The recomputation is over the accepted events: for networks with frozen in-edges the last
    /// (blocks + 1) x capacity events, since a window can depend on no earlier ones, and for other
    /// networks the events of the window. A difference ends the program with status 1.
    #[arg(long, help_heading = PREDICTIONS)]
    pub(crate) verify: bool,
    #[command(flatten)]
    pub(crate) format: JsonArgs,
    #[command(flatten)]
    pub(crate) log: LogArgs,
    /// Show all sensors side by side on a page of this port.
    ///
    /// It is a page as of `meissner view`, on 127.0.0.1; without PORT, on any free one. Its address
    /// goes to standard error. It reads no engine: it shows what is reported, at most 20 times a
    /// second, and only while a page is open.
    #[arg(long, value_name = "PORT", num_args = 0..=1, default_missing_value = "0", help_heading = OUTPUT)]
    pub(crate) view: Option<u16>,
}

/// An overload policy, before the sensor is known.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Policy {
    Block,
    DropOldest,
    DropNewest,
    Thin(u32),
    Activity(i64),
    Refractory(i64),
    Rate(u64),
}

impl PlayArgs {
    /// Opens `recording`.
    fn open(&self, recording: Option<&Path>, card: &ModelCard) -> Result<PlayInput, CliError> {
        let source = self.input.source_of(recording, card)?;
        let sensor = source.sensor(self.input.read.sensor)?;
        Ok(PlayInput { source, sensor, overload: self.overload.overload(sensor)? })
    }

    /// The options of the play.
    fn options(&self) -> PlayOptions {
        PlayOptions {
            speed: self.speed,
            repeat: self.repeat,
            queue: self.queue as usize,
            packet: self.packet,
            cores: self.pin.clone(),
            ahead: self.ahead,
            report_every: self.report_every,
            deadline: self.deadline,
            late: self.input.late,
            restart: self.input.restart,
            approximations: self.input.approximations.values(),
            limit: self.input.limit,
            verify: self.verify.then_some(meissner_reference::PROPOSE),
        }
    }
}

impl Policy {
    /// The policy for `sensor`.
    fn overload(self, sensor: Sensor) -> Result<Overload, EngineError> {
        let filter = match self {
            Self::Block => return Ok(Overload::Block),
            Self::DropOldest => return Ok(Overload::DropOldest),
            Self::DropNewest => return Ok(Overload::DropNewest),
            Self::Thin(stride) => return Ok(Overload::Thin { stride }),
            Self::Activity(us) => Filter::BackgroundActivity(BackgroundActivity::new(sensor, us)?),
            Self::Refractory(us) => Filter::Refractory(Refractory::new(sensor, us)?),
            Self::Rate(rate) => Filter::RateLimit(RateLimit::new(rate)?),
        };
        Ok(Overload::Filter(Chain::new(vec![filter])))
    }
}

impl FromStr for Policy {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let us = |text| span_us(text).ok();
        let policy = match text.split_once(':') {
            None => match text {
                "block" => Some(Self::Block),
                "drop-oldest" => Some(Self::DropOldest),
                "drop-newest" => Some(Self::DropNewest),
                _ => None,
            },
            Some(("thin", n)) => n.parse().ok().filter(|&n| n > 0).map(Self::Thin),
            Some(("filter", time)) => us(time).map(Self::Activity),
            Some(("refractory", time)) => us(time).map(Self::Refractory),
            Some(("rate", n)) => n.parse().ok().filter(|&n| n > 0).map(Self::Rate),
            Some(_) => None,
        };
        policy.ok_or_else(|| {
            "expected block, drop-oldest, drop-newest, thin:N such as thin:4, filter:TIME such as filter:1250us, \
             refractory:TIME such as refractory:1ms, or rate:N in events per second"
                .to_owned()
        })
    }
}
