//! Files that belong together, all or none: a whole folder, or a set of files within one.

use super::names::is_temporary;
use super::place::{Identity, OutputTarget, folder_of};
use super::state::{CHANGED, PathState, PlannedOutput, changed, free_name};
use super::temporary::{TemporaryFile, TemporaryFolder, is_same, is_unsupported, rename_new, swap};
use super::write::{check_folder, write_bytes};
use crate::{Error, Result};
use std::fs::File;
use std::io::ErrorKind::{AlreadyExists, DirectoryNotEmpty, NotADirectory};
use std::path::{Path, PathBuf};

/// A folder that is filled beside its place and moved there whole, over one of the same kind.
pub struct WholeFolder {
    out: PathBuf,
    target: PathBuf,
    staged: TemporaryFolder,
    way: MoveMethod,
    /// The state of the target at the beginning, which alone may go.
    before: PathState,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum MoveMethod {
    /// By its name, where nothing but an empty folder is.
    Rename,
    /// In exchange for the folder that is there.
    Exchange,
    /// File by file, into the empty folder around it.
    Inside,
}

impl WholeFolder {
    /// Tells whether `out` is a folder that holds files with these `names`.
    pub fn check(out: &Path, names: &[&str]) -> Result<bool> {
        let OutputTarget::File(target) = OutputTarget::new(out)? else { return Err(no_folder(out)) };
        if target.is_file() {
            return Err(no_folder(out));
        }
        if !target.is_dir() {
            return check_folder(folder_of(&target)).map(|()| false).map_err(|e| Error::io(out, e));
        }
        let mut filled = false;
        for entry in std::fs::read_dir(&target).map_err(|e| Error::io(out, e))? {
            let entry = entry.map_err(|e| Error::io(out, e))?;
            let name = entry.file_name();
            // What another run is about to write is no content yet.
            if is_temporary(&name) {
                continue;
            }
            if !names.iter().any(|o| name == *o) || entry.file_type().is_ok_and(|t| t.is_dir()) {
                let message = format!("contains `{}`, which this command does not write", name.to_string_lossy());
                return Err(Error::output(out, message, "name another or an empty folder"));
            }
            filled = true;
        }
        Ok(filled)
    }

    /// Begins a folder for `out`, which may replace files with these `names`.
    pub fn create(out: &Path, names: &[&str]) -> Result<WholeFolder> {
        let fail = |e| Error::io(out, e);
        let OutputTarget::File(target) = OutputTarget::new(out)? else { return Err(no_folder(out)) };
        let before = PathState::at(&target).map_err(fail)?;
        let filled = WholeFolder::check(out, names)?;
        if PlannedOutput::find(out).is_some_and(|p| filled && before != p.state || target != p.target) {
            return Err(Error::output(out, CHANGED, "name another folder"));
        }
        // The name itself, also of `.` and `a/..`: what it lies in is where it is made.
        let target = std::fs::canonicalize(&target).unwrap_or(target);
        let is_there = target.is_dir();
        let here = is_there && Identity::from_path(&target) == Identity::from_path(Path::new("."));
        if here && filled {
            let message = "is the working folder and would be replaced as a whole";
            return Err(Error::output(out, message, "run the command in another folder"));
        }
        let beside = TemporaryFolder::within(folder_of(&target));
        let (staged, way) = match beside {
            // The working folder is not replaced: this process would stay in the old one.
            Ok(staged) if !here && (!is_there || same_disk(staged.path(), &target)) => {
                (staged, if filled { MoveMethod::Exchange } else { MoveMethod::Rename })
            }
            Err(e) if !is_there || filled => return Err(fail(e)),
            // A mount point can be neither renamed nor exchanged.
            _ if filled => return Err(fail(std::io::ErrorKind::CrossesDevices.into())),
            _ => (TemporaryFolder::within(&target).map_err(fail)?, MoveMethod::Inside),
        };
        Ok(WholeFolder { out: out.to_path_buf(), target, staged, way, before })
    }

    pub fn path(&self) -> &Path {
        self.staged.path()
    }

    pub fn finish(mut self) -> Result<()> {
        if let Ok(metadata) = self.target.metadata() {
            // Who may use the folder stays as it is; where that cannot be, it is as any new folder.
            let _ = std::fs::set_permissions(self.staged.path(), metadata.permissions());
        }
        let placed = match self.way {
            MoveMethod::Inside => self.move_files(),
            MoveMethod::Exchange => self.exchange(),
            // It fails where another process has filled the folder meanwhile.
            MoveMethod::Rename => std::fs::rename(self.staged.path(), &self.target).map(|()| {
                self.staged.moved();
                true
            }),
        };
        let in_the_way =
            matches!(&placed, Err(e) if matches!(e.kind(), DirectoryNotEmpty | AlreadyExists | NotADirectory));
        let fail = |e| Error::io(&self.out, e);
        if !in_the_way && placed.map_err(fail)? {
            return Ok(());
        }
        let beside = match self.way {
            MoveMethod::Inside => self.target.join(self.target.file_name().unwrap_or_default()),
            _ => self.target.clone(),
        };
        let aside = self.staged.keep_beside(&beside).map_err(fail)?;
        Err(changed(&self.out, &aside))
    }

