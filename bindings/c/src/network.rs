//! Networks: descriptions with weights, over events or over frames.

use std::ffi::{CString, c_char};
use std::path::Path;
use std::ptr;
use std::sync::{Arc, OnceLock};

use meissner::frames::{Convolution, FrameNetwork, FrameShape};
use meissner::kernels::WinogradTile;
use meissner::{AnyDescription, Card, ModelError, Network, Sensor, Weights};

use crate::arguments::{Versioned, array, options, place, place_if_wanted, report, text};
use crate::handles::Handles;
use crate::log::{warn, write_lines};
use crate::status::{Failure, Status, call, meissner_status};

/// A network with its weights. It does not change, and any number of threads and engines may use
/// it.
pub struct meissner_network(());

pub(crate) static NETWORKS: Handles<meissner_network, Arc<Loaded>> = Handles::new(1, "network");

/// The value behind a handle of a network.
pub(crate) struct Loaded {
    kind: Kind,
    name: CString,
    /// Name and unit of each output.
    outputs: Vec<[CString; 2]>,
    card: Card,
    warnings: Vec<String>,
}

enum Kind {
    Events(Arc<Network>),
    Frames(Arc<FrameNetwork>),
}

/// Convolutions of frame networks: exact sums.
pub const MEISSNER_CONVOLUTION_DIRECT: u32 = 0;
/// Winograd's method in tiles of 2 x 2 outputs: fewer products, with other rounding errors.
pub const MEISSNER_CONVOLUTION_WINOGRAD_2: u32 = 1;
/// Winograd's method in tiles of 4 x 4 outputs: still fewer products, and larger rounding errors.
pub const MEISSNER_CONVOLUTION_WINOGRAD_4: u32 = 2;

/// Options of a network. 0 is the default of each.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct meissner_network_options {
    /// `sizeof(meissner_network_options)`.
    pub size: usize,
    /// Length of the window in microseconds, instead of the description's. Networks over events
    /// only.
    pub span_us: i64,
    /// Maximum number of events in the window, instead of the description's. Networks over events
    /// only.
    pub capacity: u64,
    /// Maximum number of neighbours of an event, at most the description's: an approximation.
    /// Networks over events only.
    pub neighbours: u64,
    /// MEISSNER_CONVOLUTION_DIRECT or another MEISSNER_CONVOLUTION constant. Frame networks only.
    pub convolution: u32,
    /// 1 to take weights that were trained on other graphs or frames than the description's.
    pub ignore_preparation: u32,
}

// SAFETY: `repr(C)` with only integers, the first of which is the size.
unsafe impl Versioned for meissner_network_options {}

/// A network over events.
pub const MEISSNER_EVENTS: u32 = 1;
/// A frame network.
pub const MEISSNER_FRAMES: u32 = 2;

/// Facts about a network. The name belongs to the network.
#[repr(C)]
#[derive(Clone, Copy, Debug)]
pub struct meissner_network_info {
    /// `sizeof(meissner_network_info)`, set by the caller.
    pub size: usize,
    /// Name of the description.
    pub name: *const c_char,
    /// MEISSNER_EVENTS or MEISSNER_FRAMES.
    pub kind: u32,
    /// 1 if the weights were trained, 0 if they were drawn from a seed, -1 if they do not say.
    pub trained: i32,
    /// Number of values of a prediction.
    pub outputs: u64,
    /// Length of the window in microseconds; 0 for frame networks.
    pub span_us: i64,
    /// Maximum number of events in the window; 0 for frame networks.
    pub capacity: u64,
    /// Number of layers that are counted.
    pub layers: u64,
    /// The weights were trained on every `stride`-th event: push the same share. At least 1.
    pub stride: u64,
    /// Columns of the training's sensor; 0 if the weights do not say.
    pub sensor_width: u16,
    /// Rows of the training's sensor; 0 if the weights do not say.
    pub sensor_height: u16,
    /// Shape of a frame, for frame networks; a vector has a height and width of 1.
    pub input_channels: u32,
    /// Rows of a frame.
    pub input_height: u32,
    /// Columns of a frame.
    pub input_width: u32,
    /// Shape of a prediction, for frame networks.
    pub output_channels: u32,
    /// Rows of a prediction.
    pub output_height: u32,
    /// Columns of a prediction.
    pub output_width: u32,
}

