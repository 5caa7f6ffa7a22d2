//! Frames over consecutive windows of equal length: what counts and signed frames have in common.
//!
//! Enters: events. Leaves: frames, one for each window, once time has passed the window's end; empty ones as runs.
//! Window k holds the events with `start + k period <= t < start + (k + 1) period`.
//! Invariant between calls: `values` is 0 wherever `integers` is, `integers` wherever `touched` has no pixel, `before`
//! wherever `touched_before` has none.

use crate::admission::Admission;
use crate::representations::{Completed, Crop, EmptyRun, EventFrame, RepresentationError};
use crate::rows::RowSet;
use crate::{Event, EventCounters, LatePolicy, Outcome, Sensor};

/// Where and when consecutive frames are taken.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Consecutive {
    /// The pixels.
    pub crop: Crop,
    /// Length of a window in microseconds.
    pub period_us: i64,
    /// When the first window begins; without it, at the first event on the sensor, inside the crop or not.
    pub start_us: Option<i64>,
}

impl Consecutive {
    /// Windows of 10 ms over `crop`, from the first event on.
    pub fn new(crop: Crop) -> Self {
        Self { crop, period_us: 10_000, start_us: None }
    }
}

/// What an event does to its pixel.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Rule {
    /// Adds 1 to the channel of its polarity.
    Count,
    /// Adds its polarity.
    Sum,
    /// Leaves its polarity.
    Latest,
}

#[derive(Clone, Debug)]
pub(super) struct Windows {
    admission: Admission,
    options: Consecutive,
    rule: Rule,
    channels: usize,
    /// A value is its integer divided by this.
    divisor: f32,
    /// Windows before the open one.
    open: i64,
    integers: Vec<i32>,
    values: Vec<f32>,
    touched: RowSet,
    /// The last completed frame.
    before: Vec<f32>,
    touched_before: RowSet,
    changed: Vec<u32>,
    events: [u64; 2],
    outside_crop: u64,
}

impl Windows {
    pub(super) fn new(
        sensor: Sensor,
        options: Consecutive,
        rule: Rule,
        divisor: f32,
    ) -> Result<Self, RepresentationError> {
        let channels = if rule == Rule::Count { 2 } else { 1 };
        options.crop.check(sensor, channels)?;
        if options.period_us < 1 {
            return Err(RepresentationError::option("period", "at least 1 us", options.period_us));
        }
        let pixels = options.crop.pixels();
        let mut windows = Self {
            admission: Admission::new(sensor, LatePolicy::Drop),
            options,
            rule,
            channels,
            divisor,
            open: 0,
            integers: vec![0; channels * pixels],
            values: vec![0.0; channels * pixels],
            touched: RowSet::new(pixels),
            before: vec![0.0; channels * pixels],
            touched_before: RowSet::new(pixels),
            changed: Vec::with_capacity(pixels),
            events: [0; 2],
            outside_crop: 0,
        };
        windows.begin();
        Ok(windows)
    }

    pub(super) fn shape(&self) -> [usize; 3] {
        self.options.crop.shape(self.channels)
    }

    pub(super) fn counters(&self) -> &EventCounters {
        self.admission.counters()
    }

    pub(super) fn outside_crop(&self) -> u64 {
        self.outside_crop
    }

    pub(super) fn push(&mut self, event: Event, sink: impl FnMut(Completed<'_>)) -> Outcome {
        if let Err(reason) = self.admission.admit_node(event) {
            return Outcome::Dropped(reason);
        }
        self.complete(sink);
        match self.options.crop.index(event.x, event.y) {
            Some(pixel) => self.enter(pixel, event.on),
            None => self.outside_crop += 1,
        }
        Outcome::Accepted
    }

    pub(super) fn advance(&mut self, t_us: i64, sink: impl FnMut(Completed<'_>)) {
        self.admission.advance(t_us);
        self.complete(sink);
    }

    pub(super) fn open(&mut self) -> Option<EventFrame<'_>> {
        self.admission.epoch_us()?;
        self.render();
        Some(self.frame())
    }

    pub(super) fn reset(&mut self) {
        self.turn();
        self.forget();
        self.admission.reset();
        self.begin();
    }

    fn begin(&mut self) {
        self.open = 0;
        if let Some(start_us) = self.options.start_us {
            self.admission.begin(start_us);
        }
    }

    fn enter(&mut self, pixel: u32, on: bool) {
        self.events[usize::from(on)] += 1;
        self.touched.insert(pixel);
        let sign = if on { 1 } else { -1 };
        let pixels = self.options.crop.pixels();
        match self.rule {
            Rule::Count => {
                let count = &mut self.integers[usize::from(on) * pixels + pixel as usize];
                *count = count.saturating_add(1);
            }
            Rule::Sum => {
                let sum = &mut self.integers[pixel as usize];
                *sum = sum.saturating_add(sign);
            }
            Rule::Latest => self.integers[pixel as usize] = sign,
        }
    }

    /// Hands out every window before the one that now is in.
    fn complete(&mut self, mut sink: impl FnMut(Completed<'_>)) {
        let open = self.admission.now() / self.options.period_us;
        if open > self.open && self.events != [0, 0] {
            self.render();
            sink(Completed::Frame(self.frame()));
            self.turn();
            self.open += 1;
        }
        if open > self.open {
            self.render();
            sink(Completed::Empty(EmptyRun {
                start_us: self.start_us(),
                period_us: self.options.period_us,
                count: (open - self.open) as u64,
                changed: &self.changed,
            }));
            self.forget();
            self.open = open;
        }
    }

    /// When the open window begins. It cannot overflow: now is not earlier.
    fn start_us(&self) -> i64 {
        self.admission.epoch_us().unwrap_or(0) + self.open * self.options.period_us
    }

    fn frame(&self) -> EventFrame<'_> {
        EventFrame {
            shape: self.shape(),
            values: &self.values,
            start_us: self.start_us(),
            events: self.events,
            touched: self.touched.as_slice(),
            changed: &self.changed,
        }
    }

    /// Forms the open window's values, and what they change.
    fn render(&mut self) {
        let pixels = self.options.crop.pixels();
        self.changed.clear();
        for &pixel in self.touched.as_slice() {
            let mut differs = false;
            for i in (pixel as usize..).step_by(pixels).take(self.channels) {
                self.values[i] = self.integers[i] as f32 / self.divisor;
                differs |= self.values[i] != self.before[i];
            }
            if differs {
                self.changed.push(pixel);
            }
        }
        for &pixel in self.touched_before.as_slice() {
            let mut channels = (pixel as usize..).step_by(pixels).take(self.channels);
            if !self.touched.contains(pixel) && channels.any(|i| self.before[i] != 0.0) {
                self.changed.push(pixel);
            }
        }
    }

    /// The open window's frame becomes the one before, and an empty one is opened.
    fn turn(&mut self) {
        self.forget();
        std::mem::swap(&mut self.values, &mut self.before);
        std::mem::swap(&mut self.touched, &mut self.touched_before);
        let pixels = self.options.crop.pixels();
        for &pixel in self.touched_before.as_slice() {
            (pixel as usize..).step_by(pixels).take(self.channels).for_each(|i| self.integers[i] = 0);
        }
        self.events = [0; 2];
    }

    /// The frame before becomes an empty one.
    fn forget(&mut self) {
        let pixels = self.options.crop.pixels();
        for &pixel in self.touched_before.as_slice() {
            (pixel as usize..).step_by(pixels).take(self.channels).for_each(|i| self.before[i] = 0.0);
        }
        self.touched_before.clear();
    }
}
