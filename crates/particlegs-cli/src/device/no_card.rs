//! In place of graphics cards, where the program was built without them.

use particlegs::camera::View;
use particlegs::picture::{Gray8, Plane, Size};
use particlegs::progress::Progress;
use particlegs::render::Scene;
use particlegs::space::Bounds;
use particlegs::splat::ToneStyle;
use particlegs::{Error, Result};
use std::marker::PhantomData;
use std::ops::Range;
use std::sync::Arc;

/// There is none.
pub enum Device {}

/// Nothing is drawn on one.
pub struct Pictures(Device);

/// No particles are drawn on one.
pub struct ParticlePictures<'a>(Device, PhantomData<Columns<'a>>);

/// Positions of a range of particles.
pub type Columns<'a> = Box<dyn Fn(Range<usize>) -> [Vec<f32>; 3] + Send + Sync + 'a>;

/// Methods of what cannot be: they are never called.
macro_rules! uncalled {
    ($($method:ident($($argument:ty),*) -> $result:ty;)*) => {
        $(pub fn $method(&self, $(_: $argument),*) -> Result<$result> { match self.0 {} })*
    };
}

impl Pictures {
    pub fn new(device: &Device, _: &Scene) -> Result<Self> {
        match *device {}
    }

    uncalled! { draw(&View, Size, ToneStyle) -> Gray8; optical_depth(&View, Size) -> Plane; }
}

impl<'a> ParticlePictures<'a> {
    pub fn new(device: &Device, _: [f64; 3], _: Bounds, _: usize, _: Columns<'a>) -> Result<Self> {
        match *device {}
    }

    pub fn keep(&mut self, _: &Device, _: &mut dyn FnMut(u64) -> Result<()>) -> Result<()> {
        match self.0 {}
    }

    uncalled! {
        draw(&View, Size, ToneStyle, &dyn Progress) -> Gray8;
        response(&View, Size, ToneStyle, &dyn Progress) -> Gray8;
        optical_depth(&View, Size, &dyn Progress) -> Plane;
    }
}

/// Why there is none.
pub fn open<T>(_: Option<usize>) -> Result<T> {
    let what = "this program was built without GPU support";
    let hint = "build it with `cargo build --release -p particlegs-cli --features gpu`";
    Err(Error::argument_with(what, hint))
}

#[cfg(feature = "lab")]
pub use open as open_timed;

#[cfg(feature = "lab")]
pub fn name(device: &Device) -> String {
    match *device {}
}

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
    open(None)
}
