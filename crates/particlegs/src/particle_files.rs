//! Particles as files, drawn from a model or converted; and haloes as files.

use crate::{Context, Error, Model, Particles, RecoverOptions, Result, Snapshot, Storage};
use particlegs_core::codec;
use particlegs_figure::FileKind;
use particlegs_files::output::kinds::{CSV, HDF5, PARTICLES, PDF, PNG, SVG};
use particlegs_files::output::{Outputs, ending};
use particlegs_fit::recover::{drawn_fields, recover};
use particlegs_formats::{Writer, is_hdf5, write_haloes, write_splats};
use particlegs_measure::haloes::HaloReport;
use particlegs_particles::{RawForm, SelectedParticles, Selection, Tiling};
use std::path::{Path, PathBuf};

/// Particles that were written to a file or folder.
#[derive(Clone, Copy, Debug)]
pub struct ParticleFile {
    /// Particles that were there to choose from.
    pub particles_in: u64,
    /// Particles that the file holds.
    pub particles: u64,
    /// Bytes that were written; 0 where it held the same already.
    pub bytes: u64,
}

/// The writer of an output by its ending or a format's name; a file is declared, a folder is not.
fn writer_of(out: &Path, format: Option<&str>, outputs: &Outputs, context: &Context<'_>) -> Result<&'static Writer> {
    match Writer::for_output(out, format) {
        Ok(writer) if writer.folder => Ok(writer),
        Ok(writer) => outputs.writes(out, &PARTICLES, context).map(|_| writer),
        // First check that the output is neither an input nor another output.
        Err(error) => outputs.writes(out, &PARTICLES, context).and(Err(error)),
    }
}

/// Declares the folder or file that particles are drawn into, unless it is declared already: what long work does before
/// it reads its input.
///
/// # Errors
/// [`Error::Argument`] for an unknown ending, and a form for a file; [`Error::Output`] for what may not be replaced.
pub fn plan_recovery(out: &Path, options: &RecoverOptions, outputs: &Outputs, context: &Context<'_>) -> Result<()> {
    if outputs.is_declared(out, None) || outputs.is_declared(out, Some(&PARTICLES)) {
        return Ok(());
    }
    let writer = writer_of(out, None, outputs, context)?;
    if !writer.folder {
        let message = "the form is that of a folder: a file's extension selects its format";
        return if options.form == RawForm::Columns { Ok(()) } else { Err(Error::argument(message)) };
    }
    // An earlier run may have drawn fields, whose files go with the others.
    let drawn = drawn_fields(out);
    let files: Vec<&str> = RawForm::FOLDER_FILES.into_iter().chain(drawn.iter().map(String::as_str)).collect();
    outputs.writes_folder(out, &files).map(drop)
}

impl Model {
    /// Draws synthetic particles into a folder, which may be larger than memory, or into a file in the format of its
    /// ending, from some layers or, without names, from all. An existing output is kept if it is the same.
    ///
    /// # Errors
    /// [`Error::Argument`] for options out of range; [`Error::Output`] for what may not be replaced; [`Error::Memory`];
    /// [`Error::Io`]; [`Error::Cancelled`].
    pub fn recover_into(
        self,
        out: &Path,
        (options, layers): (&RecoverOptions, &[String]),
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<ParticleFile> {
        plan_recovery(out, options, outputs, context)?;
        let (writer, is_kept) = (Writer::for_output(out, None)?, outputs.is_kept(out));
        let hash = codec::file_hash(self.bytes());
        let mut model = self.into_decoded();
        if !layers.is_empty() {
            let certificate = model.certificate.take();
            model = model.only(layers)?;
            // Scores of the whole model say little about some layers.
            if certificate.is_some() {
                context.note("the scores in the model file are for all layers together, not for these");
            }
        }
        let particles = options.total(&model);
        // A folder may be larger than memory, so its notes and lengths are compared; a file is compared byte by byte.
        if is_kept && writer.folder && !options.is_there(out, &model, hash)? {
            return Err(outputs.refused(out));
        }
        let bytes = match (is_kept && writer.folder, writer.folder) {
            (true, _) => 0,
            (_, true) => recover(model, hash, options, out, context)?,
            _ => {
                let (particles, fields) = options.draw_with_fields(model, context)?;
                let all = SelectedParticles::new(&particles, Tiling::single(), Selection::all(), context)?;
                write(writer, &all.with_fields(fields), out, outputs, context)?
            }
        };
        Ok(ParticleFile { particles_in: particles, particles, bytes })
    }

    /// Synthetic particles with the fields that are drawn with them, as a snapshot.
    ///
    /// # Errors
    /// As [`Model::recover`].
    pub fn recover_snapshot(&self, options: &RecoverOptions, context: &Context<'_>) -> Result<Snapshot> {
        let (particles, fields): (Particles, _) = options.draw_with_fields(self.decoded().clone(), context)?;
        Snapshot::from(particles).with_fields(fields)
    }

    /// Writes the splats of an alpha-blend model as the PLY of 3-D Gaussian splatting, y down. Gives the bytes.
    ///
    /// # Errors
    /// [`Error::Input`] for optical-depth models; [`Error::Output`]; [`Error::Io`]; [`Error::Cancelled`].
    pub fn save_splats(&self, out: &Path, outputs: &Outputs, context: &Context<'_>) -> Result<u64> {
        outputs.writes_new(out, &PARTICLES, context)?;
        let bytes = write_splats(self.decoded(), None, &[], out, context)?;
        if self.decoded().vizmapper().is_some() {
            context.note("the VizMapper is left out: a PLY file holds only splats");
        }
        Ok(bytes)
    }
}

impl Snapshot {
    /// Writes the selected particles, with their fields, in the format of the output's ending or of a name; `copies` of
    /// a periodic box along x, y and z lie one after the other, z fastest, before the selection.
    ///
    /// # Errors
    /// [`Error::Argument`] for an unknown format, and copies of what is not periodic; [`Error::Output`] for what may not
    /// be replaced; those of reading; [`Error::Io`]; [`Error::Cancelled`].
    pub fn convert(
        &self,
        out: &Path,
        (format, copies): (Option<&str>, Option<[u32; 3]>),
        outputs: &Outputs,
        context: &Context<'_>,
    ) -> Result<ParticleFile> {
        self.declare(outputs);
        let writer = writer_of(out, format, outputs, context)?;
        if writer.folder {
            outputs.writes_folder(out, &RawForm::FOLDER_FILES)?;
        }
        // Copies come before the selection, so all particles are read.
        let (whole, selection) = self.clone().without_selection();
        let (particles, fields) = whole.read(whole.has_fields(), &Storage::Memory, context)?;
        let tiling = copies.map_or(Ok(Tiling::single()), |copies| Tiling::new(copies, &particles))?;
        let mut selected = SelectedParticles::new(&particles, tiling, selection, context)?;
        if !fields.is_empty() {
            selected = selected.with_fields(fields);
        }
        let bytes = write(writer, &selected, out, outputs, context)?;
        Ok(ParticleFile { particles_in: particles.len() as u64, particles: selected.total(), bytes })
    }

    /// Writes the selected particles in the format of the output's ending, over no other file.
    ///
    /// # Errors
    /// As [`Snapshot::convert`].
    pub fn save(&self, out: impl AsRef<Path>, context: &Context<'_>) -> Result<ParticleFile> {
        self.convert(out.as_ref(), (None, None), &Outputs::new(false), context)
    }
}

fn write(
    writer: &Writer,
    selected: &SelectedParticles<'_>,
    out: &Path,
    outputs: &Outputs,
    context: &Context<'_>,
) -> Result<u64> {
    if let Some(left_out) = writer.left_out(selected) {
        context.note(&left_out);
    }
    outputs.write_file(out, |out| writer.write(selected, out, context), context)
}

/// Files that haloes are written to.
#[derive(Clone, Copy, Debug)]
pub struct HaloFiles<'a> {
    /// The catalogue: `NAME.csv` or `NAME.hdf5`.
    pub catalogue: &'a Path,
    /// Mass functions: tables `NAME.csv`, plots `NAME.png`, `.svg` or `.pdf`.
    pub mass_functions: &'a [PathBuf],
}

impl HaloFiles<'_> {
    /// Declares the files before the work.
    ///
    /// # Errors
    /// [`Error::Output`] for an ending that means another type of file, and a file that is kept.
    pub fn declare(&self, outputs: &Outputs, context: &Context<'_>) -> Result<()> {
        outputs.writes(self.catalogue, if is_hdf5(self.catalogue)? { &HDF5 } else { &CSV }, context)?;
        self.mass_functions.iter().try_for_each(|path| {
            ending(path, &["csv", "png", "svg", "pdf"])?;
            let kind = match FileKind::from_path(path) {
                Some(FileKind::Png) => &PNG,
                Some(FileKind::Svg) => &SVG,
                Some(FileKind::Pdf) => &PDF,
                None => &CSV,
            };
            outputs.writes(path, kind, context).map(drop)
        })
    }

    /// Writes them, each whole or not at all.
    ///
    /// # Errors
    /// [`Error::Argument`] for a plot without a halo that has a mass; [`Error::Io`].
    pub fn write(&self, report: &HaloReport) -> Result<()> {
        write_haloes(&report.catalogue, self.catalogue)?;
        self.mass_functions.iter().try_for_each(|path| report.write_mass_function(path))
    }
}
