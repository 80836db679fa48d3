//! The process among others: signals that stop it, and the number of threads that it may use.

use std::num::NonZeroUsize;
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Arc, LazyLock, OnceLock};
use std::time::{Duration, Instant};

static STOP: AtomicBool = AtomicBool::new(false);
/// Whether the work writes a checkpoint when it is stopped.
static KEEPS: AtomicBool = AtomicBool::new(false);
/// Time for that after the first signal; further signals are ignored meanwhile.
const FOR_A_CHECKPOINT: Duration = Duration::from_secs(10);
/// Set by SIGUSR1, which batch systems send before they end a task.
static SOON: LazyLock<Arc<AtomicBool>> = LazyLock::new(Arc::default);

/// Whether a signal has asked the work to stop.
pub fn is_stopped() -> bool {
    STOP.load(Ordering::SeqCst) || SOON.load(Ordering::SeqCst)
}

/// From now on a stop writes a checkpoint.
pub fn keep_checkpoint() {
    KEEPS.store(true, Ordering::SeqCst);
}

/// Starts a thread that calls [`stop`] at every signal to end.
#[cfg(unix)]
pub fn meet_stop_signals() {
    use signal_hook::consts::{SIGHUP, SIGINT, SIGTERM, SIGUSR1};
    // Only a flag: a second SIGUSR1 does not end the process, as a second SIGTERM does.
    let _ = signal_hook::flag::register(SIGUSR1, Arc::clone(&SOON));
    if let Ok(mut signals) = signal_hook::iterator::Signals::new([SIGINT, SIGTERM, SIGHUP]) {
        std::thread::spawn(move || signals.forever().for_each(|_| stop()));
    }
}

#[cfg(not(unix))]
pub fn meet_stop_signals() {
    let _ = ctrlc::set_handler(stop);
}

/// Turns a limit on file sizes into an error of writing, instead of a signal that ends the process.
pub fn meet_file_size_limits() {
    #[cfg(unix)]
    // Nobody reads the flag: with any handler `write` fails with EFBIG instead.
    let _ = signal_hook::flag::register(signal_hook::consts::SIGXFSZ, Arc::default());
}

/// Asks the work to stop. A second signal ends the process at once, unless it is writing a checkpoint. Outputs are
/// complete or absent either way.
fn stop() {
    static FIRST: OnceLock<Instant> = OnceLock::new();
    let again = STOP.swap(true, Ordering::SeqCst);
    let first = FIRST.get_or_init(Instant::now);
    if again && !(KEEPS.load(Ordering::SeqCst) && first.elapsed() < FOR_A_CHECKPOINT) {
        // 128 and the number of SIGINT, as shells report it.
        std::process::exit(130);
    }
}

/// Meets SIGBUS, which the system sends if another program truncates a memory-mapped file: ends the process with one
/// line and the exit code of a failed read. Outputs have no names until they are complete, so nothing remains.
#[cfg(unix)]
pub fn end_with_message() {
    use signal_hook::consts::SIGBUS;
    const LINE: &[u8] = b"error: a file ended while being read: another program truncated it, or its disk failed\n";
    let end = || {
        // Not `eprintln`: the thread that was interrupted may hold its lock.
        let _ = rustix::io::write(rustix::stdio::stderr(), LINE);
        signal_hook::low_level::exit(6);
    };
    // SAFETY: the handler only writes a constant and exits, both by system calls.
    let _ = unsafe { signal_hook::low_level::register(SIGBUS, end) };
}

/// Mapped files cannot be truncated on this system.
#[cfg(not(unix))]
pub fn end_with_message() {}

/// Environment variables with a number of threads, most explicit first. Those of batch systems come before
/// OMP_NUM_THREADS, which some sites set to 1 for everyone.
const VARIABLES: [&str; 7] =
    ["RAYON_NUM_THREADS", "SLURM_CPUS_PER_TASK", "PBS_NCPUS", "NCPUS", "LSB_DJOB_NUMPROC", "NSLOTS", "OMP_NUM_THREADS"];

/// Default of `--threads`.
pub fn threads() -> usize {
    // This respects the affinity mask and, on Linux, the quota of the control group.
    let cores = std::thread::available_parallelism().map_or(1, NonZeroUsize::get);
    threads_of(|name| std::env::var(name).ok(), cores)
}

/// As [`threads`], on a machine that lets this process use `cores`.
fn threads_of(variable: impl Fn(&str) -> Option<String>, cores: usize) -> usize {
    // OMP_NUM_THREADS may be a list, one number per level.
    let number = |name: &str| {
        let text = variable(name)?;
        text.split(',').next().unwrap_or("").trim().parse::<usize>().ok().filter(|n| *n > 0)
    };
    // Slurm sets SLURM_CPUS_PER_TASK only where --cpus-per-task is given, so this stands in its place.
    let job = || slurm_node(&number);
    VARIABLES[..2]
        .iter()
        .find_map(|name| number(name))
        .or_else(job)
        .or_else(|| VARIABLES[2..].iter().find_map(|name| number(name)))
        .map_or(cores, |n| n.min(cores))
}

/// Cores of a Slurm job with one task on its node, without `--cpus-per-task`.
fn slurm_node(number: &impl Fn(&str) -> Option<usize>) -> Option<usize> {
    // Several tasks share the cores, so their number says nothing about this one.
    let alone = number("SLURM_NTASKS").is_none_or(|tasks| tasks == 1);
    number("SLURM_CPUS_ON_NODE").filter(|_| alone)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_batch_system_sets_the_number_of_threads() {
        let with = |variables: &[(&str, &str)]| {
            threads_of(|name| variables.iter().find(|v| v.0 == name).map(|v| v.1.to_string()), 16)
        };
        assert_eq!(with(&[]), 16);
        assert_eq!(with(&[("SLURM_CPUS_PER_TASK", "4"), ("OMP_NUM_THREADS", "1")]), 4);
        assert_eq!(with(&[("RAYON_NUM_THREADS", "2"), ("SLURM_CPUS_PER_TASK", "4")]), 2);
        assert_eq!(with(&[("PBS_NCPUS", "8")]), 8);
        assert_eq!(with(&[("NCPUS", "3")]), 3);
        assert_eq!(with(&[("LSB_DJOB_NUMPROC", "5")]), 5);
        assert_eq!(with(&[("NSLOTS", "6")]), 6);
        assert_eq!(with(&[("OMP_NUM_THREADS", "7,2")]), 7);
    }

    #[test]
    fn a_job_of_one_task_has_its_cores_of_the_node() {
        let with = |tasks: Option<&str>| {
            threads_of(
                |name| match name {
                    "SLURM_CPUS_ON_NODE" => Some("6".into()),
                    "SLURM_NTASKS" => tasks.map(String::from),
                    _ => None,
                },
                16,
            )
        };
        assert_eq!([with(None), with(Some("1")), with(Some("8"))], [6, 6, 16]);
    }

    /// The machine knows best what it lets a process use; what is no number says nothing.
    #[test]
    fn the_number_of_threads_is_within_1_and_the_cores() {
        let with = |text: &str| threads_of(|name| (name == "SLURM_CPUS_PER_TASK").then(|| text.to_string()), 16);
        assert_eq!(["64", "0", "-1", "many", ""].map(with), [16; 5]);
    }
}