// SAFETY: `repr(C)` with only integers and a pointer, the first of which is the size.
unsafe impl Versioned for meissner_network_info {}

impl Kind {
    fn new(
        description: &AnyDescription,
        weights: &Weights,
        options: &meissner_network_options,
    ) -> Result<Self, Failure> {
        let regardless = flag(options.ignore_preparation, "ignore_preparation")?;
        match description {
            AnyDescription::Events(description) => {
                only(options.convolution == 0, "convolution", "a frame network")?;
                let mut network = if regardless {
                    description.network_ignoring_preparation(weights)?
                } else {
                    description.network(weights)?
                };
                if options.span_us != 0 {
                    network = network.with_span_us(options.span_us)?;
                }
                if options.capacity != 0 {
                    network = network.with_capacity(number(options.capacity, "capacity")?)?;
                }
                if options.neighbours != 0 {
                    network = network.with_neighbours(number(options.neighbours, "neighbours")?)?;
                }
                Ok(Self::Events(Arc::new(network)))
            }
            AnyDescription::Frames(description) => {
                let of_events = [
                    (options.span_us == 0, "span_us"),
                    (options.capacity == 0, "capacity"),
                    (options.neighbours == 0, "neighbours"),
                ];
                of_events.into_iter().try_for_each(|(is, what)| only(is, what, "a network over events"))?;
                let parts = if regardless {
                    description.network_parts_regardless(weights)?
                } else {
                    description.network_parts(weights)?
                };
                let convolution = match options.convolution {
                    MEISSNER_CONVOLUTION_DIRECT => Convolution::Direct,
                    MEISSNER_CONVOLUTION_WINOGRAD_2 => Convolution::Winograd(WinogradTile::Two),
                    MEISSNER_CONVOLUTION_WINOGRAD_4 => Convolution::Winograd(WinogradTile::Four),
                    found => return Err(Failure::argument("convolution", "0 to 2", found)),
                };
                Ok(Self::Frames(Arc::new(FrameNetwork::new(parts, convolution)?)))
            }
        }
    }
}

impl Loaded {
    fn new(
        description: &AnyDescription,
        weights: &Weights,
        options: &meissner_network_options,
    ) -> Result<Self, Failure> {
        let kind = Kind::new(description, weights, options)?;
        let (names, units) = description.outputs();
        let outputs = names.iter().zip(units).map(|(name, unit)| [c_string(name), c_string(unit)]);
        let (name, card) = (description.name(), weights.card()?);
        let mut warnings = Vec::new();
        if card.trained == Some(false) {
            warnings.push(format!("{name}: the weights are drawn from a seed; predictions mean nothing"));
        }
        if options.ignore_preparation != 0 && card.preparation != description.preparation() {
            warnings.push(format!("{name}: the weights may have been trained on other graphs or frames"));
        }
        warnings.iter().for_each(|text| warn(text));
        Ok(Self { kind, name: c_string(name), outputs: outputs.collect(), card, warnings })
    }

    /// The warning about a sensor that is not the training's.
    pub(crate) fn warning_of_sensor(&self, sensor: Sensor) -> Option<String> {
        let trained = self.card.sensor.filter(|&trained| trained != sensor)?;
        let name = self.name.to_string_lossy();
        Some(format!("{name}: the weights were trained on a sensor of {trained}, not {sensor}"))
    }

    /// The warnings from when the network was made.
    pub(crate) fn warnings(&self) -> &[String] {
        &self.warnings
    }

    /// The network over events. Refuses a frame network.
    pub(crate) fn of_events(&self) -> Result<&Arc<Network>, Failure> {
        match &self.kind {
            Kind::Events(network) => Ok(network),
            Kind::Frames(_) => Err(self.wrong("a network over events", "a frame network")),
        }
    }

