//! Inputs and outputs of a command, declared before its work.

use crate::common::CommandContext;
use crate::report::wrapped;
use clap::Args;
use particlegs_core::Result;
pub use particlegs_files::output::kinds::*;
use particlegs_files::output::{Input, Kind};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// Most files of a folder that are listed by name.
const MOST_NAMED: usize = 12;

#[derive(Args, Clone, Copy, Debug, Default)]
pub struct ForceArgs {
    /// Replace an existing output, but no input and no file of another kind.
    #[arg(long, help_heading = None::<&'static str>, display_order = 900)]
    pub force: bool,
}

impl CommandContext {
    /// Declares the `inputs` of a command and its first output, `--json`; `force` replaces kept outputs.
    pub fn reads<'a>(&self, inputs: impl IntoIterator<Item = &'a Path>, force: bool) -> Result<()> {
        self.plan(inputs.into_iter().map(|path| Input::Data(path.to_path_buf())), force)
    }

    /// [`CommandContext::reads`] for a job folder and its snapshot.
    pub fn reads_job(&self, job: &Path, snapshot: &[PathBuf], force: bool) -> Result<()> {
        let inputs = snapshot.iter().map(|path| Input::Data(path.clone()));
        self.plan(inputs.chain([Input::Whole(job.to_path_buf())]), force)
    }

    fn plan(&self, inputs: impl Iterator<Item = Input>, force: bool) -> Result<()> {
        if force {
            self.outputs.replace();
        }
        inputs.for_each(|input| self.outputs.reads(input));
        self.common.json.as_ref().map_or(Ok(()), |path| self.writes(path, &JSON).map(drop))
    }

    /// Declares an output; returns whether it exists and is kept.
    pub fn writes(&self, path: &Path, kind: &Kind) -> Result<bool> {
        self.outputs.writes(path, kind, self)
    }

    /// One line per folder with written files that `text` does not mention.
    pub fn names_files(&self, text: &str) -> String {
        let mut folders: BTreeMap<PathBuf, Vec<PathBuf>> = BTreeMap::new();
        for path in self.outputs.files().iter().filter(|p| p.is_file() && !text.contains(&p.display().to_string())) {
            folders.entry(path.parent().unwrap_or(Path::new("")).into()).or_default().push(path.clone());
        }
        let line = |files: &Vec<PathBuf>| match &files[..] {
            [first, .., last] if files.len() > MOST_NAMED => {
                format!("\nwrote {} files, {} to {}", files.len(), first.display(), last.display())
            }
            files => {
                let names: Vec<String> = files.iter().map(|p| p.display().to_string()).collect();
                format!("\n{}", wrapped("wrote ", &names.join(", "), 6))
            }
        };
        folders.values().map(line).collect()
    }
}
