//! Makes a series of models of the snapshots of a run.

use crate::{Choice, Context, Error, Hint, Particles, Result, Storage};
use particlegs_compress::series::{FrameStore, KEYFRAME_INTERVAL, SERIES_FILE, SeriesBuilder};
use particlegs_compress::{FieldSelection, Options, differences_from};
use particlegs_core::codec::{CodedFrame, FrameCoding, MOST_FRAMES, SeriesFile, assemble_series};
use particlegs_core::model::{Certificate, Model, QuantityKind};
use particlegs_files::input::{Source, name_of};
use particlegs_files::model_file;
use particlegs_files::output::{self, Input, Outputs};
use particlegs_formats::{AtomSelection, run_snapshots};
use particlegs_particles::{AlignedFrame, Alignment, LayerFields};
use serde::Serialize;
use serde_json::json;
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::time::Instant;

/// Options of making a series of the snapshots of a run.
#[derive(Clone, Debug)]
pub struct SeriesOptions {
    /// Options of compressing keyframes. Memory, blocks, fields and seed are those of every frame.
    pub compress: Options,
    /// Frames from one keyframe to the next, at least 1.
    pub keyframe_interval: usize,
    /// Whether frames between keyframes get the certificate as well, which takes most of the time of small frames.
    pub certify_changes: bool,
    /// Frames of a trajectory; `None` for one snapshot a frame.
    pub frames: Option<FrameRange>,
    /// Atoms, in the words of [`AtomSelection`], by which each frame is turned and moved onto the first. Aligned frames
    /// have no periodic box.
    pub align: Option<String>,
    /// Whether a series that was made with other options, or of other snapshots, is replaced.
    pub replace: bool,
}

impl Default for SeriesOptions {
    fn default() -> Self {
        let (compress, certify_changes, frames, align, replace) = Default::default();
        SeriesOptions { compress, keyframe_interval: KEYFRAME_INTERVAL, certify_changes, frames, align, replace }
    }
}

/// Frames of a trajectory: from `first` to before `end`, every `step`. Its text is `FIRST:END` or `FIRST:END:STEP`.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FrameRange {
    /// The first frame, from 0.
    pub first: i64,
    /// The frame behind the last.
    pub end: i64,
    /// From one frame to the next.
    pub step: i64,
}

impl FromStr for FrameRange {
    type Err = Error;

    fn from_str(text: &str) -> Result<FrameRange> {
        let wrong = || Error::argument(format!("frames {text}: write FIRST:END or FIRST:END:STEP, such as 0:1000:10"));
        let numbers: Vec<i64> =
            text.split(':').map(str::parse).collect::<std::result::Result<_, _>>().map_err(|_| wrong())?;
        let (first, end, step) = match numbers[..] {
            [first, end] => (first, end, 1),
            [first, end, step] => (first, end, step),
            _ => return Err(wrong()),
        };
        FrameRange { first, end, step }.check().map_err(|_| wrong())
    }
}

impl FrameRange {
    /// Refuses a range without frames, backwards, or of more frames than a series holds.
    fn check(self) -> Result<FrameRange> {
        let FrameRange { first, end, step } = self;
        // `first` is not negative where the difference is taken, so that cannot overflow.
        if first < 0 || end <= first || step < 1 || (end - first) / step >= MOST_FRAMES as i64 {
            return Err(Error::argument(format!(
                "there are no such frames: from {first} to before {end}, every {step}"
            )));
        }
        Ok(self)
    }
}

/// A frame of a series that was made.
#[derive(Clone, Debug, Serialize)]
pub struct FrameResult {
    /// Its number, from 0.
    pub frame: usize,
    /// Time by the series' clock.
    pub time: f64,
    /// Whether it is a model of its own.
    pub keyframe: bool,
    /// Bytes of its part of the file.
    pub bytes: usize,
}

/// A series that was made.
#[derive(Clone, Debug, Serialize)]
pub struct SeriesResult {
    /// The frames that the series holds, in the order of time.
    pub frames: Vec<FrameResult>,
    /// Numbers of the frames whose snapshots could not be read.
    pub missing: Vec<usize>,
    /// Bytes of the file.
    pub series_bytes: usize,
    /// Bytes of the positions and masses of all frames, as float32.
    pub raw_bytes: u64,
    /// `raw_bytes` over `series_bytes`.
    pub compression_ratio: f64,
}