    /// The frame network. Refuses a network over events.
    pub(crate) fn of_frames(&self) -> Result<&Arc<FrameNetwork>, Failure> {
        match &self.kind {
            Kind::Frames(network) => Ok(network),
            Kind::Events(_) => Err(self.wrong("a frame network", "a network over events")),
        }
    }

    fn wrong(&self, expected: &str, found: &str) -> Failure {
        let text = format!("expected {expected}, found {}, {found}", self.name.to_string_lossy());
        Failure::new(Status::MEISSNER_WRONG_NETWORK, text)
    }

    fn info(&self) -> meissner_network_info {
        let Card { trained, stride, sensor, .. } = &self.card;
        let sensor = sensor.unwrap_or(Sensor::new(0, 0));
        let mut info = meissner_network_info {
            size: 0,
            name: self.name.as_ptr(),
            kind: MEISSNER_EVENTS,
            trained: trained.map_or(-1, i32::from),
            outputs: self.outputs.len() as u64,
            span_us: 0,
            capacity: 0,
            layers: 0,
            stride: *stride as u64,
            sensor_width: sensor.width,
            sensor_height: sensor.height,
            input_channels: 0,
            input_height: 0,
            input_width: 0,
            output_channels: 0,
            output_height: 0,
            output_width: 0,
        };
        match &self.kind {
            Kind::Events(network) => {
                info.outputs = network.outputs() as u64;
                info.span_us = network.parts().span_us;
                info.capacity = network.parts().capacity as u64;
                info.layers = network.layers().len() as u64;
            }
            Kind::Frames(network) => {
                info.kind = MEISSNER_FRAMES;
                info.outputs = network.output().values() as u64;
                info.layers = network.layers().count() as u64;
                [info.input_channels, info.input_height, info.input_width] = shape(network.input());
                [info.output_channels, info.output_height, info.output_width] = shape(network.output());
            }
        }
        info
    }
}

/// Refuses an option that networks of this kind do not have.
fn only(is: bool, what: &str, kind: &str) -> Result<(), Failure> {
    if is { Ok(()) } else { Err(Failure::argument(what, format!("0 unless it is {kind}"), "another value")) }
}

pub(crate) fn flag(value: u32, what: &str) -> Result<bool, Failure> {
    match value {
        0 | 1 => Ok(value == 1),
        found => Err(Failure::argument(what, "0 or 1", found)),
    }
}

/// A count as the library takes it. A count that only fits an unsigned number of 64 bits is refused
/// here: it would become negative.
pub(crate) fn number(count: u64, what: &str) -> Result<usize, Failure> {
    let fits = i64::try_from(count).ok().and_then(|count| usize::try_from(count).ok());
    fits.ok_or_else(|| Failure::argument(what, format!("at most {}", isize::MAX), count))
}

fn shape(shape: FrameShape) -> [u32; 3] {
    match shape {
        FrameShape::Vector(values) => [values as u32, 1, 1],
        FrameShape::Image { channels, height, width } => [channels, height, width].map(|size| size as u32),
    }
}

fn c_string(text: &str) -> CString {
    CString::new(text.replace('\0', " ")).unwrap_or_default()
}

/// Makes a network. `network` is the name of a network that comes with the library
/// ("tactigraph-past"), or the path of a description. `weights` is the path of a safetensors file
/// or of a PyTorch state dict; NULL for the weights that come with the library. `options` may be
/// NULL. Allocates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_network_open(
    network: *const c_char,
    weights: *const c_char,
    options: *const meissner_network_options,
    result: *mut *mut meissner_network,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let (result, name, options) = unsafe {
            (place(result, "result")?, text(network, "network")?, self::options(options, "options")?)
        };
        // SAFETY: as above.
        let weights = if weights.is_null() { None } else { Some(unsafe { text(weights, "weights") }?) };
        let description = match AnyDescription::shipped(name) {
            Some(description) => description,
            None if Path::new(name).exists() => AnyDescription::load(name)?,
            None => {
                let expected =
                    "the name of a network that comes with the library, or the path of a description";
                let text = format!("network: expected {expected}, found {name:?}");
                return Err(Failure::new(Status::MEISSNER_NOT_FOUND, text));
            }
        };
        let weights = match weights {
            Some(path) => Weights::load(path)?,
            None => Weights::shipped(name).ok_or_else(|| {
                let text = match Weights::left_out(name) {
                    Some(error) => error.to_string(),
                    None => format!("weights: expected a path, as {name} comes without, found NULL"),
                };
                Failure::new(Status::MEISSNER_NOT_FOUND, text)
            })?,
        };
        result.write(NETWORKS.add(Arc::new(Loaded::new(&description, &weights, &options)?))?);
        Ok(())
    })
}

