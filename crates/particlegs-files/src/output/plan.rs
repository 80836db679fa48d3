//! Inputs and outputs of a command, known before the work: no output is an input, none is another's
//! place, and an existing file is replaced only if that was meant.

use super::folder::WholeFolder;
use super::kind::{Kind, ending};
use super::place::{Identity, OutputTarget, is_pipe, open_stream, spelled_out};
use super::state::PlannedOutput;
use super::write::check_writable;
use crate::context::Context;
use crate::{Error, Result};
use particlegs_core::Hint;
use std::fs::File;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicBool, Ordering};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::Duration;

/// The kind of a folder.
const FOLDER: &str = "a folder";
/// Between two looks for a pipe's reader.
const PATIENCE: Duration = Duration::from_millis(20);

#[derive(Clone, Debug)]
pub enum Input {
    /// A file with those that belong to it, or a folder of them.
    Data(PathBuf),
    /// A folder whose every file is read, two levels deep: a job.
    Whole(PathBuf),
}

/// Inputs and outputs of a command. While it lives, named pipes stay open; when it goes, so do empty
/// folders that it made.
#[derive(Debug, Default)]
pub struct Outputs {
    inputs: Mutex<Vec<Input>>,
    taken: Mutex<Vec<Identity>>,
    replaces: AtomicBool,
    pipes: Mutex<Vec<File>>,
    made: Mutex<Vec<PathBuf>>,
    planned: Mutex<Vec<PathBuf>>,
    /// Names of files and folders, and of the kinds that they were declared as.
    files: Mutex<Vec<(PathBuf, &'static str)>>,
    kept: Mutex<Vec<PathBuf>>,
}

impl Outputs {
    /// Of work that replaces what is kept if `replaces`.
    pub fn new(replaces: bool) -> Outputs {
        let outputs = Outputs::default();
        outputs.replaces.store(replaces, Ordering::Relaxed);
        outputs
    }

    /// From now on replaces what is kept.
    pub fn replace(&self) {
        self.replaces.store(true, Ordering::Relaxed);
    }

    pub fn reads(&self, input: Input) {
        lock(&self.inputs).push(input);
    }

    pub fn is_empty(&self) -> bool {
        lock(&self.taken).is_empty()
    }

    pub fn on_standard_output(&self) -> bool {
        lock(&self.taken).contains(&Identity::StandardOutput)
    }

    /// Files that were declared one by one, in that order.
    pub fn files(&self) -> Vec<PathBuf> {
        lock(&self.files).iter().map(|file| file.0.clone()).collect()
    }

    /// Takes note of a file that is to be written, and tells whether one is there that is kept: then
    /// the caller shows that it is what would be written, or refuses by [`Outputs::refused`]. Waits for the
    /// reader of a named pipe.
    pub fn writes(&self, path: &Path, kind: &Kind, context: &Context<'_>) -> Result<bool> {
        let place = OutputTarget::new(path)?;
        self.take(path, &place)?;
        let is_kept = match &place {
            OutputTarget::StandardOutput => false,
            OutputTarget::Stream(pipe) => self.wait_for_reader(pipe, context).map(|()| false)?,
            OutputTarget::File(target) if target.is_file() => {
                self.note(path, target)?;
                check_writable(path)?;
                if !kind.may_replace(target).map_err(|e| Error::io(path, e))? {
                    let message = format!("exists and is not {}", kind.name);
                    return Err(Error::output(path, message, "name another file; this one is left unchanged"));
                }
                // An empty file holds nothing to keep.
                let empty = target.metadata().is_ok_and(|m| m.len() == 0);
                kind.kept && !self.replaces() && !empty
            }
            OutputTarget::File(target) => {
                self.note(path, target)?;
                check_writable(path).map(|()| false)?
            }
        };
        lock(&self.files).push((path.to_path_buf(), kind.name));
        Ok(self.keep(path, is_kept))
    }

    fn keep(&self, path: &Path, is_kept: bool) -> bool {
        if is_kept {
            lock(&self.kept).push(path.to_path_buf());
        }
        is_kept
    }

