//! A log of a run in MCAP, for viewers such as Foxglove and Lichtblick, and to be read again.
//!
//! Input: the events that a run takes, and its predictions. Output: a file that is readable at any
//! time, up to a second before that time. Times are those of the stream.
//!
//! | topic | type | messages |
//! |---|---|---|
//! | `/events` | `event_camera_msgs/msg/EventPacket` | the events, exactly |
//! | `/events/image` | `foxglove.CompressedImage` | 30 pictures a second: rises red, falls blue |
//! | `/prediction` | `meissner.Prediction` | a number for each output (`roll_rad`); the class |
//! | `/latency` | `meissner.Latency` | time spent, and its quantiles so far, in microseconds |
//! | `/truth` | `meissner.Truth` | where the truth is known: its numbers, named as the outputs |
//!
//! If there are several inputs, the topics of each begin with `/input0`, `/input1` and so on. If
//! the file cannot be written any more, the run continues without it, and the error is reported at
//! the end.

use std::fs::{File, OpenOptions};
use std::io::{self, BufWriter};
use std::path::{Path, PathBuf};
use std::sync::mpsc::{self, RecvTimeoutError};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::Duration;

use base64::Engine;
use base64::prelude::BASE64_STANDARD;
use meissner_engine::{Event, Sensor};
use meissner_io::{McapWriter, encode_palette_png};
use serde_json::{Map, Value, json};

use crate::answer::{Answer, Values};
use crate::error::{Result, RunError};
use crate::latency::{Latency, Quantiles};
use crate::press;
use crate::provenance::ModelCard;
use crate::run::{Observer, Prediction};
use crate::training::Output;

/// Stream time of a picture of events, in microseconds.
const PICTURE_US: i64 = 33_333;
/// Colours of a pixel without events, with a rise and with a fall as its newest event.
const COLOURS: [[u8; 3]; 4] = [[0, 0, 0], [255, 64, 64], [64, 128, 255], [255, 255, 255]];
/// Number of events that are written together.
const PACKET: usize = 4096;
/// Time after which all events so far can be read, also in a silence.
const FLUSH: Duration = Duration::from_millis(500);
/// Number of predictions after which the quantiles of latencies are computed again.
const QUANTILES: u64 = 64;

/// The log of a run.
pub struct McapLog {
    path: PathBuf,
    /// `None` after an error.
    writer: Option<McapWriter<BufWriter<File>>>,
    error: Option<io::Error>,
    inputs: Vec<Input>,
    outputs: Vec<Output>,
    classes: Vec<String>,
}

/// The logged data of an input.
struct Input {
    sensor: Sensor,
    events: u16,
    image: u16,
    prediction: u16,
    latency: u16,
    /// The channel of the truth, and its values that are not due yet.
    truth: Option<(u16, std::vec::IntoIter<press::Truth>)>,
    /// Events that are not written yet.
    waiting: Vec<Event>,
    picture: Picture,
    spent: Latency,
    quantiles: Option<Quantiles>,
    count: u64,
}

/// The events of a thirtieth of a second.
#[derive(Default)]
struct Picture {
    /// Number of the picture; `None`: no event yet.
    number: Option<i64>,
    /// One byte per pixel.
    pixels: Vec<u8>,
}

/// Calls `run` with `observer`, and also logs its predictions if there is a `log`.
///
/// # Errors
/// The file could not be written; the result of `run` is returned in any case.
pub fn observe<T>(
    log: Option<McapLog>,
    observer: &mut dyn Observer,
    run: impl FnOnce(&mut dyn Observer) -> T,
) -> (T, Result<()>) {
    let Some(log) = log else { return (run(observer), Ok(())) };
    let log = Mutex::new(log);
    let (ended, end) = mpsc::channel::<()>();
    let shared = &log;
    let result = thread::scope(|scope| {
        // In a silence of a stream, no other code would write the events before it.
        scope.spawn(move || {
            while end.recv_timeout(FLUSH) == Err(RecvTimeoutError::Timeout) {
                held(shared).flush();
            }
        });
        // It is dropped, and the thread above ends, even if the run panics.
        let _ended = ended;
        run(&mut Logged { log: shared, observer })
    });
    (result, log.into_inner().unwrap_or_else(PoisonError::into_inner).finish())
}

