//! Verification of a file or a series against its snapshot: decided here, reported by the command and by Python.

mod fields;
mod figures;

use crate::{FieldSelection, certify, differences_from, measured_bytes, source_difference};
use fields::FieldComparison;
pub use figures::StatedFigure;
use particlegs_core::codec::{FrameCoding, SeriesDecoder, SeriesFile, TrackedModel};
use particlegs_core::context::Context;
use particlegs_core::model::{Certificate, CertificateLevel, Epoch, Model, Quantity};
use particlegs_core::{Error, Result, codec};
use particlegs_files::model_file::is_of_several;
use particlegs_measure::score::Assessment;
use particlegs_particles::{LayerFields, Particles};

/// A decoded model with facts about its file: of a file, or of a frame of a series.
pub struct StoredModel {
    /// The model.
    pub model: Model,
    /// Its name in errors.
    pub place: String,
    /// Whether it is merged from several snapshots.
    pub of_several: bool,
    bytes: u64,
    /// Bytes of the file that its certificate was measured on.
    measured_bytes: u64,
    /// Of a frame of changes: the frame before it, and itself.
    frames: Option<[TrackedModel; 2]>,
    /// Whether it is a frame of a series that was coded anew.
    extracted: bool,
    /// Notes on fields that it lists and lacks.
    lacking: Vec<String>,
}

/// Results of a model's verification.
#[derive(Clone, Debug, serde::Serialize)]
pub struct Verification {
    /// Bytes of its file, or of its frame in the file.
    pub model_bytes: u64,
    /// Its law.
    pub law: &'static str,
    /// Gaussians.
    pub gaussians: usize,
    /// Particles that they stand for.
    pub particles: u64,
    /// Whether these are as many as the metadata say.
    pub counts_sum_to_particles: bool,
    /// Relative error of the Gaussians' mass.
    pub mass_error: f64,
    /// Whether the snapshot is its source. `None` without a snapshot, and of a merge of several.
    pub source_matches: Option<bool>,
    /// A phrase on its certificate: whether it was measured again.
    pub certificate: &'static str,
    /// Its certificate.
    pub stored: Option<Certificate>,
    /// The same, measured on the snapshot.
    pub measured_again: Option<Certificate>,
    /// Every number of these, and of the model's fields.
    pub figures: Vec<StatedFigure>,
    /// Metadata that differs from the snapshot: name, stored, found.
    pub source_differences: Vec<[String; 3]>,
    /// Impossible values: such a file was altered, or another program wrote it.
    pub contradictions: Vec<String>,
    /// Values that are possible, but not likely.
    pub doubts: Vec<String>,
    /// Uses that the model is good for.
    pub verdict: Vec<Assessment>,
}

impl StoredModel {
    /// A model and the file that it was decoded from.
    ///
    /// # Errors
    /// [`Error::Corrupt`]: its Gaussians do not stand for its particles and mass.
    pub fn new(model: Model, bytes: &[u8], place: &str) -> Result<StoredModel> {
        let info = codec::read_info(bytes, place)?;
        StoredModel {
            of_several: is_of_several(bytes, &model.metadata, place)?,
            measured_bytes: measured_bytes(bytes, &model, place)?,
            bytes: bytes.len() as u64,
            extracted: info.is_extracted(),
            lacking: info.lacking_fields,
            frames: None,
            place: place.into(),
            model,
        }
        .checked()
    }

    /// A frame of a series, as it was decoded when its certificate was measured.
    pub fn of_frame(decoder: &mut SeriesDecoder<'_>, frame: usize, context: &Context<'_>) -> Result<StoredModel> {
        let (place, bytes) = (decoder.series().name(frame), decoder.series().frame_bytes(frame)?.to_vec());
        if decoder.series().frames[frame].kind == FrameCoding::Keyframe {
            return StoredModel::new(decoder.frame(frame, context)?.clone().into_model(), &bytes, &place);
        }
        let measured_bytes = decoder.series().measured_bytes(frame)?;
        // Changes build on the last frame that is there, as frames may be missing.
        let earlier = decoder.series().frames[..frame].iter().rposition(|f| f.kind != FrameCoding::Missing);
        let earlier = decoder.frame(earlier.unwrap_or_default(), context)?.clone();
        let tracked_model = decoder.frame(frame, context)?.clone();
        StoredModel {
            model: tracked_model.clone().into_model(),
            of_several: false,
            measured_bytes,
            bytes: bytes.len() as u64,
            extracted: false,
            lacking: tracked_model.lacking_fields(),
            frames: Some([earlier, tracked_model]),
            place,
        }
        .checked()
    }

