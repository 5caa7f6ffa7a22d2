//! The engine over frames.

use std::sync::Arc;

use meissner::frames::{Convolution, FrameEngine as Engine, FrameNetwork, FrameOptions, Skip};
use numpy::{PyArrayMethods, PyReadonlyArrayDyn, PyUntypedArrayMethods};
use pyo3::prelude::*;
use pyo3::types::{PyBytes, PyDict};

use crate::arrays::contiguous;
use crate::description::{Description, shape};
use crate::error::{Failure, Outcome};
use crate::methods::{engine_methods, html_table};
use crate::prediction::{self, Outputs, Prediction};
use crate::representations::EventFrame;
use crate::threads::{on_own_threads, turn};
use crate::warned;
use crate::weights::Weights;

/// A network over frames with its recurrent state. It does not recompute values that no change
/// reaches.
///
/// Frames of a gel, for `canf` and similar networks, are (3, height, width): red, green and blue,
/// each ((picture - rest) / 255 - mean) / std, with the picture `rest` without contact, and mean
/// and std of the description. A prediction times `force_std` plus `force_mean` is the force on
/// each pixel in N.
///
/// - `network`, `weights`: as for `Engine`.
/// - `skip`: "exact", "nothing" (the oracle), or the change up to which a pixel keeps its values.
/// - `sparse`: frames are mostly zero: the answer to zeros is stored. The bits are the same.
/// - `two_threads`: two threads share large maps. The bits are the same.
/// - `memory_limit`: maximum bytes of activations and state.
/// - `check_preparation`: False to run weights that were trained with another preparation.
///
/// `copy.copy(engine)` is an independent engine in the same state. `len(engine)` is the number of
/// frames since the last reset.
///
/// Raises `DescriptionError`, `WeightsError`, `InputError`, `MemoryLimitError`.
#[pyclass(module = "meissner", name = "FrameEngine", weakref)]
#[derive(Clone)]
pub(crate) struct FrameEngine {
    pub(crate) engine: Engine,
    pub(crate) outputs: Arc<Outputs>,
    pub(crate) description: Description,
    frame: Vec<f32>,
    taken: u64,
    pub(crate) two_threads: bool,
}

/// The kind of skipping with this name, or up to this tolerance.
fn skip_of(skip: &Bound<'_, PyAny>) -> Outcome<Skip> {
    if let Ok(tolerance) = skip.extract::<f32>() {
        return Ok(Skip::Tolerance(tolerance));
    }
    match skip.extract::<String>().as_deref() {
        Ok("exact") => Ok(Skip::Exact),
        Ok("nothing") => Ok(Skip::Nothing),
        _ => {
            let found = skip.repr()?;
            Err(Failure::input(format!("skip: expected \"exact\", \"nothing\" or a number, found {found}")))
        }
    }
}

/// Frames of shape `expected`, one or several, as contiguous finite float32.
pub(crate) fn checked<'py>(
    frames: &Bound<'py, PyAny>,
    expected: &[usize],
) -> Outcome<PyReadonlyArrayDyn<'py, f32>> {
    let array = contiguous("frame", frames)?;
    let found = array.shape();
    let in_front = found.len() == expected.len() + 1;
    if found != expected && !(in_front && found[1..] == *expected) {
        return Err(Failure::input(format!(
            "frame: expected shape {expected:?}, or several frames with one more axis in front, found {found:?}"
        )));
    }
    let array = array.try_readonly().map_err(PyErr::from)?;
    let values = array.as_slice().map_err(PyErr::from)?;
    if let Some(at) = values.iter().position(|value| !value.is_finite()) {
        let found = values[at];
        return Err(Failure::input(format!("frame: expected finite values, found {found} as value {at}")));
    }
    Ok(array)
}

/// Frames since the last reset. A copy predicts, so that no counter of `engine` changes.
fn taken(engine: &Engine, two_threads: bool) -> Outcome<u64> {
    let count = || engine.clone().predict().map_or(0, |prediction| prediction.frames);
    if two_threads { on_own_threads(count) } else { Ok(count()) }
}

impl FrameEngine {
    pub(crate) fn new_from(
        engine: Engine,
        outputs: &Arc<Outputs>,
        description: &Description,
        two_threads: bool,
    ) -> Outcome<Self> {
        let taken = taken(&engine, two_threads)?;
        let (outputs, description) = (Arc::clone(outputs), description.clone());
        Ok(Self { engine, outputs, description, frame: Vec::new(), taken, two_threads })
    }

