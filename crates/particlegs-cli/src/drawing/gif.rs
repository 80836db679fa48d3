//! Frames of an animated GIF, each with its own palette, exact up to 256 colours.

use crate::figure::FigureImage;
use ::gif::{Encoder, Frame, Repeat};
use particlegs_files::output::write_atomic;
use particlegs_pipeline::{Error, Result};
use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Write;
use std::path::Path;

/// An encoded frame.
pub struct GifFrame(Frame<'static>);

/// Most colours of a frame.
const COLOURS: usize = 256;
/// If the most frequent colours cover this share of the pixels (all but the edges of letters), they are the palette;
/// otherwise a neural network chooses one (Dekker 1994).
const ALMOST_ALL: f64 = 0.97;
/// With more colours than this, the network chooses.
const MANY: usize = 4096;
/// The network learns from one in so many pixels.
const SPEED: i32 = 10;
/// Viewers treat shorter delays as a tenth of a second.
const SHORTEST: u16 = 2;

/// Encodes a picture as a frame with a delay.
pub fn coded(image: FigureImage, fps: u32) -> Result<GifFrame> {
    let size = image.size();
    let (Ok(width), Ok(height)) = (u16::try_from(size.width), u16::try_from(size.height)) else {
        return Err(Error::argument(format!("a GIF of {}x{} pixels is too large", size.width, size.height)));
    };
    let mut frame = match image {
        FigureImage::Gray(gray) => {
            let palette: Vec<u8> = (0..=255).flat_map(|v| [v; 3]).collect();
            Frame { width, height, buffer: Cow::Owned(gray.data), palette: Some(palette), ..Frame::default() }
        }
        FigureImage::Color(colours) => match of_few(&colours.data) {
            Some((buffer, palette)) => {
                Frame { width, height, buffer: Cow::Owned(buffer), palette: Some(palette), ..Frame::default() }
            }
            None => Frame::from_rgb_speed(width, height, colours.data.as_flattened(), SPEED),
        },
    };
    frame.delay = ((100 + fps / 2) / fps.max(1)).clamp(SHORTEST.into(), 100) as u16;
    frame.make_lzw_pre_encoded();
    Ok(GifFrame(frame))
}

/// Palette indices of the pixels; `None` if there are too many colours.
fn of_few(pixels: &[[u8; 3]]) -> Option<(Vec<u8>, Vec<u8>)> {
    let mut counts: HashMap<[u8; 3], u32> = HashMap::new();
    for pixel in pixels {
        *counts.entry(*pixel).or_default() += 1;
        if counts.len() > MANY {
            return None;
        }
    }
    let mut by_count: Vec<([u8; 3], u32)> = counts.into_iter().collect();
    by_count.sort_unstable_by(|a, b| b.1.cmp(&a.1).then(a.0.cmp(&b.0)));
    let kept: u32 = by_count.iter().take(COLOURS).map(|c| c.1).sum();
    if f64::from(kept) < ALMOST_ALL * pixels.len() as f64 {
        return None;
    }
    let palette: Vec<[u8; 3]> = by_count.iter().take(COLOURS).map(|c| c.0).collect();
    let apart = |a: [u8; 3], b: [u8; 3]| (0..3).map(|k| i32::from(a[k]).abs_diff(i32::from(b[k])).pow(2)).sum::<u32>();
    let nearest = |c: [u8; 3]| (0..palette.len()).min_by_key(|i| apart(palette[*i], c)).unwrap_or(0) as u8;
    let number: HashMap<[u8; 3], u8> = by_count.iter().map(|(c, _)| (*c, nearest(*c))).collect();
    Some((pixels.iter().map(|p| number[p]).collect(), palette.into_iter().flatten().collect()))
}

/// Writes frames as one looping GIF.
pub fn write(path: &Path, frames: &[GifFrame]) -> Result<()> {
    let Some(GifFrame(first)) = frames.first() else { return Ok(()) };
    write_atomic(path, |to: &mut dyn Write| {
        let fail = |e: ::gif::EncodingError| std::io::Error::other(e);
        let mut encoder = Encoder::new(to, first.width, first.height, &[]).map_err(fail)?;
        encoder.set_repeat(Repeat::Infinite).map_err(fail)?;
        for GifFrame(frame) in frames {
            encoder.write_lzw_pre_encoded_frame(frame).map_err(fail)?;
        }
        Ok(())
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_pipeline::picture::{Gray8, Rgb8, Size};

    /// Read by the crate's own decoder; the end-to-end tests have another's.
    #[test]
    fn few_colours_are_exact() {
        let size = Size { width: 40, height: 9 };
        let gray = Gray8 { size, data: (0..360).map(|i| (i * 7 % 256) as u8).collect() };
        let few = Rgb8 { size, data: (0..360).map(|i| [(i % 200) as u8, 3, 9]).collect() };
        let frames = [FigureImage::Gray(gray.clone()), FigureImage::Color(few.clone())].map(|i| coded(i, 30).unwrap());
        assert_eq!(frames[0].0.delay, 3);
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.gif");
        write(&path, &frames).unwrap();
        let mut options = ::gif::DecodeOptions::new();
        options.set_color_output(::gif::ColorOutput::RGBA);
        let mut decoder = options.read_info(std::fs::File::open(&path).unwrap()).unwrap();
        let mut next = || {
            let frame = decoder.read_next_frame().unwrap().unwrap();
            frame.buffer.chunks_exact(4).map(|p| [p[0], p[1], p[2]]).collect::<Vec<_>>()
        };
        assert_eq!(next(), gray.data.iter().map(|v| [*v; 3]).collect::<Vec<_>>());
        assert_eq!(next(), few.data);
    }

    #[test]
    fn many_colours_are_approximated() {
        let pixels: Vec<[u8; 3]> = (0..2000).map(|i| [(i % 255) as u8, (i / 255) as u8 * 4, 7]).collect();
        assert!(of_few(&pixels).is_none());
        // Few that fill the picture, and some between them.
        let mut mostly: Vec<[u8; 3]> = (0..25_600).map(|i| [(i % 256) as u8, 0, 7]).collect();
        mostly.extend((0..60).map(|i| [4 * i as u8, 3, 7]));
        let (numbers, palette) = of_few(&mostly).unwrap();
        assert_eq!(palette.len(), 3 * COLOURS);
        let far = numbers.iter().zip(&mostly).map(|(n, p)| palette[3 * *n as usize].abs_diff(p[0])).max();
        assert_eq!(far, Some(0));
    }
}
