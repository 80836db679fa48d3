//! `particlegs series SNAPSHOT... -o RUN.pgs`.

use crate::common::{CommandContext, Common};
use crate::error_text::option_error;
use crate::fit_args::{FitArgs, number_of_blocks};
use crate::info_series::mean_psnr;
use crate::outputs::{self, ForceArgs};
use crate::snapshot_args::ParticleArgs;
use crate::target_args::parse_bytes;
use clap::{Args, ValueHint};
use particlegs_compress::differences_from;
use particlegs_compress::series::{FrameStore, KEYFRAME_INTERVAL, SeriesBuilder};
use particlegs_compress::{FieldSelection, Options};
use particlegs_core::codec::{CodedFrame, FrameCoding, SeriesFile};
use particlegs_core::model::{Model, QuantityKind};
use particlegs_core::{Error, Result, codec};
use particlegs_files::input::name_of;
use particlegs_files::model_file;
use particlegs_files::output;
use particlegs_formats::{AtomSelection, Choice, run_snapshots};
use particlegs_particles::{AlignedFrame, Alignment, LayerFields, Particles, Storage};
use serde_json::json;
use std::path::PathBuf;
use std::time::Instant;

#[derive(Args)]
#[command(mut_arg("train", |a| a.hide_short_help(true)), mut_arg("psnr", |a| a.hide_short_help(true)))]
#[command(mut_arg("size", |a| a.hide_short_help(true)))]
#[command(after_help = "\
Run the command again to go on after an interruption, or with more snapshots.

Examples:
  particlegs series snap_*.hdf5 -o run.pgs --ratio 300
  particlegs series traj.xtc --topology conf.gro --frames 0:1000:10 -o run.pgs")]
pub struct Arguments {
    /// Snapshots in order of time, or their folder; or a trajectory, with --frames.
    #[arg(required = true, value_name = "SNAPSHOT")]
    input: Vec<PathBuf>,
    /// Series file to write.
    #[arg(long, short, alias = "out", value_name = "RUN.pgs", value_hint = ValueHint::FilePath)]
    output: PathBuf,
    /// Frames of a trajectory: from FIRST to before END, every STEP.
    #[arg(long, value_name = "FIRST:END:STEP")]
    frames: Option<String>,
    /// Frames from one keyframe to the next.
    #[arg(long, value_name = "N", default_value_t = KEYFRAME_INTERVAL)]
    keyframe_interval: usize,
    /// Turn and move each frame so that these atoms, such as "name CA", lie best on those of the first frame.
    ///
    /// The words are those of --select. Aligned frames have no periodic box.
    #[arg(long, value_name = "TEXT", hide_short_help = true)]
    align: Option<String>,
    /// Memory limit, such as 2GiB: particles are then read from scratch files beside the output.
    ///
    /// Frames that need more are fitted in blocks.
    #[arg(long, value_name = "SIZE", hide_short_help = true)]
    memory: Option<String>,
    /// Number of blocks of each frame [default: 1, or as many as --memory needs].
    #[arg(long, value_name = "K", hide_short_help = true, value_parser = number_of_blocks)]
    blocks: Option<u32>,
    #[command(flatten)]
    fit: FitArgs,
    #[command(flatten)]
    force: ForceArgs,
    #[command(flatten)]
    particles: ParticleArgs,
    #[command(flatten)]
    common: Common,
}

/// Where a frame is read.
struct FrameSource {
    path: PathBuf,
    frame: Option<i64>,
}

/// Turns frames onto the first.
struct Aligner {
    /// The atoms that are put onto those of the first frame.
    chosen: Choice,
    /// These, and their ids, where the file has any.
    first: Option<(Alignment, Option<Vec<u64>>)>,
}

impl Aligner {
    fn new(text: &str, a: &Arguments) -> Result<Aligner> {
        let select = AtomSelection::parse(text).map_err(|e| Error::argument(format!("--align: {e}")))?;
        let chosen = Choice { select: Some(select), species: Vec::new(), ..a.particles.opening.choice()? };
        Ok(Aligner { chosen, first: None })
    }

