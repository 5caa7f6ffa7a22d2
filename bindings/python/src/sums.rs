//! Sums of a spline convolution over in-edges, and their gradient, for trainings on a processor.
//!
//! Input: the values of rows, and the in-edges of a level in the form of `meissner.torch`. Output:
//! S(s, c) of each row as `kernels/src/spline.rs` defines it, and the gradient of the values for a
//! gradient of S. PyTorch needs a gather, a batched product and a scatter for these, and an
//! intermediate array with the values of all in-edges.
//!
//! Every sum has a fixed order, so that the number of threads changes no bit.
#![allow(
    clippy::inline_always,
    reason = "what is not inlined into an instruction set's wrapper misses its instructions"
)]

use std::ops::Range;

use meissner::kernels::{Isa, LANES, Lanes, Simd, Task, Vector, spline_basis};
use numpy::{
    IntoPyArray, PyArray2, PyArrayMethods, PyReadonlyArray2, PyReadonlyArray3, PyUntypedArrayMethods,
};
use pyo3::prelude::*;
use rayon::prelude::*;

use crate::error::{Failure, Outcome};
use crate::threads::on_own_threads;

/// Rows that one thread sums at a time.
const PART: usize = 4096;

/// In-edges of rows: `k` entries for each, some of which are empty.
#[derive(Clone, Copy)]
struct Edges<'a> {
    k: usize,
    /// (rows, k): rows that are read.
    source: &'a [i64],
    /// (rows, k): whether there is such an in-edge.
    there: &'a [bool],
    /// (rows, k, 3), from 0 to 1.
    attribute: &'a [f32],
    kernel: [usize; 3],
}

/// The slots of a kernel that an in-edge touches, with their weights.
type Corners = [(usize, f32); 8];

impl<'a> Edges<'a> {
    fn new(
        source: &'a PyReadonlyArray2<'_, i64>,
        there: &'a PyReadonlyArray2<'_, bool>,
        attribute: &'a PyReadonlyArray3<'_, f32>,
        kernel: [usize; 3],
        rows: usize,
    ) -> Outcome<Self> {
        let k = source.shape()[1];
        let edges = Self {
            k,
            source: source.as_slice().map_err(PyErr::from)?,
            there: there.as_slice().map_err(PyErr::from)?,
            attribute: attribute.as_slice().map_err(PyErr::from)?,
            kernel,
        };
        let fits = there.shape() == source.shape() && attribute.shape() == [source.shape()[0], k, 3];
        if !fits || kernel.contains(&0) {
            return Err(Failure::input("in-edges: expected arrays of (rows, k), (rows, k) and (rows, k, 3)"));
        }
        match edges.source.iter().find(|&&source| source < 0 || source as usize >= rows) {
            Some(found) => Err(Failure::input(format!("source: expected 0 to {rows}, found {found}"))),
            None => Ok(edges),
        }
    }

    fn slots(&self) -> usize {
        self.kernel.iter().product()
    }

    /// The in-edges of `rows`.
    #[inline(always)]
    fn of(self, rows: Range<usize>) -> impl Iterator<Item = usize> {
        (rows.start * self.k..rows.end * self.k).filter(move |&edge| self.there[edge])
    }

    /// Open B-splines of degree 1 (`SplineCNN`, Fey et al. 2018, Eq. 2).
    #[inline(always)]
    fn corners(self, edge: usize) -> Corners {
        let mut corners = [(0, 1.0); 8];
        let mut stride = 1;
        for (axis, size) in self.kernel.into_iter().enumerate() {
            let place = self.attribute[3 * edge + axis] * (size - 1) as f32;
            let first = (place as usize).min(size.saturating_sub(2));
            let upper = place - first as f32;
            for (i, (slot, weight)) in corners.iter_mut().enumerate() {
                let is_upper = i >> axis & 1 == 1;
                // An axis with one slot is ignored: the weight of its second corner is 0.
                *slot += stride * (first + usize::from(is_upper && size > 1));
                *weight *= if is_upper { upper } else { 1.0 - upper };
            }
            stride *= size;
        }
        corners
    }

