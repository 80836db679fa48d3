//! The one place that opens and reads what a user names.
//!
//! A file is looked at before it is read: its first bytes must be those of what is expected, its size
//! must be one that such a file can have, and the memory that it takes is asked for first. Pipes and
//! devices give their data as they come, within the same bounds; waiting for them is said and can be
//! stopped. Files that are mapped or read from many places must be regular ones ([`open_file`]).

use crate::context::Context;
use crate::{Error, Result, memory};
use std::fs::{File, Metadata};
use std::io::{ErrorKind, Read, Write};
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::{Duration, Instant};

/// The name of standard input among paths.
pub(crate) const STANDARD_INPUT: &str = "-";

/// The form of a file that is read whole.
#[derive(Clone, Copy, Debug)]
pub struct Form {
    /// In words, with its article: `a views file`.
    pub title: &'static str,
    pub begins: Begins,
    /// Bytes that it has at most.
    pub most: u64,
    /// Bytes of memory that a byte of it takes while it is taken apart.
    pub expansion: u64,
}

#[derive(Clone, Copy, Debug)]
pub enum Begins {
    With(&'static [u8]),
    /// With a JSON object, after white space.
    Object,
    /// With text: no byte is zero.
    Text,
}

impl Begins {
    /// Whether a file with these first bytes begins so. Fewer than [`HEAD`] bytes are the whole file.
    fn fits(self, head: &[u8]) -> bool {
        match self {
            Begins::With(magic) => head.starts_with(magic),
            // Nothing but white space so far: the object may begin later.
            Begins::Object => head.trim_ascii_start().first().is_none_or(|b| *b == b'{') && !head.contains(&0),
            Begins::Text => !head.contains(&0),
        }
    }
}

/// First bytes that tell what a file is.
const HEAD: usize = 512;
/// A wait is said after so long ...
const SAY_AFTER: Duration = Duration::from_secs(1);
/// ... and asks so often whether it is still wanted.
const ASK_EVERY: Duration = Duration::from_millis(100);
const PIECE: usize = 1 << 18;

/// A file, pipe or device being read from its beginning on.
pub struct Source<'a> {
    file: File,
    place: String,
    /// Bytes that were read and not yet taken.
    head: Vec<u8>,
    ended: bool,
    /// Bytes, of a regular file.
    length: Option<u64>,
    context: &'a Context<'a>,
    /// Whether the user has been told that we wait.
    said: bool,
}

impl<'a> Source<'a> {
    /// Opens `path`; `-` is standard input. A pipe without a writer is opened too: reading waits.
    pub fn open(path: &Path, context: &'a Context<'a>) -> Result<Self> {
        let place = name_of(path);
        let file = match is_standard(path) {
            true => standard().map_err(|e| Error::io(&place, e))?,
            false => open_at_once(path).map_err(|e| Error::io(&place, e))?,
        };
        let metadata = file.metadata().map_err(|e| Error::io(&place, e))?;
        if metadata.is_dir() {
            return Err(Error::input(place, "a folder, but a file is expected"));
        }
        // Standard input may be a file that others have read from.
        let length = (metadata.is_file() && !is_standard(path)).then_some(metadata.len());
        Ok(Source { file, place, head: Vec::new(), ended: false, length, context, said: false })
    }

    pub fn place(&self) -> &str {
        &self.place
    }

    /// Bytes, where that is known before: of a regular file.
    pub fn length(&self) -> Option<u64> {
        self.length
    }

    /// The next `bytes` bytes, or fewer where there are no more; they are still to be read.
    pub fn peek(&mut self, bytes: usize) -> Result<&[u8]> {
        self.fill(bytes)?;
        Ok(&self.head[..bytes.min(self.head.len())])
    }

    /// Reads to the end, or `most` bytes. Memory grows with what is there, not with what is promised.
    pub fn read(&mut self, most: u64) -> Result<Vec<u8>> {
        let most = usize::try_from(most).unwrap_or(usize::MAX);
        if let Some(length) = self.length {
            let more = usize::try_from(length).unwrap_or(usize::MAX).min(most).saturating_sub(self.head.len());
            self.head.try_reserve_exact(more).map_err(|_| self.no_memory(more as u64))?;
        }
        self.fill(most)?;
        let rest = self.head.split_off(most.min(self.head.len()));
        Ok(std::mem::replace(&mut self.head, rest))
    }

