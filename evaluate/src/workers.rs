//! Recordings shared by threads.

use rayon::ThreadPool;
use rayon::prelude::*;

/// The results of `work` for each of `items`, in their order, on the threads of `pool`, each with clones of `engine`.
///
/// The number of threads and the order in which they take items cannot reach a result if `work` resets its engine.
///
/// # Errors
/// The first error in the order of the items.
pub(crate) fn for_each<E: Clone + Sync, I: Sync, T: Send, X: Send>(
    pool: &ThreadPool,
    engine: &E,
    items: &[I],
    work: impl Fn(&mut E, &I) -> Result<T, X> + Sync + Send,
) -> Result<Vec<T>, X> {
    let work = || items.par_iter().map_init(|| engine.clone(), work).collect::<Vec<_>>();
    pool.install(work).into_iter().collect()
}
