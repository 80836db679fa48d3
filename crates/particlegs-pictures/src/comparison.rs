//! Compares two PNGs or surface densities, or two folders of them with the same names.

use crate::density_file;
use crate::provenance::PictureProvenance;
use particlegs_core::context::Context;
use particlegs_core::picture::{DensityScores, Gray8, Scores};
use particlegs_core::{Error, Result, parallel};
use particlegs_files::png::read_png;
use serde::Serialize;
use std::collections::BTreeSet;
use std::path::Path;

/// Scores of pictures, and of raw values of surface densities, A against B.
#[derive(Debug, Serialize)]
pub struct FolderComparison {
    /// Each pair of pictures.
    pub views: Vec<PictureComparison>,
    /// Means over them.
    pub mean: MeanScores,
    /// Each pair of files of values.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub densities: Vec<DensityFileComparison>,
    /// Means over them.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_density: Option<MeanDensityScores>,
    /// Names of files without a counterpart in B.
    pub only_in_a: Vec<String>,
    /// Names of files without a counterpart in A.
    pub only_in_b: Vec<String>,
}

impl FolderComparison {
    fn new(views: Vec<PictureComparison>, densities: Vec<DensityFileComparison>) -> Self {
        let (mean, mean_density) = (mean_scores(&views), mean_density(&densities));
        FolderComparison { views, mean, densities, mean_density, only_in_a: Vec::new(), only_in_b: Vec::new() }
    }

    /// Why pairs could not be scored.
    pub fn failures(&self) -> impl Iterator<Item = &str> {
        let pictures = self.views.iter().filter_map(|v| v.error.as_deref());
        pictures.chain(self.densities.iter().filter_map(|v| v.error.as_deref()))
    }
}