    fn aligned(&mut self, source: &FrameSource, all: Particles, context: &CommandContext) -> Result<Particles> {
        let paths = std::slice::from_ref(&source.path);
        let mut choice = Choice { frame: source.frame, ..self.chosen.clone() };
        let (chosen, fields) = choice.read_fields(paths, &Storage::Memory, context)?;
        let ids = ids(&chosen, &fields)?;
        if self.first.is_none() {
            self.first = Some((Alignment::new(&chosen)?, ids.clone()));
            context.message("note: aligned frames have no periodic box");
        }
        let Some((alignment, first)) = &self.first else { return Ok(all) };
        if ids != *first {
            let what = "its atoms are in another order than those of the first frame, by which it is aligned";
            return Err(Error::input_with(source.name(), what, "sort the atoms of each frame by their ids"));
        }
        let AlignedFrame { particles, rms_distance } = alignment.apply(&chosen, &all)?;
        let unit = all.meta.units.length_text().unwrap_or_default();
        context.message(format!("{}: aligned, RMS distance {rms_distance:.4} {unit}", source.name()).trim_end());
        Ok(particles)
    }
}

/// The ids of atoms, where their file has a field of that name.
fn ids(particles: &Particles, fields: &[LayerFields]) -> Result<Option<Vec<u64>>> {
    let mut all = Vec::new();
    for (layer, fields) in particles.layers().iter().zip(fields) {
        let Some(number) = fields.fields.iter().position(|f| f.name.eq_ignore_ascii_case("id")) else {
            return Ok(None);
        };
        all.extend(fields.identities(number, layer.content.len())?);
    }
    Ok(Some(all).filter(|ids| !ids.is_empty()))
}

