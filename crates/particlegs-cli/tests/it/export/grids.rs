//! Density on a grid: NPY, VTI and FITS.

use super::{bytes, export, exported, write};
use crate::common::{fails, particlegs, snapshot};
use particlegs::model::LawKind;
use serde_json::Value;
use std::path::Path;

/// Numbers behind the head of a NumPy array.
fn npy(bytes: &[u8]) -> Vec<f32> {
    let head = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[head..].as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

#[test]
fn density_keeps_the_mass_of_a_periodic_box_in_every_format() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), LawKind::OpticalDepth);
    let out = |name: &str| dir.path().join(name);
    let report = exported(&path, &out("d.npy"), &["--grid", "20"]);
    for name in ["d.vti", "d.fits"] {
        export(&path, &out(name), &["--grid", "20", "-q"]).assert().success();
    }
    let grid = &report["grid"];
    assert_eq!(
        (&grid["cells"], &grid["periodic"]),
        (&serde_json::json!([20, 20, 20]), &serde_json::json!([true, true, true]))
    );
    assert_eq!((grid["unit"].as_str(), grid["outside"].as_f64()), (Some("particles / (Mpc/h)^3"), Some(0.0)));
    let values = npy(&bytes(&out("d.npy")));
    let volume = 1.25f64.powi(3);
    let total: f64 = values.iter().map(|v| f64::from(*v) * volume).sum();
    assert!((total / 262_144.0 - 1.0).abs() < 1e-6, "{total}");
    assert!((grid["total"].as_f64().unwrap() / 262_144.0 - 1.0).abs() < 1e-6);
    assert!(values.iter().all(|v| v.is_finite() && *v > -1e-3));
    // The others have x as the fastest.
    let turned: Vec<f32> = (0..8000).map(|i| values[(i % 20 * 20 + i / 20 % 20) * 20 + i / 400]).collect();
    let vti = bytes(&out("d.vti"));
    let start = vti.windows(4).position(|w| w == b"raw\"").unwrap() + 6 + 8;
    let raw: Vec<u8> = turned.iter().flat_map(|v| v.to_le_bytes()).collect();
    assert!(vti[start..start + 32_000] == raw[..]);
    let fits = bytes(&out("d.fits"));
    assert!(fits.len().is_multiple_of(2880));
    // Its units have no h: particles / Mpc^3.
    let physical = |v: f32| f64::from(v) * 0.68f64.powi(3);
    let number = |bytes: &[u8; 4]| f64::from(f32::from_be_bytes(*bytes));
    let is_same = |(found, v): (&[u8; 4], &f32)| (number(found) - physical(*v)).abs() <= 1e-6 * physical(*v).abs();
    assert!(fits.windows(32_000).step_by(2880).any(|w| w.as_chunks::<4>().0.iter().zip(&turned).all(is_same)));
    let described: Value = serde_json::from_slice(&bytes(&out("d.json"))).unwrap();
    assert_eq!(described["density"]["cells"], grid["cells"]);
    assert_eq!(described["quantity"], "density");
    // Cells of a length: as many as fill the box.
    let of_side = exported(&path, &out("e.vti"), &["--cell", "1.2"]);
    assert_eq!(of_side["grid"]["cells"], serde_json::json!([21, 21, 21]));
    assert!((of_side["grid"]["cell"][0].as_f64().unwrap() - 25.0 / 21.0).abs() < 1e-12);
}

/// Without a box, what lies beyond the bounds is told.
#[test]
fn an_open_density_says_what_it_leaves_out() {
    let dir = tempfile::tempdir().unwrap();
    let columns: Vec<Vec<f32>> =
        (0..3u32).map(|k| (0..500).map(|i| (i * (37 + 14 * k) % 101) as f32 * 0.1).collect()).collect();
    let snap = dir.path().join("snap");
    snapshot(&snap, &columns);
    let path = dir.path().join("m.pgs");
    let mut c = particlegs();
    c.arg("compress").arg(&snap).arg("-o").arg(&path).args(["--gaussians", "8", "--certificate", "none", "-q"]);
    c.assert().success();
    let report = exported(&path, &dir.path().join("d.fits"), &["--grid", "16"]);
    let [total, outside] = ["total", "outside"].map(|k| report["grid"][k].as_f64().unwrap());
    assert!((total + outside - 500.0).abs() < 1e-3 && outside > 1.0, "{total} {outside}");
    assert_eq!(report["grid"]["unit"], "particles / length^3");
}

/// An array and its description are one: neither is replaced, or written, without the other.
#[test]
fn an_array_and_its_description_stay_together() {
    let dir = tempfile::tempdir().unwrap();
    let path = write(dir.path(), LawKind::OpticalDepth);
    let [array, description] = ["d.npy", "d.json"].map(|n| dir.path().join(n));
    std::fs::write(&description, "{\"mine\": 1}").unwrap();
    for force in [&[][..], &["--force"]] {
        fails(export(&path, &array, &["--grid", "8"]).args(force), 8, "is not the description of a density");
        assert!(!array.exists());
    }
    std::fs::remove_file(&description).unwrap();
    export(&path, &array, &["--grid", "8", "-q"]).assert().success();
    let first = [bytes(&array), bytes(&description)];
    export(&path, &array, &["--grid", "8", "-q"]).assert().success();
    fails(&mut export(&path, &array, &["--grid", "9"]), 8, "exists already");
    std::fs::remove_file(&array).unwrap();
    fails(&mut export(&path, &array, &["--grid", "9"]), 8, "exists already");
    assert!(!array.exists() && bytes(&description) == first[1]);
    export(&path, &array, &["--grid", "8", "-q", "--force"]).assert().success();
    assert_eq!([bytes(&array), bytes(&description)], first);
    // Standard output takes the array alone.
    let printed = export(&path, Path::new("-"), &["--kind", "npy", "--grid", "8", "-q"]).assert().success();
    assert_eq!(printed.get_output().stdout, first[0]);
}