/// A picture against another.
#[derive(Debug, Serialize)]
pub struct PictureComparison {
    /// File name without `.png`.
    pub name: String,
    /// Its scores; none where they cannot be compared.
    #[serde(flatten)]
    pub scores: Option<Scores>,
    /// Largest difference of a pixel in levels.
    pub largest_difference: u8,
    /// Why there are no scores.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// Means over views; decibels are averaged as they are.
#[derive(Debug, Serialize)]
pub struct MeanScores {
    /// dB over all pixels.
    pub psnr: Option<f64>,
    /// dB over lit pixels.
    pub masked_psnr: Option<f64>,
    /// Structural similarity, at most 1.
    pub ssim: Option<f64>,
    /// Views without a masked PSNR.
    pub left_out: usize,
}

/// Scores a picture or surface density against another. In a folder, the file of the same name is used; of two folders,
/// all files with the same names. Pairs that cannot be compared are listed with their [`FolderComparison::failures`].
///
/// # Errors
/// [`Error::Input`] where there is nothing to compare; [`Error::Io`]; [`Error::Cancelled`].
pub fn compare(a: &Path, b: &Path, context: &Context<'_>) -> Result<FolderComparison> {
    let within = |folder: &Path, file: &Path| folder.join(file.file_name().unwrap_or_default());
    let (a, b) = match (a.is_dir(), b.is_dir()) {
        (true, true) => return compare_folders(a, b, context),
        (true, false) => (within(a, b), b.to_path_buf()),
        (false, true) => (a.to_path_buf(), within(b, a)),
        (false, false) => (a.to_path_buf(), b.to_path_buf()),
    };
    // A file that is not there is an error of its own, not a pair without scores.
    for file in [&a, &b] {
        file.metadata().map_err(|e| Error::io(file, e))?;
    }
    let name = a.file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let values = |p: &Path| p.extension().is_some_and(|e| e == "f32" || e == "json");
    let (mut views, mut densities) = (Vec::new(), Vec::new());
    match (values(&a), values(&b)) {
        (true, true) => densities.push(compare_density(&name, &a, &b, context)),
        (false, false) => views.push(compare_pictures(&name, &a, &b, context)),
        _ => return Err(Error::input(&a, format!("cannot compare a picture with raw values ({})", b.display()))),
    }
    Ok(FolderComparison::new(views, densities))
}

/// Scores every PNG, and the raw values of every surface density, in folder `a` against the same name in `b`.
fn compare_folders(a: &Path, b: &Path, context: &Context<'_>) -> Result<FolderComparison> {
    let (in_a, in_b) = (FolderNames::new(a)?, FolderNames::new(b)?);
    let shared: Vec<&String> = in_a.pictures.intersection(&in_b.pictures).collect();
    let shared_densities: Vec<&String> = in_a.densities.intersection(&in_b.densities).collect();
    if shared.is_empty() && shared_densities.is_empty() {
        let message = format!("no PNG and no raw values with the same name as in {}", b.display());
        return Err(Error::input(a, message));
    }
    context.begin("comparing", (shared.len() + shared_densities.len()) as u64);
    let views = parallel::try_map(shared, |name| {
        context.check()?;
        let file = format!("{name}.png");
        let comparison = compare_pictures(name, &a.join(&file), &b.join(&file), context);
        context.advance(1);
        Ok::<_, Error>(comparison)
    })?;
    let densities = parallel::try_map(shared_densities, |name| {
        context.check()?;
        let file = format!("{name}.f32");
        let comparison = compare_density(name, &a.join(&file), &b.join(&file), context);
        context.advance(1);
        Ok::<_, Error>(comparison)
    })?;
    context.end();
    let (only_in_a, only_in_b) = (in_a.without(&in_b), in_b.without(&in_a));
    Ok(FolderComparison { only_in_a, only_in_b, ..FolderComparison::new(views, densities) })
}

fn mean_scores(views: &[PictureComparison]) -> MeanScores {
    let scores = || views.iter().filter_map(|v| v.scores);
    MeanScores {
        psnr: mean(scores().map(|s| s.psnr)),
        masked_psnr: mean(scores().map(|s| s.masked_psnr)),
        ssim: mean(scores().map(|s| s.ssim)),
        left_out: scores().filter(|s| s.masked_psnr.is_none()).count(),
    }
}

fn mean_density(densities: &[DensityFileComparison]) -> Option<MeanDensityScores> {
    let scores = || densities.iter().filter_map(|v| v.scores);
    (!densities.is_empty()).then(|| MeanDensityScores {
        rms_dex: mean(scores().map(|s| s.rms_dex)),
        mean_dex: mean(scores().map(|s| s.mean_dex)),
        correlation: mean(scores().map(|s| s.correlation)),
    })
}

/// Mean of the existing values; `None` without any.
fn mean(values: impl Iterator<Item = Option<f64>>) -> Option<f64> {
    let (sum, count) = values.flatten().fold((0.0, 0u32), |(sum, count), v| (sum + v, count + 1));
    (count > 0).then(|| sum / f64::from(count))
}

fn compare_pictures(name: &str, a: &Path, b: &Path, context: &Context<'_>) -> PictureComparison {
    let pair = read_png(a).and_then(|a| Ok((a, read_png(b)?)));
    // Pictures of other programs do not say what they show.
    let provenance_of = |path: &Path| PictureProvenance::read(path, context).ok().map(|(provenance, _)| provenance);
    let differing = provenance_of(a).zip(provenance_of(b)).and_then(|(a, b)| a.differs(&b));
    let (scores, largest_difference, error) = match (pair, differing) {
        (Err(e), _) => (None, 0, Some(e.to_string())),
        (Ok(_), Some(words)) => (None, 0, Some(format!("{name}: their colours differ: {words}"))),
        (Ok((a, b)), _) if a.size != b.size => {
            let [a, b] = [a.size, b.size].map(|s| format!("{}x{}", s.width, s.height));
            (None, 0, Some(format!("{name}: sizes differ, {a} and {b} pixels")))
        }
        (Ok((a, b)), _) => (Some(Scores::new(&a, &b)), largest_difference(&a, &b), None),
    };
    PictureComparison { name: name.into(), scores, largest_difference, error }
}

fn largest_difference(a: &Gray8, b: &Gray8) -> u8 {
    a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b)).max().unwrap_or(0)
}

/// Values of a surface density against others.
#[derive(Debug, Serialize)]
pub struct DensityFileComparison {
    /// File name without `.f32`.
    pub name: String,
    /// Their scores; none where they cannot be compared.
    #[serde(flatten)]
    pub scores: Option<DensityScores>,
    /// Why there are no scores.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub error: Option<String>,
}

