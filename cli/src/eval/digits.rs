//! `meissner eval digits`: accuracies of networks over events for digits, event by event.

mod plot;

use std::io::{self, Write};

use meissner_evaluate::digits::{Judged, Options, Protocol, Report, evaluate};
use meissner_evaluate::trainings::seed_name;
use meissner_models::systems::digits::CLASSES;
use meissner_pipeline::text;
use meissner_pipeline::text::grouped;

use super::{NONE, OutputArgs, Views, confusion, spread};
use crate::args::{Mode, NETWORK, PREDICTIONS, STATUS};
use crate::error::CliError;
use crate::tasks::DigitsTask;
use crate::text::{Table, percent};

/// At the end of the long help.
const METHOD: &str = "\
How it judges:
  Every recording is a stream of its own. The engine is reset, events are pushed one by one, and a prediction is read every TIME (--every) and at the end. Times count from the first event of the recording. A prediction is the class with the largest output. After the end of a recording its last prediction stands: every recording counts at every time, and the last accuracy is that at the end. An answer has settled at the first of these moments from which on it is right. The median is the time by which half of all recordings have settled; some may never settle.
  Whole trainings are judged on the split test, folds of a cross-validation on the recordings that they held out, of both splits.
  Intervals are 95 % Wilson intervals over the recordings, one for each seed. For several seeds, the bounds are means over the seeds, accuracies have a mean and a sample standard deviation (- for one seed), and confusion matrices are sums.

Trainings (--trainings): every *.safetensors file of the folder is one, with metadata
  network     name of the network; digits-frozen runs with those of digits-past
  seed        whole number
  trained_on  \"train\": the split test is unseen; folds need no trained_on
  held_out    JSON list of recordings, such as [\"train/3/00123\"]: the file is a
              fold; or not there: a whole training
  fold        whole number, or not there
  stride      trained on every N-th event of a recording, from the first one
              on; or not there: on all events
  The folds of a network and seed must hold out every recording exactly once, and give one accuracy together.

JSON (--json), shares from 0 to 1:
  {\"header\": what was judged on what (docs/json.md), \"data\": {\"folder\", \"recordings\", \"train\", \"test\", \"events\", \"notes\"}, \"classes\", \"mode\", \"every_us\", \"times_us\": [the times at which predictions are read], \"networks\": [{\"network\", \"weights\", \"outputs\", \"classes\", \"stride\", \"test\": JUDGED or null, \"cross_validation\": JUDGED or null}]}
  JUDGED: \"recordings\": judged per training, \"trainings\", \"accuracy\": {\"mean\", \"std\" (null for one training)}, \"interval_95\": [low, high], \"settled_us\": the median, null where half or more never settle, \"confusion\": rows true, columns predicted, summed over the trainings, \"accuracy_at\": [{\"mean\", \"std\"}], \"interval_95_at\": [[low, high]], both for each of times_us, \"each\": [{\"seed\" (null where the weights name none), \"files\", \"recordings\", \"accuracy\", \"interval_95\", \"settled_us\", \"confusion\", \"accuracy_at\": [share], \"interval_95_at\"}]

Logits (--logits), at the end of each recording:
  For every whole training a tensor NETWORK.SEED, or NETWORK.shipped where the weights name no seed, of shape (recordings of the split test, 10). For the folds of a seed together a tensor NETWORK.SEED.folds of shape (recordings, 10). Metadata recordings and test: JSON lists of their names.

Examples:
  meissner eval digits nmnist/
  meissner eval digits nmnist/ --network own.toml --weights own.safetensors
  meissner eval digits nmnist/ --trainings runs/ --folds 10 --json - > out.json
  meissner eval digits nmnist/ --network digits-past --every 5ms --svg out.svg";

/// `meissner eval digits`.
#[derive(Debug, clap::Args)]
#[command(after_help = STATUS, after_long_help = format!("{METHOD}\n\n{STATUS}"))]
pub(super) struct DigitsArgs {
    #[command(flatten)]
    task: DigitsTask,
    /// Take every Nth event of each recording [default: as the weights say].
    ///
    /// The first event is taken. The metadata of weights have the stride of their training; without it, every event is
    /// taken.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u32).range(1..), help_heading = NETWORK)]
    stride: Option<u32>,
    /// Time from one prediction to the next.
    ///
    /// It is 100us to 10s.
    #[arg(long = "every", value_name = "TIME", default_value = "10ms", value_parser = every_us,
          help_heading = PREDICTIONS)]
    every_us: i64,
    /// Recompute what an event changes, or every row at every prediction.
    ///
    /// Both give the same values, bit for bit.
    #[arg(long, value_enum, default_value_t = Mode::Incremental, help_heading = PREDICTIONS)]
    mode: Mode,
    #[command(flatten)]
    output: OutputArgs,
}

/// Reads a time from one prediction to the next.
fn every_us(text: &str) -> Result<i64, String> {
    let us = text::span_us(text)?;
    let fits = (100..=10_000_000).contains(&us);
    if fits { Ok(us) } else { Err("expected a time from 100us to 10s".to_owned()) }
}