    fn checked(self) -> Result<StoredModel> {
        let m = &self.model.metadata;
        let (counts, mass_error) = sums(&self.model);
        if counts != m.count || mass_error.is_nan() || mass_error > 1e-9 {
            let message = format!(
                "its Gaussians stand for {counts} of {} particles, and their mass is off by {mass_error:e}",
                m.count
            );
            return Err(Error::corrupt(&self.place, message));
        }
        Ok(self)
    }

    /// Looks for contradictions, and with a snapshot and the fields of its layers measures again what the file says:
    /// all that a certificate can have if it is to be `full`. Without the layers' fields, those of the model are not
    /// compared. `seed` is that of views where the file has none.
    ///
    /// # Errors
    /// [`Error::Input`]: the snapshot is not the model's source.
    pub fn verify(
        &self,
        snapshot: Option<(&Particles, &[LayerFields])>,
        (full, seed): (bool, u64),
        context: &Context<'_>,
    ) -> Result<Verification> {
        let (model, stored) = (&self.model, self.model.certificate);
        let (particles, mass_error) = sums(model);
        let mut contradictions = stored.map_or_else(Vec::new, |c| figures::contradictions(&c, &model.metadata));
        contradictions.extend(self.lacking.iter().cloned());
        let mut verification = Verification {
            model_bytes: self.bytes,
            law: model.metadata.law.name(),
            gaussians: model.gaussians(),
            particles,
            counts_sum_to_particles: true,
            mass_error,
            source_matches: None,
            certificate: if stored.is_some() { "not measured again" } else { "none in the file" },
            stored,
            measured_again: None,
            figures: Vec::new(),
            source_differences: Vec::new(),
            contradictions,
            doubts: stored.as_ref().map_or_else(Vec::new, figures::doubts),
            verdict: Assessment::unverified(),
        };
        if let Some((particles, sources)) = snapshot {
            check_source(model, self.of_several, particles, &particles.meta.name, &self.place)?;
            verification.source_matches = (!self.of_several).then_some(true);
            self.measure(particles, sources, (full, seed), &mut verification, context)?;
        }
        Ok(verification)
    }

    /// The fields of the snapshot that the model lists.
    fn fields<'a>(&self, particles: &'a Particles, sources: &'a [LayerFields]) -> Result<FieldSelection<'a>> {
        let m = &self.model.metadata;
        let names: Vec<String> = m.fields.iter().map(|q| q.name.clone()).collect();
        let star_forming = m.recipe.read.get("star-forming").and_then(|text| text.parse().ok());
        let fields = FieldSelection::new(&names, star_forming.unwrap_or_default(), particles, sources, m.law);
        let fields = fields.map_err(|e| match e {
            Error::Argument { what, .. } => Error::Differs {
                place: self.place.clone(),
                what: format!("its fields are not those of the snapshot: {what}"),
                hint: "the file was altered, or the snapshot was".into(),
            },
            other => other,
        })?;
        // A part of a merge may be described otherwise than the whole would be.
        let fields = if self.of_several { fields.with_scales(&m.fields) } else { fields };
        if m.fields_hash.is_some() { fields.hashed() } else { Ok(fields) }
    }

