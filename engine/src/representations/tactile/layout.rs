//! The places of the electrodes, and the values of the cells between them.
//!
//! Enters: 24 values. Leaves: an image of 12 x 11, row-major: each electrode in its cell; every
//! other cell the mean of its filled neighbours among 8, in two passes (the slip paper's published
//! preparation). The first pass sees the electrodes, the second also what the first filled (97
//! cells; 11 remain). A mean adds in f64 in row-major order, divides by the number, and is rounded
//! to f32 once.

/// Electrodes of the sensor.
pub const ELECTRODES: usize = 24;
/// Rows of the image.
pub const TACTILE_ROWS: usize = 12;
/// Columns of the image.
pub const TACTILE_COLUMNS: usize = 11;
/// Cells of the image.
pub const TACTILE_CELLS: usize = TACTILE_ROWS * TACTILE_COLUMNS;

/// The row of each electrode (the slip paper's published preparation).
pub const ELECTRODE_ROWS: [usize; ELECTRODES] =
    [0, 1, 4, 5, 6, 7, 8, 9, 10, 11, 0, 1, 4, 5, 6, 7, 8, 9, 10, 11, 2, 3, 3, 5];
/// The column of each electrode (the slip paper's published preparation).
pub const ELECTRODE_COLUMNS: [usize; ELECTRODES] =
    [1, 2, 0, 1, 3, 0, 1, 4, 2, 1, 9, 8, 10, 9, 7, 10, 9, 6, 8, 9, 5, 4, 6, 5];

const PASSES: usize = 2;

/// The lists of neighbours by which 24 values become an image.
#[derive(Clone, Debug)]
pub struct TactileLayout {
    /// Each cell between electrodes, and its filled neighbours.
    fills: Vec<(usize, Vec<usize>)>,
}

impl TactileLayout {
    /// Finds the filled neighbours of every cell, pass by pass.
    pub fn new() -> Self {
        let mut filled = [false; TACTILE_CELLS];
        cells_of_electrodes().for_each(|cell| filled[cell] = true);
        let mut fills = Vec::new();
        for _ in 0..PASSES {
            let before = filled;
            for cell in (0..TACTILE_CELLS).filter(|&cell| !before[cell]) {
                let neighbours: Vec<_> = around(cell).filter(|&neighbour| before[neighbour]).collect();
                if !neighbours.is_empty() {
                    fills.push((cell, neighbours));
                    filled[cell] = true;
                }
            }
        }
        Self { fills }
    }

    /// Lays the electrodes' `values` out as `image` (12, 11), row-major. 204 additions.
    pub fn image(&self, values: &[f32; ELECTRODES], image: &mut [f32; TACTILE_CELLS]) {
        for (cell, &value) in cells_of_electrodes().zip(values) {
            image[cell] = value;
        }
        for (cell, neighbours) in &self.fills {
            let sum: f64 = neighbours.iter().map(|&neighbour| f64::from(image[neighbour])).sum();
            image[*cell] = (sum / neighbours.len() as f64) as f32;
        }
    }
}

impl Default for TactileLayout {
    fn default() -> Self {
        Self::new()
    }
}

/// The cell of each electrode.
fn cells_of_electrodes() -> impl Iterator<Item = usize> {
    ELECTRODE_ROWS.iter().zip(ELECTRODE_COLUMNS).map(|(row, column)| row * TACTILE_COLUMNS + column)
}

/// The neighbours of a cell that are in the image, row by row.
fn around(cell: usize) -> impl Iterator<Item = usize> {
    let (row, column) = (cell / TACTILE_COLUMNS, cell % TACTILE_COLUMNS);
    let near = |at: usize, extent: usize| at.saturating_sub(1)..(at + 2).min(extent);
    near(row, TACTILE_ROWS)
        .flat_map(move |r| near(column, TACTILE_COLUMNS).map(move |c| r * TACTILE_COLUMNS + c))
        .filter(move |&neighbour| neighbour != cell)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// The image as the header describes it, without any list.
    fn slow(values: &[f32; ELECTRODES]) -> [Option<f32>; TACTILE_CELLS] {
        let mut image = [[None; TACTILE_COLUMNS]; TACTILE_ROWS];
        for i in 0..ELECTRODES {
            image[ELECTRODE_ROWS[i]][ELECTRODE_COLUMNS[i]] = Some(values[i]);
        }
        for _ in 0..2 {
            let before = image;
            for row in 0..TACTILE_ROWS as i32 {
                for column in 0..TACTILE_COLUMNS as i32 {
                    let (mut sum, mut count) = (0.0, 0.0);
                    for dr in -1..=1 {
                        for dc in -1..=1 {
                            let at =
                                |r: i32, c: i32| before.get(r as usize)?.get(c as usize).copied().flatten();
                            if let Some(value) = at(row + dr, column + dc) {
                                sum += f64::from(value);
                                count += 1.0;
                            }
                        }
                    }
                    let cell = &mut image[row as usize][column as usize];
                    if cell.is_none() && count > 0.0 {
                        *cell = Some((sum / count) as f32);
                    }
                }
            }
        }
        std::array::from_fn(|cell| image[cell / TACTILE_COLUMNS][cell % TACTILE_COLUMNS])
    }

    #[test]
    fn two_passes_fill_every_cell() {
        let layout = TactileLayout::new();
        assert_eq!(layout.fills.len() + ELECTRODES, TACTILE_CELLS);
        assert_eq!(layout.fills.iter().map(|(_, neighbours)| neighbours.len()).sum::<usize>(), 204);
        assert!(slow(&[0.0; ELECTRODES]).iter().all(Option::is_some));
    }

    #[test]
    fn a_cell_is_the_mean_of_its_filled_neighbours() {
        let values = std::array::from_fn(|i| (1 << i) as f32);
        let mut image = [0.0; TACTILE_CELLS];
        TactileLayout::new().image(&values, &mut image);
        let at = |row: usize, column: usize| image[row * TACTILE_COLUMNS + column];
        assert_eq!(at(0, 1), 1.0);
        assert_eq!(at(5, 5), (1 << 23) as f32);
        // First pass: beside electrode 0 alone; between electrodes 0 and 1.
        assert_eq!([at(0, 0), at(0, 2)], [1.0, 1.5]);
        // Second pass: (2, 0) sees (1, 0), (1, 1), (2, 1), (3, 0), (3, 1) of the first: electrodes
        // 0, 0 and 1, 1, 2, 2.
        assert_eq!(at(2, 0), (1.0 + 1.5 + 2.0 + 4.0 + 4.0) / 5.0);
    }

    #[test]
    fn means_of_the_largest_readings_do_not_overflow() {
        let mut image = [0.0; TACTILE_CELLS];
        TactileLayout::new().image(&[f32::MAX; ELECTRODES], &mut image);
        assert_eq!(image, [f32::MAX; TACTILE_CELLS]);
    }

    proptest! {
        #[test]
        fn lists_give_the_image_that_passes_give(values in proptest::array::uniform24(-5_000f32..5_000.0)) {
            let mut image = [f32::NAN; TACTILE_CELLS];
            TactileLayout::new().image(&values, &mut image);
            prop_assert_eq!(image.map(Some), slow(&values));
        }
    }
}