/// Makes a series of models of the snapshots of a run, or goes on with one: frames that `output` or the folder
/// `OUTPUT.work` holds already are kept where their snapshots are the same, and new snapshots are added behind them.
/// `snapshots` are files in any order of time, their folder, or one trajectory; a snapshot that cannot be read is a
/// gap, of which the context is warned.
///
/// # Errors
/// [`Error::Input`] for snapshots that are not those of one run; [`Error::Output`] for an `output` that was made with other
/// options; [`Error::Argument`] for options out of range, and frames of other snapshots; [`Error::Io`]; [`Error::Memory`];
/// [`Error::Cancelled`]: the frames so far wait in `OUTPUT.work`.
pub fn make_series(
    snapshots: &[PathBuf],
    choice: &Choice,
    output: &Path,
    options: &SeriesOptions,
    context: &Context<'_>,
) -> Result<SeriesResult> {
    let outputs = Outputs::new(options.replace);
    snapshots.iter().chain(&choice.topology).for_each(|path| outputs.reads(Input::Data(path.clone())));
    let mut work = SeriesWork::new(choice, output, options, context)?;
    let goes_on = outputs.writes(output, &SERIES_FILE, context)?;
    model_file::check_name(output)?;
    let recipe = work.recipe();
    let mut store = FrameStore::open(output, &recipe, options.replace)?;
    // Frames of another recipe have other bytes: the whole series would have to be made anew.
    let mut old_frames = Vec::new();
    if goes_on {
        old_frames = frames_of(output, &recipe, context)?.ok_or_else(|| outputs.refused(output))?;
    }
    let sources = work.sources(snapshots)?;
    let old_frame =
        |number: usize, store: &FrameStore| old_frames.get(number).cloned().flatten().or_else(|| store.frame(number));
    let is_absent =
        |(number, source): &(usize, &FrameSource)| !source.path.exists() && old_frame(*number, &store).is_none();
    // A path that is not there is rather a slip of the caller than a gap in the run: told before hours of work.
    if let Some((_, source)) = sources.iter().enumerate().find(is_absent) {
        let absent = std::io::Error::new(std::io::ErrorKind::NotFound, "there is no such file or folder");
        return Err(Error::io(&source.path, absent));
    }
    if old_frames.len() > sources.len() {
        let message = format!("it has {} frames, more than the {} snapshots given", old_frames.len(), sources.len());
        return Err(Error::input(name_of(output), message));
    }
    let (mut frames, mut unread, mut all_kept) = (Vec::new(), None, true);
    for (number, source) in sources.iter().enumerate() {
        // A frame that is new changes those behind it.
        let old_frame = if all_kept { old_frame(number, &store) } else { None };
        let read = match work.read(source) {
            Ok(read) => work.aligned(source, read)?,
            // These say nothing of the snapshot, so its frame is no gap.
            Err(e @ (Error::Cancelled | Error::Bound { .. })) => return Err(e),
            Err(e) => {
                frames.push(work.keep_unread(number, old_frame, &e)?);
                unread = Some(e);
                continue;
            }
        };
        let kept_frame = match old_frame {
            Some(frame) => work.keep(number, &read, frame)?,
            None => None,
        };
        frames.push(Some(match kept_frame {
            Some(frame) => frame,
            None => {
                all_kept = false;
                let frame = work.make(number, &read)?;
                // Written at once, so that a run that is stopped goes on from here.
                store.keep(number, &frame)?;
                frame
            }
        }));
    }
    // Without any frame there is no series, and the last error tells why.
    if let Some(error) = unread.filter(|_| frames.iter().all(Option::is_none)) {
        return Err(error);
    }
    let bytes = assemble_series(work.builder.clock(), &recipe, &frames)?;
    output::write_bytes(output, &bytes)?;
    // The series is whole by now: that its folder stays is no reason to fail.
    if let Err(error) = store.remove() {
        context.warn(&format!("the folder of unfinished work stays: {error}"));
    }
    let (is_missing, raw_bytes) = (|number: &usize| frames[*number].is_none(), work.raw_bytes);
    let listed = frames.iter().enumerate().filter_map(|(frame, coded)| {
        let CodedFrame { time, keyframe, bytes } = coded.as_ref()?;
        Some(FrameResult { frame, time: *time, keyframe: *keyframe, bytes: bytes.len() })
    });
    Ok(SeriesResult {
        frames: listed.collect(),
        missing: (0..frames.len()).filter(is_missing).collect(),
        series_bytes: bytes.len(),
        raw_bytes,
        compression_ratio: raw_bytes as f64 / bytes.len() as f64,
    })
}

