//! A picture in grey levels or in colours.

use particlegs_core::picture::{Gray8, Rgb8, Size};

/// A picture, top row first.
#[derive(Clone, Debug, PartialEq)]
pub enum FigureImage {
    Gray(Gray8),
    Color(Rgb8),
}

impl FigureImage {
    /// Pixels across and down.
    pub fn size(&self) -> Size {
        match self {
            FigureImage::Gray(g) => g.size,
            FigureImage::Color(c) => c.size,
        }
    }

    /// Its bytes: one a pixel, or three.
    pub fn bytes(&self) -> &[u8] {
        match self {
            FigureImage::Gray(g) => &g.data,
            FigureImage::Color(c) => c.data.as_flattened(),
        }
    }

    pub fn channels(&self) -> usize {
        match self {
            FigureImage::Gray(_) => 1,
            FigureImage::Color(_) => 3,
        }
    }

    pub fn pixel(&self, x: usize, y: usize) -> [u8; 3] {
        let at = y * self.size().width + x;
        match self {
            FigureImage::Gray(g) => [g.data[at]; 3],
            FigureImage::Color(c) => c.data[at],
        }
    }

    /// Black for white and white for black: dark ink on a white ground.
    pub fn inverted(mut self) -> Self {
        match &mut self {
            FigureImage::Gray(g) => g.data.iter_mut().for_each(|v| *v = 255 - *v),
            FigureImage::Color(c) => c.data.as_flattened_mut().iter_mut().for_each(|v| *v = 255 - *v),
        }
        self
    }
}