    fn measure(
        &self,
        particles: &Particles,
        sources: &[LayerFields],
        (full, seed): (bool, u64),
        verification: &mut Verification,
        context: &Context<'_>,
    ) -> Result<()> {
        let (model, m) = (&self.model, &self.model.metadata);
        let compares_fields = !m.fields.is_empty() && !sources.is_empty();
        let stored = model.certificate.map(|c| Certificate { fields: c.fields.filter(|_| compares_fields), ..c });
        let fields = if compares_fields { Some(self.fields(particles, sources)?) } else { None };
        verification.source_differences = differences_from(particles, model, self.of_several);
        verification.source_differences.extend(fields.iter().flat_map(|f| listed_otherwise(&m.fields, f.quantities())));
        let hashes = m.fields_hash.zip(fields.as_ref().and_then(FieldSelection::hash));
        if let Some((stored, now)) = hashes.filter(|(stored, now)| stored != now) {
            let digits = |hash: [u8; 16]| hash.iter().map(|byte| format!("{byte:02x}")).collect();
            verification.source_differences.push(["hash of the fields' values".into(), digits(stored), digits(now)]);
        }
        if !verification.source_differences.is_empty() {
            return Ok(());
        }
        context.message("this is the snapshot that the file was made from; measuring");
        let seed = stored.map_or(seed, |c| c.views.seed);
        let level = stored.as_ref().map_or(CertificateLevel::Quick, figures::level_of);
        let requested_level = if full { CertificateLevel::Full } else { level };
        let mut measured = certify(model, self.measured_bytes, particles, seed, requested_level, context)?;
        let comparison = match &fields {
            Some(fields) => Some(FieldComparison::new(self, fields, seed, context)?),
            None => None,
        };
        if let Some(comparison) = &comparison {
            verification.figures.extend(comparison.figures.iter().cloned());
            // Models of joined fields have none.
            let has_own = stored.is_none_or(|c| c.fields.is_some() || requested_level != level);
            measured.fields = comparison.gathered.filter(|_| has_own);
        }
        // As a file has it.
        let measured = codec::rounded(&measured);
        if let Some(stored) = &stored {
            let completes = figures::level_of(&measured) != level;
            // Each block's sum is rounded on its own.
            let exact = stored.blocks.is_none() && m.tool_version == env!("CARGO_PKG_VERSION");
            verification.figures.splice(0..0, figures::side_by_side(stored, &measured, completes, exact));
        }
        let judged_certificate = Certificate { fields: comparison.map(|c| c.of_model), ..measured };
        verification.certificate = if stored.is_some() { "measured again" } else { "none in the file; measured now" };
        verification.measured_again = Some(measured);
        verification.verdict = Assessment::verdict(Some(&judged_certificate), m);
        Ok(())
    }
}

/// Fields that a file lists otherwise than the snapshot has them: name, stored, found.
fn listed_otherwise(stored: &[Quantity], snapshot: &[Quantity]) -> Vec<[String; 3]> {
    let describe = |q: Option<&Quantity>| match q {
        None => "absent".to_string(),
        Some(q) => {
            let unit = q.unit.as_ref().map_or("none", |u| &u.text);
            let by = if q.by_mass { "mass" } else { "count" };
            format!("a {}, weighted by {by}, unit {unit}, {} bytes a particle", q.describe_kind(), q.bytes)
        }
    };
    let name = |i: usize| &stored.get(i).or(snapshot.get(i)).expect("one is there").name;
    let differing = (0..stored.len().max(snapshot.len())).filter(|&i| stored.get(i) != snapshot.get(i));
    differing.map(|i| [format!("field `{}`", name(i)), describe(stored.get(i)), describe(snapshot.get(i))]).collect()
}

impl Verification {
    /// [`Error::Differs`], of the model at `place`, if what it says differs from what was measured, or contradicts
    /// itself.
    pub fn judge(&self, place: &str) -> Result<()> {
        let differs = |what: String, hint: &str| Error::Differs { place: place.into(), what, hint: hint.into() };
        let altered = "the file was altered, or another version of the program measured it: do not trust it before you know which";
        if !self.contradictions.is_empty() {
            return Err(differs(format!("it contradicts itself: {}", self.contradictions.join("; ")), altered));
        }
        if let Some([name, stored, present]) = self.source_differences.first() {
            let hint = "give the options that the model was made with (`info` shows them); if they are the same, its metadata was altered";
            return Err(differs(format!("its {name} is {stored} in the file and {present} in the snapshot"), hint));
        }
        let deviations: Vec<&StatedFigure> = self.figures.iter().filter(|f| f.differs).collect();
        let Some(f) = deviations.first() else { return Ok(()) };
        let first = format!("{} is stored as {} and measured as {}", f.name, f.stored, f.measured);
        Err(differs(format!("{} of {} of its values differ: {first}", deviations.len(), self.figures.len()), altered))
    }
}

