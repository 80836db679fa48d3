//! Snapshots of one run to a series of models. The first frame of a group is a model of its own; the Gaussians of
//! the others are those of the frame before, moved to where they are expected and refined on the frame's particles.
//! If memory is bounded, a frame's blocks are sets of Gaussians with the particles that are likeliest theirs.

mod frame_store;

pub use frame_store::FrameStore;

use crate::held_power::{CountCoding, hold_power};
use crate::{Compression, FieldSelection, MemoryLoad, Options, SharingPolicy, certify};
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::codec::{
    ChangePrecision, ChangeTarget, CodedFrame, CountBalance, FrameStep, SeriesClock, TrackedBlock, TrackedModel,
    is_series,
};
use particlegs_core::context::Context;
use particlegs_core::model::{
    Certificate, CertificateLevel, Effort, LawKind, Mass, Metadata, Mixture, Model, Quantity,
};
use particlegs_core::space::Bounds;
use particlegs_core::{Error, Result, codec};
use particlegs_files::output::Kind;
use particlegs_fit::{FitOptions, MixtureAssignment, TrackedGaussians, TrackingEffort, track_gaussians};
use particlegs_particles::blocks::divide;
use particlegs_particles::{Chunk, Domain, Particles};

/// The file of a series, which does not replace a single model.
pub const SERIES_FILE: Kind = Kind { name: "a series of models", kept: true, is: |_, head| is_series(head) };

/// Frames from one keyframe to the next where nothing is said.
pub const KEYFRAME_INTERVAL: usize = 16;

/// EM iterations at most, and rounds, of a tracked frame. Gain and cost of each are in docs/results/series.md.
const TRACKING: TrackingEffort = TrackingEffort { first_iterations: 16, rounds: 1, iterations: 2 };
const TRACKING_FAST: TrackingEffort = TrackingEffort { first_iterations: 2, rounds: 0, iterations: 0 };

/// Particles of a block over those that it would have if all were equal, at most, in quarters: its memory is reckoned
/// so.
const MOST_UNEQUAL: usize = 6;

/// A series that is being made, frame by frame.
pub struct SeriesBuilder {
    options: Options,
    /// Frames from one keyframe to the next.
    interval: usize,
    /// The certificate of a change.
    level: CertificateLevel,
    clock: Option<SeriesClock>,
    /// The frame before, and how many there are since its keyframe.
    before: Option<TrackedModel>,
    since: usize,
    /// Bytes of the last keyframe without its certificate.
    key_bytes: usize,
}

/// A frame that was added.
pub struct AddedFrame {
    /// To be put into the file.
    pub coded: CodedFrame,
    /// The frame, decoded.
    pub model: Model,
    /// Notes for the user, a sentence each.
    pub notes: Vec<String>,
}

impl SeriesBuilder {
    /// A series whose keyframes are compressed by `options`, one every `interval` frames. `certify_changes`: the frames
    /// between get the options' certificate as well.
    pub fn new(options: Options, interval: usize, certify_changes: bool) -> Result<SeriesBuilder> {
        options.check()?;
        if options.law() == LawKind::AlphaBlend || options.training.is_some() {
            return Err(Error::argument("a series holds optical-depth models that are fitted, not trained"));
        }
        if interval == 0 {
            return Err(Error::argument("there is at least 1 frame from one keyframe to the next"));
        }
        let level = match options.certificate {
            _ if !certify_changes => CertificateLevel::None,
            // Fits of halves say nothing of Gaussians that are tracked.
            CertificateLevel::Full => CertificateLevel::Quick,
            level => level,
        };
        let options = Options { sharing: SharingPolicy::No, ..options };
        Ok(SeriesBuilder { options, interval, level, clock: None, before: None, since: 0, key_bytes: 0 })
    }

    /// Decodes a frame that was made by the same options before, as the next one.
    pub fn decode(&self, frame: &CodedFrame, place: &str, context: &Context<'_>) -> Result<TrackedModel> {
        let CodedFrame { time, keyframe, bytes } = frame;
        match self.before.as_ref().filter(|_| !keyframe) {
            Some(previous_frame) => previous_frame.next(bytes, *time, place),
            None => TrackedModel::keyframe(bytes, *time, place, context),
        }
    }

