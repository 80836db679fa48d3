use super::*;
use crate::testing::{clustered, held, odd};
use proptest::prelude::*;

#[test]
fn the_bound_is_kept_and_larger_bounds_give_smaller_files() {
    let particles = clustered(5000);
    let sizes = [0.001, 0.03, 0.5, 4.0, 100.0].map(|bound| held(&QuantisedCoder, &particles, bound));
    assert!(sizes.windows(2).all(|w| w[0] > w[1]), "{sizes:?}");
    assert!(sizes[2] * 4 < 12 * 5000);
}

#[test]
fn unusual_particles_survive_a_round_trip() {
    odd().iter().for_each(|(particles, bound)| {
        held(&QuantisedCoder, particles, *bound);
    });
    let strange = [vec![f32::NAN, 1.0, f32::INFINITY], vec![2.0; 3], vec![-0.0, 0.0, 5.0]];
    held(&QuantisedCoder, &strange, 0.1);
    for bound in [0.0, -1.0, f64::NAN, f64::INFINITY] {
        assert!(QuantisedCoder.compress(&strange, bound).is_err());
    }
}

fn layout(particles: &PositionColumns, bound: f64) -> u8 {
    held(&QuantisedCoder, particles, bound);
    let coded = QuantisedCoder.compress(particles, bound).unwrap();
    packed::opened(&coded.bytes).unwrap().0[0]
}

#[test]
fn layouts_are_chosen_by_their_sizes() {
    assert_eq!(layout(&clustered(20_000), 1.0), CodingLayout::Cells as u8);
    // Each column steps evenly around a circle by its own step: only the input order is simple.
    let even = [0, 1, 2].map(|k| (0..2000).map(|i| (i * (k * 3001 + 17) % 2003) as f32).collect());
    assert_eq!(layout(&even, 0.25), CodingLayout::File as u8);
    // Too many bins for 64-bit codes.
    let fine = clustered(3000);
    assert!([CodingLayout::Axes as u8, CodingLayout::File as u8].contains(&layout(&fine, 1e-7)));
}

#[test]
fn every_layout_decodes_to_the_same_particles() {
    let particles = clustered(2000);
    let sorted = SortedParticles::new(ParticleBins::new(&particles, 0.2).unwrap());
    for layout in BINNED {
        let bytes = packed::sealed(sorted.coded(layout).unwrap(), 2000);
        let decoded = QuantisedCoder.decompress(&bytes).unwrap();
        let order = (layout != CodingLayout::File).then_some(&sorted.order[..]);
        assert!(crate::largest_error(&particles, &decoded, order) <= 0.2);
    }
}

/// The checksum catches damaged bytes; with a matching checksum nothing may panic.
#[test]
fn damaged_bytes_are_refused() {
    let particles = clustered(300);
    let sorted = SortedParticles::new(ParticleBins::new(&particles, 0.3).unwrap());
    let exact = exact(&clustered(40)).bytes;
    let all = BINNED.map(|l| packed::sealed(sorted.coded(l).unwrap(), 300));
    for good in all.iter().chain([&exact]) {
        for i in 0..good.len() {
            for flip in [1, 0x10, 0x80, 0xff] {
                let mut bad = good.clone();
                bad[i] ^= flip;
                assert!(QuantisedCoder.decompress(&bad).is_err());
                let _ = QuantisedCoder.decompress(&packed::sealed(bad[4..].to_vec(), 0));
            }
            assert!(QuantisedCoder.decompress(&good[..i]).is_err());
            let _ = QuantisedCoder.decompress(&packed::sealed(good[4.min(i)..i].to_vec(), 0));
        }
    }
}

proptest! {
    #[test]
    fn any_particles_are_within_the_bound(
        rows in prop::collection::vec([-1e3f32..1e3, -1.0f32..1.0, 0.0f32..1e-3], 0..200),
        bound in 1e-4f64..10.0,
    ) {
        held(&QuantisedCoder, &[0, 1, 2].map(|k| rows.iter().map(|r| r[k]).collect()), bound);
    }

    #[test]
    fn any_bytes_are_no_panic(bytes in prop::collection::vec(any::<u8>(), 0..300), kind in 0u8..6) {
        let mut all = vec![kind];
        all.extend(bytes);
        let _ = QuantisedCoder.decompress(&packed::sealed(all, 0));
    }
}