/// The log. A panic while it was held does not change it.
fn held(log: &Mutex<McapLog>) -> MutexGuard<'_, McapLog> {
    log.lock().unwrap_or_else(PoisonError::into_inner)
}

impl McapLog {
    /// Begins the file at `path`, which is replaced, for a run of the network of `card` over inputs
    /// with these `sensors`. With `is_press`, they are the embedded press, whose truth is known.
    ///
    /// # Errors
    /// The file cannot be written.
    pub fn create(path: &Path, card: &ModelCard, sensors: &[Sensor], is_press: bool) -> Result<Self> {
        let fail = |source| RunError::file("write", path, source);
        let file = OpenOptions::new().write(true).create(true).truncate(true).open(path).map_err(fail)?;
        let mut writer = McapWriter::new(BufWriter::new(file)).map_err(fail)?;
        let several = sensors.len() > 1;
        let input = |(number, &sensor): (usize, &Sensor)| -> io::Result<Input> {
            let topic = |name: &str| if several { format!("/input{number}{name}") } else { name.to_owned() };
            let writer = &mut writer;
            let events = writer.event_channel(&topic("/events"))?;
            let image = schema(
                "foxglove.CompressedImage",
                &[
                    ("timestamp", &time_schema()),
                    ("frame_id", &json!({"type": "string"})),
                    ("data", &json!({"type": "string", "contentEncoding": "base64"})),
                    ("format", &json!({"type": "string"})),
                ],
            );
            let image = writer.json_channel(&topic("/events/image"), "foxglove.CompressedImage", &image)?;
            let number = json!({"type": "number"});
            let keys: Vec<String> = card.outputs.iter().map(key).collect();
            let mut properties: Vec<(&str, &Value)> = keys.iter().map(|key| (&**key, &number)).collect();
            let (class, probability) = (json!({"type": "string"}), json!({"type": "object"}));
            if card.classes.is_some() {
                properties.extend([("class", &class), ("probability", &probability)]);
            }
            let prediction = schema("meissner.Prediction", &properties);
            let prediction =
                writer.json_channel(&topic("/prediction"), "meissner.Prediction", &prediction)?;
            let times = ["update_us", "age_us", "waited_us", "p50_us", "p99_us"].map(|key| (key, &number));
            let latency = schema("meissner.Latency", &times);
            let latency = writer.json_channel(&topic("/latency"), "meissner.Latency", &latency)?;
            let truth = is_press.then(|| {
                let names = press::TRUTH_NAMES.map(|name| (name, &number));
                let truth = schema("meissner.Truth", &names);
                let channel = writer.json_channel(&topic("/truth"), "meissner.Truth", &truth)?;
                Ok::<_, io::Error>((channel, press::truth().into_iter()))
            });
            Ok(Input {
                sensor,
                events,
                image,
                prediction,
                latency,
                truth: truth.transpose()?,
                waiting: Vec::with_capacity(PACKET),
                picture: Picture { number: None, pixels: vec![0; pixels(sensor)] },
                spent: Latency::new(),
                quantiles: None,
                count: 0,
            })
        };
        let inputs = sensors.iter().enumerate().map(input).collect::<io::Result<_>>().map_err(fail)?;
        Ok(Self {
            path: path.to_owned(),
            writer: Some(writer),
            error: None,
            inputs,
            outputs: card.outputs.clone(),
            classes: card.classes.clone().unwrap_or_default(),
        })
    }

    /// Writes the waiting events, and the end of the file.
    fn finish(mut self) -> Result<()> {
        for input in 0..self.inputs.len() {
            self.write(|log, writer| {
                let input = &mut log[input];
                input.packet(writer)?;
                input.draw(writer)
            });
        }
        if let Some(writer) = self.writer.take() {
            self.error = writer.finish().err();
        }
        self.error.map_or(Ok(()), |source| Err(RunError::file("write", &self.path, source)))
    }