    /// Goes on behind such a frame, which decodes to `model`.
    pub fn resume(&mut self, frame: &CodedFrame, model: TrackedModel) {
        self.clock.get_or_insert_with(|| SeriesClock::of(&model.metadata));
        if frame.keyframe {
            (self.since, self.key_bytes) = (1, uncertified(&frame.bytes, &model));
        } else {
            self.since += 1;
        }
        self.before = Some(model);
    }

    /// The clock of the series, which its first frame decides.
    pub fn clock(&self) -> SeriesClock {
        self.clock.unwrap_or(SeriesClock::Frame)
    }

    /// Adds frame `number`, with the `fields` of its particles.
    ///
    /// # Errors
    /// [`Error::Bound`]: the fit would take more than the options' memory.
    pub fn add(
        &mut self,
        number: usize,
        particles: &Particles,
        fields: Option<&FieldSelection<'_>>,
        context: &Context<'_>,
    ) -> Result<AddedFrame> {
        let needed = self.blocks_needed(particles)?;
        // A frame has the blocks of its keyframe.
        let before = self.before.as_ref().filter(|_| self.since < self.interval);
        let before = before.filter(|b| needed <= b.metadata.recipe.blocks);
        let blocks = before.map_or(needed, |b| b.metadata.recipe.blocks);
        let options = Options { blocks: Some(blocks), ..self.options.clone() };
        // What is left out where fields are chosen was the user's choice.
        let omitted = if fields.is_some() { &[][..] } else { &particles.meta.fields };
        // Planned for a change as well, which has the metadata and notes of a frame of its own.
        let planned = Compression::of_positions(particles, omitted, &options, context)?;
        let metadata = planned.metadata();
        let clock = *self.clock.get_or_insert_with(|| SeriesClock::of(metadata));
        let name = &particles.meta.name;
        let Some(time) = clock.time(number, metadata).filter(|t| t.is_finite()) else {
            return Err(Error::input(name, format!("the snapshot does not state its {}", clock.name())));
        };
        if let Some(previous_frame) = &self.before {
            let fields = fields.map_or(Vec::new(), |f| f.quantities().to_vec());
            follows(previous_frame, &Metadata { fields, ..metadata.clone() }, (particles, time, clock))?;
        }
        let mut notes = planned.notes().to_vec();
        let tracked = match before {
            Some(before) => self.change(before, (particles, fields), metadata, time, context)?,
            None => None,
        };
        let (keyframe, bytes, next) = match tracked {
            // Changes that save nothing would only make readers decode more frames.
            Some((bytes, next)) if uncertified(&bytes, &next) < self.key_bytes => (false, bytes, next),
            larger => {
                let why = match larger {
                    Some((bytes, next)) => {
                        let bytes = uncertified(&bytes, &next);
                        Some(format!("its changes take {bytes} bytes, and a keyframe {}", self.key_bytes))
                    }
                    None if self.before.is_some() && self.since < self.interval => Some(
                        "it has other particle types or metadata than the frame before, or needs other blocks".into(),
                    ),
                    None => None,
                };
                notes.extend(why.map(|why| format!("frame {number} is a keyframe: {why}")));
                let done = planned.run(&mut NoCheckpoints, context)?;
                let bytes = match fields {
                    Some(fields) => fields.add_to(&done.bytes, &done.model, context)?,
                    None => done.bytes,
                };
                let next = TrackedModel::keyframe(&bytes, time, name, context)?;
                (true, bytes, next)
            }
        };
        let (model, coded) = (next.clone().into_model(), CodedFrame { time, keyframe, bytes });
        self.resume(&coded, next);
        Ok(AddedFrame { coded, model, notes })
    }

    /// The fewest blocks in which a frame is fitted and tracked within the options' memory.
    fn blocks_needed(&self, particles: &Particles) -> Result<u32> {
        let Options { blocks, memory, .. } = self.options;
        let Some(bound) = memory.filter(|_| blocks.is_none()) else { return self.options.blocks_of(particles) };
        let count = particles.len() as u64;
        // Tracking sorts a copy by the number of each particle's Gaussian.
        let load = self.options.load(count, particles.raw_bytes(), 2);
        MemoryLoad { fields: 4 * count, ..load }.blocks_within(bound)
    }

    /// The particles of a layer, each with the block whose Gaussians it is likeliest to have.
    fn divided(&self, particles: Particles, starts: &[Mixture], context: &Context<'_>) -> Result<Vec<Particles>> {
        if starts.len() < 2 {
            return Ok(vec![particles]);
        }
        let (assignment, origin) = (MixtureAssignment::new(starts, context), particles.origin);
        let blocks_of = |chunk: &Chunk<'_>| assignment.mixtures_of(chunk, origin);
        divide(&particles, starts.len(), &blocks_of, &self.options.storage, context)
    }

