//! Two folders of PNGs of the same names against each other.

use particlegs::parallel;
use particlegs::picture::{Gray8, Scores, read_png};
use particlegs::progress::Progress;
use particlegs::{Error, Result};
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::Path;

/// Scores of the pictures that two folders share.
#[derive(Serialize)]
pub struct Comparison {
    /// Shared names in order.
    pub views: Vec<Compared>,
    /// Means over the views that have a value.
    pub mean: MeanScores,
    /// Names of the first folder without counterpart.
    pub only_in_a: Vec<String>,
    /// Names of the second folder without counterpart.
    pub only_in_b: Vec<String>,
}

impl Comparison {
    /// What could not be scored, a line each.
    pub fn failures(&self) -> impl Iterator<Item = &str> {
        self.views.iter().filter_map(|v| v.error.as_deref())
    }
}

/// One shared picture.
#[derive(Serialize)]
pub struct Compared {
    /// File name without `.png`.
    pub name: String,
    /// The scores, where both can be read and have one size.
    #[serde(flatten)]
    pub scores: Option<Scores>,
    /// Largest difference of a pixel, levels.
    pub largest_difference: u8,
    /// Why there are no scores.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// Means of views' scores: of the decibels, never the decibels of a mean.
#[derive(Serialize)]
pub struct MeanScores {
    /// dB over all pixels.
    pub psnr: Option<f64>,
    /// dB over lit pixels.
    pub masked_psnr: Option<f64>,
    /// Structural similarity.
    pub ssim: Option<f64>,
    /// Views without a masked PSNR.
    pub left_out: usize,
}

/// Scores every PNG of folder `a` against the one of its name in `b`.
///
/// # Errors
/// [`Error::Io`] where a folder cannot be read; [`Error::Input`] where they share no name. A pair
/// that cannot be scored is told in its place, not here.
pub fn compare_folders(a: &Path, b: &Path, progress: &dyn Progress) -> Result<Comparison> {
    let (names_a, names_b) = (pictures(a)?, pictures(b)?);
    let shared: Vec<&String> = names_a.intersection(&names_b).collect();
    if shared.is_empty() {
        let what = format!("no PNG has the name of one in {}", b.display());
        return Err(Error::input(a, what));
    }
    progress.begin("comparing", shared.len() as u64);
    let views = parallel::try_map(shared, |name| {
        progress.check()?;
        let file = format!("{name}.png");
        let compared = compare(name, &a.join(&file), &b.join(&file));
        progress.advance(1);
        Ok(compared)
    })?;
    progress.end();
    let scores = || views.iter().filter_map(|v| v.scores);
    let mean = MeanScores {
        psnr: mean(scores().map(|s| s.psnr)),
        masked_psnr: mean(scores().map(|s| s.masked_psnr)),
        ssim: mean(scores().map(|s| s.ssim)),
        left_out: scores().filter(|s| s.masked_psnr.is_none()).count(),
    };
    Ok(Comparison {
        views,
        mean,
        only_in_a: names_a.difference(&names_b).cloned().collect(),
        only_in_b: names_b.difference(&names_a).cloned().collect(),
    })
}

/// The mean of the values there are, in order; `None` where there is none.
fn mean(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let (sum, count) = values.flatten().fold((0.0, 0u32), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

fn compare(name: &str, a: &Path, b: &Path) -> Compared {
    let pair = read_png(a).and_then(|a| Ok((a, read_png(b)?)));
    let failed =
        |error: String| Compared { name: name.into(), scores: None, largest_difference: 0, error: Some(error) };
    match pair {
        Err(e) => failed(e.to_string()),
        Ok((a, b)) if a.size != b.size => failed(format!(
            "{name}: {}x{} pixels against {}x{}",
            a.size.width, a.size.height, b.size.width, b.size.height
        )),
        Ok((a, b)) => Compared {
            name: name.into(),
            scores: Some(Scores::of(&a, &b)),
            largest_difference: largest_difference(&a, &b),
            error: None,
        },
    }
}

fn largest_difference(a: &Gray8, b: &Gray8) -> u8 {
    a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0)
}

/// Names without ending of the PNGs in a folder.
fn pictures(folder: &Path) -> Result<BTreeSet<String>> {
    let fail = |e| Error::io(folder, e);
    let mut names = BTreeSet::new();
    for entry in std::fs::read_dir(folder).map_err(fail)? {
        let path = entry.map_err(fail)?.path();
        if path.extension().is_some_and(|e| e == "png")
            && let Some(stem) = path.file_stem().and_then(|s| s.to_str())
        {
            names.insert(stem.to_string());
        }
    }
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs::picture::{Size, write_png};
    use particlegs::progress::Silent;

    #[test]
    fn counterparts_and_sizes() {
        let dir = tempfile::tempdir().unwrap();
        let (a, b) = (dir.path().join("a"), dir.path().join("b"));
        let write = |folder: &Path, name: &str, side: usize, level: u8| {
            std::fs::create_dir_all(folder).unwrap();
            let size = Size { width: side, height: side };
            write_png(&folder.join(name), size, &vec![level; side * side]).unwrap();
        };
        write(&a, "alone.png", 8, 0);
        write(&b, "other.png", 8, 0);
        assert!(compare_folders(&a, &b, &Silent).is_err());
        for (name, side, level) in [("same.png", 8, 10), ("differs.png", 8, 20), ("sizes.png", 9, 10)] {
            write(&a, name, 8, 10);
            write(&b, name, side, level);
        }
        let c = compare_folders(&a, &b, &Silent).unwrap();
        assert_eq!((&c.only_in_a[..], &c.only_in_b[..]), (&["alone".to_string()][..], &["other".to_string()][..]));
        assert_eq!(c.views.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(), ["differs", "same", "sizes"]);
        assert_eq!(c.failures().count(), 1);
        let expected = -20.0 * (10.0f64 / 255.0).log10();
        assert!((c.mean.psnr.unwrap() - expected).abs() < 1e-12 && c.views[0].largest_difference == 10);
        assert_eq!((c.views[1].scores.unwrap().psnr, c.mean.left_out), (None, 1));
    }
}
