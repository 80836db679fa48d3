//! Density on a grid: NPY, VTI, FITS, OpenDX and MRC.

use super::{exported, folder};
use crate::common::{TestFolder, snapshot};
use particlegs_core::model::LawKind;

/// Numbers after the header of a NumPy array.
fn npy(bytes: &[u8]) -> Vec<f32> {
    let head = 10 + usize::from(u16::from_le_bytes([bytes[8], bytes[9]]));
    bytes[head..].as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect()
}

#[test]
fn density_keeps_the_mass_of_a_periodic_box_in_every_format() {
    let dir = folder(LawKind::OpticalDepth);
    let report = exported(&dir, "m.pgs -o d.npy --grid 20");
    let [vti, fits] = ["d.vti", "d.fits"].map(|name| dir.makes(&format!("export m.pgs -o {name} --grid 20 -q")));
    let grid = &report["grid"];
    let all = |value: serde_json::Value| serde_json::json!([value, value, value]);
    assert_eq!((&grid["cells"], &grid["periodic"]), (&all(20.into()), &all(true.into())));
    assert_eq!((grid["unit"].as_str(), grid["outside"].as_f64()), (Some("particles / (Mpc/h)^3"), Some(0.0)));
    let values = npy(&dir.bytes("d.npy"));
    let volume = 1.25f64.powi(3);
    let total: f64 = values.iter().map(|v| f64::from(*v) * volume).sum();
    assert!((total / 262_144.0 - 1.0).abs() < 1e-6, "{total}");
    assert!((grid["total"].as_f64().unwrap() / 262_144.0 - 1.0).abs() < 1e-6);
    assert!(values.iter().all(|v| v.is_finite() && *v > -1e-3));
    // The others have x as the fastest.
    let turned: Vec<f32> = (0..8000).map(|i| values[(i % 20 * 20 + i / 20 % 20) * 20 + i / 400]).collect();
    let start = vti.windows(4).position(|w| w == b"raw\"").unwrap() + 6 + 8;
    let raw: Vec<u8> = turned.iter().flat_map(|v| v.to_le_bytes()).collect();
    assert!(vti[start..start + 32_000] == raw[..]);
    assert!(fits.len().is_multiple_of(2880));
    // Its units have no h: particles / Mpc^3.
    let physical = |v: f32| f64::from(v) * 0.68f64.powi(3);
    let number = |bytes: &[u8; 4]| f64::from(f32::from_be_bytes(*bytes));
    let is_same = |(bytes, v): (&[u8; 4], &f32)| (number(bytes) - physical(*v)).abs() <= 1e-6 * physical(*v).abs();
    assert!(fits.windows(32_000).step_by(2880).any(|w| w.as_chunks::<4>().0.iter().zip(&turned).all(is_same)));
    let description = dir.json("d.json");
    assert_eq!(description["density"]["cells"], grid["cells"]);
    assert_eq!(description["quantity"], "density");
    // Cells of a given length are adjusted to fill the box.
    let of_side = exported(&dir, "m.pgs -o e.vti --cell 1.2");
    assert_eq!(of_side["grid"]["cells"], serde_json::json!([21, 21, 21]));
    assert!((of_side["grid"]["cell"][0].as_f64().unwrap() - 25.0 / 21.0).abs() < 1e-12);
}

/// Without a box, the mass outside the bounds is reported.
#[test]
fn an_open_density_reports_what_it_leaves_out() {
    let dir = TestFolder::new();
    let columns: Vec<Vec<f32>> =
        (0..3u32).map(|k| (0..500).map(|i| (i * (37 + 14 * k) % 101) as f32 * 0.1).collect()).collect();
    snapshot(&dir.at("snap"), &columns);
    dir.runs("compress snap -o m.pgs --gaussians 8 --certificate none -q");
    let report = exported(&dir, "m.pgs -o d.fits --grid 16");
    let [total, outside] = ["total", "outside"].map(|k| report["grid"][k].as_f64().unwrap());
    assert!((total + outside - 500.0).abs() < 1e-3 && outside > 1.0, "{total} {outside}");
    assert_eq!(report["grid"]["unit"], "particles / length^3");
}