    /// The file of changes from the frame before, and the frame decoded; `None` if a keyframe is needed. Changes that are
    /// too large are not measured.
    fn change(
        &self,
        before: &TrackedModel,
        (particles, fields): (&Particles, Option<&FieldSelection<'_>>),
        metadata: &Metadata,
        time: f64,
        context: &Context<'_>,
    ) -> Result<Option<(Vec<u8>, TrackedModel)>> {
        let layers = particles.layers();
        let layer_named = |name: &str| layers.iter().find(|l| l.name == name);
        let same = |l: &particlegs_core::model::Layer<_>| {
            layer_named(&l.name).is_some_and(|o| o.mass.is_weighted() == l.mass.is_weighted())
        };
        if layers.len() != before.layers.len() || !before.layers.iter().all(same) {
            return Ok(None);
        }
        let step = FrameStep { cells: [before.metadata.cell, metadata.cell], elapsed: time - before.time };
        let (mut blocks, mut masses, mut sums) = (Vec::new(), Vec::new(), Vec::new());
        for layer in &before.layers {
            let Some(particle_layer) = layer_named(&layer.name) else { return Ok(None) };
            masses.push(Mass::new(particle_layer.mass.is_weighted(), particle_layer.mass.unit()));
            let starts: Vec<Mixture> = layer.content.iter().map(|b| b.expected(&step)).collect();
            let parts = self.divided(particles.of_layer(particle_layer), &starts, context)?;
            for ((block, start), particles) in layer.content.iter().zip(&starts).zip(&parts) {
                // Blocks that have drifted apart would take more memory than was reckoned.
                if particles.is_empty()
                    || particles.len() * parts.len() > MOST_UNEQUAL * particle_layer.content.len() / 4
                {
                    return Ok(None);
                }
                let options = FitOptions {
                    effort: self.options.effort,
                    pixel: crate::near_pixel(&metadata.bounds),
                    seed: self.options.seed,
                    ..FitOptions::new(start.len(), metadata.default_radius)
                };
                let effort = if self.options.effort == Effort::Fast { TRACKING_FAST } else { TRACKING };
                let tracked = track_gaussians(particles, start, &options, effort, context)?;
                let mut coding = ChangeCoding::new(block, tracked, particles, &step);
                sums.push(coding.mass);
                let held = if parts.len() == 1 && self.options.effort != Effort::Fast {
                    let domain = Domain::new(&metadata.bounds, metadata.cell.as_ref());
                    hold_power(&mut coding, (particles, &domain), u64::MAX, context)?
                } else {
                    None
                };
                let bytes = match held {
                    Some(bytes) => bytes,
                    None => coding.encode()?,
                };
                blocks.push((bytes, Vec::new()));
            }
        }
        // In rising order, as the masses of a file's blocks are summed.
        sums.sort_unstable_by(f64::total_cmp);
        let quantities = fields.map_or(Vec::new(), |f| f.quantities().to_vec());
        let fields_hash = fields.and_then(FieldSelection::hash);
        let metadata = Metadata { mass: sums.iter().sum(), fields: quantities, fields_hash, ..metadata.clone() };
        let Some(bytes) = before.change_file(&metadata, &masses, None, &blocks) else { return Ok(None) };
        // Decoded again: fields and certificate are of the Gaussians that readers get.
        let next = before.next(&bytes, time, &particles.meta.name)?;
        let (size, measured) = (bytes.len() as u64, self.level != CertificateLevel::None);
        if fields.is_none() && !measured {
            return Ok(Some((bytes, next)));
        }
        let model = next.clone().into_model();
        if let Some(fields) = fields {
            let previous_field = |at, quantity: &Quantity| before.field_before(&next, at, quantity);
            let coded = fields.sections(&model, &previous_field, context)?;
            blocks.iter_mut().zip(coded).for_each(|(block, sections)| block.1 = sections);
        }
        // What becomes a keyframe is measured as that alone.
        let file = |certificate: Option<&Certificate>| before.change_file(&metadata, &masses, certificate, &blocks);
        let Some(mut bytes) = file(None) else { return Ok(None) };
        if measured && bytes.len() < self.key_bytes {
            let seed = self.options.seed;
            let mut certificate = certify(&model, size, particles, seed, self.level, context)?;
            if let Some(fields) = fields {
                certificate.fields = fields.agreement(&model, seed, context)?;
            }
            let Some(whole) = file(Some(&certificate)) else { return Ok(None) };
            bytes = whole;
        }
        let next = before.next(&bytes, time, &particles.meta.name)?;
        Ok(Some((bytes, next)))
    }
}

/// Gaussians of a frame's share of a block, coded as changes of the frame before.
struct ChangeCoding<'a> {
    previous: &'a TrackedBlock,
    step: &'a FrameStep,
    /// As they are coded, and the counts that they should have.
    tracked: TrackedGaussians,
    counts: Vec<f64>,
    bounds: Bounds,
    count: u64,
    mass: f64,
    /// The frame as decoded last.
    next: Option<TrackedBlock>,
}

