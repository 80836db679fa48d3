//! Work over several threads: the few forms that this crate needs. Without the feature `threads` the
//! same work is done in order, to the same bits.

#[cfg(feature = "threads")]
use rayon::prelude::*;

/// `of(0)`, `of(1)`, ... `of(n - 1)`.
pub(crate) fn map_range<R: Send>(n: usize, of: impl Fn(usize) -> R + Send + Sync) -> Vec<R> {
    #[cfg(feature = "threads")]
    return (0..n).into_par_iter().map(of).collect();
    #[cfg(not(feature = "threads"))]
    (0..n).map(of).collect()
}

/// `of` every item, in their order.
pub(crate) fn map<T: Send, R: Send>(items: Vec<T>, of: impl Fn(T) -> R + Send + Sync) -> Vec<R> {
    #[cfg(feature = "threads")]
    return items.into_par_iter().map(of).collect();
    #[cfg(not(feature = "threads"))]
    items.into_iter().map(of).collect()
}

/// Calls `each` with every item; items are few and their work is long.
pub(crate) fn try_for_each<T: Send, E: Send>(
    items: Vec<T>,
    each: impl Fn(T) -> Result<(), E> + Send + Sync,
) -> Result<(), E> {
    #[cfg(feature = "threads")]
    return items.into_par_iter().with_max_len(1).try_for_each(each);
    #[cfg(not(feature = "threads"))]
    items.into_iter().try_for_each(each)
}

/// Calls `each` with the number and the values of every chunk of `size` values, the last of which may be
/// shorter.
pub(crate) fn for_each_chunk<T: Send>(values: &mut [T], size: usize, each: impl Fn(usize, &mut [T]) + Send + Sync) {
    for_each_chunk_with(values, size, || (), |(), i, chunk| each(i, chunk));
}

/// [`for_each_chunk`] with a thread's own scratch space.
pub(crate) fn for_each_chunk_with<T: Send, S>(
    values: &mut [T],
    size: usize,
    scratch: impl Fn() -> S + Send + Sync,
    each: impl Fn(&mut S, usize, &mut [T]) + Send + Sync,
) {
    #[cfg(feature = "threads")]
    values.par_chunks_mut(size).enumerate().for_each_init(scratch, |scratch, (i, chunk)| each(scratch, i, chunk));
    #[cfg(not(feature = "threads"))]
    {
        let mut scratch = scratch();
        values.chunks_mut(size).enumerate().for_each(|(i, chunk)| each(&mut scratch, i, chunk));
    }
}

/// Both, side by side.
pub(crate) fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    #[cfg(feature = "threads")]
    return rayon::join(a, b);
    #[cfg(not(feature = "threads"))]
    (a(), b())
}

/// Sorts; values that are equal are the same.
pub(crate) fn sort_unstable<T: Ord + Send>(values: &mut [T]) {
    #[cfg(feature = "threads")]
    values.par_sort_unstable();
    #[cfg(not(feature = "threads"))]
    values.sort_unstable();
}

/// Threads that share work.
pub(crate) fn threads() -> usize {
    #[cfg(feature = "threads")]
    return rayon::current_num_threads();
    #[cfg(not(feature = "threads"))]
    1
}

/// Adds bytes to a hash.
pub(crate) fn hash(hasher: &mut blake3::Hasher, bytes: &[u8]) {
    #[cfg(feature = "threads")]
    hasher.update_rayon(bytes);
    #[cfg(not(feature = "threads"))]
    hasher.update(bytes);
}