    /// Hands what is left over in pieces to `to`.
    pub fn copy(&mut self, mut to: impl FnMut(&[u8]) -> Result<()>) -> Result<()> {
        loop {
            self.fill(PIECE)?;
            if self.head.is_empty() {
                return Ok(());
            }
            to(&self.head)?;
            self.head.clear();
        }
    }

    /// Has `bytes` bytes at hand, or all that there are.
    fn fill(&mut self, bytes: usize) -> Result<()> {
        while self.head.len() < bytes && !self.ended {
            self.context.check()?;
            self.wait()?;
            let start = self.head.len();
            let piece = PIECE.min(bytes - start);
            if start + piece > self.head.capacity() {
                // What there is moves to a place of twice its size.
                memory::require(&format!("reading {}", self.place), 2 * start as u64)?;
            }
            self.head.try_reserve(piece).map_err(|_| self.no_memory(piece as u64))?;
            self.head.resize(start + piece, 0);
            let read = self.file.read(&mut self.head[start..]);
            self.head.truncate(start + read.as_ref().map_or(0, |n| *n));
            match read {
                Ok(n) => self.ended = n == 0,
                Err(e) if matches!(e.kind(), ErrorKind::Interrupted | ErrorKind::WouldBlock) => {}
                Err(e) => return Err(Error::io(&self.place, e)),
            }
        }
        Ok(())
    }

    /// Waits until there is something to read, or the end.
    fn wait(&mut self) -> Result<()> {
        if self.length.is_some() {
            return Ok(());
        }
        let began = Instant::now();
        while !ready(&self.file).map_err(|e| Error::io(&self.place, e))? {
            self.context.check()?;
            if !self.said && began.elapsed() >= SAY_AFTER {
                self.context.message(&format!("waiting for data from {}", self.place));
                self.said = true;
            }
        }
        Ok(())
    }

    fn no_memory(&self, need_bytes: u64) -> Error {
        let have_bytes = memory::available_bytes().unwrap_or(0);
        Error::Memory { what: format!("reading {}", self.place), need_bytes, have_bytes }
    }
}

/// Reads a file, pipe or device whole: `-` is standard input.
pub fn read_whole(path: &Path, form: Form, context: &Context<'_>) -> Result<Vec<u8>> {
    form.read(Source::open(path, context)?)
}

/// [`read_whole`] of a regular file of the program's own; `None` where there is none.
pub fn read_own(path: &Path, form: Form) -> Result<Option<Vec<u8>>> {
    let (file, length) = match open_file(path) {
        Ok(opened) => opened,
        Err(Error::Io { source, .. }) if source.kind() == ErrorKind::NotFound => return Ok(None),
        Err(e) => return Err(e),
    };
    let context = &crate::context::Context::SILENT;
    let (place, length) = (name_of(path), Some(length));
    form.read(Source { file, place, head: Vec::new(), ended: false, length, context, said: false }).map(Some)
}

impl Form {
    fn read(self, mut source: Source<'_>) -> Result<Vec<u8>> {
        let place = source.place.clone();
        let head = source.peek(HEAD)?;
        if head.is_empty() {
            return Err(Error::input(place, format!("the file is empty, not {}", self.title)));
        }
        if !self.begins.fits(head) {
            return Err(Error::input(place, format!("not {}: the first bytes are wrong", self.title)));
        }
        let too_large = || {
            let message = format!("larger than {} bytes, so it is not {}", self.most, self.title);
            Err(Error::input(&place, message))
        };
        if source.length.is_some_and(|n| n > self.most) {
            return too_large();
        }
        // The length of a stream is not known: `fill` asks for more memory as it grows.
        let need = source.length.unwrap_or(self.most.min(1 << 20)).saturating_mul(self.expansion.max(1));
        memory::require(self.title, need)?;
        // One byte more tells a file that is too large from one that just fits.
        let bytes = source.read(self.most.saturating_add(1))?;
        if bytes.len() as u64 > self.most { too_large() } else { Ok(bytes) }
    }
}

