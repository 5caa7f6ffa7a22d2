//! `meissner simulate loop`: control by touch.

use std::io::{self, Write};
use std::path::PathBuf;

use clap::ValueEnum;
use meissner_evaluate::closed_loop::{Delays, Goal, NetworkReport, Plan, Report, Row, Variation, run};
use meissner_kernels::random::Random;
use meissner_plot::{Errors, Panel, Plane, Scale, Series, Setting, Style, TradeOff, page};
use meissner_run::text::{grouped, span_us};
use meissner_simulator::gel::GelSensor;

use crate::args::{APPROXIMATIONS, GelSensorArg, INPUT, MEASUREMENT, OUTPUT};
use crate::error::CliError;
use crate::output;
use crate::output::ReportArgs;
use crate::progress::Progress;
use crate::tasks::TrainedNetworks;
use crate::text::{Table, cell};

/// At the end of the long help.
const METHOD: &str = "\
The loop:
  saw-tooth  a ball of 5 mm is pressed into the gel. The force is to rise from 0.4 to 1.6 N in 4 s, fall at once, and rise again. The first second is not judged.
  marble     a marble of 5 mm lies 0.8 mm deep, is pushed 4 mm away every 2 s, and is to lie in the middle. The sensor moves, the marble rolls, and the contact moves by half as much.
  The network takes a picture when it is free; of the pictures that come meanwhile only the newest waits. Its run time on this machine passes in the loop, so run times and what depends on them differ from run to run. Everything else is determined by --seed.
  The controller adds the motion since the picture to what the network says of it. It takes the force for that of a ball on the first sensor's gel. Speeds are at most 10 mm/s into the gel and 20 mm/s along it.
  Each network runs as it is, and then with each value of --tolerance, --slower, --stale and --drop alone. `the truth` is a controller that knows the truth of each picture at once.

Columns:
  error, rms     mean and root mean square of the distance from the goal
  reading        mean error of what the network said of its pictures
  run            median run time of the network for a picture
  age            mean age of the newest reading when the controller moves
  read, lost     pictures that the network took, and that were lost
  * on the front: no other loop has both a smaller run time and a smaller error.

Examples:
  meissner simulate loop --network canf-plain --svg loop.svg
  meissner simulate loop --goal marble --stale 50ms,100ms,200ms --drop 0.2,0.5";

/// `meissner simulate loop`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = METHOD)]
pub(super) struct LoopArgs {
    /// What is to be reached.
    #[arg(long, value_enum, default_value_t = GoalArg::SawTooth, help_heading = INPUT)]
    goal: GoalArg,
    /// The sensor, as `simulate gel` has it.
    #[arg(long, value_enum, default_value_t = GelSensorArg::First, help_heading = INPUT)]
    sensor: GelSensorArg,
    #[command(flatten)]
    networks: TrainedNetworks,
    /// Simulated time in seconds.
    #[arg(long, value_name = "S", default_value_t = 8.0, help_heading = MEASUREMENT)]
    seconds: f64,
    /// Pictures a second.
    #[arg(long, value_name = "HZ", default_value_t = 25.0, help_heading = MEASUREMENT)]
    rate: f64,
    /// Seed of noise, light, pushes and lost pictures.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = MEASUREMENT)]
    seed: u64,
    /// Also compute only what changes by more than this between pictures.
    ///
    /// It holds for the input, in which one grey level is 0.04 for the shipped networks, and for
    /// the values of every layer.
    #[arg(long, value_name = "CHANGE", value_delimiter = ',', default_values_t = [0.2, 0.4], help_heading = APPROXIMATIONS)]
    tolerance: Vec<f32>,
    /// Also with networks that take so many times as long.
    #[arg(long, value_name = "TIMES", value_delimiter = ',', default_values_t = [4.0], help_heading = INPUT)]
    slower: Vec<f64>,
    /// Also with readings that come so much later.
    #[arg(long, value_name = "TIME", value_delimiter = ',', default_value = "100ms", value_parser = span_us, help_heading = INPUT)]
    stale: Vec<i64>,
    /// Also with this share of the pictures lost.
    #[arg(long, value_name = "SHARE", value_delimiter = ',', default_values_t = [0.3], help_heading = INPUT)]
    drop: Vec<f64>,
    #[command(flatten)]
    report: ReportArgs,
    /// Draw error against run time, and the loops over time, into this file.
    #[arg(long, value_name = "FILE", help_heading = OUTPUT)]
    svg: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum GoalArg {
    /// A force that rises evenly and falls at once.
    SawTooth,
    /// A marble in the middle of the sensor.
    Marble,
}

/// Runs the loops, and prints and draws their results.
pub(super) fn closed_loop(args: &LoopArgs, progress: &Progress) -> Result<(), CliError> {
    output::check_all_writable([&args.report.out, &args.svg])?;
    let variations = args.variations();
    let plan = Plan {
        request: args.networks.request(),
        goal: match args.goal {
            GoalArg::SawTooth => Goal::SawTooth,
            GoalArg::Marble => Goal::Marble,
        },
        sensor: args.sensor.fixed().unwrap_or_else(|| GelSensor::drawn(&mut Random::new(args.seed))),
        seconds: args.seconds,
        rate_hz: args.rate,
        seed: args.seed,
        variations: &variations,
    };
    let report = run(&plan)?;
    progress.finish();
    if let Some(path) = &args.svg {
        output::write(path, svg(&report))?;
    }
    output::report(&args.report, &report, |out| table(out, &report))
}

impl LoopArgs {
    /// The network without variation, then each variation alone.
    fn variations(&self) -> Vec<Variation> {
        let delays = Delays::default();
        let tolerances =
            self.tolerance.iter().map(|&tolerance| Variation { tolerance: Some(tolerance), delays });
        let slower = self.slower.iter().map(|&slower| Delays { slower, ..delays });
        let stale = self.stale.iter().map(|&us| Delays { stale_us: us.unsigned_abs(), ..delays });
        let lost = self.drop.iter().map(|&lost| Delays { lost, ..delays });
        let delayed = slower.chain(stale).chain(lost).map(|delays| Variation { tolerance: None, delays });
        std::iter::once(Variation::default()).chain(tolerances).chain(delayed).collect()
    }
}

/// All rows with the number and name of their network.
fn rows(report: &Report) -> impl Iterator<Item = (usize, &str, &Row)> {
    report.networks.iter().enumerate().flat_map(|(index, network)| {
        let name = network.card.network.name.as_str();
        network.rows.iter().map(move |row| (index, name, row))
    })
}

/// The report for people.
fn table(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    writeln!(out, "loop         {}", about(report))?;
    for network in &report.networks {
        writeln!(out, "network      {}: {}", network.card.network.name, network.weights)?;
    }
    report.notes.iter().try_for_each(|note| writeln!(out, "note         {note}"))?;
    let unit = report.goal.unit();
    let [error, rms, reading] = ["error", "rms", "reading"].map(|figure| format!("{figure} ({unit})"));
    let headings =
        [title(report.goal), &error, &rms, &reading, "run (ms)", "age (ms)", "pictures", "read", "lost"];
    let cells = |name: String, row: &Row| {
        let time = |us: Option<f64>| cell(us, |us| format!("{:.1}", us / 1e3));
        let reading = cell(row.reading_error, |error| format!("{error:.3}"));
        let [pictures, read, lost] = [row.pictures, row.read, row.pictures_lost].map(grouped);
        let (run, age) = (time(row.run_us), time(row.age_us));
        [
            name,
            format!("{:.3}", row.error),
            format!("{:.3}", row.rms),
            reading,
            run,
            age,
            pictures,
            read,
            lost,
        ]
    };
    let networks = rows(report).map(|(_, network, row)| {
        let mark = if row.on_front { " *" } else { "" };
        cells(format!("{network}, {}{mark}", row.name), row)
    });
    Table::section(out, &headings, networks.chain([cells(report.truth.name.clone(), &report.truth)]))?;
    writeln!(out, "\n* on the front: no other loop has both a smaller run time and a smaller error.")
}

fn title(goal: Goal) -> &'static str {
    match goal {
        Goal::SawTooth => "saw-tooth of force",
        Goal::Marble => "marble to the middle",
    }
}

