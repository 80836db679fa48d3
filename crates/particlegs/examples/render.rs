//! From a model file to a picture: `cargo run --release -p particlegs --example render MODEL.pgs`.

use particlegs::prelude::*;

fn main() -> Result<()> {
    let path = std::env::args_os().nth(1).expect("the path of a model file");
    let model = Model::open(std::path::Path::new(&path))?;
    let size = Size { width: 960, height: 540 };
    // From azimuth 30 and elevation 20 degrees; any radius and opacity: nothing is fitted again.
    let view = model.orbit(30.0, 20.0, size);
    let view = View { radius: 2.0 * view.radius, ..view };
    model.render(&view, size, &Context::default())?.save_png("view.png")
}
