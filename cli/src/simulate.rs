//! `meissner simulate`: events of the camera model.

mod closed_loop;
mod grasp;

use std::io::{Write, stdout};
use std::path::PathBuf;

use clap::{Arg, Subcommand, ValueEnum};
use meissner_engine::Sensor;
use meissner_evaluate::EvaluateError;
use meissner_evaluate::prepare::{
    self, DOME_KINDS, GelPlan, Shapes, dome_presses, film_images, film_markers, gel_presses, measured_optics,
};
use meissner_io::{Format, ImageSequence};
use meissner_run::RunError;
use meissner_run::text::{grouped, span_us};
use meissner_simulator::{CameraSettings, MarkerScene};

use crate::args::{GelSensorArg, INPUT, MEASUREMENT, Threads, positive, sensor};
use crate::error::CliError;
use crate::output::OutArgs;
use crate::progress::Progress;
use crate::stderr::tell;

pub(crate) const CAMERA: &str = "Camera";
pub(crate) const MARKERS: &str = "Markers";

/// `meissner simulate`.
#[derive(Debug, clap::Args)]
pub(crate) struct SimulateArgs {
    #[command(subcommand)]
    input: InputArgs,
}

#[derive(Debug, Subcommand)]
enum InputArgs {
    /// Events of markers that move, such as the pins of a tactile sensor.
    ///
    /// Each stream of tracks is filmed by a camera of its own. Equal tracks, settings and seeds
    /// give equal bytes on every machine.
    Markers(MarkersArgs),
    /// Events of a sequence of images, as a recording.
    Images(ImagesArgs),
    /// Tracks of the markers in a soft dome that is pressed on planes, with labels.
    ///
    /// The planes have tilts of 0 to 9 degrees in 20 directions; depths are 5 to 15 mm, durations
    /// 90 to 200 ms. The dome is the published one of 40 mm with 169 markers. `simulate markers`
    /// turns the tracks into events.
    Dome(DomeArgs),
    /// Pictures of a gel that is pressed by indenters, with the force on each pixel.
    ///
    /// The lights are fitted to pictures of a real sensor. `eval area` and `models/train/area` read
    /// the file.
    Gel(GelArgs),
    /// Events of fingers that grasp and release a bolt, with the force along time.
    ///
    /// A camera behind the transparent silicone of one finger sees a bolt of 8, 12 or 16 mm come,
    /// touch, vibrate and leave. Equal numbers and seeds give equal bytes on every machine.
    Grasp(grasp::GraspArgs),
    /// Control by touch: how the error and the run time of a network affect it.
    ///
    /// A ball is pressed so that its force follows a saw-tooth, or a marble is brought back to the
    /// middle of the sensor. The sensor is that of `simulate gel`, and the controller moves by what
    /// a network says of its pictures.
    Loop(closed_loop::LoopArgs),
}

/// Tensors of both files.
const TENSORS: &str = "\
Reads, of T times one stream after the other:
  t_us      I64 (T): times in microseconds, ascending in each stream
  start     I64 (streams + 1): where each stream begins in T, and the end
  position  F32 (T, markers, 2): column and row of each marker in pixels
  NAME      F32 (T): any label of the streams along time, such as depth

Writes, of E events one stream after the other, as `prepare graphs` reads them, all I64:
  t_us, x, y, on  (E): time, pixel, and 1 where the brightness rose
  cause           (E): 0 signal, 1 leak, 2 shot noise, 3 hot pixel
  start           (streams + 1): where each stream begins in E, and the end
  Metadata: sensor, JSON [width, height].
With labels also, for `eval angle`:
  truth.t_us      I64 (T), truth.start I64 (streams + 1): the times of the tracks
  truth.NAME      F32 (T): each label, linear between these times.";

/// `meissner simulate markers`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = TENSORS)]
struct MarkersArgs {
    /// File with the tracks (safetensors).
    #[arg(value_name = "TRACKS")]
    tracks: PathBuf,
    /// Size of the sensor in pixels.
    #[arg(long, value_name = "WxH", value_parser = sensor, help_heading = INPUT)]
    sensor: Sensor,
    /// Radius of a marker in pixels.
    #[arg(long, value_name = "PX", default_value_t = MarkerScene::default().radius, help_heading = MARKERS)]
    radius: f32,
    /// Width of the blurred edge of a marker in pixels.
    #[arg(long, value_name = "PX", default_value_t = MarkerScene::default().edge, help_heading = MARKERS)]
    edge: f32,
    /// Intensity of a marker: the share of the light of a white surface.
    #[arg(long, value_name = "SHARE", default_value_t = MarkerScene::default().marker, help_heading = MARKERS)]
    marker: f32,
    /// Intensity between the markers.
    #[arg(long, value_name = "SHARE", default_value_t = MarkerScene::default().ground, help_heading = MARKERS)]
    ground: f32,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    file: OutArgs,
}

