//! The one-dimensional transforms of Winograd's F(2, 3) and F(4, 3) (Lavin and Gray 2016).

use crate::isa::Vector;

/// The matrices of F(M, 3) with N = M + 2.
pub(super) trait Transform<const N: usize> {
    /// M.
    const OUT: usize;
    /// G.
    const KERNEL: [[f64; 3]; N];
    /// B^t d.
    fn input<S: Copy, V: Vector<S>>(simd: S, d: [V; N]) -> [V; N];
    /// A^t m, in the first M places.
    fn output<S: Copy, V: Vector<S>>(simd: S, m: [V; N]) -> [V; N];
}

/// F(2, 3).
pub(super) struct Two;

impl Transform<4> for Two {
    const OUT: usize = 2;
    const KERNEL: [[f64; 3]; 4] = [[1.0, 0.0, 0.0], [0.5, 0.5, 0.5], [0.5, -0.5, 0.5], [0.0, 0.0, 1.0]];

    #[inline(always)]
    fn input<S: Copy, V: Vector<S>>(_: S, [a, b, c, d]: [V; 4]) -> [V; 4] {
        [a.sub(c), b.add(c), c.sub(b), b.sub(d)]
    }

    #[inline(always)]
    fn output<S: Copy, V: Vector<S>>(_: S, [a, b, c, d]: [V; 4]) -> [V; 4] {
        [a.add(b).add(c), b.sub(c).sub(d), a, a]
    }
}

/// F(4, 3).
pub(super) struct Four;

impl Transform<6> for Four {
    const OUT: usize = 4;
    const KERNEL: [[f64; 3]; 6] = [
        [1.0 / 4.0, 0.0, 0.0],
        [-1.0 / 6.0, -1.0 / 6.0, -1.0 / 6.0],
        [-1.0 / 6.0, 1.0 / 6.0, -1.0 / 6.0],
        [1.0 / 24.0, 1.0 / 12.0, 1.0 / 6.0],
        [1.0 / 24.0, -1.0 / 12.0, 1.0 / 6.0],
        [0.0, 0.0, 1.0],
    ];

    /// 4a - 5c + e; (d - 4b) + (e - 4c); (e - 4c) - (d - 4b); (e - c) + 2(d - b); (e - c) - 2(d -
    /// b); 4b - 5d + f.
    #[inline(always)]
    fn input<S: Copy, V: Vector<S>>(simd: S, [a, b, c, d, e, f]: [V; 6]) -> [V; 6] {
        let (four, less_four) = (V::splat(simd, 4.0), V::splat(simd, -4.0));
        let less_five = V::splat(simd, -5.0);
        let (two, less_two) = (V::splat(simd, 2.0), V::splat(simd, -2.0));
        let (odd, even) = (d.add_product(b, less_four), e.add_product(c, less_four));
        let (db, ec) = (d.sub(b), e.sub(c));
        [
            e.add_product(c, less_five).add_product(a, four),
            even.add(odd),
            even.sub(odd),
            ec.add_product(db, two),
            ec.add_product(db, less_two),
            f.add_product(d, less_five).add_product(b, four),
        ]
    }

    /// a + (b + c) + (d + e); (b - c) + 2(d - e); (b + c) + 4(d + e); (b - c) + 8(d - e) + f.
    #[inline(always)]
    fn output<S: Copy, V: Vector<S>>(simd: S, [a, b, c, d, e, f]: [V; 6]) -> [V; 6] {
        let (bc, de, b_c, d_e) = (b.add(c), d.add(e), b.sub(c), d.sub(e));
        let (two, four, eight) = (V::splat(simd, 2.0), V::splat(simd, 4.0), V::splat(simd, 8.0));
        [
            a.add(bc).add(de),
            b_c.add_product(d_e, two),
            bc.add_product(de, four),
            f.add(b_c).add_product(d_e, eight),
            a,
            a,
        ]
    }
}