fn about(report: &Report) -> String {
    let Report { seconds, rate_hz, seed, .. } = report;
    format!("{}: {seconds} s, {rate_hz} pictures a second, seed {seed}", title(report.goal))
}

/// The picture: run time against error, and below it each network without variation, over time.
fn svg(report: &Report) -> String {
    let unit = report.goal.unit();
    let point = |(network, of, row): (usize, &str, &Row)| {
        let (name, run_us) = (row.name.clone(), row.run_us?);
        Some(Setting {
            network,
            time: run_us / 1e3,
            error: row.error,
            interval: None,
            on_front: row.on_front,
            tooltip: format!("{of}, {name}: {:.1} ms, {:.3} {unit}", run_us / 1e3, row.error),
            label: Some(name),
        })
    };
    let trade_off = TradeOff {
        time_title: "run time of a picture (ms)".to_owned(),
        error_title: format!("mean tracking error ({unit})"),
        about: format!("with the truth instead of a network: {:.3} {unit}", report.truth.error),
        errors: Errors::Quantities,
        networks: report.networks.iter().map(|network| network.card.network.name.clone()).collect(),
        points: rows(report).filter_map(point).collect(),
    };
    let first =
        |network: &NetworkReport| Some((network.card.network.name.clone(), network.rows.first()?.clone()));
    let all = report.networks.iter().filter_map(first);
    let panels = all.chain([(report.truth.name.clone(), report.truth.clone())]).map(|(name, row)| {
        let series = |name: &str, colour: usize, style: Style, of: fn(&(f64, f64, f64)) -> f64| Series {
            name: name.to_owned(),
            colour,
            style,
            points: row.trace.iter().map(|at| (at.0, of(at))).collect(),
        };
        let y_title = match report.goal {
            Goal::SawTooth => "force (N)",
            Goal::Marble => "distance from the middle (mm)",
        };
        Panel::Plane(Plane {
            about: format!("mean error {:.3} {unit}", row.error),
            scale: Scale::FromZero,
            series: vec![
                series("goal", 5, Style::Dashed, |at| at.1),
                series("reached", 0, Style::Line, |at| at.2),
            ],
            ..Plane::new(name, ["time (s)", y_title])
        })
    });
    let panels = vec![vec![Panel::TradeOff(trade_off)], panels.collect()];
    page("Control by touch: error against run time", &about(report), &panels)
}
