//! The report for programs: one JSON object a line.

use std::io::{self, Write};

use serde::Serialize;

use super::report::{Reading, Report};
use super::summary::Summary;
use crate::answer::{Answer, Answers};
use meissner_pipeline::latency::microseconds;
use meissner_pipeline::provenance::Header;

/// Writes JSON lines.
pub(crate) struct JsonLines<W> {
    out: W,
    /// Whether each line is to be seen at once.
    live: bool,
}

/// Writes predictions of networks over events as JSON lines.
pub(crate) struct Predictions<W> {
    lines: JsonLines<W>,
    answers: Answers,
}

#[derive(Serialize)]
struct First<'a> {
    header: &'a Header,
}

#[derive(Serialize)]
struct Line<'a> {
    t_us: Option<i64>,
    value: Values<'a>,
    #[serde(flatten)]
    answer: Option<Answer<'a>>,
    nodes: usize,
    rows: &'a [u64],
    update_us: f64,
}

#[derive(Serialize)]
struct Last<'a> {
    summary: &'a Summary,
}

/// f32 values with the digits of the equal f64: the shortest digits of an f32 do not survive every reader that goes
/// through f64 (7.038531e-26 is one that does not), these do.
pub(crate) struct Values<'a>(pub(crate) &'a [f32]);

impl Serialize for Values<'_> {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.collect_seq(self.0.iter().map(|&value| f64::from(value)))
    }
}

impl<W: Write> JsonLines<W> {
    pub(crate) fn new(out: W, live: bool) -> Self {
        Self { out, live }
    }

    fn line(&mut self, line: &impl Serialize) -> io::Result<()> {
        serde_json::to_writer(&mut self.out, line)?;
        self.out.write_all(b"\n")
    }

    /// The first line.
    pub(crate) fn header(&mut self, header: &Header) -> io::Result<()> {
        self.prediction(&First { header })
    }

    /// The line of a prediction, or what stands before them.
    pub(crate) fn prediction(&mut self, line: &impl Serialize) -> io::Result<()> {
        self.line(line)?;
        if self.live { self.out.flush() } else { Ok(()) }
    }

    /// The last line.
    pub(crate) fn last(&mut self, line: &impl Serialize) -> io::Result<()> {
        self.line(line)?;
        self.out.flush()
    }
}

impl<W: Write> Predictions<W> {
    pub(crate) fn new(lines: JsonLines<W>, answers: Answers) -> Self {
        Self { lines, answers }
    }
}

impl<W: Write> Report for Predictions<W> {
    fn reading(&mut self, reading: &Reading<'_>) -> io::Result<()> {
        let prediction = &reading.prediction;
        self.lines.prediction(&Line {
            t_us: prediction.t_us,
            value: Values(prediction.values),
            answer: self.answers.of(prediction.values),
            nodes: prediction.nodes,
            rows: prediction.rows,
            update_us: microseconds(reading.update),
        })
    }

    fn summary(&mut self, summary: &Summary) -> io::Result<()> {
        self.lines.last(&Last { summary })
    }
}

#[cfg(test)]
mod tests {
    use super::{JsonLines, Predictions, Reading, Report};
    use crate::answer::Answers;
    use meissner_engine::Prediction;
    use std::time::Duration;

    #[test]
    fn printed_values_restore_every_bit_through_f64_and_through_f32() {
        let mut values = vec![0.0, -0.0, 0.1, 7.038_531e-26, f32::MIN_POSITIVE, f32::MAX, f32::from_bits(1)];
        values.extend((0..2000_u32).map(|i| f32::from_bits(i.wrapping_mul(2_654_435_761) & 0xbf7f_ffff)));
        let mut text = Vec::new();
        let prediction = Prediction { values: &values, t_us: None, nodes: 0, rows: &[] };
        let reading = Reading { prediction, elapsed_us: None, update: Duration::from_nanos(1500), taken: 0 };
        let lines = JsonLines::new(&mut text, false);
        Predictions::new(lines, Answers::default()).reading(&reading).expect("a vector takes everything");
        let line: serde_json::Value = serde_json::from_slice(&text).expect("the line is JSON");
        assert_eq!(line["t_us"], serde_json::Value::Null);
        assert_eq!(line["update_us"], 1.5);
        let text = String::from_utf8(text).expect("JSON is text");
        let list = text.split(['[', ']']).nth(1).expect("the values are the first list");
        for (value, digits) in values.iter().zip(list.split(',')) {
            let through = [digits.parse::<f64>().map(|v| v as f32).ok(), digits.parse::<f32>().ok()];
            assert!(
                through.iter().all(|v| v.map(f32::to_bits) == Some(value.to_bits())),
                "{value}: {digits}"
            );
        }
    }
}
