//! Our program in this process: opening, compressing by phase, decoding, drawing.

use super::TimingViews;
use super::clock::{FrameTimes, Machine, Times, load};
use crate::experiments::rates::COMPARED;
use crate::lab::{Lab, ModelBuild, ModelSettings};
use crate::snapshot::Snapshot;
use particlegs_compress::compress;
use particlegs_core::camera::View;
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::picture::{Gray8, Pixels, Size};
use particlegs_core::render::{Scene, Scratch, draw_into};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Result, codec};
use particlegs_fit::Effort;
use particlegs_formats::Choice;
use particlegs_particles::Storage;
use particlegs_reference::Reference;
use serde::{Deserialize, Serialize};

/// Repetitions of short work.
const TIMES: usize = 5;
/// Repetitions of each picture of a model.
const DRAWN: usize = 3;

#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct Phases {
    /// Phases with their seconds, in order.
    pub phases: Vec<(String, f64)>,
    /// Total seconds.
    pub seconds: f64,
    pub bytes: u64,
    pub gaussians: u64,
    /// Load of the machine at the end.
    pub load: Option<f64>,
}

pub(super) fn recipe(lab: &Lab<'_>, effort: Effort) -> ModelSettings {
    ModelSettings { effort, ..ModelSettings::ratio(COMPARED, lab.settings.seed) }
}

/// Opening, reading and checking the snapshot; `None` if it was read with options.
pub(super) fn opening(lab: &Lab<'_>, snapshot: &Snapshot, machine: &Machine) -> Result<Option<Times>> {
    lab.store.result("timed-opening", &(&snapshot.hash, &snapshot.path, machine), || {
        let choice = Choice::default();
        let read = || choice.read(std::slice::from_ref(&snapshot.path), &Storage::Memory, lab.context);
        // This reading also brings the files into the cache of the system.
        let same = read().ok().is_some_and(|p| p.source_hash() == snapshot.particles.source_hash());
        if same { Times::new(TIMES, read).map(Some) } else { Ok(None) }
    })
}

/// A compression; its model is cached for the other experiments.
pub(super) fn compression(lab: &Lab<'_>, snapshot: &Snapshot, effort: Effort, machine: &Machine) -> Result<Phases> {
    let recipe = recipe(lab, effort);
    lab.store.result("timed-compression", &(&snapshot.hash, &recipe, machine), || {
        let start = std::time::Instant::now();
        let done = compress(&snapshot.particles, &recipe.options(), &mut NoCheckpoints, lab.context)?;
        let seconds = start.elapsed().as_secs_f64();
        let phases = done.seconds.iter().map(|(name, s)| (name.to_string(), *s)).collect();
        let (bytes, gaussians) = (done.bytes.len() as u64, done.model.gaussians() as u64);
        lab.keep(snapshot, &recipe, done, seconds)?;
        Ok(Phases { phases, seconds, bytes, gaussians, load: load() })
    })
}

pub(super) fn decoding(lab: &Lab<'_>, snapshot: &Snapshot, build: &ModelBuild, machine: &Machine) -> Result<Times> {
    let key = (&snapshot.hash, recipe(lab, Effort::Default), machine);
    lab.store.result("timed-decoding", &key, || {
        Times::new(TIMES, || codec::decode_with(&build.bytes, "the model", lab.context))
    })
}

#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub(super) enum RenderSource {
    /// The model, in ParaView's style.
    Model,
    /// All particles, in ParaView's style.
    Paraview,
    /// All particles, noise-free.
    Expected,
}

/// Frames with new cameras, and with new radii and opacities.
#[derive(Clone, Debug, Default, Serialize, Deserialize)]
pub(super) struct FrameTimings {
    pub cameras: FrameTimes,
    pub settings: FrameTimes,
}

/// Frames of one kind of picture. The model's buffers are kept between frames, as the commands do; the renderer of all
/// particles has none.
pub(super) fn frames(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    source: RenderSource,
    build: &ModelBuild,
    shots: &TimingViews,
    machine: &Machine,
) -> Result<FrameTimings> {
    lab.store.result(
        "timed-frames",
        &(&snapshot.hash, source, shots.key(), recipe(lab, Effort::Default), machine),
        || {
            let (scene, mut scratch) = (Scene::new(&build.model), Scratch::default());
            let reference = Reference::new(&snapshot.particles);
            let (times, look) = match source {
                RenderSource::Model => (DRAWN, ToneStyle::Paraview),
                RenderSource::Paraview => (1, ToneStyle::Paraview),
                RenderSource::Expected => (1, ToneStyle::Expected),
            };
            let mut picture = Gray8::black(shots.size);
            let mut draw = |view: &View| match source {
                RenderSource::Model => {
                    let pixels = Pixels::new(shots.size, &mut picture.data)?;
                    draw_into(&scene, view, look, pixels, &mut scratch, lab.context)
                }
                _ => reference.draw(view, shots.size, look, lab.context).map(drop),
            };
            // The first frame allocates memory.
            draw(&shots.first)?;
            Ok(FrameTimings {
                cameras: each(&shots.cameras, times, &mut draw)?,
                settings: each(&shots.settings, times, &mut draw)?,
            })
        },
    )
}

fn each(views: &[View], times: usize, draw: &mut dyn FnMut(&View) -> Result<()>) -> Result<FrameTimes> {
    let views = views.iter().map(|v| Ok(Times::new(times, || draw(v))?.seconds)).collect::<Result<_>>()?;
    Ok(FrameTimes { views, load: load() })
}

/// All particles in the first view by our renderer, to compare with VTK.
pub(super) fn picture(lab: &Lab<'_>, snapshot: &Snapshot, view: &View, size: Size, look: ToneStyle) -> Result<Gray8> {
    let key = ("all particles", &snapshot.hash, crate::views::cache_key(view, size), look.name());
    crate::views::kept_picture(lab, &key, || Reference::new(&snapshot.particles).draw(view, size, look, lab.context))
}
