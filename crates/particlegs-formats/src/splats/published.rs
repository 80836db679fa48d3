//! Models of the alpha-blend law as the published system stores its own: the PLY of 3-D Gaussian
//! splatting with spherical harmonics of degree 0, 17 float32 a Gaussian, three of them always 0
//! (Kerbl et al. 2023, `gaussian_model.py`, `save_ply`; docs/law/published.md, "Evaluation").

use particlegs::camera::Normalisation;
use particlegs::math::Sym3;
use particlegs::model::{AlphaBlend, LawKind, Mixture, Model};
use particlegs::progress::Progress;
use particlegs::{Error, Remedy, Result};
use particlegs_files::output::{check_space_in, write_atomic};
use std::io::Write;
use std::path::Path;

const _: () = assert!(AlphaBlend::PLY_BYTES == 4 * PROPERTIES.len() as u64);

const PROPERTIES: [&str; 17] = [
    "x", "y", "z", "nx", "ny", "nz", "f_dc_0", "f_dc_1", "f_dc_2", "opacity", "scale_0", "scale_1", "scale_2", "rot_0",
    "rot_1", "rot_2", "rot_3",
];
/// The constant spherical harmonic, 1 / (2 sqrt(pi)): colours are 0.5 + this times f_dc.
const HARMONIC: f64 = 0.282_094_791_773_878_14;
/// Gaussians between two looks at whether to stop.
const RUN: usize = 1 << 14;
/// Variances below this share of a Gaussian's largest are written as that: f32 holds no log of 0.
const FLATTEST: f64 = 1e-12;

/// Writes the Gaussians of an alpha-blend model to `out`, layer by layer and block by block, in the
/// frame that it was trained in: `(x - centre) * scale` of the comments in the file's head. The
/// network is not in it: PLY files hold Gaussians alone, at the default radius and opacity.
///
/// Properties, all float32: place; a normal of zeros; three equal colours `(grey - 0.5) / 0.2821`;
/// logit of the opacity; logarithms of the three standard deviations, the largest first; their axes
/// as a quaternion (w, x, y, z). Returns the bytes written.
///
/// # Errors
/// [`Error::Argument`] for a model of another law, whose Gaussians have no opacity; [`Error::Io`];
/// [`Error::Cancelled`].
pub fn write_splats(model: &Model, out: &Path, progress: &dyn Progress) -> Result<u64> {
    if model.metadata.law != LawKind::AlphaBlend {
        let what = format!("a model of the {} law has no opacities to write as splats", model.metadata.law.name());
        return Err(Error::Argument { what, remedy: Remedy::DrawParticles });
    }
    let frame = Normalisation::of(&model.metadata.bounds);
    let head = head(model.gaussians(), &frame);
    let bytes = head.len() as u64 + AlphaBlend::PLY_BYTES * model.gaussians() as u64;
    if let Some(folder) = out.parent().filter(|f| !f.as_os_str().is_empty()) {
        check_space_in(folder, bytes)?;
    }
    progress.begin("writing splats", model.gaussians() as u64);
    let mut stopped = Ok(());
    let written = write_atomic(out, |w| {
        w.write_all(head.as_bytes())?;
        for block in model.blocks() {
            for start in (0..block.gaussians.len()).step_by(RUN) {
                stopped = progress.check();
                if stopped.is_err() {
                    return Err(std::io::ErrorKind::Interrupted.into());
                }
                let end = block.gaussians.len().min(start + RUN);
                (start..end).try_for_each(|i| write_one(w, &block.gaussians, i, &frame))?;
                progress.advance((end - start) as u64);
            }
        }
        Ok(())
    });
    stopped?;
    written?;
    progress.end();
    Ok(bytes)
}

fn head(gaussians: usize, frame: &Normalisation) -> String {
    let [x, y, z] = frame.center;
    let properties: String = PROPERTIES.iter().map(|name| format!("property float {name}\n")).collect();
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment particlegs: (world - center) * scale\ncomment center {x} {y} {z}\n\
         comment scale {}\nelement vertex {gaussians}\n{properties}end_header\n",
        frame.scale
    )
}

