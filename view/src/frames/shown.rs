//! The data of an engine over frames in a frame of the page.

use super::{Content, Frame, Frames, Kind};
use crate::frame::{Bytes, FrameWriter};

/// Number of shown readings, each of 10 ms.
const READINGS: usize = 200;

impl Frames {
    /// The sections LAYR and DIFF, and PICT and FORC, ELEC, or SPAR.
    pub(super) fn show(&self, items: &[Frame], to: &mut FrameWriter) {
        let since = self.engine.counters().since(&self.before);
        to.section(*b"LAYR", |to| {
            to.count(since.layers.len());
            for layer in &since.layers {
                for count in [layer.computed, layer.skipped, layer.absorbed] {
                    to.count(count as usize);
                }
            }
        });
        let Some(newest) = items.last() else { return };
        if let Some([columns, rows]) = self.size() {
            to.section(*b"DIFF", |to| {
                to.count(columns);
                to.count(rows);
                bits(&self.changed, to);
            });
        }
        match (&self.kind, &newest.content) {
            (Kind::Pictures(of), Content::Picture(rgb)) => {
                let [columns, rows] = self.size().unwrap_or_default();
                to.section(*b"PICT", |to| {
                    to.count(columns);
                    to.count(rows);
                    to.bytes(rgb);
                });
                let Some(contact) = of.contact else { return };
                to.section(*b"FORC", |to| {
                    to.count(columns);
                    to.count(rows);
                    let centre =
                        contact.centroid.map_or([f32::NAN; 2], |at| [at.x_px as f32, at.y_px as f32]);
                    to.f32s(&centre);
                    to.f32(of.threshold_n);
                    to.f32(of.pixel_mm2 as f32);
                    to.f32s(&of.force);
                });
            }
            (Kind::Electrodes(..), _) => to.section(*b"ELEC", |to| {
                let shown = &items[items.len().saturating_sub(READINGS)..];
                to.count(shown.len());
                for item in shown {
                    let Content::Reading(values) = &item.content else { continue };
                    to.u32(u32::from(item.begins));
                    to.f32s(values);
                }
            }),
            (Kind::Events, Content::Events(values)) => to.section(*b"SPAR", |to| {
                let [columns, rows] = self.size().unwrap_or_default();
                to.count(self.input.len() / (columns * rows).max(1));
                to.count(rows);
                to.count(columns);
                for &(at, value) in values {
                    to.u32(at);
                    to.f32(value);
                }
            }),
            _ => {}
        }
    }

    /// Columns and rows of a frame that is an image.
    fn size(&self) -> Option<[usize; 2]> {
        match self.framed.network.input() {
            meissner_engine::frames::FrameShape::Image { height, width, .. } => Some([width, height]),
            meissner_engine::frames::FrameShape::Vector(_) => None,
        }
    }

    /// The section WORK.
    pub(super) fn count(&self, to: &mut Bytes<'_>) {
        let counters = self.engine.counters();
        to.count(counters.layers.len());
        for layer in &counters.layers {
            for count in [layer.computed, 0, 0, layer.skipped + layer.absorbed] {
                to.f64(count as f64);
            }
        }
        for count in [counters.predictions, 0, 0, 0, 0, 0] {
            to.f64(count as f64);
        }
    }
}

/// Booleans as bits of words of 32, the first in the lowest.
fn bits(all: &[bool], to: &mut Bytes<'_>) {
    for word in all.chunks(32) {
        to.u32(word.iter().rev().fold(0, |bits, &set| bits << 1 | u32::from(set)));
    }
}
