//! Images of few channels, stored plane after plane, with convolution and pooling.
//!
//! Lanes run over adjacent positions of a row and share each weight. For many channels,
//! channels-last is better. Poolings ignore pixels that fill no window.

mod conv;
mod planes;

pub use conv::PlanarConv3x3;
pub(crate) use conv::RowOut;
pub(crate) use planes::TILE;
pub use planes::{Occupancy, Planes, TileRegion};

/// The largest value of each 2 x 2 window. -0 becomes +0, as the order must not matter; NaN gives
/// NaN. O(values).
///
/// # Panics
/// If `out` is not (channels, height / 2, width / 2).
pub fn planar_max_pool(image: &Planes, out: &mut Planes) {
    check(image, 2, out);
    let larger = |a: f32, b: f32| if (b > a) | b.is_nan() { b } else { a };
    for channel in 0..out.channels() {
        for y in 0..out.height() {
            let (above, below) = (image.row(channel, 2 * y), image.row(channel, 2 * y + 1));
            let windows = above.as_chunks::<2>().0.iter().zip(below.as_chunks::<2>().0);
            for (out, (&[a, b], &[c, d])) in out.row_mut(channel, y).iter_mut().zip(windows) {
                *out = larger(larger(a, c), larger(b, d)) + 0.0;
            }
        }
    }
}

/// The mean of each `size` x `size` window: sums of columns (rows ascending), their sum, ascending,
/// divided by the number of pixels. `columns` is scratch. O(values).
///
/// # Panics
/// If `size` is zero, or `out` is not (channels, height / size, width / size).
pub fn planar_average_pool(image: &Planes, size: usize, columns: &mut Vec<f32>, out: &mut Planes) {
    check(image, size, out);
    let pixels = size.saturating_mul(size) as f32;
    for channel in 0..out.channels() {
        for y in 0..out.height() {
            columns.clear();
            columns.extend_from_slice(image.row(channel, y * size));
            for dy in 1..size {
                for (sum, v) in columns.iter_mut().zip(image.row(channel, y * size + dy)) {
                    *sum += v;
                }
            }
            for (out, window) in out.row_mut(channel, y).iter_mut().zip(columns.chunks_exact(size)) {
                *out = window.iter().fold(0.0, |sum, v| sum + v) / pixels;
            }
        }
    }
}

fn check(image: &Planes, size: usize, out: &Planes) {
    assert_eq!(
        (out.channels(), out.height(), out.width()),
        (image.channels(), image.height() / size, image.width() / size),
        "the output must have the size of the pooled image"
    );
}