    /// Whether an output was declared as a file of this kind, or without a kind as a folder.
    pub fn is_declared(&self, path: &Path, kind: Option<&Kind>) -> bool {
        let name = kind.map_or(FOLDER, |kind| kind.name);
        lock(&self.files).iter().any(|file| file.0 == path && file.1 == name)
    }

    /// Whether a declared output exists and is kept.
    pub fn is_kept(&self, path: &Path) -> bool {
        lock(&self.kept).iter().any(|kept_path| kept_path == path)
    }

    /// Takes note of an input that is to be written anew, before it is read: of what has changed by then nothing is
    /// lost.
    pub fn rewrites(&self, path: &Path) -> Result<()> {
        if let OutputTarget::File(target) = OutputTarget::new(path)? { self.note(path, &target) } else { Ok(()) }
    }

    /// Nothing but what is there now is replaced.
    fn note(&self, path: &Path, target: &Path) -> Result<()> {
        lock(&self.planned).push(PlannedOutput::note(path, target)?);
        Ok(())
    }

    /// Takes note of a folder that is to be written whole, of files with these `names`, and tells
    /// whether such files are there and kept, as [`Outputs::writes`] does.
    pub fn writes_folder(&self, path: &Path, names: &[&str]) -> Result<bool> {
        let OutputTarget::File(target) = OutputTarget::new(path)? else {
            return Err(is_no_folder(path));
        };
        self.take(path, &OutputTarget::File(target.clone()))?;
        self.note(path, &target)?;
        let whole = spelled_out(&target);
        // An input inside the folder would go with the old one.
        if lock(&self.inputs).iter().any(|input| spelled_out(input.path()).starts_with(&whole)) {
            return Err(is_input(path));
        }
        lock(&self.files).push((path.to_path_buf(), FOLDER));
        let filled = WholeFolder::check(path, names)?;
        Ok(self.keep(path, filled && !self.replaces()))
    }

    /// Takes note of a job's folder; what is in it is the job's to look at.
    pub fn writes_job(&self, path: &Path) -> Result<()> {
        let OutputTarget::File(target) = OutputTarget::new(path)? else { return Err(is_no_folder(path)) };
        if target.is_file() {
            return Err(is_no_folder(path));
        }
        self.take(path, &OutputTarget::File(target))?;
        ending(path, &[])?;
        self.rewrites(&path.join("plan.json"))
    }

    /// The error for what is there and kept.
    pub fn refused(&self, path: &Path) -> Error {
        let hint = Hint::from("name another output, or replace it with ").option("force", "");
        Error::output(path, "exists already and is not replaced", hint)
    }

    /// Makes a folder where it is missing; it goes again if nothing comes into it. Refuses a name that means a file.
    pub fn make_folder(&self, folder: &Path) -> Result<()> {
        ending(folder, &[])?;
        let missing = folder.ancestors().take_while(|f| !f.as_os_str().is_empty() && !f.exists());
        let missing: Vec<PathBuf> = missing.map(Path::to_path_buf).collect();
        // The innermost first, as they are removed.
        lock(&self.made).splice(0..0, missing);
        std::fs::create_dir_all(folder)
            .map_err(|e| if folder.is_file() { is_no_folder(folder) } else { Error::io(folder, e) })
    }

    /// Refuses a place that is read, or taken by another output.
    fn take(&self, path: &Path, place: &OutputTarget) -> Result<()> {
        let Some(identity) = Identity::from_target(place) else { return Ok(()) };
        if lock(&self.inputs).iter().any(|input| input.holds(&identity)) {
            return Err(is_input(path));
        }
        let mut taken = lock(&self.taken);
        if taken.contains(&identity) {
            return Err(Error::output(path, "is named twice as an output of this command", "name another file"));
        }
        taken.push(identity);
        Ok(())
    }

    /// Whether what is kept is replaced.
    pub fn replaces(&self) -> bool {
        self.replaces.load(Ordering::Relaxed)
    }

