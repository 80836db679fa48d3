//! Models of the alpha-blend law as the published system stores its own: the PLY of 3-D Gaussian
//! splatting with spherical harmonics of degree 0, 17 float32 a Gaussian, three of them always 0
//! (Kerbl et al. 2023, `gaussian_model.py`, `save_ply`; docs/law/published.md, "Evaluation").

use particlegs_core::camera::Normalisation;
use particlegs_core::context::Context;
use particlegs_core::model::{AlphaBlend, LawKind, Mixture, Model};
use particlegs_core::{Error, Hint, Result};
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

/// Writes the Gaussians of an alpha-blend model to `out`, layer by layer and block by block, in the
/// frame that it was trained in, `(x - centre) * scale` of the comments in the file's head, turned by 180 degrees
/// about z: published files have y down, and viewers turn them back. The
/// network is not in it: PLY files hold Gaussians alone, at the default radius and opacity.
///
/// Properties, all float32: place; a normal of zeros; three equal colours `(grey - 0.5) / 0.2821`, or those of
/// `colors`, red, green and blue in 0 to 1 a Gaussian; logit of the opacity; logarithms of the three standard
/// deviations, the largest first; their axes as a quaternion (w, x, y, z). `comments` are further lines of
/// the head. Returns the bytes written.
pub fn write_splats(
    model: &Model,
    colors: Option<&[[f32; 3]]>,
    comments: &[String],
    out: &Path,
    context: &Context<'_>,
) -> Result<u64> {
    if model.metadata.law != LawKind::AlphaBlend {
        let message = format!("a model of the {} law has no opacities to write as splats", model.metadata.law.name());
        return Err(Error::argument_with(message, Hint::from("draw particles from it with ").command("recover", "")));
    }
    if colors.is_some_and(|c| c.len() != model.gaussians()) {
        return Err(Error::argument("give one colour for each Gaussian"));
    }
    let frame = Normalisation::new(&model.metadata.bounds);
    let head = head(model.gaussians(), &frame, comments);
    let bytes = head.len() as u64 + AlphaBlend::PLY_BYTES * model.gaussians() as u64;
    if let Some(folder) = out.parent().filter(|f| !f.as_os_str().is_empty()) {
        check_space_in(folder, bytes)?;
    }
    context.begin("writing splats", model.gaussians() as u64);
    let mut stopped = Ok(());
    let mut colors = colors.map(|c| c.iter());
    let written = write_atomic(out, |w| {
        w.write_all(head.as_bytes())?;
        for block in model.blocks() {
            for start in (0..block.gaussians.len()).step_by(RUN) {
                stopped = context.check();
                if stopped.is_err() {
                    return Err(std::io::ErrorKind::Interrupted.into());
                }
                let end = block.gaussians.len().min(start + RUN);
                for i in start..end {
                    let color = colors.as_mut().and_then(Iterator::next);
                    write_one(w, &block.gaussians, i, color, &frame)?;
                }
                context.advance((end - start) as u64);
            }
        }
        Ok(())
    });
    stopped?;
    written?;
    context.end();
    Ok(bytes)
}

fn head(gaussians: usize, frame: &Normalisation, comments: &[String]) -> String {
    let [x, y, z] = frame.center;
    let properties: String = PROPERTIES.iter().map(|name| format!("property float {name}\n")).collect();
    // A line is a comment's end.
    let comments: String = comments.iter().flat_map(|c| c.lines()).map(|line| format!("comment {line}\n")).collect();
    format!(
        "ply\nformat binary_little_endian 1.0\ncomment particlegs: (world - center) * scale, x and y negated\ncomment center {x} {y} {z}\n\
         comment scale {}\n{comments}element vertex {gaussians}\n{properties}end_header\n",
        frame.scale
    )
}

