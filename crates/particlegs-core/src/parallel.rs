//! Work over several threads: the few forms that the library needs. Without the feature `threads` the same work is
//! done in order, to the same bits.
//!
//! Of what may fail the first error in the order of the items is given, whatever the threads, and nothing that follows it is
//! begun.
//!
//! All of them are thin covers of `each`, which is compiled once: what is generic down to the threads would be
//! compiled again for every use.

use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};

/// Pieces that items are worked on in, for each thread: enough for all threads to end together.
const PIECES: usize = 64;
/// Keys that one thread sorts.
const ALONE: usize = 1 << 14;
/// Items in a piece, at most.
const MOST: usize = 1024;

/// Calls `action` with every number below `n`, on as many threads as there are. Numbers are begun in their order.
fn each(n: usize, action: &(dyn Fn(usize) + Sync)) {
    let next = AtomicUsize::new(0);
    let work = || {
        // Relaxed, as the counter orders nothing: results are handed over by locks and by the end of the scope.
        while let i = next.fetch_add(1, Ordering::Relaxed)
            && i < n
        {
            action(i);
        }
    };
    #[cfg(feature = "threads")]
    if n > 1 && threads() > 1 {
        return rayon_core::scope(|scope| {
            (1..threads().min(n)).for_each(|_| scope.spawn(|_| work()));
            work();
        });
    }
    work();
}

/// Items in a piece of work, of `n` in all.
fn piece(n: usize) -> usize {
    (n / (PIECES * threads())).clamp(1, MOST)
}

/// No work is done under a lock: nothing that it guards can be half made.
fn lock<T>(slot: &Mutex<T>) -> MutexGuard<'_, T> {
    slot.lock().unwrap_or_else(PoisonError::into_inner)
}

/// `value_of(0)`, `value_of(1)`, ... `value_of(n - 1)`.
pub fn map_range<R: Send>(n: usize, value_of: impl Fn(usize) -> R + Sync) -> Vec<R> {
    let size = piece(n);
    let parts: Vec<Mutex<Vec<R>>> = (0..n.div_ceil(size)).map(|_| Mutex::default()).collect();
    each(parts.len(), &|k| {
        let mut part = Vec::with_capacity(size);
        for i in k * size..n.min((k + 1) * size) {
            part.push(value_of(i));
        }
        *lock(&parts[k]) = part;
    });
    let mut all = Vec::with_capacity(n);
    for part in &parts {
        all.append(&mut lock(part));
    }
    all
}

/// [`map_range`] of what may fail.
pub fn try_map_range<R: Send, E: Send>(n: usize, value_of: impl Fn(usize) -> Result<R, E> + Sync) -> Result<Vec<R>, E> {
    let failed = AtomicUsize::new(n);
    let one = |i: usize| {
        // Items before the first error so far go on, as one of them may fail, too.
        let result = (i < failed.load(Ordering::Relaxed)).then(|| value_of(i))?;
        if result.is_err() {
            failed.fetch_min(i, Ordering::Relaxed);
        }
        Some(result)
    };
    let mut all = Vec::with_capacity(n);
    for result in map_range(n, one).into_iter().flatten() {
        all.push(result?);
    }
    Ok(all)
}

/// `value_of` every item, in their order.
pub fn map<T: Send, R: Send>(items: impl IntoIterator<Item = T>, value_of: impl Fn(T) -> R + Sync) -> Vec<R> {
    let items = slots(items);
    map_range(items.len(), |i| value_of(taken(&items[i])))
}

/// [`map`] of what may fail.
pub fn try_map<T: Send, R: Send, E: Send>(
    items: impl IntoIterator<Item = T>,
    value_of: impl Fn(T) -> Result<R, E> + Sync,
) -> Result<Vec<R>, E> {
    let items = slots(items);
    try_map_range(items.len(), |i| value_of(taken(&items[i])))
}

/// Places that items are taken from, each once, by any thread.
fn slots<T>(items: impl IntoIterator<Item = T>) -> Vec<Mutex<Option<T>>> {
    items.into_iter().map(|item| Mutex::new(Some(item))).collect()
}

fn taken<T>(slot: &Mutex<Option<T>>) -> T {
    lock(slot).take().expect("every item is taken once")
}

/// Calls `work` with every item.
pub fn for_each<T: Send>(items: impl IntoIterator<Item = T>, work: impl Fn(T) + Sync) {
    let items = slots(items);
    each(items.len(), &|i| work(taken(&items[i])));
}

/// [`for_each`] of what may fail.
pub fn try_for_each<T: Send, E: Send>(
    items: impl IntoIterator<Item = T>,
    each: impl Fn(T) -> Result<(), E> + Sync,
) -> Result<(), E> {
    try_map(items, each).map(drop)
}

/// Calls `each` with the number and the values of every chunk of `size` values, the last of which may be
/// shorter.
pub fn for_each_chunk<T: Send>(values: &mut [T], size: usize, each: impl Fn(usize, &mut [T]) + Sync) {
    for_each_chunk_with(values, size, || (), |(), i, chunk| each(i, chunk));
}

