//! A signed frame over the last `span_us`, readable at any time.
//!
//! Input: events, and time. Output: the frame over `now - span <= t <= now`, on demand. Invariant:
//! a pixel's integer is the sum (or latest polarity) of its events in `window`, `held` their
//! number; `values` is out of date only in `stale`.

use std::collections::VecDeque;

use crate::admission::Admission;
use crate::filters::FilterRule;
use crate::representations::consecutive::sign;
use crate::representations::{Crop, EventFrame, RepresentationError, SignedRule};
use crate::rows::RowSet;
use crate::{Event, EventCounters, LatePolicy, Outcome, Sensor};

#[derive(Clone, Copy, Debug)]
struct Member {
    t: i64,
    pixel: u32,
    on: bool,
}

/// A signed frame whose events leave when they are too old.
///
/// A push costs O(1) amortised, a frame O(pixels whose events changed).
#[derive(Clone, Debug)]
pub struct SlidingSigned {
    admission: Admission,
    crop: Crop,
    rule: SignedRule,
    span_us: i64,
    capacity: usize,
    window: VecDeque<Member>,
    integers: Vec<i32>,
    held: Vec<u32>,
    values: Vec<f32>,
    touched: RowSet,
    stale: RowSet,
    changed: Vec<u32>,
    events: [u64; 2],
    outside_crop: u64,
}

impl SlidingSigned {
    /// A capacity for streams of any sensor: 6 MiB of events.
    pub const DEFAULT_CAPACITY: usize = 1 << 18;

    /// An empty window of `span_us` for `capacity` events: if there are more, the oldest leave
    /// first and count as evicted.
    ///
    /// # Errors
    /// A crop outside `sensor`, a span or a capacity below 1, a capacity above 2^31 - 1.
    pub fn new(
        sensor: Sensor,
        crop: Crop,
        rule: SignedRule,
        span_us: i64,
        capacity: usize,
    ) -> Result<Self, RepresentationError> {
        crop.check(sensor, 1)?;
        if span_us < 1 {
            return Err(RepresentationError::option("span", "at least 1 us", span_us));
        }
        if capacity < 1 || capacity > i32::MAX as usize {
            return Err(RepresentationError::option("capacity", "1 to 2^31 - 1 events", capacity));
        }
        let pixels = crop.pixels();
        Ok(Self {
            admission: Admission::new(sensor, LatePolicy::Drop),
            crop,
            rule,
            span_us,
            capacity,
            window: VecDeque::new(),
            integers: vec![0; pixels],
            held: vec![0; pixels],
            values: vec![0.0; pixels],
            touched: RowSet::new(pixels),
            stale: RowSet::new(pixels),
            changed: Vec::with_capacity(pixels),
            events: [0; 2],
            outside_crop: 0,
        })
    }

    /// The same behind the filters of `rules`, which drop and count events as a network's filters
    /// do.
    ///
    /// # Errors
    /// A filter refuses the sensor.
    pub fn with_filters(self, rules: &[FilterRule]) -> Result<Self, RepresentationError> {
        Ok(Self { admission: self.admission.with_filters(rules)?, ..self })
    }

    /// The shape of every frame: (1, height, width).
    pub fn shape(&self) -> [usize; 3] {
        self.crop.shape(1)
    }

    /// Takes `event`, and removes the events that its time makes too old.
    ///
    /// An event outside the crop is accepted, advances time and counts as [`Self::outside_crop`].
    pub fn push(&mut self, event: Event) -> Outcome {
        let t = match self.admission.admit_node(event) {
            Ok(node) => node.t,
            Err(reason) => return Outcome::Dropped(reason),
        };
        self.expire();
        let Some(pixel) = self.crop.index(event.x, event.y) else {
            self.outside_crop += 1;
            return Outcome::Accepted;
        };
        if self.window.len() == self.capacity {
            self.leave();
            self.admission.counters_mut().evicted += 1;
        }
        self.enter(Member { t, pixel, on: event.on });
        Outcome::Accepted
    }

    /// Advances time to `t_us`, and removes events that are too old. Earlier times, and times
    /// before the first event, change nothing.
    pub fn advance(&mut self, t_us: i64) {
        self.admission.advance(t_us);
        self.expire();
    }

    /// The current frame. `changed` are the pixels that differ from the last frame read; `start_us`
    /// is `now - span`, or 0 without a time.
    pub fn frame(&mut self) -> EventFrame<'_> {
        self.changed.clear();
        for &pixel in self.stale.as_slice() {
            let value = self.integers[pixel as usize] as f32;
            if self.values[pixel as usize] != value {
                self.values[pixel as usize] = value;
                self.changed.push(pixel);
            }
        }
        self.stale.clear();
        EventFrame {
            shape: self.shape(),
            values: &self.values,
            start_us: self.admission.now_us().map_or(0, |now| now.saturating_sub(self.span_us)),
            events: self.events,
            touched: self.touched.as_slice(),
            changed: &self.changed,
        }
    }

    /// Forgets time and events, but keeps counters. The next frame lists changes since the last one
    /// read.
    pub fn reset(&mut self) {
        while !self.window.is_empty() {
            self.leave();
        }
        self.admission.reset();
    }

    /// Counts of the events so far, by outcome.
    pub fn counters(&self) -> &EventCounters {
        self.admission.counters()
    }

    /// Accepted events outside the crop.
    pub fn outside_crop(&self) -> u64 {
        self.outside_crop
    }

    fn expire(&mut self) {
        // Times from the epoch are at least 0, so ages cannot overflow.
        let now = self.admission.now();
        while self.window.front().is_some_and(|oldest| now - oldest.t > self.span_us) {
            self.leave();
            self.admission.counters_mut().expired += 1;
        }
    }

    fn enter(&mut self, member: Member) {
        let (pixel, sign) = (member.pixel as usize, sign(member.on));
        match self.rule {
            SignedRule::Sum => self.integers[pixel] += sign,
            SignedRule::Latest => self.integers[pixel] = sign,
        }
        self.held[pixel] += 1;
        self.touched.insert(member.pixel);
        self.stale.insert(member.pixel);
        self.events[usize::from(member.on)] += 1;
        self.window.push_back(member);
    }

    fn leave(&mut self) {
        let Some(member) = self.window.pop_front() else { return };
        let pixel = member.pixel as usize;
        self.held[pixel] -= 1;
        match self.rule {
            SignedRule::Sum => self.integers[pixel] -= sign(member.on),
            // Events leave in the order of arrival: the latest of a pixel is the last to go.
            SignedRule::Latest if self.held[pixel] == 0 => self.integers[pixel] = 0,
            SignedRule::Latest => {}
        }
        if self.held[pixel] == 0 {
            self.touched.remove(member.pixel);
        }
        self.stale.insert(member.pixel);
        self.events[usize::from(member.on)] -= 1;
    }
}