    /// The row that each in-edge of a row reads, with its weights of a kernel of 2 x 2 x 2.
    #[inline(always)]
    fn read(self, row: usize, read: &mut Vec<(usize, Lanes)>) {
        read.clear();
        read.extend(self.of(row..row + 1).map(|edge| {
            let u = &self.attribute[3 * edge..][..3];
            (self.source[edge] as usize, spline_basis([u[0], u[1], u[2]]))
        }));
    }
}

/// S of the rows from `first` on.
struct Sums<'a> {
    edges: Edges<'a>,
    values: &'a [f32],
    channels: usize,
    first: usize,
    sums: &'a mut [f32],
}

impl Task for Sums<'_> {
    type Output = ();

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) {
        let Self { edges, values, channels, .. } = self;
        let mut read = Vec::with_capacity(edges.k);
        for (row, sums) in self.sums.chunks_exact_mut(edges.slots() * channels).enumerate() {
            let row = self.first + row;
            if edges.kernel == [2; 3] {
                edges.read(row, &mut read);
                let mut c = 0;
                while S::WIDE && c + 2 * LANES <= channels {
                    sum_of_slots::<S, S::V16>(simd, &read, &values[c..], channels, &mut sums[c..]);
                    c += 2 * LANES;
                }
                while c + LANES <= channels {
                    sum_of_slots::<S, S::V8>(simd, &read, &values[c..], channels, &mut sums[c..]);
                    c += LANES;
                }
                for c in c..channels {
                    let mut slots = S::V8::splat(simd, 0.0);
                    for (source, basis) in &read {
                        let value = S::V8::splat(simd, values[source * channels + c]);
                        slots = slots.add_product(S::V8::load(simd, basis), value);
                    }
                    let mut found = Lanes::ZERO;
                    slots.store(&mut found);
                    sums[c..].iter_mut().step_by(channels).zip(found.0).for_each(|(sum, slot)| *sum = slot);
                }
            } else {
                for edge in edges.of(row..row + 1) {
                    let values = &values[edges.source[edge] as usize * channels..][..channels];
                    for (slot, weight) in edges.corners(edge) {
                        let sums = &mut sums[slot * channels..][..channels];
                        sums.iter_mut().zip(values).for_each(|(sum, value)| *sum += weight * value);
                    }
                }
            }
        }
    }
}

/// The eight slots of the channels of one vector.
#[inline(always)]
fn sum_of_slots<S: Simd, V: Vector<S>>(
    simd: S,
    read: &[(usize, Lanes)],
    values: &[f32],
    channels: usize,
    sums: &mut [f32],
) {
    let mut slots = [V::splat(simd, 0.0); 8];
    for (source, basis) in read {
        let value = V::load_slice(simd, &values[source * channels..]);
        for (slot, weight) in slots.iter_mut().zip(basis.0) {
            *slot = slot.add_product(V::splat(simd, weight), value);
        }
    }
    for (slot, sum) in slots.into_iter().enumerate() {
        sum.store_slice(&mut sums[slot * channels..]);
    }
}

/// The gradient of the values from the row `low` on, for a gradient of S in some rows from `first`
/// on.
struct Gradient<'a> {
    edges: Edges<'a>,
    gradients: &'a [f32],
    channels: usize,
    first: usize,
}

impl Task for Gradient<'_> {
    type Output = (usize, Vec<f32>);

    #[inline(always)]
    fn run<S: Simd>(self, simd: S) -> (usize, Vec<f32>) {
        let Self { edges, gradients, channels, first } = self;
        let width = edges.slots() * channels;
        let rows = first..first + gradients.len() / width;
        let sources = || edges.of(rows.clone()).map(|edge| edges.source[edge] as usize);
        let Some((low, high)) = sources().min().zip(sources().max()) else { return (0, Vec::new()) };
        let mut found = vec![0.0; (high + 1 - low) * channels];
        let mut read = Vec::with_capacity(edges.k);
        for (row, gradients) in rows.clone().zip(gradients.chunks_exact(width)) {
            if edges.kernel == [2; 3] && channels.is_multiple_of(LANES) {
                edges.read(row, &mut read);
                for (source, _) in &mut read {
                    *source -= low;
                }
                let mut c = 0;
                while S::WIDE && c + 2 * LANES <= channels {
                    share_of_slots::<S, S::V16>(simd, &read, &gradients[c..], channels, &mut found[c..]);
                    c += 2 * LANES;
                }
                while c < channels {
                    share_of_slots::<S, S::V8>(simd, &read, &gradients[c..], channels, &mut found[c..]);
                    c += LANES;
                }
            } else {
                for edge in edges.of(row..row + 1) {
                    let found = &mut found[(edges.source[edge] as usize - low) * channels..][..channels];
                    for (slot, weight) in edges.corners(edge) {
                        let gradients = &gradients[slot * channels..][..channels];
                        found.iter_mut().zip(gradients).for_each(|(sum, gradient)| *sum += weight * gradient);
                    }
                }
            }
        }
        (low, found)
    }
}