/// Bytes of the disk that a copy of a stream leaves to others.
const LEFT_FREE: u64 = 256 << 20;

/// Data of a pipe or device, in a file without a name: it can be read again and from many places.
#[derive(Debug)]
pub struct SpoolFile {
    file: File,
    place: String,
}

impl SpoolFile {
    /// Keeps what `source` still has to give, in the system's folder for temporary files.
    pub fn new(mut source: Source<'_>) -> Result<Self> {
        let place = source.place.clone();
        // Only there does a file without a name have a path, in /proc/self/fd.
        if !cfg!(target_os = "linux") {
            return Err(Error::input_with(place, "this is a pipe or device", "write the data to a file first"));
        }
        let folder = std::env::temp_dir();
        let mut file = tempfile::tempfile_in(&folder).map_err(|e| Error::io(&folder, e))?;
        source.context.begin("reading the input", 0);
        source.copy(|piece| {
            // The disk is not filled to its end by a stream that has none.
            crate::output::check_space_in(&folder, LEFT_FREE).map_err(|_| {
                let message = "cannot copy the input: the folder for temporary files is nearly full";
                Error::input_with(&place, message, "set TMPDIR to a folder on a larger disk")
            })?;
            file.write_all(piece).map_err(|e| Error::io(&folder, e))
        })?;
        source.context.end();
        Ok(SpoolFile { file, place })
    }

    /// A path by which it can be opened, while this lives.
    pub fn path(&self) -> PathBuf {
        #[cfg(target_os = "linux")]
        return PathBuf::from(format!("/proc/self/fd/{}", std::os::fd::AsRawFd::as_raw_fd(&self.file)));
        #[cfg(not(target_os = "linux"))]
        PathBuf::new()
    }

    pub fn place(&self) -> &str {
        &self.place
    }

    /// The error as people know its place.
    pub fn named(&self, error: Error) -> Error {
        let path = self.path().display().to_string();
        let name = |text: String| text.replace(&path, &self.place);
        match error {
            Error::Input { place, what, hint } => Error::Input { place: name(place), what: name(what), hint },
            Error::Io { place, source } => Error::Io { place: name(place), source },
            other => other,
        }
    }
}

/// Opens a regular file and tells its length; never waits.
pub fn open_file(path: &Path) -> Result<(File, u64)> {
    let file = open_at_once(path).map_err(|e| Error::io(path, e))?;
    let metadata = file.metadata().map_err(|e| Error::io(path, e))?;
    if metadata.is_file() {
        return Ok((file, metadata.len()));
    }
    let message = format!("{}, but a regular file is expected", describe(&metadata));
    Err(Error::input_with(path, message, if metadata.is_dir() { "" } else { "write the data to a file first" }))
}

pub(crate) fn is_standard(path: &Path) -> bool {
    path.as_os_str() == STANDARD_INPUT
}

/// Whether `path` gives its data once, in order: standard input, a pipe or a device.
pub fn is_stream(path: &Path) -> bool {
    is_standard(path) || std::fs::metadata(path).is_ok_and(|m| !m.is_file() && !m.is_dir())
}

pub fn name_of(path: &Path) -> String {
    if is_standard(path) { "standard input".into() } else { path.display().to_string() }
}

#[cfg(unix)]
fn describe(metadata: &Metadata) -> &'static str {
    use std::os::unix::fs::FileTypeExt;
    let kind = metadata.file_type();
    match () {
        _ if kind.is_dir() => "a folder",
        _ if kind.is_fifo() => "a pipe",
        _ if kind.is_char_device() || kind.is_block_device() => "a device",
        _ => "a socket",
    }
}

#[cfg(not(unix))]
fn describe(metadata: &Metadata) -> &'static str {
    if metadata.is_dir() { "a folder" } else { "not a regular file" }
}

/// Opens without waiting for a pipe's writer.
#[cfg(unix)]
fn open_at_once(path: &Path) -> std::io::Result<File> {
    use rustix::fs::{CWD, Mode, OFlags, openat};
    // NOCTTY: a terminal that is read does not become that of this process.
    let flags = OFlags::RDONLY | OFlags::NONBLOCK | OFlags::CLOEXEC | OFlags::NOCTTY;
    Ok(openat(CWD, path, flags, Mode::empty())?.into())
}

