//! Finds the commit of the source, if it is in a repository, for results to name it. It reads git's files and runs no
//! program.

use std::path::{Path, PathBuf};

fn main() {
    println!("cargo:rerun-if-changed=build.rs");
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("../..");
    if let Some(commit) = git_folder(&root).and_then(|git| commit(&git)) {
        println!("cargo:rustc-env=PARTICLEGS_COMMIT={}", &commit[..commit.len().min(12)]);
    }
}

/// `.git`, or the folder that it names (in a git worktree).
fn git_folder(root: &Path) -> Option<PathBuf> {
    let git = root.join(".git");
    if git.is_dir() {
        return Some(git);
    }
    let text = std::fs::read_to_string(&git).ok()?;
    Some(root.join(text.strip_prefix("gitdir:")?.trim()))
}

fn commit(git: &Path) -> Option<String> {
    let watched = |path: PathBuf| {
        println!("cargo:rerun-if-changed={}", path.display());
        std::fs::read_to_string(path).ok()
    };
    let head = watched(git.join("HEAD"))?;
    let Some(name) = head.trim().strip_prefix("ref: ") else { return Some(head.trim().to_string()) };
    // The branches of a worktree are in the main repository.
    let common = std::fs::read_to_string(git.join("commondir")).map_or(git.to_path_buf(), |c| git.join(c.trim()));
    let of_packed = || {
        let packed = std::fs::read_to_string(common.join("packed-refs")).ok()?;
        let line = packed.lines().find(|l| l.ends_with(name) && l.split(' ').nth(1) == Some(name))?;
        line.split(' ').next().map(str::to_string)
    };
    let path = common.join(name);
    if path.exists() { watched(path).map(|c| c.trim().to_string()) } else { of_packed() }
}
