//! Frames of a series that wait beside its file until it is whole.

use particlegs_core::codec::CodedFrame;
use particlegs_core::{Error, Hint, Result};
use particlegs_files::output::WorkFolder;
use std::path::Path;

const RECIPE: &str = "recipe.json";
const FRAME: &str = "frame-";
/// Bytes before a frame's own: BLAKE3 of the recipe, the frame's number and all that follows; the time; 1 for a
/// keyframe.
const HASH: usize = 32;

/// Frames of one recipe in the folder `OUTPUT.work`, from which an interrupted run goes on.
pub struct FrameStore {
    folder: Option<WorkFolder>,
    recipe: String,
    has_frames: bool,
}

impl FrameStore {
    /// Opens the store of an `output`; frames that were made by another recipe go if they are to be replaced. An output
    /// that is a stream has none, and its frames are not kept.
    ///
    /// # Errors
    /// As [`WorkFolder::beside`], and [`Error::Argument`] for frames of another recipe.
    pub fn open(output: &Path, recipe: &str, replace: bool) -> Result<FrameStore> {
        let folder = WorkFolder::beside(output, is_own)?;
        let mut store = FrameStore { folder, recipe: recipe.into(), has_frames: false };
        let Some(folder) = &store.folder else { return Ok(store) };
        match folder.read(RECIPE) {
            Some(bytes) if bytes == recipe.as_bytes() => store.has_frames = true,
            Some(_) if !replace => {
                store.has_frames = true;
                let message = format!("{} holds frames that were made with other options", folder.path().display());
                return Err(Error::argument_with(
                    message,
                    Hint::from("remove the folder, or use ").option("force", ""),
                ));
            }
            _ => {
                folder.clear()?;
                folder.write(RECIPE, recipe.as_bytes())?;
            }
        }
        Ok(store)
    }

    /// Keeps a frame.
    pub fn keep(&mut self, number: usize, frame: &CodedFrame) -> Result<()> {
        let Some(folder) = &self.folder else { return Ok(()) };
        let mut bytes = frame.time.to_le_bytes().to_vec();
        bytes.push(u8::from(frame.keyframe));
        bytes.extend(&frame.bytes);
        let hash = self.hash(number, &bytes);
        folder.write(&name(number), &[&hash[..], &bytes].concat())?;
        self.has_frames = true;
        Ok(())
    }

    /// A frame that was kept; none where there is none, or where its bytes are not those that were kept.
    pub fn frame(&self, number: usize) -> Option<CodedFrame> {
        let bytes = self.folder.as_ref()?.read(&name(number))?;
        let (hash, rest) = bytes.split_at_checked(HASH)?;
        // A frame that was damaged, or stands under another number, is made again.
        if hash != self.hash(number, rest) {
            return None;
        }
        let (time, rest) = rest.split_first_chunk()?;
        let (&keyframe, bytes) = rest.split_first()?;
        Some(CodedFrame { time: f64::from_le_bytes(*time), keyframe: keyframe == 1, bytes: bytes.to_vec() })
    }

    fn hash(&self, number: usize, bytes: &[u8]) -> [u8; HASH] {
        let mut hasher = blake3::Hasher::new();
        hasher.update(blake3::hash(self.recipe.as_bytes()).as_bytes());
        *hasher.update(&(number as u64).to_le_bytes()).update(bytes).finalize().as_bytes()
    }

    /// Removes the frames, which the series holds now.
    ///
    /// # Errors
    /// Others have put something into the folder: it stays as it is.
    pub fn remove(mut self) -> Result<()> {
        self.folder.take().map_or(Ok(()), WorkFolder::remove)
    }
}

impl Drop for FrameStore {
    /// A run that ends before its first frame leaves nothing.
    fn drop(&mut self) {
        if let Some(folder) = self.folder.take().filter(|_| !self.has_frames) {
            let _ = folder.remove();
        }
    }
}

fn name(number: usize) -> String {
    format!("{FRAME}{number:06}")
}

fn is_own(text: &str) -> bool {
    let number = text.strip_prefix(FRAME).and_then(|digits| digits.parse().ok());
    text == RECIPE || number.is_some_and(|number| name(number) == text)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn frames_come_back_whole_to_the_recipe_that_made_them() {
        let dir = tempfile::tempdir().unwrap();
        let output = dir.path().join("run.pgs");
        let open = |recipe: &str, replace| FrameStore::open(&output, recipe, replace);
        let frame = CodedFrame { time: 0.5, keyframe: true, bytes: b"frame".to_vec() };
        let mut store = open("{}", false).unwrap();
        store.keep(3, &frame).unwrap();
        assert_eq!((store.frame(3), store.frame(2)), (Some(frame.clone()), None));
        drop(store);
        // A frame under another number, or cut short, is none.
        let place = |name: &str| dir.path().join("run.pgs.work").join(name);
        let bytes = std::fs::read(place("frame-000003")).unwrap();
        std::fs::write(place("frame-000004"), &bytes).unwrap();
        std::fs::write(place("frame-000003"), &bytes[..bytes.len() - 1]).unwrap();
        let store = open("{}", false).unwrap();
        assert_eq!([3, 4].map(|number| store.frame(number)), [None, None]);
        drop(store);
        assert!(open("[]", false).is_err_and(|e| e.to_string().contains("other options")));
        std::fs::write(place("frame-000003"), &bytes).unwrap();
        assert_eq!(open("[]", true).unwrap().frame(3), None);
        // Nothing was kept: nothing stays.
        assert!(!dir.path().join("run.pgs.work").exists());
        open("[]", false).unwrap().remove().unwrap();
        assert!(!dir.path().join("run.pgs.work").exists());
    }

    #[test]
    fn names_of_frames_alone_are_ours() {
        assert!(["frame-000000", "frame-1048576", RECIPE].iter().all(|name| is_own(name)));
        assert!(
            ["frame-1", "frame-0000001", "frame-+00001", "frames", "FRAME-000001"].iter().all(|name| !is_own(name))
        );
    }
}