    /// Opens a named pipe when somebody reads it, and keeps it open.
    fn wait_for_reader(&self, path: &Path, context: &Context<'_>) -> Result<()> {
        if !is_pipe(path) {
            return Ok(());
        }
        let mut said = false;
        loop {
            match open_stream(path) {
                Ok(file) => {
                    lock(&self.pipes).push(file);
                    return Ok(());
                }
                // Nobody reads the pipe yet.
                Err(e) if e.kind() == std::io::ErrorKind::NotConnected => {}
                Err(e) => return Err(Error::io(path, e)),
            }
            if !said {
                context.message(&format!("waiting for a reader of the pipe {}", path.display()));
                said = true;
            }
            context.check()?;
            std::thread::sleep(PATIENCE);
        }
    }
}

impl Drop for Outputs {
    fn drop(&mut self) {
        lock(&self.planned).iter().for_each(|name| PlannedOutput::forget(name));
        for folder in &*lock(&self.made) {
            // It fails, as it should, where something is in it.
            let _ = std::fs::remove_dir(folder);
        }
    }
}

fn is_no_folder(path: &Path) -> Error {
    Error::output(path, "is not a folder, but files must be written into it", "name a folder")
}

fn is_input(path: &Path) -> Error {
    Error::output(path, "is an input of this command or belongs to one", "name another output")
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

impl Input {
    fn path(&self) -> &Path {
        match self {
            Input::Data(path) | Input::Whole(path) => path,
        }
    }

    fn holds(&self, file: &Identity) -> bool {
        // What is not there yet cannot be read.
        let Identity::There(..) = file else { return false };
        let (path, whole) = match self {
            Input::Data(path) => (path, false),
            Input::Whole(path) => (path, true),
        };
        if Identity::from_path(path) == *file {
            return true;
        }
        match path.is_dir() {
            true if whole => in_folder(path, 2, |_| true, file),
            true => in_folder(path, 1, is_data, file),
            false => beside(path, file),
        }
    }
}

/// Whether it is one of the files that are read of a folder and, so many levels deep, of those in it.
fn in_folder(folder: &Path, levels: u32, is_read: fn(&Path) -> bool, file: &Identity) -> bool {
    levels > 0
        && std::fs::read_dir(folder).into_iter().flatten().flatten().any(|entry| {
            let path = entry.path();
            is_read(&path) && Identity::from_path(&path) == *file || in_folder(&path, levels - 1, is_read, file)
        })
}

/// Whether this file of a folder that is read may be data. Models, pictures and logs beside data are not.
fn is_data(path: &Path) -> bool {
    let ending = path.extension().map(|e| e.to_string_lossy().to_lowercase());
    match ending.as_deref() {
        Some("pgs" | "png" | "svg" | "jsonl" | "checkpoint") => false,
        Some("json") => path.file_name().is_some_and(|n| n == "meta.json"),
        _ => true,
    }
}

/// Whether it lies beside a file and belongs to it: another part of the same snapshot, or its description.
fn beside(path: &Path, file: &Identity) -> bool {
    let Some(name) = path.file_name().map(|n| n.to_string_lossy().into_owned()) else { return false };
    let entries = std::fs::read_dir(super::place::folder_of(path)).into_iter().flatten().flatten();
    let belongs = |other: &str| {
        let numbered = without_numbers(other) == without_numbers(&name);
        other == "meta.json" || numbered || other.starts_with(&format!("{name}#"))
    };
    // Lists of pieces in XML name those of a folder of their own name.
    let is_list = path.extension().is_some_and(|e| ["pvtp", "pvtu", "pvd", "vtm"].iter().any(|l| e == *l));
    let stem = path.file_stem().filter(|_| is_list).map(|s| path.with_file_name(s));
    let pieces = || stem.is_some_and(|s| s.is_dir() && in_folder(&s, 1, is_data, file));
    entries.filter(|e| belongs(&e.file_name().to_string_lossy())).any(|e| Identity::from_path(&e.path()) == *file)
        || pieces()
}

/// A name without the numbers that stand between its dots: `snap_010.3.hdf5` and `snap_010.7.hdf5` are
/// parts of one snapshot.
fn without_numbers(name: &str) -> Vec<&str> {
    let is_number = |part: &&str| !part.is_empty() && part.bytes().all(|b| b.is_ascii_digit());
    name.split('.').map(|part| if is_number(&part) { "0" } else { part }).collect()
}
