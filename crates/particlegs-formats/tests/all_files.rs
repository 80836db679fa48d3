//! Every good file: its count, its first three positions and its box are what independent readers
//! say (the table beside the files).

mod support;

use particlegs_formats::{Fields, Weights};
use std::path::Path;

/// Files whose features are not read, and a word of the message that says so: none now.
const UNSUPPORTED: &[(&str, &str)] = &[];

/// A row of the table.
struct Row {
    file: String,
    format: String,
    count: u64,
    first: Vec<[f64; 3]>,
    /// Rows of the cell's vectors, or its diagonal.
    cell: Vec<f64>,
}

fn numbers(text: &str) -> Vec<f64> {
    text.split(|c: char| !(c.is_ascii_digit() || "+-.e".contains(c))).filter_map(|w| w.parse().ok()).collect()
}

fn rows(table: &str) -> Vec<Row> {
    let cells = table.lines().filter(|l| l.starts_with("|real/") || l.starts_with("|gen/"));
    cells
        .map(|line| {
            // Cells hold no bars; a quoted `|` in the formats' column would shift the rest.
            let c: Vec<&str> = line.trim_matches('|').split('|').collect();
            let first = c[5].split(';').map(numbers).filter(|v| v.len() == 3).map(|v| [v[0], v[1], v[2]]).collect();
            let cell = numbers(c[6]).into_iter().filter(|v| *v != 0.0 || c[6].contains("[[")).collect();
            Row { file: c[0].into(), format: c[1].into(), count: c[4].parse().expect("a count"), first, cell }
        })
        .collect()
}

/// Files of one snapshot after the first: the first one finds them.
fn is_later_part(file: &str) -> bool {
    ["snap.1", "multi.1", "multi.2", "multi.1.hdf5", "multi.2.hdf5"].iter().any(|end| file.ends_with(end))
}

/// Particles of the whole snapshot whose first file this is.
fn whole_count(row: &Row, rows: &[Row]) -> u64 {
    let stem = |file: &str| file.trim_end_matches(".hdf5").trim_end_matches(|c: char| c.is_ascii_digit()).to_string();
    let parts = rows.iter().filter(|r| is_later_part(&r.file) && stem(&r.file) == stem(&row.file));
    row.count + parts.map(|r| r.count).sum::<u64>()
}

fn check(folder: &Path, row: &Row, count: u64) -> Result<(), String> {
    let path = folder.join(&row.file);
    let said = |e: particlegs::Error| format!("{e} ({})", e.hint());
    let mut snapshot = support::open(&path, None, None).map_err(said)?;
    if snapshot.description().frames.is_some_and(|f| f.count > 1) {
        snapshot = support::open(&path, None, Some(0)).map_err(said)?;
    }
    let description = snapshot.description();
    let counts: Vec<u64> = description.species.iter().map(|s| s.count).collect();
    if counts.iter().sum::<u64>() != count && counts.first() != Some(&count) {
        return Err(format!("{counts:?} particles instead of {count}"));
    }
    // Rows of dumps come in any order: sorted by id here.
    let has_ids = row.format.contains("LAMMPS") && description.species[0].fields.iter().any(|f| f.name == "id");
    let weights = if has_ids { Weights::Field("id".into()) } else { Weights::None };
    let fields = Fields { weights, ..Fields::default() };
    let mut particles = support::particles(&*snapshot, 0, &fields).map_err(said)?;
    if has_ids {
        // Types are species.
        for species in 1..description.species.len() {
            particles.extend(support::particles(&*snapshot, species, &fields).map_err(said)?);
        }
        particles.sort_by(|a, b| a[3].total_cmp(&b[3]));
    }
    let extent = row.first.iter().flatten().chain(&row.cell).fold(0.0f64, |a, v| a.max(v.abs()));
    let tolerance = |v: f64| if row.format.contains("SPZ") { 1.3e-4 } else { 6e-6 * v.abs() + 2e-7 * extent + 6e-7 };
    for (seen, wanted) in particles.iter().zip(&row.first) {
        if (0..3).any(|k| (seen[k] - wanted[k]).abs() > tolerance(wanted[k])) {
            return Err(format!("{seen:?} instead of {wanted:?}"));
        }
    }
    check_cell(description.meta.cell.as_ref().map(|c| c.vectors), &row.cell)
}

