//! `meissner inspect`: a network as a table, as data, as pictures.

use std::io::{Write, stderr, stdout};

use crate::args::InspectArgs;
use crate::error::CliError;
use crate::text::Folded;
use meissner_pipeline::model::describe_any;

/// Prints what `args` ask for.
pub(crate) fn inspect(args: &InspectArgs) -> Result<(), CliError> {
    let (description, _) = describe_any(&args.network)?;
    if let Some(path) = &args.svg {
        std::fs::write(path, description.to_svg())
            .map_err(|source| CliError::Write { path: path.clone(), source })?;
        let _ = writeln!(stderr(), "wrote {}", path.display());
    }
    let mut out = Folded::new(stdout().lock(), !args.json && !args.dot);
    if args.json {
        serde_json::to_writer(&mut out, &description.summary()).map_err(std::io::Error::from)?;
        writeln!(out)?;
    } else if args.dot {
        write!(out, "{}", description.to_dot())?;
    } else if args.svg.is_none() {
        writeln!(out, "{}", description.to_table().trim_end())?;
    }
    Ok(out.flush()?)
}