/// An array and its description are replaced or written only together.
#[test]
fn an_array_and_its_description_stay_together() {
    let dir = folder(LawKind::OpticalDepth);
    let both = || [dir.bytes("d.npy"), dir.bytes("d.json")];
    dir.write("d.json", "{\"mine\": 1}");
    for force in ["", "--force"] {
        let refused = "is not the description of a density";
        dir.fails(&format!("export m.pgs -o d.npy --grid 8 {force}"), 8, refused);
        assert!(!dir.at("d.npy").exists());
    }
    std::fs::remove_file(dir.at("d.json")).unwrap();
    let words = "export m.pgs -o d.npy --grid 8 -q";
    dir.runs(words);
    let first = both();
    dir.runs(words);
    dir.fails("export m.pgs -o d.npy --grid 9", 8, "exists already");
    std::fs::remove_file(dir.at("d.npy")).unwrap();
    dir.fails("export m.pgs -o d.npy --grid 9", 8, "exists already");
    assert!(!dir.at("d.npy").exists() && dir.bytes("d.json") == first[1]);
    dir.runs(&format!("{words} --force"));
    assert_eq!(both(), first);
    // Standard output gets only the array.
    let printed = dir.command("export m.pgs -o - --kind npy --grid 8 -q").assert().success();
    assert_eq!(printed.get_output().stdout, first[0]);
}

/// Viewers of molecules know lengths in Angstrom alone: those in nm are converted, others stay and are said to be lost.
#[test]
fn maps_for_viewers_of_molecules_are_in_angstrom() {
    let dir = folder(LawKind::OpticalDepth);
    dir.runs("compress FIXTURES/mdanalysis.xtc -o nm.pgs --gaussians 4 --certificate none -q");
    for (model, scale) in [("nm", 10.0), ("m", 1.0)] {
        let grid = exported(&dir, &format!("{model}.pgs -o {model}.npy --grid 6"))["grid"].clone();
        let number = |key: &str, k: usize| grid[key][k].as_f64().unwrap();
        let middle = |k: usize| scale * (number("origin", k) + 0.5 * number("cell", k));
        let values: Vec<f32> = npy(&dir.bytes(&format!("{model}.npy")))
            .iter()
            .map(|v| (f64::from(*v) * f64::powi(scale, -3)) as f32)
            .collect();
        for kind in ["dx", "mrc"] {
            let lost = exported(&dir, &format!("{model}.pgs -o {model}.{kind} --grid 6"))["lost"].to_string();
            assert_eq!(lost.contains("viewers take them for Angstrom"), model == "m", "{lost}");
        }
        let dx = String::from_utf8(dir.bytes(&format!("{model}.dx"))).unwrap();
        let units = if model == "nm" {
            "lengths in Angstrom, density in particles / Angstrom^3"
        } else {
            "lengths as they are"
        };
        assert!(dx.starts_with(&format!("# this file: {units}")), "{dx}");
        let words = |start: &str| -> Vec<f64> {
            let line = dx.lines().find(|l| l.starts_with(start)).unwrap();
            line[start.len()..].split(' ').map(|w| w.parse().unwrap()).collect()
        };
        let near = |a: f64, b: f64| (a - b).abs() < 1e-5 * b.abs().max(1.0);
        let cells: Vec<usize> = (0..3).map(|k| grid["cells"][k].as_u64().unwrap() as usize).collect();
        assert!((0..3).all(|k| near(words("origin ")[k], middle(k))
            && words("object 1 class gridpositions counts ")[k] as usize == cells[k]));
        assert!(near(words("delta ")[0], scale * number("cell", 0)));
        let rows =
            dx.lines().skip_while(|l| !l.ends_with("data follows")).skip(1).take_while(|l| !l.starts_with("attribute"));
        let dx_values: Vec<f32> = rows.flat_map(|l| l.split(' ')).map(|w| w.parse().unwrap()).collect();
        assert!(dx_values == values);
        let mrc = dir.bytes(&format!("{model}.mrc"));
        let word = |k: usize| <[u8; 4]>::try_from(&mrc[4 * k - 4..4 * k]).unwrap();
        let float = |k: usize| f64::from(f32::from_le_bytes(word(k)));
        assert_eq!((&word(53), u32::from_le_bytes(word(4)), mrc.len()), (b"MAP ", 2, 1024 + 4 * values.len()));
        assert!((0..3).all(
            |k| near(float(50 + k), middle(k)) && near(float(11 + k), scale * number("cell", k) * cells[k] as f64)
        ));
        let at = |x: usize, y: usize, z: usize| {
            f32::from_le_bytes(*mrc[1024..].as_chunks::<4>().0.get((z * cells[1] + y) * cells[0] + x).unwrap())
        };
        let same = |i: usize| values[i] == at(i / cells[2] / cells[1], i / cells[2] % cells[1], i % cells[2]);
        assert!((0..values.len()).all(same));
    }
}
