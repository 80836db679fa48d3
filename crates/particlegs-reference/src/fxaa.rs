//! FXAA as VTK runs it with ParaView's settings, on the 8-bit picture (docs/law/fxaa.md,
//! "The filter"). Luminosities are float32 table entries: their roundings decide ties.

use particlegs_core::parallel;
use particlegs_core::picture::Gray8;

const RELATIVE_THRESHOLD: f32 = 0.125;
const HARD_THRESHOLD: f32 = 0.045;
/// A range of so many levels is below [`HARD_THRESHOLD`], 11.5 levels, however luminosities are rounded.
const FLAT: u8 = 11;
const BLEND_LIMIT: f32 = 0.75;
const SUBPIXEL_THRESHOLD: f32 = 0.25;
const SEARCH_STEPS: i32 = 12;

/// A texel as a shader reads it, and its luminosity in Mesa's order of additions.
struct Tables {
    value: [f32; 256],
    luminosity: [f32; 256],
}

impl Tables {
    fn new() -> Self {
        let value: [f32; 256] = std::array::from_fn(|k| k as f32 * (1.0 / 255.0));
        Tables { value, luminosity: value.map(|k| ((k * 0.114) + (k * 0.587)) + (k * 0.299)) }
    }
}

/// The picture after FXAA, as VTK's fragment shader computes it (docs/law/fxaa.md).
pub fn fxaa(picture: &Gray8) -> Gray8 {
    let tables = Tables::new();
    let image = FxaaImage { picture, tables: &tables };
    let width = picture.size.width;
    let mut data = vec![0u8; picture.data.len()];
    parallel::for_each_chunk(&mut data, width.max(1), |row, out| {
        for (x, level) in out.iter_mut().enumerate() {
            *level = match image.flat(x, row) {
                Some(unchanged) => unchanged,
                None => image.filtered(x as i32, row as i32),
            };
        }
    });
    Gray8 { size: picture.size, data }
}

/// An edge, as seen from a pixel that lies on it.
struct Edge {
    /// Column and row.
    pixel: [i32; 2],
    /// The step to the other side.
    across: [i32; 2],
    /// The pixel's luminosity.
    own: f32,
    other: f32,
}

struct FxaaImage<'a> {
    picture: &'a Gray8,
    tables: &'a Tables,
}

