//! Tables of Gaussians: NPZ and CSV.

use super::layers;
use particlegs_core::model::Mixture;
use particlegs_particles::Particles;

#[test]
fn tables_hold_the_gaussians_to_the_last_digit() {
    let dir = layers();
    let model = dir.model("layers.pgs");
    let text = String::from_utf8(dir.makes("export layers.pgs -o t.csv -q")).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().filter(|l| !l.starts_with('#')).map(|l| l.split(',').collect()).collect();
    assert_eq!(rows[0][..3], ["x", "y", "z"]);
    let terms = ["xx", "xy", "xz", "yy", "yz", "zz"].map(|k| format!("covariance_{k}"));
    assert_eq!(rows[0][3..9], terms);
    assert_eq!(rows[0][9..], ["count", "mass", "layer"]);
    let all: Vec<(&str, &Mixture, usize, f64)> = model
        .layers
        .iter()
        .flat_map(|l| l.content.iter().map(move |b| (l, &b.gaussians)))
        .flat_map(|(l, g)| (0..g.len()).map(move |i| (&l.name[..], g, i, l.mass.unit_or_one())))
        .collect();
    assert_eq!(rows.len() - 1, all.len());
    for (row, (layer, g, i, unit)) in rows[1..].iter().zip(&all) {
        let numbers: Vec<f64> = row[..11].iter().map(|v| v.parse().unwrap()).collect();
        let want = [&g.mean_of(*i)[..], &g.cov_of(*i).0, &[g.count[*i], unit * g.mass_of(*i)]].concat();
        assert_eq!((numbers, row[11]), (want, *layer));
    }
    // This program reads both tables as points.
    dir.runs("export layers.pgs -o t.npz -q");
    for file in ["t.csv", "t.npz --positions mean"] {
        dir.runs(&format!("convert {file} -o points -q --force --mass-field none"));
        let points = Particles::open_raw(&[dir.at("points")]).unwrap();
        assert_eq!(points.len(), all.len());
        for (i, (_, g, number, _)) in all.iter().enumerate() {
            assert!((0..3).all(|k| (points.position(i)[k] - g.mean[k][*number]).abs() < 1e-5));
        }
    }
}
