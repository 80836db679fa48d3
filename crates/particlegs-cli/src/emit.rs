//! Scripts that run a job with a workflow engine: `plan --emit slurm|snakemake`.
//!
//! Their templates are beside this file; `@NAME@` is replaced by values of the plan.

use particlegs::job::JobParts;
use particlegs_core::text::shell_word;
use particlegs_core::{Error, Result};
use std::path::{Path, PathBuf};

const SLURM: &str = include_str!("emit/slurm.sh");
const SNAKEMAKE: &str = include_str!("emit/Snakefile");

#[derive(Clone, Copy, Debug, PartialEq, Eq, clap::ValueEnum)]
pub enum JobEngine {
    /// A bash script for a login node: three dependent submissions.
    Slurm,
    /// A Snakefile with three rules.
    Snakemake,
}

/// The values of a script. Paths should be absolute, since tasks run elsewhere.
#[derive(Clone, Debug)]
pub struct JobScript {
    pub program: PathBuf,
    pub folder: PathBuf,
    pub model: PathBuf,
    pub parts: JobParts,
    pub threads: usize,
}

/// A path for an engine's script. Refuses paths that are not UTF-8 or have line breaks, and special characters that the
/// engine cannot quote: for Snakemake braces (wildcards) and angle brackets (path variables), for Slurm backslashes (in
/// names of logs).
pub fn quoted(engine: JobEngine, path: &Path) -> Result<String> {
    let (refused, quote): (&[char], fn(&str) -> String) = match engine {
        JobEngine::Slurm => (&['\n', '\r', '\\'], shell_word),
        JobEngine::Snakemake => (&['\n', '\r', '{', '}', '<', '>'], python_literal),
    };
    match path.to_str() {
        Some(text) if !text.contains(refused) => Ok(quote(text)),
        _ => Err(Error::Argument {
            what: format!("{}: this path cannot be written in the script of this engine", path.display()),
            hint: "use a path in UTF-8 without line breaks, braces, angle brackets and backslashes".into(),
        }),
    }
}

pub fn script(engine: JobEngine, job: &JobScript) -> Result<String> {
    // Slurm's M is a MiB, Snakemake's mem_mb counts 10^6. Ask for a tenth more, since engines kill tasks that exceed
    // it.
    let (template, unit) = match engine {
        JobEngine::Slurm => (SLURM, 1 << 20),
        JobEngine::Snakemake => (SNAKEMAKE, 1_000_000),
    };
    let path = |p: &Path| quoted(engine, p);
    let memory = |bytes: u64| (bytes.div_ceil(unit) * 11).div_ceil(10).to_string();
    Ok(fill(
        template,
        &[
            ("PROGRAM", path(&job.program)?),
            ("JOB", path(&job.folder)?),
            ("MODEL", path(&job.model)?),
            ("CHUNKS", job.parts.chunks.to_string()),
            ("BLOCKS", job.parts.blocks.to_string()),
            ("MEMORY", memory(job.parts.task_bytes)),
            ("MERGE_MEMORY", memory(job.parts.merge_bytes)),
            ("THREADS", job.threads.to_string()),
        ],
    ))
}

/// Replaces each `@NAME@` in one pass, so that paths may contain anything.
fn fill(template: &str, values: &[(&str, String)]) -> String {
    let mut text = String::with_capacity(template.len() + 256);
    let mut rest = template;
    while let Some(at) = rest.find('@') {
        let (before, tail) = rest.split_at(at);
        text += before;
        let value = values.iter().find_map(|(name, v)| Some((v, tail[1..].strip_prefix(name)?.strip_prefix('@')?)));
        rest = match value {
            Some((v, after)) => {
                text += v;
                after
            }
            None => {
                text.push('@');
                &tail[1..]
            }
        };
    }
    text + rest
}

