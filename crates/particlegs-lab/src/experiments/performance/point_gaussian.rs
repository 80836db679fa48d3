//! VTK's own Point Gaussian, run by lab/point_gaussian.py in the user's Python.

use super::clock::{FrameTimes, Machine, load};
use super::command::{Cost, RawCopy, run};
use super::{TimingViews, ours};
use crate::lab::Lab;
use crate::snapshot::Snapshot;
use particlegs_core::picture::{Gray8, Size, masked_psnr, psnr};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, Result};
use serde::{Deserialize, Serialize};
use serde_json::json;
use std::path::Path;
use std::process::Command;

const SCRIPT: &str = include_str!("../../../lab/point_gaussian.py");
/// Seconds after which no further frame of a size is started.
fn limit(lab: &Lab<'_>) -> f64 {
    if lab.settings.quick { 12.0 } else { 100.0 }
}

/// VTK's times at one picture size.
#[derive(Clone, Debug, Serialize, Deserialize)]
pub(super) struct PointGaussian {
    /// Versions of VTK and of its OpenGL.
    pub version: String,
    pub opengl: String,
    /// Seconds from float32 files to points for its mapper.
    pub load: f64,
    /// Seconds of the first frame.
    pub first: f64,
    pub cameras: FrameTimes,
    pub settings: FrameTimes,
    /// Cost of the whole child, including Python.
    pub cost: Cost,
    /// Agreement of its first picture with ours, without and with FXAA.
    pub agrees: Option<[Agreement; 2]>,
}

/// dB between two pictures; `None` if they are equal.
#[derive(Clone, Copy, Debug, Serialize, Deserialize)]
pub(super) struct Agreement {
    pub psnr: Option<f64>,
    pub masked: Option<f64>,
    /// Share of pixels that differ, and the largest difference in levels.
    pub differ: f64,
    pub largest: u8,
}

impl Agreement {
    fn new(a: &Gray8, b: &Gray8) -> Agreement {
        let apart = a.data.iter().zip(&b.data).map(|(a, b)| a.abs_diff(*b));
        let differ = apart.clone().filter(|d| *d > 0).count() as f64 / a.data.len().max(1) as f64;
        Agreement { psnr: psnr(a, b), masked: masked_psnr(a, b), differ, largest: apart.max().unwrap_or(0) }
    }
}

#[derive(Deserialize)]
struct ScriptOutput {
    version: String,
    opengl: String,
    load: f64,
    first: f64,
    cameras: Vec<f64>,
    settings: Vec<f64>,
}

/// The version of VTK in a Python; a new version is measured again.
fn installed(python: &Path) -> Option<String> {
    let code = "from importlib.metadata import version; print(version('vtk'))";
    let said = Command::new(python).args(["-c", code]).output().ok().filter(|o| o.status.success())?;
    Some(String::from_utf8_lossy(&said.stdout).trim().into())
}

/// VTK at one picture size, compared with our picture if `compared`, or why it failed. Failures are tried again the
/// next time.
pub(super) fn measure(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    shots: &TimingViews,
    compared: bool,
    raw: &RawCopy<'_>,
    machine: &Machine,
) -> Result<std::result::Result<PointGaussian, String>> {
    let Some(python) = &lab.settings.python else {
        return Ok(Err("it needs a Python with the packages of lab/requirements.txt".into()));
    };
    let script = blake3::hash(SCRIPT.as_bytes()).to_hex()[..16].to_string();
    let key = (&snapshot.hash, shots.key(), limit(lab), compared, (script, installed(python)), machine);
    let timings = lab.store.result("timed-vtk", &key, || child(lab, snapshot, shots, compared, raw, python));
    match timings {
        Err(Error::Input { what, .. }) => Ok(Err(what)),
        other => other.map(Ok),
    }
}