/// `meissner simulate images`.
#[derive(Debug, clap::Args)]
#[command(mut_arg("out", of_images))]
struct ImagesArgs {
    /// Folder of images, or a text with a path on each line.
    ///
    /// The images of a folder (PNG, JPEG, PPM, PGM) are taken in the order of their names.
    ///
    /// The brightness of a pixel is taken as linear. Between two images its logarithm changes
    /// linearly, so that fast motion needs many images: at most a pixel of motion from one to the
    /// next.
    #[arg(value_name = "IMAGES")]
    images: PathBuf,
    /// Time from one image to the next.
    #[arg(long, value_name = "TIME", default_value = "10ms", value_parser = span_us, help_heading = INPUT)]
    interval: i64,
    #[command(flatten)]
    camera: CameraArgs,
    #[command(flatten)]
    file: OutArgs,
}

/// `--out` for images.
fn of_images(arg: Arg) -> Arg {
    let more = "The extensions are .csv, .npy, .dat, .evt3 and .raw (EVT3). A file that ends in .safetensors has the cause of \
                each event too, for `eval filters`; `simulate markers --help` has its tensors.";
    arg.help("Recording to write").long_help(format!("Recording to write.\n\n{more}"))
}

/// Tensors of the file.
const DOME: &str = "\
Writes, of T times one press after the other:
  t_us, start, position  as `simulate markers` reads them
  roll, pitch            F32 (T): angles of the plane about x and y, in radians
  depth                  F32 (T): depth along the axis of the dome, in mm
  force                  F32 (T): force of the plane along the axis, in N
  Metadata: sensor, JSON [width, height].";

/// `meissner simulate dome`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = DOME)]
struct DomeArgs {
    /// Presses of each plane, of 10 tilts and 20 directions: N = 1 makes 200.
    ///
    /// The shipped networks were trained on 12. The program says the time and the size before it
    /// starts.
    #[arg(long, alias = "presses", value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..), help_heading = MEASUREMENT)]
    each: u16,
    /// Planes at random instead of the 200 of the plan.
    ///
    /// Their tilts are 0 to 9 degrees, in any direction.
    #[arg(long, value_name = "N", value_parser = clap::value_parser!(u16).range(1..), help_heading = MEASUREMENT)]
    planes: Option<u16>,
    /// Size of the sensor in pixels.
    #[arg(long, value_name = "WxH", default_value = "346x260", value_parser = sensor, help_heading = INPUT)]
    sensor: Sensor,
    /// Seed of depths and durations, and of random planes.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = MEASUREMENT)]
    seed: u64,
    #[command(flatten)]
    file: OutArgs,
}

/// Tensors of the file.
const GEL: &str = "\
Writes, of P pictures one press after the other:
  picture    U8 (P, H, W, 3): red, green and blue
  force      F32 (P, H, W): normal force on the surface of each pixel, in N
  depth_mm   F32 (P): depth of the indenter
  start      I64 (presses + 1): the first picture of each press, and the end
  reference  U8 (presses, H, W, 3): the sensor at rest
  pixel_mm   F32 (presses): width of a pixel
  Metadata: indenters, JSON [kind of each press].
Between `reference` and `picture` the light drifts, smoothly over the picture.";

