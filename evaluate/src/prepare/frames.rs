//! Statistics of the frames of a training.
//!
//! Input: the data that frames are made of, and weights. Output: the weights, with statistics of
//! these frames in their metadata. The frames are those that `eval` of the same data shows a
//! network.

use std::path::PathBuf;

use meissner_engine::Event;
use meissner_engine::frames::{
    Convolution, FrameFeatures, FrameNetwork, FrameShape, FrameStatistics, TrainingFrames,
};
use meissner_engine::representations::{ELECTRODE_COLUMNS, ELECTRODE_ROWS, ELECTRODES, TACTILE_COLUMNS};
use meissner_models::description::frames::PictureSettings;
use meissner_models::systems::contact_area::ImageSize;
use meissner_models::systems::slip::ObjectSet;
use meissner_models::{FrameDescription, FrameSource, Weights, frames_text};
use meissner_run::RunError;
use meissner_run::frame_feed::FeedOutput;
use meissner_run::text::grouped;
use rayon::prelude::*;

use super::Prepared;
use super::windows::{Ages, Times, told};
use crate::area::pictures::Set;
use crate::error::{EvaluateError, RequestPart, Result, weights_error};
use crate::regression::engine::feed;
use crate::slip::{SlipData, Windows, trained_on_basic};
use crate::streams::Streams;
use crate::trainings::Metadata;

/// `weights` of the network of `description`, with statistics of its frames from `inputs`: streams
/// of events, folders of the data set of electrodes (only the set Basic for weights that were
/// trained on it), or files of pictures.
///
/// Sliding windows count at `ages` of the streams, all other frames count.
///
/// # Errors
/// An input cannot be read or does not fit, there are fewer frames than twice the number of
/// features, and two, or the weights do not fit.
///
/// # Panics
/// Never: a description's source fits its shape.
pub fn training_frames(
    inputs: &[PathBuf],
    description: &FrameDescription,
    (weights, label): (&Weights, &str),
    ages: Ages,
) -> Result<Prepared> {
    let parts = description.network_parts_regardless(weights).map_err(weights_error(label))?;
    let network = FrameNetwork::new(parts, Convolution::Direct).map_err(RunError::from)?;
    let of = features(description.source());
    let statistics = FrameStatistics::new(&of, description.input(), network.has_state());
    let statistics = statistics.expect("the source of frames fits their shape");
    let mut frames = Vec::new();
    match description.source() {
        FrameSource::TactileImage(_) | FrameSource::Electrodes(_) => {
            let on_basic = trained_on_basic(Metadata(weights.metadata()));
            for folder in inputs {
                let data = SlipData::read(folder)?;
                let windows = Windows::cut(&data, description)?;
                let counts = |&window: &usize| {
                    !on_basic || data.objects[windows.cases.recording(window)].set == ObjectSet::Basic
                };
                let chosen = (0..windows.cases.len()).filter(counts);
                frames.extend(
                    chosen.map(|window| of_sequence(&statistics, windows.frames(window, windows.steps))),
                );
            }
        }
        FrameSource::Picture(settings) => {
            for file in inputs {
                frames.extend(of_pictures(&statistics, description, settings, &Set::read(file)?)?);
            }
        }
        _ => {
            let card = weights.card().map_err(weights_error(label))?;
            let mut times = Times::new(ages);
            for file in inputs {
                let streams = Streams::read(file)?;
                let times = times.of(&streams);
                let each: Vec<usize> = (0..streams.parts().len()).collect();
                let of_stream = |&i: &usize| {
                    let events = streams.parts()[i].iter().copied().step_by(card.stride);
                    of_events(&statistics, description, &streams, (events, i), times[i].clone())
                };
                let found = each.par_iter().map(of_stream).collect::<Result<Vec<_>>>()?;
                frames.extend(found.into_iter().flatten());
            }
        }
    }
    let described = TrainingFrames::of(of, &frames).ok_or_else(|| {
        let least = 2 * (statistics.features().len() + 1);
        let found = format!("{} frames", frames.len());
        EvaluateError::request(RequestPart::Data, format!("at least {least} frames"), found)
    })?;
    let contents = format!("{label}, and what {} frames were like", grouped(frames.len() as u64));
    Ok(told(weights, frames_text(&described), contents))
}

/// The features that describe frames of `source`. For electrodes, these are their values, because
/// they fill few cells of an image.
fn features(source: &FrameSource) -> FrameFeatures {
    match source {
        FrameSource::Electrodes(readings) => FrameFeatures::Values((0..readings.scaling.values()).collect()),
        FrameSource::TactileImage(_) => {
            let cell = |i: usize| ELECTRODE_ROWS[i] * TACTILE_COLUMNS + ELECTRODE_COLUMNS[i];
            let mut cells: Vec<usize> = (0..ELECTRODES).map(cell).collect();
            cells.sort_unstable();
            FrameFeatures::Values(cells)
        }
        _ => FrameFeatures::Image,
    }
}

/// The features after all `frames`.
fn of_sequence<'a>(statistics: &FrameStatistics, frames: impl Iterator<Item = &'a [f32]>) -> Vec<f64> {
    let mut statistics = statistics.clone();
    frames.for_each(|frame| statistics.push(frame));
    statistics.features()
}

/// The features of each picture in `set`.
fn of_pictures(
    statistics: &FrameStatistics,
    description: &FrameDescription,
    settings: &PictureSettings,
    set: &Set,
) -> Result<Vec<Vec<f64>>> {
    if let FrameShape::Image { height, width, .. } = description.input() {
        set.check(description.name(), ImageSize { width, height })?;
    }
    let images = settings.image_normalisation().map_err(RunError::from)?;
    let mut planes = vec![0.0; description.input().values()];
    let mut found = Vec::new();
    for press in &set.presses {
        for picture in &press.pictures {
            let reference = settings.difference.then_some(&press.reference[..]);
            images.apply(&picture.rgb, reference, &mut planes).map_err(RunError::from)?;
            found.push(of_sequence(statistics, std::iter::once(&planes[..])));
        }
    }
    Ok(found)
}

/// The features after each consecutive frame of stream `i`, or of sliding windows at `times`.
fn of_events(
    statistics: &FrameStatistics,
    description: &FrameDescription,
    streams: &Streams,
    (events, i): (impl Iterator<Item = Event>, usize),
    mut times: Vec<i64>,
) -> Result<Vec<Vec<f64>>> {
    let (mut statistics, mut found) = (statistics.clone(), Vec::new());
    let mut take = |output: FeedOutput<'_>| {
        if let FeedOutput::Frame { values, .. } = output {
            statistics.push(values);
            found.push(statistics.features());
        }
        Ok::<_, RunError>(())
    };
    let mut events = events.peekable();
    // Frames begin with the labels, as in `eval force`.
    let span = streams.truth.as_ref().map(|truth| truth.span_us(i));
    let [start, end] = span.unwrap_or_else(|| streams.span_us(i));
    let mut feed = feed(description, streams.sensor(), start)?;
    let slides = feed.slides();
    if slides {
        times.sort_unstable();
    } else {
        times = vec![end];
    }
    for t_us in times {
        while let Some(event) = events.next_if(|event| event.t_us <= t_us) {
            feed.push(event, &mut take)?;
        }
        feed.advance(t_us, &mut take)?;
        if slides {
            feed.finish(&mut take)?;
        }
    }
    Ok(found)
}
