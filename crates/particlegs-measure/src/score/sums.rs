//! Sums over a part of the particles and its Gaussians, and the certificate that is added up from those of all parts,
//! which were never in one process.
//!
//! Optical depths, masses in cells and the weights that shot noise follows from add up; ParaView's pictures, whose
//! splats hide each other, do not, nor do groups and neighbours across parts. All parts share a [`MeasurementFrame`].
//! Sections are little-endian, of a fixed order and independent of threads; rows of zeros are left out.

use super::cells::{agreements, finest};
use super::density::{DensityAgreement, DensityGrid, GRID, density_metrics, model_and_uniform};
use super::evaluate::clipped;
use super::field_sums::{FieldCellTable, FieldCells, add_field_section};
use super::science::{file_holds, science_metrics, spectrum_options};
use super::views::{SIZE, certificate_views, view_metrics};
use crate::stats::{Assignment, Field, Grid, SpectrumOptions, Subject, deposit_for_modes, scheme_of, spectra_of};
use particlegs_core::camera::View;
use particlegs_core::context::Context;
use particlegs_core::model::{
    CELL_SIZES, CERTIFIED_FIELDS, CellDensity, Certificate, FieldAgreements, Metadata, Model, OrbitMetrics,
    PictureScore, PictureScores, ScienceMetrics, ScienceSubject,
};
use particlegs_core::picture::{Gray8, Plane, Scores};
use particlegs_core::render::{Scene, tone};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result, render};
use particlegs_particles::{Domain, Particles};
use particlegs_reference::{Reference, uniform_box};

/// A section of a part's sums: of the particles (0) or of the Gaussians (1).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum SumsSection {
    /// The particles' mass and the sum of its squares.
    Weights,
    /// Mass in the cells of the certificate's coarse grid.
    Density(usize),
    /// Mass in the smallest cells.
    Cells(usize),
    /// The spectrum's field, as it is (0) and moved by half a cell (1).
    Spectrum(usize, usize),
    /// Optical depth in a view.
    View(usize, usize),
    /// A field in its cells ([`super::field_section`]), empty where there is none.
    Field(usize),
}

impl SumsSection {
    /// All, in the order of a part.
    pub const ALL: [SumsSection; 15 + CERTIFIED_FIELDS] = {
        use SumsSection::{Cells, Density, Field, Spectrum, View, Weights};
        [
            Weights,
            Density(0),
            Density(1),
            Cells(0),
            Cells(1),
            Spectrum(0, 0),
            Spectrum(0, 1),
            Spectrum(1, 0),
            Spectrum(1, 1),
            View(0, 0),
            View(0, 1),
            View(0, 2),
            View(1, 0),
            View(1, 1),
            View(1, 2),
            Field(0),
            Field(1),
            Field(2),
            Field(3),
            Field(4),
            Field(5),
            Field(6),
            Field(7),
        ]
    };
}

/// Views, grids and options that all parts of a snapshot are measured by; they follow from the metadata of the whole.
pub struct MeasurementFrame {
    /// Metadata of the whole.
    pub metadata: Metadata,
    /// Box of the whole.
    pub domain: Domain,
    /// The certificate's views, with the whole's clipping ranges.
    pub views: Vec<View>,
    /// Cells of the certificate's density.
    pub density: DensityGrid,
    /// The smallest cells, where there are enough.
    pub cells: Option<Grid>,
    /// Options of P(k).
    pub spectrum: SpectrumOptions,
    /// Cells in which fields are compared.
    pub fields: FieldCells,
}

impl MeasurementFrame {
    /// The frame of a snapshot of this metadata, in views that `seed` turns.
    pub fn new(metadata: &Metadata, seed: u64) -> MeasurementFrame {
        let domain = Domain::new(&metadata.bounds, metadata.cell.as_ref());
        let views = certificate_views(metadata, SIZE, seed);
        let count = metadata.count as usize;
        MeasurementFrame {
            domain,
            views: views.iter().map(|v| clipped(v, &metadata.bounds)).collect(),
            density: DensityGrid::new(&metadata.bounds, metadata.cell.as_ref(), GRID),
            cells: finest(&domain, count),
            // Parts do not know how many Gaussians there are of all.
            spectrum: spectrum_options(&domain, count),
            fields: FieldCells::new(metadata, seed),
            metadata: metadata.clone(),
        }
    }

