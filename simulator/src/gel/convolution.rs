//! Convolution of a picture with a symmetric kernel by FFT, without wrap: O(n log n) for n pixels.
//!
//! The transforms are rustfft's scalar ones, so that the bits are those of every machine.

use std::sync::Arc;

use rustfft::num_complex::Complex;
use rustfft::{Fft, FftPlannerScalar};

/// A kernel, and the plans of the transforms of `2 width` x `2 height` values.
#[derive(Clone)]
pub(super) struct Convolution {
    width: usize,
    height: usize,
    /// Rows and columns forward, then back.
    rows: [Arc<dyn Fft<f64>>; 2],
    columns: [Arc<dyn Fft<f64>>; 2],
    /// Transform of the kernel, column by column, divided by the number of values.
    kernel: Vec<f64>,
    by_rows: Vec<Complex<f64>>,
    by_columns: Vec<Complex<f64>>,
    scratch: Vec<Complex<f64>>,
}

impl Convolution {
    /// `kernel` gives the value so many columns and rows from the middle, on either side.
    pub(super) fn new(width: usize, height: usize, kernel: impl Fn(usize, usize) -> f64) -> Self {
        let mut planner = FftPlannerScalar::new();
        let rows = [planner.plan_fft_forward(2 * width), planner.plan_fft_inverse(2 * width)];
        let columns = [planner.plan_fft_forward(2 * height), planner.plan_fft_inverse(2 * height)];
        let longest = rows.iter().chain(&columns).map(|fft| fft.get_inplace_scratch_len()).max().unwrap_or(0);
        let values = 4 * width * height;
        let zero = Complex::new(0.0, 0.0);
        let mut made = Self {
            width,
            height,
            rows,
            columns,
            kernel: Vec::new(),
            by_rows: vec![zero; values],
            by_columns: vec![zero; values],
            scratch: vec![zero; longest],
        };
        for (row, line) in made.by_rows.chunks_exact_mut(2 * width).enumerate() {
            for (column, value) in line.iter_mut().enumerate() {
                // The distance at `width` is never between two pixels.
                *value = Complex::new(kernel(column.min(2 * width - column), row.min(2 * height - row)), 0.0);
            }
        }
        made.forward(2 * height);
        // The kernel is symmetric, so that its transform is real.
        made.kernel = made.by_columns.iter().map(|value| value.re / values as f64).collect();
        made
    }

    /// The convolution of `picture`, row by row.
    pub(super) fn apply(&mut self, picture: &[f64]) -> Vec<f64> {
        let (width, height) = (self.width, self.height);
        assert_eq!(picture.len(), width * height, "a value for each pixel");
        self.by_rows.fill(Complex::new(0.0, 0.0));
        for (line, row) in self.by_rows.chunks_exact_mut(2 * width).zip(picture.chunks_exact(width)) {
            line.iter_mut().zip(row).for_each(|(value, &pixel)| value.re = pixel);
        }
        self.forward(height);
        self.by_columns.iter_mut().zip(&self.kernel).for_each(|(value, kernel)| *value *= kernel);
        let Self { rows, columns, by_rows, by_columns, scratch, .. } = self;
        columns[1].process_with_scratch(by_columns, scratch);
        // Only the rows of the picture go back.
        let lines = &mut by_rows[..2 * width * height];
        for (row, line) in lines.chunks_exact_mut(2 * width).enumerate() {
            for (column, value) in line.iter_mut().enumerate() {
                *value = by_columns[column * 2 * height + row];
            }
        }
        rows[1].process_with_scratch(lines, scratch);
        lines.chunks_exact(2 * width).flat_map(|line| line[..width].iter().map(|value| value.re)).collect()
    }

    /// Transforms `by_rows`, of whose rows the first `filled` are not zero, into `by_columns`.
    fn forward(&mut self, filled: usize) {
        let (width, height) = (2 * self.width, 2 * self.height);
        self.rows[0].process_with_scratch(&mut self.by_rows[..width * filled], &mut self.scratch);
        for (column, line) in self.by_columns.chunks_exact_mut(height).enumerate() {
            for (row, value) in line.iter_mut().enumerate() {
                *value = self.by_rows[row * width + column];
            }
        }
        self.columns[0].process_with_scratch(&mut self.by_columns, &mut self.scratch);
    }
}