/// `meissner simulate gel`.
#[derive(Debug, clap::Args)]
#[command(after_long_help = GEL)]
struct GelArgs {
    /// Presses, with an indenter, a place and a force each.
    #[arg(long, value_name = "N", default_value_t = 100, value_parser = clap::value_parser!(u32).range(1..), help_heading = MEASUREMENT)]
    presses: u32,
    /// Pictures of a press, while the force rises and falls as a squared sine.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u16).range(1..), help_heading = MEASUREMENT)]
    pictures: u16,
    /// The sensor: its gel, lights, lens and scale.
    #[arg(long, value_enum, default_value_t = GelSensorArg::First, help_heading = INPUT)]
    sensor: GelSensorArg,
    /// The indenters; no kind and no letter is both seen and unseen.
    #[arg(long, value_enum, default_value_t = ShapesArg::Seen, help_heading = INPUT)]
    indenters: ShapesArg,
    /// Range of the greatest force of a press, in N.
    ///
    /// An indenter that reaches 60 % of the gel's thickness before presses less.
    #[arg(long, value_name = "LOW..HIGH", default_value = "0.2..20", value_parser = range, help_heading = INPUT)]
    newtons: Range,
    /// How often the force rises and falls linearly in a press, instead of a sine.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = INPUT)]
    saw_teeth: u16,
    /// Colours of slopes that were measured on a real sensor, instead of its camera.
    ///
    /// The array NAME of the archive FILE, F32 (3 colours, B angles of the slope, B directions, 6),
    /// as the calibration of Taxim makes them. The contact stays that of --sensor.
    #[arg(long, value_name = "FILE.npz:NAME", value_parser = optics, help_heading = INPUT)]
    optics: Option<OpticsArg>,
    /// Width of the surface that the picture shows, in mm, instead of the sensor's.
    #[arg(long, value_name = "MM", value_parser = positive, help_heading = INPUT)]
    width: Option<f64>,
    /// Size of a picture in pixels.
    #[arg(long, value_name = "WxH", default_value = "320x240", value_parser = sensor, help_heading = INPUT)]
    size: Sensor,
    /// Pixels of the picture for each one that contacts are solved on, a side.
    ///
    /// A contact on half of the pixels a side takes a quarter of the time and has coarser edges.
    #[arg(long, value_name = "N", default_value_t = 1, value_parser = clap::value_parser!(u8).range(1..=16), help_heading = INPUT)]
    coarseness: u8,
    /// Seed of everything that is drawn.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = MEASUREMENT)]
    seed: u64,
    #[command(flatten)]
    file: OutArgs,
}

#[derive(Clone, Copy, Debug, ValueEnum)]
enum ShapesArg {
    /// Balls, cylinders, punches, blocks, cones, irregular bodies, polygons, wires, letters A to K.
    Seen,
    /// Rings, edges, squares of balls, and letters L to Z.
    Unseen,
    /// Bodies of two to nine pins with flat ends.
    Pins,
    /// Plates of parallel ridges with round crests.
    Ridges,
    /// Flat blocks that reach beyond the picture.
    Larger,
    /// Flat rings that reach beyond the picture.
    LargerUnseen,
    /// Five irregular bodies, one after another.
    Irregular,
}

/// Least and greatest.
#[derive(Clone, Copy, Debug)]
struct Range([f64; 2]);

/// A range such as `0.2..20`.
fn range(text: &str) -> Result<Range, String> {
    let number = |text: &str| text.parse::<f64>().ok();
    let parsed = text.split_once("..").and_then(|(low, high)| Some([number(low)?, number(high)?]));
    match parsed {
        Some([low, high]) if 0.0 < low && low <= high && high.is_finite() => Ok(Range([low, high])),
        _ => Err("expected two numbers above 0, such as 0.2..20, the least first".to_owned()),
    }
}

/// An archive and the name of an array in it.
#[derive(Clone, Debug)]
struct OpticsArg {
    path: PathBuf,
    name: String,
}

/// `FILE.npz:NAME`.
fn optics(text: &str) -> Result<OpticsArg, String> {
    let (path, name) = text.rsplit_once(':').ok_or("expected FILE.npz:NAME")?;
    Ok(OpticsArg { path: path.into(), name: name.to_owned() })
}