/// The frames of a series that exists, where `recipe` made it.
fn frames_of(path: &Path, recipe: &str, context: &Context<'_>) -> Result<Option<Vec<Option<CodedFrame>>>> {
    let name = name_of(path);
    let bytes = model_file::read_source(Source::open(path, context)?, &name)?;
    let series = SeriesFile::read(&bytes, &name)?;
    let frame = |i: usize| match series.frames[i].kind {
        FrameCoding::Missing => Ok(None),
        kind => {
            let bytes = series.frame_bytes(i)?.to_vec();
            Ok(Some(CodedFrame { time: series.frames[i].time, keyframe: kind == FrameCoding::Keyframe, bytes }))
        }
    };
    let frames = || (0..series.frames.len()).map(frame).collect::<Result<Vec<_>>>();
    (series.recipe == recipe).then(frames).transpose()
}

/// The place that a frame is read from.
struct FrameSource {
    path: PathBuf,
    frame: Option<i64>,
}

impl FrameSource {
    fn name(&self) -> String {
        match self.frame {
            Some(frame) => format!("frame {frame} of {}", self.path.display()),
            None => self.path.display().to_string(),
        }
    }
}

/// Particles of a frame, and their fields where some are stored.
struct FrameParticles {
    /// Its name in errors.
    source: String,
    particles: Particles,
    fields: Vec<LayerFields>,
}

/// A series that is being made.
struct SeriesWork<'a> {
    choice: &'a Choice,
    options: &'a SeriesOptions,
    compress: Options,
    aligner: Option<Aligner>,
    builder: SeriesBuilder,
    raw_bytes: u64,
    name: String,
    context: &'a Context<'a>,
}

impl<'a> SeriesWork<'a> {
    fn new(choice: &'a Choice, output: &Path, options: &'a SeriesOptions, context: &'a Context<'a>) -> Result<Self> {
        let mut compress = options.compress.clone();
        compress.read.extend(choice.options());
        // Aligned particles are others, and the recipe must say so.
        compress.read.extend(options.align.iter().map(|text| ("align".to_string(), text.clone())));
        if compress.memory.is_some() {
            compress.storage = Storage::Disk(output::scratch_folder(output));
        }
        let aligner = options.align.as_deref().map(|text| Aligner::new(text, choice)).transpose()?;
        let builder = SeriesBuilder::new(compress.clone(), options.keyframe_interval, options.certify_changes)?;
        Ok(SeriesWork { choice, options, compress, aligner, builder, raw_bytes: 0, name: name_of(output), context })
    }

    /// Text of all options that decide the bytes of a frame.
    fn recipe(&self) -> String {
        let Options { certificate, memory, blocks, .. } = &self.compress;
        // Blocks follow from the particles of each frame, so their options stand below instead of a number.
        let mut recipe = json!({
            "model": self.compress.recipe(1), "keyframe_interval": self.options.keyframe_interval,
        });
        // Keyframes alone have a name of their own: earlier versions look for what `certificate` says in every frame.
        let in_all = self.options.certify_changes || !certificate.measures();
        recipe[if in_all { "certificate" } else { "keyframe_certificate" }] = certificate.name().into();
        if self.options.frames.is_some() {
            // Without the range, so that a longer one goes on with the same series.
            recipe["trajectory"] = true.into();
        }
        if memory.is_some() || blocks.is_some() {
            recipe["blocks"] = json!({ "memory": memory, "number": blocks });
        }
        recipe.to_string()
    }

