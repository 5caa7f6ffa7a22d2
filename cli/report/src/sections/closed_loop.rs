//! Control by touch: how well a controller follows the goal with a network's readings, and the cost
//! of delays.

use meissner_plot::{Errors, Panel, Scale, Series, Setting, Style, TradeOff};
use serde_json::Value;

use crate::json::{at, list, number, text};
use crate::parts::{Section, Table, bars, plane, shares};
use crate::words::{count, counted, number as shown, time};

/// Maximum number of loops whose errors are lines of a picture.
const MAX_SERIES: usize = 6;
/// Time in seconds, goal and reached value, at each picture.
type Trace = Vec<[f64; 3]>;

/// The section of loops.
pub(crate) fn section(object: &Value) -> Section {
    let mut section = Section::default();
    let goal = Goal::of(text(object, "goal").unwrap_or_default());
    let truth = at(object, "truth");
    let networks: Vec<(&str, &[Value])> = list(object, "networks")
        .iter()
        .map(|of| (text(of, "network/name").unwrap_or("?"), list(of, "rows")))
        .collect();
    let known = truth.and_then(|row| number(row, "error"));
    for (name, rows) in &networks {
        answer(&mut section, goal, name, rows, known);
    }
    section.draw(
        "Each point is a loop. Left is faster, lower follows better.",
        &Panel::TradeOff(trade_off(goal, &networks, known)),
    );
    let first = networks.iter().filter_map(|&(name, rows)| Some((name, rows.first()?)));
    for (name, row) in first.chain(truth.map(|row| ("the truth", row))) {
        course(&mut section, goal, name, row);
    }
    for (name, rows) in &networks {
        errors(&mut section, goal, name, rows);
    }
    ages(&mut section, &networks);
    table(&mut section, goal, &networks, truth);
    let notes = list(object, "notes").iter().filter_map(Value::as_str);
    section.table(Table::new("Notes", &[""], notes.map(|note| vec![note.to_owned()]).collect()));
    let facts = [
        ("simulated time", number(object, "seconds").map(|s| time(1e6 * s))),
        ("pictures a second", number(object, "rate_hz").map(shown)),
        ("seed", number(object, "seed").map(count)),
    ];
    let facts = facts.into_iter().filter_map(|(name, value)| Some(vec![name.to_owned(), value?]));
    section.table(Table::new("The loop", &["", ""], facts.collect()));
    section
}