pub fn run(a: Arguments) -> Result<()> {
    let mut options = a.fit.options(&a.particles, a.common.seed)?;
    let mut aligner = a.align.as_deref().map(|text| Aligner::new(text, &a)).transpose()?;
    options.read.extend(a.align.iter().map(|text| ("align".to_string(), text.clone())));
    options.memory = a.memory.as_deref().map(parse_bytes).transpose()?;
    options.blocks = a.blocks;
    if options.memory.is_some() {
        options.storage = Storage::Disk(output::scratch_folder(&a.output));
    }
    let mut builder = SeriesBuilder::new(options.clone(), a.keyframe_interval)?;
    let context = a.common.clone().start()?;
    let start = Instant::now();
    context.reads(a.input.iter().chain(&a.particles.opening.topology).map(PathBuf::as_path), a.force.force)?;
    let goes_on = context.writes(&a.output, &outputs::SERIES)?;
    model_file::check_name(&a.output)?;
    let recipe = a.recipe(&options);
    let mut work = FrameStore::open(&a.output, &recipe, a.force.force)?;
    let done = if goes_on { a.done(&recipe, &context)? } else { Vec::new() };
    let choice = a.particles.choice(a.common.seed)?;
    let sources = a.sources(&choice, &context)?;
    let is_missing = |(number, source): &(usize, &FrameSource)| {
        !source.path.exists() && done.get(*number).is_none_or(Option::is_none) && work.frame(*number).is_none()
    };
    if let Some((_, source)) = sources.iter().enumerate().find(is_missing) {
        let missing = std::io::Error::new(std::io::ErrorKind::NotFound, "there is no such file or folder");
        return Err(Error::io(&source.path, missing));
    }
    if done.len() > sources.len() {
        let what = format!("it has {} frames, more than the {} snapshots given", done.len(), sources.len());
        return Err(Error::input(name_of(&a.output), what));
    }
    let (mut frames, mut raw_bytes, mut listed) = (Vec::new(), 0u64, Vec::new());
    let (mut all_kept, mut unread) = (true, None);
    for (number, source) in sources.iter().enumerate() {
        // A frame that is new changes those behind it.
        let kept = if all_kept { done.get(number).cloned().flatten().or_else(|| work.frame(number)) } else { None };
        let place = format!("{}, frame {number}", name_of(&a.output));
        let (mut particles, fields) = match source.read(&choice, (!a.fit.fields.is_empty(), &options.storage), &context)
        {
            Ok(read) => read,
            Err(e @ (Error::Cancelled | Error::Bound { .. })) => return Err(e),
            Err(e) => {
                let what = if kept.is_some() { "is kept as it was" } else { "is missing" };
                context.warn(&format!("frame {number} {what}: {e}"));
                if kept.is_some() && aligner.as_ref().is_some_and(|a| a.first.is_none()) {
                    let what = format!("frame {number} cannot be read, and --align needs the first frame: {e}");
                    return Err(Error::argument_with(what, "bring its snapshot back"));
                }
                unread = Some(e);
                if let Some(frame) = &kept {
                    let tracked = builder.decode(frame, &place, &context)?;
                    raw_bytes += tracked.clone().into_model().raw_bytes();
                    builder.resume(frame, tracked);
                }
                frames.push(kept);
                continue;
            }
        };
        if let Some(aligner) = &mut aligner {
            particles = aligner.aligned(source, particles, &context)?;
        }
        if !fields.is_empty() {
            // What is left out was the user's choice.
            particles.meta.fields.clear();
        }
        let fields = a.fields(&particles, &fields, &options).map_err(|e| option_error(&source.name(), e))?;
        let mut resumed = None;
        if let Some(frame) = kept {
            let tracked = builder.decode(&frame, &place, &context)?;
            let model = tracked.clone().into_model();
            let differing = match &differences_from(&particles, &model, false)[..] {
                [[what, stored, now], ..] => Some(format!("its {what} was {stored} and is {now} now")),
                [] if model.metadata.source_hash != particles.source_hash() => Some("its particles differ".into()),
                [] => match (model.metadata.fields_hash, fields.as_ref().and_then(FieldSelection::hash)) {
                    (stored, now) if stored == now => None,
                    (None, _) => Some("an earlier version made it and kept no record of its fields".into()),
                    _ => Some("the values of its fields differ".into()),
                },
            };
            match differing {
                None => {
                    raw_bytes += model.raw_bytes();
                    builder.resume(&frame, tracked);
                    resumed = Some(frame);
                }
                // It is made again, and so are those behind it.
                Some(_) if a.force.force => {}
                Some(differing) => {
                    let what = format!("{place} was made from another snapshot than {}: {differing}", source.name());
                    return Err(Error::argument_with(what, "replace the series with --force"));
                }
            }
        }
        let kept = match resumed {
            Some(frame) => frame,
            None => {
                all_kept = false;
                let from = Instant::now();
                let added = builder.add(number, &particles, fields.as_ref(), &context)?;
                context.notes(&added.notes);
                work.keep(number, &added.coded)?;
                let text = describe(number, builder.clock().name(), &added.coded, &added.model, from);
                context.message(&text);
                raw_bytes += added.model.raw_bytes();
                added.coded
            }
        };
        listed.push(json!({"frame": number, "time": kept.time, "keyframe": kept.keyframe, "bytes": kept.bytes.len()}));
        frames.push(Some(kept));
    }
    if let Some(error) = unread.filter(|_| frames.iter().all(Option::is_none)) {
        return Err(error);
    }
    let bytes = codec::assemble_series(builder.clock(), &recipe, &frames)?;
    output::write_bytes(&a.output, &bytes)?;
    if let Err(error) = work.remove() {
        context.warn(&format!("the folder of unfinished work stays: {error}"));
    }
    let (count, keys) = (listed.len(), frames.iter().flatten().filter(|f| f.keyframe).count());
    let missing: Vec<usize> = (0..frames.len()).filter(|&number| frames[number].is_none()).collect();
    let gaps = if missing.is_empty() { String::new() } else { format!(", {} missing", missing.len()) };
    let (ratio, seconds) = (raw_bytes as f64 / bytes.len() as f64, start.elapsed().as_secs_f64());
    let text = format!(
        "{}: {count} frames, {keys} of them keyframes{gaps}, {} bytes, ratio {ratio:.1}, {seconds:.1} s",
        a.output.display(),
        bytes.len()
    );
    let report = json!({
        "output": a.output.to_string_lossy(), "frames": listed, "missing": missing, "series_bytes": bytes.len(), "raw_bytes": raw_bytes,
        "compression_ratio": ratio, "seconds": seconds,
    });
    context.finish(&text, &report)
}

impl Arguments {
    /// What decides the bytes of a frame.
    fn recipe(&self, options: &Options) -> String {
        let certificate = options.certificate.name();
        let mut recipe = json!({
            "model": options.recipe(1), "keyframe_interval": self.keyframe_interval, "certificate": certificate,
        });
        if self.frames.is_some() {
            recipe["trajectory"] = true.into();
        }
        if options.memory.is_some() || options.blocks.is_some() {
            recipe["blocks"] = json!({ "memory": options.memory, "number": options.blocks });
        }
        recipe.to_string()
    }

