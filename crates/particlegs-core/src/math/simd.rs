//! The instruction set, chosen at run time: for the whole program at its start, or for one piece of work.

use fearless_simd::Level;
use std::cell::Cell;
use std::sync::atomic::{AtomicBool, Ordering};

/// The program's choice.
static OFF: AtomicBool = AtomicBool::new(false);

thread_local! {
    /// Whether this thread belongs to a pool of [`without_simd`].
    static PLAIN: Cell<bool> = const { Cell::new(false) };
}

/// Turns vector instructions off for the rest of the program. Results are the same bits either way.
pub fn disable_simd() {
    OFF.store(true, Ordering::Relaxed);
}

/// Does `work` without vector instructions, on threads of its own: what runs beside it keeps its level.
///
/// # Panics
/// Where the system gives no threads.
pub fn without_simd<T: Send>(work: impl FnOnce() -> T + Send) -> T {
    let pool = rayon::ThreadPoolBuilder::new()
        .num_threads(rayon::current_num_threads())
        .start_handler(|_| PLAIN.set(true))
        .build()
        .expect("threads for work without vector instructions");
    pool.install(work)
}

/// The level to hand to [`fearless_simd::dispatch!`].
pub fn simd_level() -> Level {
    if PLAIN.get() || OFF.load(Ordering::Relaxed) { Level::baseline() } else { Level::new() }
}

#[cfg(test)]
mod tests {
    use super::*;
    use rayon::prelude::*;

    fn levels() -> Vec<String> {
        let of = |_| format!("{:?}", simd_level());
        (0..1000).into_par_iter().map(of).collect()
    }

    #[test]
    fn the_plain_level_is_that_of_one_piece_of_work() {
        let all = |levels: &[String], one: Level| levels.iter().all(|l| *l == format!("{one:?}"));
        let (plain, beside) = without_simd(|| {
            let beside = std::thread::spawn(simd_level).join().unwrap();
            (levels(), format!("{beside:?}"))
        });
        assert!(all(&plain, Level::baseline()), "{plain:?}");
        assert_eq!(beside, format!("{:?}", Level::new()), "another thread keeps its level");
        assert!(all(&levels(), Level::new()), "the level comes back");
    }
}