fn child(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    shots: &TimingViews,
    compared: bool,
    raw: &RawCopy<'_>,
    python: &Path,
) -> Result<PointGaussian> {
    let folder = raw.folder()?;
    let request = json!({
        "folder": raw.snapshot()?,
        "width": shots.size.width,
        "height": shots.size.height,
        "first": shots.first,
        "cameras": shots.cameras,
        "settings": shots.settings,
        "pictures": compared.then_some(folder),
        "limit": limit(lab),
    });
    let mut command = Command::new(python);
    let ran = run(command.args(["-u", "-c", SCRIPT]), &request.to_string(), folder, lab.context)?;
    let Some(cost) = ran.cost else { return Err(Error::input(python, ran.said)) };
    let answer: ScriptOutput = serde_json::from_str(&ran.said)
        .map_err(|e| Error::input(python, format!("the answer does not come from lab/point_gaussian.py: {e}")))?;
    let agrees = match compared {
        true => Some([
            agreement(lab, snapshot, shots, folder, "plain.gray", ToneStyle::ParaviewNoFxaa)?,
            agreement(lab, snapshot, shots, folder, "fxaa.gray", ToneStyle::Paraview)?,
        ]),
        false => None,
    };
    let frames = |seconds: Vec<f64>| FrameTimes { views: seconds.into_iter().map(|s| vec![s]).collect(), load: load() };
    Ok(PointGaussian {
        version: answer.version,
        opengl: answer.opengl,
        load: answer.load,
        first: answer.first,
        cameras: frames(answer.cameras),
        settings: frames(answer.settings),
        cost,
        agrees,
    })
}

fn agreement(
    lab: &Lab<'_>,
    snapshot: &Snapshot,
    shots: &TimingViews,
    folder: &Path,
    name: &str,
    look: ToneStyle,
) -> Result<Agreement> {
    let (path, size): (_, Size) = (folder.join(name), shots.size);
    let data = std::fs::read(&path).map_err(|e| Error::io(&path, e))?;
    if data.len() != size.pixels() {
        return Err(Error::input(&path, format!("has {} pixels, not {}", data.len(), size.pixels())));
    }
    Ok(Agreement::new(&Gray8 { size, data }, &ours::picture(lab, snapshot, &shots.first, size, look)?))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::lab::ModelSettings;
    use crate::settings::Settings;
    use crate::testing::lattice;
    use particlegs_core::context::Context;
    use std::path::PathBuf;

    const SIZE: Size = Size { width: 160, height: 90 };

    /// VTK of so many particles by a Python, in a folder of its own.
    fn measured(python: Option<PathBuf>) -> std::result::Result<PointGaussian, String> {
        let snapshot = Snapshot::new("s".into(), "s".into(), lattice(3000, |v| (v / 100.0).powi(2)), None);
        let folder = tempfile::tempdir().unwrap();
        let lab = Lab::new(Settings { size: SIZE, ..Settings::new(true, "".into()) }, folder.path(), &Context::SILENT);
        let mut lab = lab.unwrap();
        lab.settings.python = python;
        let mut model = lab.model(&snapshot, &ModelSettings::ratio(10.0, 1)).unwrap().model;
        // Splats that are seen.
        model.metadata.default_radius *= 10.0;
        let shots = TimingViews::new(&lab, &model.metadata, SIZE);
        measure(&lab, &snapshot, &shots, true, &RawCopy::new(&lab, &snapshot), &Machine::here()).unwrap()
    }

    #[test]
    fn missing_measurements_say_why() {
        assert!(measured(None).unwrap_err().contains("a Python"));
        if Path::new("/bin/false").exists() {
            assert!(measured(Some("/bin/false".into())).unwrap_err().contains("exit status: 1"));
        }
    }

    #[test]
    fn vtk_draws_the_same_picture() {
        let Some(python) = std::env::var_os("PARTICLEGS_LAB_PYTHON") else { return };
        let timings = measured(Some(python.into())).unwrap();
        let [plain, _] = timings.agrees.unwrap();
        // Pixels at the very edge of a splat may fall to either side.
        assert!(plain.psnr.is_none_or(|d| d > 60.0) && plain.differ < 0.01, "{plain:?}");
        assert_eq!((timings.cameras.views.len(), timings.settings.views.len()), (3, 3));
        assert!(timings.first > 0.0 && !timings.opengl.is_empty(), "{timings:?}");
    }

    #[test]
    fn agreement_of_pictures_is_measured() {
        let size = Size { width: 4, height: 2 };
        let (a, mut b) = (Gray8 { size, data: vec![100; 8] }, Gray8 { size, data: vec![100; 8] });
        let same = Agreement::new(&a, &b);
        assert!(same.psnr.is_none() && same.differ == 0.0 && same.largest == 0);
        (b.data[1], b.data[6]) = (101, 97);
        let other = Agreement::new(&a, &b);
        assert_eq!((other.differ, other.largest), (0.25, 3));
        // Mean square of 1 and 3 over 8 pixels.
        assert!((other.psnr.unwrap() - 10.0 * (255.0f64.powi(2) / 1.25).log10()).abs() < 1e-9);
    }
}
