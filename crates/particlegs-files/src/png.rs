//! PNG in and out.

use crate::{input, memory, output};
use particlegs_core::picture::{Gray8, Size};
use particlegs_core::{Error, Result};
use std::path::Path;

/// Pictures larger than this in either direction are refused before memory is taken.
const LARGEST_SIDE: u32 = 65_536;

/// Writes an 8-bit PNG, whole or not at all: [`png_bytes`].
pub fn write_png(path: &Path, size: Size, bytes: &[u8]) -> Result<()> {
    output::write_bytes(path, &png_bytes(size, bytes)?)
}

/// An 8-bit PNG: of grey levels, or of red, green and blue where there are three bytes a pixel (a [`Gray8`]'s `data`,
/// or an [`Rgb8`](particlegs_core::picture::Rgb8)'s `data.as_flattened()`). The top row is first.
pub fn png_bytes(size: Size, bytes: &[u8]) -> Result<Vec<u8>> {
    let color = match bytes.len() {
        n if n == size.pixels() => png::ColorType::Grayscale,
        n if n == 3 * size.pixels() => png::ColorType::Rgb,
        n => return Err(Error::argument(format!("{n} bytes for a picture of {}x{}", size.width, size.height))),
    };
    // No more than the picture, and a little.
    memory::require("writing a picture", bytes.len() as u64 + bytes.len() as u64 / 64)?;
    let mut out = Vec::new();
    let mut encoder = png::Encoder::new(&mut out, size.width as u32, size.height as u32);
    encoder.set_color(color);
    encoder.set_depth(png::BitDepth::Eight);
    // Of pictures the same bytes as the default's in grey, 8 % more in colour, in a fifteenth of the time.
    encoder.set_compression(png::Compression::Fast);
    let written = encoder.write_header().and_then(|mut writer| {
        writer.write_image_data(bytes)?;
        writer.finish()
    });
    written.map_err(|e| Error::argument(format!("a picture cannot be written as PNG: {e}")))?;
    Ok(out)
}

/// Reads a PNG as grey levels. Colour pictures are taken where R = G = B, else by Rec. 601 luma.
pub fn read_png(path: &Path) -> Result<Gray8> {
    let (file, _) = input::open_file(path)?;
    let bad = |e: png::DecodingError| Error::input(path, format!("not a readable PNG: {e}"));
    let mut decoder = png::Decoder::new(std::io::BufReader::new(file));
    decoder.set_transformations(png::Transformations::EXPAND | png::Transformations::STRIP_16);
    let mut reader = decoder.read_info().map_err(bad)?;
    let info = reader.info();
    let (width, height) = (info.width, info.height);
    if width > LARGEST_SIDE || height > LARGEST_SIDE {
        return Err(Error::input(path, format!("a picture of {width} x {height} pixels is too large")));
    }
    let bytes =
        reader.output_buffer_size().ok_or_else(|| Error::input(path, "a picture too large for this machine"))?;
    // As it is decoded, and as grey levels.
    memory::require("a picture", 2 * bytes as u64)?;
    let mut buffer = vec![0; bytes];
    let frame = reader.next_frame(&mut buffer).map_err(bad)?;
    let pixels = &buffer[..frame.buffer_size()];
    let data = match frame.color_type {
        png::ColorType::Grayscale | png::ColorType::Indexed => pixels.to_vec(),
        png::ColorType::GrayscaleAlpha => pixels.chunks_exact(2).map(|p| p[0]).collect(),
        png::ColorType::Rgb => pixels.chunks_exact(3).map(luma).collect(),
        png::ColorType::Rgba => pixels.chunks_exact(4).map(luma).collect(),
    };
    Ok(Gray8 { size: Size { width: width as usize, height: height as usize }, data })
}

fn luma(p: &[u8]) -> u8 {
    if p[0] == p[1] && p[1] == p[2] {
        return p[0];
    }
    // Rounded as Pillow's convert("L") does.
    ((u32::from(p[0]) * 19_595 + u32::from(p[1]) * 38_470 + u32::from(p[2]) * 7_471 + 0x8000) >> 16) as u8
}
