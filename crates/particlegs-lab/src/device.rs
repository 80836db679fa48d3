//! What draws the pictures of experiments, and takes steps of training: the processor, or what the caller has.

use particlegs::camera::View;
use particlegs::model::Model;
use particlegs::particles::Particles;
use particlegs::picture::{Gray8, Size};
use particlegs::progress::Progress;
use particlegs::reference::Reference;
use particlegs::render::{Scene, draw};
use particlegs::space::Bounds;
use particlegs::splat::ToneStyle;
use particlegs::{Result, train};
use std::fmt::Debug;
use std::sync::Arc;

/// Pictures of one thing as ParaView draws it, antialiased, by view and size.
pub type Draw<'a> = Box<dyn Fn(&View, Size) -> Result<Gray8> + 'a>;

/// What of all particles is drawn.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Style {
    /// ParaView's own picture, shot noise and all.
    Paraview,
    /// Its mean without that noise.
    NoiseFree,
}

/// What draws and trains.
pub trait Device: Debug + Send + Sync {
    /// Its name, which kept pictures, scores and trained models depend on; `None` = the processor, whose are the same
    /// everywhere.
    fn name(&self) -> Option<&str>;

    /// What takes steps of training; `None` = the processor.
    fn trainer(&self) -> Result<Option<Arc<dyn train::Device>>>;

    /// Pictures of particles with these bounds (world units).
    fn particles<'a>(&self, of: &'a Particles, bounds: Bounds, style: Style, p: &'a dyn Progress) -> Result<Draw<'a>>;

    /// Pictures of a model.
    fn model<'a>(&self, of: &'a Model, progress: &'a dyn Progress) -> Result<Draw<'a>>;
}

/// The processor.
#[derive(Clone, Copy, Debug)]
pub struct Processor;

impl Device for Processor {
    fn name(&self) -> Option<&str> {
        None
    }

    fn trainer(&self) -> Result<Option<Arc<dyn train::Device>>> {
        Ok(None)
    }

    fn particles<'a>(&self, of: &'a Particles, bounds: Bounds, style: Style, p: &'a dyn Progress) -> Result<Draw<'a>> {
        let reference = Reference::with_bounds(of, bounds);
        Ok(Box::new(move |view, size| match style {
            Style::Paraview => reference.draw(view, size, ToneStyle::Paraview, p),
            Style::NoiseFree => reference.response(view, size, ToneStyle::Paraview, p),
        }))
    }

    fn model<'a>(&self, of: &'a Model, progress: &'a dyn Progress) -> Result<Draw<'a>> {
        let scene = Scene::new(of);
        Ok(Box::new(move |view, size| draw(&scene, view, size, ToneStyle::Paraview, progress)))
    }
}