fn check_cell(seen: Option<[[f64; 3]; 3]>, wanted: &[f64]) -> Result<(), String> {
    let near = |a: f64, b: f64| (a - b).abs() <= 1e-5 * b.abs() + 1e-9;
    let right = match (seen, wanted) {
        (None, []) => true,
        (Some(v), [l]) => (0..9).all(|i| near(v[i / 3][i % 3], if i % 4 == 0 { *l } else { 0.0 })),
        (Some(v), [x, y, z]) => near(v[0][0], *x) && near(v[1][1], *y) && near(v[2][2], *z),
        (Some(v), nine) if nine.len() == 9 => (0..9).all(|i| near(v[i / 3][i % 3], nine[i])),
        _ => false,
    };
    if right { Ok(()) } else { Err(format!("box {seen:?} instead of {wanted:?}")) }
}

#[test]
fn every_good_file_is_what_the_table_says() {
    let Some(folder) = support::shared() else { return };
    let table = std::fs::read_to_string(folder.join("README.md")).expect("the table");
    let rows = rows(&table);
    assert!(rows.len() > 90, "the table has {} rows", rows.len());
    let (mut wrong, mut right, mut unsupported) = (Vec::new(), 0, Vec::new());
    for row in rows.iter().filter(|r| !is_later_part(&r.file)) {
        let expected = UNSUPPORTED.iter().find(|u| u.0 == row.file);
        match (check(&folder, row, whole_count(row, &rows)), expected) {
            (Ok(()), _) => right += 1,
            (Err(what), Some((_, word))) if what.contains(word) => unsupported.push(what),
            (Err(what), _) => wrong.push(format!("{} ({}): {what}", row.file, row.format)),
        }
    }
    println!("{right} files as the table says; not supported: {}", unsupported.join("; "));
    assert!(wrong.is_empty(), "{} of {} files:\n{}", wrong.len(), rows.len(), wrong.join("\n"));
}

#[test]
fn every_fixture_holds_the_first_fifty_particles() {
    let mut wrong = Vec::new();
    let mut count = 0;
    for entry in std::fs::read_dir(support::fixtures()).expect("a folder").flatten() {
        let path = entry.path();
        if path.extension().is_some_and(|e| e == "py" || e == "md") {
            continue;
        }
        count += 1;
        if let Err(what) = check_fixture(&path) {
            wrong.push(format!("{}: {what}", path.display()));
        }
    }
    assert!(wrong.is_empty(), "{} of {count} files:\n{}", wrong.len(), wrong.join("\n"));
}

/// Compares with the sample's columns, whatever the species and the order.
fn check_fixture(path: &Path) -> Result<(), String> {
    let said = |e: particlegs::Error| format!("{e} ({})", e.hint());
    let mut snapshot = support::open(path, None, None).map_err(said)?;
    if snapshot.description().frames.is_some() {
        snapshot = support::open(path, None, Some(0)).map_err(said)?;
    }
    let mut seen = Vec::new();
    for species in 0..snapshot.description().species.len() {
        seen.extend(support::particles(&*snapshot, species, &Fields::default()).map_err(said)?);
    }
    let sample = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../samples/nbody64");
    let column = |name: &str| -> Vec<f64> {
        let bytes = std::fs::read(sample.join(name)).expect("the sample");
        bytes[..200].chunks_exact(4).map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]).into()).collect()
    };
    let (x, y, z) = (column("xx.f32"), column("yy.f32"), column("zz.f32"));
    let mut wanted: Vec<[f64; 3]> = (0..50).map(|i| [x[i], y[i], z[i]]).collect();
    let tolerance = match &*path.file_name().expect("a name").to_string_lossy() {
        // Half floats, twelve bits of fraction, six digits; scaled dumps have nine.
        "v1.spz" => 8e-3,
        name if name.ends_with(".spz") => 1.3e-4,
        name if name.starts_with("ascii.v") => 5e-5,
        _ => 4e-6,
    };
    let order = |a: &[f64], b: &[f64]| a[0].total_cmp(&b[0]).then(a[1].total_cmp(&b[1]));
    if snapshot.description().species.len() > 1 {
        wanted.sort_by(|a, b| order(a, b));
        seen.sort_by(|a, b| order(a, b));
    }
    let near = |s: &[f64; 4], w: &[f64; 3]| (0..3).all(|k| (s[k] - w[k]).abs() <= tolerance);
    if seen.len() != 50 {
        return Err(format!("{} particles", seen.len()));
    }
    match seen.iter().zip(&wanted).find(|(s, w)| !near(s, w)) {
        Some((s, w)) => Err(format!("{s:?} instead of {w:?}")),
        None => Ok(()),
    }
}