/// Parameters of the camera; those that are missing are the default's or, with --ideal, the ideal
/// camera's. The defaults for markers are those of the training (`CameraSettings::tactile`).
#[derive(Clone, Copy, Debug, clap::Args)]
struct CameraArgs {
    /// A camera without noise, spread, delay and limit of bandwidth.
    #[arg(long, help_heading = CAMERA)]
    ideal: bool,
    /// Light of a white surface in lux [default: 300].
    ///
    /// Less light makes pixels slower and noisier.
    #[arg(long, value_name = "LUX", help_heading = CAMERA)]
    lux: Option<f64>,
    /// Light whose photocurrent equals the dark current, in lux [default: 0.1].
    #[arg(long, value_name = "LUX", help_heading = CAMERA)]
    dark_lux: Option<f64>,
    /// Mean threshold of on events, in units of the natural logarithm [default: 0.2].
    #[arg(long, value_name = "LOG", help_heading = CAMERA)]
    threshold_on: Option<f64>,
    /// Mean threshold of off events [default: 0.2; of markers 0.35].
    #[arg(long, value_name = "LOG", help_heading = CAMERA)]
    threshold_off: Option<f64>,
    /// Standard deviation of thresholds over pixels [default: 0.02; of markers 0.03].
    #[arg(long, value_name = "LOG", help_heading = CAMERA)]
    threshold_spread: Option<f64>,
    /// Highest cutoff frequency of a pixel in hertz [default: 3000].
    #[arg(long, value_name = "HZ", help_heading = CAMERA)]
    cutoff_max_hz: Option<f64>,
    /// Rate of leak events in the dark, in hertz [default: 0.061; of markers 0.003].
    #[arg(long, value_name = "HZ", help_heading = CAMERA)]
    leak_hz: Option<f64>,
    /// Rate of shot noise of a pixel in the dark, in hertz [default: 5].
    #[arg(long, value_name = "HZ", help_heading = CAMERA)]
    shot_hz: Option<f64>,
    /// Share of hot pixels [default: 0.0005].
    #[arg(long, value_name = "SHARE", help_heading = CAMERA)]
    hot_share: Option<f64>,
    /// Time after an event in which its pixel is reset, such as 100us [default: 100us].
    #[arg(long, value_name = "TIME", value_parser = span_us, help_heading = CAMERA)]
    refractory: Option<i64>,
    /// Mean time from a crossing to its event, such as 100us [default: 100us].
    #[arg(long, value_name = "TIME", value_parser = span_us, help_heading = CAMERA)]
    latency: Option<i64>,
    /// Standard deviation of that time, such as 20us [default: 20us].
    #[arg(long, value_name = "TIME", value_parser = span_us, help_heading = CAMERA)]
    jitter: Option<i64>,
    /// Seed of thresholds, phases and noise; stream i of markers has this seed plus i.
    #[arg(long, value_name = "N", default_value_t = 0, help_heading = MEASUREMENT)]
    seed: u64,
}

impl CameraArgs {
    /// The settings: given ones replace those of `base`.
    fn settings(self, base: CameraSettings) -> CameraSettings {
        let base = if self.ideal { CameraSettings::ideal() } else { base };
        CameraSettings {
            lux: self.lux.unwrap_or(base.lux),
            dark_lux: self.dark_lux.unwrap_or(base.dark_lux),
            threshold_on: self.threshold_on.unwrap_or(base.threshold_on),
            threshold_off: self.threshold_off.unwrap_or(base.threshold_off),
            threshold_spread: self.threshold_spread.unwrap_or(base.threshold_spread),
            cutoff_max_hz: self.cutoff_max_hz.unwrap_or(base.cutoff_max_hz),
            leak_hz: self.leak_hz.unwrap_or(base.leak_hz),
            shot_hz: self.shot_hz.unwrap_or(base.shot_hz),
            hot_share: self.hot_share.unwrap_or(base.hot_share),
            refractory_us: self.refractory.map_or(base.refractory_us, |us| us as f64),
            latency_us: self.latency.map_or(base.latency_us, |us| us as f64),
            jitter_us: self.jitter.map_or(base.jitter_us, |us| us as f64),
            ..base
        }
    }
}

/// Simulates and writes the events.
pub(crate) fn simulate(args: &SimulateArgs) -> Result<(), CliError> {
    let progress = Progress::busy(|| "simulating".to_owned());
    let (path, contents) = match &args.input {
        InputArgs::Markers(args) => (&args.file.out, markers(args)?),
        InputArgs::Images(args) => (&args.file.out, images(args)?),
        InputArgs::Dome(args) => (&args.file.out, dome(args)?),
        InputArgs::Gel(args) => (&args.file.out, gel(args)?),
        InputArgs::Grasp(args) => (&args.file.out, grasp::grasp(args)?),
        InputArgs::Loop(args) => return closed_loop::closed_loop(args, &progress),
    };
    progress.finish();
    let mut out = stdout().lock();
    writeln!(out, "{}: {contents}", path.display())?;
    Ok(out.flush()?)
}

