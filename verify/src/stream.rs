//! Streams as data: inputs, and the other calls of an engine, in order. Their text:
//!
//! ```text
//! # sensor 8x8                 (events alone)
//! # values 400                 (frames alone: values of a frame)
//! # capacity 30                (most events in the window, if it is not the network's)
//! t,x,y,p                      (events alone)
//! 0,1,1,1                      (an event: microseconds, column, row, polarity)
//! frame 3=0.5 7=1              (a frame: its values that are not 0)
//! # predict                    (everything is compared here)
//! # advance 120                (microseconds)
//! # reset
//! # snapshot                   (a snapshot, five events or a frame of ones, and the return to it)
//! # bytes                      (the state as bytes, which a reset engine reads)
//! ```
//!
//! Other comments are ignored. A stream of events is also a recording that every command reads.
use meissner_engine::{Admission, Event, LatePolicy, Sensor};

use crate::error::VerifyError;

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
    /// Most events in the window, instead of the network's.
    pub capacity: Option<usize>,
    /// The steps.
    pub steps: Vec<Step<I>>,
}

/// Comparisons that are spread over a recording unless the caller says otherwise.
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
    /// Where time starts.
    pub origin_us: i64,
    /// The stream.
    pub steps: Vec<Step>,
}

impl Script {
    /// A stream from `steps` whose times count from the newest event or advance before them; an
    /// event of negative time is late. A few pixels lie outside the sensor.
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

impl Stream<Event> {
    /// The stream as text, after `remarks`, a comment line each.
    pub fn to_text(&self, remarks: &str) -> String {
        let header = self.sensor.map(|sensor| format!("# sensor {sensor}\n")).unwrap_or_default();
        text(self, remarks, &header, "t,x,y,p\n", |Event { t_us, x, y, on }| {
            format!("{t_us},{x},{y},{}", u8::from(*on))
        })
    }

    /// Reads [`Self::to_text`].
    ///
    /// # Errors
    /// [`VerifyError::Line`] for a line of another form, or if the sensor is missing.
    pub fn parse(text: &str) -> Result<Self, VerifyError> {
        let mut sensor = None;
        let comment = |comment: &str| {
            let sides = comment.strip_prefix("sensor ").and_then(|sides| sides.split_once('x'));
            if let Some((Ok(width), Ok(height))) = sides.map(|(w, h)| (w.parse::<u16>(), h.parse::<u16>())) {
                sensor = Some(Sensor::new(width, height));
            }
        };
        let (capacity, steps) = parse(text, "an event t,x,y,p", comment, |line, out| {
            if line == "t,x,y,p" {
                return Some(());
            }
            let [t_us, x, y, p @ ("0" | "1")] = line.split(',').collect::<Vec<_>>()[..] else { return None };
            out.push(Step::Push(Event::new(t_us.parse().ok()?, x.parse().ok()?, y.parse().ok()?, p == "1")));
            Some(())
        })?;
        if sensor.is_none() {
            return Err(refuse(0, "a line `# sensor WxH`", ""));
        }
        Ok(Self { sensor, capacity, steps })
    }
}

impl Stream<Vec<f32>> {
    /// The stream as text, after `remarks`, a comment line each.
    pub fn to_text(&self, remarks: &str) -> String {
        let values = self.steps.iter().find_map(Step::input).map(Vec::len);
        text(self, remarks, &format!("# values {}\n", values.unwrap_or(0)), "", |frame| {
            let set = frame.iter().enumerate().filter(|(_, v)| v.to_bits() != 0);
            set.fold("frame".to_owned(), |line, (i, value)| format!("{line} {i}={value}"))
        })
    }

    /// Reads [`Self::to_text`], of frames of `values` values.
    ///
    /// # Errors
    /// [`VerifyError::Line`] for a line of another form.
    pub fn parse(text: &str, values: usize) -> Result<Self, VerifyError> {
        let (capacity, steps) = parse(
            text,
            "a frame",
            |_| {},
            |line, out| {
                let mut frame = vec![0.0; values];
                for word in line.strip_prefix("frame")?.split_whitespace() {
                    let (at, value) = word.split_once('=')?;
                    *frame.get_mut(at.parse::<usize>().ok()?)? = value.parse().ok()?;
                }
                out.push(Step::Push(frame));
                Some(())
            },
        )?;
        Ok(Self { sensor: None, capacity, steps })
    }
}

fn text<I>(
    stream: &Stream<I>,
    remarks: &str,
    header: &str,
    columns: &str,
    input: impl Fn(&I) -> String,
) -> String {
    let mut out = header.to_owned();
    out.extend(remarks.lines().map(|remark| format!("# {remark}\n")));
    out.extend(stream.capacity.map(|capacity| format!("# capacity {capacity}\n")));
    out += columns;
    out.extend(stream.steps.iter().map(|step| {
        let line = match step {
            Step::Push(value) => input(value),
            Step::Advance(t_us) => format!("# advance {t_us}"),
            Step::Predict => "# predict".to_owned(),
            Step::Reset => "# reset".to_owned(),
            Step::Snapshot => "# snapshot".to_owned(),
            Step::Bytes => "# bytes".to_owned(),
        };
        line + "\n"
    }));
    out
}

/// Capacity and steps of `text`, whose inputs stand as `expected` says.
fn parse<I>(
    text: &str,
    expected: &'static str,
    mut comment: impl FnMut(&str),
    mut input: impl FnMut(&str, &mut Vec<Step<I>>) -> Option<()>,
) -> Result<(Option<usize>, Vec<Step<I>>), VerifyError> {
    let (mut capacity, mut steps) = (None, Vec::new());
    for (i, line) in text.lines().map(str::trim).enumerate().filter(|(_, line)| !line.is_empty()) {
        let Some(words) = line.strip_prefix('#').map(str::trim) else {
            input(line, &mut steps).ok_or_else(|| refuse(i + 1, expected, line))?;
            continue;
        };
        match words.split_once(' ').unwrap_or((words, "")) {
            ("capacity", number) => {
                capacity = Some(number.parse().map_err(|_| refuse(i + 1, "a number of events", line))?);
            }
            ("advance", time) => {
                let t_us = time.parse().map_err(|_| refuse(i + 1, "a time in microseconds", line))?;
                steps.push(Step::Advance(t_us));
            }
            ("predict", "") => steps.push(Step::Predict),
            ("reset", "") => steps.push(Step::Reset),
            ("snapshot", "") => steps.push(Step::Snapshot),
            ("bytes", "") => steps.push(Step::Bytes),
            _ => comment(words),
        }
    }
    Ok((capacity, steps))
}

fn refuse(line: usize, expected: &'static str, found: &str) -> VerifyError {
    VerifyError::Line { line, expected, found: found.chars().take(60).collect() }
}