    fn sources(&self, snapshots: &[PathBuf]) -> Result<Vec<FrameSource>> {
        let Some(FrameRange { first, end, step }) = self.options.frames.map(FrameRange::check).transpose()? else {
            let paths = run_snapshots(snapshots, self.choice, self.context)?;
            return Ok(paths.into_iter().map(|path| FrameSource { path, frame: self.choice.frame }).collect());
        };
        let [path] = snapshots else {
            return Err(Error::argument("frames are chosen from one trajectory, but there are several inputs"));
        };
        let frames = (first..end).step_by(step as usize);
        Ok(frames.map(|frame| FrameSource { path: path.clone(), frame: Some(frame) }).collect())
    }

    fn read(&self, source: &FrameSource) -> Result<FrameParticles> {
        let mut choice = Choice { frame: source.frame, ..self.choice.clone() };
        let path = std::slice::from_ref(&source.path);
        let Options { fields, storage, .. } = &self.compress;
        let (particles, fields) = match fields.is_empty() {
            true => (choice.read(path, storage, self.context)?, Vec::new()),
            false => choice.read_fields(path, storage, self.context)?,
        };
        Ok(FrameParticles { source: source.name(), particles, fields })
    }

    fn aligned(&mut self, source: &FrameSource, read: FrameParticles) -> Result<FrameParticles> {
        let Some(aligner) = &mut self.aligner else { return Ok(read) };
        let particles = aligner.aligned(source, read.particles, self.context)?;
        Ok(FrameParticles { particles, ..read })
    }

    /// The fields of a frame that are stored.
    fn fields<'b>(&self, read: &'b FrameParticles) -> Result<Option<FieldSelection<'b>>> {
        let Options { fields, star_forming, .. } = &self.compress;
        if fields.is_empty() {
            return Ok(None);
        }
        let FrameParticles { source, particles, fields: sources } = read;
        let chosen = FieldSelection::new(fields, *star_forming, particles, sources, self.compress.law());
        let chosen = chosen.map_err(|e| e.at(source))?;
        let is_turned = |kind: QuantityKind| kind == QuantityKind::Vector && self.aligner.is_some();
        if let Some(vector) = chosen.quantities().iter().find(|q| is_turned(q.kind)) {
            let message = format!("align turns positions, but not vectors such as the field `{}`", vector.name);
            return Err(Error::argument_with(format!("{source}: {message}"), "leave the field out, or do not align"));
        }
        chosen.hashed().map(Some)
    }

    fn place(&self, number: usize) -> String {
        format!("{}, frame {number}", self.name)
    }

    /// Goes on behind a frame whose snapshot cannot be read, as it is; `None` where there is no such frame.
    fn keep_unread(&mut self, number: usize, frame: Option<CodedFrame>, error: &Error) -> Result<Option<CodedFrame>> {
        let outcome = if frame.is_some() { "is kept as it was" } else { "is missing" };
        self.context.warn(&format!("frame {number} {outcome}: {error}"));
        // The first frame gives the atoms that all others are turned onto.
        if frame.is_some() && self.aligner.as_ref().is_some_and(|a| a.first.is_none()) {
            let message = format!("frame {number} cannot be read, and align needs the first frame: {error}");
            return Err(Error::argument_with(message, "bring its snapshot back"));
        }
        if let Some(frame) = &frame {
            let tracked = self.builder.decode(frame, &self.place(number), self.context)?;
            self.raw_bytes += tracked.clone().into_model().raw_bytes();
            self.builder.resume(frame, tracked);
        }
        Ok(frame)
    }

    /// Goes on behind a frame that was made before, where it was made from these particles; `None` where it is
    /// replaced.
    fn keep(&mut self, number: usize, read: &FrameParticles, frame: CodedFrame) -> Result<Option<CodedFrame>> {
        let place = self.place(number);
        let tracked = self.builder.decode(&frame, &place, self.context)?;
        let model = tracked.clone().into_model();
        match self.difference(read, &model)? {
            None => {
                self.raw_bytes += model.raw_bytes();
                self.builder.resume(&frame, tracked);
                Ok(Some(frame))
            }
            Some(_) if self.options.replace => Ok(None),
            Some(difference) => {
                let message = format!("{place} was made from another snapshot than {}: {difference}", read.source);
                Err(Error::argument_with(message, Hint::from("replace the series with ").option("force", "")))
            }
        }
    }

    /// The first difference of particles from those that a model was made from.
    fn difference(&self, read: &FrameParticles, model: &Model) -> Result<Option<String>> {
        if let [[name, stored, now], ..] = &differences_from(&read.particles, model, false)[..] {
            return Ok(Some(format!("its {name} was {stored} and is {now} now")));
        }
        if model.metadata.source_hash != read.particles.source_hash() {
            return Ok(Some("its particles differ".into()));
        }
        let fields = self.fields(read)?;
        Ok(match (model.metadata.fields_hash, fields.as_ref().and_then(FieldSelection::hash)) {
            (stored, now) if stored == now => None,
            (None, _) => Some("an earlier version made it and kept no record of its fields".into()),
            _ => Some("the values of its fields differ".into()),
        })
    }

    /// Makes a frame.
    fn make(&mut self, number: usize, read: &FrameParticles) -> Result<CodedFrame> {
        let start = Instant::now();
        let fields = self.fields(read)?;
        let added = self.builder.add(number, &read.particles, fields.as_ref(), self.context)?;
        added.notes.iter().for_each(|note| self.context.note(note));
        self.raw_bytes += added.model.raw_bytes();
        let CodedFrame { time, keyframe, bytes } = &added.coded;
        let kind = if *keyframe { "keyframe" } else { "changes" };
        let score = added.model.certificate.as_ref().and_then(Certificate::mean_psnr);
        let score = score.map_or(String::new(), |score| format!(", {score:.2} dB"));
        let (clock, gaussians) = (self.builder.clock().name(), added.model.gaussians());
        self.context.message(&format!(
            "frame {number} ({clock} {time:.5}): {kind}, {gaussians} Gaussians, {} bytes, {:.2} per Gaussian{score}, \
             {:.1} s",
            bytes.len(),
            bytes.len() as f64 / gaussians.max(1) as f64,
            start.elapsed().as_secs_f64(),
        ));
        Ok(added.coded)
    }
}

