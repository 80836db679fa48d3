//! Tables of Gaussians: NPZ and CSV.

use super::{bytes, decode, export, layers};
use crate::common::particlegs;
use particlegs::model::Mixture;
use particlegs::particles::Particles;

#[test]
fn tables_hold_the_gaussians_to_the_last_digit() {
    let dir = tempfile::tempdir().unwrap();
    let path = layers(dir.path());
    let model = decode(&path);
    let table = dir.path().join("t.csv");
    export(&path, &table, &["-q"]).assert().success();
    let text = String::from_utf8(bytes(&table)).unwrap();
    let rows: Vec<Vec<&str>> = text.lines().filter(|l| !l.starts_with('#')).map(|l| l.split(',').collect()).collect();
    assert_eq!(rows[0][..3], ["x", "y", "z"]);
    assert_eq!(
        rows[0][3..],
        [
            "covariance_xx",
            "covariance_xy",
            "covariance_xz",
            "covariance_yy",
            "covariance_yz",
            "covariance_zz",
            "count",
            "mass",
            "layer"
        ]
    );
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
    let archive = dir.path().join("t.npz");
    export(&path, &archive, &["-q"]).assert().success();
    for (file, more) in [(&table, &[][..]), (&archive, &["--positions", "mean"])] {
        let points = dir.path().join("points");
        let mut convert = particlegs();
        convert.arg("convert").arg(file).arg("-o").arg(&points).args(more).args([
            "-q",
            "--force",
            "--mass-field",
            "none",
        ]);
        convert.assert().success();
        let points = Particles::open_raw(&[points]).unwrap();
        assert_eq!(points.len(), all.len());
        for (i, (_, g, own, _)) in all.iter().enumerate() {
            assert!((0..3).all(|k| (points.position(i)[k] - g.mean[k][*own]).abs() < 1e-5));
        }
    }
}
