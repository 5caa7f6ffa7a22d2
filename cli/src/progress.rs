//! Progress bars on standard error, if it is a terminal.

use std::io::{IsTerminal, stdout};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Smallest number of events that a bar is shown for. Fewer events are over before a bar helps.
const LONG: u64 = 20_000;
/// Number of events between two updates of the bar.
const STRIDE: u64 = 256;

/// Time between two updates of the time since the begin.
const TICK: Duration = Duration::from_millis(200);

/// A bar, or nothing.
#[derive(Clone, Debug)]
pub(crate) struct Progress(Option<ProgressBar>);

impl Progress {
    /// A bar over `total` events, if the total is known and large.
    pub(crate) fn new(total: Option<u64>, json: bool) -> Self {
        let long = total.filter(|&total| total >= LONG);
        Self::unless_json(long, json, "{bar:30} {percent:>3} % of {human_len} events, {eta} left")
    }

    /// A bar over `total` tasks that each take a while, with the name of the current one. None if `total` is 0.
    pub(crate) fn tasks(total: u64, json: bool) -> Self {
        let some = Some(total).filter(|&total| total > 0);
        Self::unless_json(some, json, "{bar:30} {pos} of {len} measured, {eta} left: {msg}")
    }

    /// The time since `what` began, for work whose length is not known.
    pub(crate) fn busy(what: &'static str) -> Self {
        let busy = Self::bar(None, "{spinner} {msg}, {elapsed}");
        if let Some(spinner) = &busy.0 {
            spinner.set_message(what);
            spinner.enable_steady_tick(TICK);
        }
        busy
    }

    /// A bar over `total`, unless JSON scrolls by on a terminal.
    fn unless_json(total: Option<u64>, json: bool, template: &str) -> Self {
        match total {
            Some(_) if !(json && stdout().is_terminal()) => Self::bar(total, template),
            _ => Self(None),
        }
    }

    fn bar(total: Option<u64>, template: &str) -> Self {
        // Indicatif shows nothing if standard error is not a terminal.
        let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template(template).unwrap_or_else(|_| ProgressStyle::default_bar());
        Self(Some(bar.with_style(style)))
    }

    /// Sets the number of events that are done.
    pub(crate) fn set(&self, taken: u64) {
        if let Some(bar) = self.0.as_ref().filter(|_| taken.is_multiple_of(STRIDE)) {
            bar.set_position(taken);
        }
    }

    /// Shows the name of the task that begins.
    pub(crate) fn start(&self, name: String) {
        if let Some(bar) = &self.0 {
            bar.set_message(name);
            bar.tick();
        }
    }

    /// Counts a task as done.
    pub(crate) fn done(&self) {
        if let Some(bar) = &self.0 {
            bar.inc(1);
        }
    }

    /// Runs `write`, which writes lines that the bar must not overwrite.
    pub(crate) fn suspend<T>(&self, write: impl FnOnce() -> T) -> T {
        match &self.0 {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}