impl<'a> ChangeCoding<'a> {
    fn new(
        previous: &'a TrackedBlock,
        tracked: TrackedGaussians,
        particles: &Particles,
        step: &'a FrameStep,
    ) -> ChangeCoding<'a> {
        let counts = tracked.gaussians.count.clone();
        let (bounds, count, mass) = (particles.bounds(), particles.len() as u64, particles.total_mass());
        ChangeCoding { previous, step, tracked, counts, bounds, count, mass, next: None }
    }

    fn encode(&self) -> Result<Vec<u8>> {
        let TrackedGaussians { gaussians, born } = &self.tracked;
        let ChangeCoding { bounds, count, mass, .. } = *self;
        let target = ChangeTarget { gaussians, born, bounds, count, mass };
        self.previous.encode(&target, self.step, &ChangePrecision::default())
    }
}

impl CountCoding for ChangeCoding<'_> {
    fn len(&self) -> usize {
        self.counts.len()
    }

    fn code(&mut self) -> Result<(Vec<u8>, Mixture)> {
        let bytes = self.encode()?;
        let next = self.previous.decode(&bytes, self.step).map_err(Error::argument)?;
        let gaussians = next.block.gaussians.clone();
        self.next = Some(next);
        Ok((bytes, gaussians))
    }

    fn balance(&mut self, balance: &CountBalance<'_>) -> Result<Vec<f64>> {
        let Some(next) = &self.next else { return Err(Error::argument("nothing was coded yet")) };
        let gaussians = (&mut self.tracked.gaussians, &self.counts[..]);
        self.previous.balance_counts(next, gaussians, &ChangePrecision::default(), balance)
    }
}

/// Bytes of a frame's file without its certificate, which says nothing of how well it is coded.
fn uncertified(bytes: &[u8], frame: &TrackedModel) -> usize {
    bytes.len() - frame.certificate.as_ref().map_or(0, codec::certificate_bytes)
}

/// Particle masses of one run differ by less, relative to their size.
const SAME_MASS: f64 = 1e-6;

