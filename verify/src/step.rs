//! Streams as data: inputs, and the other calls of an engine, in order.

use meissner_engine::{Admission, Event, LatePolicy, Sensor};

/// One call of an engine.
#[derive(Clone, Debug, PartialEq)]
pub enum Step<I = Event> {
    /// An input is pushed.
    Push(I),
    /// Time is moved on to so many microseconds. Frame networks have no time and pass over it.
    Advance(i64),
    /// A prediction is read, and everything is compared.
    Predict,
    /// All inputs are forgotten.
    Reset,
    /// A snapshot is taken, inputs follow that are to be forgotten, and the engine returns to the snapshot.
    Snapshot,
    /// The state is written as bytes, the engine is reset, and returns to the bytes.
    Bytes,
}

impl<I> Step<I> {
    /// The input that is pushed.
    pub fn input(&self) -> Option<&I> {
        if let Self::Push(input) = self { Some(input) } else { None }
    }
}

/// A stream with the sensor and the capacity of the window that it runs on.
#[derive(Clone, Debug, PartialEq)]
pub struct Stream<I = Event> {
    /// The sensor; `None` for frames.
    pub sensor: Option<Sensor>,
    /// Most events in the window, in place of the network's.
    pub capacity: Option<usize>,
    /// The steps.
    pub steps: Vec<Step<I>>,
}

/// A step whose time counts from the one before, as random streams are drawn.
#[derive(Clone, Debug)]
pub enum Relative {
    /// An event `dt` after the newest (negative: late), at a pixel.
    Push {
        /// Microseconds since the newest event or `advance`.
        dt: i64,
        /// Column, taken modulo a little more than the sensor's width.
        x: u16,
        /// Row.
        y: u16,
        /// Polarity.
        on: bool,
    },
    /// Time moves on.
    Advance {
        /// Microseconds.
        dt: i64,
    },
    /// A prediction is read.
    Predict,
    /// Everything is forgotten.
    Reset,
    /// A snapshot is taken and returned to.
    Snapshot,
}

/// A sensor and a stream for it.
#[derive(Clone, Debug)]
pub struct Script {
    /// The sensor.
    pub sensor: Sensor,
    /// Where time starts.
    pub origin_us: i64,
    /// The stream.
    pub steps: Vec<Step>,
}

impl Script {
    /// `steps` with absolute times. A few pixels lie outside the sensor.
    pub fn new(sensor: Sensor, origin_us: i64, steps: &[Relative]) -> Self {
        let pixel = |p: u16, extent: u16| (u32::from(p) % (u32::from(extent) * 33 / 32 + 1)) as u16;
        let (mut admission, mut clock) = (Admission::new(sensor, LatePolicy::Drop), origin_us);
        let absolute = |step: &Relative| match *step {
            Relative::Push { dt, x, y, on } => {
                let event = Event::new(clock + dt, pixel(x, sensor.width), pixel(y, sensor.height), on);
                if admission.admit(event).is_ok() {
                    clock = event.t_us;
                }
                Step::Push(event)
            }
            Relative::Advance { dt } => {
                let t_us = clock + dt;
                admission.advance(t_us);
                clock = admission.now_us().unwrap_or(clock);
                Step::Advance(t_us)
            }
            Relative::Predict => Step::Predict,
            Relative::Reset => {
                admission.reset();
                Step::Reset
            }
            Relative::Snapshot => Step::Snapshot,
        };
        Self { sensor, origin_us, steps: steps.iter().map(absolute).collect() }
    }
}
