//! Heads that are linear in the readout: ridge regression, and a shrunken discriminant.
//!
//! ```text
//! quantities  w = (X^T X + s)^-1 X^T (y - mean y)
//! classes     w = S^-1 (m_c - m),  bias = log p_c - (m_c + m) w / 2
//!             S = (C + r v I) / (1 + r)
//! ```
//! where C is the covariance within classes, v its mean variance and p the share of a class
//! (Hoerl and Kennard 1970, "Ridge regression"; Friedman 1989, "Regularized discriminant
//! analysis"; the target of Ledoit and Wolf 2004, "A well-conditioned estimator for
//! large-dimensional covariance matrices"). A strength r is relative: `s = r v rows`.

use libm::log;
use ndarray::{Array2, Axis};

use super::design::{Design, Linear, System};
use super::samples::{Instant, Target};

/// Strengths that are tried.
pub(super) const STRENGTHS: [f64; 9] = [1e-4, 1e-3, 3.2e-3, 1e-2, 3.2e-2, 0.1, 0.32, 1.0, 10.0];

/// The heads of `rows` for each of the relative `strengths`; `None` where rounding forbids it.
pub(super) fn fit(
    design: Design<'_>,
    target: &Target,
    instants: &[Instant],
    rows: &[usize],
    strengths: &[f64],
) -> Vec<Option<Linear>> {
    match target {
        Target::Quantities(each) => {
            let group = vec![0; rows.len()];
            let system = design.system(rows, &group, 1);
            quantities(&system, each.len(), instants, rows, strengths)
        }
        Target::Classes { names, .. } => {
            let group: Vec<usize> = rows.iter().map(|&row| instants[row].truth[0] as usize).collect();
            let system = design.system(rows, &group, names.len());
            classes(&system, names.len(), &group, strengths)
        }
    }
}

/// The heads of a system whose targets in scaled columns are `of`; `bias` completes each.
fn solved(
    system: &System<'_>,
    of: &Array2<f64>,
    relative: &[f64],
    complete: impl Fn(f64, Array2<f64>) -> Linear,
) -> Vec<Option<Linear>> {
    let size = system.size();
    let size = if size > 0.0 { size } else { 1.0 };
    let strengths: Vec<f64> = relative.iter().map(|relative| relative * size).collect();
    let found = system.solve(of, &strengths).into_iter().zip(relative);
    found.map(|(found, &relative)| found.map(|weight| complete(relative, weight))).collect()
}

fn quantities(
    system: &System<'_>,
    outputs: usize,
    instants: &[Instant],
    rows: &[usize],
    strengths: &[f64],
) -> Vec<Option<Linear>> {
    let mut truth =
        Array2::from_shape_fn((rows.len(), outputs), |(i, output)| instants[rows[i]].truth[output]);
    let mean = truth.sum_axis(Axis(0)) / rows.len().max(1) as f64;
    truth -= &mean;
    solved(system, &system.transposed(&truth), strengths, |_, mut weight| {
        rescale(&mut weight, &system.scale);
        let bias = weight.rows().into_iter().zip(&mean).map(|(w, mean)| mean - along(w.iter(), &system.mean));
        Linear { bias: bias.collect(), weight }
    })
}

fn classes(system: &System<'_>, classes: usize, group: &[usize], strengths: &[f64]) -> Vec<Option<Linear>> {
    let mut apart = system.means.clone();
    for mut row in apart.rows_mut() {
        for ((value, mean), scale) in row.iter_mut().zip(&system.mean).zip(&system.scale) {
            *value = (*value - mean) * scale;
        }
    }
    let mut counts = vec![0_usize; classes];
    group.iter().for_each(|&class| counts[class] += 1);
    let rows = group.len().max(1) as f64;
    solved(system, &apart, strengths, |relative, mut weight| {
        weight *= (1.0 + relative) * rows;
        rescale(&mut weight, &system.scale);
        let bias = (0..classes).map(|class| {
            let between = weight.row(class).into_iter().zip(system.means.row(class)).zip(&system.mean);
            let between: f64 = between.map(|((w, of), mean)| w * (of + mean)).sum();
            // A class that these presses lack gets half a row.
            log((counts[class] as f64).max(0.5) / rows) - between / 2.0
        });
        Linear { bias: bias.collect(), weight }
    })
}

fn rescale(weight: &mut Array2<f64>, scale: &[f64]) {
    weight.rows_mut().into_iter().for_each(|mut row| {
        row.iter_mut().zip(scale).for_each(|(w, scale)| *w *= scale);
    });
}

fn along<'a>(weight: impl Iterator<Item = &'a f64>, of: &[f64]) -> f64 {
    weight.zip(of).map(|(w, x)| w * x).sum()
}