    /// Runs `work` on the engine without the interpreter.
    fn compute<R: Send>(
        &mut self,
        py: Python<'_>,
        work: impl FnOnce(&mut Engine, &[f32]) -> R + Send,
    ) -> Outcome<R> {
        let Self { engine, frame, two_threads, .. } = self;
        py.detach(
            || if *two_threads { on_own_threads(|| work(engine, frame)) } else { Ok(work(engine, frame)) },
        )
    }

    /// Shapes of a frame and of a prediction.
    pub(crate) fn shapes(&self) -> [Vec<usize>; 2] {
        let network = self.engine.network();
        [network.input(), network.output()].map(shape)
    }

    fn push_frames(&mut self, py: Python<'_>, frames: &Bound<'_, PyAny>) -> Outcome<()> {
        let [expected, _] = self.shapes();
        let values = checked(frames, &expected)?;
        let values = values.as_slice().map_err(PyErr::from)?;
        for frame in values.chunks_exact(expected.iter().product::<usize>().max(1)) {
            self.frame.clear();
            self.frame.extend_from_slice(frame);
            self.push_taken(py, 1)?;
        }
        Ok(())
    }

    /// Pushes the content of `self.frame` `count` times.
    fn push_taken(&mut self, py: Python<'_>, count: u64) -> Outcome<()> {
        for _ in 0..count {
            self.compute(py, Engine::push)??;
            self.taken += 1;
            py.check_signals()?;
        }
        Ok(())
    }
}

engine_methods!(FrameEngine);

#[pymethods]
impl FrameEngine {
    #[new]
    #[pyo3(signature = (network, weights=None, *, skip=None, sparse=false, two_threads=false, memory_limit=1 << 32, check_preparation=true))]
    fn new(
        network: &Bound<'_, PyAny>,
        weights: Option<&Bound<'_, PyAny>>,
        skip: Option<&Bound<'_, PyAny>>,
        sparse: bool,
        two_threads: bool,
        memory_limit: u128,
        check_preparation: bool,
    ) -> Outcome<Self> {
        let description = Description::of(network)?;
        let frames = description.frames()?;
        let weights = Weights::of(weights, &description)?;
        let parts = if check_preparation {
            frames.network_parts(&weights)?
        } else {
            frames.network_parts_regardless(&weights)?
        };
        let frame_network = FrameNetwork::new(parts, Convolution::Direct)?;
        warned::of_network(network.py(), &description, &weights, None, None)?;
        let options = FrameOptions::new()
            .with_skip(skip.map(skip_of).transpose()?.unwrap_or_default())
            .with_sparse(sparse)
            .with_two_threads(two_threads)
            .with_memory_limit(memory_limit);
        let outputs = Outputs::new(&description.any, frame_network.layers());
        Ok(Self {
            engine: Engine::with_options(frame_network, options)?,
            outputs,
            description,
            frame: Vec::new(),
            taken: 0,
            two_threads,
        })
    }

    /// Takes the next frame, of shape `input_shape`, or several with one more axis in front.
    ///
    /// Frames of contiguous float32 are read in place; others are converted. A run of equal frames
    /// (`EventFrame`) is taken as often as its `count` states. Other threads run meanwhile, and
    /// Ctrl-C raises `KeyboardInterrupt` between two frames.
    ///
    /// Raises `InputError` for another shape or infinite values before the first frame;
    /// `DtypeError`.
    fn push(slf: &Bound<'_, Self>, py: Python<'_>, frames: &Bound<'_, PyAny>) -> Outcome<()> {
        let mut this = turn(slf)?;
        if let Ok(frame) = frames.cast::<EventFrame>() {
            let frame = frame.get();
            this.push_frames(py, frame.values.bind(py))?;
            return this.push_taken(py, frame.count - 1);
        }
        this.push_frames(py, frames)
    }

    /// The prediction after the last frame, at first for a frame of zeros. Raises
    /// `NotANumberError`.
    fn predict(slf: &Bound<'_, Self>, py: Python<'_>) -> Outcome<Prediction> {
        let mut this = turn(slf)?;
        let (values, frames, unlike) =
            this.compute(py, |engine, _| engine.predict().map(|p| (p.values.to_vec(), p.frames, p.unlike)))??;
        let [_, shape] = this.shapes();
        Prediction::new(py, &values, Some(&shape), (None, frames, unlike), &[], &this.outputs)
    }

