//! Scalar versions of the kernels over frames.

use meissner_kernels::{ConvParts, FeatureMap, KernelError, View, WinogradTile};

/// (height, width, channels), row after row.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct Image {
    /// Rows.
    pub(crate) height: usize,
    /// Pixels in a row.
    pub(crate) width: usize,
    /// Channels of a pixel.
    pub(crate) channels: usize,
    /// The channels of each pixel, row after row.
    pub(crate) values: Vec<f32>,
}

impl Image {
    /// An image whose value at (y, x, c) is `value(y, x, c)`.
    pub(crate) fn new(
        [height, width, channels]: [usize; 3],
        value: impl Fn(usize, usize, usize) -> f32,
    ) -> Self {
        let at = |i: usize| value(i / channels / width, i / channels % width, i % channels);
        Self { height, width, channels, values: (0..height * width * channels).map(at).collect() }
    }

    /// Channel `c` of pixel (y, x); zero beyond the image.
    pub(crate) fn at(&self, y: isize, x: isize, c: usize) -> f32 {
        if y < 0 || x < 0 || y as usize >= self.height || x as usize >= self.width {
            return 0.0;
        }
        self.values[(y as usize * self.width + x as usize) * self.channels + c]
    }

    /// The same values as a map with a halo of `halo`.
    ///
    /// # Errors
    /// As [`FeatureMap::from_pixels`].
    pub(crate) fn to_map(&self, halo: usize) -> Result<FeatureMap, KernelError> {
        FeatureMap::from_pixels([self.height, self.width, self.channels], halo, &self.values)
    }

    /// The values of a view.
    pub(crate) fn of(view: View<'_>) -> Self {
        Self::new(view.size(), |y, x, c| view.pixel(y, x)[c])
    }
}

fn scale(parts: &ConvParts, o: usize) -> f64 {
    parts.norm.as_ref().map_or(1.0, |(scale, _)| f64::from(scale[o]))
}

fn bias(parts: &ConvParts, o: usize) -> f32 {
    let bias = parts.bias.as_ref().map_or(0.0, |bias| f64::from(bias[o]));
    let shift = parts.norm.as_ref().map_or(0.0, |(_, shift)| f64::from(shift[o]));
    (scale(parts, o) * bias + shift) as f32
}

fn finish(parts: &ConvParts, y: f32) -> f32 {
    let y = y + 0.0;
    if parts.relu && y < 0.0 { 0.0 } else { y }
}

/// A convolution with a `size` x `size` kernel, 3 or 1, over the images one after the other.
pub(crate) fn conv(parts: &ConvParts, size: usize, inputs: &[Image]) -> Image {
    let all: usize = parts.inputs.iter().sum();
    let half = (size / 2) as isize;
    Image::new([inputs[0].height, inputs[0].width, parts.outputs], |y, x, o| {
        let mut sum = bias(parts, o);
        let mut before = 0;
        for image in inputs {
            for ky in 0..size {
                for kx in 0..size {
                    for i in 0..image.channels {
                        let weight = parts.weight[((o * all + before + i) * size + ky) * size + kx];
                        let weight = (f64::from(weight) * scale(parts, o)) as f32;
                        let (y, x) = ((y + ky) as isize - half, (x + kx) as isize - half);
                        sum = image.at(y, x, i).mul_add(weight, sum);
                    }
                }
            }
            before += image.channels;
        }
        finish(parts, sum)
    })
}

/// A 3 x 3 convolution whose products are summed for each place of the kernel, then over places.
pub(crate) fn kn2row(parts: &ConvParts, image: &Image) -> Image {
    Image::new([image.height, image.width, parts.outputs], |y, x, o| {
        let mut sum = bias(parts, o);
        for place in 0..9 {
            let (y, x) = ((y + place / 3) as isize - 1, (x + place % 3) as isize - 1);
            let mut products = 0.0;
            for i in 0..image.channels {
                let weight = parts.weight[(o * image.channels + i) * 9 + place];
                let weight = (f64::from(weight) * scale(parts, o)) as f32;
                products = image.at(y, x, i).mul_add(weight, products);
            }
            sum += products;
        }
        finish(parts, sum)
    })
}

/// A transposed convolution with a 2 x 2 kernel and stride 2.
pub(crate) fn transposed(parts: &ConvParts, inputs: &[Image]) -> Image {
    Image::new([2 * inputs[0].height, 2 * inputs[0].width, parts.outputs], |y, x, o| {
        let mut sum = bias(parts, o);
        let mut before = 0;
        for image in inputs {
            for i in 0..image.channels {
                let weight = parts.weight[(((before + i) * parts.outputs + o) * 2 + y % 2) * 2 + x % 2];
                let weight = (f64::from(weight) * scale(parts, o)) as f32;
                sum = image.at((y / 2) as isize, (x / 2) as isize, i).mul_add(weight, sum);
            }
            before += image.channels;
        }
        finish(parts, sum)
    })
}

/// B^t d of one column or row.
fn forward(d: &[f32]) -> Vec<f32> {
    match *d {
        [a, b, c, d] => vec![a - c, b + c, c - b, b - d],
        [a, b, c, d, e, f] => {
            let (odd, even) = (b.mul_add(-4.0, d), c.mul_add(-4.0, e));
            vec![
                a.mul_add(4.0, c.mul_add(-5.0, e)),
                even + odd,
                even - odd,
                (d - b).mul_add(2.0, e - c),
                (d - b).mul_add(-2.0, e - c),
                b.mul_add(4.0, d.mul_add(-5.0, f)),
            ]
        }
        _ => unreachable!("tiles read 4 or 6 pixels"),
    }
}