    /// Writes, unless a write has failed before.
    fn write(
        &mut self,
        write: impl FnOnce(&mut [Input], &mut McapWriter<BufWriter<File>>) -> io::Result<()>,
    ) {
        let Some(writer) = &mut self.writer else { return };
        if let Err(error) = write(&mut self.inputs, writer) {
            tracing::warn!("{}: {error}: the log ends here", self.path.display());
            (self.writer, self.error) = (None, Some(error));
        }
    }

    /// Makes the data so far readable.
    fn flush(&mut self) {
        self.write(|inputs, writer| {
            inputs.iter_mut().try_for_each(|input| input.packet(writer))?;
            writer.flush()
        });
    }

    fn event(&mut self, input: usize, event: Event) {
        let log = &mut self.inputs[input];
        let number = event.t_us.div_euclid(PICTURE_US);
        let is_next = log.picture.number != Some(number);
        if is_next || log.waiting.len() >= PACKET {
            self.write(|inputs, writer| {
                let log = &mut inputs[input];
                log.packet(writer)?;
                if is_next { log.next_picture(writer, number) } else { Ok(()) }
            });
        }
        let log = &mut self.inputs[input];
        log.waiting.push(event);
        if log.sensor.contains(event.x, event.y) {
            let place = usize::from(event.y) * usize::from(log.sensor.width) + usize::from(event.x);
            log.picture.pixels[place] = if event.on { 1 } else { 2 };
        }
    }

    fn prediction(&mut self, prediction: &Prediction<'_>) {
        let (input, at_us, values, answer, spent) = match prediction {
            Prediction::Events(found) => {
                (0, found.at_us, found.value, found.answer, vec![("update_us", found.update_us)])
            }
            Prediction::Frames(found) => {
                (0, Some(found.t_us), found.value, found.answer, vec![("update_us", found.update_us)])
            }
            Prediction::Report(found) => {
                let spent = vec![("waited_us", found.waited_us), ("age_us", found.age_us)];
                (found.input, Some(found.at_us), found.value, found.answer, spent)
            }
            Prediction::Electrodes(_) | Prediction::Picture(_) => return,
        };
        let Some(at_us) = at_us else { return };
        let message = self.message(values, answer);
        self.write(|inputs, writer| {
            let log = &mut inputs[input];
            writer.message(log.prediction, at_us, &message)?;
            log.spend(writer, at_us, &spent)
        });
    }

    /// The message of a prediction.
    fn message(&self, values: Values<'_>, answer: Option<Answer<'_>>) -> Vec<u8> {
        let numbers = self.outputs.iter().zip(values.0);
        let mut message: Map<String, Value> =
            numbers.map(|(output, &value)| (key(output), f64::from(value).into())).collect();
        if let Some(answer) = answer {
            let each = self.classes.iter().zip(answer.probabilities.0);
            let each: Map<String, Value> =
                each.map(|(name, &value)| (name.clone(), f64::from(value).into())).collect();
            message.insert("class".to_owned(), answer.class.into());
            message.insert("probability".to_owned(), each.into());
        }
        Value::Object(message).to_string().into_bytes()
    }
}

impl Input {
    /// Writes the waiting events.
    fn packet(&mut self, writer: &mut McapWriter<BufWriter<File>>) -> io::Result<()> {
        let Some(last) = self.waiting.last() else { return Ok(()) };
        if let Some((channel, rows)) = &mut self.truth {
            while let Some(row) = rows.as_slice().first().filter(|row| row.0 <= last.t_us) {
                let message: Map<String, Value> = press::TRUTH_NAMES
                    .iter()
                    .zip(row.1)
                    .map(|(&name, value)| (name.to_owned(), value.into()))
                    .collect();
                writer.message(*channel, row.0, Value::Object(message).to_string().as_bytes())?;
                rows.next();
            }
        }
        let result = writer.events(self.events, self.sensor, &self.waiting);
        self.waiting.clear();
        result
    }

