//! Frames over consecutive windows of equal length: event counts of two channels, or signed frames.
//!
//! Input: events. Output: a frame for each window whose end has passed; empty frames as runs.
//! Window k holds the events with `start + k period <= t < start + (k + 1) period`. Invariant:
//! `values` is 0 where `integers` is, `integers` outside `touched`, `before` outside
//! `touched_before`.

use crate::admission::Admission;
use crate::filters::FilterRule;
use crate::representations::{Completed, Crop, EmptyRun, EventFrame, RepresentationError, SignedRule};
use crate::rows::RowSet;
use crate::{Event, EventCounters, LatePolicy, Outcome, Sensor};

/// Pixels and times of consecutive frames.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Consecutive {
    /// The pixels.
    pub crop: Crop,
    /// Length of a window in microseconds.
    pub period_us: i64,
    /// Start of the first window; by default the time of the first event on the sensor.
    pub start_us: Option<i64>,
}

impl Consecutive {
    /// Windows of 10 ms over `crop`, from the first event on.
    pub fn new(crop: Crop) -> Self {
        Self { crop, period_us: 10_000, start_us: None }
    }
}

/// Frames over consecutive windows: counts of events, or their polarities.
///
/// A push costs O(1), a frame O(pixels touched in it and the one before); nothing is allocated
/// later.
#[derive(Clone, Debug)]
pub struct ConsecutiveFrames {
    admission: Admission,
    options: Consecutive,
    /// The value of a signed pixel; `None` for counts.
    rule: Option<SignedRule>,
    channels: usize,
    /// A value is its integer divided by this.
    divisor: f32,
    /// Number of windows before the open one.
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

impl ConsecutiveFrames {
    /// Two-channel event counts, the input of the contact-force networks: frames of (2, height,
    /// width), channel 0 negative (OFF), 1 positive (ON).
    ///
    /// value(p, y, x) = events of polarity p at (x, y) in the window / `maximum` (the force paper,
    /// Eq. 1), divided in f32. More than `maximum` events give values above 1.
    ///
    /// # Errors
    /// A crop outside `sensor`, a period below 1 us, a maximum that is not finite or below 1.
    pub fn counts(sensor: Sensor, options: Consecutive, maximum: f32) -> Result<Self, RepresentationError> {
        if !maximum.is_finite() || maximum < 1.0 {
            return Err(RepresentationError::option("maximum count", "a finite number from 1 on", maximum));
        }
        Self::new(sensor, options, None, maximum)
    }

    /// Signed frames (1, height, width), the input of the contact-angle paper's frame network.
    ///
    /// # Errors
    /// A crop outside `sensor`, a period below 1 us.
    pub fn signed(
        sensor: Sensor,
        options: Consecutive,
        rule: SignedRule,
    ) -> Result<Self, RepresentationError> {
        Self::new(sensor, options, Some(rule), 1.0)
    }

    fn new(
        sensor: Sensor,
        options: Consecutive,
        rule: Option<SignedRule>,
        divisor: f32,
    ) -> Result<Self, RepresentationError> {
        let channels = if rule.is_none() { 2 } else { 1 };
        options.crop.check(sensor, channels)?;
        if options.period_us < 1 {
            return Err(RepresentationError::option("period", "at least 1 us", options.period_us));
        }
        let pixels = options.crop.pixels();
        let mut frames = Self {
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
        frames.begin();
        Ok(frames)
    }

    /// The same behind the filters of `rules`, which drop and count events as a network's filters
    /// do.
    ///
    /// # Errors
    /// A filter refuses the sensor.
    pub fn with_filters(self, rules: &[FilterRule]) -> Result<Self, RepresentationError> {
        Ok(Self { admission: self.admission.with_filters(rules)?, ..self })
    }

    /// The shape of every frame: (channels, height, width).
    pub fn shape(&self) -> [usize; 3] {
        self.options.crop.shape(self.channels)
    }

    /// Counts of the events so far, by outcome.
    pub fn counters(&self) -> &EventCounters {
        self.admission.counters()
    }

    /// Accepted events outside the crop.
    pub fn outside_crop(&self) -> u64 {
        self.outside_crop
    }

    /// Takes `event`. First hands completed windows to `sink` in order, in at most two calls: one
    /// frame, and one run of empty ones.
    ///
    /// An event outside the crop is accepted, advances time and counts as [`Self::outside_crop`].
    pub fn push(&mut self, event: Event, sink: impl FnMut(Completed<'_>)) -> Outcome {
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

    /// Advances time to `t_us`, and hands the windows that this completes to `sink`. Earlier times
    /// change nothing. Times before the first event change nothing either, unless a start was
    /// given.
    pub fn advance(&mut self, t_us: i64, sink: impl FnMut(Completed<'_>)) {
        self.admission.advance(t_us);
        self.complete(sink);
    }

    /// The open window with its events so far; `None` without a time. O(touched pixels).
    pub fn open(&mut self) -> Option<EventFrame<'_>> {
        self.admission.epoch_us()?;
        self.render();
        Some(self.frame())
    }

    /// Forgets time and all events; the frame before the next one is all 0. Counters are kept.
    pub fn reset(&mut self) {
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
        let integer = match self.rule {
            None => &mut self.integers[usize::from(on) * self.options.crop.pixels() + pixel as usize],
            Some(_) => &mut self.integers[pixel as usize],
        };
        *integer = match self.rule {
            None => integer.saturating_add(1),
            Some(SignedRule::Sum) => integer.saturating_add(sign(on)),
            Some(SignedRule::Latest) => sign(on),
        };
    }

    /// Hands out every window that ends by now.
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

    /// Start of the open window. It cannot overflow: now is not earlier.
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

    /// Computes the open window's values, and the pixels that changed.
    fn render(&mut self) {
        let indices = |pixel| self.options.crop.indices(pixel, self.channels);
        self.changed.clear();
        for &pixel in self.touched.as_slice() {
            let mut differs = false;
            for i in indices(pixel) {
                self.values[i] = self.integers[i] as f32 / self.divisor;
                differs |= self.values[i] != self.before[i];
            }
            if differs {
                self.changed.push(pixel);
            }
        }
        for &pixel in self.touched_before.as_slice() {
            if !self.touched.contains(pixel) && indices(pixel).any(|i| self.before[i] != 0.0) {
                self.changed.push(pixel);
            }
        }
    }

    /// Makes the open window's frame the one before, and opens an empty one.
    fn turn(&mut self) {
        self.forget();
        std::mem::swap(&mut self.values, &mut self.before);
        std::mem::swap(&mut self.touched, &mut self.touched_before);
        for &pixel in self.touched_before.as_slice() {
            self.options.crop.indices(pixel, self.channels).for_each(|i| self.integers[i] = 0);
        }
        self.events = [0; 2];
    }

    /// Makes the frame before an empty one.
    fn forget(&mut self) {
        for &pixel in self.touched_before.as_slice() {
            self.options.crop.indices(pixel, self.channels).for_each(|i| self.before[i] = 0.0);
        }
        self.touched_before.clear();
    }
}

/// The polarity of an event as a number.
pub(super) fn sign(on: bool) -> i32 {
    if on { 1 } else { -1 }
}