/// A^t m of one column or row.
fn backward(m: &[f32]) -> Vec<f32> {
    match *m {
        [a, b, c, d] => vec![(a + b) + c, (b - c) - d],
        [a, b, c, d, e, f] => vec![
            (a + (b + c)) + (d + e),
            (d - e).mul_add(2.0, b - c),
            (d + e).mul_add(4.0, b + c),
            (d - e).mul_add(8.0, f + (b - c)),
        ],
        _ => unreachable!("tiles have 4 or 6 sums"),
    }
}

/// Applies `transform` to every column, then to every row.
fn both(square: &[Vec<f32>], transform: fn(&[f32]) -> Vec<f32>) -> Vec<Vec<f32>> {
    let turned = |rows: &[Vec<f32>]| -> Vec<Vec<f32>> {
        (0..rows[0].len()).map(|c| rows.iter().map(|row| row[c]).collect()).collect()
    };
    let columns: Vec<Vec<f32>> = turned(square).iter().map(|column| transform(column)).collect();
    turned(&columns).iter().map(|row| transform(row)).collect()
}

/// G of F(2, 3) and F(4, 3).
fn kernel(n: usize) -> Vec<[f64; 3]> {
    if n == 4 {
        return vec![[1.0, 0.0, 0.0], [0.5, 0.5, 0.5], [0.5, -0.5, 0.5], [0.0, 0.0, 1.0]];
    }
    let (sixth, twelfth, twenty_fourth) = (1.0 / 6.0, 1.0 / 12.0, 1.0 / 24.0);
    vec![
        [0.25, 0.0, 0.0],
        [-sixth, -sixth, -sixth],
        [-sixth, sixth, -sixth],
        [twenty_fourth, twelfth, sixth],
        [twenty_fourth, -twelfth, sixth],
        [0.0, 0.0, 1.0],
    ]
}

/// A 3 x 3 convolution by Winograd's tiles.
pub(crate) fn winograd(parts: &ConvParts, tile: WinogradTile, inputs: &[Image]) -> Image {
    let (m, n) = (tile.size(), tile.size() + 2);
    let all: usize = parts.inputs.iter().sum();
    let g = kernel(n);
    let transformed = |o: usize, i: usize, u: usize, v: usize| {
        let mut sum = 0.0;
        for ky in 0..3 {
            for kx in 0..3 {
                let weight = f64::from(parts.weight[((o * all + i) * 3 + ky) * 3 + kx]) * scale(parts, o);
                sum += g[u][ky] * weight * g[v][kx];
            }
        }
        sum as f32
    };
    let (height, width) = (inputs[0].height, inputs[0].width);
    let mut out = Image::new([height, width, parts.outputs], |_, _, _| 0.0);
    for (ty, tx) in (0..height.div_ceil(m)).flat_map(|y| (0..width.div_ceil(m)).map(move |x| (y, x))) {
        let mut patches = Vec::new();
        for image in inputs {
            for i in 0..image.channels {
                let pixel =
                    |r: usize, c: usize| image.at((ty * m + r) as isize - 1, (tx * m + c) as isize - 1, i);
                let patch: Vec<Vec<f32>> = (0..n).map(|r| (0..n).map(|c| pixel(r, c)).collect()).collect();
                patches.push(both(&patch, forward));
            }
        }
        for o in 0..parts.outputs {
            let place = |u: usize, v: usize| {
                let products = patches.iter().enumerate();
                products.fold(0.0, |sum, (i, patch)| patch[u][v].mul_add(transformed(o, i, u, v), sum))
            };
            let sums: Vec<Vec<f32>> = (0..n).map(|u| (0..n).map(|v| place(u, v)).collect()).collect();
            for (r, row) in both(&sums, backward).into_iter().enumerate().take(height - ty * m) {
                for (c, y) in row.into_iter().enumerate().take(width - tx * m) {
                    let at = ((ty * m + r) * width + tx * m + c) * parts.outputs + o;
                    out.values[at] = finish(parts, y + bias(parts, o));
                }
            }
        }
    }
    out
}

/// Maximum of 2 x 2 pixels; NaN if any of them is.
pub(crate) fn max_pool_2x2(input: &Image) -> Image {
    Image::new([input.height / 2, input.width / 2, input.channels], |y, x, c| {
        let at = |i: usize| input.at((2 * y + i / 2) as isize, (2 * x + i % 2) as isize, c);
        (1..4).fold(at(0), |largest, i| if at(i) > largest || at(i).is_nan() { at(i) } else { largest })
    })
}

/// Average of `size` x `size` pixels.
pub(crate) fn average_pool(size: usize, input: &Image) -> Image {
    Image::new([input.height / size, input.width / size, input.channels], |y, x, c| {
        let at = |i: usize| input.at((size * y + i / size) as isize, (size * x + i % size) as isize, c);
        let sum = (0..size * size).fold(0.0, |sum, i| sum + at(i));
        sum * (1.0 / (size * size) as f64) as f32
    })
}

/// Average of all pixels.
pub(crate) fn global_average(input: &Image) -> Vec<f32> {
    let row =
        |y: usize, c: usize| (0..input.width).fold(0.0, |sum, x| sum + input.at(y as isize, x as isize, c));
    let total = |c: usize| (0..input.height).fold(0.0, |sum, y| sum + row(y, c));
    let inverse = (1.0 / (input.height * input.width) as f64) as f32;
    (0..input.channels).map(|c| total(c) * inverse).collect()
}
