//! The crate `gemm` on two layers' products, to compare with our own kernels:
//! `cargo run --release -p meissner-benches --example gemm_crate`.
//!
//! The 3 x 3 convolution as one product of matrices, positions x (9 channels) times (9 channels) x outputs. Gathering the
//! neighbourhoods of positions (im2col) is timed separately; our kernels do without it.

use std::hint::black_box;

use meissner_benches::conv_cases::{Case, SHAPES, SHORTEST};
use meissner_benches::peak::Peak;
use meissner_benches::timing::median_ns;
use meissner_kernels::{FeatureMap, Isa};

fn main() {
    let isa = Isa::best();
    let peak = Peak::measure(isa);
    println!("{}, one thread, peak {:.1} GFLOP/s", isa.name(), peak.gflops);
    for shape in SHAPES.into_iter().filter(|(_, inputs, ..)| *inputs == [64] || *inputs == [128]) {
        let case = Case::new(shape);
        let flops = 2.0 * case.multiply_adds() as f64;
        let own = case.direct_ns(isa, &mut case.out());
        let (gather, product) = by_crate(&case);
        let figure = |ns: f64| {
            format!("{:9.1} us {:6.1} GFLOP/s {:5.1} %", ns / 1e3, flops / ns, peak.percent(flops / ns))
        };
        println!("{:<32}", case.name);
        println!("  own, direct            {}", figure(own));
        println!("  crate gemm             {}", figure(product));
        println!("  with the gathering     {}", figure(gather + product));
    }
}

/// Nanoseconds of the gathering and of the product.
fn by_crate(case: &Case) -> (f64, f64) {
    let map = &case.inputs[0];
    let (rows, depth, outputs) = (map.height() * map.width(), 9 * map.channels(), case.parts.outputs);
    let mut gathered = vec![0.0; rows * depth];
    let gather = median_ns(SHORTEST, || im2col(map, black_box(&mut gathered)));
    // Any order of the same weights takes the same time.
    let weights = &case.parts.weight;
    let mut out = vec![0.0; rows * outputs];
    let product = median_ns(SHORTEST, || {
        multiply([rows, depth, outputs], &gathered, weights, black_box(&mut out));
    });
    (gather, product)
}

/// Each position's 3 x 3 pixels.
fn im2col(map: &FeatureMap, out: &mut [f32]) {
    let (height, width, channels) = (map.height() as isize, map.width() as isize, map.channels());
    for (i, pixel) in out.chunks_exact_mut(channels).enumerate() {
        let (position, place) = ((i / 9) as isize, (i % 9) as isize);
        let (y, x) = (position / width + place / 3 - 1, position % width + place % 3 - 1);
        if (0..height).contains(&y) && (0..width).contains(&x) {
            pixel.copy_from_slice(map.pixel(y as usize, x as usize));
        } else {
            pixel.fill(0.0);
        }
    }
}

/// c = a b, (m, k) times (k, n).
fn multiply([m, k, n]: [usize; 3], a: &[f32], b: &[f32], c: &mut [f32]) {
    assert!(a.len() == m * k && b.len() == k * n && c.len() == m * n, "the matrices must have their sizes");
    let (k_step, n_step) = (k as isize, n as isize);
    #[allow(unsafe_code, reason = "the crate has no other entry")]
    // SAFETY: each matrix is as large as its sizes say, and the steps between rows and columns stay within it.
    unsafe {
        gemm::gemm(
            m,
            n,
            k,
            c.as_mut_ptr(),
            1,
            n_step,
            false,
            a.as_ptr(),
            1,
            k_step,
            b.as_ptr(),
            1,
            n_step,
            0.0,
            1.0,
            false,
            false,
            false,
            gemm::Parallelism::None,
        );
    }
}
