//! Streams as data: inputs, and the other calls of an engine, in order.

use meissner_engine::{Admission, Event, LatePolicy, Sensor};

/// One call of an engine.
#[derive(Clone, Debug, PartialEq)]
pub enum Step<I = Event> {
    /// An input is pushed.
    Push(I),
    /// The clock is advanced to so many microseconds. Frame networks have no clock and ignore it.
    Advance(i64),
    /// A prediction is read, and everything is compared.
    Predict,
    /// All inputs are forgotten.
    Reset,
    /// A snapshot, inputs that are to be forgotten, and the return to the snapshot.
    Snapshot,
    /// The state is written as bytes, the engine is reset, and returns to the bytes.
    Bytes,
}

impl<I> Step<I> {
    /// The input that is pushed.
    pub fn input(&self) -> Option<&I> {
        if let Self::Push(input) = self { Some(input) } else { None }
    }

    /// Whether everything is compared after the step.
    pub fn is_compared(&self) -> bool {
        !matches!(self, Self::Push(_) | Self::Advance(_))
    }
}

/// A stream with the sensor and the capacity of the window that it runs on.
#[derive(Clone, Debug, PartialEq)]
pub struct Stream<I = Event> {
    /// The sensor; `None` for frames.
    pub sensor: Option<Sensor>,
    /// Maximum number of events in the window, instead of the network's.
    pub capacity: Option<usize>,
    /// The steps.
    pub steps: Vec<Step<I>>,
}

/// Default number of comparisons, spread over a recording.
const COMPARISONS: usize = 64;

impl<I> Stream<I> {
    /// A recording, compared after every `every` inputs; `None` spreads 64 comparisons over it.
    pub fn of_recording(sensor: Option<Sensor>, inputs: Vec<I>, every: Option<usize>) -> Self {
        let every = every.unwrap_or(inputs.len().div_ceil(COMPARISONS)).max(1);
        let mut steps = Vec::with_capacity(inputs.len() + inputs.len() / every);
        for (i, input) in inputs.into_iter().enumerate() {
            steps.push(Step::Push(input));
            if (i + 1) % every == 0 {
                steps.push(Step::Predict);
            }
        }
        Self { sensor, capacity: None, steps }
    }
}

/// A sensor and a stream for it.
#[derive(Clone, Debug)]
pub struct Script {
    /// The sensor.
    pub sensor: Sensor,
    /// The start of time.
    pub origin_us: i64,
    /// The stream.
    pub steps: Vec<Step>,
}

impl Script {
    /// A stream from `steps` whose times count from the newest event or advance before them; an
    /// event with a negative time is late. A few pixels lie outside the sensor.
    pub fn new(sensor: Sensor, origin_us: i64, mut steps: Vec<Step>) -> Self {
        let pixel = |p: u16, extent: u16| (u32::from(p) % (u32::from(extent) * 33 / 32 + 1)) as u16;
        let (mut admission, mut clock) = (Admission::new(sensor, LatePolicy::Drop), origin_us);
        for step in &mut steps {
            match step {
                Step::Push(Event { t_us, x, y, on }) => {
                    let event =
                        Event::new(clock + *t_us, pixel(*x, sensor.width), pixel(*y, sensor.height), *on);
                    if admission.admit(event).is_ok() {
                        clock = event.t_us;
                    }
                    *step = Step::Push(event);
                }
                Step::Advance(t_us) => {
                    *t_us += clock;
                    admission.advance(*t_us);
                    clock = admission.now_us().unwrap_or(clock);
                }
                Step::Reset => admission.reset(),
                Step::Predict | Step::Snapshot | Step::Bytes => {}
            }
        }
        Self { sensor, origin_us, steps }
    }
}
