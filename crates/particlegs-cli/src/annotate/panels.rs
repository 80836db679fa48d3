//! Pictures side by side with captions, for looking at truth, model and error at once.

use super::bar::{Bar, INK, colour_bar, letter_height};
use super::text;
use particlegs::picture::{Gray8, Rgb8, Size, diverging};

/// What a panel shows.
pub enum PanelImage<'a> {
    /// Grey levels.
    Gray(&'a Gray8),
    /// Colours.
    Color(&'a Rgb8),
    /// Model minus truth, in grey levels: red where the model is brighter, blue where it is darker.
    Error {
        /// What should be.
        truth: &'a Gray8,
        /// What is.
        model: &'a Gray8,
    },
}

/// Grey level behind the panels.
const GROUND: u8 = 24;

/// Panels from left to right, each under its caption.
pub fn panels(panels: &[(&str, PanelImage)]) -> Rgb8 {
    let pictures: Vec<Rgb8> = panels.iter().map(|(_, image)| image.colours()).collect();
    let largest = pictures.iter().map(|p| p.size).max_by_key(|s| s.height).unwrap_or(Size { width: 1, height: 1 });
    let letters = letter_height(largest);
    let gap = (letters * 0.5).ceil() as usize;
    let caption = text::extent("X", letters).height + gap;
    let size = Size {
        width: gap + pictures.iter().map(|p| p.size.width + gap).sum::<usize>(),
        height: caption + largest.height + gap,
    };
    let mut out = Rgb8 { size, data: vec![[GROUND; 3]; size.pixels()] };
    let mut x = gap;
    for ((name, _), picture) in panels.iter().zip(&pictures) {
        // A caption that is too long for its panel is set smaller.
        let mut height = letters;
        while text::extent(name, height).width > picture.size.width && height > 4.0 {
            height *= 0.9;
        }
        let room = caption.saturating_sub(text::extent(name, height).height) / 2;
        text::draw(&mut out, name, x as i64, room as i64, height, INK);
        for (row, line) in picture.data.chunks_exact(picture.size.width.max(1)).enumerate() {
            let start = (caption + row) * size.width + x;
            out.data[start..start + line.len()].copy_from_slice(line);
        }
        x += picture.size.width + gap;
    }
    out
}

impl PanelImage<'_> {
    fn colours(&self) -> Rgb8 {
        match self {
            PanelImage::Gray(g) => Rgb8 { size: g.size, data: g.data.iter().map(|&v| [v; 3]).collect() },
            PanelImage::Color(c) => (*c).clone(),
            PanelImage::Error { truth, model } => error_picture(truth, model),
        }
    }
}

/// The signed difference over the part that both have, with its own bar.
fn error_picture(truth: &Gray8, model: &Gray8) -> Rgb8 {
    let size = Size { width: truth.size.width.min(model.size.width), height: truth.size.height.min(model.size.height) };
    let differences: Vec<i32> = (0..size.pixels())
        .map(|i| {
            let (x, y) = (i % size.width, i / size.width);
            i32::from(model.data[y * model.size.width + x]) - i32::from(truth.data[y * truth.size.width + x])
        })
        .collect();
    let reach = reach(&differences);
    let data = differences.iter().map(|&d| diverging(d as f32 / reach)).collect();
    let mut picture = Rgb8 { size, data };
    let label = |v: f32| text::number(f64::from(v));
    let ticks = [-1.0f32, -0.5, 0.0, 0.5, 1.0]
        .map(|t| (0.5 + 0.5 * f64::from(t), format!("{}{}", if t > 0.0 { "+" } else { "" }, label(t * reach))));
    let color = |t: f32| diverging(2.0 * t - 1.0);
    colour_bar(&mut picture, &Bar { title: "grey levels", color: &color, ticks: ticks.to_vec() });
    picture
}

/// A round number of levels that nearly all (99.9 %) of the lit differences stay within.
fn reach(differences: &[i32]) -> f32 {
    let mut sizes: Vec<i32> = differences.iter().map(|d| d.abs()).filter(|d| *d > 0).collect();
    sizes.sort_unstable();
    let high = sizes.get(sizes.len().saturating_sub(1 + sizes.len() / 1000)).copied().unwrap_or(0);
    [4, 10, 20, 40, 100, 200].into_iter().find(|r| *r >= high).unwrap_or(256) as f32
}

/// Kept for the layout tests: where panel `i` begins.
#[cfg(test)]
fn panel_box(pictures: &[Size], i: usize) -> super::bar::Box2 {
    let largest = pictures.iter().max_by_key(|s| s.height).copied().unwrap();
    let letters = letter_height(largest);
    let gap = (letters * 0.5).ceil() as usize;
    let x = gap + pictures[..i].iter().map(|p| p.width + gap).sum::<usize>();
    let y = text::extent("X", letters).height + gap;
    super::bar::Box2 { x: x as i64, y: y as i64, w: pictures[i].width as i64, h: pictures[i].height as i64 }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn panels_stand_side_by_side() {
        let size = Size { width: 320, height: 180 };
        let truth = Gray8 { size, data: vec![100; size.pixels()] };
        let model = Gray8 { size, data: (0..size.pixels()).map(|i| if i % 2 == 0 { 103 } else { 100 }).collect() };
        let out = panels(&[
            ("truth", PanelImage::Gray(&truth)),
            ("model", PanelImage::Gray(&model)),
            ("error", PanelImage::Error { truth: &truth, model: &model }),
        ]);
        let at = |i: usize, x: i64, y: i64| {
            let b = panel_box(&[size; 3], i);
            out.data[(b.y + y) as usize * out.size.width + (b.x + x) as usize]
        };
        assert_eq!(at(0, 0, 0), [100; 3]);
        assert_eq!(at(1, 0, 179), [103; 3]);
        assert_eq!(at(2, 1, 170), [0; 3]);
        assert!(at(2, 0, 170)[0] > at(2, 0, 170)[2], "too bright is red");
        assert_eq!(reach(&[0, 0]), 4.0);
        assert_eq!(reach(&[7; 100]), 10.0);
    }
}
