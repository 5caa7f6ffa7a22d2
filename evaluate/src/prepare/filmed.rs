//! Marker tracks, images and grasps, filmed by the camera model.
//!
//! Input: a safetensors file of marker tracks with labels, a sequence of images, or a number of
//! grasps and a seed. Output: events with their causes, and the labels.

use std::path::Path;

use meissner_engine::Sensor;
use meissner_io::ImageSequence;
use meissner_models::TensorFile;
use meissner_run::RunError;
use meissner_run::text::grouped;
use meissner_simulator::gel::GelSolver;
use meissner_simulator::grasp::{Grasp, Grip, SENSOR};
use meissner_simulator::{Camera, CameraSettings, MarkerScene, MarkerTracks, SimulatedEvent, SimulatorError};
use rayon::ThreadPool;
use rayon::prelude::*;
use safetensors::tensor::{Dtype, SafeTensors};
use serde_json::json;

use crate::error::{EvaluateError, Result, StreamsError};
use crate::prepare::{Prepared, add_streams, metadata};
use crate::streams::{Truth, bounds, floats, integers, tensor, wrong};

/// The events that a camera sees of the marker tracks in the safetensors file `tracks`.
///
/// A separate camera with the seed `seed + i` films stream i. The file has
///
/// | tensor | type and shape | values |
/// |---|---|---|
/// | `t_us` | I64 (times) | times of all streams, ascending in each |
/// | `start` | I64 (streams + 1) | the first time of each stream, and the number of times |
/// | `position` | F32 (times, markers, 2) | column and row of each marker in pixels |
/// | any other | F32 (times) | a label of the streams along time |
///
/// The result has `t_us`, `x`, `y`, `on`, `start` as [`super::graphs`] reads them, and `cause` (0
/// signal, 1 leak, 2 shot noise, 3 hot pixel), all I64. With labels it also has `truth.start` I64
/// (streams + 1), `truth.t_us` I64 (times), and a label NAME as `truth.NAME` F32 (times), linear
/// between the times. The threads of `pool` share the streams.
///
/// # Errors
/// The file cannot be read, its tensors do not fit, or the simulator refuses settings or tracks.
pub fn film_markers(
    tracks: &Path,
    sensor: Sensor,
    scene: &MarkerScene,
    settings: CameraSettings,
    seed: u64,
    pool: &ThreadPool,
) -> Result<Prepared> {
    let bytes = meissner_io::read_whole(tracks).map_err(RunError::File)?;
    let (tracks, truth) =
        read(&bytes).map_err(|source| EvaluateError::Streams { path: tracks.to_owned(), source })?;
    let film = |(i, tracks): (usize, MarkerTracks)| -> Result<Vec<SimulatedEvent>, SimulatorError> {
        let mut camera = Camera::new(sensor, settings, seed.wrapping_add(i as u64))?;
        let mut events = Vec::new();
        tracks.film(scene, &mut camera, &mut events)?;
        Ok(events)
    };
    let streams: Vec<Vec<SimulatedEvent>> =
        pool.install(|| tracks.into_par_iter().enumerate().map(film).collect::<Result<_, _>>())?;

    Ok(prepared(sensor, &streams, truth))
}

/// Simulated `streams` in the form that [`film_markers`] documents, without labels.
pub fn with_causes(sensor: Sensor, streams: &[Vec<SimulatedEvent>]) -> Prepared {
    prepared(sensor, streams, None)
}

/// Simulated `streams` with labels, where there are any.
pub(super) fn prepared(sensor: Sensor, streams: &[Vec<SimulatedEvent>], truth: Option<Truth>) -> Prepared {
    let mut file = TensorFile::new(metadata([("sensor", json!([sensor.width, sensor.height]))]));
    add_streams(&mut file, streams.iter().map(|stream| stream.iter().map(|simulated| &simulated.event)));
    let cause: Vec<i64> = streams.iter().flatten().map(|simulated| simulated.cause as i64).collect();
    file.i64("cause", &[cause.len()], &cause);
    if let Some(truth) = truth {
        truth.write(&mut file);
    }
    let count = grouped(cause.len() as u64);
    let streams = grouped(streams.len() as u64);
    Prepared { file, contents: format!("{count} events of {streams} streams") }
}