#[cfg(not(unix))]
fn open_at_once(path: &Path) -> std::io::Result<File> {
    File::open(path)
}

/// Standard input, apart from the library's own buffer of it.
#[cfg(unix)]
fn standard() -> std::io::Result<File> {
    use std::os::fd::AsFd;
    Ok(std::io::stdin().as_fd().try_clone_to_owned()?.into())
}

#[cfg(windows)]
fn standard() -> std::io::Result<File> {
    use std::os::windows::io::AsHandle;
    Ok(std::io::stdin().as_handle().try_clone_to_owned()?.into())
}

/// Whether something can be read now, or it has ended. Waits for a moment.
#[cfg(unix)]
fn ready(file: &File) -> std::io::Result<bool> {
    use rustix::event::{PollFd, PollFlags, Timespec, poll};
    let wait = Timespec { tv_sec: 0, tv_nsec: ASK_EVERY.subsec_nanos().into() };
    match poll(&mut [PollFd::new(file, PollFlags::IN)], Some(&wait)) {
        Ok(n) => Ok(n > 0),
        // A signal: the caller looks whether it is to stop.
        Err(rustix::io::Errno::INTR) => Ok(false),
        Err(e) => Err(e.into()),
    }
}

#[cfg(not(unix))]
fn ready(_: &File) -> std::io::Result<bool> {
    let _ = ASK_EVERY;
    Ok(true)
}

/// A mapped file, read only. Where another program makes it shorter, reading what is gone ends the process (SIGBUS):
/// [`MappedFile::check`] says so before.
#[derive(Debug)]
pub struct MappedFile {
    map: memmap2::Mmap,
    /// Its name and what it was; none of a scratch file, which no other program has.
    named: Option<(PathBuf, Metadata)>,
}

impl MappedFile {
    /// A scratch file.
    pub fn scratch(map: memmap2::Mmap) -> MappedFile {
        MappedFile { map, named: None }
    }

    /// Refuses a file that has become shorter since it was mapped. One that was removed or replaced stays as it was.
    pub fn check(&self) -> Result<()> {
        let Some((path, before)) = &self.named else { return Ok(()) };
        let Ok(now) = std::fs::metadata(path) else { return Ok(()) };
        if now.len() >= self.map.len() as u64 || !is_same_file(&now, before) {
            return Ok(());
        }
        let message = format!("it was cut to {} bytes; it had {} when it was opened", now.len(), self.map.len());
        Err(Error::input_with(path, message, "open it again when it is whole"))
    }
}

impl std::ops::Deref for MappedFile {
    type Target = [u8];

    fn deref(&self) -> &[u8] {
        &self.map
    }
}

impl AsRef<[u8]> for MappedFile {
    fn as_ref(&self) -> &[u8] {
        self
    }
}

#[cfg(unix)]
fn is_same_file(a: &Metadata, b: &Metadata) -> bool {
    use std::os::unix::fs::MetadataExt;
    (a.dev(), a.ino()) == (b.dev(), b.ino())
}

/// Mapped files cannot be made shorter on this system.
#[cfg(not(unix))]
fn is_same_file(_: &Metadata, _: &Metadata) -> bool {
    false
}