/// Turns frames onto the first.
struct Aligner {
    /// The atoms that are put onto those of the first frame.
    chosen: Choice,
    /// These, and their ids, where the file has any.
    first: Option<(Alignment, Option<Vec<u64>>)>,
}

impl Aligner {
    fn new(text: &str, choice: &Choice) -> Result<Aligner> {
        let select = AtomSelection::parse(text).map_err(|e| Error::argument(format!("align: {e}")))?;
        // The atoms to align by are taken from all, whichever are compressed.
        let chosen = Choice { select: Some(select), species: Vec::new(), selection: None, ..choice.clone() };
        Ok(Aligner { chosen, first: None })
    }

    fn aligned(&mut self, source: &FrameSource, all: Particles, context: &Context<'_>) -> Result<Particles> {
        let paths = std::slice::from_ref(&source.path);
        let mut choice = Choice { frame: source.frame, ..self.chosen.clone() };
        let (chosen, fields) = choice.read_fields(paths, &Storage::Memory, context)?;
        let ids = ids(&chosen, &fields)?;
        if self.first.is_none() {
            self.first = Some((Alignment::new(&chosen)?, ids.clone()));
            context.note("aligned frames have no periodic box");
        }
        let Some((alignment, first)) = &self.first else { return Ok(all) };
        if ids != *first {
            let message = "its atoms are in another order than those of the first frame, by which it is aligned";
            return Err(Error::input_with(source.name(), message, "sort the atoms of each frame by their ids"));
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

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::codec::{self, SeriesDecoder};
    use particlegs_core::model::CertificateLevel;

    /// Snapshots of 300 particles that drift, each with its time.
    fn snapshots(folder: &Path, number: usize) -> Vec<PathBuf> {
        let snapshot = |n: usize| {
            let row = |i: usize| {
                let place = |k: usize| ((i * (k + 3) * 7919) % 1000) as f64 / 100.0;
                format!("A {:.3} {:.3} {:.3} {}\n", (place(0) + 0.1 * n as f64) % 10.0, place(1), place(2), i % 7)
            };
            let head = r#"Lattice="10 0 0 0 10 0 0 0 10" Properties=species:S:1:pos:R:3:heat:R:1"#;
            let path = folder.join(format!("snap_{n}.xyz"));
            let rows: String = (0..300).map(row).collect();
            std::fs::write(&path, format!("300\n{head} Time={n}\n{rows}")).unwrap();
            path
        };
        (0..number).map(snapshot).collect()
    }

    fn options(gaussians: u64) -> SeriesOptions {
        let compress = Options { certificate: CertificateLevel::None, ..Options::gaussians(gaussians) };
        SeriesOptions { compress, ..SeriesOptions::default() }
    }

    #[test]
    fn a_series_that_goes_on_is_the_series_made_at_once() {
        let dir = tempfile::tempdir().unwrap();
        let (all, context) = (snapshots(dir.path(), 3), Context::default());
        let make = |snapshots: &[PathBuf], name: &str| {
            let output = dir.path().join(name);
            let options = SeriesOptions { keyframe_interval: 2, ..options(5) };
            let result = make_series(snapshots, &Choice::default(), &output, &options, &context).unwrap();
            (result, std::fs::read(output).unwrap())
        };
        make(&all[..2], "run.pgs");
        let (result, bytes) = make(&all, "run.pgs");
        let keyframes: Vec<bool> = result.frames.iter().map(|f| f.keyframe).collect();
        let expected = (vec![true, false, true], Vec::new(), bytes.len());
        assert_eq!((keyframes, result.missing, result.series_bytes), expected);
        assert!(bytes == make(&all, "whole.pgs").1);
    }

    #[test]
    fn a_series_is_replaced_only_where_that_is_asked_for() {
        let dir = tempfile::tempdir().unwrap();
        let (all, output) = (snapshots(dir.path(), 1), dir.path().join("run.pgs"));
        let make = |options: &SeriesOptions| {
            make_series(&all, &Choice::default(), &output, options, &Context::default()).map(|r| r.frames.len())
        };
        make(&options(5)).unwrap();
        assert!(matches!(make(&options(6)), Err(Error::Output { .. })));
        assert_eq!(make(&SeriesOptions { replace: true, ..options(6) }).unwrap(), 1);
        assert!(matches!(make(&SeriesOptions { keyframe_interval: 0, ..options(6) }), Err(Error::Argument { .. })));
        let frames = Some(FrameRange { first: 0, end: 5, step: 0 });
        let refused = make(&SeriesOptions { frames, replace: true, ..options(6) });
        assert!(matches!(refused, Err(Error::Argument { .. })));
    }

    #[test]
    fn frames_have_the_fields_that_are_named() {
        let dir = tempfile::tempdir().unwrap();
        let (all, output) = (snapshots(dir.path(), 2), dir.path().join("run.pgs"));
        let compress = Options { fields: vec!["heat".into()], ..options(5).compress };
        let options = SeriesOptions { compress, ..SeriesOptions::default() };
        make_series(&all, &Choice::default(), &output, &options, &Context::default()).unwrap();
        let bytes = std::fs::read(output).unwrap();
        let mut decoder = SeriesDecoder::of(SeriesFile::read(&bytes, "run.pgs").unwrap());
        for number in 0..2 {
            let frame = decoder.extract(number, &Context::default()).unwrap();
            assert_eq!(codec::read_metadata(&frame, "frame").unwrap().fields[0].name, "heat", "frame {number}");
        }
    }

    #[test]
    fn ranges_of_frames_are_read_from_text() {
        let range = |first, end, step| FrameRange { first, end, step };
        assert_eq!("0:10".parse::<FrameRange>().unwrap(), range(0, 10, 1));
        assert_eq!("5:100:10".parse::<FrameRange>().unwrap(), range(5, 100, 10));
        for text in ["", "5", "a:b", "-1:5", "5:5", "0:10:0", "0:10:1:2", "0:99999999999"] {
            assert!(text.parse::<FrameRange>().is_err(), "{text}");
        }
    }
}
