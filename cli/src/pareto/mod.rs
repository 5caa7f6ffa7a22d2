//! `meissner pareto`: run time against error, of networks exactly and with each approximation.
//!
//! | file | job |
//! |---|---|
//! | `args` | what can be asked for, and in its help how it is measured |
//! | `digits`, `angle`, `slip/` | the systems: networks, settings, data |
//! | `settings` | the approximations of a network over events |
//! | `study` | everything that is to be measured, one after the other |
//! | `state`, `fingerprint` | what has been measured already |
//! | `events`, `wrong` | a network over events: times and numerical errors, answers against labels |
//! | `measurement`, `timing`, `numerical` | what is known of a setting |
//! | `front` | what nothing beats |
//! | `report`, `words` | all results, as they are written as JSON, and what they come to |
//! | `table`, `plot/` | the same for people |

mod angle;
mod args;
mod digits;
mod events;
mod fingerprint;
mod front;
mod measurement;
mod numerical;
mod plot;
mod report;
mod settings;
mod slip;
mod state;
mod study;
mod table;
mod timing;
mod words;
mod wrong;

use std::io::{BufWriter, Write, stdout};

use crate::error::CliError;
use crate::output;
use crate::slip::SlipData;
use crate::text::Folded;
use crate::threads::pool;
pub(crate) use args::ParetoArgs;
use args::{Common, What};
use meissner_pipeline::source::is_stdin;
use report::Report;
use state::State;
use study::Study;

/// Measures what `args` ask for, and reports to standard output.
pub(crate) fn pareto(args: &ParetoArgs) -> Result<(), CliError> {
    match &args.what {
        What::Digits(args) => {
            let pool = pool(args.common.threads)?;
            let plan = digits::DigitsPlan::read(args)?;
            finish(&digits::study(args, &plan, &pool)?, &args.common)
        }
        What::Angle(args) => {
            let data = angle::AngleData::read(args)?;
            finish(&angle::study(args, &data)?, &args.common)
        }
        What::Slip(args) => {
            let pool = pool(args.common.threads)?;
            let data = SlipData::read(&args.data)?;
            finish(&slip::study(args, &data, &pool)?, &args.common)
        }
    }
}

fn finish(study: &Study<'_>, common: &Common) -> Result<(), CliError> {
    let json_file = common.json.as_deref().filter(|path| !is_stdin(path));
    for path in [json_file, common.csv.as_deref(), common.svg.as_deref()].into_iter().flatten() {
        output::check_writable(path)?;
    }
    let mut state = State::open(common.state.as_deref())?;
    let report = Report::new(study, study.run(common, &mut state)?, common.repeat);
    if let Some(path) = &common.svg {
        output::write(path, plot::svg(&report))?;
    }
    if let Some(path) = &common.csv {
        output::write(path, table::csv(&report))?;
    }
    let mut out = Folded::new(BufWriter::new(stdout().lock()), !common.prints_json());
    if common.prints_json() {
        out.write_all(&output::json(&report)?)?;
    } else {
        if let Some(path) = json_file {
            output::write(path, output::json(&report)?)?;
        }
        table::write(&mut out, &report)?;
    }
    Ok(out.flush()?)
}
