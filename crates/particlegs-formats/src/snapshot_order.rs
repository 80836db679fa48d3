//! The snapshots of a run, in the order of time.

use crate::Choice;
use crate::folder::{folder_snapshots, natural_key};
use particlegs_core::context::Context;
use particlegs_core::{Error, Result};
use particlegs_files::input::is_stream;
use std::path::{Path, PathBuf};

/// The snapshots that a user names by a folder, by patterns that no shell has replaced, or one by one: sorted by the times
/// that they state. If some state none, they stay as they are named, but for names that differ in numbers alone and that
/// a shell has sorted as text: `snap_2` then comes before `snap_10`. Says so where that changes their order.
///
/// # Errors
/// A folder that cannot be read or holds no snapshot, a pattern that nothing matches.
pub fn run_snapshots(inputs: &[PathBuf], options: &Choice, context: &Context<'_>) -> Result<Vec<PathBuf>> {
    let named = match inputs {
        [folder] if folder.is_dir() => folder_snapshots(folder, options)?,
        paths => paths.iter().map(|p| matching(p)).collect::<Result<Vec<_>>>()?.concat(),
    };
    let mut ordered = in_natural_order(&named);
    let is_timed = sort_by_time(&mut ordered, options);
    if ordered != named {
        let name = |path: &PathBuf| path.file_name().unwrap_or(path.as_os_str()).to_string_lossy().into_owned();
        let names: Vec<String> = ordered.iter().map(name).collect();
        let names = match &names[..] {
            [first, second, _, .., last] => format!("{first}, {second}, ..., {last}"),
            few => few.join(", "),
        };
        let by = if is_timed { "their times" } else { "the numbers in their names" };
        context.message(&format!("note: the snapshots are taken in the order of {by}: {names}"));
    }
    Ok(ordered)
}

/// Files that match a pattern; a path that is none, or that exists, as it is.
fn matching(path: &Path) -> Result<Vec<PathBuf>> {
    let Some(pattern) = path.to_str().filter(|text| text.contains(['*', '?', '[']) && !path.exists()) else {
        return Ok(vec![path.to_path_buf()]);
    };
    let matches = glob::glob(pattern).map_err(|e| Error::argument(format!("{pattern}: {e}")))?;
    let paths: Vec<PathBuf> = matches.filter_map(|path| path.ok()).collect();
    if paths.is_empty() { Err(Error::argument(format!("no file matches {pattern}"))) } else { Ok(paths) }
}

/// Sorts each stretch of names that differ in numbers alone, if it is sorted as text: what a user has put into another
/// order stays so.
fn in_natural_order(paths: &[PathBuf]) -> Vec<PathBuf> {
    let words = |path: &PathBuf| natural_key(path).into_iter().map(|part| part.0).collect::<Vec<_>>();
    let letters = |path: &PathBuf| path.to_string_lossy().replace(|c: char| !c.is_alphanumeric(), "").to_lowercase();
    let mut ordered = paths.to_vec();
    for alike in ordered.chunk_by_mut(|a, b| words(a) == words(b)) {
        // Shells sort by bytes, or as dictionaries do, without signs and capitals.
        if alike.is_sorted() || alike.is_sorted_by_key(letters) {
            alike.sort_by_cached_key(|path| natural_key(path));
        }
    }
    ordered
}

/// Sorts by scale factor, time or step, whichever the first states, where all state it, and tells whether they do. A snapshot that cannot be opened
/// stays behind the one that it is named after.
fn sort_by_time(paths: &mut Vec<PathBuf>, options: &Choice) -> bool {
    let clock = |path: &PathBuf| {
        if !path.exists() || is_stream(path) {
            return None;
        }
        let described = options.describe(std::slice::from_ref(path), false, &Context::SILENT).ok()?;
        let epoch = described.0.meta.epoch;
        Some([epoch.scale_factor, epoch.time, epoch.step.map(|step| step as f64)])
    };
    let clocks: Vec<Option<[Option<f64>; 3]>> = paths.iter().map(clock).collect();
    let Some(kind) = clocks.iter().flatten().next().and_then(|clock| clock.iter().position(Option::is_some)) else {
        return false;
    };
    let mut timed = Vec::with_capacity(paths.len());
    let mut last = f64::NEG_INFINITY;
    for (path, clock) in paths.iter().zip(clocks) {
        match clock.map(|clock| clock[kind]) {
            Some(None) => return false,
            Some(Some(time)) => last = time,
            None => {}
        }
        timed.push((last, path.clone()));
    }
    // A stable sort: those that could not be opened stay behind the one before them.
    timed.sort_by(|a, b| a.0.total_cmp(&b.0));
    *paths = timed.into_iter().map(|(_, path)| path).collect();
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn paths(names: &[&str]) -> Vec<PathBuf> {
        names.iter().map(PathBuf::from).collect()
    }

    #[test]
    fn numbers_in_names_are_numbers_where_a_shell_has_sorted_text() {
        let ordered = |names: &[&str]| in_natural_order(&paths(names));
        assert_eq!(ordered(&["s_1.x", "s_10.x", "s_2.x"]), paths(&["s_1.x", "s_2.x", "s_10.x"]));
        // As a dictionary sorts them, and folders with numbers.
        assert_eq!(ordered(&["s_10.x", "s_1.x", "s_2.x"]), paths(&["s_1.x", "s_2.x", "s_10.x"]));
        assert_eq!(ordered(&["t1/s", "t10/s", "t9/s"]), paths(&["t1/s", "t9/s", "t10/s"]));
        assert_eq!(ordered(&["s_007", "s_08", "s_9"]), paths(&["s_007", "s_08", "s_9"]));
        // Two patterns, one after the other; and what a user has put into an order.
        let two = ["b_1", "b_10", "b_2", "a_1", "a_3"];
        assert_eq!(ordered(&two), paths(&["b_1", "b_2", "b_10", "a_1", "a_3"]));
        for chosen in [&["s_3", "s_2", "s_1"][..], &["start", "middle", "end"]] {
            assert_eq!(ordered(chosen), paths(chosen));
        }
    }

    #[test]
    fn snapshots_are_sorted_by_their_times_where_all_state_them() {
        let dir = tempfile::tempdir().unwrap();
        let put = |name: &str, title: &str| {
            std::fs::write(dir.path().join(name), format!("{title}\n1\n    1X      X    1   0.1   0.2   0.3\n1 1 1\n"))
        };
        for (name, time) in [("a.gro", 3.0), ("b.gro", 1.0), ("c.gro", 2.0)] {
            put(name, &format!("frame t= {time}")).unwrap();
        }
        let ordered = || {
            let named = paths(&["a.gro", "gone.gro", "b.gro", "c.gro"]).iter().map(|p| dir.path().join(p)).collect();
            let ordered: Vec<PathBuf> = run_snapshots(&named as &Vec<_>, &Choice::default(), &Context::SILENT).unwrap();
            ordered.iter().map(|p| p.file_stem().unwrap().to_string_lossy().into_owned()).collect::<Vec<_>>()
        };
        assert_eq!(ordered(), ["b", "c", "a", "gone"]);
        put("c.gro", "no time").unwrap();
        assert_eq!(ordered(), ["a", "gone", "b", "c"]);
    }
}
