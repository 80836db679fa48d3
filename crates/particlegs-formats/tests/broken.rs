//! Every broken file is refused in one line that names it, at once and in little memory.

mod support;

use std::path::Path;
use std::time::Duration;
use support::{ResourceUse, measured};

#[global_allocator]
static COUNTING: support::CountingAllocator = support::CountingAllocator;

/// Those that are read: a box of 0 is none, and a header may be that of a larger snapshot, which a note says.
const GOOD: [&str; 2] = ["hdf5_box0.hdf5", "hdf5_count_lies.hdf5"];
const MOST_BYTES: usize = 100 << 20;
const LONGEST: Duration = Duration::from_secs(1);

fn check(path: &Path, refused: bool) -> Vec<String> {
    let mut wrong = Vec::new();
    let name = path.file_name().expect("a file").to_string_lossy().into_owned();
    let ResourceUse { result, time, peak, largest } = measured(|| support::read_everything(path, None));
    match result {
        Err(_) => wrong.push("it panics".into()),
        Ok(Ok(n)) if refused => wrong.push(format!("it is read: {n} particles")),
        Ok(Ok(_)) => {}
        Ok(Err(e)) if !refused => wrong.push(format!("it is refused: {e}")),
        Ok(Err(e)) => {
            let text = e.to_string();
            println!("{text} | {}", e.hint());
            if text.contains('\n') || e.hint().to_string().contains('\n') {
                wrong.push(format!("more than a line: {text:?}"));
            }
            if !text.contains(&name) {
                wrong.push(format!("the file is not named: {text}"));
            }
        }
    }
    if time > LONGEST {
        wrong.push(format!("it takes {time:?}"));
    }
    if peak > MOST_BYTES {
        wrong.push(format!("it takes {} MiB, {} MiB at once", peak >> 20, largest >> 20));
    }
    wrong.into_iter().map(|message| format!("{name}: {message}")).collect()
}

#[test]
fn every_broken_file_is_refused_in_one_line() {
    let files = support::files(&support::data("bad"));
    assert!(files.len() >= 75, "{} files", files.len());
    let wrong: Vec<String> = files.iter().flat_map(|p| check(p, !GOOD.iter().any(|good| p.ends_with(good)))).collect();
    assert!(wrong.is_empty(), "{} faults:\n{}", wrong.len(), wrong.join("\n"));
}