    /// Takes the place of the folder that is there, if it is as it was; what it held goes.
    fn exchange(&mut self) -> std::io::Result<bool> {
        match swap(self.staged.path(), &self.target) {
            Ok(()) => {
                let old = self.staged.path().to_path_buf();
                self.staged.moved();
                // Looked at after the exchange: by its name nobody reaches the old folder any more.
                if PathState::at(&old)? != self.before {
                    swap(&old, &self.target)?;
                    self.staged = TemporaryFolder::from_path(old);
                    return Ok(false);
                }
                self.remove(old)
            }
            Err(e) if is_unsupported(&e) => self.put_aside(),
            Err(e) => Err(e),
        }
    }

    /// If two folders cannot be exchanged in one step, the old one waits under a name that says what it is.
    fn put_aside(&mut self) -> std::io::Result<bool> {
        let mut name = self.target.as_os_str().to_os_string();
        name.push(format!(".replaced-{}", std::process::id()));
        let old = PathBuf::from(name);
        rename_new(&self.target, &old)?;
        if PathState::at(&old)? != self.before {
            return rename_new(&old, &self.target).map(|()| false);
        }
        match rename_new(self.staged.path(), &self.target) {
            Ok(()) => {
                self.staged.moved();
                self.remove(old)
            }
            Err(e) => rename_new(&old, &self.target).and(Err(e)),
        }
    }

    /// Removes the old folder; where something has come into it even now, that stays, and is told.
    fn remove(&self, old: PathBuf) -> std::io::Result<bool> {
        self.before.remove(&old).map(|()| true).or_else(|_| {
            let remains = free_name(&self.target, |path| rename_new(&old, path))?;
            let message =
                format!("the old folder was in use while it was replaced; its remains are in {}", remains.display());
            Err(std::io::Error::other(message))
        })
    }

    /// Moves the files one by one into the empty folder around them, over nothing; none stays where one fails.
    fn move_files(&mut self) -> std::io::Result<bool> {
        let mut moved: Vec<(PathBuf, PathBuf)> = Vec::new();
        for entry in std::fs::read_dir(self.staged.path())? {
            let entry = entry?;
            let to = self.target.join(entry.file_name());
            if let Err(e) = rename_new(&entry.path(), &to) {
                // They are kept with the rest of the folder.
                moved.iter().try_for_each(|(from, to)| rename_new(to, from))?;
                return if e.kind() == AlreadyExists { Ok(false) } else { Err(e) };
            }
            moved.push((entry.path(), to));
        }
        Ok(true)
    }
}

fn no_folder(out: &Path) -> Error {
    Error::output(out, "is a file, not a folder", "name a folder")
}

/// Whether two folders lie on one disk, so that one can be renamed to the other.
fn same_disk(a: &Path, b: &Path) -> bool {
    match (Identity::from_path(a), Identity::from_path(b)) {
        (Identity::There(a, _), Identity::There(b, _)) => a == b,
        _ => true,
    }
}

/// Several files that one step makes. They are written to a folder of their own within their folder, and moved to their
/// places together.
pub struct FileSet {
    folder: PathBuf,
    staged: TemporaryFolder,
}

impl FileSet {
    /// Files for `folder`, which is there.
    pub fn in_folder(folder: &Path) -> Result<FileSet> {
        let staged = TemporaryFolder::within(folder).map_err(|e| Error::io(folder, e))?;
        Ok(FileSet { folder: folder.to_path_buf(), staged })
    }

    pub fn path(&self) -> &Path {
        self.staged.path()
    }

    /// The places of the files that have been written, in the order of their names.
    pub fn places(&self) -> Result<Vec<PathBuf>> {
        let fail = |e| Error::io(&self.folder, e);
        let entries = std::fs::read_dir(self.staged.path()).map_err(fail)?;
        let names = entries.map(|e| e.map(|e| self.folder.join(e.file_name())));
        let mut places = names.collect::<std::io::Result<Vec<_>>>().map_err(fail)?;
        places.sort();
        Ok(places)
    }

    /// Moves them to their places, over what is there; gives the places.
    pub fn finish(self) -> Result<Vec<PathBuf>> {
        let places = self.places()?;
        for place in &places {
            // All places are looked at before the first file is moved.
            if let (Some(planned), OutputTarget::File(target)) = (PlannedOutput::find(place), OutputTarget::new(place)?)
                && planned.replaceable(&target).map_err(|e| Error::io(place, e))?.is_none()
                && !File::open(self.staged_at(place)).is_ok_and(|mut file| is_same(&mut file, &target))
            {
                return Err(Error::output(place, CHANGED, "run the command again, or name another place"));
            }
        }
        for place in &places {
            moved(self.staged_at(place), place)?;
        }
        Ok(places)
    }

    fn staged_at(&self, place: &Path) -> PathBuf {
        self.staged.path().join(place.file_name().unwrap_or_default())
    }
}

fn moved(from: PathBuf, to: &Path) -> Result<()> {
    let fail = |e| Error::io(to, e);
    let written = || write_bytes(to, &std::fs::read(&from).map_err(fail)?);
    match OutputTarget::new(to)? {
        OutputTarget::File(target) => match TemporaryFile::open(from.clone()).map_err(fail)?.place(to, &target) {
            // Behind a link to another disk.
            Err(Error::Io { source, .. }) if source.kind() == std::io::ErrorKind::CrossesDevices => written(),
            done => done,
        },
        _ => written(),
    }
}
