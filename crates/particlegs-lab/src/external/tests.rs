use super::*;
use crate::testing::{clustered, odd};
use crate::{PositionColumns, largest_error, rate};
use particlegs_core::context::Context;
use std::ffi::OsString;

/// A Python with the packages, from `PARTICLEGS_LAB_PYTHON`.
fn named() -> Option<PathBuf> {
    std::env::var_os("PARTICLEGS_LAB_PYTHON").map(|p: OsString| p.into())
}

/// A child that needs only the standard library. The statements compute `out` from what = 'v', 'c' or 'd', name, bound,
/// n and data, or end the child.
fn fake(statements: &str) -> Result<External> {
    let program = format!(
        "import os, struct, sys
stdin, stdout = sys.stdin.buffer, sys.stdout.buffer
def say(kind, out):
    stdout.write(kind + struct.pack('<Q', len(out)) + out)
    stdout.flush()
while True:
    head = stdin.read(8)
    if len(head) < 8: break
    request = stdin.read(struct.unpack('<Q', head)[0])
    what, k = chr(request[0]), request[1]
    name = request[2:2 + k].decode()
    bound, n = struct.unpack_from('<dQ', request, 2 + k)
    data = request[18 + k:]
    out = b'SZ3 of nobody\\nZFP of nobody'
    if what != 'v':
        {}
    say(b'K', out)
",
        statements.replace('\n', "\n        ")
    );
    External::from_command(Path::new("python3"), ["-u", "-c", &program].map(String::from).to_vec())
}

fn sz3(external: &External) -> LibraryBaseline {
    LibraryBaseline { external: external.clone(), library: CompressionLibrary::Sz3, order: ColumnOrder::Morton }
}

#[test]
fn requests_and_answers_pass_the_pipes_unchanged() {
    // Compression returns the request itself before the data.
    let external =
        fake("out = struct.pack('<dQ', bound, n) + name.encode() + data if what == 'c' else data[19:]").unwrap();
    // More than a pipe can hold.
    let particles = clustered(300_000);
    for order in [ColumnOrder::File, ColumnOrder::Morton] {
        let baseline = LibraryBaseline { order, ..sz3(&external) };
        let coded = baseline.compress(&particles, 0.25).unwrap();
        let (inner, _) = packed::opened(&coded.bytes).unwrap();
        assert_eq!(inner[..8], 0.25f64.to_le_bytes());
        assert_eq!((&inner[8..16], &inner[16..19]), (&300_000u64.to_le_bytes()[..], &b"SZ3"[..]));
        assert_eq!(coded.order.is_some(), order == ColumnOrder::Morton);
        let decoded = baseline.decompress(&coded.bytes).unwrap();
        assert_eq!(largest_error(&particles, &decoded, coded.order.as_deref()), 0.0);
    }
    assert_eq!(sz3(&external).source(), "of nobody");
    let names: Vec<&str> = external.baselines().iter().map(|b| b.name()).collect();
    assert_eq!(names, ["SZ3, file order", "SZ3, Morton order", "ZFP, file order", "ZFP, Morton order"]);
}

#[test]
fn a_missing_python_or_package_is_reported_in_one_line() {
    let error = External::start(Path::new("/nowhere/python")).err().unwrap();
    assert!(error.to_string().starts_with("/nowhere/python: the program cannot be started"), "{error}");
    assert!(error.hint().to_string().contains("requirements.txt"));
    // Without site-packages no package is found.
    let lacking = ["-I", "-S", "-u", "-c", SCRIPT].map(String::from).to_vec();
    let error = External::from_command(Path::new("python3"), lacking).err().unwrap();
    assert_eq!(error.to_string(), "python3: is missing the packages numpy, pysz, zfpy");
    let hint = error.hint().to_string();
    assert!(hint.starts_with("python3 -m pip install numpy==") && hint.contains(" pysz=="), "{hint}");
}

#[test]
fn wrong_programs_are_reported() {
    let message_of = |program: &str, arguments: &[&str]| {
        let arguments = arguments.iter().map(|a| (*a).to_string()).collect();
        External::from_command(Path::new(program), arguments).err().unwrap().to_string()
    };
    assert_eq!(
        message_of("sh", &["-c", "echo no such option >&2; exit 3"]),
        "sh: it ended before it answered: no such option"
    );
    assert_eq!(message_of("sh", &["-c", "exit 3"]), "sh: it ended before it answered: exit status: 3");
    // One that gives back what it gets, and one that writes without end and reads nothing.
    assert!(message_of("cat", &[]).contains("the answer does not come from"));
    assert!(message_of("sh", &["-c", "while echo yyyyyyyyyyy; do :; done"]).contains("the answer does not come from"));
}