/// The particles that the Gaussians stand for, and the relative error of their mass.
fn sums(model: &Model) -> (u64, f64) {
    let mut counts = 0u64;
    let mut mass = 0.0;
    for block in model.blocks() {
        let g = &block.gaussians;
        counts += g.count.iter().map(|&c| c as u64).sum::<u64>();
        mass += match g.masses() {
            Some(m) => m.iter().sum::<f64>(),
            None => block.mass,
        };
    }
    (counts, (mass / model.metadata.mass - 1.0).abs())
}

/// Refuses particles that the model was not made from. The error names `snapshot` and the model's `place`.
pub fn check_source(model: &Model, of_several: bool, particles: &Particles, snapshot: &str, place: &str) -> Result<()> {
    let Some(why) = source_difference(particles, model, of_several) else { return Ok(()) };
    Err(Error::input(snapshot, format!("it is not the snapshot that {place} was made from ({why})")))
}

/// Results of the verification of a series' frames.
#[derive(Clone, Debug, serde::Serialize)]
pub struct SeriesVerification {
    /// Frames, with those that are missing.
    pub frames: usize,
    /// Of these, keyframes.
    pub keyframes: usize,
    /// Numbers of those that are there.
    #[serde(skip)]
    pub there: Vec<usize>,
    /// Contradictions, a line each that begins with the number of the frame.
    pub contradictions: Vec<String>,
    /// Hash of the source of each of [`SeriesVerification::there`].
    #[serde(skip)]
    pub hashes: Vec<[u8; 32]>,
    /// The moment of each.
    #[serde(skip)]
    epochs: Vec<Epoch>,
}

impl SeriesVerification {
    /// Decodes every frame.
    ///
    /// # Errors
    /// Those of [`SeriesFile::check`].
    pub fn new(series: &SeriesFile<'_>, context: &Context<'_>) -> Result<SeriesVerification> {
        let frames = series.frames.len();
        let keyframes = series.frames.iter().filter(|f| f.kind == FrameCoding::Keyframe).count();
        let (mut present_frames, mut hashes, mut epochs): (Vec<_>, Vec<_>, Vec<_>) = Default::default();
        let mut contradictions = Vec::new();
        series.check(context, |number, frame| {
            present_frames.push(number);
            hashes.push(frame.metadata.source_hash);
            epochs.push(frame.metadata.epoch);
            let of_certificate = frame.certificate.map(|c| figures::contradictions(&c, &frame.metadata));
            let all = of_certificate.into_iter().flatten().chain(frame.lacking_fields());
            contradictions.extend(all.map(|contradiction| format!("frame {number} of {frames}: {contradiction}")));
            Ok(())
        })?;
        Ok(SeriesVerification { frames, keyframes, there: present_frames, contradictions, hashes, epochs })
    }

    /// The frame that was made of these particles; where several have their places, the one of their moment.
    pub fn frame_of(&self, particles: &Particles) -> Option<usize> {
        let hash = particles.source_hash();
        let alike = || (0..self.there.len()).filter(|&i| self.hashes[i] == hash);
        let of_moment = alike().find(|&i| self.epochs[i] == particles.meta.epoch);
        of_moment.or_else(|| alike().next()).map(|i| self.there[i])
    }

    /// [`Error::Differs`], of the series at `place`, if a frame contradicts itself.
    pub fn judge(&self, place: &str) -> Result<()> {
        if self.contradictions.is_empty() {
            return Ok(());
        }
        Err(Error::Differs {
            place: place.into(),
            what: format!("it contradicts itself: {}", self.contradictions.join("; ")),
            hint: "the series was altered: do not trust it before you know how".into(),
        })
    }
}
