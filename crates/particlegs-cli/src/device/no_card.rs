//! In place of graphics cards, where the program was built without them.

use particlegs::camera::View;
use particlegs::picture::{Gray8, Size};
use particlegs::render::Scene;
use particlegs::space::Bounds;
use particlegs::splat::Look;
use particlegs::{Error, Result};
use std::sync::Arc;

/// There is none.
pub enum Device {}

/// Nothing is drawn on one.
pub struct Pictures(Device);

impl Pictures {
    /// Never called.
    pub fn new(device: &Device, _scene: &Scene) -> Result<Pictures> {
        match *device {}
    }

    /// Never called.
    pub fn draw(&self, _view: &View, _size: Size, _look: Look) -> Result<Gray8> {
        match self.0 {}
    }
}

/// No particles are drawn on one.
pub struct ParticlePictures(Device);

impl ParticlePictures {
    /// Never called.
    pub fn new(device: &Device, _origin: [f64; 3], _bounds: Bounds) -> Result<ParticlePictures> {
        match *device {}
    }

    /// Never called.
    pub fn take(&mut self, _columns: [&[f32]; 3]) -> Result<()> {
        match self.0 {}
    }

    /// Never called.
    pub fn draw(&self, _view: &View, _size: Size, _look: Look) -> Result<Gray8> {
        match self.0 {}
    }
}

fn unsupported() -> Error {
    let what = "this program was built without graphics cards".into();
    Error::Argument { what, remedy: "build it with `cargo build --release -p particlegs-cli --features gpu`".into() }
}

/// Why there is none.
pub fn open(_number: Option<usize>) -> Result<Device> {
    Err(unsupported())
}

/// Never called.
pub fn trainer(device: &Device) -> Result<Arc<dyn particlegs::train::Device>> {
    match *device {}
}

/// A card, as `devices` tells it.
pub struct Adapter {
    pub name: String,
    pub interface: String,
    pub driver: String,
    pub kind: &'static str,
    pub memory: Option<u64>,
    pub largest: [u64; 2],
    pub features: Vec<&'static str>,
}

/// Why there are none.
pub fn list() -> Result<(Vec<Adapter>, Option<String>)> {
    Err(unsupported())
}