    /// The grid that P(k) is measured on.
    pub fn spectrum_grid(&self) -> Grid {
        Grid::new(&self.domain, self.spectrum.cells)
    }

    /// Numbers that a section adds up, and how many of them are a row.
    pub fn shape(&self, section: SumsSection) -> [usize; 2] {
        let shape_of = |g: &Grid| [g.len(), g.cells[2]];
        match section {
            SumsSection::Weights => [2, 2],
            SumsSection::Density(_) => shape_of(self.density.grid()),
            SumsSection::Cells(_) => self.cells.as_ref().map_or([0, 1], shape_of),
            SumsSection::Spectrum(..) => shape_of(&self.spectrum_grid()),
            SumsSection::View(..) => [SIZE.pixels(), SIZE.width],
            SumsSection::Field(_) => [0, 1],
        }
    }

    /// One section of a part: `particles` and the `model` made of them. Those of fields are measured elsewhere.
    pub fn measure(
        &self,
        section: SumsSection,
        model: &Model,
        particles: &Particles,
        context: &Context<'_>,
    ) -> Result<Vec<u8>> {
        let part = PartWithModel { frame: self, layers: layers_of(particles), model, context };
        let [_, width] = self.shape(section);
        Ok(match section {
            SumsSection::Weights => part.weights().into_iter().flat_map(f64::to_le_bytes).collect(),
            SumsSection::Density(side) => rows(&part.density(side)?, width),
            SumsSection::Cells(side) => match &self.cells {
                Some(grid) => rows(&part.field(side, grid, Some(Assignment::Ngp), 0.0)?, width),
                None => Vec::new(),
            },
            SumsSection::Spectrum(side, moved) => {
                let grid = self.spectrum_grid();
                let scheme = scheme_of(side == 0, &grid, &self.spectrum);
                // Without a scheme Gaussians are widened, and the second field is not asked for.
                match (scheme, moved) {
                    (None, 1) => Vec::new(),
                    _ => rows(&part.field(side, &grid, scheme, 0.5 * moved as f64)?, width),
                }
            }
            SumsSection::View(side, view) => rows(&part.optical_depth(side, &self.views[view])?, width),
            SumsSection::Field(_) => Vec::new(),
        })
    }
}

/// Each layer on its own: its mass is then its own, wherever the particles come from.
fn layers_of(particles: &Particles) -> Vec<Particles> {
    particles.layers().iter().map(|l| particles.of_layer(l)).filter(|l| !l.is_empty()).collect()
}

struct PartWithModel<'a> {
    frame: &'a MeasurementFrame,
    layers: Vec<Particles>,
    model: &'a Model,
    context: &'a Context<'a>,
}

