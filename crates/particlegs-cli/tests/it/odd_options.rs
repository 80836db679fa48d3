//! Every option in the help of every command that reads or draws, at odd values: the command succeeds, prints one error
//! line, or works and can be stopped.

use crate::common::{TestFolder, errors, particlegs, process, signal, snapshot};
use std::process::{Child, Stdio};
use std::time::{Duration, Instant};

/// A working command is stopped after this ...
const PATIENCE: Duration = Duration::from_secs(4);
/// ... and must end within this, on a busy machine.
const HEARD: Duration = Duration::from_secs(30);

const VALUES: [&str; 9] =
    ["0", "-1", "5e-324", "1e-300", "1e300", "nan", "inf", "18446744073709551615", "1e-9,1e300,1"];

/// Commands with required arguments, and options that make them quick.
const COMMANDS: [[&str; 2]; 9] = [
    ["compress snap --certificate=none", "-o=@.pgs --effort=fast --ratio=10"],
    ["render m.pgs", "--out=@ --size=32x24"],
    ["reference snap", "--out=@ --size=32x24"],
    ["eval m.pgs snap", "--frames=1 --size=32x24"],
    ["stats snap snap --no-plots", "-o=@ --grid=8 --spectrum-grid=8 --pairs=10000"],
    ["simplify m.pgs", "-o=@.pgs --gaussians=5"],
    ["recover m.pgs", "-o=@ --particles=50"],
    ["convert snap", "-o=@"],
    ["plan snap", "-o=@ --blocks=2"],
];

/// A folder with a snapshot and a model of it.
fn inputs() -> TestFolder {
    let dir = TestFolder::new();
    let column = |k: u64| (0..600u64).map(|i| ((i * (7 + k) * 2_654_435_761) % 10_007) as f32 * 1e-2).collect();
    snapshot(&dir.at("snap"), &[column(0), column(1), column(2)]);
    dir.runs("compress snap -o m.pgs --gaussians 20 --effort fast --certificate=none -q");
    dir
}

/// The options of a command that take a value, from its help.
fn options(command: &str) -> Vec<String> {
    let out = particlegs().args([command, "--help"]).output().unwrap();
    let help = String::from_utf8(out.stdout).unwrap();
    let option = |line: &str| {
        let (before, _) = line.trim().split_once(" <")?;
        let name = before.split(' ').next_back()?;
        (line.trim().starts_with('-') && name.starts_with("--")).then(|| name.to_string())
    };
    let options: Vec<String> = help.lines().filter_map(option).collect();
    assert!(options.len() > 3, "{command}: {options:?}");
    options
}

fn arguments([base, small]: [&str; 2], option: &str, value: &str, number: usize) -> Vec<String> {
    let mut all: Vec<String> = base.split(' ').map(String::from).collect();
    for word in small.split(' ') {
        let (name, small) = word.split_once('=').unwrap();
        if name != option && !(name == "-o" && option == "--out") {
            all.extend([name.to_string(), small.replace('@', &format!("out{number}"))]);
        }
    }
    all.extend(["-q".into(), format!("{option}={value}")]);
    all
}

fn wait(child: &mut Child, limit: Duration) -> bool {
    let start = Instant::now();
    while start.elapsed() < limit {
        if child.try_wait().unwrap().is_some() {
            return true;
        }
        std::thread::sleep(Duration::from_millis(3));
    }
    false
}

/// Runs a command until it ends or is stopped.
fn run(dir: &TestFolder, arguments: &[String]) {
    let error = std::fs::File::create(dir.at("stderr")).unwrap();
    let mut command = process(dir.path());
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::null()).stderr(error);
    let mut child = command.spawn().unwrap();
    let mut ended = wait(&mut child, PATIENCE);
    if !ended {
        signal(&child, "-TERM");
        ended = wait(&mut child, HEARD);
    }
    if !ended {
        child.kill().unwrap();
    }
    let status = child.wait().unwrap();
    let text = dir.text("stderr");
    assert!(ended, "{arguments:?} does not end:\n{text}");
    let code = status.code().unwrap_or_else(|| panic!("{arguments:?} ended by {status}:\n{text}"));
    assert!([0, 2, 3, 4, 5, 6, 7, 8, 75, 130].contains(&code), "{arguments:?} ended with {code}:\n{text}");
    assert!(!text.contains("panicked"), "{arguments:?} ended with {code}:\n{text}");
    assert_eq!(errors(&text), usize::from(code != 0), "{arguments:?} ended with {code}:\n{text}");
}

/// Every option with each value, starting with the `first`.
fn sweep(first: usize) {
    let dir = inputs();
    let mut number = 0;
    for base in COMMANDS {
        for (i, option) in options(base[0].split(' ').next().unwrap()).iter().enumerate() {
            let value = VALUES[(first + i) % VALUES.len()];
            run(&dir, &arguments(base, option, value, number));
            number += 1;
        }
    }
    assert!(number > 50);
}

#[test]
fn options_at_odd_values_end() {
    sweep(0);
}

#[test]
#[ignore = "slow"]
fn options_at_other_odd_values_end() {
    sweep(4);
}
