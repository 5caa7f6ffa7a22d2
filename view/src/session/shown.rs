//! The frame of a session: the data of its engine, and of the session itself.

use super::{Course, Session};
use crate::facts::{Facts, Info, TruthFacts};
use crate::frame::FrameWriter;
use crate::subject::Subject;

impl<S: Subject> Session<S> {
    /// Counts changes of [`Self::facts`]: after a change, a page needs them again.
    pub fn facts_version(&self) -> u64 {
        self.facts
    }

    /// A frame with the section FACT alone, for a page that has opened and after a change.
    pub fn facts(&self) -> Vec<u8> {
        let mut to = FrameWriter::new();
        to.json(*b"FACT", &self.describe());
        to.finish()
    }

    fn describe(&self) -> Facts {
        Facts {
            version: self.facts,
            live: self.live,
            controls: true,
            networks: self.networks.names(),
            truth: self.truths(),
            ..S::facts(&self.name, &self.sensor, &self.network, &self.chosen)
        }
    }

    fn truths(&self) -> Vec<TruthFacts> {
        let first_us = self.history.absolute_us(0.0);
        let columns = self.truth.columns(&self.chosen.outputs, &self.chosen.units);
        let known = columns.into_iter().enumerate().filter_map(|(output, column)| Some((output, column?)));
        let point = |column: usize, (t_us, values): &(i64, Vec<f64>)| {
            let value = values.get(column).copied().filter(|value| value.is_finite());
            (t_us.saturating_sub(first_us) as f64 / 1e3, value)
        };
        let of = |(output, column)| TruthFacts {
            output,
            points: self.truth.rows.iter().map(|row| point(column, row)).collect(),
        };
        known.map(of).collect()
    }

    fn info(&self) -> Info {
        Info {
            queue: self.queue,
            forgotten: self.history.forgotten,
            comparing: self.comparison.is_on(),
            compared: self.comparison.newest.clone(),
            error: self.error.clone(),
            ..self.subject.info()
        }
    }

    /// The frame of this moment.
    pub(super) fn frame(&self) -> Vec<u8> {
        let (history, outputs) = (&self.history, self.chosen.outputs.len());
        let now_us = history.time_of(history.cursor);
        let at_end = history.cursor == history.len();
        let flags = [self.playing, at_end, self.live, self.course == Course::Asked];
        let flags = (0..).zip(flags).map(|(bit, set)| u32::from(set) << bit).sum();
        let mut to = FrameWriter::new();
        to.section(*b"TIME", |to| {
            to.f64(now_us);
            to.f64(history.end_us() as f64);
            to.f64(history.cursor as f64);
            to.f64(history.len() as f64);
            to.f32(self.speed as f32);
            to.u32(flags);
        });
        self.subject.write(history.taken(), &mut to);
        let truths = self.truth.columns(&self.chosen.outputs, &self.chosen.units);
        let truth = truths.iter().map(|column| {
            column.map_or(f32::NAN, |column| self.truth.at(column, history.absolute_us(now_us)) as f32)
        });
        to.section(*b"PRED", |to| {
            to.count(outputs);
            to.count(self.subject.nodes());
            to.f32(self.unlike.unwrap_or(f32::NAN));
            to.f32(self.took_us.map_or(f32::NAN, |us| us as f32));
            (0..outputs).for_each(|i| to.f32(self.prediction.get(i).copied().unwrap_or(f32::NAN)));
            truth.chain(std::iter::repeat(f32::NAN)).take(outputs).for_each(|value| to.f32(value));
        });
        to.section(*b"SERS", |to| self.series.write(outputs, to));
        to.section(*b"LATE", |to| self.latency.write(to));
        to.section(*b"WORK", |to| self.subject.work(to));
        to.json(*b"INFO", &self.info());
        to.finish()
    }
}
