//! `meissner eval slip`: networks that tell the direction of slip, on objects that training has seen and on others.
//!
//! | file | job |
//! |---|---|
//! | `args` | what can be asked for, and in its help how it is judged |
//! | `judge` | outputs against labels |
//! | `report` | all results, as they are written as JSON |
//! | `table`, `plot` | the same for people |

mod args;
mod judge;
mod plot;
mod report;
mod table;

use std::collections::BTreeMap;
use std::io::{BufWriter, IsTerminal, Write, stderr, stdout};
use std::time::Instant;

use meissner_models::TensorFile;
use meissner_models::systems::slip::CLASSES;

use crate::error::CliError;
use crate::output::{self, json};
use crate::slip::{SlipData, candidates};
use crate::tell::tell;
use crate::text::Folded;
use crate::threads::pool;
pub(super) use args::SlipArgs;
use judge::Judge;
use meissner_pipeline::provenance::{Header, InputCard};
use meissner_pipeline::source::is_stdin;
use report::{DataReport, ReferenceReport, Report};

/// Judges what `args` ask for, and reports to standard output.
pub(super) fn eval(args: &SlipArgs) -> Result<(), CliError> {
    let (candidates, mut notes) = candidates(&args.networks, args.trainings.as_deref())?;
    let data = SlipData::read(&args.data)?;
    let json_file = args.json.as_deref().filter(|path| !is_stdin(path));
    for path in [json_file, args.svg.as_deref(), args.logits.as_deref()].into_iter().flatten() {
        output::check_writable(path)?;
    }
    let pool = pool(args.threads)?;

    let start = Instant::now();
    let judge = Judge { data: &data, pool: &pool };
    let mut reports = Vec::new();
    let mut logits = Vec::new();
    for candidate in &candidates {
        let judgement = judge.judge(candidate, |training| {
            if stderr().is_terminal() {
                tell(format_args!("{:>8.1} s  {}", start.elapsed().as_secs_f64(), training.label));
            }
        })?;
        reports.push(judgement.report);
        logits.extend(judgement.logits);
        notes.extend(judgement.notes);
    }
    let spent_s = start.elapsed().as_secs_f64();

    notes.splice(0..0, data.notes.iter().cloned());
    let input = InputCard::other(&args.data.display().to_string(), "readings of 24 electrodes");
    let report = Report {
        header: Header::of_many("eval slip", input),
        data: DataReport::new(args.data.display().to_string(), &data, notes),
        classes: CLASSES,
        networks: reports,
        references: ReferenceReport::all(),
    };
    if let Some(path) = &args.svg {
        output::write(path, plot::svg(&report))?;
    }
    if let Some(path) = &args.logits {
        output::write(path, logits_file(&logits))?;
    }
    let mut out = Folded::new(BufWriter::new(stdout().lock()), !args.json.as_deref().is_some_and(is_stdin));
    match &args.json {
        Some(path) if is_stdin(path) => out.write_all(&json(&report)?)?,
        path => {
            if let Some(path) = path {
                output::write(path, json(&report)?)?;
            }
            table::write(&mut out, &report)?;
            writeln!(out, "\njudged in {spent_s:.1} s on {} threads", pool.current_num_threads())?;
        }
    }
    Ok(out.flush()?)
}

/// The outputs of each whole training, as safetensors.
fn logits_file(logits: &[(String, Vec<f32>)]) -> Vec<u8> {
    let mut file = TensorFile::new(BTreeMap::new());
    for (name, values) in logits {
        file.f32(name, &[values.len() / CLASSES.len(), CLASSES.len()], values);
    }
    file.into_bytes()
}