/// Makes a network from the text of a description and the bytes of a weights file. `options` may be
/// NULL. Allocates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_network_from_bytes(
    description: *const c_char,
    description_length: usize,
    weights: *const u8,
    weights_length: usize,
    options: *const meissner_network_options,
    result: *mut *mut meissner_network,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let (result, description, weights, options) = unsafe {
            (
                place(result, "result")?,
                array(description.cast::<u8>(), description_length, "description")?,
                array(weights, weights_length, "weights")?,
                self::options(options, "options")?,
            )
        };
        let description = std::str::from_utf8(description).map_err(|error| {
            Failure::argument("description", "UTF-8", format!("other bytes at {}", error.valid_up_to()))
        })?;
        let description = AnyDescription::parse(description).map_err(ModelError::from)?;
        let weights = Weights::from_bytes(weights).map_err(ModelError::from)?;
        result.write(NETWORKS.add(Arc::new(Loaded::new(&description, &weights, &options)?))?);
        Ok(())
    })
}

/// Facts about a network.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_network_describe(
    network: *const meissner_network,
    info: *mut meissner_network_info,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let info = unsafe { report(info, "info") }?;
        info.write(NETWORKS.get(network)?.info());
        Ok(())
    })
}

/// The name of value `index` of a prediction, and its unit. Either pointer may be NULL. The strings
/// belong to the network. The values of an image have one name.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_network_output(
    network: *const meissner_network,
    index: usize,
    name: *mut *const c_char,
    unit: *mut *const c_char,
) -> meissner_status {
    call(|| {
        // SAFETY: the callers' rules at the top of the header.
        let (name, unit) = unsafe { (place_if_wanted(name, "name")?, place_if_wanted(unit, "unit")?) };
        let outputs = &NETWORKS.get(network)?.outputs;
        let refused = || Failure::argument("index", format!("less than {}", outputs.len()), index);
        let [first, second] = outputs.get(index).ok_or_else(refused)?;
        name.into_iter().for_each(|name| name.write(first.as_ptr()));
        unit.into_iter().for_each(|unit| unit.write(second.as_ptr()));
        Ok(())
    })
}

/// Writes the warnings about a network to `text`, one on each line, and the number of bytes with
/// the NUL at the end to `length`. `text` has room for `capacity` bytes. The warnings are about
/// weights that were drawn from a seed, or trained on other graphs or frames. If there is too
/// little room, only `length` is written: call with a `capacity` of 0 to get it. Allocates.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_network_warnings(
    network: *const meissner_network,
    text: *mut c_char,
    capacity: usize,
    length: *mut usize,
) -> meissner_status {
    call(|| {
        let lines = || Ok(NETWORKS.get(network)?.warnings().to_vec());
        // SAFETY: the callers' rules at the top of the header.
        unsafe { write_lines(text, capacity, length, lines) }
    })
}

/// The name of network `index` among those that come with the library, or NULL after the last. The
/// pointer stays valid.
#[unsafe(no_mangle)]
pub extern "C" fn meissner_shipped_network(index: usize) -> *const c_char {
    static NAMES: OnceLock<Vec<CString>> = OnceLock::new();
    let names = NAMES.get_or_init(|| AnyDescription::shipped_names().map(c_string).collect());
    names.get(index).map_or(ptr::null(), |name| name.as_ptr())
}

/// Ends a network. Its engines keep working.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn meissner_network_release(network: *mut meissner_network) {
    NETWORKS.release(network);
}
