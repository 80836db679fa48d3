//! The certificate section: 94 bytes (docs/format.md, section 3); its statistics and baselines have
//! sections of their own (`science`, `baselines`).

use super::wire::Reader;
use crate::model::{Certificate, LookScore, Measures, OrbitScore};

/// Bytes of a certificate.
pub(crate) const CERTIFICATE_BYTES: usize = 2 + 2 + 8 + 2 + 4 + 4 + 9 * 8;
/// Steps of a decibel.
const PER_DECIBEL: f64 = 200.0;
/// Steps of SSIM.
const PER_SSIM: f64 = 32_767.0;
/// Stands for `None`.
const NONE: u16 = u16::MAX;

/// The section's bytes.
pub(crate) fn write(c: &Certificate) -> Vec<u8> {
    let mut out = Vec::with_capacity(CERTIFICATE_BYTES);
    out.extend(c.width.to_le_bytes());
    out.extend(c.height.to_le_bytes());
    out.extend(c.seed.to_le_bytes());
    out.extend(c.grid.to_le_bytes());
    out.extend((c.density_correlation as f32).to_le_bytes());
    out.extend((c.density_mae as f32).to_le_bytes());
    for orbit in &c.orbits {
        for look in [&orbit.paraview, &orbit.paraview_no_fxaa, &orbit.expected] {
            out.extend(decibels(look.masked_psnr).to_le_bytes());
            out.extend(similarity(look.ssim).to_le_bytes());
            out.extend(decibels(look.noise_free_masked_psnr).to_le_bytes());
            out.extend(similarity(look.noise_free_ssim).to_le_bytes());
        }
    }
    out
}

/// Reads the section.
pub(crate) fn read(bytes: &[u8]) -> Result<Certificate, String> {
    let mut r = Reader::new(bytes);
    let (width, height, seed, grid) = (r.u16()?, r.u16()?, r.u64()?, r.u16()?);
    let (density_correlation, density_mae) = (f64::from(r.f32()?), f64::from(r.f32()?));
    let mut orbits = Vec::with_capacity(3);
    for _ in 0..3 {
        let looks = [look(&mut r)?, look(&mut r)?, look(&mut r)?];
        orbits.push(OrbitScore { paraview: looks[0], paraview_no_fxaa: looks[1], expected: looks[2] });
    }
    if !r.is_done() {
        return Err(format!("a certificate of {} bytes", bytes.len()));
    }
    let orbits = [orbits[0], orbits[1], orbits[2]];
    Ok(Certificate {
        width,
        height,
        seed,
        orbits,
        grid,
        density_correlation,
        density_mae,
        science: None,
        baselines: None,
        measures: Measures::default(),
    })
}

fn look(r: &mut Reader<'_>) -> Result<LookScore, String> {
    Ok(LookScore {
        masked_psnr: from_decibels(r.u16()?),
        ssim: from_similarity(r.u16()?)?,
        noise_free_masked_psnr: from_decibels(r.u16()?),
        noise_free_ssim: from_similarity(r.u16()?)?,
    })
}

pub(super) fn decibels(v: Option<f64>) -> u16 {
    // The largest that is not NONE stands for itself and all above.
    v.map_or(NONE, |v| (v * PER_DECIBEL).round().clamp(0.0, f64::from(NONE - 1)) as u16)
}

pub(super) fn from_decibels(v: u16) -> Option<f64> {
    (v != NONE).then(|| f64::from(v) / PER_DECIBEL)
}

pub(super) fn similarity(v: f64) -> i16 {
    (v * PER_SSIM).round().clamp(-PER_SSIM, PER_SSIM) as i16
}

pub(super) fn from_similarity(v: u16) -> Result<f64, String> {
    match v as i16 {
        i16::MIN => Err("an SSIM below -1".into()),
        v => Ok(f64::from(v) / PER_SSIM),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn comes_back_to_the_step() {
        let look = LookScore {
            masked_psnr: Some(31.234_56),
            ssim: 0.752_1,
            noise_free_masked_psnr: None,
            noise_free_ssim: -0.1,
        };
        let orbit = OrbitScore { paraview: look, paraview_no_fxaa: look, expected: look };
        let c = Certificate {
            width: 1920,
            height: 1080,
            seed: 7,
            orbits: [orbit; 3],
            grid: 64,
            density_correlation: 0.999,
            density_mae: 0.2,
            science: None,
            baselines: None,
            measures: Measures::default(),
        };
        let bytes = write(&c);
        assert_eq!(bytes.len(), CERTIFICATE_BYTES);
        let back = read(&bytes).unwrap();
        assert_eq!((back.width, back.height, back.seed, back.grid), (1920, 1080, 7, 64));
        let l = back.orbits[2].expected;
        assert!((l.masked_psnr.unwrap() - 31.234_56).abs() <= 0.0025 && l.noise_free_masked_psnr.is_none());
        assert!((l.ssim - 0.752_1).abs() < 2e-5 && (l.noise_free_ssim + 0.1).abs() < 2e-5);
        assert!((back.density_correlation - 0.999).abs() < 1e-7);
        // What was read writes the same bytes.
        assert_eq!(write(&back), bytes);
        assert!(read(&bytes[1..]).is_err());
    }
}
