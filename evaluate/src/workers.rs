//! Recordings shared by threads.

use std::sync::atomic::{AtomicUsize, Ordering};

use rayon::ThreadPool;

/// The results of `work` for each of `items`, in their order, each thread of `pool` with a clone of `engine`.
///
/// The number of threads and the order in which they take items cannot reach a result where `work` resets its engine.
///
/// # Errors
/// The first error in the order of the items.
pub(crate) fn for_each<E: Clone + Sync, I: Sync, T: Send, X: Send>(
    pool: &ThreadPool,
    engine: &E,
    items: &[I],
    work: impl Fn(&mut E, &I) -> Result<T, X> + Sync,
) -> Result<Vec<T>, X> {
    let next = AtomicUsize::new(0);
    let worker = |_: rayon::BroadcastContext<'_>| {
        let mut engine = engine.clone();
        let mut done = Vec::new();
        loop {
            let place = next.fetch_add(1, Ordering::Relaxed);
            let Some(item) = items.get(place) else { return done };
            done.push((place, work(&mut engine, item)));
        }
    };
    let mut done: Vec<_> = pool.broadcast(worker).into_iter().flatten().collect();
    done.sort_by_key(|(place, _)| *place);
    done.into_iter().map(|(_, result)| result).collect()
}