fn write_one(w: &mut dyn Write, g: &Mixture, i: usize, frame: &Normalisation) -> std::io::Result<()> {
    let (opacity, grey) = g.law.alpha_blend().map_or((0.5, 0.5), |s| (s.opacity[i], s.grey[i]));
    let mean = g.mean_of(i);
    let place: [f64; 3] = std::array::from_fn(|k| (mean[k] - frame.center[k]) * frame.scale);
    let color = (grey - 0.5) / HARMONIC;
    let logit = opacity.ln() - (-opacity).ln_1p();
    let (scales, rotation) = axes(&g.cov_of(i), frame.scale);
    let numbers = place.into_iter().chain([0.0; 3]).chain([color; 3]).chain([logit]).chain(scales).chain(rotation);
    numbers.into_iter().try_for_each(|v| w.write_all(&(v as f32).to_le_bytes()))
}

/// Logarithms of the deviations in units of 1 / `scale`, and the axes as a quaternion w, x, y, z.
fn axes(cov: &Sym3, scale: f64) -> ([f64; 3], [f64; 4]) {
    // Scaled first: squares of very small or large lengths keep their digits.
    let size = cov.trace().max(f64::MIN_POSITIVE);
    let e = cov.scale(1.0 / size).eigen();
    let least = e.values[0].max(f64::MIN_POSITIVE) * FLATTEST;
    let scales = e.values.map(|v| 0.5 * (v.max(least).ln() + size.ln()) + scale.ln());
    let [a, b, mut c] = e.vectors;
    let cross = [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]];
    // Axes have no sign: a turn has to be right-handed.
    if (0..3).map(|k| cross[k] * c[k]).sum::<f64>() < 0.0 {
        c = c.map(|v| -v);
    }
    (scales, quaternion([a, b, c]))
}

