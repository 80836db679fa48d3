//! Pictures as plain arrays, row by row from the top.

/// Width and height in pixels.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
pub struct Size {
    /// Pixels across.
    pub width: usize,
    /// Pixels down.
    pub height: usize,
}

impl Size {
    /// Number of pixels.
    pub fn pixels(&self) -> usize {
        self.width * self.height
    }
}

/// A plane of floats (optical depth, surface density), top row first.
#[derive(Clone, Debug, PartialEq)]
pub struct Plane {
    /// Size in pixels.
    pub size: Size,
    /// `size.pixels()` values.
    pub data: Vec<f32>,
}

impl Plane {
    /// All zero.
    pub fn zeros(size: Size) -> Self {
        Plane { size, data: vec![0.0; size.pixels()] }
    }
}

/// An 8-bit grey picture, top row first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Gray8 {
    /// Size in pixels.
    pub size: Size,
    /// `size.pixels()` levels.
    pub data: Vec<u8>,
}

impl Gray8 {
    /// All black.
    pub fn black(size: Size) -> Self {
        Gray8 { size, data: vec![0; size.pixels()] }
    }
}

/// An 8-bit colour picture, top row first.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Rgb8 {
    /// Size in pixels.
    pub size: Size,
    /// `size.pixels()` triples.
    pub data: Vec<[u8; 3]>,
}
