//! Cache of results by the hash of their inputs, so that interrupted work continues where it stopped.

use particlegs_core::{Error, Result};
use particlegs_files::output::{FileSet, write_bytes};
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

/// Raise this when results of the same inputs change their meaning: older ones are then ignored.
const VERSION: u32 = 1;

/// Commit of this program, if it was built in a repository.
pub(crate) const COMMIT: Option<&str> = option_env!("PARTICLEGS_COMMIT");

/// A folder of results.
pub struct ResultStore {
    folder: PathBuf,
    /// Device that the results depend on; empty for the CPU.
    by: Option<String>,
    /// Commits of the programs that made the cached results used so far.
    kept_of: Arc<Mutex<BTreeSet<Option<String>>>>,
}

impl ResultStore {
    /// Uses an existing folder.
    pub fn new(folder: &Path) -> ResultStore {
        ResultStore { folder: folder.to_path_buf(), by: None, kept_of: Arc::default() }
    }

    /// The results of a device in the same folder, apart from those of the CPU.
    pub fn by(&self, device: Option<&str>) -> ResultStore {
        ResultStore { folder: self.folder.clone(), by: device.map(str::to_string), kept_of: Arc::clone(&self.kept_of) }
    }

    /// The file of a result: its kind and the hash of its inputs (hashes of data, options, seeds).
    pub fn path(&self, kind: &str, inputs: &impl Serialize, ending: &str) -> PathBuf {
        let text = match &self.by {
            None => serde_json::to_vec(&(VERSION, kind, inputs)),
            Some(device) => serde_json::to_vec(&(VERSION, kind, inputs, device)),
        };
        let text = text.unwrap_or_default();
        let hash = blake3::hash(&text).to_hex();
        self.folder.join(format!("{kind}-{}.{ending}", &hash.as_str()[..24]))
    }

    /// Cached bytes; made if they are missing.
    pub fn bytes(
        &self,
        kind: &str,
        inputs: &impl Serialize,
        ending: &str,
        make: impl FnOnce() -> Result<Vec<u8>>,
    ) -> Result<Vec<u8>> {
        let path = self.path(kind, inputs, ending);
        match std::fs::read(&path) {
            Ok(bytes) => return Ok(bytes),
            Err(e) if e.kind() == std::io::ErrorKind::NotFound => {}
            Err(e) => return Err(Error::io(&path, e)),
        }
        let bytes = make()?;
        write_bytes(&path, &bytes)?;
        Ok(bytes)
    }

    /// A cached result; made if it is missing, damaged or of another version.
    pub fn result<T: Serialize + DeserializeOwned>(
        &self,
        kind: &str,
        inputs: &impl Serialize,
        make: impl FnOnce() -> Result<T>,
    ) -> Result<T> {
        self.result_if(kind, inputs, make, |_| true)
    }

    /// [`ResultStore::result`], cached only if it `lasts`: other failures are retried the next time.
    pub fn result_if<T: Serialize + DeserializeOwned>(
        &self,
        kind: &str,
        inputs: &impl Serialize,
        make: impl FnOnce() -> Result<T>,
        lasts: impl Fn(&T) -> bool,
    ) -> Result<T> {
        let path = self.path(kind, inputs, "json");
        if let Some(record) = std::fs::read(&path).ok().and_then(|text| StoredRecord::from_text(&text)) {
            self.kept_of.lock().unwrap_or_else(PoisonError::into_inner).insert(record.commit);
            return Ok(record.result);
        }
        let result = make()?;
        if !lasts(&result) {
            return Ok(result);
        }
        let text = record(inputs, &result).map_err(|e| Error::input(path.display().to_string(), e.to_string()))?;
        write_bytes(&path, &text)?;
        Ok(result)
    }

    /// A temporary folder.
    pub fn scratch(&self) -> Result<FileSet> {
        FileSet::in_folder(&self.folder)
    }

    /// Note on cached results that other versions of this program made, if there are any.
    pub fn of_others(&self) -> Option<String> {
        let all = self.kept_of.lock().unwrap_or_else(PoisonError::into_inner);
        let commit_name = |c: &Option<String>| c.as_ref().map_or("an unknown commit".into(), |c| format!("commit {c}"));
        let others: Vec<String> = all.iter().filter(|c| c.as_deref() != COMMIT).map(commit_name).collect();
        (!others.is_empty()).then(|| format!("Some results were reused from earlier runs, of {}", others.join(", ")))
    }
}