/// Maps a file and tells its length; `None` for an empty one, which cannot be mapped.
pub fn map_file(path: &Path) -> Result<(Option<Arc<MappedFile>>, usize)> {
    let (file, length) = open_file(path)?;
    if length == 0 {
        return Ok((None, 0));
    }
    let metadata = file.metadata().map_err(|e| Error::io(path, e))?;
    // SAFETY: the mapping is read only; a file that another program truncates while we read it
    // raises SIGBUS, as with every mapped reader; nothing is written from it.
    let map = unsafe { memmap2::Mmap::map(&file) }.map_err(|e| Error::io(path, e))?;
    let length = map.len();
    Ok((Some(Arc::new(MappedFile { map, named: Some((path.to_path_buf(), metadata)) })), length))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::context::Context;
    use crate::context::ProgressSink;
    use std::sync::Mutex;
    use std::sync::atomic::{AtomicBool, Ordering};

    const NOTE: Form = Form { title: "a note", begins: Begins::Object, most: 100, expansion: 1 };

    #[test]
    fn sizes_and_beginnings_are_looked_at() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("note");
        for (bytes, fault) in [
            (&b"{}"[..], None),
            (b"  {\"a\": 1}", None),
            (b"", Some("the file is empty, not a note")),
            (b"\0\0\0", Some("the first bytes are wrong")),
            (b"text", Some("the first bytes are wrong")),
            (&[b' '; 101], Some("larger than 100 bytes, so it is not a note")),
        ] {
            std::fs::write(&path, bytes).unwrap();
            let read = read_whole(&path, NOTE, &Context::SILENT);
            let own_file = read_own(&path, NOTE);
            match fault {
                None => assert_eq!((&read.unwrap()[..], &own_file.unwrap().unwrap()[..]), (bytes, bytes)),
                Some(fault) => {
                    assert!(read.unwrap_err().to_string().contains(fault));
                    assert!(own_file.unwrap_err().to_string().contains(fault));
                }
            }
        }
        assert!(read_own(&folder.path().join("none"), NOTE).unwrap().is_none());
        assert!(read_own(folder.path(), NOTE).unwrap_err().to_string().contains("a folder"));
        assert!(read_whole(folder.path(), NOTE, &Context::SILENT).unwrap_err().to_string().contains("a folder"));
    }

    #[cfg(target_os = "linux")]
    fn fifo(folder: &Path) -> std::path::PathBuf {
        let path = folder.join("pipe");
        let mode = rustix::fs::Mode::from_raw_mode(0o600);
        rustix::fs::mknodat(rustix::fs::CWD, &path, rustix::fs::FileType::Fifo, mode, 0).unwrap();
        path
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn an_endless_device_is_left_after_its_first_bytes() {
        let zero = Path::new("/dev/zero");
        assert!(
            read_whole(zero, NOTE, &Context::SILENT).unwrap_err().to_string().contains("the first bytes are wrong")
        );
        let endless = Form { begins: Begins::With(b"\0"), ..NOTE };
        assert!(read_whole(zero, endless, &Context::SILENT).unwrap_err().to_string().contains("larger than 100"));
        assert!(open_file(zero).unwrap_err().to_string().contains("a device"));
        assert!(read_own(zero, endless).is_err());
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn a_pipe_is_waited_for_and_read() {
        let folder = tempfile::tempdir().unwrap();
        let path = fifo(folder.path());
        assert!(open_file(&path).unwrap_err().to_string().contains("a pipe"));
        let writer = std::thread::spawn({
            let path = path.clone();
            move || {
                std::thread::sleep(Duration::from_millis(300));
                std::fs::write(path, b"{\"a\": 1}").unwrap();
            }
        });
        assert_eq!(read_whole(&path, NOTE, &Context::SILENT).unwrap(), b"{\"a\": 1}");
        writer.join().unwrap();
    }

    /// Keeps what is said, and stops the work then.
    struct CancelOnMessage(Mutex<Vec<String>>, AtomicBool);

    impl ProgressSink for CancelOnMessage {
        fn message(&self, text: &str) {
            self.0.lock().unwrap().push(text.into());
            self.1.store(true, Ordering::SeqCst);
        }
    }

    #[cfg(target_os = "linux")]
    #[test]
    fn waiting_for_a_writer_is_said_and_can_be_stopped() {
        let folder = tempfile::tempdir().unwrap();
        let path = fifo(folder.path());
        let impatient = CancelOnMessage(Mutex::default(), AtomicBool::new(false));
        let cancel = || impatient.1.load(Ordering::SeqCst);
        let context = Context::SILENT.with_sink(&impatient).with_cancel(&cancel);
        assert!(matches!(read_whole(&path, NOTE, &context), Err(Error::Cancelled)));
        let said = impatient.0.into_inner().unwrap();
        assert_eq!(said.len(), 1);
        assert!(said[0].starts_with("waiting for data from ") && said[0].ends_with("pipe"), "{said:?}");
    }
}