impl PartWithModel<'_> {
    fn weights(&self) -> [f64; 2] {
        let mut sums = [0.0; 2];
        for p in &self.layers {
            let unit = p.meta.particle_mass.unwrap_or(1.0);
            let layer_sums = match p.weights() {
                None => [p.len() as f64; 2],
                Some(w) => w.iter().fold([0.0; 2], |s, &w| [s[0] + f64::from(w), s[1] + f64::from(w) * f64::from(w)]),
            };
            (sums[0], sums[1]) = (sums[0] + unit * layer_sums[0], sums[1] + unit * unit * layer_sums[1]);
        }
        sums
    }

    fn density(&self, side: usize) -> Result<Vec<f32>> {
        let grid = &self.frame.density;
        let mut sum = vec![0.0f64; grid.grid().len()];
        let mut add = |masses: Vec<f64>| sum.iter_mut().zip(masses).for_each(|(s, v)| *s += v);
        match side {
            0 => self.layers.iter().try_for_each(|p| grid.of_particles(p, self.context).map(&mut add))?,
            _ => add(grid.of_model(self.model, self.context)?),
        }
        Ok(sum.into_iter().map(|v| v as f32).collect())
    }

    fn field(&self, side: usize, grid: &Grid, scheme: Option<Assignment>, shift: f64) -> Result<Vec<f32>> {
        let masses_of = |subject| deposit_for_modes(subject, grid, scheme, shift, self.context).map(|f: Field| f.mass);
        if side == 1 {
            return masses_of(Subject::Model(self.model));
        }
        let mut sum: Vec<f32> = Vec::new();
        for p in &self.layers {
            let masses = masses_of(Subject::Particles(p))?;
            match sum.is_empty() {
                true => sum = masses,
                false => sum.iter_mut().zip(masses).for_each(|(s, v)| *s += v),
            }
        }
        Ok(sum)
    }

    fn optical_depth(&self, side: usize, view: &View) -> Result<Vec<f32>> {
        let size = SIZE;
        if side == 1 {
            return Ok(render::optical_depth(&Scene::new(self.model), view, size, self.context)?.data);
        }
        let mut sum = vec![0.0f32; size.pixels()];
        for p in &self.layers {
            let depth =
                Reference::with_bounds(p, self.frame.metadata.bounds).optical_depth(view, size, self.context)?;
            sum.iter_mut().zip(depth.data).for_each(|(s, v)| *s += v);
        }
        Ok(sum)
    }
}

/// The rows of `values` that hold anything: u32 number, u32 first and u32 count of the values from the first to the
/// last that is not 0, and these as f32.
fn rows(values: &[f32], width: usize) -> Vec<u8> {
    let mut out = Vec::new();
    for (number, row) in values.chunks(width).enumerate() {
        let Some(first) = row.iter().position(|v| *v != 0.0) else { continue };
        let last = row.iter().rposition(|v| *v != 0.0).unwrap_or(first);
        [number, first, last + 1 - first].iter().for_each(|n| out.extend((*n as u32).to_le_bytes()));
        row[first..=last].iter().for_each(|v| out.extend(v.to_le_bytes()));
    }
    out
}

/// Adds the rows of a section; `None` where they are none of these.
fn add_rows(sum: &mut [f32], width: usize, mut bytes: &[u8]) -> Option<()> {
    while !bytes.is_empty() {
        let (head, rest) = bytes.split_at_checked(12)?;
        let [number, first, count] =
            [0, 4, 8].map(|at| u32::from_le_bytes(std::array::from_fn(|b| head[at + b])) as usize);
        let (values, rest) = rest.split_at_checked(count.checked_mul(4)?)?;
        // Sections are read from files: each number is checked before it is used.
        let row = sum.get_mut(number.checked_mul(width)?..)?;
        let row = row.get_mut(first..first.checked_add(count).filter(|end| *end <= width)?)?;
        for (s, v) in row.iter_mut().zip(values.chunks_exact(4)) {
            *s += f32::from_le_bytes(std::array::from_fn(|b| v[b]));
        }
        bytes = rest;
    }
    Some(())
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn rows_come_back_and_contradictions_do_not() {
        let mut values = vec![0.0f32; 20];
        (values[3], values[11], values[14]) = (1.5, -2.0, 7.0);
        let bytes = rows(&values, 5);
        assert_eq!(bytes.len(), 12 + 4 + 12 + 4 * 4);
        let mut sum = vec![1.0f32; 20];
        add_rows(&mut sum, 5, &bytes).unwrap();
        assert!(sum.iter().zip(&values).all(|(s, v)| *s == v + 1.0));
        for cut in [1, 11, 13, bytes.len() - 1] {
            assert!(add_rows(&mut sum, 5, &bytes[..cut]).is_none(), "{cut}");
        }
        for (at, value) in [(0, 4u32), (4, 5), (8, u32::MAX)] {
            let mut bad = bytes.clone();
            bad[at..at + 4].copy_from_slice(&value.to_le_bytes());
            assert!(add_rows(&mut sum, 5, &bad).is_none(), "{at}");
        }
        assert!(add_rows(&mut sum[..10], 5, &bytes).is_none());
    }
}