fn write_one(
    out: &mut dyn Write,
    g: &Mixture,
    i: usize,
    color: Option<&[f32; 3]>,
    frame: &Normalisation,
) -> std::io::Result<()> {
    let (opacity, grey) = g.law.alpha_blend().map_or((0.5, 0.5), |s| (s.opacity[i], s.grey[i]));
    let mean = g.mean_of(i);
    let [x, y, z]: [f64; 3] = std::array::from_fn(|k| (mean[k] - frame.center[k]) * frame.scale);
    let color = color.map_or([grey; 3], |c| c.map(f64::from)).map(|v| (v - 0.5) / HARMONIC);
    let logit = opacity.ln() - (-opacity).ln_1p();
    let (deviations, [w, i, j, k]) = g.cov_of(i).deviations_and_turn();
    let scales = deviations.map(|d| d.ln() + frame.scale.ln());
    // By 180 degrees about z: the quaternion k times it.
    let (place, turn) = ([-x, -y, z], [-k, -j, i, w]);
    let numbers = place.into_iter().chain([0.0; 3]).chain(color).chain([logit]).chain(scales).chain(turn);
    numbers.into_iter().try_for_each(|v| out.write_all(&(v as f32).to_le_bytes()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_core::math::{Random, Sym3};
    use particlegs_core::model::{AlphaBlend, Block, Law, Layer, Mass, Metadata};
    use particlegs_core::space::Bounds;
    use particlegs_particles::Storage;

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
        let metadata = Metadata::new(LawKind::AlphaBlend, n as u64, bounds);
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
        let bytes = write_splats(&m, None, &[], &path, &Context::SILENT).unwrap();
        let file = std::fs::read(&path).unwrap();
        assert_eq!((file.len() as u64, AlphaBlend::PLY_BYTES), (bytes, 68));
        let body = &file[file.len() - 200 * 68..];
        let frame = Normalisation::new(&m.metadata.bounds);
        let g = &m.layers[0].content[0].gaussians;
        let blend = g.law.alpha_blend().unwrap();
        for (i, record) in body.chunks_exact(68).enumerate() {
            let v: Vec<f64> =
                record.chunks_exact(4).map(|b| f64::from(f32::from_le_bytes(b.try_into().unwrap()))).collect();
            for (k, sign) in [-1.0, -1.0, 1.0].into_iter().enumerate() {
                let world = sign * v[k] / frame.scale + frame.center[k];
                assert!((world - g.mean[k][i]).abs() < 1e-5 && v[3 + k] == 0.0);
                assert!((0.5 + HARMONIC * v[6 + k] - blend.grey[i]).abs() < 1e-6);
            }
            assert!((1.0 / (1.0 + (-v[9]).exp()) - blend.opacity[i]).abs() < 1e-6);
            let back = covariance([v[10], v[11], v[12]], [v[13], v[14], v[15], v[16]]);
            let mut want = g.cov_of(i).scale(frame.scale * frame.scale);
            // xz and yz.
            want.0[2] *= -1.0;
            want.0[4] *= -1.0;
            for k in 0..6 {
                assert!((back.0[k] - want.0[k]).abs() < 1e-5 * want.trace(), "{i}: {back:?} {want:?}");
            }
        }
        let read = crate::Choice::default().read(&[path], &Storage::Memory, &Context::SILENT).unwrap();
        assert_eq!(read.len(), 200);
        for i in 0..200 {
            let p = read.position(i);
            let signs = [-1.0, -1.0, 1.0];
            assert!((0..3).all(|k| (signs[k] * p[k] / frame.scale + frame.center[k] - g.mean[k][i]).abs() < 1e-5));
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
    fn colours_and_comments_are_written_and_read_over() {
        let m = model(3);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("m.ply");
        let colors = [[1.0, 0.0, 0.5], [0.25; 3], [0.0, 1.0, 0.0]];
        write_splats(&m, Some(&colors), &["one\nelement vertex 7".into(), "two".into()], &path, &Context::SILENT)
            .unwrap();
        let file = std::fs::read(&path).unwrap();
        let text = String::from_utf8_lossy(&file);
        assert!(text.contains("comment one\ncomment element vertex 7\ncomment two\nelement vertex 3\n"), "{text}");
        let body = &file[file.len() - 3 * 68..];
        for (record, color) in body.chunks_exact(68).zip(&colors) {
            for k in 0..3 {
                let at = 24 + 4 * k;
                let dc = f64::from(f32::from_le_bytes(record[at..at + 4].try_into().unwrap()));
                assert!((0.5 + HARMONIC * dc - f64::from(color[k])).abs() < 1e-6);
            }
        }
        assert_eq!(crate::Choice::default().read(&[path], &Storage::Memory, &Context::SILENT).unwrap().len(), 3);
        let two = write_splats(&m, Some(&colors[..2]), &[], &dir.path().join("n.ply"), &Context::SILENT);
        assert!(matches!(two, Err(Error::Argument { .. })));
    }

    #[test]
    fn other_laws_have_no_splats() {
        let mut m = model(3);
        m.metadata.law = LawKind::OpticalDepth;
        let dir = tempfile::tempdir().unwrap();
        assert!(matches!(
            write_splats(&m, None, &[], &dir.path().join("m.ply"), &Context::SILENT),
            Err(Error::Argument { .. })
        ));
        assert_eq!(std::fs::read_dir(dir.path()).unwrap().count(), 0);
    }
}
