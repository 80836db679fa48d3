use super::*;
use crate::lcp::Lcp;
use crate::quantised::QuantisedCoder;
use crate::testing::{clustered, odd};
use crate::{CompressedParticles, check_bound};
use particlegs_core::context::Context;

/// Coordinates rounded to powers of two, as ZFP does; `wrong` adds an error.
struct RoundingBaseline {
    off: f32,
    drop: usize,
}

impl Baseline for RoundingBaseline {
    fn name(&self) -> &'static str {
        "steps"
    }

    fn source(&self) -> String {
        "here".into()
    }

    fn compress(&self, particles: &PositionColumns, bound: f64) -> Result<CompressedParticles> {
        check_bound(bound)?;
        let power = bound.log2().floor();
        let bits = (20.0 - power).max(1.0) as usize;
        let mut bytes = vec![0; particles[0].len() * bits * 4];
        bytes.extend(particles.iter().flatten().flat_map(|v| (v + self.off).to_le_bytes()));
        Ok(CompressedParticles { bytes, order: None })
    }

    fn decompress(&self, bytes: &[u8]) -> Result<PositionColumns> {
        // The decoded particles do not depend on the bound: twelve bytes per particle at the end.
        let n = 40 - self.drop;
        let values = bytes[bytes.len() - 480..].as_chunks::<4>().0;
        Ok([0, 1, 2].map(|k| values[40 * k..40 * k + n].iter().map(|v| f32::from_le_bytes(*v)).collect()))
    }
}

#[test]
fn requested_sizes_are_reached() {
    let particles = clustered(20_000);
    for baseline in [&Lcp as &dyn Baseline, &QuantisedCoder] {
        for ratio in [4, 20, 100] {
            let bytes = 240_000 / ratio;
            let size_bound = at_size(baseline, &particles, bytes, &Context::SILENT).unwrap();
            assert!(size_bound.met() && size_bound.trials <= TRIALS, "{} {ratio}: {size_bound:?}", baseline.name());
            let again = baseline.compress(&particles, size_bound.bound).unwrap().bytes.len() as u64;
            assert_eq!(again, size_bound.bytes);
            assert!((again as f64 / bytes as f64 - 1.0 - size_bound.off).abs() < 1e-12);
        }
    }
}

#[test]
fn unreachable_sizes_are_approached() {
    let particles = clustered(1000);
    // Fewer bytes than its header.
    let size_bound = at_size(&QuantisedCoder, &particles, 10, &Context::SILENT).unwrap();
    let least = QuantisedCoder.compress(&particles, 1e4).unwrap().bytes.len() as u64;
    assert!(!size_bound.met() && size_bound.bytes <= least && size_bound.off > 0.0, "{size_bound:?} {least}");
    // More than all digits take.
    let size_bound = at_size(&QuantisedCoder, &particles, 1_000_000, &Context::SILENT).unwrap();
    assert!(!size_bound.met() && size_bound.off < 0.0 && size_bound.bytes > 6000, "{size_bound:?}");
    // Between two steps: 2560 and 2720 bytes.
    let particles = clustered(40);
    let size_bound = at_size(&RoundingBaseline { off: 0.0, drop: 0 }, &particles, 2630, &Context::SILENT).unwrap();
    assert!(!size_bound.met() && size_bound.bytes == 2560 && size_bound.trials <= TRIALS, "{size_bound:?}");
    assert!(at_size(&Lcp, &Default::default(), 100, &Context::SILENT).is_err());
    assert!(at_size(&Lcp, &particles, 0, &Context::SILENT).is_err());
}

#[test]
fn bounds_are_found_for_unusual_particles() {
    for (particles, _) in odd() {
        if !particles[0].is_empty() {
            let size_bound = at_size(&QuantisedCoder, &particles, 300, &Context::SILENT).unwrap();
            assert!(size_bound.bound > 0.0 && size_bound.bound.is_finite(), "{size_bound:?}");
        }
    }
}

#[test]
fn bounds_are_verified() {
    for (particles, bound) in odd().into_iter().chain([(clustered(3000), 0.2)]) {
        for baseline in [&Lcp as &dyn Baseline, &QuantisedCoder] {
            let all = verified(baseline, &particles, bound);
            assert!(matches!(all, BoundCheck::Held(_)), "{}: {:?}", baseline.name(), all.failure());
            let run = all.run().unwrap();
            assert!(run.excess == 0.0 && run.bytes > 0 && run.decoded[0].len() == particles[0].len());
        }
    }
    assert!(matches!(verified(&Lcp, &clustered(9), -1.0), BoundCheck::Failed(Error::Argument { .. })));
}

#[test]
fn failures_are_reported_with_numbers() {
    let particles = clustered(40);
    let within = verified(&RoundingBaseline { off: 0.2, drop: 0 }, &particles, 0.25);
    assert!(within.failure().is_none() && (within.run().unwrap().largest_error - 0.2).abs() < 1e-5);
    let beyond = verified(&RoundingBaseline { off: 0.2, drop: 0 }, &particles, 0.15);
    let BoundCheck::Exceeded(run) = &beyond else { panic!("an error of 0.2 passes a bound of 0.15") };
    assert!((run.excess - 0.05).abs() < 1e-4, "{}", run.excess);
    assert!(beyond.failure().unwrap().contains("0.15"));
    let nan = verified(&RoundingBaseline { off: f32::NAN, drop: 0 }, &particles, 0.15);
    assert!(matches!(&nan, BoundCheck::Exceeded(run) if run.excess == f64::INFINITY));
    let fewer = verified(&RoundingBaseline { off: 0.0, drop: 1 }, &particles, 0.15);
    assert_eq!(fewer.failure().unwrap(), "steps: 39 particles were decoded instead of 40");
    assert!(!is_order(&[0, 0], 2) && !is_order(&[0, 2], 2) && !is_order(&[0], 2) && is_order(&[1, 0], 2));
}

#[test]
fn half_ulps_are_those_of_the_coordinate() {
    assert_eq!(half_ulp(1.0), f64::from(f32::EPSILON) / 2.0);
    assert_eq!((half_ulp(-64.0), half_ulp(f32::INFINITY), half_ulp(f32::MAX)), (half_ulp(64.0), 0.0, 0.0));
    assert!(half_ulp(0.0) > 0.0 && half_ulp(0.0) < 1e-45);
}
