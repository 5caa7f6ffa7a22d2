//! Figures as tables or JSON: rows are JSON objects, and a table prints some of their fields.

use meissner_kernels::Isa;
use serde_json::{Value, json};

use crate::peak::Peak;

/// How the numbers of a column are printed. Absent values are printed as nothing.
#[derive(Clone, Copy, Debug)]
pub enum Digits {
    /// This number of digits after the point.
    Fixed(usize),
    /// Two digits in total, with an exponent.
    Exponent,
}

/// A column of a table: the field of the rows that it prints, its title, and its digits.
pub type Column = (&'static str, &'static str, Digits);

fn cell(row: &Value, (field, _, digits): &Column) -> String {
    match (&row[field], digits) {
        (Value::String(text), _) => text.clone(),
        (Value::Number(number), Digits::Exponent) => format!("{:.1e}", number.as_f64().unwrap_or(f64::NAN)),
        (Value::Number(number), Digits::Fixed(digits)) if number.is_f64() => {
            format!("{:.digits$}", number.as_f64().unwrap_or(f64::NAN))
        }
        (Value::Number(number), _) => number.to_string(),
        _ => String::new(),
    }
}

/// Prints `rows` as a table with aligned columns: texts to the left, numbers to the right.
fn print_table(columns: &[Column], rows: &[Value]) {
    let mut lines = vec![columns.iter().map(|(_, title, _)| (*title).to_owned()).collect::<Vec<_>>()];
    lines.extend(rows.iter().map(|row| columns.iter().map(|column| cell(row, column)).collect()));
    let widths: Vec<usize> = (0..columns.len())
        .map(|c| lines.iter().map(|line| line[c].chars().count()).max().unwrap_or(0))
        .collect();
    for line in lines {
        let cells = line.iter().zip(&widths).zip(columns).map(|((text, &width), (field, ..))| {
            if rows.iter().any(|row| row[field].is_string()) {
                format!("{text:<width$}")
            } else {
                format!("{text:>width$}")
            }
        });
        println!("{}", cells.collect::<Vec<_>>().join("  ").trim_end());
    }
    println!();
}

/// The command line and the loop of a roofline: `[--json] [--all-isas]`.
///
/// Calls `measure` for each instruction set, adds its name and peak to the object, and prints all
/// as JSON, or each as a header, a `note` and a table of the field `rows`.
///
/// `all` are the instruction sets of `--all-isas`; without it, only the fastest is measured.
pub fn rooflines(
    name: &str,
    all: Vec<Isa>,
    rows: &str,
    columns: &[Column],
    note: impl Fn(&Value) -> String,
    measure: impl Fn(&Peak) -> Value,
) {
    let (mut as_json, mut chosen) = (false, vec![Isa::best()]);
    for argument in std::env::args().skip(1) {
        match argument.as_str() {
            "--json" => as_json = true,
            "--all-isas" => chosen.clone_from(&all),
            _ => {
                eprintln!("usage: {name} [--json] [--all-isas]");
                std::process::exit(2);
            }
        }
    }
    let mut reports = Vec::new();
    for isa in chosen {
        let peak = Peak::measure(isa);
        let mut report = measure(&peak);
        report["isa"] = isa.name().into();
        report["peak_gflops"] = json!(peak.gflops);
        if as_json {
            reports.push(report);
            continue;
        }
        println!("{}, one thread", isa.name());
        println!("  measured peak, product then sum in registers: {:.1} GFLOP/s", peak.gflops);
        println!("{}", note(&report));
        print_table(columns, report[rows].as_array().map_or(&[], Vec::as_slice));
    }
    if as_json {
        println!("{:#}", Value::from(reports));
    }
}
