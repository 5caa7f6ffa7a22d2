//! Rows of activations, each padded to whole lanes.

use crate::isa::{flat, flat_mut, prefetch_at};
use crate::lanes::{LANES, Lanes};

/// A matrix of f32 whose rows start on lane boundaries. Columns beyond `columns` are zeros, or
/// finite values from kernels with zero weights in these columns.
#[derive(Debug)]
pub struct Matrix {
    columns: usize,
    stride: usize,
    data: Vec<Lanes>,
}

impl Clone for Matrix {
    /// A copy with the same room.
    fn clone(&self) -> Self {
        let mut data = Vec::with_capacity(self.data.capacity());
        data.extend_from_slice(&self.data);
        Self { data, ..*self }
    }
}

impl Matrix {
    /// `rows` x `columns` zeros.
    ///
    /// # Panics
    /// If the memory cannot be allocated.
    pub fn zeros(rows: usize, columns: usize) -> Self {
        let stride = Lanes::count(columns);
        Self { columns, stride, data: vec![Lanes::ZERO; rows * stride] }
    }

    /// An empty matrix with room for `rows` rows; memory is touched when rows [grow](Self::grow).
    ///
    /// # Panics
    /// If the memory cannot be allocated.
    pub fn with_room(rows: usize, columns: usize) -> Self {
        let stride = Lanes::count(columns);
        Self { columns, stride, data: Vec::with_capacity(rows * stride) }
    }

    /// Adds rows of zeros, up to `rows` rows in total. O(new rows).
    pub fn grow(&mut self, rows: usize) {
        self.data.resize(rows * self.stride, Lanes::ZERO);
    }

    /// A matrix of `values`, row after row of `columns` values.
    ///
    /// # Panics
    /// If `columns` is zero, or `values` does not fill whole rows.
    pub fn from_rows(columns: usize, values: &[f32]) -> Self {
        assert_eq!(values.len() % columns, 0, "values must fill whole rows");
        let mut out = Self::zeros(values.len() / columns, columns);
        for (i, &v) in values.iter().enumerate() {
            out.row_mut(i / columns)[i % columns / LANES].0[i % columns % LANES] = v;
        }
        out
    }

    /// Number of columns, without padding.
    #[inline]
    pub fn columns(&self) -> usize {
        self.columns
    }

    /// Number of rows; 0 if there are no columns.
    #[inline]
    pub fn rows(&self) -> usize {
        self.data.len().checked_div(self.stride).unwrap_or(0)
    }

    /// Row `i`, in lanes.
    ///
    /// # Panics
    /// If there is no such row.
    #[inline]
    pub fn row(&self, i: usize) -> &[Lanes] {
        &self.data[i * self.stride..][..self.stride]
    }

    /// Row `i`, to write.
    ///
    /// # Panics
    /// If there is no such row.
    #[inline]
    pub fn row_mut(&mut self, i: usize) -> &mut [Lanes] {
        &mut self.data[i * self.stride..][..self.stride]
    }

    /// Asks for row `i`, if it exists, as [`prefetch`](crate::prefetch) does.
    #[inline(always)]
    pub fn prefetch(&self, i: usize) {
        let start = i * self.stride;
        let Some(row) = self.data.get(start..start + self.stride) else { return };
        // A lane is half a line: every line has the first lane, or one with an odd index.
        for lane in row.iter().take(1).chain(row.iter().skip(1).step_by(2)) {
            prefetch_at(lane);
        }
    }

    /// All rows, one after the other, in lanes.
    #[inline]
    pub fn lanes(&self) -> &[Lanes] {
        &self.data
    }

    /// All rows, to write.
    #[inline]
    pub fn lanes_mut(&mut self) -> &mut [Lanes] {
        &mut self.data
    }

    /// The values of row `i`, without padding, as a slice.
    ///
    /// # Panics
    /// If there is no such row.
    #[inline]
    pub fn slice(&self, i: usize) -> &[f32] {
        &flat(self.row(i))[..self.columns]
    }

    /// The values of row `i`, without padding, to write.
    ///
    /// # Panics
    /// If there is no such row.
    #[inline]
    pub fn slice_mut(&mut self, i: usize) -> &mut [f32] {
        let columns = self.columns;
        &mut flat_mut(self.row_mut(i))[..columns]
    }

    /// The values of row `i`, without padding.
    ///
    /// # Panics
    /// If there is no such row.
    pub fn values(&self, i: usize) -> impl Iterator<Item = f32> + '_ {
        self.row(i).iter().flat_map(|lanes| lanes.0).take(self.columns)
    }

    /// Bytes of storage.
    pub fn bytes(&self) -> usize {
        self.data.len() * size_of::<Lanes>()
    }
}