/// Refuses particles of a frame of such metadata and time that do not belong behind the previous frame.
fn follows(
    previous: &TrackedModel,
    next: &Metadata,
    (particles, time, clock): (&Particles, f64, SeriesClock),
) -> Result<()> {
    let refused = |fault: String| Err(Error::input(&particles.meta.name, fault));
    if time <= previous.time {
        return refused(format!("its {} is {time}, not after {} of the frame before", clock.name(), previous.time));
    }
    if let Some(difference) = previous.metadata.difference_to_next(next) {
        return refused(difference);
    }
    for layer in particles.layers() {
        let Some(same) = previous.layers.iter().find(|l| l.name == layer.name) else { continue };
        let masses = [same.mass, layer.mass];
        let is_same = match masses {
            [Mass::Each(before), Mass::Each(now)] => (before - now).abs() <= SAME_MASS * before,
            [Mass::Weights(_), _] | [_, Mass::Weights(_)] => true,
            [before, now] => before == now,
        };
        if !is_same {
            let [before, now] = masses.map(|m| m.unit().map_or("not stated".into(), |mass| mass.to_string()));
            let named = if layer.name.is_empty() { String::new() } else { format!(" of `{}`", layer.name) };
            return refused(format!("its particle mass{named} is {now}, that of the frame before {before}"));
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::codec::MOST_SUMS;
    use particlegs_measure::stats::PowerTarget;
    use particlegs_particles::Storage;
    use particlegs_particles::testing::{from_points, random_points, sample};

    /// Two species of clouds that drift through a box.
    fn frame(number: usize) -> Particles {
        let place = |i: u64, r: &mut particlegs_core::math::Random| {
            let cloud = (i % 7) as f64;
            let center = [2.0 + cloud + 0.1 * number as f64, 3.0 + (cloud * 2.3) % 5.0, 2.0 + (cloud * 3.7) % 6.0];
            center.map(|c| c + 0.3 * r.normal())
        };
        let species = [("a", 0..2000), ("b", 2000..6000)];
        let layer = |(name, content): (&str, _)| particlegs_core::model::Layer {
            name: name.into(),
            mass: Mass::Unknown,
            content,
        };
        from_points(random_points(6000, 5, place)).with_layers(species.map(layer).to_vec())
    }

    fn series(blocks: u32, storage: Storage) -> Vec<AddedFrame> {
        let certificate = CertificateLevel::None;
        let options = Options { blocks: Some(blocks), storage, certificate, ..Options::gaussians(450) };
        let mut builder = SeriesBuilder::new(options, 4, true).unwrap();
        (0..3).map(|i| builder.add(i, &frame(i), None, &Context::SILENT).unwrap()).collect()
    }

    #[test]
    fn blocks_of_a_frame_keep_their_gaussians_and_share_the_particles() {
        let folder = tempfile::tempdir().unwrap();
        let (one, three) = (series(1, Storage::Memory), series(3, Storage::Memory));
        for (a, b) in three.iter().zip(series(3, Storage::Disk(folder.path().into()))) {
            assert!(a.coded.bytes == b.coded.bytes, "scratch files change nothing");
        }
        let mean = |m: &Model, k: usize| {
            let all = || m.layers.iter().flat_map(|l| &l.content).map(|b| &b.gaussians);
            all().map(|g| (0..g.len()).map(|i| g.count[i] * g.mean[k][i]).sum::<f64>()).sum::<f64>() / 6000.0
        };
        for (number, (one, three)) in one.iter().zip(&three).enumerate() {
            assert_eq!((one.coded.keyframe, three.coded.keyframe), (number == 0, number == 0));
            for layer in &three.model.layers {
                assert_eq!(layer.content.len(), 3);
                let particles = if layer.name == "a" { 2000 } else { 4000 };
                assert_eq!(layer.content.iter().map(|b| b.count).sum::<u64>(), particles);
            }
            // They drift by 0.1 a frame.
            let particles = frame(number);
            let truth = |k: usize| (0..6000).map(|i| particles.position(i)[k]).sum::<f64>() / 6000.0;
            let off = [0, 1, 2].map(|k| [mean(&one.model, k) - truth(k), mean(&three.model, k) - truth(k)]);
            assert!(off.as_flattened().iter().all(|d| d.abs() < 0.08), "frame {number}: {off:?}");
        }
    }

    #[test]
    fn frames_between_keyframes_have_the_power_of_their_particles() {
        let particles = sample();
        let cell = particles.meta.cell.unwrap();
        // Each frame is moved further along a wave.
        let frame = |number: usize| {
            let moved = |at: u64, _: &mut particlegs_core::math::Random| {
                let x = particles.position(at as usize);
                let phase = 2.0 * std::f64::consts::PI * x[1] / cell.vectors[1][1];
                [x[0] + 0.01 * number as f64 * libm::sin(phase) * cell.vectors[0][0], x[1], x[2]]
            };
            let mut frame = from_points(random_points(particles.len(), 5, moved));
            frame.meta.cell = Some(cell);
            frame
        };
        let options = Options { certificate: CertificateLevel::None, ..Options::gaussians(1500) };
        let mut builder = SeriesBuilder::new(options, 4, false).unwrap();
        for number in 0..3 {
            let particles = frame(number);
            let added = builder.add(number, &particles, None, &Context::SILENT).unwrap();
            assert_eq!(added.coded.keyframe, number == 0);
            let domain = Domain::from_particles(&particles);
            let power = PowerTarget::new(&particles, &domain, MOST_SUMS, &Context::SILENT).unwrap().unwrap();
            let mixture = &added.model.layers[0].content[0].gaussians;
            let deviation = power.deviation(mixture, None, &Context::SILENT).unwrap();
            let largest = deviation.of_shell.iter().fold(0.0f64, |largest, d| largest.max(d.abs()));
            assert!(largest < 2e-3, "frame {number}: {largest}");
        }
    }
}