/// Text of a result's file: the inputs, the result and a hash of it.
fn record(inputs: &impl Serialize, result: &impl Serialize) -> serde_json::Result<Vec<u8>> {
    let (inputs, result) = (serde_json::to_value(inputs)?, serde_json::to_value(result)?);
    let mut all = serde_json::json!({ "inputs": inputs, "commit": COMMIT, "result": result });
    // Hash the numbers as they are read back.
    let read: serde_json::Value = serde_json::from_slice(&serde_json::to_vec(&all)?)?;
    all["hash"] = hash_of(&read).into();
    serde_json::to_vec_pretty(&all)
}

/// BLAKE3 of a result's text.
fn hash_of(all: &serde_json::Value) -> String {
    blake3::hash(all["result"].to_string().as_bytes()).to_hex().to_string()
}

#[derive(serde::Deserialize)]
struct StoredRecord<T> {
    #[serde(default)]
    commit: Option<String>,
    result: T,
}

impl<T: DeserializeOwned> StoredRecord<T> {
    /// `None` for a truncated or altered file.
    fn from_text(text: &[u8]) -> Option<Self> {
        let all: serde_json::Value = serde_json::from_slice(text).ok()?;
        let sound = all["hash"] == hash_of(&all);
        sound.then(|| serde_json::from_value(all).ok()).flatten()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_result_is_made_once() {
        let dir = tempfile::tempdir().unwrap();
        let store = ResultStore::new(dir.path());
        let ask = |inputs: &(u32, &str), value: f64| store.result("score", inputs, || Ok(value)).unwrap();
        assert_eq!(ask(&(1, "a"), 2.5), 2.5);
        // Kept; other inputs are other results.
        assert_eq!((ask(&(1, "a"), 9.0), ask(&(2, "a"), 9.0)), (2.5, 9.0));
        let has = |inputs: &(u32, &str)| store.path("score", inputs, "json").exists();
        assert!(has(&(1, "a")) && !has(&(3, "a")));
        // Damaged: made again.
        std::fs::write(store.path("score", &(1, "a"), "json"), b"{").unwrap();
        assert_eq!(ask(&(1, "a"), 4.0), 4.0);
        let failed = store.result::<f64>("score", &(7, "a"), || Err(Error::Cancelled));
        assert!(failed.is_err() && !has(&(7, "a")));
        assert_eq!(store.bytes("model", &1, "pgs", || Ok(vec![1, 2])).unwrap(), [1, 2]);
        assert_eq!(store.bytes("model", &1, "pgs", || Ok(vec![])).unwrap(), [1, 2]);
        // What does not last is made again.
        let tried = [1u32, 2, 3].map(|v| store.result_if("try", &1, || Ok(v), |v| *v == 2).unwrap());
        assert_eq!(tried, [1, 2, 2]);
        // What a device had a part in is another result; the processor is none.
        let on = |device: Option<&str>| store.by(device).result("score", &(1, "a"), || Ok(7.5)).unwrap();
        assert_eq!([on(None), on(Some("card"))], [4.0, 7.5]);
        assert_eq!(ask(&(1, "a"), 9.0), 4.0);
        // Those of another program are told.
        assert_eq!(store.of_others(), None);
        let mut other = serde_json::json!({ "commit": "abc123", "result": 4.0 });
        other["hash"] = hash_of(&other).into();
        let path = store.path("score", &(1, "a"), "json");
        std::fs::write(&path, other.to_string()).unwrap();
        assert_eq!(ask(&(1, "a"), 9.0), 4.0);
        assert!(store.of_others().unwrap().ends_with("of commit abc123"));
        // Altered, or without its hash: made again.
        for altered in [other.to_string().replace("4.0", "5.0"), r#"{"result":5.0}"#.into()] {
            std::fs::write(&path, altered).unwrap();
            assert_eq!(ask(&(1, "a"), 6.125), 6.125);
        }
    }
}
