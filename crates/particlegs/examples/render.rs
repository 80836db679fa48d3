//! From a model file to a picture: `cargo run --release --example render MODEL.pgs`.

use particlegs::camera::{View, base_distance, spherical_camera};
use particlegs::codec;
use particlegs::context::Context;
use particlegs::picture::{Size, write_png};
use particlegs::render::{Scene, draw};
use particlegs::splat::ToneStyle;
use std::path::{Path, PathBuf};

fn main() -> particlegs::Result<()> {
    let path: PathBuf = std::env::args_os().nth(1).expect("the path of a model file").into();
    let bytes = std::fs::read(&path).expect("a file that can be read");
    let model = codec::decode(&bytes, &path.display().to_string())?;

    let size = Size { width: 960, height: 540 };
    let m = &model.metadata;
    let view = View {
        name: "view".into(),
        // Azimuth and elevation in degrees, and the distance that shows everything.
        camera: spherical_camera(m.bounds.center(), 30.0, 20.0, base_distance(&m.bounds, size)),
        // Any radius and opacity: nothing is fitted again.
        radius: 2.0 * m.default_radius,
        opacity: m.default_opacity,
    };
    let picture = draw(&Scene::new(&model), &view, size, ToneStyle::Paraview, &Context::SILENT)?;
    write_png(Path::new("view.png"), size, &picture.data)
}
