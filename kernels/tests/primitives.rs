//! The parts of kernels: elementary functions and the inner loops of instruction sets.

#![expect(
    clippy::inline_always,
    reason = "a task that is not inlined into the wrapper of an instruction set does not use it"
)]

mod elementary {
    use meissner_kernels::inner::elus;
    use meissner_kernels::{Portable, elu, exp, expm1, sigmoid, softmax, tanh};

    /// Error of `got` in units of the last place of the f32 nearest to `want`.
    fn ulps(got: f32, want: f64) -> f64 {
        let nearest = want as f32;
        if got == nearest || (got.is_nan() && nearest.is_nan()) {
            return 0.0;
        }
        let ulp = if nearest.is_infinite() || nearest.abs() >= f32::MAX {
            2f64.powi(104)
        } else {
            f64::from(f32::from_bits(nearest.abs().to_bits() + 1)) - f64::from(nearest.abs())
        };
        (f64::from(got) - want).abs() / ulp
    }

    /// Every `stride`th bit pattern: all exponents, both signs, NaNs and infinities.
    fn sweep(stride: usize) -> impl Iterator<Item = f32> {
        (0..=u32::MAX).step_by(stride).map(f32::from_bits)
    }

    fn worst(f: impl Fn(f32) -> f32, exact: impl Fn(f64) -> f64) -> (f64, f32) {
        sweep(251).fold((0.0, 0.0), |worst, x| {
            let error = ulps(f(x), exact(f64::from(x)));
            if error > worst.0 { (error, x) } else { worst }
        })
    }

    #[test]
    fn exp_is_within_its_stated_bound() {
        let (error, x) = worst(exp, f64::exp);
        assert!(error <= 1.1, "{error} ULP at {x:e}");
    }

    #[test]
    fn expm1_is_within_its_stated_bound() {
        let (error, x) = worst(expm1, f64::exp_m1);
        assert!(error <= 1.4, "{error} ULP at {x:e}");
    }

    #[test]
    fn sigmoid_is_within_its_stated_bound() {
        // For x < 0, e^x / (1 + e^x) keeps digits that f64 loses when e^-x overflows.
        let exact =
            |x: f64| if x < 0.0 { f64::exp(x) / (1.0 + f64::exp(x)) } else { 1.0 / (1.0 + f64::exp(-x)) };
        let (error, x) = worst(sigmoid, exact);
        assert!(error <= 2.5, "{error} ULP at {x:e}");
    }

    #[test]
    fn tanh_is_within_its_stated_bound() {
        let (error, x) = worst(tanh, f64::tanh);
        assert!(error <= 2.5, "{error} ULP at {x:e}");
    }

    #[test]
    fn sigmoid_and_tanh_saturate_at_their_limits() {
        for (x, expected) in [
            (f32::NEG_INFINITY, 0.0),
            (-1e30, 0.0),
            (0.0, 0.5),
            (-0.0, 0.5),
            (40.0, 1.0),
            (f32::INFINITY, 1.0),
        ] {
            assert_eq!(sigmoid(x).to_bits(), f32::to_bits(expected), "{x}");
        }
        for x in [f32::INFINITY, 1e30, 20.0] {
            assert_eq!((tanh(x), tanh(-x)), (1.0, -1.0));
        }
        for x in [0.0, 1e-45, 1e-40, 1e-30] {
            assert_eq!((tanh(x).to_bits(), tanh(-x).to_bits()), (x.to_bits(), (-x).to_bits()));
        }
        assert!(sigmoid(f32::NAN).is_nan() && tanh(f32::NAN).is_nan());
    }

    #[test]
    fn sigmoid_and_tanh_never_leave_their_range() {
        for x in sweep(251).filter(|x| !x.is_nan()) {
            assert!((0.0..=1.0).contains(&sigmoid(x)) && tanh(x).abs() <= 1.0, "{x:e}");
        }
    }

