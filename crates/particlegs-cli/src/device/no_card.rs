//! In place of graphics cards, where the program was built without them.

use particlegs::camera::View;
use particlegs::picture::{Gray8, Plane, Size};
use particlegs::progress::Progress;
use particlegs::render::Scene;
use particlegs::space::Bounds;
use particlegs::splat::Look;
use particlegs::{Error, Result};
use std::marker::PhantomData;
use std::ops::Range;
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

    /// Never called.
    pub fn optical_depth(&self, _view: &View, _size: Size) -> Result<Plane> {
        match self.0 {}
    }
}

/// Positions of a range of particles.
pub type Columns<'a> = Box<dyn Fn(Range<usize>) -> [Vec<f32>; 3] + Send + Sync + 'a>;

/// No particles are drawn on one.
pub struct ParticlePictures<'a>(Device, PhantomData<Columns<'a>>);

impl<'a> ParticlePictures<'a> {
    /// Never called.
    pub fn new(
        device: &Device,
        _origin: [f64; 3],
        _bounds: Bounds,
        _count: usize,
        _columns: Columns<'a>,
    ) -> Result<Self> {
        match *device {}
    }

    /// Never called.
    pub fn keep(&mut self, _device: &Device, _sent: &mut dyn FnMut(u64) -> Result<()>) -> Result<()> {
        match self.0 {}
    }

    /// Never called.
    pub fn draw(&self, _view: &View, _size: Size, _look: Look, _progress: &dyn Progress) -> Result<Gray8> {
        match self.0 {}
    }

    /// Never called.
    pub fn optical_depth(&self, _view: &View, _size: Size, _progress: &dyn Progress) -> Result<Plane> {
        match self.0 {}
    }

    /// Never called.
    pub fn response(&self, _view: &View, _size: Size, _look: Look, _progress: &dyn Progress) -> Result<Gray8> {
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

/// Why there is none.
#[cfg(feature = "lab")]
pub fn open_timed(_number: Option<usize>) -> Result<Device> {
    Err(unsupported())
}

/// Never called.
#[cfg(feature = "lab")]
pub fn name(device: &Device) -> String {
    match *device {}
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
