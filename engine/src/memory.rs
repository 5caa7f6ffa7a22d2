//! The memory of an engine: allocated once, when the engine is made, or only counted.
//!
//! Every stage takes its storage from a [`Memory`]. A memory that only counts hands out empty
//! vectors, so the code that allocates also computes an engine's size before anything is allocated.

use std::ops::{Deref, DerefMut};

use meissner_kernels::{Lanes, Matrix};

/// Hands out storage and counts its bytes.
#[derive(Debug, Default)]
pub(crate) struct Memory {
    bytes: u128,
    pub(crate) counts_only: bool,
}

impl Memory {
    /// Bytes of the storage that `make` takes. Allocates nothing.
    pub(crate) fn needed<T>(make: impl FnOnce(&mut Self) -> T) -> u128 {
        let mut memory = Self { counts_only: true, ..Self::default() };
        make(&mut memory);
        memory.bytes
    }

    /// Counts storage that the caller allocates. Saturates.
    pub(crate) fn add(&mut self, bytes: u128) {
        self.bytes = self.bytes.saturating_add(bytes);
    }

    /// Counts `count` values; returns how many of them to allocate.
    fn count<T>(&mut self, count: usize) -> usize {
        self.add(count as u128 * size_of::<T>() as u128);
        if self.counts_only { 0 } else { count }
    }

    pub(crate) fn copies<T: Clone>(&mut self, value: T, count: usize) -> Vec<T> {
        vec![value; self.count::<T>(count)]
    }

    pub(crate) fn values<T>(&mut self, count: usize, value: impl FnMut(usize) -> T) -> Vec<T> {
        (0..self.count::<T>(count)).map(value).collect()
    }

    /// `make(i)` for i in `0..count`, each of which takes storage of its own.
    pub(crate) fn each<T>(&mut self, count: usize, mut make: impl FnMut(&mut Self, usize) -> T) -> Vec<T> {
        self.count::<T>(count);
        (0..count).map(|i| make(self, i)).collect()
    }

    /// An empty list with room for `most` values.
    pub(crate) fn room<T>(&mut self, most: usize) -> FixedVec<T> {
        FixedVec(Vec::with_capacity(self.count::<T>(most)))
    }

    pub(crate) fn matrix(&mut self, rows: usize, columns: usize) -> Matrix {
        let mut matrix = self.room_for_rows(rows, columns);
        if !self.counts_only {
            matrix.grow(rows);
        }
        matrix
    }

    /// No rows, and room for `most` of `columns` values.
    pub(crate) fn room_for_rows(&mut self, most: usize, columns: usize) -> Matrix {
        self.count::<Lanes>(most * Lanes::count(columns));
        Matrix::with_room(if self.counts_only { 0 } else { most }, columns)
    }
}

/// A vector that keeps its capacity when cloned: an engine's clone must not allocate later either.
#[derive(Debug)]
pub(crate) struct FixedVec<T>(Vec<T>);

impl<T: Clone> Clone for FixedVec<T> {
    fn clone(&self) -> Self {
        let mut values = Vec::with_capacity(self.0.capacity());
        values.extend_from_slice(&self.0);
        Self(values)
    }
}

impl<T> Deref for FixedVec<T> {
    type Target = Vec<T>;

    #[inline]
    fn deref(&self) -> &Vec<T> {
        &self.0
    }
}

impl<T> DerefMut for FixedVec<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut Vec<T> {
        &mut self.0
    }
}
