//! Progress bars on standard error, if it is a terminal.

use std::fmt::Write;
use std::io::{IsTerminal, stdout};
use std::sync::{Mutex, PoisonError};
use std::time::Duration;

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressState, ProgressStyle};

/// Smallest number of events for which a bar is shown. Fewer events are finished before a bar
/// helps.
const LONG: u64 = 20_000;
/// Number of events between two updates of the bar.
const STRIDE: u64 = 256;
/// Time between two updates of the time since the begin.
const TICK: Duration = Duration::from_millis(200);

/// The bar on the terminal: there is one at a time.
static SHOWN: Mutex<Option<ProgressBar>> = Mutex::new(None);

/// Runs `write`, which writes lines that the bar must not overwrite.
pub(crate) fn above<T>(write: impl FnOnce() -> T) -> T {
    let shown = SHOWN.lock().unwrap_or_else(PoisonError::into_inner).clone();
    match shown {
        Some(bar) => bar.suspend(write),
        None => write(),
    }
}

/// A bar, or nothing. It disappears when this is dropped.
#[derive(Debug)]
pub(crate) struct Progress(Option<ProgressBar>);

impl Progress {
    /// A bar over `total` events, if the total is known and large.
    pub(crate) fn new(total: Option<u64>, json: bool) -> Self {
        let long = total.filter(|&total| total >= LONG);
        Self::unless_json(long, json, "{bar:30} {percent:>3} % of {human_len} events, {eta} left")
    }

    /// A bar over `total` tasks that each take a while, with the name of the current one. None if
    /// `total` is 0.
    pub(crate) fn tasks(total: u64, json: bool) -> Self {
        let some = Some(total).filter(|&total| total > 0);
        Self::unless_json(some, json, "{bar:30} {pos} of {len} measured, {eta} left: {msg}")
    }

    /// Shows the current work and its duration, if no events are counted.
    pub(crate) fn busy(what: impl Fn() -> String + Clone + Send + Sync + 'static) -> Self {
        let what = move |_: &ProgressState, out: &mut dyn Write| {
            let _ = out.write_str(&what());
        };
        let bar = ProgressBar::with_draw_target(None, ProgressDrawTarget::stderr());
        let style = ProgressStyle::with_template("{spinner} {what}, {elapsed}");
        bar.set_style(style.unwrap_or_else(|_| ProgressStyle::default_spinner()).with_key("what", what));
        bar.enable_steady_tick(TICK);
        Self::shown(bar)
    }

    /// A bar over `total`, unless JSON scrolls by on a terminal.
    fn unless_json(total: Option<u64>, json: bool, template: &str) -> Self {
        match total {
            Some(_) if !(json && stdout().is_terminal()) => {
                // Indicatif shows nothing if standard error is not a terminal.
                let bar = ProgressBar::with_draw_target(total, ProgressDrawTarget::stderr());
                let style = ProgressStyle::with_template(template);
                Self::shown(bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar())))
            }
            _ => Self(None),
        }
    }

    fn shown(bar: ProgressBar) -> Self {
        *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = Some(bar.clone());
        Self(Some(bar))
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

    /// Removes the bar.
    pub(crate) fn finish(&self) {
        if let Some(bar) = self.0.as_ref().filter(|bar| !bar.is_finished()) {
            *SHOWN.lock().unwrap_or_else(PoisonError::into_inner) = None;
            bar.finish_and_clear();
        }
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.finish();
    }
}
