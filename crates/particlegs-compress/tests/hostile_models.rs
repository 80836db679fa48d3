//! Models with altered fields and right checksums: whatever is done with one ends, in a result or in
//! an error; nothing panics, and what is written can be read.

#![allow(clippy::disallowed_methods)]

mod common;

use common::reseal;
use particlegs_compress::{Target, simplify};
use particlegs_core::camera::{View, base_distance, spherical_camera};
use particlegs_core::codec::Merge;
use particlegs_core::context::Context;
use particlegs_core::math::Random;
use particlegs_core::model::Model;
use particlegs_core::picture::Size;
use particlegs_core::render::{Scene, draw, surface_density};
use particlegs_core::splat::ToneStyle;
use particlegs_core::{Error, camera, codec};
use particlegs_fit::recover::{Method, Options, recover};
use particlegs_measure::stats::{StatsOptions, Subject, compare};
use particlegs_particles::RawForm;
use std::time::{Duration, Instant};

const SIZE: Size = Size { width: 40, height: 24 };
/// A step may go on for so long before it is told to stop ...
const PATIENCE: Duration = Duration::from_millis(100);
/// ... and has then stopped within this, on a machine that does much else.
const HEARD: Duration = Duration::from_secs(20);

/// Runs a step, which is told to stop when it has gone on for [`PATIENCE`]; a stop that was asked for is a result like
/// any other.
fn step<T>(name: &str, work: impl FnOnce(&Context<'_>) -> Result<T, Error>) -> Option<T> {
    let start = Instant::now();
    let outcome = work(&Context::SILENT.with_cancel(&|| start.elapsed() > PATIENCE));
    assert!(start.elapsed() < PATIENCE + HEARD, "{name} took {:?}", start.elapsed());
    match outcome {
        Ok(value) => Some(value),
        Err(error) => {
            let text = error.to_string();
            assert!(!text.contains('\n') && !text.is_empty(), "{name}: {text}");
            None
        }
    }
}

/// The fixtures of both laws.
fn fixtures() -> Vec<Vec<u8>> {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    ["1.0", "1.0-alpha"].map(|v| std::fs::read(folder.join(format!("format-{v}.pgs"))).unwrap()).to_vec()
}

/// Places of numbers: of the metadata's fields, of the certificate and of blocks' headers, and some of the streams.
fn places(file: &[u8]) -> Vec<(usize, usize)> {
    let mut out = Vec::new();
    let mut at = 24;
    while at + 16 <= file.len() {
        let length = u64::from_le_bytes(file[at + 4..at + 12].try_into().unwrap()) as usize;
        let content = at + 16..at + 16 + length;
        match &file[at..at + 4] {
            b"META" => {
                let mut field = content.start;
                while field < content.end {
                    let n = usize::from(u16::from_le_bytes([file[field + 1], file[field + 2]]));
                    // A cell's lengths stand behind a byte of flags.
                    let first = field + 3 + usize::from(n % 8 == 1 && n > 1);
                    out.extend((first..field + 3 + n).step_by(8).map(|p| (p, (field + 3 + n - p).min(8))));
                    field += 3 + n;
                }
            }
            b"BLOK" => {
                out.extend((0..8).map(|i| (content.start + 8 * i, 8)));
                out.push((content.start + 64, 4));
                out.extend((68..73).map(|i| (content.start + i, 1)));
                out.extend((73..117).step_by(4).map(|i| (content.start + i, 4)));
                out.extend((129..length).step_by(29).map(|i| (content.start + i, 1)));
            }
            _ => out.extend((content.start..content.end).step_by(8).map(|p| (p, (content.end - p).min(8)))),
        }
        at = content.end;
    }
    out
}

/// Values that a number of so many bytes may become.
fn values(width: usize) -> Vec<Vec<u8>> {
    const REALS: [f64; 14] =
        [0.0, -1.0, 5e-324, 1e-300, 1e-160, 1e-45, 1e-6, 0.5, 1e6, 1e38, 1e160, 1e300, f64::MAX, f64::NAN];
    match width {
        8 => REALS
            .iter()
            .map(|v| v.to_le_bytes().to_vec())
            .chain([1u64, 1 << 53, u64::MAX].map(|v| v.to_le_bytes().to_vec()))
            .collect(),
        4 => REALS
            .iter()
            .map(|v| (*v as f32).to_le_bytes().to_vec())
            .chain([1u32, 16, 1 << 20, u32::MAX].map(|v| v.to_le_bytes().to_vec()))
            .collect(),
        _ => [0u8, 1, 2, 7, 15, 128, 255].map(|v| vec![v; width]).to_vec(),
    }
}

/// All that is done with a model file.
fn use_all(bytes: &[u8], good: &[u8]) {
    let info = step("info", |_| codec::read_info(bytes, "m"));
    let decoded = step("decode", |_| codec::decode(bytes, "m"));
    if let Some(merged) = step("merge", |_| {
        let mut merge = Merge::default();
        merge.add(bytes, "m", &Context::SILENT)?;
        merge.finish()
    }) {
        assert!(decoded.is_some(), "a model that cannot be read was merged");
        codec::decode(&merged, "the merged model").unwrap();
    }
    let Some(model) = decoded else { return };
    assert!(info.is_some());
    pictures(&model);
    reduced(&model, bytes.len());
    drawn(&model);
    measured(&model, good);
}

fn pictures(model: &Model) {
    let m = &model.metadata;
    let scene = Scene::new(model);
    let distance = base_distance(&m.bounds, SIZE);
    for (factor, opacity) in [(1.0, m.default_opacity), (0.2, 1e-12)] {
        let camera = spherical_camera(m.bounds.center(), 30.0, 20.0, factor * distance);
        let view = View { name: "v".into(), camera, radius: m.default_radius, opacity };
        step("render", |p| draw(&scene, &view, SIZE, ToneStyle::Paraview, p));
    }
    step("density", |p| {
        let width = m.bounds.extent_nonzero().into_iter().fold(0.0, f64::max);
        let window = camera::Window { center: m.bounds.center(), angles_deg: [0.0; 2], width, depth: None };
        let view = camera::DensityView::orthographic("d", &window, SIZE, &m.bounds, m.cell)?;
        surface_density(&scene, &view, SIZE, p)
    });
}

fn reduced(model: &Model, bytes: usize) {
    let wanted = (model.gaussians() as u64 / 2).max(1);
    let small = step("simplify", |p| simplify(model.clone(), bytes as u64, Target::Gaussians(wanted), p));
    if let Some(small) = small {
        codec::decode(&small, "the simplified model").unwrap();
    }
}

fn drawn(model: &Model) {
    let dir = tempfile::tempdir().unwrap();
    for (i, method) in [Method::Count, Method::Grid].into_iter().enumerate() {
        let form = RawForm::Columns;
        let options = Options { particles: Some(20), method, scale: 1.0, seed: 1, form, model_name: "m".into() };
        let out = dir.path().join(i.to_string());
        step("recover", |p| recover(model.clone(), [0; 32], &options, &out, p));
    }
}

fn measured(model: &Model, good: &[u8]) {
    let good = codec::decode(good, "good").unwrap();
    let centers = Some(vec![(model.metadata.bounds.center(), None); 2]);
    let o = StatsOptions { cells: Some(8), spectrum_cells: 8, centers, halo_bins: 3, ..StatsOptions::default() };
    step("stats", |p| compare(Subject::Model(model), Subject::Model(&good), &o, p));
    step("stats", |p| compare(Subject::Model(&good), Subject::Model(model), &o, p));
}

/// Checksums and headers are right, a stream is not.
#[test]
fn a_block_that_cannot_be_decoded_is_not_merged() {
    let good = fixtures().remove(0);
    let mut tried = 0;
    for (at, _) in places(&good).into_iter().filter(|p| p.1 == 1) {
        let mut bad = good.clone();
        bad[at] ^= 0x55;
        reseal(&mut bad);
        if codec::read_info(&bad, "m").is_ok() && codec::decode(&bad, "m").is_err() {
            let error = Merge::default().add(&bad, "m", &Context::SILENT).unwrap_err();
            assert!(
                matches!(error, crate::Error::Corrupt { .. }) && error.to_string().starts_with("m: corrupt model file"),
                "{error}"
            );
            assert!(matches!(codec::check(&bad, "m", &Context::SILENT).unwrap_err(), crate::Error::Corrupt { .. }));
            tried += 1;
        }
    }
    assert!(tried > 3, "{tried}");
}

/// One of `every` of the alterations, drawn by `seed`.
fn sweep(every: u64, seed: u64) {
    let mut tried = 0;
    for (number, good) in fixtures().into_iter().enumerate() {
        use_all(&good, &good);
        for (p, (at, width)) in places(&good).into_iter().enumerate() {
            for (v, value) in values(width).into_iter().enumerate() {
                let index = ((number * 4096 + p) * 64 + v) as u64;
                if !Random::new(seed, 1, index).bits().is_multiple_of(every) {
                    continue;
                }
                let mut bad = good.clone();
                bad[at..at + width].copy_from_slice(&value);
                reseal(&mut bad);
                use_all(&bad, &good);
                tried += 1;
            }
        }
    }
    assert!(tried > 30, "{tried}");
}

#[test]
fn altered_fields_do_no_harm() {
    sweep(64, 1);
}

#[test]
#[ignore = "slow"]
fn more_altered_fields_do_no_harm() {
    sweep(4, 2);
}
