//! Number of threads this process may use, by batch system, control group and affinity mask.

use std::num::NonZeroUsize;

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
