//! Crops of pictures, enlarged and brightened for figures.

use particlegs_core::picture::{Gray8, Rgb8, Size};

/// Share of width and height in the paper's close-ups.
const SHARE: f64 = 0.3;
/// Approximate width of a panel in pixels.
const WIDTH: usize = 480;

/// Note of captions on [`brightened`].
pub(super) const BRIGHTENED: &str = "Grey levels are brightened: the pictures show the square root of each level.";

/// The square root of a level's share of white.
fn brightened(level: u8) -> u8 {
    (255.0 * (f64::from(level) / 255.0).sqrt()).round() as u8
}

/// The centre 30 % of a picture, enlarged by a whole factor if it is small.
pub(super) fn close_up(picture: &Gray8) -> Rgb8 {
    enlarged(&centre(picture, SHARE))
}

/// The whole picture, reduced by a whole factor if it is large.
pub(super) fn whole(picture: &Gray8) -> Rgb8 {
    let by = (picture.size.width / WIDTH).max(1);
    enlarged(&reduced(picture, by))
}

/// The centre of a picture, by share of width and height.
pub(super) fn centre(picture: &Gray8, share: f64) -> Gray8 {
    let Size { width, height } = picture.size;
    let part = |n: usize| ((n as f64 * share).round() as usize).clamp(1, n.max(1));
    let size = Size { width: part(width), height: part(height) };
    let (left, top) = ((width - size.width) / 2, (height - size.height) / 2);
    let row = |j: usize| &picture.data[(top + j) * width + left..][..size.width];
    Gray8 { size, data: (0..size.height).flat_map(row).copied().collect() }
}

/// Means of squares of `by` pixels; incomplete squares at the right and bottom are dropped.
fn reduced(picture: &Gray8, by: usize) -> Gray8 {
    let size = Size { width: picture.size.width / by, height: picture.size.height / by };
    let mean = |(x, y): (usize, usize)| {
        let row = |j: usize| &picture.data[(by * y + j) * picture.size.width + by * x..][..by];
        let sum: usize = (0..by).flat_map(row).map(|v| usize::from(*v)).sum();
        ((sum + by * by / 2) / (by * by)) as u8
    };
    let places = (0..size.height).flat_map(|y| (0..size.width).map(move |x| (x, y)));
    Gray8 { size, data: places.map(mean).collect() }
}

fn enlarged(picture: &Gray8) -> Rgb8 {
    let by = ((WIDTH as f64 / picture.size.width as f64).round() as usize).max(1);
    let size = Size { width: by * picture.size.width, height: by * picture.size.height };
    let pixel = |i: usize| {
        let (x, y) = (i % size.width / by, i / size.width / by);
        [brightened(picture.data[y * picture.size.width + x]); 3]
    };
    Rgb8 { size, data: (0..size.pixels()).map(pixel).collect() }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn picture(width: usize, height: usize) -> Gray8 {
        let size = Size { width, height };
        Gray8 { size, data: (0..size.pixels()).map(|i| (i % 251) as u8).collect() }
    }

    #[test]
    fn crops_take_the_centre_and_average_squares() {
        let p = picture(10, 10);
        let c = centre(&p, 0.3);
        assert_eq!((c.size, &c.data[..]), (Size { width: 3, height: 3 }, &[33, 34, 35, 43, 44, 45, 53, 54, 55][..]));
        assert_eq!(reduced(&p, 5).data, [22, 27, 72, 77]);
        let large = close_up(&p);
        assert_eq!((large.size.width, large.data[0], large.data[479]), (480, [92; 3], [94; 3]));
        assert_eq!([0, 1, 64, 255].map(brightened), [0, 16, 128, 255]);
        assert_eq!(whole(&picture(1920, 1080)).size, Size { width: 480, height: 270 });
        assert_eq!(whole(&picture(640, 360)).size, Size { width: 640, height: 360 });
    }
}
