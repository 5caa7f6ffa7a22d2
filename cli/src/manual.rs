//! `meissner completions` and `meissner man`: completions of a shell and pages of the manual, from
//! the definitions of the arguments.

use std::fs;
use std::io::Write;
use std::path::PathBuf;

use clap::Command;
use clap_complete::Shell;

use crate::error::CliError;
use crate::output;

/// Examples, at the end of the long help of `completions`.
const COMPLETIONS: &str = "\
Examples:
  meissner completions bash > ~/.local/share/bash-completion/completions/meissner
  meissner completions zsh > ~/.zfunc/_meissner
  meissner completions fish > ~/.config/fish/completions/meissner.fish";

/// Examples, at the end of the long help of `man`.
const MAN: &str = "\
Examples:
  meissner man ~/.local/share/man/man1";

/// `meissner completions`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = COMPLETIONS)]
pub(crate) struct CompletionsArgs {
    /// The shell.
    #[arg(value_name = "SHELL")]
    shell: Shell,
}

/// `meissner man`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = MAN)]
pub(crate) struct ManArgs {
    /// Folder for the pages, one for each command; it is made if it is missing.
    ///
    /// Pages of the same names are replaced.
    #[arg(value_name = "FOLDER")]
    folder: PathBuf,
}

/// Prints the completions of a shell for `command`, the whole program.
pub(crate) fn completions(args: &CompletionsArgs, mut command: Command) -> Result<(), CliError> {
    let mut text = Vec::new();
    clap_complete::generate(args.shell, &mut command, "meissner", &mut text);
    let mut out = output::out(true);
    out.write_all(&text)?;
    Ok(out.flush()?)
}

/// Writes the pages of the manual of `command`, the whole program.
pub(crate) fn man(args: &ManArgs, command: Command) -> Result<(), CliError> {
    let made = fs::create_dir_all(&args.folder);
    let written = made.and_then(|()| clap_mangen::generate_to(command, &args.folder));
    written.map_err(|source| CliError::write(&args.folder, source))
}