/// A Python string: JSON uses the same escapes.
fn python_literal(text: &str) -> String {
    serde_json::Value::from(text).to_string()
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::process::{Command, Stdio};

    fn job() -> JobScript {
        JobScript {
            program: "/opt/particlegs".into(),
            folder: "/scratch/my job's {1} @BLOCKS@".into(),
            model: "/scratch/m.pgs".into(),
            parts: JobParts {
                particles: 0,
                blocks: 1000,
                chunks: 12,
                scatter_bytes: 0,
                memory: None,
                planned_before: false,
                task_bytes: 2_000_000_000,
                merge_bytes: 500_000_000,
            },
            threads: 4,
        }
    }

    #[test]
    fn every_placeholder_is_filled_once() {
        for engine in [JobEngine::Slurm, JobEngine::Snakemake] {
            let text = script(engine, &JobScript { folder: "/scratch/job".into(), ..job() }).unwrap();
            for name in ["PROGRAM", "JOB", "MODEL", "CHUNKS", "BLOCKS", "MEMORY", "MERGE_MEMORY", "THREADS"] {
                assert!(!text.contains(&format!("@{name}@")), "{name} in {text}");
            }
        }
    }

    #[test]
    fn the_slurm_script_matches_the_plan() {
        let text = script(JobEngine::Slurm, &job()).unwrap();
        for line in [
            "program=/opt/particlegs\n",
            "job='/scratch/my job'\\''s {1} @BLOCKS@'\n",
            "model=/scratch/m.pgs\n",
            "chunks=12 ",
            "blocks=1000\n",
            "memory=2099M ",
            "merge_memory=525M ",
            "cpus=4\n",
            "--requeue",
            "--signal=\"B:USR1@$notice\"",
        ] {
            assert!(text.contains(line), "{line} in {text}");
        }
    }

    #[test]
    fn the_snakefile_matches_the_plan() {
        let text = script(JobEngine::Snakemake, &JobScript { folder: "/s/a \"b\" \\c é".into(), ..job() }).unwrap();
        for line in [
            "PROGRAM = \"/opt/particlegs\"\n",
            "JOB = \"/s/a \\\"b\\\" \\\\c é\"\n",
            "CHUNKS, BLOCKS = 12, 1000 ",
            "MEMORY, MERGE_MEMORY = 2200, 550 ",
            "MINUTES, THREADS = 240, 4 ",
        ] {
            assert!(text.contains(line), "{line} in {text}");
        }
    }

    #[test]
    fn a_path_that_a_script_cannot_quote_is_refused() {
        for engine in [JobEngine::Slurm, JobEngine::Snakemake] {
            assert!(script(engine, &JobScript { folder: "a\nb".into(), ..job() }).is_err());
        }
        for name in ["a{b}.pgs", "a<r>.pgs"] {
            assert!(script(JobEngine::Snakemake, &JobScript { model: name.into(), ..job() }).is_err());
            assert!(script(JobEngine::Slurm, &JobScript { model: name.into(), ..job() }).is_ok());
        }
        assert!(script(JobEngine::Slurm, &JobScript { folder: "a\\b".into(), ..job() }).is_err());
    }

    #[test]
    fn arguments_survive_the_shell() {
        for word in ["", "plain/path.pgs", "a b", "it's", "$HOME `x` \"y\" \\ * {1}", "é", "-o"] {
            let echo = Command::new("sh").arg("-c").arg(format!("printf %s {}", shell_word(word))).output();
            let output = echo.expect("a shell");
            // printf takes a leading dash for itself; the word was one word all the same.
            if word != "-o" {
                assert_eq!(String::from_utf8_lossy(&output.stdout), word);
            }
        }
    }

    #[test]
    fn bash_can_parse_the_script() {
        let child = Command::new("bash").arg("-n").stdin(Stdio::piped()).stderr(Stdio::piped()).spawn();
        let mut child = child.expect("bash");
        let text = script(JobEngine::Slurm, &job()).unwrap();
        std::io::Write::write_all(&mut child.stdin.take().unwrap(), text.as_bytes()).unwrap();
        let output = child.wait_with_output().unwrap();
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    }
}