/// Means over views that have a value.
#[derive(Debug, Serialize)]
pub struct MeanDensityScores {
    /// Root mean square of log10(A / B).
    pub rms_dex: Option<f64>,
    /// Mean of log10(A / B).
    pub mean_dex: Option<f64>,
    /// Correlation of the logarithms.
    pub correlation: Option<f64>,
}

/// Scores the values of one file against those of another; failures are listed in place of scores.
fn compare_density(name: &str, a: &Path, b: &Path, context: &Context<'_>) -> DensityFileComparison {
    let (scores, error) = match density_scores(a, b, context) {
        Ok(Ok(scores)) => (Some(scores), None),
        Ok(Err(why)) => (None, Some(format!("{name}: {why}"))),
        Err(e) => (None, Some(e.to_string())),
    };
    DensityFileComparison { name: name.into(), scores, error }
}

/// The scores, or why there are none.
fn density_scores(a: &Path, b: &Path, context: &Context<'_>) -> Result<std::result::Result<DensityScores, String>> {
    let (said_a, density) = density_file::read(a, context)?;
    let (said_b, truth) = density_file::read(b, context)?;
    match said_a.differs(&said_b) {
        Some(why) => Ok(Err(why)),
        None => DensityScores::new(&density, &truth, context).map(Ok),
    }
}

/// Names, without extension, of the comparable files in a folder.
struct FolderNames {
    pictures: BTreeSet<String>,
    densities: BTreeSet<String>,
}

impl FolderNames {
    fn new(folder: &Path) -> Result<FolderNames> {
        let fail = |e| Error::io(folder, e);
        let mut names = FolderNames { pictures: BTreeSet::new(), densities: BTreeSet::new() };
        for entry in std::fs::read_dir(folder).map_err(fail)? {
            let path = entry.map_err(fail)?.path();
            let Some(stem) = path.file_stem().and_then(|s| s.to_str()) else { continue };
            match path.extension().and_then(|e| e.to_str()) {
                Some("png") => names.pictures.insert(stem.to_string()),
                Some("f32") if path.with_extension("json").is_file() => names.densities.insert(stem.to_string()),
                _ => continue,
            };
        }
        Ok(names)
    }

    fn without(&self, others: &FolderNames) -> Vec<String> {
        let pictures = self.pictures.difference(&others.pictures).cloned();
        pictures.chain(self.densities.difference(&others.densities).map(|name| format!("{name}.f32"))).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use particlegs_core::context::Context;
    use particlegs_core::picture::Size;
    use particlegs_files::png::write_png;

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
        assert!(compare(&a, &b, &Context::SILENT).is_err());
        for (name, side, level) in [("same.png", 8, 10), ("differs.png", 8, 20), ("sizes.png", 9, 10)] {
            write(&a, name, 8, 10);
            write(&b, name, side, level);
        }
        let c = compare(&a, &b, &Context::SILENT).unwrap();
        assert_eq!((&c.only_in_a[..], &c.only_in_b[..]), (&["alone".to_string()][..], &["other".to_string()][..]));
        assert_eq!(c.views.iter().map(|v| v.name.as_str()).collect::<Vec<_>>(), ["differs", "same", "sizes"]);
        assert_eq!(c.failures().count(), 1);
        let expected = -20.0 * (10.0f64 / 255.0).log10();
        assert!((c.mean.psnr.unwrap() - expected).abs() < 1e-12 && c.views[0].largest_difference == 10);
        assert_eq!((c.views[1].scores.unwrap().psnr, c.mean.left_out), (None, 1));
        // Two files, whatever their names; a file and the folder that has its like.
        let (one, other) = (a.join("same.png"), b.join("differs.png"));
        for (a, b) in [(&one, &other), (&other, &a), (&b, &a.join("differs.png"))] {
            let c = compare(a, b, &Context::SILENT).unwrap();
            assert!((c.mean.psnr.unwrap() - expected).abs() < 1e-12 && c.views.len() == 1, "{a:?} {b:?}");
        }
        std::fs::write(a.join("values.f32"), b"").unwrap();
        for (a, b) in [(&one, &b.join("none.png")), (&one, &b.join("values.f32")), (&one, &a.join("values.f32"))] {
            assert!(compare(a, b, &Context::SILENT).is_err(), "{b:?}");
        }
    }
}
