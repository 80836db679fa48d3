//! A picture in grey levels or in colours.

use particlegs::picture::{Gray8, Rgb8, Size};

/// A picture, top row first.
#[derive(Clone, Debug, PartialEq)]
pub enum Image {
    /// Grey levels.
    Gray(Gray8),
    /// Colours.
    Color(Rgb8),
}

impl Image {
    /// Pixels across and down.
    pub fn size(&self) -> Size {
        match self {
            Image::Gray(g) => g.size,
            Image::Color(c) => c.size,
        }
    }

    /// Its bytes: one a pixel, or three.
    pub fn bytes(&self) -> &[u8] {
        match self {
            Image::Gray(g) => &g.data,
            Image::Color(c) => c.data.as_flattened(),
        }
    }

    /// Bytes a pixel.
    pub fn channels(&self) -> usize {
        match self {
            Image::Gray(_) => 1,
            Image::Color(_) => 3,
        }
    }

    /// The colour of a pixel.
    pub fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let at = y * self.size().width + x;
        match self {
            Image::Gray(g) => [g.data[at]; 3],
            Image::Color(c) => c.data[at],
        }
    }

    /// Black for white and white for black: dark ink on a white ground.
    pub fn inverted(mut self) -> Self {
        match &mut self {
            Image::Gray(g) => g.data.iter_mut().for_each(|v| *v = 255 - *v),
            Image::Color(c) => c.data.as_flattened_mut().iter_mut().for_each(|v| *v = 255 - *v),
        }
        self
    }
}
