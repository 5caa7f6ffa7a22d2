//! Spline convolution of one row: open B-splines of degree 1, mean over in-edges, ELU, batch norm,
//! skip (`SplineCNN`, Fey et al. 2018, Eq. 2 and 5; the contact-angle paper's block).
//!
//! For a row with in-edges e = 1..n from rows j(e), with attributes u(e) in [0, 1]:
//!
//! ```text
//! v_d    = u_d (k_d - 1), i_d = min(floor(v_d), k_d - 2), f_d = v_d - i_d    if k_d > 1
//! B(e,s) = (w_x w_y) w_t, w_d = 1 - f_d at i_d, f_d at i_d + 1;     s = i_x + k_x (i_y + k_y i_t)
//! S(s,c) = sum over e of B(e,s) x(j(e), c)                          in the order of edges
//! a(p,o) = sum over touched s, then c, ascending, of S(s,c) W(s,c,o), (s C + c) mod 4 = p
//! m(o)   = ((a(0,o) + a(1,o)) + (a(2,o) + a(3,o))) (1 / n)          0 without in-edges
//! r(o)   = the same four partial sums over c of x(i,c) R(c,o)       if there is a root weight
//! y(o)   = ELU((m + r) + bias) scale + shift  (+ skip)
//! ```
//!
//! Every product that is added, in S, a, r and y, is rounded once with its sum.
//!
//! Summing inputs per kernel slot before weights costs n s C + s C O multiply-adds, not n s C O.
//! Four partial sums keep the adders busy; their order is part of the contract.

mod block;
mod contract;
mod gather;
mod run;

use crate::graph::GraphRow;
use crate::isa::Isa;
use crate::lanes::Lanes;
use crate::matrix::Matrix;
pub use block::{SplineConv, SplineParts, spline_multiply_adds};
pub(crate) use gather::locate;
pub use gather::{SplineScratch, spline_basis};
use run::Run;

impl SplineConv {
    /// Computes rows, each as if alone; together they share loaded weights. Fastest in groups of
    /// [`Self::GROUP`].
    ///
    /// `features` is (rows, C); `out` holds the rows' O values in lanes, one row after the other.
    ///
    /// # Panics
    /// If a row or a slice does not have the sizes of this block.
    #[inline]
    pub fn rows(
        &self,
        isa: Isa,
        features: &Matrix,
        rows: &[GraphRow<'_>],
        scratch: &mut SplineScratch,
        out: &mut [Lanes],
    ) {
        isa.run(Run { conv: self, features, rows, scratch, out });
    }
}
