//! The input of a frame network, item by item, for the page.

use std::collections::VecDeque;
use std::convert::Infallible;
use std::path::Path;

use meissner_engine::frames::FrameShape;
use meissner_engine::{LatePolicy, RestartPolicy, Sensor};
use meissner_io::{IoError, read_image};
use meissner_run::frame_feed::{EmptyFrameLimit, FeedOptions, FeedOutput, FrameFeed};
use meissner_run::model::FrameModel;
use meissner_run::run::{self, EVERY, PERIOD_US, VideoOptions};
use meissner_run::source::Source;
use meissner_run::{RunError, streams};
use meissner_view::frames::{Content, Frame, FrameSensor};

use crate::error::CliError;
use crate::stderr::tell;

/// Default time from one picture to the next, because pictures in files have no times.
const PICTURE_US: i64 = 40_000;

/// The items of an input.
pub(super) type Items = Box<dyn Iterator<Item = Result<Frame, RunError>> + Send>;

/// An input of a frame network.
pub(super) struct Opened {
    pub(super) name: String,
    pub(super) sensor: FrameSensor,
    pub(super) live: bool,
    pub(super) items: Items,
}

/// The pictures at `path`, of the size that `model` reads.
///
/// # Errors
/// The pictures cannot be opened, or one has another size.
pub(super) fn open_pictures(
    model: &FrameModel,
    path: &Path,
    video: Option<VideoOptions>,
    reference: Option<&Path>,
) -> Result<Opened, CliError> {
    let FrameShape::Image { height, width, .. } = model.description.input() else {
        return Err(RunError::is_frame_network(&model.name).into());
    };
    let network = model.name.clone();
    let check = move |path: &Path, found: (usize, usize)| {
        let (path, network, expected) = (path.to_owned(), network.clone(), (width, height));
        if found == expected {
            return Ok(());
        }
        Err(RunError::PictureSize { path, network, expected, found })
    };
    let reference = reference.map(|path| {
        let image = read_image(path).map_err(RunError::from)?;
        check(path, image.size())?;
        Ok::<_, RunError>(image.data)
    });
    let period = video.and_then(|video| video.period());
    let period_us = period.map_or(PICTURE_US, |period| period.as_micros() as i64);
    let (pictures, live) = run::open_pictures(path, video, usize::MAX)?;
    let items = pictures.zip(0..).map(move |(picture, number)| {
        let (path, image) = picture?;
        check(&path, image.size())?;
        let content = Content::Picture(image.data);
        Ok(Frame { t_us: number * period_us, begins: number == 0, content })
    });
    let sensor = FrameSensor { size: [width as u16, height as u16], reference: reference.transpose()? };
    Ok(Opened { name: streams::name(path), sensor, live, items: Box::new(items) })
}

/// The readings at `path`.
///
/// # Errors
/// The readings cannot be opened.
pub(super) fn open_readings(path: &Path) -> Result<Opened, CliError> {
    let (mut rows, live) = run::open_readings(path)?;
    let name = streams::name(path);
    let label = name.clone();
    let mut count = 0;
    let items = std::iter::from_fn(move || {
        loop {
            let reading = match rows.next()? {
                Ok(reading) => reading,
                Err(error @ IoError::Malformed { what: "row" | "field", .. }) => {
                    // A refused row only ends a window.
                    tell(format_args!("{label}: {error}"));
                    continue;
                }
                Err(error) => return Some(Err(RunError::recording(&label, error))),
            };
            let t_us = reading.time_s.map_or(count * PERIOD_US as i64, |s| (s * 1e6) as i64);
            count += 1;
            let content = Content::Reading(reading.values);
            return Some(Ok(Frame { t_us, begins: !rows.follows(), content }));
        }
    });
    Ok(Opened { name, sensor: FrameSensor::default(), live, items: Box::new(items) })
}

/// The frames that `model` reads of the events of `source`.
///
/// # Errors
/// The sensor lacks their pixels.
pub(super) fn open_events(model: &FrameModel, source: Source, sensor: Sensor) -> Result<Opened, CliError> {
    let options = FeedOptions {
        late: LatePolicy::Drop,
        restart: RestartPolicy::Reset,
        every: EVERY,
        silence: EmptyFrameLimit::new(None, 0),
        keeps: false,
    };
    let feed = FrameFeed::new(&model.description, sensor, options, None);
    let feed = feed.map_err(|source| RunError::Frames { network: model.name.clone(), source })?;
    let feed = feed.ok_or_else(|| RunError::is_frame_network(&model.name))?;
    let (name, live) = (source.name.clone(), source.is_live());
    let sensor = FrameSensor { size: [sensor.width, sensor.height], reference: None };
    let items = Fed { source, feed, frames: VecDeque::new(), begins: true, ended: false };
    Ok(Opened { name, sensor, live, items: Box::new(items) })
}

/// Frames of the events of a source.
struct Fed {
    source: Source,
    feed: FrameFeed,
    /// Frames that are complete.
    frames: VecDeque<Frame>,
    /// Whether the next frame does not continue an earlier one.
    begins: bool,
    ended: bool,
}

impl Iterator for Fed {
    type Item = Result<Frame, RunError>;

    fn next(&mut self) -> Option<Self::Item> {
        let Self { source, feed, frames, begins, ended } = self;
        let mut take = |output: FeedOutput<'_>, frames: &mut VecDeque<Frame>| {
            match output {
                FeedOutput::Frame { values, t_us, .. } => {
                    let set = (0..).zip(values).filter(|&(_, &value)| value != 0.0);
                    let content = Content::Events(set.map(|(at, &value)| (at, value)).collect());
                    frames.push_back(Frame { t_us, begins: std::mem::take(begins), content });
                }
                FeedOutput::LeftOut { resets, .. } => *begins |= resets,
                FeedOutput::Restart => *begins = true,
            }
            Ok::<(), Infallible>(())
        };
        while frames.is_empty() && !*ended {
            let done = match source.next() {
                Some(Ok(event)) => feed.push(event, |output| take(output, frames)).map(drop),
                Some(Err(error)) => return Some(Err(error)),
                None => {
                    *ended = true;
                    let settled = feed.settle(|output| take(output, frames));
                    settled.and_then(|()| feed.finish(|output| take(output, frames)))
                }
            };
            match done {
                Ok(()) => {}
            }
        }
        frames.pop_front().map(Ok)
    }
}
