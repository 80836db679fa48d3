//! `particlegs render`: interim.
use crate::common::Common;
use clap::Args;
use particlegs::render::Scene;
use std::path::PathBuf;
/// Arguments.
#[derive(Args)]
pub struct Arguments {
    model: PathBuf,
    #[arg(long)]
    views: PathBuf,
    #[arg(long)]
    style: String,
    #[arg(long)]
    out: PathBuf,
    #[command(flatten)]
    common: Common,
}
/// Runs.
pub fn run(a: &Arguments) -> particlegs::Result<()> {
    let context = a.common.clone().start()?;
    let bytes = std::fs::read(&a.model).map_err(|e| particlegs::Error::io(&a.model, e))?;
    let model = particlegs::codec::decode(&bytes, &a.model.display().to_string())?;
    let set = particlegs::camera::read_views(&a.views)?;
    let scene = Scene::of(&model);
    std::fs::create_dir_all(&a.out).map_err(|e| particlegs::Error::io(&a.out, e))?;
    let look = particlegs::splat::Look::ALL.into_iter().find(|l| l.name() == a.style).unwrap();
    for v in &set.views {
        let p = particlegs::render::draw(&scene, v, set.size, look, &context)?;
        particlegs::picture::write_gray_png(&a.out.join(format!("{}.png", v.name)), &p)?;
    }
    Ok(())
}
