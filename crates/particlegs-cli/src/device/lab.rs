//! A graphics card that draws and trains for the laboratory.

use super::card::{self, Device, Pictures};
use super::particles::on_card;
use particlegs::camera::View;
use particlegs::model::Model;
use particlegs::particles::Particles;
use particlegs::progress::Progress;
use particlegs::render::Scene;
use particlegs::space::Bounds;
use particlegs::splat::ToneStyle;
use particlegs::{Result, train};
use particlegs_lab::device::{self, Draw, Style};
use std::fmt::{self, Debug, Formatter};
use std::sync::Arc;

/// A card by its name.
pub struct NamedDevice {
    device: Device,
    trainer: Arc<dyn train::Device>,
    name: String,
}

impl NamedDevice {
    pub fn new(device: Device) -> Result<NamedDevice> {
        let (trainer, name) = (card::trainer(&device)?, card::name(&device));
        Ok(NamedDevice { device, trainer, name })
    }
}

impl Debug for NamedDevice {
    fn fmt(&self, f: &mut Formatter<'_>) -> fmt::Result {
        f.write_str(&self.name)
    }
}

impl device::Device for NamedDevice {
    fn name(&self) -> Option<&str> {
        Some(&self.name)
    }

    fn trainer(&self) -> Result<Option<Arc<dyn train::Device>>> {
        Ok(Some(Arc::clone(&self.trainer)))
    }

    fn particles<'a>(&self, of: &'a Particles, bounds: Bounds, style: Style, p: &'a dyn Progress) -> Result<Draw<'a>> {
        let pictures = on_card(&self.device, of, bounds, p)?;
        Ok(Box::new(move |view, size| match style {
            Style::Paraview => pictures.draw(view, size, ToneStyle::Paraview, p),
            Style::NoiseFree => pictures.response(view, size, ToneStyle::Paraview, p),
        }))
    }

    fn model<'a>(&self, of: &'a Model, _progress: &'a dyn Progress) -> Result<Draw<'a>> {
        let pictures = Pictures::new(&self.device, &Scene::new(of))?;
        Ok(Box::new(move |view: &View, size| pictures.draw(view, size, ToneStyle::Paraview)))
    }
}