/// The turn whose columns are the axes, by the largest of the four components (Shepperd 1978).
fn quaternion([a, b, c]: [[f64; 3]; 3]) -> [f64; 4] {
    let trace = a[0] + b[1] + c[2];
    let squares = [trace, 2.0 * a[0] - trace, 2.0 * b[1] - trace, 2.0 * c[2] - trace];
    let largest = (0..4).fold(0, |l, k| if squares[k] > squares[l] { k } else { l });
    let twice = (1.0 + squares[largest]).max(0.0).sqrt();
    let over = |v: f64| v / (2.0 * twice.max(f64::MIN_POSITIVE));
    let (x, y, z) = (b[2] - c[1], c[0] - a[2], a[1] - b[0]);
    let (xy, xz, yz) = (a[1] + b[0], a[2] + c[0], b[2] + c[1]);
    let half = 0.5 * twice;
    match largest {
        0 => [half, over(x), over(y), over(z)],
        1 => [over(x), half, over(xy), over(xz)],
        2 => [over(y), over(xy), half, over(yz)],
        _ => [over(z), over(xz), over(yz), half],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs::math::Random;
    use particlegs::model::{AlphaBlend, Block, Law, Layer, Mass, Metadata};
    use particlegs::particles::Storage;
    use particlegs::progress::Silent;
    use particlegs::space::Bounds;

    fn model(n: usize) -> Model {
        let mut g = Mixture::default();
        let mut law = AlphaBlend::default();
        for i in 0..n {
            let mut r = Random::new(3, 1, i as u64);
            let v: [[f64; 3]; 3] = std::array::from_fn(|_| std::array::from_fn(|_| 0.1 * r.normal()));
            let cov = Sym3::outer(v[0]).add(&Sym3::outer(v[1])).add(&Sym3::outer(v[2]));
            g.push(std::array::from_fn(|_| 10.0 * r.uniform()), cov, 1.0, 1.0);
            law.opacity.push(0.01 + 0.98 * r.uniform());
            law.grey.push(2.0 * r.uniform());
        }
        g.law = Law::AlphaBlend(law);
        let bounds = Bounds { min: [0.0; 3], max: [10.0, 10.0, 8.0] };
        let metadata = Metadata {
            law: LawKind::AlphaBlend,
            count: n as u64,
            mass: n as f64,
            bounds,
            cell: None,
            default_radius: 0.1,
            default_opacity: 0.05,
            source: "test".into(),
            source_hash: [1; 32],
            length_unit: None,
            mass_unit: None,
            comoving: None,
            scale_factor: None,
            hubble: None,
            time: None,
            command: "test".into(),
            tool_version: "0".into(),
            effort: None,
        };
        let block = Block { bounds, count: n as u64, mass: n as f64, gaussians: g };
        let layers = vec![Layer { name: "particles".into(), mass: Mass::Unknown, content: vec![block] }];
        Model { metadata, layers, certificate: None }
    }

    /// Written as published, everything comes back by the published formulas; our reader of PLY finds
    /// the places.
    #[test]
    fn what_is_written_is_what_splat_viewers_read() {
        let m = model(200);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.ply");
        let bytes = write_splats(&m, &path, &Silent).unwrap();
        let file = std::fs::read(&path).unwrap();
        assert_eq!((file.len() as u64, AlphaBlend::PLY_BYTES), (bytes, 68));
        let body = &file[file.len() - 200 * 68..];
        let frame = Normalisation::of(&m.metadata.bounds);
        let g = &m.layers[0].content[0].gaussians;
        let own = g.law.alpha_blend().unwrap();
        for (i, record) in body.chunks_exact(68).enumerate() {
            let v: Vec<f64> =
                record.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap()))).collect();
            for k in 0..3 {
                let world = v[k] / frame.scale + frame.center[k];
                assert!((world - g.mean[k][i]).abs() < 1e-5 && v[3 + k] == 0.0);
                assert!((0.5 + HARMONIC * v[6 + k] - own.grey[i]).abs() < 1e-6);
            }
            assert!((1.0 / (1.0 + (-v[9]).exp()) - own.opacity[i]).abs() < 1e-6);
            let back = covariance([v[10], v[11], v[12]], [v[13], v[14], v[15], v[16]]);
            let want = g.cov_of(i).scale(frame.scale * frame.scale);
            for k in 0..6 {
                assert!((back.0[k] - want.0[k]).abs() < 1e-5 * want.trace(), "{i}: {back:?} {want:?}");
            }
        }
        let read = crate::Choice::default().read(&[path], &Storage::Memory, &Silent).unwrap();
        assert_eq!(read.len(), 200);
        for i in 0..200 {
            let p = read.position(i);
            assert!((0..3).all(|k| (p[k] / frame.scale + frame.center[k] - g.mean[k][i]).abs() < 1e-5));
        }
    }

    /// R S S R^T of a quaternion that is not normalised, as `build_rotation` has it.
    fn covariance(scales: [f64; 3], q: [f64; 4]) -> Sym3 {
        let n = q.iter().map(|v| v * v).sum::<f64>().sqrt();
        let [w, x, y, z] = q.map(|v| v / n);
        let rows = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - w * z), 2.0 * (x * z + w * y)],
            [2.0 * (x * y + w * z), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - w * x)],
            [2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)],
        ];
        (0..3).fold(Sym3::default(), |sum, k| {
            sum.add(&Sym3::outer([rows[0][k], rows[1][k], rows[2][k]]).scale((2.0 * scales[k]).exp()))
        })
    }

    #[test]
    fn turns_of_every_kind_are_right() {
        for cov in [[3.0, 2.0, 1.0], [1.0, 2.0, 3.0], [1.0, 3.0, 2.0], [2.0, 3.0, 1.0], [2.0, 1.0, 3.0], [1.0; 3]] {
            let cov = Sym3([cov[0], 0.0, 0.0, cov[1], 0.0, cov[2]]);
            let (scales, q) = axes(&cov, 1.0);
            let back = covariance(scales, q);
            assert!((0..6).all(|k| (back.0[k] - cov.0[k]).abs() < 1e-12), "{cov:?} {back:?}");
        }
        let (scales, q) = axes(&Sym3::default(), 2.0);
        assert!(scales.iter().chain(&q).all(|v| v.is_finite()));
    }

    #[test]
    fn other_laws_have_no_splats() {
        let mut m = model(3);
        m.metadata.law = LawKind::OpticalDepth;
        let dir = tempfile::tempdir().unwrap();
        assert!(matches!(write_splats(&m, &dir.path().join("m.ply"), &Silent), Err(Error::Argument { .. })));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
