//! A stream as text, so that a mismatch can be kept, sent and replayed.
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
//! Other comments are ignored. The text of a stream of events is also a recording that every
//! command reads.

use meissner_engine::{Event, Sensor};

use crate::error::VerifyError;
use crate::stream::{Step, Stream};

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

/// Capacity and steps of `text`; `expected` describes the form of its inputs.
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