pub(super) fn eval(args: &DigitsArgs) -> Result<(), CliError> {
    let options = Options {
        request: args.task.request(),
        stride: args.stride.map(|stride| stride as usize),
        folds: args.task.folds(),
        every_us: args.every_us,
        mode: args.mode.into(),
    };
    let views = Views { svg: plot::svg, table };
    super::write(&args.output, &views, |pool, done| evaluate(&args.task.data, &options, pool, done))
}

/// Largest number of rows of the table of accuracies against time. JSON has all times.
const MOST_TIMES: usize = 40;

/// The report for people: shares in percent, times in milliseconds.
fn table(out: &mut dyn Write, report: &Report) -> io::Result<()> {
    let data = &report.data;
    let [recordings, train, test] = [data.recordings, data.train, data.test].map(|n| grouped(n as u64));
    writeln!(
        out,
        "data         {}: {recordings} recordings ({train} train, {test} test), {} events",
        data.folder,
        grouped(data.events)
    )?;
    let every = milliseconds(report.every_us);
    writeln!(out, "predictions  {}, every {every} ms and at the end of a recording", report.mode)?;
    for (i, network) in report.networks.iter().enumerate() {
        let title = if i == 0 { "networks" } else { "" };
        let stride = match network.stride {
            1 => String::new(),
            stride => format!("; one event of {stride}"),
        };
        writeln!(out, "{title:<12} {}: {}{stride}", network.network, network.weights)?;
    }
    data.notes.iter().try_for_each(|note| writeln!(out, "note         {note}"))?;
    let judged = judged(report);
    accuracies(out, &judged)?;
    seeds(out, &judged)?;
    against_time(out, report, &judged)?;
    for (name, judged) in &judged {
        writeln!(out, "\n{name}: true class by row, predicted by column, percent of the row")?;
        confusion(out, &CLASSES, "recordings", &judged.confusion, judged.trainings)?;
    }
    Ok(())
}

/// All figures, each with its network and protocol.
fn judged(report: &Report) -> Vec<(String, &Judged)> {
    let mut all = Vec::new();
    for network in &report.networks {
        for protocol in Protocol::ALL {
            let judged = network.judged(protocol);
            all.extend(judged.map(|judged| (format!("{}, {}", network.network, protocol.name()), judged)));
        }
    }
    all
}

/// Microseconds as milliseconds, with all decimals.
fn milliseconds(t_us: i64) -> String {
    (t_us as f64 / 1000.0).to_string()
}

/// An interval in percent.
fn interval((low, high): (f64, f64)) -> String {
    format!("{} to {}", percent(low), percent(high))
}

fn settled(t_us: Option<i64>) -> String {
    t_us.map_or_else(|| NONE.to_owned(), |t_us| format!("{:.1}", t_us as f64 / 1000.0))
}

fn accuracies(out: &mut dyn Write, all: &[(String, &Judged)]) -> io::Result<()> {
    let mut table = Table::new(&[
        "at the end of a recording",
        "recordings",
        "seeds",
        "accuracy (%)",
        "std",
        "95 % interval",
        "half right for good by (ms)",
    ]);
    for (name, judged) in all {
        let [mean, std] = spread(judged.accuracy);
        table.row([
            name.clone(),
            grouped(judged.recordings),
            judged.trainings.to_string(),
            mean,
            std,
            interval(judged.interval_95),
            settled(judged.settled_us),
        ]);
    }
    writeln!(out)?;
    table.write(out)
}

/// Each seed, where there are several.
fn seeds(out: &mut dyn Write, all: &[(String, &Judged)]) -> io::Result<()> {
    if all.iter().all(|(_, judged)| judged.trainings < 2) {
        return Ok(());
    }
    let mut table =
        Table::new(&["each seed", "files", "accuracy (%)", "95 % interval", "half right for good by (ms)"]);
    for (name, judged) in all {
        for one in &judged.each {
            table.row([
                format!("{name}, seed {}", seed_name(one.seed)),
                one.files.len().to_string(),
                percent(one.accuracy),
                interval(one.interval_95),
                settled(one.settled_us),
            ]);
        }
    }
    writeln!(out)?;
    table.write(out)
}

/// Accuracies at the times of predictions, the last one always.
fn against_time(out: &mut dyn Write, report: &Report, all: &[(String, &Judged)]) -> io::Result<()> {
    let mut headings = vec!["accuracy (%) after (ms)"];
    headings.extend(all.iter().map(|(name, _)| name.as_str()));
    let mut table = Table::new(&headings);
    let times = &report.times_us;
    let step = times.len().div_ceil(MOST_TIMES).max(1);
    for (i, &t_us) in times.iter().enumerate().filter(|(i, _)| (i + 1) % step == 0 || i + 1 == times.len()) {
        let cells = all.iter().map(|(_, judged)| percent(judged.accuracy_at[i].mean));
        table.row(std::iter::once(milliseconds(t_us)).chain(cells));
    }
    writeln!(out)?;
    table.write(out)
}
