//! The pictures of a raw video.
//!
//! Input: the bytes of a file or a stream. Output: pictures, with number and time of arrival.
//!
//! | input | rate | pictures |
//! |---|---|---|
//! | a regular file | any | all, read when they are asked for |
//! | a stream, a pipe or a device | not given | all; the writer waits until they are asked for |
//! | | given | those that are not late; the writer never waits |
//!
//! With a rate, a thread takes each picture off the stream at once. A picture is *late* if it has
//! waited longer than one period of the rate and a newer one has arrived: it is dropped and
//! counted. So all pictures of a burst within a period are taken, and a picture that is taken has
//! waited for at most a period, or is the newest. Only intervals are compared, so that a camera may
//! be a little slower or faster than its stated rate.
//!
//! Invariant: at most [`MAX_WAITING`] pictures wait; each picture that arrived was taken, is late
//! or waits.

use std::collections::VecDeque;
use std::fmt;
use std::fs::{self, File};
use std::path::Path;
use std::sync::{Arc, Condvar, Mutex, MutexGuard, PoisonError};
use std::thread;
use std::time::{Duration, Instant};

use meissner_io::{Image, IoError, RawVideo, VideoFormat};
use meissner_live::LiveError;

use crate::error::{Result, RunError};
use crate::run::summary::VideoCounts;
use crate::text::grouped;
use crate::{interrupt, streams};

/// Maximum number of pictures that wait for the network.
pub(crate) const MAX_WAITING: usize = 4;

/// Options for reading a raw video.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct VideoOptions {
    /// Size and pixels of its pictures.
    pub format: VideoFormat,
    /// Pictures per second, positive. Late pictures of a stream are dropped only if it is given.
    pub rate: Option<f64>,
    /// Whether remaining bytes after the last complete picture are an error.
    pub strict: bool,
}

impl VideoOptions {
    /// Time from one picture to the next.
    pub fn period(&self) -> Option<Duration> {
        self.rate.map(|rate| Duration::try_from_secs_f64(1.0 / rate).unwrap_or(Duration::MAX))
    }
}

impl fmt::Display for VideoOptions {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}", self.format)?;
        self.rate.map_or(Ok(()), |rate| write!(f, ", {rate} pictures a second"))
    }
}

/// A picture of a video.
#[derive(Debug)]
pub(crate) struct VideoPicture {
    pub(crate) image: Image,
    /// Number in the video, from 0.
    pub(crate) number: u64,
    /// Arrival time of its last byte.
    pub(crate) arrived: Instant,
}

type Pictures = Box<dyn Iterator<Item = Result<VideoPicture, IoError>> + Send>;

/// The pictures to take from a raw video.
pub(super) struct Video {
    name: String,
    /// Whether the whole video exists from the start.
    pub(super) is_recorded: bool,
    strict: bool,
    pictures: Source,
    taken: u64,
    /// Bytes after the last whole picture.
    rest: u64,
}

enum Source {
    Read(Pictures),
    Arriving(Arrivals),
}

impl Video {
    /// Opens the file or stream at `path`, to take its first `limit` pictures.
    ///
    /// # Errors
    /// It cannot be opened, or is a stream of datagrams or packets.
    pub(super) fn open(path: &Path, options: VideoOptions, limit: usize) -> Result<Self> {
        let name = streams::name(path);
        let problem = if streams::is_of_datagrams(path) {
            Some("a picture is longer than a datagram")
        } else {
            streams::is_of_packets(path).then_some("packets of AEDAT4 are no raw video")
        };
        if let Some(problem) = problem {
            let expected = "a file, standard input or TCP".to_owned();
            return Err(RunError::Video { expected, found: format!("{name}: {problem}") });
        }
        let input = if streams::is_live(path) {
            streams::open(path)?
        } else {
            interrupt::awaited(File::open(path).map_err(|source| RunError::file("open", path, source))?)
        };
        let pictures = RawVideo::new(input, options.format).take(limit).zip(0..).map(|(image, number)| {
            let image = image?;
            Ok(VideoPicture { image, number, arrived: Instant::now() })
        });
        let (pictures, is_recorded): (Pictures, _) = (Box::new(pictures), is_recorded(path));
        let pictures = match options.period() {
            Some(period) if !is_recorded => Source::Arriving(Arrivals::start(pictures, period)?),
            _ => Source::Read(pictures),
        };
        Ok(Self { name, is_recorded, strict: options.strict, pictures, taken: 0, rest: 0 })
    }

    pub(super) fn counts(&self) -> VideoCounts {
        let pictures_late = match &self.pictures {
            Source::Read(_) => 0,
            Source::Arriving(arrivals) => arrivals.queue.lock().late,
        };
        VideoCounts { pictures: self.taken + pictures_late, pictures_late, bytes_left_out: self.rest }
    }

