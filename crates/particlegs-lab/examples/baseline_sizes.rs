//! Sizes of every baseline on raw columns, each run's bound verified: `baseline_sizes FOLDER BOUND...`; SZ3 and ZFP too
//! where PARTICLEGS_LAB_PYTHON names a Python that has them. Lines of CSV.
use particlegs::particles::Particles;
use particlegs_lab::{baselines, external::External, rate};

fn main() -> particlegs::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let particles = Particles::open_raw(&[arguments.next().expect("a folder").into()])?;
    let columns = [0, 1, 2].map(|k| (0..particles.len()).map(|i| particles.position(i)[k] as f32).collect());
    let external = std::env::var_os("PARTICLEGS_LAB_PYTHON").map(|p| External::start(p.as_ref())).transpose()?;
    let bounds: Vec<f64> = arguments.map(|a| a.parse().expect("a bound")).collect();
    println!("baseline;bound;bytes;compress_s;decompress_s;largest_error;failure;source");
    for baseline in baselines(external.as_ref()) {
        for bound in &bounds {
            let verified = rate::verified(&*baseline, &columns, *bound);
            let failure = verified.failure().unwrap_or_default();
            let figures = verified.run().map_or(";;;".into(), |r| {
                format!("{};{:.2};{:.2};{}", r.bytes, r.compress_seconds, r.decompress_seconds, r.largest_error)
            });
            println!("{};{bound};{figures};{failure};{}", baseline.name(), baseline.source());
        }
    }
    Ok(())
}
