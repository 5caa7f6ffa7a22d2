//! Time surfaces: how long ago each pixel saw each polarity (Lagorce et al. 2017, HOTS, Eq. 3).
//!
//! Input: events, and time. Output, on demand: a frame (2, height, width), channel 0 negative
//! (OFF), 1 positive (ON), with value(p, y, x) = decay(now - latest(p, y, x)), 0 without an event.
//! Ages are integers, rounded to f32 once. Tonic's `ToTimesurface` reads one every `dt`: push the
//! events before, `advance`, read. Invariant: a value outside `active` is 0 until its next event,
//! as ages only grow.

use meissner_kernels::exp;

use crate::admission::Admission;
use crate::representations::{Crop, RepresentationError};
use crate::rows::RowSet;
use crate::{Event, EventCounters, LatePolicy, Outcome, Sensor};

/// How a value decays with the age of its event.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Decay {
    /// exp(-age / tau).
    Exponential {
        /// The time constant in microseconds.
        tau_us: f32,
    },
    /// max(0, 1 - age / span).
    Linear {
        /// The age in microseconds at which the value reaches 0.
        span_us: f32,
    },
}

impl Decay {
    /// The value of an event after `age_us` microseconds, from 1 down to 0; a quotient in f32.
    #[inline]
    pub fn value(self, age_us: i64) -> f32 {
        match self {
            Self::Exponential { tau_us } => exp(-(age_us as f32 / tau_us)),
            Self::Linear { span_us } => (1.0 - age_us as f32 / span_us).max(0.0),
        }
    }
}

/// A time surface at one moment.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Surface<'a> {
    /// Channels, rows, columns.
    pub shape: [usize; 3],
    /// Values from 0 to 1, row-major.
    pub values: &'a [f32],
    /// Indices of the values that are not 0, in no particular order.
    pub active: &'a [u32],
    /// The time, on the events' own clock, in microseconds; `None` if there is no time yet.
    pub at_us: Option<i64>,
}

/// The times of the latest event by pixel and polarity.
///
/// A push costs O(1), a surface O(values that were not 0 before or have new events); nothing is
/// allocated later. In f32 an exponential is 0 after 104 time constants.
#[derive(Clone, Debug)]
pub struct TimeSurface {
    admission: Admission,
    crop: Crop,
    decay: Decay,
    /// Microseconds since the epoch, for active values.
    last: Vec<i64>,
    values: Vec<f32>,
    active: RowSet,
    outside_crop: u64,
}

impl TimeSurface {
    /// A surface that has not seen an event.
    ///
    /// # Errors
    /// A crop outside `sensor`, a time constant or span that is not finite and above 0.
    pub fn new(sensor: Sensor, crop: Crop, decay: Decay) -> Result<Self, RepresentationError> {
        crop.check(sensor, 2)?;
        let (Decay::Exponential { tau_us: scale } | Decay::Linear { span_us: scale }) = decay;
        if !scale.is_finite() || scale <= 0.0 {
            return Err(RepresentationError::option("decay", "a finite number of us above 0", scale));
        }
        let values = 2 * crop.pixels();
        Ok(Self {
            admission: Admission::new(sensor, LatePolicy::Drop),
            crop,
            decay,
            last: vec![0; values],
            values: vec![0.0; values],
            active: RowSet::new(values),
            outside_crop: 0,
        })
    }

    /// The shape of every surface: (2, height, width).
    pub fn shape(&self) -> [usize; 3] {
        self.crop.shape(2)
    }

    /// Records the time of `event`.
    ///
    /// An event outside the crop is accepted, advances time and counts as [`Self::outside_crop`].
    pub fn push(&mut self, event: Event) -> Outcome {
        let t = match self.admission.admit_node(event) {
            Ok(node) => node.t,
            Err(reason) => return Outcome::Dropped(reason),
        };
        if let Some(pixel) = self.crop.index(event.x, event.y) {
            let value = u32::from(event.on) * self.crop.pixels() as u32 + pixel;
            self.last[value as usize] = t;
            self.active.insert(value);
        } else {
            self.outside_crop += 1;
        }
        Outcome::Accepted
    }

    /// Advances time to `t_us`. Earlier times, and any time before the first event, change nothing.
    pub fn advance(&mut self, t_us: i64) {
        self.admission.advance(t_us);
    }

    /// The surface at the time of the newest event, or a later `advance`.
    pub fn surface(&mut self) -> Surface<'_> {
        let now = self.admission.now();
        // Backwards: the row that replaces a removed one has been visited.
        for at in (0..self.active.len()).rev() {
            let index = self.active.as_slice()[at];
            let value = self.decay.value(now - self.last[index as usize]);
            self.values[index as usize] = value;
            if value == 0.0 {
                self.active.remove(index);
            }
        }
        Surface {
            shape: self.shape(),
            values: &self.values,
            active: self.active.as_slice(),
            at_us: self.admission.now_us(),
        }
    }

    /// Forgets time and all events. Counters are kept.
    pub fn reset(&mut self) {
        for &index in self.active.as_slice() {
            self.values[index as usize] = 0.0;
        }
        self.active.clear();
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
}