    /// The error `error` of the next picture; `None` if it only ends the video.
    fn ended(&mut self, error: IoError) -> Option<RunError> {
        match error {
            // An interruption usually cuts a stream inside a picture.
            _ if interrupt::requested() => None,
            IoError::Truncated { expected, actual, .. } if self.taken > 0 && !self.strict => {
                self.rest = actual;
                let (rest, all) = (grouped(actual), grouped(expected));
                tracing::warn!(
                    "{}: the last {rest} bytes are no whole picture of {all} bytes and are left out: the video was cut off, \
                     or its size or pixels are others",
                    self.name
                );
                None
            }
            error => Some(RunError::recording(&self.name, error)),
        }
    }
}

impl Iterator for Video {
    type Item = Result<VideoPicture>;

    /// Waits for the next picture; `None` at the end, and on a signal.
    fn next(&mut self) -> Option<Self::Item> {
        let next = match &mut self.pictures {
            Source::Read(pictures) => pictures.next(),
            Source::Arriving(arrivals) => arrivals.next(),
        };
        match next? {
            Ok(picture) => {
                self.taken += 1;
                Some(Ok(picture))
            }
            Err(error) => self.ended(error).map(Err),
        }
    }
}

/// Whether the file at `path`, or the file on standard input, exists completely.
fn is_recorded(path: &Path) -> bool {
    let path = if streams::is_stdin(path) { Path::new("/dev/stdin") } else { path };
    fs::metadata(path).is_ok_and(|file| file.is_file())
}

/// Pictures that a thread takes from a stream.
struct Arrivals {
    queue: Arc<Queue>,
    period: Duration,
}

#[derive(Default)]
struct Queue {
    waiting: Mutex<Waiting>,
    changed: Condvar,
}

/// The pictures that wait for the network.
#[derive(Debug, Default)]
pub(crate) struct Waiting {
    pictures: VecDeque<VideoPicture>,
    /// Pictures that were dropped.
    pub(crate) late: u64,
    /// How the stream has ended.
    end: Option<Result<(), IoError>>,
    /// Whether pictures are no longer taken.
    is_closed: bool,
}

impl Waiting {
    /// Takes a picture that has arrived. If the queue is full, the oldest is dropped.
    pub(crate) fn offer(&mut self, picture: VideoPicture) {
        if self.pictures.len() == MAX_WAITING {
            self.drop_oldest();
        }
        self.pictures.push_back(picture);
    }

    /// The oldest picture that is not late at `now`.
    pub(crate) fn take(&mut self, now: Instant, period: Duration) -> Option<VideoPicture> {
        let is_late = |picture: &VideoPicture| now.saturating_duration_since(picture.arrived) > period;
        while self.pictures.len() > 1 && self.pictures.front().is_some_and(is_late) {
            self.drop_oldest();
        }
        self.pictures.pop_front()
    }

    fn drop_oldest(&mut self) {
        self.late += u64::from(self.pictures.pop_front().is_some());
    }
}

impl Queue {
    fn lock(&self) -> MutexGuard<'_, Waiting> {
        self.waiting.lock().unwrap_or_else(PoisonError::into_inner)
    }

    /// Fills the queue until the stream ends or nothing is taken any more.
    fn fill(&self, pictures: Pictures) {
        for picture in pictures {
            let mut waiting = self.lock();
            match picture {
                _ if waiting.is_closed => return,
                Ok(picture) => waiting.offer(picture),
                Err(error) => waiting.end = Some(Err(error)),
            }
            drop(waiting);
            self.changed.notify_one();
        }
        self.lock().end.get_or_insert(Ok(()));
        self.changed.notify_one();
    }
}

impl Arrivals {
    fn start(pictures: Pictures, period: Duration) -> Result<Self> {
        let queue = Arc::new(Queue::default());
        let filled = Arc::clone(&queue);
        let thread = thread::Builder::new().name("camera".to_owned());
        // The thread may wait for a camera that sends nothing any more, so it is not joined.
        thread
            .spawn(move || filled.fill(pictures))
            .map_err(|error| RunError::Live(LiveError::Thread(error)))?;
        Ok(Self { queue, period })
    }

    /// The next picture, as soon as there is one. A signal ends the stream.
    fn next(&self) -> Option<Result<VideoPicture, IoError>> {
        let mut waiting = self.queue.lock();
        loop {
            if let Some(picture) = waiting.take(Instant::now(), self.period) {
                return Some(Ok(picture));
            }
            if let Some(end) = &mut waiting.end {
                return std::mem::replace(end, Ok(())).err().map(Err);
            }
            waiting = self.queue.changed.wait(waiting).unwrap_or_else(PoisonError::into_inner);
        }
    }
}

impl Drop for Arrivals {
    fn drop(&mut self) {
        self.queue.lock().is_closed = true;
    }
}
