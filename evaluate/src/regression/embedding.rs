//! What a network reads out of presses, in two dimensions (t-SNE).
//!
//! Enters: the readout of each press at its end. Leaves: a point for each. Neighbours in the
//! readout are neighbours in the plane; distances between groups mean nothing (van der Maaten and
//! Hinton 2008, "Visualizing data using t-SNE").

use bhtsne::tSNE;
use meissner_kernels::random::Random;
use rayon::ThreadPoolBuilder;

/// The number of neighbours that a point is placed among, of which a press has at least three times
/// as many.
const PERPLEXITY: usize = 30;
const EPOCHS: usize = 1_000;
/// Size of the square in which the points begin.
const START: f32 = 1e-4;

/// A point for each of `readouts`; `None` for too few. O(presses^2 (channels + epochs)), in one
/// thread: the order of the sums over points is then the same every time.
///
/// # Panics
/// If the system gives no thread.
pub(super) fn embedding(readouts: &[Vec<f32>]) -> Option<Vec<(f64, f64)>> {
    let perplexity = PERPLEXITY.min(readouts.len().checked_sub(1)? / 3);
    if perplexity < 2 {
        return None;
    }
    let start = Random::new(1).values(2 * readouts.len(), START);
    let distance =
        |a: &Vec<f32>, b: &Vec<f32>| a.iter().zip(b).map(|(a, b)| (a - b) * (a - b)).sum::<f32>().sqrt();
    let thread = ThreadPoolBuilder::new().num_threads(1).build().expect("the system has a thread");
    let points = thread.install(|| {
        let mut plane: tSNE<'_, f32, Vec<f32>, 2> = tSNE::new(readouts);
        plane.perplexity(perplexity as f32).epochs(EPOCHS).initial_embedding(start);
        plane.exact(distance);
        plane.embedding()
    });
    Some(points.chunks(2).map(|point| (f64::from(point[0]), f64::from(point[1]))).collect())
}

#[cfg(test)]
mod tests {
    use super::embedding;
    use meissner_kernels::random::Random;

    #[test]
    fn two_groups_stay_apart_and_the_same_presses_give_the_same_points() {
        let mut random = Random::new(3);
        let readouts: Vec<Vec<f32>> = (0..60)
            .map(|i| (0..5).map(|_| random.symmetric() + if i < 30 { 0.0 } else { 20.0 }).collect())
            .collect();
        let points = embedding(&readouts).expect("enough presses");
        assert_eq!(Some(&points), embedding(&readouts).as_ref());
        let distance = |a: (f64, f64), b: (f64, f64)| (a.0 - b.0).hypot(a.1 - b.1);
        for (i, &point) in points.iter().enumerate() {
            let others = (0..60).filter(|&j| j != i);
            let nearest =
                others.min_by(|&a, &b| distance(point, points[a]).total_cmp(&distance(point, points[b])));
            assert_eq!(nearest.map(|j| j < 30), Some(i < 30), "press {i}");
        }
    }

    #[test]
    fn a_few_presses_have_no_embedding() {
        assert!(embedding(&[]).is_none() && embedding(&vec![vec![1.0]; 6]).is_none());
        assert_eq!(embedding(&vec![vec![1.0]; 7]).map(|points| points.len()), Some(7), "equal ones too");
    }
}
