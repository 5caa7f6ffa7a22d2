//! Lists that allocate once.

use std::ops::{Deref, DerefMut};

/// A vector that keeps its capacity when cloned, because the clone of an engine must not allocate later either.
#[derive(Debug)]
pub(crate) struct Room<T>(Vec<T>);

impl<T> Room<T> {
    /// An empty list with room for `most` values.
    pub(crate) fn new(most: usize) -> Self {
        Self(Vec::with_capacity(most))
    }

    /// Bytes that [`Self::new`] allocates.
    pub(crate) fn bytes(most: usize) -> usize {
        most * size_of::<T>()
    }
}

impl<T: Clone> Clone for Room<T> {
    fn clone(&self) -> Self {
        let mut values = Vec::with_capacity(self.0.capacity());
        values.extend_from_slice(&self.0);
        Self(values)
    }
}

impl<T> Deref for Room<T> {
    type Target = Vec<T>;

    #[inline]
    fn deref(&self) -> &Vec<T> {
        &self.0
    }
}

impl<T> DerefMut for Room<T> {
    #[inline]
    fn deref_mut(&mut self) -> &mut Vec<T> {
        &mut self.0
    }
}
