//! Frame engines.

use std::process;
use std::sync::OnceLock;

use meissner::frames::{FrameEngine, FrameOptions, Skip};

use crate::arguments::{Versioned, array, options, place, report_if_wanted, room, write_bytes};
use crate::engine::{meissner_layer_counters, meissner_prediction};
use crate::handles::{Handles, forked};
use crate::network::{NETWORKS, flag, meissner_network};
use crate::status::{Failure, call, meissner_status};

/// A network over frames, with its state. One thread at a time.
pub struct meissner_frames(());

static FRAMES: Handles<meissner_frames, Frames> = Handles::new(3, "frames");

struct Frames {
    engine: FrameEngine,
    two_threads: bool,
}

impl Frames {
    /// The engine, to compute with. The pool of threads belongs to the process that first used it.
    fn computing(&mut self) -> Result<&mut FrameEngine, Failure> {
        static POOL: OnceLock<u32> = OnceLock::new();
        if self.two_threads && *POOL.get_or_init(process::id) != process::id() {
            return Err(forked("frames"));
        }
        Ok(&mut self.engine)
    }
}

/// Values that no change reaches are kept: exact.
pub const MEISSNER_SKIP_EXACT: u32 = 0;
/// Everything is computed: the same results, as an oracle.
pub const MEISSNER_SKIP_NOTHING: u32 = 1;
/// Pixels that changed by no more than `tolerance` count as unchanged: an approximation.
pub const MEISSNER_SKIP_TOLERANCE: u32 = 2;

/// Options of a frame engine. 0 is the default of each.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct meissner_frames_options {
    /// `sizeof(meissner_frames_options)`.
    pub size: usize,
    /// Limit of the state in bytes; 0 for 4 GiB.
    pub memory_limit: u64,
    /// MEISSNER_SKIP_EXACT or another MEISSNER_SKIP constant.
    pub skip: u32,
    /// Used with MEISSNER_SKIP_TOLERANCE.
    pub tolerance: f32,
    /// 1 if frames are mostly zero, as frames of events are: the same results with more memory and
    /// less time.
    pub sparse: u32,
    /// 1 to share large layers between two threads: the same results.
    pub two_threads: u32,
}

// SAFETY: `repr(C)` with only numbers, the first of which is the size.
unsafe impl Versioned for meissner_frames_options {}

fn frame_options(options: meissner_frames_options) -> Result<FrameOptions, Failure> {
    let skip = match options.skip {
        MEISSNER_SKIP_EXACT => Skip::Exact,
        MEISSNER_SKIP_NOTHING => Skip::Nothing,
        MEISSNER_SKIP_TOLERANCE => Skip::Tolerance(options.tolerance),
        found => return Err(Failure::argument("skip", "0 to 2", found)),
    };
    let made = FrameOptions::new()
        .with_skip(skip)
        .with_sparse(flag(options.sparse, "sparse")?)
        .with_two_threads(flag(options.two_threads, "two_threads")?);
    Ok(if options.memory_limit == 0 { made } else { made.with_memory_limit(options.memory_limit.into()) })
}

/// Makes an engine for a frame network. `options` may be NULL. Allocates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_frames_new(
    network: *const meissner_network,
    options: *const meissner_frames_options,
    result: *mut *mut meissner_frames,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let (result, options) = unsafe { (place(result, "result")?, self::options(options, "options")?) };
        let (network, options) = (NETWORKS.get(network)?, frame_options(options)?);
        let two_threads = options.two_threads;
        let engine = FrameEngine::with_options(network.of_frames()?.clone(), options)?;
        result.write(FRAMES.add(Frames { engine, two_threads })?);
        Ok(())
    })
}

/// Pushes one or more whole frames, one after the other: `length` values in the order (frame,
/// channel, row, column). If any value is not finite, no frame is taken.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_frames_push(
    frames: *const meissner_frames,
    values: *const f32,
    length: usize,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let values = unsafe { array(values, length, "values") }?;
        FRAMES.with(frames, |frames| Ok(frames.computing()?.push_slice(values)?))
    })
}

/// Predicts after the last frame: writes the network's outputs in the order (channel, row, column)
/// to `values`, which has room for `length` values, and facts about the prediction to `prediction`,
/// which may be NULL. Nothing is computed if `length` is less than the number of outputs.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_frames_predict(
    frames: *const meissner_frames,
    values: *mut f32,
    length: usize,
    prediction: *mut meissner_prediction,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let (values, prediction) =
            unsafe { (room(values, length, "values")?, report_if_wanted(prediction, "prediction")?) };
        FRAMES.with(frames, |frames| {
            values.fits(frames.engine.network().output().values())?;
            let found = frames.computing()?.predict()?;
            let of = meissner_prediction {
                size: 0,
                t_us: 0,
                has_time: 0,
                nodes: found.frames,
                rows: 0,
                unlike: found.unlike.unwrap_or(f32::NAN),
            };
            values.copy(found.values)?;
            prediction.into_iter().for_each(|prediction| prediction.write(of));
            Ok(())
        })
    })
}

/// Sets the engine to the state before the first frame. Counters stay.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_frames_reset(frames: *const meissner_frames) -> meissner_status {
    call(|| FRAMES.act(frames, |frames| frames.engine.reset()))
}

/// Counts of pixels for each layer; `meissner_network_info` has the number of layers. Allocates
/// temporary memory.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_frames_layer_counters(
    frames: *const meissner_frames,
    layers: *mut meissner_layer_counters,
    length: usize,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let layers = unsafe { room(layers, length, "layers") }?;
        let counts: Vec<_> = FRAMES.with(frames, |frames| {
            let counts = frames.engine.counters().layers.iter();
            Ok(counts
                .map(|layer| meissner_layer_counters {
                    computed: layer.computed,
                    kept: layer.skipped + layer.absorbed,
                    unchanged: 0,
                })
                .collect())
        })?;
        layers.copy(&counts)
    })
}

/// Writes the state as bytes, as `meissner_engine_snapshot` does.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_frames_snapshot(
    frames: *const meissner_frames,
    bytes: *mut u8,
    capacity: usize,
    length: *mut usize,
) -> meissner_status {
    let state = || FRAMES.with(frames, |frames| Ok(frames.engine.to_bytes()));
    // SAFETY: the callers' rules at the top of the header.
    call(|| unsafe { write_bytes(bytes, capacity, "bytes", length, state) })
}

/// Sets the engine to the state of a snapshot of an engine with the same network and options.
/// Allocates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_frames_restore(
    frames: *const meissner_frames,
    bytes: *const u8,
    length: usize,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let bytes = unsafe { array(bytes, length, "bytes") }?;
        FRAMES.with(frames, |frames| Ok(frames.engine.restore_bytes(bytes)?))
    })
}

/// Ends a frame engine. Waits for the call of another thread that is using it.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_frames_release(frames: *mut meissner_frames) {
    FRAMES.release(frames);
}
