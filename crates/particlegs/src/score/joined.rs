//! A certificate of sums over parts: what was never in one process.

use super::certify;
use super::density::{DensityAgreement, density_agreement};
use super::science::told;
use super::sums::{Frame, Section, add_rows};
use crate::model::{
    Baselines, CELL_SIZES, CellDensity, Certificate, LookBaselines, LookScore, Measures, OrbitBaselines, OrbitScore,
    PictureScore, Science, ScienceOf,
};
use crate::picture::{Gray8, Plane, Scores};
use crate::progress::Progress;
use crate::reference::uniform_box;
use crate::render::tone;
use crate::score::cells::agreements;
use crate::space::Bounds;
use crate::splat::Look;
use crate::stats::{Field, Grid, spectra_of};
use crate::{Error, Result};
use particlegs_core::math::each_axis;

/// Gives a section of a part, as [`Frame::measure`] made it.
pub(crate) type Read<'a> = &'a dyn Fn(u32, Section) -> Result<Vec<u8>>;

/// Adds up the sums of `parts` parts, in their order.
pub(crate) struct Joined<'a> {
    /// What they were measured by.
    pub frame: &'a Frame,
    /// Seed of the views.
    pub seed: u64,
    /// Their number.
    pub parts: u32,
    /// Where they are.
    pub read: Read<'a>,
}

impl Joined<'_> {
    /// The certificate.
    ///
    /// # Errors
    /// Those of reading; [`Error::Corrupt`] for sums that are none; [`Error::Memory`], [`Error::Cancelled`].
    pub fn certificate(&self, progress: &dyn Progress) -> Result<Certificate> {
        progress.begin("adding up the blocks' sums", 0);
        let (mut orbits, mut baselines) = (Vec::new(), Vec::new());
        for view in 0..3 {
            let (orbit, trivial) = self.view(view, progress)?;
            orbits.push(orbit);
            baselines.push(trivial);
        }
        let [density, uniform] = self.density(progress)?;
        let baselines = Baselines {
            orbits: [baselines[0], baselines[1], baselines[2]],
            uniform_density_mae: uniform.mean_absolute_error,
        };
        let measures = Measures { densities: self.cells(progress)?, blocks: Some(self.parts), ..Measures::default() };
        let science = self.science(progress)?;
        progress.end();
        Ok(Certificate {
            width: certify::SIZE.width as u16,
            height: certify::SIZE.height as u16,
            seed: self.seed,
            orbits: [orbits[0], orbits[1], orbits[2]],
            grid: certify::GRID,
            density_correlation: density.correlation,
            density_mae: density.mean_absolute_error,
            science,
            baselines: Some(baselines),
            measures,
        })
    }

    fn sum(&self, section: Section, progress: &dyn Progress) -> Result<Vec<f32>> {
        let [length, width] = self.frame.shape(section);
        particlegs_files::memory::require("the blocks' sums", 4 * length as u64)?;
        let mut sum = vec![0.0f32; length];
        for part in 0..self.parts {
            progress.check()?;
            let bytes = (self.read)(part, section)?;
            add_rows(&mut sum, width, &bytes).ok_or_else(|| self.none(part))?;
        }
        Ok(sum)
    }

    fn none(&self, part: u32) -> Error {
        Error::corrupt(format!("the sums of block {part}"), "they are not of this plan's grids")
    }

    /// The noise-free pictures alone: ParaView's own, in which splats hide each other, do not add up.
    fn view(&self, view: usize, progress: &dyn Progress) -> Result<(OrbitScore, OrbitBaselines)> {
        let (size, domain) = (certify::SIZE, &self.frame.domain);
        let max = each_axis(|k| domain.min[k] + domain.length[k]);
        let (even, view_of) = (Bounds { min: domain.min, max }, &self.frame.views[view]);
        let picture = |tau: &Plane| tone(tau, Look::Expected, view_of.opacity, view_of.radius_pixels(size));
        let side =
            |side| Ok::<_, Error>(picture(&Plane { size, data: self.sum(Section::View(side, view), progress)? }));
        let (truth, model) = (side(0)?, side(1)?);
        let even = picture(&uniform_box(&even, self.frame.metadata.count as f64, view_of, size)?);
        let score = |p: &Gray8| {
            let s = Scores::of(p, &truth);
            PictureScore { masked_psnr: s.masked_psnr, ssim: s.ssim.unwrap_or(0.0) }
        };
        let [own, black, even] = [score(&model), score(&Gray8::black(size)), score(&even)];
        let expected = LookScore {
            masked_psnr: own.masked_psnr,
            ssim: own.ssim,
            noise_free_masked_psnr: None,
            noise_free_ssim: 1.0,
        };
        let (none, nothing) = (LookScore::NOT_MEASURED, PictureScore::NOT_MEASURED);
        let nothing = LookBaselines { all_black: nothing, uniform_box: nothing };
        let trivial = LookBaselines { all_black: black, uniform_box: even };
        Ok((
            OrbitScore { paraview: none, paraview_no_fxaa: none, expected },
            OrbitBaselines { paraview: nothing, paraview_no_fxaa: nothing, expected: trivial },
        ))
    }

    fn density(&self, progress: &dyn Progress) -> Result<[DensityAgreement; 2]> {
        let side = |side| {
            let sum = self.sum(Section::Density(side), progress)?;
            Ok::<_, Error>(sum.into_iter().map(f64::from).collect::<Vec<f64>>())
        };
        let (truth, model) = (side(0)?, side(1)?);
        let uniform = vec![truth.iter().sum::<f64>() / truth.len().max(1) as f64; truth.len()];
        Ok([&model, &uniform].map(|other| density_agreement(&truth, other)))
    }

    fn field(&self, section: Section, grid: &Grid, progress: &dyn Progress) -> Result<Field> {
        Ok(Field { grid: *grid, mass: self.sum(section, progress)?, outside: 0.0 })
    }

    fn cells(&self, progress: &dyn Progress) -> Result<Option<[CellDensity; CELL_SIZES]>> {
        let Some(grid) = &self.frame.cells else { return Ok(None) };
        let side = |side| self.field(Section::Cells(side), grid, progress);
        Ok(agreements([side(0)?, side(1)?], self.frame.metadata.count as usize))
    }

    fn science(&self, progress: &dyn Progress) -> Result<Option<Science>> {
        let (o, domain, grid) = (&self.frame.spectrum, &self.frame.domain, self.frame.spectrum_grid());
        let held = |k: f64| (k as f32).is_normal();
        if !held(2.0 * std::f64::consts::PI / domain.longest()) || !held(o.k_max) {
            return Ok(None);
        }
        let (mut mass, mut squares) = (0.0, 0.0);
        for part in 0..self.parts {
            let bytes = (self.read)(part, Section::Weights)?;
            let sums: [u8; 16] = bytes.try_into().map_err(|_| self.none(part))?;
            let real = |at: usize| f64::from_le_bytes(std::array::from_fn(|b| sums[at + b]));
            (mass, squares) = (mass + real(0), squares + real(8));
        }
        let noise = domain.volume() * squares / (mass * mass);
        let field = |side, moved| self.field(Section::Spectrum(side, moved), &grid, progress);
        let spectra = spectra_of(&field, noise, domain, o, progress)?;
        Ok(Some(told(ScienceOf::Mixture, o, &spectra)))
    }
}
