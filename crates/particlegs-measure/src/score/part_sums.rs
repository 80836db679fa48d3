//! A certificate of sums over parts, which were never in one process.

use super::density::{DensityAgreement, density_metrics, model_and_uniform};
use super::field_sums::{FieldCellTable, add_field_section};
use super::science::{file_holds, science_metrics};
use super::sums::{MeasurementFrame, SumsSection, add_rows};
use super::views::{SIZE, view_metrics};
use crate::score::cells::agreements;
use crate::stats::{Field, Grid, spectra_of};
use particlegs_core::context::Context;
use particlegs_core::model::{
    CELL_SIZES, CellDensity, Certificate, FieldAgreements, OrbitMetrics, PictureScore, PictureScores, ScienceMetrics,
    ScienceSubject,
};
use particlegs_core::picture::{Gray8, Plane, Scores};
use particlegs_core::render::tone;
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result};
use particlegs_particles::Domain;
use particlegs_reference::uniform_box;

/// Gives a section of a part, as [`MeasurementFrame::measure`] made it.
pub(crate) type SectionReader<'a> = &'a dyn Fn(u32, SumsSection) -> Result<Vec<u8>>;

/// Adds up the sums of `parts` parts, in their order.
pub struct PartSums<'a> {
    /// Views, grids and options that the parts were measured by.
    pub frame: &'a MeasurementFrame,
    /// Seed of the certificate.
    pub seed: u64,
    /// Number of parts.
    pub parts: u32,
    /// Fields of the model.
    pub fields: usize,
    /// Reads a section of a part.
    pub read: SectionReader<'a>,
}

impl PartSums<'_> {
    /// The certificate.
    pub fn certificate(&self, context: &Context<'_>) -> Result<Certificate> {
        context.begin("adding up the blocks' sums", 0);
        let orbits = [self.view(0, context)?, self.view(1, context)?, self.view(2, context)?];
        let certificate = Certificate {
            views: view_metrics(self.seed, orbits),
            density: density_metrics(self.density(context)?),
            densities: self.cells(context)?,
            science: self.science(context)?,
            fields: self.fields(context)?,
            blocks: Some(self.parts),
            ..Certificate::default()
        };
        context.end();
        Ok(certificate)
    }

    fn sum(&self, section: SumsSection, context: &Context<'_>) -> Result<Vec<f32>> {
        let [length, width] = self.frame.shape(section);
        particlegs_files::memory::require("the blocks' sums", 4 * length as u64)?;
        let mut sum = vec![0.0f32; length];
        for part in 0..self.parts {
            context.check()?;
            let bytes = (self.read)(part, section)?;
            add_rows(&mut sum, width, &bytes).ok_or_else(|| self.none(part))?;
        }
        Ok(sum)
    }

    fn none(&self, part: u32) -> Error {
        Error::corrupt(format!("the sums of block {part}"), "they belong to grids of another plan")
    }

    /// The noise-free pictures alone: ParaView's own, in which splats hide each other, do not add up.
    fn view(&self, view: usize, context: &Context<'_>) -> Result<OrbitMetrics> {
        let (size, metadata) = (SIZE, &self.frame.metadata);
        let (even, view_of) = (Domain::drawn(&metadata.bounds, metadata.cell.as_ref()), &self.frame.views[view]);
        let picture = |tau: &Plane| tone(tau, ToneStyle::Expected, view_of.opacity, view_of.radius_pixels(size));
        let side =
            |side| Ok::<_, Error>(picture(&Plane { size, data: self.sum(SumsSection::View(side, view), context)? }));
        let (truth, model) = (side(0)?, side(1)?);
        let even = picture(&uniform_box(&even, metadata.count as f64, view_of, size)?);
        let score = |p: &Gray8| {
            let s = Scores::new(p, &truth);
            Some(PictureScore { masked_psnr: s.masked_psnr, ssim: s.ssim.unwrap_or(0.0) })
        };
        let expected = PictureScores {
            model: score(&model),
            noise_free: Some(PictureScore { masked_psnr: None, ssim: 1.0 }),
            all_black: score(&Gray8::black(size)),
            uniform_box: score(&even),
            subset: None,
        };
        Ok(OrbitMetrics { expected, ..OrbitMetrics::default() })
    }

    fn density(&self, context: &Context<'_>) -> Result<[DensityAgreement; 2]> {
        let side = |side| {
            let sum = self.sum(SumsSection::Density(side), context)?;
            Ok::<_, Error>(sum.into_iter().map(f64::from).collect::<Vec<f64>>())
        };
        Ok(model_and_uniform(&side(0)?, &side(1)?))
    }

    fn field(&self, section: SumsSection, grid: &Grid, context: &Context<'_>) -> Result<Field> {
        Ok(Field { grid: *grid, mass: self.sum(section, context)?, outside: 0.0 })
    }

    fn cells(&self, context: &Context<'_>) -> Result<Option<[CellDensity; CELL_SIZES]>> {
        let Some(grid) = &self.frame.cells else { return Ok(None) };
        let side = |side| self.field(SumsSection::Cells(side), grid, context);
        Ok(agreements([side(0)?, side(1)?], self.frame.metadata.count as usize))
    }

    /// `None` without fields.
    fn fields(&self, context: &Context<'_>) -> Result<Option<FieldAgreements>> {
        let mut agreements = FieldAgreements::default();
        for (number, to) in agreements.each.iter_mut().enumerate().take(self.fields) {
            context.check()?;
            let mut sums = FieldCellTable::new();
            for part in 0..self.parts {
                let bytes = (self.read)(part, SumsSection::Field(number))?;
                add_field_section(&mut sums, &bytes).ok_or_else(|| self.none(part))?;
            }
            *to = Some(self.frame.fields.agreement(&sums));
        }
        Ok((self.fields > 0).then_some(agreements))
    }

    fn science(&self, context: &Context<'_>) -> Result<Option<ScienceMetrics>> {
        let (o, domain, grid) = (&self.frame.spectrum, &self.frame.domain, self.frame.spectrum_grid());
        if !file_holds(domain, o) {
            return Ok(None);
        }
        let (mut mass, mut squares) = (0.0, 0.0);
        for part in 0..self.parts {
            let bytes = (self.read)(part, SumsSection::Weights)?;
            let sums: [u8; 16] = bytes.try_into().map_err(|_| self.none(part))?;
            let real = |at: usize| f64::from_le_bytes(std::array::from_fn(|b| sums[at + b]));
            (mass, squares) = (mass + real(0), squares + real(8));
        }
        let noise = domain.volume() * squares / (mass * mass);
        let field = |side, moved| self.field(SumsSection::Spectrum(side, moved), &grid, context);
        let spectra = spectra_of(&field, noise, domain, o, context)?;
        Ok(Some(science_metrics(ScienceSubject::Mixture, o, &spectra)))
    }
}
