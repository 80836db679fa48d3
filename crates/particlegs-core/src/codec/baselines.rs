//! The section `base`: scores of trivial pictures and densities, 76 bytes (docs/format.md, section 3).

use super::certificate::{decibels, from_decibels, from_similarity, similarity};
use super::wire::Reader;
use crate::model::{Baselines, LookBaselines, OrbitBaselines, PictureScore};

/// Bytes of the section.
pub(crate) const BASELINES_BYTES: usize = 3 * 3 * 8 + 4;

/// The section's bytes.
pub(crate) fn write(b: &Baselines) -> Vec<u8> {
    let mut out = Vec::with_capacity(BASELINES_BYTES);
    for orbit in &b.orbits {
        for look in [&orbit.paraview, &orbit.paraview_no_fxaa, &orbit.expected] {
            for score in [&look.all_black, &look.uniform_box] {
                out.extend(decibels(score.masked_psnr).to_le_bytes());
                out.extend(similarity(score.ssim).to_le_bytes());
            }
        }
    }
    out.extend((b.uniform_density_mae as f32).to_le_bytes());
    out
}

/// Reads the section.
pub(crate) fn read(bytes: &[u8]) -> Result<Baselines, String> {
    let mut r = Reader::new(bytes);
    let score = |r: &mut Reader<'_>| {
        Ok::<_, String>(PictureScore { masked_psnr: from_decibels(r.u16()?), ssim: from_similarity(r.u16()?)? })
    };
    let look = |r: &mut Reader<'_>| Ok::<_, String>(LookBaselines { all_black: score(r)?, uniform_box: score(r)? });
    let orbit = |r: &mut Reader<'_>| {
        Ok::<_, String>(OrbitBaselines { paraview: look(r)?, paraview_no_fxaa: look(r)?, expected: look(r)? })
    };
    let orbits = [orbit(&mut r)?, orbit(&mut r)?, orbit(&mut r)?];
    let uniform_density_mae = f64::from(r.f32()?);
    if !(uniform_density_mae >= 0.0 && uniform_density_mae.is_finite()) {
        return Err(format!("a uniform density's error of {uniform_density_mae}"));
    }
    if !r.is_done() {
        return Err(format!("baselines of {} bytes", bytes.len()));
    }
    Ok(Baselines { orbits, uniform_density_mae })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn baselines() -> Baselines {
        let score = |db, ssim| PictureScore { masked_psnr: db, ssim };
        let look = LookBaselines { all_black: score(Some(29.375), 0.9), uniform_box: score(None, -0.25) };
        let orbit = OrbitBaselines { paraview: look, paraview_no_fxaa: look, expected: look };
        Baselines { orbits: [orbit; 3], uniform_density_mae: 1.25 }
    }

    #[test]
    fn comes_back_to_the_step() {
        let bytes = write(&baselines());
        assert_eq!(bytes.len(), BASELINES_BYTES);
        let back = read(&bytes).unwrap();
        let look = back.orbits[2].expected;
        assert_eq!((look.all_black.masked_psnr, look.uniform_box.masked_psnr), (Some(29.375), None));
        assert!((look.all_black.ssim - 0.9).abs() < 2e-5 && (look.uniform_box.ssim + 0.25).abs() < 2e-5);
        assert_eq!(back.uniform_density_mae, 1.25);
        assert_eq!(write(&back), bytes);
    }

    #[test]
    fn contradictions_are_refused() {
        let bytes = write(&baselines());
        assert!(read(&bytes[1..]).is_err() && read(&[&bytes[..], &[0]].concat()).is_err());
        for mae in [-1.0f32, f32::NAN, f32::INFINITY] {
            let mut bytes = bytes.clone();
            bytes[72..].copy_from_slice(&mae.to_le_bytes());
            assert!(read(&bytes).is_err(), "{mae}");
        }
        let mut bytes = bytes;
        bytes[2..4].copy_from_slice(&i16::MIN.to_le_bytes());
        assert!(read(&bytes).is_err());
    }
}