    /// Writes the picture that is complete, and begins number `next`.
    fn next_picture(&mut self, writer: &mut McapWriter<BufWriter<File>>, next: i64) -> io::Result<()> {
        self.draw(writer)?;
        self.picture.pixels.fill(0);
        // A silence begins with an empty picture, so that viewers do not show an old one.
        if let Some(number) = self.picture.number.replace(next)
            && next > number + 1
        {
            self.picture.number = Some(number + 1);
            self.draw(writer)?;
            self.picture.number = Some(next);
        }
        Ok(())
    }

    /// Writes the picture, if there is one, at the time of its end.
    fn draw(&self, writer: &mut McapWriter<BufWriter<File>>) -> io::Result<()> {
        let Some(number) = self.picture.number else { return Ok(()) };
        let (width, height) = (self.sensor.width.into(), self.sensor.height.into());
        let png =
            encode_palette_png(width, height, COLOURS, &self.picture.pixels).map_err(io::Error::other)?;
        let t_us = number.saturating_add(1).saturating_mul(PICTURE_US).max(0);
        let timestamp = json!({"sec": t_us / 1_000_000, "nsec": t_us % 1_000_000 * 1000});
        let data = BASE64_STANDARD.encode(png);
        let message = json!({"timestamp": timestamp, "frame_id": "sensor", "data": data, "format": "png"});
        writer.message(self.image, t_us, message.to_string().as_bytes())
    }

    /// Writes the times that a prediction took. The first time has quantiles.
    fn spend(
        &mut self,
        writer: &mut McapWriter<BufWriter<File>>,
        at_us: i64,
        spent: &[(&str, f64)],
    ) -> io::Result<()> {
        if let Some((_, us)) = spent.first() {
            self.spent.record(Duration::from_nanos((us * 1e3) as u64));
        }
        if self.count.is_multiple_of(QUANTILES) {
            self.quantiles = self.spent.quantiles();
        }
        self.count += 1;
        let mut message: Map<String, Value> =
            spent.iter().map(|&(name, us)| (name.to_owned(), us.into())).collect();
        if let Some(Quantiles { p50, p99, .. }) = self.quantiles {
            message.insert("p50_us".to_owned(), p50.into());
            message.insert("p99_us".to_owned(), p99.into());
        }
        writer.message(self.latency, at_us, Value::Object(message).to_string().as_bytes())
    }
}

/// Logs the calls of an observer.
struct Logged<'a> {
    log: &'a Mutex<McapLog>,
    observer: &'a mut dyn Observer,
}

impl Observer for Logged<'_> {
    fn prediction(&mut self, prediction: &Prediction<'_>) -> io::Result<()> {
        // A failed log does not suppress a prediction.
        let shown = self.observer.prediction(prediction);
        held(self.log).prediction(prediction);
        shown
    }

    fn progress(&mut self, taken: u64) {
        self.observer.progress(taken);
    }

    fn event(&mut self, input: usize, event: Event) {
        held(self.log).event(input, event);
    }

    fn takes_events(&self) -> bool {
        true
    }
}

fn pixels(sensor: Sensor) -> usize {
    usize::from(sensor.width) * usize::from(sensor.height)
}

/// The key of an output: its name and its unit. Viewers use it as a path.
fn key(output: &Output) -> String {
    let unit = if output.unit.is_empty() { "" } else { "_" };
    let key = format!("{}{unit}{}", output.name, output.unit);
    key.replace(|c: char| !c.is_ascii_alphanumeric(), "_")
}

fn time_schema() -> Value {
    let integer = json!({"type": "integer"});
    json!({"type": "object", "title": "time", "properties": {"sec": integer, "nsec": integer}})
}

/// The JSON Schema of the type `title`.
fn schema(title: &str, properties: &[(&str, &Value)]) -> String {
    let properties: Map<String, Value> =
        properties.iter().map(|&(name, schema)| (name.to_owned(), schema.clone())).collect();
    json!({"title": title, "type": "object", "properties": properties}).to_string()
}
