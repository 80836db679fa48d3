//! Sizes of every baseline on raw columns, with verified bounds, as CSV: `baseline_sizes FOLDER BOUND|RATIOx...`, such
//! as `0.2 263x`. SZ3 and ZFP need a Python that has them in PARTICLEGS_LAB_PYTHON.
use particlegs_core::context::Context;
use particlegs_lab::{Baseline, PositionColumns, baselines, external::External, rate, subset};
use particlegs_particles::Particles;

fn main() -> particlegs_core::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let particles = Particles::open_raw(&[arguments.next().expect("a folder").into()])?;
    let columns = [0, 1, 2].map(|k| (0..particles.len()).map(|i| particles.position(i)[k] as f32).collect());
    let external = std::env::var_os("PARTICLEGS_LAB_PYTHON").map(|p| External::start(p.as_ref())).transpose()?;
    let requests: Vec<String> = arguments.collect();
    println!("baseline;asked;bound;bytes;compress_s;decompress_s;largest_error;failure;source");
    for baseline in baselines(external.as_ref()) {
        requests.iter().try_for_each(|a| line(&*baseline, &columns, a))?;
    }
    for ratio in requests.iter().filter_map(|a| a.strip_suffix('x')) {
        let bytes = bytes_of(&columns, ratio);
        if let Some(thin) = subset::subset(&columns, bytes, 1, &Context::SILENT)? {
            println!("subset of {};{ratio}x;;{};;;;;", thin.particles[0].len(), thin.bytes);
        }
    }
    Ok(())
}

fn bytes_of(columns: &PositionColumns, ratio: &str) -> u64 {
    (12.0 * columns[0].len() as f64 / ratio.parse::<f64>().expect("a ratio")) as u64
}

fn line(baseline: &dyn Baseline, columns: &PositionColumns, request: &str) -> particlegs_core::Result<()> {
    let bound = match request.strip_suffix('x') {
        None => request.parse().expect("a bound"),
        Some(ratio) => {
            let size_bound = rate::at_size(baseline, columns, bytes_of(columns, ratio), &Context::SILENT)?;
            eprintln!("{} at {request}: {size_bound:?}", baseline.name());
            size_bound.bound
        }
    };
    let verified = rate::verified(baseline, columns, bound);
    let failure = verified.failure().unwrap_or_default();
    let figures = verified.run().map_or(";;;".into(), |r| {
        format!("{};{:.2};{:.2};{}", r.bytes, r.compress_seconds, r.decompress_seconds, r.largest_error)
    });
    println!("{};{request};{bound};{figures};{failure};{}", baseline.name(), baseline.source());
    Ok(())
}