/// Adds to each read value its share of the gradients of eight slots, in the channels of one
/// vector.
#[inline(always)]
fn share_of_slots<S: Simd, V: Vector<S>>(
    simd: S,
    read: &[(usize, Lanes)],
    gradients: &[f32],
    channels: usize,
    found: &mut [f32],
) {
    let slots: [V; 8] = std::array::from_fn(|slot| V::load_slice(simd, &gradients[slot * channels..]));
    for (source, basis) in read {
        let found = &mut found[source * channels..];
        // Two sums, so that a product need not wait for the previous one.
        let mut sums = [V::load_slice(simd, found), V::splat(simd, 0.0)];
        for (i, (slot, weight)) in slots.iter().zip(basis.0).enumerate() {
            sums[i % 2] = sums[i % 2].add_product(V::splat(simd, weight), *slot);
        }
        sums[0].add(sums[1]).store_slice(found);
    }
}

/// (rows, slots x channels): the values (any, channels) of in-edges, summed per kernel slot.
#[pyfunction]
pub(crate) fn _spline_sums<'py>(
    py: Python<'py>,
    values: PyReadonlyArray2<'py, f32>,
    source: PyReadonlyArray2<'py, i64>,
    there: PyReadonlyArray2<'py, bool>,
    attribute: PyReadonlyArray3<'py, f32>,
    kernel: [usize; 3],
) -> Outcome<Bound<'py, PyArray2<f32>>> {
    let (rows, channels) = (values.shape()[0], values.shape()[1]);
    let edges = Edges::new(&source, &there, &attribute, kernel, rows)?;
    let values = values.as_slice().map_err(PyErr::from)?;
    let width = edges.slots() * channels;
    let mut sums = vec![0.0; source.shape()[0] * width];
    py.detach(|| {
        on_own_threads(|| {
            let parts = sums.par_chunks_mut((PART * width).max(1)).enumerate();
            parts.for_each(|(part, sums)| {
                Isa::best().run(Sums { edges, values, channels, first: part * PART, sums });
            });
        })
    })?;
    Ok(sums.into_pyarray(py).reshape([source.shape()[0], width])?)
}

/// (rows, channels): the gradient of the values for one of these sums.
#[pyfunction]
pub(crate) fn _spline_sums_gradient<'py>(
    py: Python<'py>,
    gradients: PyReadonlyArray2<'py, f32>,
    source: PyReadonlyArray2<'py, i64>,
    there: PyReadonlyArray2<'py, bool>,
    attribute: PyReadonlyArray3<'py, f32>,
    kernel: [usize; 3],
    rows: usize,
) -> Outcome<Bound<'py, PyArray2<f32>>> {
    let edges = Edges::new(&source, &there, &attribute, kernel, rows)?;
    let channels = gradients.shape()[1] / edges.slots();
    let gradients = gradients.as_slice().map_err(PyErr::from)?;
    let width = edges.slots() * channels;
    let mut found = vec![0.0; rows * channels];
    py.detach(|| {
        on_own_threads(|| {
            let parts = gradients.par_chunks((PART * width).max(1)).enumerate();
            let parts: Vec<_> = parts
                .map(|(part, gradients)| {
                    Isa::best().run(Gradient { edges, gradients, channels, first: part * PART })
                })
                .collect();
            for (low, part) in parts {
                found[low * channels..][..part.len()]
                    .iter_mut()
                    .zip(part)
                    .for_each(|(sum, value)| *sum += value);
            }
        })
    })?;
    Ok(found.into_pyarray(py).reshape([rows, channels])?)
}