#[test]
fn a_child_that_dies_is_reported_and_restarted() {
    let external = fake(
        "out = data
if bound == 7:
    print('Segmentation', file=sys.stderr, flush=True); os.kill(os.getpid(), 9)
if bound == 8:
    stdout.write(b'K' + struct.pack('<Q', 10**15) + b'few'); stdout.flush(); sys.exit('half way')
if bound == 9:
    say(b'E', b'ValueError: two\\nlines'); continue",
    )
    .unwrap();
    // More than a pipe can hold, so that the writer blocks.
    let particles = clustered(100_000);
    let compress = |bound| sz3(&external).compress(&particles, bound);
    assert_eq!(
        compress(7.0).err().unwrap().to_string(),
        "python3: it ended before it answered during SZ3: Segmentation"
    );
    assert!(compress(1.0).is_ok());
    assert_eq!(
        compress(8.0).err().unwrap().to_string(),
        "python3: it ended in the middle of its answer during SZ3: half way"
    );
    assert_eq!(compress(9.0).err().unwrap().to_string(), "SZ3: ValueError: two lines");
    assert!(compress(1.0).is_ok());
    // A baseline's failure is a result.
    let failed = rate::verified(&sz3(&external), &particles, 9.0);
    assert_eq!(failed.failure().as_deref(), Some("SZ3: ValueError: two lines"));
}

#[test]
fn a_child_that_dies_while_reading_causes_no_deadlock() {
    let program = "import sys, struct
stdin, stdout = sys.stdin.buffer, sys.stdout.buffer
stdin.read(struct.unpack('<Q', stdin.read(8))[0])
stdout.write(b'K' + struct.pack('<Q', 0)); stdout.flush()
stdin.read(1000)
sys.exit('enough')";
    let external =
        External::from_command(Path::new("python3"), ["-u", "-c", program].map(String::from).to_vec()).unwrap();
    let error = sz3(&external).compress(&clustered(300_000), 1.0).err().unwrap();
    assert_eq!(error.to_string(), "python3: it ended before it answered during SZ3: enough");
}

#[test]
fn bounds_and_bytes_are_checked_before_the_child_sees_them() {
    let external = fake("out = b'1234567'").unwrap();
    let particles = clustered(10);
    assert!(matches!(sz3(&external).compress(&particles, f64::NAN), Err(Error::Argument { .. })));
    let uneven: PositionColumns = [vec![1.0], vec![], vec![1.0]];
    assert!(matches!(sz3(&external).compress(&uneven, 1.0), Err(Error::Argument { .. })));
    let mut bytes = sz3(&external).compress(&particles, 1.0).unwrap().bytes;
    assert!(sz3(&external).decompress(&bytes).err().unwrap().to_string().contains("columns differ in length"));
    bytes[5] ^= 1;
    assert_eq!(sz3(&external).decompress(&bytes).err().unwrap().to_string(), "SZ3: the data are corrupt");
}

#[test]
fn the_libraries_keep_their_bounds() {
    let Some(python) = named() else { return };
    let external = External::start(&python).unwrap();
    let all = odd().into_iter().chain([0.001, 0.2, 20.0].map(|bound| (clustered(5000), bound)));
    for (particles, bound) in all {
        for baseline in external.baselines() {
            let run = rate::verified(&*baseline, &particles, bound);
            let case = (baseline.name(), particles[0].len(), bound);
            // ZFP has fewer digits than float32 if coordinates in a block differ much: the broken bound is reported.
            let digits = particles.iter().flatten().fold(0f32, |m, v| m.max(v.abs())) * f32::EPSILON;
            let broken = baseline.name().starts_with("ZFP") && bound < f64::from(digits);
            assert!(run.failure().is_none() || broken, "{case:?}: {:?}", run.failure());
            let again = baseline.compress(&particles, bound).unwrap().bytes.len() as u64;
            assert_eq!(again, run.run().unwrap().bytes, "{case:?}");
        }
    }
}

#[test]
fn the_libraries_meet_sizes_and_refuse_damage() {
    let Some(python) = named() else { return };
    let external = External::start(&python).unwrap();
    assert!(sz3(&external).source().starts_with("SZ3 3."), "{}", sz3(&external).source());
    let particles = clustered(20_000);
    let size_bound = rate::at_size(&sz3(&external), &particles, 12_000, &Context::SILENT).unwrap();
    assert!(size_bound.met(), "{size_bound:?}");
    let other = LibraryBaseline { library: CompressionLibrary::Zfp, order: ColumnOrder::File, ..sz3(&external) };
    let bytes = other.compress(&particles, 0.1).unwrap().bytes;
    // Bytes of another compressor, and damage with a matching checksum.
    assert!(sz3(&external).decompress(&bytes).is_err());
    let inner = packed::opened(&bytes).unwrap().0;
    assert!(other.decompress(&packed::sealed(inner[..inner.len() / 2].to_vec(), 0)).is_err());
    assert!(other.decompress(&bytes).is_ok());
}