    #[test]
    fn a_softmax_sums_to_one_and_does_not_overflow() {
        let mut values = [1000.0, 999.0, -1000.0];
        softmax(&mut values);
        let expected = [1.0 / (1.0 + f64::exp(-1.0)), 1.0 / (1.0 + f64::exp(1.0)), 0.0];
        for (got, expected) in values.iter().zip(expected) {
            assert!((f64::from(*got) - expected).abs() < 1e-6, "{got}, not {expected}");
        }
        let mut nan = [0.0, f32::NAN];
        softmax(&mut nan);
        assert!(nan.iter().all(|v| v.is_nan()));
        softmax(&mut []);
    }

    #[test]
    fn special_values_are_kept() {
        assert_eq!(exp(0.0), 1.0);
        assert_eq!(exp(f32::NEG_INFINITY), 0.0);
        assert_eq!(exp(f32::INFINITY), f32::INFINITY);
        assert_eq!(expm1(f32::NEG_INFINITY), -1.0);
        assert_eq!(expm1(f32::INFINITY), f32::INFINITY);
        assert_eq!(expm1(-0.0).to_bits(), (-0.0f32).to_bits());
        assert_eq!(expm1(1e-40).to_bits(), 1e-40f32.to_bits());
        assert!(exp(f32::NAN).is_nan() && expm1(f32::NAN).is_nan() && elu(f32::NAN).is_nan());
    }

    #[test]
    fn elus_in_step_are_the_same_bits() {
        let xs: Vec<f32> = sweep(251).filter(|x| !x.is_nan()).collect();
        for x in xs.as_chunks::<16>().0 {
            let (low, high) = x.split_at(8);
            let [a, b] = elus(Portable, [low, high].map(|half| <[f32; 8]>::try_from(half).expect("a half")));
            for (i, &x) in x.iter().enumerate() {
                let got = if i < 8 { a[i] } else { b[i - 8] };
                assert_eq!(got.to_bits(), elu(x).to_bits(), "{x:e}");
            }
        }
        assert!(elus(Portable, [[f32::NAN; 8]])[0].iter().all(|y| y.is_nan()));
    }

    #[test]
    fn elu_is_the_identity_above_zero() {
        for x in [1e-38, 0.3, 7.5, 1e30, f32::INFINITY] {
            assert_eq!(elu(x), x);
        }
    }
}

mod elementwise {
    use meissner_kernels::{Elementary, Isa, LANES};

    #[test]
    fn vectors_give_the_bits_of_the_scalar_functions_on_every_instruction_set() {
        let inputs: Vec<f32> = (0..=u32::MAX).step_by(65_519).map(f32::from_bits).collect();
        assert_ne!(inputs.len() % (2 * LANES), 0, "some values are left over");
        for function in Elementary::ALL {
            let expected: Vec<f32> = inputs.iter().map(|&x| function.of(x)).collect();
            for isa in Isa::available() {
                let mut values = inputs.clone();
                function.apply(isa, &mut values);
                for ((x, got), want) in inputs.iter().zip(&values).zip(&expected) {
                    let equal = got.to_bits() == want.to_bits() || (got.is_nan() && want.is_nan());
                    assert!(equal, "{} of {x:e} with {}: {got:e}, {want:e}", function.name(), isa.name());
                }
            }
        }
    }
}

mod random {
    use meissner_kernels::random::Random;

    #[test]
    fn the_generator_gives_its_published_values() {
        let mut random = Random::new(1_234_567);
        let found = [random.bits(), random.bits(), random.bits()];
        assert_eq!(found, [6_457_827_717_110_365_317, 3_203_168_211_198_807_973, 9_817_491_932_198_370_423]);
    }
}

mod divisor {
    use meissner_kernels::{Divisor, Isa, Simd, Task};
    use proptest::prelude::*;

    struct Divide(i64, i64);

    impl Task for Divide {
        type Output = f64;

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> f64 {
            Divisor::new(self.1).divide(simd, self.0 as f64)
        }
    }

