//! Where an image is not zero, by row and tile: what a convolution may leave out.

use super::planes::{Planes, TILE};

/// One flag per row and tile of sixteen columns of an image, all channels together.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Occupancy {
    tiles: usize,
    /// (height + 2, tiles + 2): a border of empty tiles.
    flags: Vec<bool>,
}

impl Occupancy {
    /// Of an image of `height` rows of `width` zeros.
    ///
    /// # Panics
    /// If no memory holds it.
    pub fn empty(height: usize, width: usize) -> Self {
        let tiles = width.div_ceil(TILE);
        Self { tiles, flags: vec![false; (height + 2) * (tiles + 2)] }
    }

    /// Reads `planes` anew. O(values). Nothing is allocated.
    ///
    /// # Panics
    /// If `planes` has other rows or tiles.
    pub fn update(&mut self, planes: &Planes) {
        let columns = self.tiles + 2;
        assert!(
            self.fits(planes.height(), planes.width()),
            "the image must have the rows and tiles that were announced"
        );
        for y in 0..planes.height() {
            let flags = &mut self.flags[(y + 1) * columns + 1..][..planes.tiles()];
            flags.fill(false);
            for channel in 0..planes.channels() {
                for (flag, values) in flags.iter_mut().zip(planes.row(channel, y).chunks(TILE)) {
                    // All bits but the sign's.
                    *flag |= values.iter().fold(0, |bits, v| bits | v.to_bits() << 1) != 0;
                }
            }
        }
    }

    /// Whether nothing is set in row `y` of tiles `first..first + count`, nor in the tiles around them.
    ///
    /// # Panics
    /// If there is no such row or tile.
    #[inline]
    pub fn is_empty_around(&self, y: usize, first: usize, count: usize) -> bool {
        let columns = self.tiles + 2;
        (y..y + 3).all(|row| !self.flags[row * columns + first..][..count + 2].contains(&true))
    }

    /// Whether it is of an image of this size.
    pub(crate) fn fits(&self, height: usize, width: usize) -> bool {
        self.tiles == width.div_ceil(TILE) && self.flags.len() == (height + 2) * (self.tiles + 2)
    }

    /// Tiles that hold something.
    pub fn occupied(&self) -> usize {
        self.flags.iter().filter(|&&flag| flag).count()
    }
}