/// The events that a camera sees of `images`, one every `interval_us` microseconds from 0 on.
///
/// The luma of a pixel (0.299 R + 0.587 G + 0.114 B, as in ITU-R BT.601) over 255 is its intensity.
///
/// # Errors
/// An image cannot be read, or the simulator refuses the settings.
///
/// # Panics
/// If `images` is empty.
pub fn film_images(
    images: ImageSequence,
    interval_us: i64,
    settings: CameraSettings,
    seed: u64,
) -> Result<(Sensor, Vec<SimulatedEvent>)> {
    let mut camera: Option<Camera> = None;
    let (mut intensity, mut events) = (Vec::new(), Vec::new());
    for (i, image) in images.enumerate() {
        let (path, image) = image.map_err(RunError::from)?;
        let camera = match &mut camera {
            Some(camera) => camera,
            none => {
                let [width, height] = [image.width, image.height].map(u16::try_from);
                let (Ok(width), Ok(height)) = (width, height) else {
                    return Err(EvaluateError::ImageSize { path, width: image.width, height: image.height });
                };
                none.insert(Camera::new(Sensor::new(width, height), settings, seed)?)
            }
        };
        let luma =
            |rgb: &[u8]| 0.299 * f32::from(rgb[0]) + 0.587 * f32::from(rgb[1]) + 0.114 * f32::from(rgb[2]);
        intensity.clear();
        intensity.extend(image.data.chunks_exact(3).map(|rgb| luma(rgb) / 255.0));
        camera.push(i as i64 * interval_us, &intensity, &mut events)?;
    }
    let mut camera = camera.expect("a sequence has an image");
    camera.finish(&mut events);
    Ok((camera.sensor(), events))
}

fn read(bytes: &[u8]) -> Result<(Vec<MarkerTracks>, Option<Truth>), StreamsError> {
    let file = SafeTensors::deserialize(bytes)?;
    let t_us = integers(&file, "t_us", None)?;
    let start = bounds(&integers(&file, "start", None)?, t_us.len())?;
    let expected = format!("F32 ({}, markers, 2)", t_us.len());
    let view = tensor(&file, "position", Dtype::F32, &expected)?;
    let markers = match *view.shape() {
        [times, markers, 2] if times == t_us.len() => markers,
        _ => return Err(wrong("position", &expected, &view)),
    };
    let positions = floats(view.data()).as_chunks().0.to_vec();
    let tracks = |(stream, range): (usize, &[usize])| {
        let (times, places) = (range[0]..range[1], range[0] * markers..range[1] * markers);
        MarkerTracks::new(t_us[times].to_vec(), markers, positions[places].to_vec())
            .map_err(|source| StreamsError::Tracks { stream, source })
    };
    let tracks = start.windows(2).enumerate().map(tracks).collect::<Result<_, _>>()?;
    Ok((tracks, Truth::of_tracks(&file, start, t_us)?))
}

/// The labels of a grasp: force (N), depth (mm), area (mm2), the number of the
/// [`Phase`](meissner_simulator::grasp::Phase), diameter of the bolt (mm).
const LABELS: [&str; 5] = ["force", "depth", "area", "phase", "bolt"];

/// `recordings` grasps of bolts of 8, 12 and 16 mm in turn; `seed` determines all of them.
///
/// The file has streams as [`crate::prepare::film_markers`] writes them, with `truth.force` (N),
/// `truth.depth` (mm), `truth.area` (mm2), `truth.phase` (0 grasping, 1 holding, 2 releasing) and
/// `truth.bolt` (mm). The threads of `pool` share the recordings, and change no bit of them.
///
/// Complexity: about a second of one core for each recording.
///
/// # Errors
/// As [`Grasp::film`].
pub fn grasps(recordings: usize, seed: u64, pool: &ThreadPool) -> Result<Prepared> {
    let solver = Grasp::solver()?;
    let film = |solver: &mut GelSolver, number: usize| -> Result<_, SimulatorError> {
        let grasp = Grasp::drawn(seed, number);
        let (events, grips) = grasp.film(solver, CameraSettings::tactile())?;
        let label = |grip: Grip| {
            let Grip { t_us, force_n, depth_mm, area_mm2, phase } = grip;
            let number = f32::from(phase as u8);
            (t_us, [force_n as f32, depth_mm as f32, area_mm2 as f32, number, grasp.bolt_mm() as f32])
        };
        Ok((events, grips.into_iter().map(label).collect::<Vec<_>>()))
    };
    let filmed: Vec<_> = pool.install(|| {
        (0..recordings).into_par_iter().map_init(|| solver.clone(), film).collect::<Result<_, _>>()
    })?;
    let (streams, labels): (Vec<_>, Vec<_>) = filmed.into_iter().unzip();
    Ok(prepared(SENSOR, &streams, Some(Truth::of_streams(&LABELS, &labels))))
}