/// [`for_each_chunk`] with scratch space that some chunks share.
pub fn for_each_chunk_with<T: Send, S>(
    values: &mut [T],
    size: usize,
    scratch: impl Fn() -> S + Sync,
    each: impl Fn(&mut S, usize, &mut [T]) + Sync,
) {
    // Chunks are joined to runs, so that scratch space is made once for many.
    let run = piece(values.len().div_ceil(size));
    for_each(values.chunks_mut(run * size).enumerate(), |(k, values)| {
        let mut scratch = scratch();
        values.chunks_mut(size).enumerate().for_each(|(i, chunk)| each(&mut scratch, k * run + i, chunk));
    });
}

/// Scratch space that pieces of work take and give back: about one for each thread.
#[derive(Default)]
pub struct Scratch<S>(Mutex<Vec<S>>);

impl<S: Default> Scratch<S> {
    /// `work` with scratch space as the last to use it left it.
    pub fn with<R>(&self, work: impl FnOnce(&mut S) -> R) -> R {
        // Taken out, so that no lock is held during the work.
        let last = lock(&self.0).pop();
        let mut scratch = last.unwrap_or_default();
        let result = work(&mut scratch);
        lock(&self.0).push(scratch);
        result
    }
}

/// Both, side by side.
pub fn join<A: Send, B: Send>(a: impl FnOnce() -> A + Send, b: impl FnOnce() -> B + Send) -> (A, B) {
    #[cfg(feature = "threads")]
    return rayon_core::join(a, b);
    #[cfg(not(feature = "threads"))]
    (a(), b())
}

/// Sorts keys with the number of what each is the key of: the halves about the median side by side, and theirs.
pub fn sort_keys(keys: &mut [(u64, u32)]) {
    let middle = keys.len() / 2;
    if keys.len() < ALONE || threads() == 1 {
        return keys.sort_unstable();
    }
    let (below, _, above) = keys.select_nth_unstable(middle);
    join(|| sort_keys(below), || sort_keys(above));
}

/// Threads that share work.
pub fn threads() -> usize {
    #[cfg(feature = "threads")]
    return rayon_core::current_num_threads();
    #[cfg(not(feature = "threads"))]
    1
}

/// Sets how many threads share work, once and before any is done.
///
/// # Errors
/// A system that has not so many, or threads that are set already.
pub fn set_threads(threads: usize) -> Result<(), String> {
    #[cfg(feature = "threads")]
    return rayon_core::ThreadPoolBuilder::new().num_threads(threads).build_global().map_err(|e| e.to_string());
    #[cfg(not(feature = "threads"))]
    if threads == 1 { Ok(()) } else { Err("built without threads".into()) }
}

/// `work` on so many threads of its own, which end with it: what is left of it is not the process's.
///
/// # Errors
/// A system that has not so many.
pub fn with_threads<R: Send>(threads: usize, work: impl FnOnce() -> R + Send) -> Result<R, String> {
    #[cfg(feature = "threads")]
    {
        let pool = rayon_core::ThreadPoolBuilder::new().num_threads(threads).build().map_err(|e| e.to_string())?;
        Ok(pool.install(work))
    }
    #[cfg(not(feature = "threads"))]
    if threads == 1 { Ok(work()) } else { Err("built without threads".into()) }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn results_stand_in_order_and_the_first_error_is_told() {
        for n in [0, 1, 7, 5000] {
            assert!(map_range(n, |i| i * i).into_iter().eq((0..n).map(|i| i * i)));
            assert!(map((0..n).map(|i| i.to_string()), |s| s + "!").into_iter().eq((0..n).map(|i| format!("{i}!"))));
            let odd = try_map_range(n, |i| if i % 1000 == 999 { Err(i) } else { Ok(i) });
            assert_eq!(odd.map(|all| all.len()), if n > 999 { Err(999) } else { Ok(n) });
        }
    }

    #[test]
    fn keys_are_sorted() {
        let mut random = crate::math::Random::new(1, 0, 0);
        let mut keys: Vec<(u64, u32)> = (0..100_000).map(|i| (random.bits() % 1000, i)).collect();
        let mut expected = keys.clone();
        expected.sort_unstable();
        sort_keys(&mut keys);
        assert!(keys == expected);
    }

    #[test]
    fn every_chunk_is_visited_once() {
        let mut values = vec![0u32; 10_001];
        for_each_chunk_with(
            &mut values,
            3,
            || 7,
            |seven, i, chunk| chunk.iter_mut().for_each(|v| *v += *seven + i as u32),
        );
        assert!(values.iter().enumerate().all(|(at, v)| *v == 7 + (at / 3) as u32));
        let scratch = Scratch::<Vec<usize>>::default();
        let seen = map_range(100, |i| {
            scratch.with(|all| {
                all.push(i);
                map_range(10, |k| k).len()
            })
        });
        assert_eq!(seen.iter().sum::<usize>(), 1000);
    }
}
