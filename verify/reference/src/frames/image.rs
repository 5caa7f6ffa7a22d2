//! Layers over images, (channels, height, width), with zeros beyond the border.

/// Values of an image; a vector has one value per channel.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Image {
    /// Channels, rows, columns.
    pub(super) size: [usize; 3],
    pub(super) values: Vec<f64>,
}

impl Image {
    pub(super) fn new(size: [usize; 3], values: Vec<f64>) -> Self {
        assert_eq!(values.len(), size.iter().product::<usize>(), "an image must have a value for each place");
        Self { size, values }
    }

    pub(super) fn vector(values: Vec<f64>) -> Self {
        Self::new([values.len(), 1, 1], values)
    }

    /// The channels of this image, then those of `other`.
    pub(super) fn beside(&self, other: &Self) -> Self {
        let [channels, height, width] = self.size;
        Self::new([channels + other.size[0], height, width], [&self.values[..], &other.values].concat())
    }

    /// The rows of each channel.
    pub(super) fn planes(&self) -> impl Iterator<Item = &[f64]> {
        self.values.chunks_exact(self.size[1] * self.size[2])
    }

    /// Value at channel `c`, row `y`, column `x`; 0 beyond the image.
    fn at(&self, c: usize, y: isize, x: isize) -> f64 {
        let [_, height, width] = self.size;
        if (0..height as isize).contains(&y) && (0..width as isize).contains(&x) {
            self.values[(c * height + y as usize) * width + x as usize]
        } else {
            0.0
        }
    }

    /// An image of `size` whose values are `value(c, y, x)`.
    fn from_fn(size: [usize; 3], value: impl Fn(usize, usize, usize) -> f64) -> Self {
        let [channels, height, width] = size;
        let places =
            (0..channels * height * width).map(|i| (i / width / height, i / width % height, i % width));
        Self::new(size, places.map(|(c, y, x)| value(c, y, x)).collect())
    }
}

/// Convolution of `kernel` x `kernel` pixels; `weight` is (outputs, channels, kernel, kernel).
pub(super) fn conv(
    input: &Image,
    kernel: usize,
    outputs: usize,
    weight: &[f32],
    bias: Option<&[f32]>,
    relu: bool,
) -> Image {
    let half = (kernel / 2) as isize;
    let [channels, height, width] = input.size;
    Image::from_fn([outputs, height, width], |o, y, x| {
        let mut sum = bias.map_or(0.0, |bias| f64::from(bias[o]));
        for i in 0..channels {
            for ky in 0..kernel {
                for kx in 0..kernel {
                    let w = weight[((o * channels + i) * kernel + ky) * kernel + kx];
                    sum += f64::from(w) * input.at(i, (y + ky) as isize - half, (x + kx) as isize - half);
                }
            }
        }
        if relu { sum.max(0.0) } else { sum }
    })
}

/// Transposed convolution of 2 x 2 pixels with stride 2; `weight` is (inputs, outputs, 2, 2).
pub(super) fn up_conv(input: &Image, outputs: usize, weight: &[f32], bias: Option<&[f32]>) -> Image {
    let [channels, height, width] = input.size;
    Image::from_fn([outputs, 2 * height, 2 * width], |o, y, x| {
        let product = |i: usize| {
            let w = weight[((i * outputs + o) * 2 + y % 2) * 2 + x % 2];
            f64::from(w) * input.at(i, (y / 2) as isize, (x / 2) as isize)
        };
        bias.map_or(0.0, |bias| f64::from(bias[o])) + (0..channels).map(product).sum::<f64>()
    })
}

/// Applies `of` to each window of `size` x `size` pixels; pixels that do not fill a window are dropped.
pub(super) fn pooled(input: &Image, size: usize, of: impl Fn(&mut dyn Iterator<Item = f64>) -> f64) -> Image {
    let [channels, height, width] = input.size;
    Image::from_fn([channels, height / size, width / size], |c, y, x| {
        let at = |i: usize| input.at(c, (y * size + i / size) as isize, (x * size + i % size) as isize);
        of(&mut (0..size * size).map(at))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn image() -> Image {
        Image::new([1, 2, 3], vec![1.0, 2.0, 3.0, 4.0, 5.0, 6.0])
    }

    #[test]
    fn a_convolution_sees_zeros_beyond_the_border() {
        let ones = conv(&image(), 3, 1, &[1.0; 9], Some(&[0.5]), false);
        assert_eq!(ones.values, [12.5, 21.5, 16.5, 12.5, 21.5, 16.5]);
        // A weight at the first place reads the pixel above and to the left.
        let mut first = [0.0; 9];
        first[0] = -1.0;
        assert_eq!(conv(&image(), 3, 1, &first, None, false).values, [0.0, 0.0, 0.0, 0.0, -1.0, -2.0]);
        assert_eq!(conv(&image(), 3, 1, &first, None, true).values, [0.0; 6]);
    }

    #[test]
    fn a_transposed_convolution_doubles_the_image() {
        let up = up_conv(&Image::new([1, 1, 2], vec![1.0, 10.0]), 1, &[1.0, 2.0, 3.0, 4.0], None);
        assert_eq!(up, Image::new([1, 2, 4], vec![1.0, 2.0, 10.0, 20.0, 3.0, 4.0, 30.0, 40.0]));
    }

    #[test]
    fn what_does_not_fill_a_window_is_left_out() {
        let largest = pooled(&image(), 2, |window| window.fold(f64::NEG_INFINITY, f64::max));
        assert_eq!(largest, Image::new([1, 1, 1], vec![5.0]));
    }
}