impl FxaaImage<'_> {
    fn level(&self, x: i32, y: i32) -> u8 {
        let (w, h) = (self.picture.size.width, self.picture.size.height);
        let (x, y) = (x.clamp(0, w as i32 - 1) as usize, y.clamp(0, h as i32 - 1) as usize);
        self.picture.data[y * w + x]
    }

    /// The level of a pixel that differs so little from its four neighbours that nothing is done: luminosities rise with
    /// levels, and no range of [`FLAT`] levels reaches the threshold.
    #[inline]
    fn flat(&self, x: usize, y: usize) -> Option<u8> {
        let (w, h, d) = (self.picture.size.width, self.picture.size.height, &self.picture.data);
        if x == 0 || y == 0 || x + 1 >= w || y + 1 >= h {
            return None;
        }
        let at = y * w + x;
        let five = [d[at], d[at - 1], d[at + 1], d[at - w], d[at + w]];
        let (least, most) = five.iter().fold((u8::MAX, 0), |(lo, hi), &v| (v.min(lo), v.max(hi)));
        (most - least <= FLAT).then_some(d[at])
    }

    fn lum(&self, x: i32, y: i32) -> f32 {
        self.tables.luminosity[self.level(x, y) as usize]
    }

    /// One pixel. North is the row below (VTK's y points up, the picture's rows go down).
    fn filtered(&self, x: i32, y: i32) -> u8 {
        let c = self.lum(x, y);
        let (n, s, w, e) = (self.lum(x, y + 1), self.lum(x, y - 1), self.lum(x - 1, y), self.lum(x + 1, y));
        let least = c.min(n.min(s).min(w.min(e)));
        let most = c.max(n.max(s).max(w.max(e)));
        let range = most - least;
        if range < HARD_THRESHOLD.max(RELATIVE_THRESHOLD * most) {
            return self.level(x, y);
        }
        let subpixel = (0.25 * ((n + s) + (w + e)) - c).abs();
        let blend =
            ((subpixel / range - SUBPIXEL_THRESHOLD).max(0.0) * (1.0 / (1.0 - SUBPIXEL_THRESHOLD))).min(BLEND_LIMIT);
        let edge = self.edge(x, y, c, [n, s, w, e]);
        let out = edge + blend * (self.average(x, y) - edge);
        (out.clamp(0.0, 1.0) * 255.0).round_ties_even() as u8
    }

    /// Mean of the 3x3 neighbourhood, in VTK's order.
    fn average(&self, x: i32, y: i32) -> f32 {
        let mut sum = 0.0;
        for dy in [1, 0, -1] {
            for dx in [-1, 0, 1] {
                sum += self.tables.value[self.level(x + dx, y + dy) as usize];
            }
        }
        sum * (1.0 / 9.0)
    }

    /// The pixel's value moved towards the other side of the edge it lies on.
    fn edge(&self, x: i32, y: i32, c: f32, [n, s, w, e]: [f32; 4]) -> f32 {
        let (ne, se) = (self.lum(x + 1, y + 1), self.lum(x + 1, y - 1));
        let (nw, sw) = (self.lum(x - 1, y + 1), self.lum(x - 1, y - 1));
        // Second differences: an edge lies across the direction in which luminosity bends more.
        let bend = |a: f32, mid: f32, b: f32| (-2.0 * mid + (a + b)).abs();
        let vertical = (2.0 * bend(w, c, e) + bend(nw, n, ne)) + bend(sw, s, se);
        let horizontal = (2.0 * bend(n, c, s) + bend(nw, w, sw)) + bend(ne, e, se);
        // The division by 12 rounds: it makes ties, and ties are horizontal.
        let is_horizontal = horizontal / 12.0 >= vertical / 12.0;
        let (first, second) = if is_horizontal { (n, s) } else { (w, e) };
        let towards_second = (c - first).abs() < (c - second).abs();
        let other = if towards_second { second } else { first };
        let side = if towards_second { 1 } else { -1 };
        // Steps along the span and across it; across is upwards in VTK, downwards in rows.
        let (along, across) = if is_horizontal { ([1, 0], [0, -side]) } else { ([0, -1], [side, 0]) };
        let edge = Edge { pixel: [x, y], across, own: c, other };
        let back = self.walk(&edge, [-along[0], -along[1]]);
        let ahead = self.walk(&edge, along);
        let (near, distance) = if back.1 < ahead.1 { back } else { ahead };
        let value = self.tables.value[self.level(x, y) as usize];
        if (near - other).abs() < (near - c).abs() {
            // Half a pixel at the end of the span, and nothing at its middle.
            let shift = 0.5 - distance as f32 / (back.1 + ahead.1) as f32;
            let (from, to) = (self.level(x, y), self.level(x + across[0], y + across[1]));
            // The texture unit's position is upward and rightward.
            return self.tables.value[between(from, to, shift, side > 0) as usize];
        }
        value
    }

    /// The luminosity in the pixel's line where the span of its edge ends in steps of `along`, and how
    /// many steps away that is.
    fn walk(&self, edge: &Edge, along: [i32; 2]) -> (f32, i32) {
        let &Edge { pixel: [x, y], across, own: start, other } = edge;
        let mut here = 0.0;
        for k in 1..=SEARCH_STEPS {
            let (px, py) = (x + k * along[0], y + k * along[1]);
            here = self.lum(px, py);
            let opposite = self.lum(px + across[0], py + across[1]);
            if (opposite - other).abs() > (opposite - start).abs() || (here - start).abs() > (here - other).abs() {
                return (here, k);
            }
        }
        (here, SEARCH_STEPS + 1)
    }
}

/// The texture `shift` of the way from one texel to a neighbour, as the texture unit blends bytes:
/// the way in 1/256, the later texel weighted by it, one rounding.
fn between(from: u8, to: u8, shift: f32, to_is_later: bool) -> u8 {
    let way = (shift * 256.0).round_ties_even() as i32;
    let (first, second, weight) = match (to_is_later, way) {
        (_, 0) => return from,
        (true, _) => (from, to, way),
        (false, _) => (to, from, 256 - way),
    };
    (i32::from(first) + ((weight * (i32::from(second) - i32::from(first)) + 128) >> 8)) as u8
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::picture::psnr;
    use particlegs_files::png::read_png;
    use std::path::Path;

    #[test]
    fn fxaa_makes_vtks_pictures_of_vtks_without() {
        let golden = Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/golden/nbody64");
        for name in ["far_00", "mid_00", "near_00", "near_01", "large_radius", "inside"] {
            let read = |style: &str| read_png(&golden.join(style).join(format!("{name}.png"))).unwrap();
            let d = psnr(&fxaa(&read("paraview-no-fxaa")), &read("paraview"));
            assert!(d.is_none_or(|d| d > 82.0), "{name}: {d:?} dB");
        }
    }
}
