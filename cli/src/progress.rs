//! A bar on standard error, on long files, where people are looking.

use std::io::{IsTerminal, stdout};

use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Files with fewer events are over before a bar helps.
const LONG: u64 = 20_000;
/// Events between two looks at the bar.
const STRIDE: u64 = 256;

/// The bar, or nothing.
#[derive(Clone, Debug)]
pub(crate) struct Progress(Option<ProgressBar>);

impl Progress {
    /// A bar over `total` events; none where `total` is unknown or small, where standard error is no terminal, or
    /// where JSON scrolls by on one.
    pub(crate) fn new(total: Option<u64>, json: bool) -> Self {
        let total = total.filter(|&total| total >= LONG && !(json && stdout().is_terminal()));
        Self(total.map(|total| {
            // Hidden by indicatif itself where standard error is no terminal.
            let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
            let style =
                ProgressStyle::with_template("{bar:30} {percent:>3} % of {human_len} events, {eta} left");
            bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        }))
    }

    /// `taken` events are done.
    pub(crate) fn set(&self, taken: u64) {
        if let Some(bar) = self.0.as_ref().filter(|_| taken.is_multiple_of(STRIDE)) {
            bar.set_position(taken);
        }
    }

    /// Runs `write`, which writes lines that the bar must not cut.
    pub(crate) fn suspend<T>(&self, write: impl FnOnce() -> T) -> T {
        match &self.0 {
            Some(bar) => bar.suspend(write),
            None => write(),
        }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}

/// A bar over things to do that each take a while, with the name of the one under way.
#[derive(Clone, Debug)]
pub(crate) struct Tasks(Option<ProgressBar>);

impl Tasks {
    /// A bar over `total` things; none where there are none, or where JSON scrolls by on a terminal.
    pub(crate) fn new(total: u64, json: bool) -> Self {
        let shown = total > 0 && !(json && stdout().is_terminal());
        Self(shown.then(|| {
            let bar = ProgressBar::with_draw_target(Some(total), ProgressDrawTarget::stderr());
            let style = ProgressStyle::with_template("{bar:30} {pos} of {len} measured, {eta} left: {msg}");
            bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()))
        }))
    }

    /// The next one is under way.
    pub(crate) fn start(&self, name: String) {
        if let Some(bar) = &self.0 {
            bar.set_message(name);
            bar.tick();
        }
    }

    /// It is done.
    pub(crate) fn done(&self) {
        if let Some(bar) = &self.0 {
            bar.inc(1);
        }
    }

    /// Takes the bar away.
    pub(crate) fn finish(&self) {
        if let Some(bar) = &self.0 {
            bar.finish_and_clear();
        }
    }
}
