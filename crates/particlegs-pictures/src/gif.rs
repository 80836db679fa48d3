//! Frames of an animated GIF, each with its own palette, exact up to 256 colours.

use ::gif::{Encoder, Frame, Repeat};
use particlegs_core::{Error, Result};
use particlegs_figure::FigureImage;
use particlegs_files::output::write_atomic;
use std::borrow::Cow;
use std::collections::HashMap;
use std::io::Write;
use std::ops::Range;
use std::path::Path;

/// An encoded frame.
pub struct GifFrame(Frame<'static>);

/// Most colours of a frame.
const COLOURS: usize = 256;
/// Most colours that are told apart before a palette is chosen: of more, those of 6 bits for each of red, green and blue.
const MANY: usize = 1 << 15;
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
        FigureImage::Color(colours) => {
            let (buffer, palette) = indexed(&colours.data);
            Frame { width, height, buffer: Cow::Owned(buffer), palette: Some(palette), ..Frame::default() }
        }
    };
    // In hundredths of a second, rounded to the nearest.
    frame.delay = ((100 + fps / 2) / fps.max(1)).clamp(SHORTEST.into(), 100) as u16;
    frame.make_lzw_pre_encoded();
    Ok(GifFrame(frame))
}

/// A colour that pixels have, and the root of their number: few pixels of a colour bar count beside a picture.
struct PixelColour {
    /// By which it is found.
    key: [u8; 3],
    value: [f64; 3],
    weight: f64,
}

/// Colours that share an entry of the palette.
struct ColourBox {
    range: Range<usize>,
    mean: [f64; 3],
    /// The channel in which they vary most: 0 is red, 1 green, 2 blue.
    axis: usize,
    /// Weighted sum of the squared deviations from the mean in it.
    error: f64,
}

impl ColourBox {
    fn new(colours: &[PixelColour], range: Range<usize>) -> ColourBox {
        let members = &colours[range.clone()];
        let total: f64 = members.iter().map(|c| c.weight).sum();
        let mean = [0, 1, 2].map(|k| members.iter().map(|c| c.weight * c.value[k]).sum::<f64>() / total);
        let errors = [0, 1, 2].map(|k| members.iter().map(|c| c.weight * (c.value[k] - mean[k]).powi(2)).sum::<f64>());
        let axis = (0..3).fold(0, |a, k| if errors[k] > errors[a] { k } else { a });
        ColourBox { range, mean, axis, error: errors[axis] }
    }
}

/// Palette indices of the pixels, and the palette: exact up to [`COLOURS`]; else boxes of colours, of which the one that
/// varies most is cut at its mean.
fn indexed(pixels: &[[u8; 3]]) -> (Vec<u8>, Vec<u8>) {
    let mut colours = distinct(pixels, 0xff);
    let mask = if colours.len() > MANY { 0xfc } else { 0xff };
    if mask != 0xff {
        colours = distinct(pixels, mask);
    }
    let mut boxes = vec![ColourBox::new(&colours, 0..colours.len())];
    while boxes.len() < COLOURS {
        let widest = (0..boxes.len()).fold(0, |a, i| if boxes[i].error > boxes[a].error { i } else { a });
        let ColourBox { range, mean, axis, error } = &boxes[widest];
        // Rounding leaves some to boxes of one colour.
        if *error < 1e-6 {
            break;
        }
        let (range, mean, axis) = (range.clone(), mean[*axis], *axis);
        let members = &mut colours[range.clone()];
        members.sort_by(|a, b| a.value[axis].total_cmp(&b.value[axis]));
        let cut = range.start + members.partition_point(|c| c.value[axis] <= mean);
        boxes[widest] = ColourBox::new(&colours, range.start..cut);
        boxes.push(ColourBox::new(&colours, cut..range.end));
    }
    let number =
        boxes.iter().enumerate().flat_map(|(i, b)| colours[b.range.clone()].iter().map(move |c| (c.key, i as u8)));
    let number: HashMap<[u8; 3], u8> = number.collect();
    // A page stays white although the edges of letters are nearly so.
    let entry = |b: &ColourBox| {
        let members = &colours[b.range.clone()];
        let most = members.iter().find(|c| c.weight > 0.5 * members.iter().map(|c| c.weight).sum::<f64>());
        most.map_or(b.mean, |c| c.value).map(|v| v.round() as u8)
    };
    let palette = boxes.iter().flat_map(entry).collect();
    (pixels.iter().map(|p| number[&p.map(|v| v & mask)]).collect(), palette)
}

/// The colours of the pixels that differ in the bits of `mask`, in order.
fn distinct(pixels: &[[u8; 3]], mask: u8) -> Vec<PixelColour> {
    let mut sums: HashMap<[u8; 3], [u64; 4]> = HashMap::new();
    for p in pixels {
        let sum = sums.entry(p.map(|v| v & mask)).or_default();
        *sum = [sum[0] + u64::from(p[0]), sum[1] + u64::from(p[1]), sum[2] + u64::from(p[2]), sum[3] + 1];
    }
    let colour = |(key, [r, g, b, n]): ([u8; 3], [u64; 4])| {
        let value = [r, g, b].map(|v| v as f64 / n as f64);
        PixelColour { key, value, weight: (n as f64).sqrt() }
    };
    let mut all: Vec<PixelColour> = sums.into_iter().map(colour).collect();
    all.sort_unstable_by_key(|c| c.key);
    all
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
    use particlegs_core::picture::{Gray8, Rgb8, Size};

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

    /// Those of a colour bar as well, which few pixels have.
    #[test]
    fn many_colours_are_approximated() {
        let shade = |i: u64| [(i % 256) as u8, (i / 7 % 256) as u8, (i / 90 % 16) as u8];
        let mut pixels: Vec<[u8; 3]> = (0..60_000).map(|i| shade(i % 900)).collect();
        pixels.extend((0..256u64).map(|i| [i as u8, 200, 100]));
        let worst = |pixels: &[[u8; 3]]| {
            let (numbers, palette) = indexed(pixels);
            assert!(palette.len() <= 3 * COLOURS);
            let off = |(n, p): (&u8, &[u8; 3])| (0..3).map(|k| palette[3 * usize::from(*n) + k].abs_diff(p[k])).max();
            numbers.iter().zip(pixels).filter_map(off).max().unwrap()
        };
        assert!(worst(&pixels) <= 10, "{}", worst(&pixels));
        // As many as a photograph has.
        let many: Vec<[u8; 3]> = (0..80_000u64).map(|i| [(i % 256) as u8, (i / 256) as u8, (i % 7) as u8]).collect();
        assert!(worst(&many) <= 24, "{}", worst(&many));
    }
}