    /// Writes the prediction to `out`, a writable contiguous array of float32 with as many values.
    ///
    /// Raises `InputError`, `DtypeError`, `NotANumberError`.
    fn predict_into(slf: &Bound<'_, Self>, py: Python<'_>, out: &Bound<'_, PyAny>) -> Outcome<()> {
        let mut this = turn(slf)?;
        let out = prediction::out(out, this.shapes()[1].iter().product())?;
        this.compute(py, |engine, _| engine.predict().map(|_| ()))??;
        // Nothing is left to compute.
        out.write(this.engine.predict()?.values)
    }

    /// Returns to the state before the first frame. Counters are kept.
    fn reset(slf: &Bound<'_, Self>) -> Outcome<()> {
        let mut this = turn(slf)?;
        this.engine.reset();
        this.taken = 0;
        Ok(())
    }

    /// The state as bytes, for `restore` in this or another process.
    fn snapshot<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> Outcome<Bound<'py, PyBytes>> {
        let this = turn(slf)?;
        Ok(PyBytes::new(py, &this.engine.to_bytes()))
    }

    /// Returns to the state of `snapshot`, which an engine with the same network and options made.
    ///
    /// Raises `SnapshotError`; the state is then unchanged.
    fn restore(slf: &Bound<'_, Self>, snapshot: &[u8]) -> Outcome<()> {
        let mut this = turn(slf)?;
        this.engine.restore_bytes(snapshot)?;
        this.taken = taken(&this.engine, this.two_threads)?;
        Ok(())
    }

    /// Counts: frames, predictions, and for each layer the pixels computed, skipped and absorbed.
    #[getter]
    fn counters<'py>(slf: &Bound<'_, Self>, py: Python<'py>) -> PyResult<Bound<'py, PyDict>> {
        let this = turn(slf)?;
        let of = this.engine.counters();
        let (dict, layers) = (PyDict::new(py), PyDict::new(py));
        dict.set_item("frames", of.frames)?;
        dict.set_item("predictions", of.predictions)?;
        for (name, layer) in this.outputs.layers.iter().zip(&of.layers) {
            let counts =
                [("computed", layer.computed), ("skipped", layer.skipped), ("absorbed", layer.absorbed)];
            layers.set_item(name, crate::arrays::counts(py, &counts)?)?;
        }
        dict.set_item("layers", layers)?;
        Ok(dict)
    }

    /// Shape of a frame: (channels, height, width) or (values,).
    #[getter]
    fn input_shape(slf: &Bound<'_, Self>) -> Outcome<Vec<usize>> {
        let [input, _] = turn(slf)?.shapes();
        Ok(input)
    }

    /// Shape of a prediction.
    #[getter]
    fn output_shape(slf: &Bound<'_, Self>) -> Outcome<Vec<usize>> {
        let [_, output] = turn(slf)?.shapes();
        Ok(output)
    }

    /// Whether a prediction depends on earlier frames than the last.
    #[getter]
    fn has_state(slf: &Bound<'_, Self>) -> Outcome<bool> {
        let this = turn(slf)?;
        Ok(this.engine.network().has_state())
    }

    /// Bytes of activations and state.
    #[getter]
    fn state_bytes(slf: &Bound<'_, Self>) -> Outcome<usize> {
        let this = turn(slf)?;
        Ok(this.engine.state_bytes())
    }

    fn __len__(slf: &Bound<'_, Self>) -> Outcome<usize> {
        let this = turn(slf)?;
        Ok(this.taken as usize)
    }

    fn _repr_html_(slf: &Bound<'_, Self>) -> Outcome<String> {
        let this = turn(slf)?;
        let network = this.engine.network();
        let rows = [
            ["frames".to_owned(), format!("{} ({:?})", network.input(), this.shapes()[0])],
            ["predicts".to_owned(), this.outputs.labels()],
            ["frames since the last reset".to_owned(), this.taken.to_string()],
            ["state".to_owned(), format!("{} bytes", this.engine.state_bytes())],
        ];
        Ok(html_table(&format!("FrameEngine {:?}", network.name()), &rows))
    }

    fn __repr__(slf: &Bound<'_, Self>) -> Outcome<String> {
        let this = turn(slf)?;
        let network = this.engine.network();
        let (name, input, labels) = (network.name(), network.input(), this.outputs.labels());
        Ok(format!("<FrameEngine {name:?} over {input}: {} frames, predicts {labels}>", this.taken))
    }
}
