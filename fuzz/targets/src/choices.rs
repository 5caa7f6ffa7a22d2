//! Bytes as choices, taken one after the other; after their end, zeros.

/// The remaining bytes.
pub(crate) struct Choices<'a> {
    bytes: &'a [u8],
}

impl<'a> Choices<'a> {
    pub(crate) fn new(bytes: &'a [u8]) -> Self {
        Self { bytes }
    }

    pub(crate) fn is_empty(&self) -> bool {
        self.bytes.is_empty()
    }

    pub(crate) fn byte(&mut self) -> u8 {
        let Some((&first, rest)) = self.bytes.split_first() else { return 0 };
        self.bytes = rest;
        first
    }

    pub(crate) fn flag(&mut self) -> bool {
        self.byte() & 1 == 1
    }

    pub(crate) fn u16(&mut self) -> u16 {
        u16::from_le_bytes([self.byte(), self.byte()])
    }

    pub(crate) fn u64(&mut self) -> u64 {
        (0..4).fold(0, |word, _| word << 16 | u64::from(self.u16()))
    }

    /// A number from `low` to `high`, of a byte.
    pub(crate) fn within(&mut self, low: usize, high: usize) -> usize {
        low + usize::from(self.byte()) % (high - low + 1)
    }

    pub(crate) fn option<T>(&mut self, some: impl FnOnce(&mut Self) -> T) -> Option<T> {
        if self.flag() { Some(some(self)) } else { None }
    }

    /// Up to `most` items.
    pub(crate) fn list<T>(&mut self, least: usize, most: usize, item: impl Fn(&mut Self) -> T) -> Vec<T> {
        (0..self.within(least, most)).map(|_| item(self)).collect()
    }
}