    fn check(a: i64, b: i64) {
        for isa in Isa::available() {
            let found = isa.run(Divide(a, b));
            let expected = a as f64 / b as f64;
            assert_eq!(found.to_bits(), expected.to_bits(), "{a} / {b}, {}", isa.name());
        }
    }

    #[test]
    fn the_columns_of_a_sensor_are_divided_exactly() {
        for b in [1, 3, 260, 346, 720, 1280, 65_535] {
            for a in 0..b {
                check(a, b);
            }
        }
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200_000))]

        #[test]
        fn any_integer_is_divided_exactly(
            a in 0i64..1 << 53,
            short in 0u32..53,
            b in 1..=Divisor::MAX,
            shorter in 0u32..48,
            near in -2i64..=2,
        ) {
            let (a, b) = (a >> short, (b >> shorter).max(1));
            check(a, b);
            check(-a - 1, b);
            // Near a quotient with few bits, and near one that is halfway between two f64.
            let multiple = (a / b).saturating_mul(b).saturating_add(near);
            check(multiple.clamp(1 - (1 << 53), (1 << 53) - 1), b);
            let odd = ((1 << 53) - 1 - 2 * i64::from(short)) / b * b + near;
            check(odd.clamp(1 - (1 << 53), (1 << 53) - 1), b);
        }
    }
}

mod panel {
    use meissner_kernels::inner::{accumulate, accumulate_wide};
    use meissner_kernels::{LANES, Lanes, Portable, Wide};

    const WEIGHT: [Lanes; 2] = [Lanes::ZERO; 2];

    fn sums<const R: usize>() -> [[[f32; LANES]; 1]; R] {
        [[[0.0; LANES]; 1]; R]
    }

    /// Three rows, of which the last would begin at 2 * 2^63, which wraps to 0.
    #[should_panic(expected = "there must be a value for each weight")]
    #[test]
    fn a_stride_that_wraps_is_refused() {
        accumulate::<_, _, 3, 1, 0, 1>(Portable, &mut sums(), &[0.0; 4], 1 << (usize::BITS - 1), [&WEIGHT]);
    }

    #[should_panic(expected = "there must be a value for each weight")]
    #[test]
    fn a_distance_of_rows_that_wraps_is_refused() {
        let weights = [Lanes::ZERO; 4 * LANES + 1];
        accumulate_wide::<_, _, 1, 1>(
            Portable,
            &mut sums(),
            &[Wide::ZERO; 4],
            1 << (usize::BITS - 1),
            [&weights],
        );
    }
}

mod planar {
    use meissner_kernels::inner::{Taps, accumulate_taps};
    use meissner_kernels::{LANES, Portable};

    fn accumulate(stride: usize, plane: usize) {
        let mut sums = [[[0.0; LANES]; 1]; 1];
        let taps = Taps { values: &[0.0; 40], stride, plane };
        accumulate_taps(Portable, &mut sums, taps, &[[0.0; 1]; 27]);
    }

    #[test]
    fn taps_within_the_values_are_taken() {
        accumulate(4, 10);
    }

    #[should_panic(expected = "there must be a value for each tap")]
    #[test]
    fn a_stride_that_wraps_is_refused() {
        accumulate(1 << (usize::BITS - 1), 10);
    }

    #[should_panic(expected = "there must be a value for each tap")]
    #[test]
    fn a_plane_that_wraps_is_refused() {
        accumulate(4, 1 << (usize::BITS - 1));
    }
}

mod portable {
    use meissner_kernels::inner::{accumulate, fused_each};
    use meissner_kernels::{Isa, LANES, Lanes, Simd, Task, Vector, fused};
    use proptest::prelude::*;

    /// c + a b of eight lanes, and of two registers.
    struct AddProduct([Lanes; 3]);

    impl Task for AddProduct {
        type Output = [f32; LANES];

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> [f32; LANES] {
            let [a, b, c] = self.0.map(|lanes| S::V8::load(simd, &lanes));
            let mut out = Lanes::ZERO;
            c.add_product(a, b).store(&mut out);
            out.0
        }
    }

