//! Sizes of LCP on raw columns: `lcp_sizes FOLDER BOUND...`
use particlegs::particles::Particles;
use particlegs_lab::{Baseline, lcp::Lcp};

fn main() -> particlegs::Result<()> {
    let mut arguments = std::env::args().skip(1);
    let particles = Particles::open_raw(&[arguments.next().expect("a folder").into()])?;
    let columns = [0, 1, 2].map(|k| (0..particles.len()).map(|i| particles.position(i)[k] as f32).collect());
    for bound in arguments.map(|a| a.parse::<f64>().expect("a bound")) {
        let started = std::time::Instant::now();
        let bytes = Lcp.compress(&columns, bound)?.bytes.len();
        println!("{bound} {bytes} {:.1} s", started.elapsed().as_secs_f64());
    }
    Ok(())
}