/// The controlled quantity.
#[derive(Clone, Copy)]
struct Goal {
    /// The controlled quantity and its goal.
    words: [&'static str; 2],
    unit: &'static str,
    axis: &'static str,
}

impl Goal {
    fn of(name: &str) -> Self {
        match name {
            "marble" => Self {
                words: ["the marble", "the middle"],
                unit: "mm",
                axis: "distance from the middle (mm)",
            },
            _ => Self { words: ["the force", "its saw-tooth"], unit: "N", axis: "force (N)" },
        }
    }
}

/// The row without variation, and the row that follows the goal worst.
fn answer(section: &mut Section, goal: Goal, name: &str, rows: &[Value], known: Option<f64>) {
    let Some(first) = rows.first() else { return };
    let found = |key: &str| number(first, key);
    let Goal { words: [what, to], unit, .. } = goal;
    if let Some(error) = found("error") {
        let known = known.map_or_else(String::new, |known| {
            format!(" A controller that knows the truth is off by {} {unit}.", shown(known))
        });
        section
            .answer
            .push(format!("With {name}, {what} is off {to} by {} {unit} in the mean.{known}", shown(error)));
        section.figure(&format!("{name}: mean error ({unit})"), Some(error));
        section.figure(&format!("{name}: rms error ({unit})"), found("rms"));
        section.figure(&format!("{name}: error of readings ({unit})"), found("reading_error"));
        section.figure(&format!("{name}: run time of a picture (us)"), found("run_us"));
    }
    if let (Some(run), Some(read), Some(pictures)) = (found("run_us"), found("read"), found("pictures")) {
        // Without an age, no reading was in time for a motion.
        let age = found("age_us").map_or_else(
            || "the controller had none of them in time".to_owned(),
            |age| format!("the controller moves by readings that are {} old", time(age)),
        );
        section.answer.push(format!(
            "It takes {} for a picture and reads {} of {}; {age}.",
            time(run),
            count(read),
            counted(pictures, "picture", "pictures"),
        ));
    }
    let judged = rows.iter().filter_map(|row| Some((text(row, "name")?, number(row, "error")?)));
    let worst = judged.max_by(|a, b| a.1.total_cmp(&b.1));
    if let Some((worst, error)) =
        worst.filter(|(_, error)| found("error").is_some_and(|first| *error > first))
    {
        section.answer.push(format!("It follows worst with {worst}: off by {} {unit}.", shown(error)));
    }
}

fn trade_off(goal: Goal, networks: &[(&str, &[Value])], known: Option<f64>) -> TradeOff {
    let unit = goal.unit;
    let rows =
        networks.iter().enumerate().flat_map(|(i, (name, rows))| rows.iter().map(move |row| (i, *name, row)));
    let point = |(network, of, row): (usize, &str, &Value)| {
        let (run_us, error) = (number(row, "run_us")?, number(row, "error")?);
        let name = text(row, "name").unwrap_or("?").to_owned();
        Some(Setting {
            network,
            time: run_us / 1e3,
            error,
            interval: None,
            on_front: at(row, "on_front").and_then(Value::as_bool) == Some(true),
            tooltip: format!("{of}, {name}: {}, {} {unit}", time(run_us), shown(error)),
            label: Some(name),
        })
    };
    let known = known.map_or_else(String::new, |known| {
        format!("with the truth instead of a network: {} {unit}", shown(known))
    });
    TradeOff {
        time_title: "run time of a picture (ms)".to_owned(),
        error_title: format!("mean error ({unit})"),
        about: known,
        errors: Errors::Quantities,
        networks: networks.iter().map(|(name, _)| (*name).to_owned()).collect(),
        points: rows.filter_map(point).collect(),
    }
}

/// Time in seconds, goal, and reached value.
fn trace(row: &Value) -> Trace {
    let point = |point: &Value| {
        let part = |i: usize| point.get(i).and_then(Value::as_f64);
        Some([part(0)?, part(1)?, part(2)?])
    };
    list(row, "trace").iter().filter_map(point).collect()
}

/// Goal and course over time.
fn course(section: &mut Section, goal: Goal, name: &str, row: &Value) {
    let trace = trace(row);
    if trace.is_empty() {
        return;
    }
    let along = |part: usize| trace.iter().map(|at| (at[0], at[part])).collect();
    let series = vec![
        Series::new("goal", 5, Style::Dashed, along(1)),
        Series::new("reached", 0, Style::Line, along(2)),
    ];
    let mut panel = plane(name, ["time (s)", goal.axis], series);
    panel.scale = Scale::FromZero;
    let error = number(row, "error").map_or_else(String::new, shown);
    let caption = if name == "the truth" {
        format!(
            "The controller alone, which knows the truth of each picture at once: off by {error} {}.",
            goal.unit
        )
    } else {
        format!("The loop as it is: off by {error} {} in the mean.", goal.unit)
    };
    section.draw(caption, &Panel::Plane(panel));
}

/// The error over time of each loop of a network.
fn errors(section: &mut Section, goal: Goal, name: &str, rows: &[Value]) {
    let traced = rows.iter().map(|row| (text(row, "name").unwrap_or("?"), trace(row)));
    let traced: Vec<(&str, Trace)> = traced.filter(|(_, trace)| !trace.is_empty()).collect();
    if traced.len() < 2 {
        return;
    }
    // If there are many, the first, without variation, and the last ones, with delays, are shown.
    let later = traced.len().saturating_sub(MAX_SERIES - 1).max(1);
    let shown = traced[..1].iter().chain(&traced[later..]).enumerate();
    let series = shown.map(|(colour, (name, trace))| {
        let points = trace.iter().map(|at| (at[0], (at[2] - at[1]).abs()));
        Series::new(*name, colour, Style::Line, points.collect())
    });
    let title = format!("{name}: distance from the goal");
    let mut panel = plane(&title, ["time (s)", &format!("error ({})", goal.unit)], series.collect());
    panel.scale = Scale::FromZero;
    section.draw(
        "Each line is a loop. Peaks are where the goal jumps, or the marble is pushed.",
        &Panel::Plane(panel),
    );
}

/// The age of readings, and the fate of the pictures.
fn ages(section: &mut Section, networks: &[(&str, &[Value])]) {
    let several = networks.len() > 1;
    let named = |name: &str, row: &Value| {
        let varied = text(row, "name").unwrap_or("?");
        if several { format!("{name}, {varied}") } else { varied.to_owned() }
    };
    let all =
        || networks.iter().flat_map(|&(name, rows)| rows.iter().map(move |row| (named(name, row), row)));
    let ages: Vec<(String, f64)> =
        all().filter_map(|(name, row)| Some((name, number(row, "age_us")? / 1e3))).collect();
    if !ages.is_empty() {
        section.draw(
            "How old the newest reading is when the controller moves: the wait for the next picture, the run time, and what is later.",
            &Panel::Parts(bars("Age of readings", "mean age (ms)", ages)),
        );
    }
    let pictures: Vec<(String, Vec<f64>)> = all()
        .filter_map(|(name, row)| {
            let [read, lost, all] = ["read", "pictures_lost", "pictures"].map(|key| number(row, key));
            let (read, lost) = (read?, lost?);
            Some((name, vec![read, lost, (all? - read - lost).max(0.0)]))
        })
        .collect();
    if !pictures.is_empty() {
        let parts = [("read", 0), ("lost", 1), ("replaced by newer ones", 5)];
        section.draw(
            "A picture that waits while the network is busy is replaced by the next one.",
            &Panel::Parts(shares(
                "What became of the pictures",
                "share of the pictures (%)",
                &parts,
                pictures,
            )),
        );
    }
}

fn table(section: &mut Section, goal: Goal, networks: &[(&str, &[Value])], truth: Option<&Value>) {
    let cells = |name: String, row: &Value| {
        let of = |key: &str| number(row, key);
        let [error, rms, reading] =
            ["error", "rms", "reading_error"].map(|key| of(key).map_or_else(String::new, shown));
        let [run, age] = ["run_us", "age_us"].map(|key| of(key).map_or_else(String::new, time));
        let [pictures, read, lost] =
            ["pictures", "read", "pictures_lost"].map(|key| of(key).map_or_else(String::new, count));
        let front = if at(row, "on_front").and_then(Value::as_bool) == Some(true) { "yes" } else { "" };
        vec![name, error, rms, reading, run, age, pictures, read, lost, front.to_owned()]
    };
    let rows = networks.iter().flat_map(|&(network, rows)| {
        rows.iter().map(move |row| (format!("{network}, {}", text(row, "name").unwrap_or("?")), row))
    });
    let rows = rows.chain(truth.map(|row| ("the truth".to_owned(), row)));
    let rows: Vec<Vec<String>> = rows.map(|(name, row)| cells(name, row)).collect();
    let [error, rms, reading] =
        ["mean error", "rms", "error of readings"].map(|figure| format!("{figure} ({})", goal.unit));
    let headings = [
        "loop",
        &error,
        &rms,
        &reading,
        "run time",
        "age of readings",
        "pictures",
        "read",
        "lost",
        "on the front",
    ];
    section.table(Table::new("Loops", &headings, rows));
}