    /// c + a0 b0 + a1 b1 and so on, of eight lanes of b.
    struct AddProducts<'a> {
        values: &'a [f32],
        weights: &'a [Lanes],
        first: Lanes,
    }

    impl Task for AddProducts<'_> {
        type Output = [f32; LANES];

        #[inline(always)]
        fn run<S: Simd>(self, simd: S) -> [f32; LANES] {
            let mut acc = [[S::V8::load(simd, &self.first)]];
            accumulate::<S, S::V8, 1, 1, 0, 1>(simd, &mut acc, self.values, 0, [self.weights]);
            let mut out = Lanes::ZERO;
            acc[0][0].store(&mut out);
            out.0
        }
    }

    /// Values like those of trained networks, and values whose sums are often half-way between two
    /// f32.
    fn ordinary() -> BoxedStrategy<f32> {
        let few_bits = (-9i32..10, -30i32..30).prop_map(|(v, e)| v as f32 * 2f32.powi(e));
        let some = prop::sample::select(vec![0.0, -0.0, 1.0, 1.0 + f32::EPSILON, f32::EPSILON / 2.0]);
        prop_oneof![2 => -1.0f32..1.0, 1 => few_bits, 1 => some].boxed()
    }

    /// The same, and values whose sums may be too small or too large.
    fn any_factor() -> BoxedStrategy<f32> {
        let edges = [-51, -52, -75, -126, -149, 49, 50, 63, 127].map(|e| 2f32.powi(e));
        let edges = (prop::sample::select(edges.to_vec()), 0.5f32..1.0, any::<bool>())
            .prop_map(|(edge, part, whole)| if whole { edge } else { part * edge });
        prop_oneof![8 => ordinary(), 1 => edges, 1 => operand()].boxed()
    }

    /// Values, weights and first values of a sum.
    fn sum(of: fn() -> BoxedStrategy<f32>) -> impl Strategy<Value = (Vec<(f32, Lanes)>, Lanes)> {
        let lanes = || prop::array::uniform8(of()).prop_map(Lanes);
        let first = prop_oneof![3 => Just(Lanes::ZERO), 1 => lanes()];
        (prop::collection::vec((of(), lanes()), 1..12), first)
    }

    /// Any bits, values of similar size, and values that nearly cancel.
    fn operand() -> impl Strategy<Value = f32> {
        prop_oneof![
            any::<u32>().prop_map(f32::from_bits),
            -2.0f32..2.0,
            (-9i32..9).prop_map(|v| v as f32 * 1.5)
        ]
    }

    fn check(a: f32, b: f32, c: f32) -> Result<(), TestCaseError> {
        check_is(a, b, c, a.mul_add(b, c))
    }

    fn check_is(a: f32, b: f32, c: f32, expected: f32) -> Result<(), TestCaseError> {
        // Next to easy lanes that play no role.
        let lanes = |value: f32, other: f32| Lanes([other, other, other, value, other, other, value, other]);
        let operands = [lanes(a, 2.0), lanes(b, 3.0), lanes(c, 1.0)];
        let with = Isa::available().into_iter().map(|isa| isa.run(AddProduct(operands)));
        let with = with.flat_map(|[x, .., y, z]| {
            assert_eq!((x, z), (7.0, 7.0));
            [y]
        });
        for got in [fused(a, b, c), fused_each([a], [b], [c])[0]].into_iter().chain(with) {
            prop_assert!(
                got.to_bits() == expected.to_bits() || (got.is_nan() && expected.is_nan()),
                "{a:e} {b:e} {c:e}: {got:e}, not {expected:e}"
            );
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(200_000))]

        #[test]
        fn a_fused_product_and_sum_is_rounded_once(a in operand(), b in operand(), c in operand()) {
            check(a, b, c)?;
            check(a, b, -(a * b))?;
            check(a, b, f32::from_bits((a * b).to_bits() ^ 1))?;
            // A sum half-way between two f32, except for a tail that f64 loses.
            let (one, tail) = (1.0 + f32::EPSILON, f32::EPSILON / 2.0);
            check(one, tail, 1.0)?;
            check(one * a, tail, a)?;
        }
    }

    fn check_sum(values: &[f32], weights: &[Lanes], first: Lanes) -> Result<(), TestCaseError> {
        for isa in Isa::available() {
            let got = isa.run(AddProducts { values, weights, first });
            for (lane, got) in got.into_iter().enumerate() {
                let products = values.iter().zip(weights);
                let want = products.fold(first.0[lane], |sum, (a, b)| a.mul_add(b.0[lane], sum));
                prop_assert!(
                    got.to_bits() == want.to_bits() || (got.is_nan() && want.is_nan()),
                    "{} {values:?} {weights:?} {first:?}: {got:e}, not {want:e}",
                    isa.name()
                );
            }
        }
        Ok(())
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(20_000))]

        #[test]
        fn each_product_of_a_sum_is_rounded_once_with_it(
            (products, first) in prop_oneof![2 => sum(ordinary), 1 => sum(any_factor)],
        ) {
            let (values, weights): (Vec<f32>, Vec<Lanes>) = products.into_iter().unzip();
            check_sum(&values, &weights, first)?;
        }
    }

    #[test]
    fn sums_at_the_edges_of_f64_sums_are_rounded_once() {
        let tiny = 2f32.powi(-51);
        let half = f32::EPSILON / 2.0;
        let below = |x: f32| f32::from_bits(x.to_bits() - 1);
        for (values, weights, first) in [
            // Half-way, to even in both directions.
            (vec![1.0, half], vec![1.0, 1.0], 0.0),
            (vec![1.0, half], vec![1.0 + f32::EPSILON, 1.0], 0.0),
            (vec![1.0, half, half * half], vec![1.0, 1.0, half], 0.0),
            // The smallest factors that are summed in f64, and smaller ones.
            (vec![tiny, tiny, tiny], vec![tiny, -tiny, tiny], 0.0),
            (vec![below(tiny), tiny], vec![tiny, below(tiny)], 0.0),
            (vec![2f32.powi(-75), 1.0], vec![2f32.powi(-75), 2f32.powi(-149)], f32::from_bits(3)),
            // A sum that leaves f32 and would come back.
            (vec![2f32.powi(64), 2f32.powi(64)], vec![2f32.powi(64), -2f32.powi(64)], 0.0),
            (vec![1.0, 1.0], vec![f32::MAX, -f32::MAX], f32::MAX),
            // Signs of zero.
            (vec![0.0], vec![-1.0], 0.0),
            (vec![0.0], vec![-1.0], -0.0),
            (vec![1.0, 0.0], vec![1.0, -1.0], -1.0),
            // Not a number.
            (vec![f32::NAN], vec![1.0], 0.0),
            (vec![f32::INFINITY, 1.0], vec![1.0, f32::NEG_INFINITY], 0.0),
        ] {
            let weights: Vec<Lanes> = weights.into_iter().map(|w| Lanes([w; LANES])).collect();
            check_sum(&values, &weights, Lanes([first; LANES])).expect("one rounding each");
        }
    }

    #[test]
    fn a_subnormal_sum_that_f64_takes_for_half_way_is_rounded_once() {
        // a b is a little less than half of the last place of c, so c does not change. The fused
        // product of a platform without such an instruction can round such sums twice.
        let (scale, tail) = (2f32.powi(-75), 2f32.powi(-15));
        let (a, b) = (scale * (1.0 + tail), scale * (1.0 - tail));
        for c in [(1 << 22) + 1, (1 << 23) - 1, 1 << 23, 1].map(f32::from_bits) {
            for (a, c) in [(a, c), (-a, -c), (-a, c), (a, -c)] {
                check_is(a, b, c, c).expect("one rounding");
            }
        }
        check_is(scale, scale, 0.0, 0.0).expect("half of the smallest");
        check_is(a, b, 0.0, 0.0).expect("less than half of the smallest");
    }
}