    /// The frames of the series that is there.
    fn done(&self, recipe: &str, context: &CommandContext) -> Result<Vec<Option<CodedFrame>>> {
        let bytes = crate::inputs::model_or_series(&self.output, context)?;
        let there = SeriesFile::read(&bytes, &name_of(&self.output))?;
        if there.recipe != recipe {
            return Err(context.refused(&self.output));
        }
        let frame = |i: usize| match there.frames[i].kind {
            FrameCoding::Missing => Ok(None),
            kind => {
                let bytes = there.frame_bytes(i)?.to_vec();
                Ok(Some(CodedFrame { time: there.frames[i].time, keyframe: kind == FrameCoding::Keyframe, bytes }))
            }
        };
        (0..there.frames.len()).map(frame).collect()
    }

    /// The fields of a frame that are stored.
    fn fields<'a>(
        &self,
        particles: &'a Particles,
        sources: &'a [LayerFields],
        options: &Options,
    ) -> Result<Option<FieldSelection<'a>>> {
        let FitArgs { fields, star_forming, .. } = &self.fit;
        if fields.is_empty() {
            return Ok(None);
        }
        let chosen = FieldSelection::new(fields, *star_forming, particles, sources, options.law())?;
        if let Some(vector) =
            chosen.quantities().iter().find(|q| q.kind == QuantityKind::Vector && self.align.is_some())
        {
            let what = format!("--align turns positions, but not vectors such as the field `{}`", vector.name);
            return Err(Error::argument_with(what, "leave the field out, or --align"));
        }
        chosen.hashed().map(Some)
    }

    fn sources(&self, choice: &Choice, context: &CommandContext) -> Result<Vec<FrameSource>> {
        let Some(text) = &self.frames else {
            let paths = run_snapshots(&self.input, choice, context)?;
            let frame = self.particles.opening.frame;
            return Ok(paths.into_iter().map(|path| FrameSource { path, frame }).collect());
        };
        let wrong =
            || Error::argument(format!("--frames {text}: write FIRST:END or FIRST:END:STEP, such as 0:1000:10"));
        let [path] = &self.input[..] else {
            return Err(Error::argument("--frames chooses from one trajectory, but there are several inputs"));
        };
        let parts: Vec<i64> =
            text.split(':').map(str::parse).collect::<std::result::Result<_, _>>().map_err(|_| wrong())?;
        let (first, end, step) = match parts[..] {
            [first, end] => (first, end, 1),
            [first, end, step] => (first, end, step),
            _ => return Err(wrong()),
        };
        if first < 0 || end <= first || step < 1 || (end - first) / step >= codec::MOST_FRAMES as i64 {
            return Err(wrong());
        }
        let frames = (first..end).step_by(step as usize);
        Ok(frames.map(|frame| FrameSource { path: path.clone(), frame: Some(frame) }).collect())
    }
}

impl FrameSource {
    /// Its particles, and their fields if these are wanted.
    fn read(
        &self,
        choice: &Choice,
        (fields, storage): (bool, &Storage),
        context: &CommandContext,
    ) -> Result<(Particles, Vec<LayerFields>)> {
        let mut choice = Choice { frame: self.frame, ..choice.clone() };
        let path = std::slice::from_ref(&self.path);
        match fields {
            true => choice.read_fields(path, storage, context),
            false => Ok((choice.read(path, storage, context)?, Vec::new())),
        }
    }

    fn name(&self) -> String {
        match self.frame {
            Some(frame) => format!("frame {frame} of {}", self.path.display()),
            None => self.path.display().to_string(),
        }
    }
}

fn describe(number: usize, clock: &str, frame: &CodedFrame, model: &Model, from: Instant) -> String {
    let gaussians = model.gaussians();
    let kind = if frame.keyframe { "keyframe" } else { "changes" };
    let score = model.certificate.as_ref().and_then(mean_psnr);
    let score = score.map_or(String::new(), |score| format!(", {score:.2} dB"));
    let (bytes, seconds) = (frame.bytes.len(), from.elapsed().as_secs_f64());
    format!(
        "frame {number} ({clock} {:.5}): {kind}, {gaussians} Gaussians, {bytes} bytes, {:.2} per Gaussian{score}, \
         {seconds:.1} s",
        frame.time,
        bytes as f64 / gaussians.max(1) as f64
    )
}
