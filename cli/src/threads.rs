//! Threads that share work.

use clap::{Arg, value_parser};
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::args::{MEASUREMENT, PREDICTIONS};
use crate::error::CliError;

/// The number of threads.
#[derive(Clone, Copy, Debug, Default, clap::Args)]
pub(crate) struct Threads {
    /// Threads that share the work [default: the machine's cores].
    ///
    /// The results are the same for any number.
    #[arg(long, value_name = "N", value_parser = value_parser!(u16).range(1..=512), help_heading = MEASUREMENT)]
    threads: Option<u16>,
}

/// `--threads` for a single engine, whose work at most two threads share.
pub(crate) fn of_one_engine(arg: Arg) -> Arg {
    let help = "Threads that share the work of a prediction, 1 or 2 [default: 1]";
    let more = "The second helps where a prediction takes hundreds of microseconds. The values are the same, bit for bit. \
                Not with --mode batch, whose predictions one thread computes.";
    let arg = arg.value_parser(value_parser!(u16).range(1..=2)).help_heading(PREDICTIONS);
    arg.help(help).long_help(format!("{help}.\n\n{more}"))
}

impl Threads {
    /// A pool of this many threads.
    pub(crate) fn pool(self) -> Result<ThreadPool, CliError> {
        let threads = self.threads.map_or(0, usize::from);
        let pool = ThreadPoolBuilder::new().num_threads(threads).build();
        pool.map_err(|source| CliError::Threads { threads, source })
    }

    /// Whether two threads share the work of one engine.
    pub(crate) fn are_two(self) -> bool {
        self.threads == Some(2)
    }

    /// The pool whose two threads share the work of one engine, if there are two. The calling
    /// thread is one of them while the pool is there.
    pub(crate) fn shared(self) -> Result<Option<ThreadPool>, CliError> {
        let two = || ThreadPoolBuilder::new().num_threads(2).use_current_thread().build();
        self.are_two().then(two).transpose().map_err(|source| CliError::Threads { threads: 2, source })
    }
}