fn markers(args: &MarkersArgs) -> Result<String, CliError> {
    args.file.check()?;
    let scene =
        MarkerScene { radius: args.radius, edge: args.edge, marker: args.marker, ground: args.ground };
    let (settings, pool) = (args.camera.settings(CameraSettings::tactile()), Threads::default().pool()?);
    let prepared = film_markers(&args.tracks, args.sensor, &scene, settings, args.camera.seed, &pool)?;
    args.file.write(prepared.file.into_bytes())?;
    Ok(prepared.contents)
}

fn images(args: &ImagesArgs) -> Result<String, CliError> {
    let with_causes = args.file.out.extension().is_some_and(|extension| extension == "safetensors");
    let format = Format::from_path(&args.file.out).ok().filter(|format| format.is_writable());
    if format.is_none() && !with_causes {
        let expected = "a file that ends in .aedat4, .csv, .npy, .dat, .es, .evt3, .raw or .safetensors";
        return Err(CliError::usage("--out", expected, &args.file.out.display().to_string()));
    }
    args.file.check()?;
    let images = ImageSequence::open(&args.images).map_err(RunError::from)?;
    let count = images.len();
    let (sensor, simulated) = film_images(
        images,
        args.interval,
        args.camera.settings(CameraSettings::default()),
        args.camera.seed,
    )?;
    let about = format!("{} events of {count} images, {sensor}", grouped(simulated.len() as u64));
    let Some(format) = format else {
        args.file.write(prepare::with_causes(sensor, &[simulated]).file.into_bytes())?;
        return Ok(format!("{about}, with their causes"));
    };
    let events: Vec<_> = simulated.iter().map(|simulated| simulated.event).collect();
    meissner_io::write(&args.file.out, format, Some(sensor), &events)
        .map_err(|error| RunError::recording(&args.file.out.display().to_string(), error))?;
    Ok(format!("{about}, as {format}"))
}

/// Seconds of one core for a tilt and a direction, bytes of a press's track, and of its events on
/// 346 x 260 pixels; measured in one run on a shared EPYC.
const DOME_SECONDS: f64 = 2.0;
const TRACK_BYTES: f64 = 31e3;
const FILM_BYTES: f64 = 2.6e6;

fn dome(args: &DomeArgs) -> Result<String, CliError> {
    args.file.check()?;
    let pool = Threads::default().pool()?;
    let planes = args.planes.map_or(DOME_KINDS, usize::from);
    let presses = u64::from(args.each) * planes as u64;
    let megabytes = |each: f64| grouped((presses as f64 * each / 1e6).ceil() as u64);
    tell(format_args!(
        "{} presses: about {} s of computing, {} MB; events that `simulate markers` films of them take about {} MB",
        grouped(presses),
        grouped((planes as f64 * DOME_SECONDS / pool.current_num_threads() as f64) as u64),
        megabytes(TRACK_BYTES),
        megabytes(FILM_BYTES),
    ));
    let prepared =
        dome_presses(args.planes.map(usize::from), args.each.into(), args.sensor, args.seed, &pool);
    args.file.write(prepared.file.into_bytes())?;
    Ok(prepared.contents)
}

fn gel(args: &GelArgs) -> Result<String, CliError> {
    args.file.check()?;
    let optics =
        args.optics.as_ref().map(|OpticsArg { path, name }| measured_optics(path, name)).transpose()?;
    let plan = GelPlan {
        sensor: args.sensor.fixed(),
        optics: optics.as_ref(),
        width_mm: args.width,
        shapes: match args.indenters {
            ShapesArg::Seen => Shapes::Seen,
            ShapesArg::Unseen => Shapes::Unseen,
            ShapesArg::Pins => Shapes::Pins,
            ShapesArg::Ridges => Shapes::Ridges,
            ShapesArg::Larger => Shapes::Larger,
            ShapesArg::LargerUnseen => Shapes::LargerUnseen,
            ShapesArg::Irregular => Shapes::Irregular,
        },
        force_n: args.newtons.0,
        saw_teeth: args.saw_teeth.into(),
        presses: args.presses as usize,
        pictures: args.pictures.into(),
        size: [args.size.width.into(), args.size.height.into()],
        coarseness: args.coarseness.into(),
        seed: args.seed,
    };
    let prepared = gel_presses(&plan, &Threads::default().pool()?).map_err(EvaluateError::from)?;
    args.file.write(prepared.file.into_bytes())?;
    Ok(prepared.contents)
}
