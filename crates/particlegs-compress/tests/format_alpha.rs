//! Models of the alpha-blend law as files: opacities and grey levels come back whatever the counts,
//! the network goes with the first block, and law and blocks that contradict each other are refused.

#![allow(clippy::disallowed_methods)]

mod common;

use common::{
    block, certificate, check_bytes, check_cuts, coded, damaged, encoded, metadata, mixture, on_threads, partner,
    reseal,
};
use particlegs_core::codec::{CodedLayer, Encoder, Merge, Precision, VIZMAPPER_SECTION_BYTES};
use particlegs_core::context::Context;
use particlegs_core::math::Random;
use particlegs_core::model::{
    AlphaBlend, Block, CertificateLevel, Law, LawKind, Layer, MASS, Mass, Metadata, Mixture, Model,
    VIZMAPPER_PARAMETERS, VizMapper, VizRanges,
};
use particlegs_core::{Error, codec};
use proptest::prelude::*;
use std::sync::Arc;

/// A mixture with opacities over two decades, some near 1, and grey levels about 1, some 0.
fn shaded(n: usize, seed: u64, origin: f64, scale: f64) -> Mixture {
    let mut m = mixture(n, seed, origin, scale, false);
    let opacity: Vec<f64> = (0..n)
        .map(|i| {
            let logit = 2.0 * Random::new(seed, 5, i as u64).normal() - 1.0;
            1.0 / (1.0 + (-logit).exp())
        })
        .collect();
    let grey = (0..n).map(|i| (1.0 + 0.4 * Random::new(seed, 6, i as u64).normal()).max(0.0)).collect();
    let sum: f64 = opacity.iter().sum();
    m.count = opacity.iter().map(|o| 100.0 * n as f64 * o / sum).collect();
    m.law = Law::AlphaBlend(AlphaBlend { opacity, grey, vizmapper: None });
    m
}

fn network(seed: u64) -> VizMapper {
    let parameter = |i: usize| (0.2 * Random::new(seed, 7, i as u64).normal()) as f32;
    VizMapper { parameters: (0..VIZMAPPER_PARAMETERS).map(parameter).collect(), ranges: VizRanges::TRAINING }
}

fn model(mut blocks: Vec<Block>, network: Option<VizMapper>, certified: bool) -> Model {
    let mut metadata = metadata(&blocks);
    metadata.law = LawKind::AlphaBlend;
    let network = network.map(Arc::new);
    for columns in blocks.iter_mut().filter_map(|b| b.gaussians.law.alpha_blend_mut()) {
        columns.vizmapper.clone_from(&network);
    }
    let layers = vec![Layer { name: "dm".into(), mass: Mass::Each(5.1e9), content: blocks }];
    Model { metadata, layers, certificate: certified.then(certificate) }
}

/// The same without its network.
fn without_network(m: &Model) -> Model {
    let mut without = model(m.layers[0].content.clone(), None, true);
    without.certificate = m.certificate;
    without
}

/// The first block's opacities and grey levels.
fn columns(b: &Mixture) -> &AlphaBlend {
    b.law.alpha_blend().unwrap()
}

fn small() -> Model {
    model(vec![block(shaded(12, 3, 0.0, 50.0))], Some(network(1)), true)
}

/// Keeps the promises of an alpha-blend model.
fn check_sums(m: &Model) {
    assert_eq!(m.metadata.law, LawKind::AlphaBlend);
    for b in m.blocks() {
        let g = &b.gaussians;
        let shades = columns(g);
        assert_eq!((shades.opacity.len(), shades.grey.len(), g.masses().is_none()), (g.len(), g.len(), true));
        assert!(shades.opacity.iter().all(|&o| o > 0.0 && o < 1.0));
        assert!(shades.grey.iter().all(|&v| v >= 0.0 && v.is_finite()));
        assert_eq!(g.count.iter().map(|&c| c as u64).sum::<u64>(), b.count);
        // Counts are opacities' shares, rounded to one of the two whole numbers beside them.
        let sum: f64 = shades.opacity.iter().sum();
        let share = |o: f64| o / sum * b.count as f64;
        assert!(g.count.iter().zip(&shades.opacity).all(|(c, &o)| (c - share(o)).abs() <= 1.0 + 1e-9 * share(o)));
    }
}

#[test]
fn a_file_comes_back() {
    let blocks = [1, 2].map(|s| block(shaded(400, s, 10.0 * s as f64, 5.0)));
    let mut m = model(blocks.to_vec(), Some(network(1)), true);
    common::add_drawn_densities(&mut m);
    let bytes = encoded(&m);
    assert_eq!(bytes[8..12], [1, 0, 1, 0]);
    let back = codec::decode(&bytes, "m.pgs").unwrap();
    assert_eq!(back.metadata, m.metadata);
    assert_eq!(back.certificate, m.certificate);
    check_sums(&back);
    let (a, b) = (m.vizmapper().unwrap(), back.vizmapper().unwrap());
    assert_eq!(a.ranges, b.ranges);
    let largest = a.parameters.iter().fold(0.0f32, |m, p| m.max(p.abs()));
    assert!(a.parameters.iter().zip(&b.parameters).all(|(x, y)| (x - y).abs() <= 0.51 * largest / 127.0));
    let info = codec::read_info(&bytes, "m.pgs").unwrap();
    assert_eq!((info.vizmapper.as_ref(), info.layers[0].mass.is_weighted()), (Some(&**b), false));
    let coded: usize = info.layers[0].content.iter().map(|b| b.bytes as usize).sum();
    let head = Layer { name: "dm".into(), mass: Mass::Each(5.1e9), content: 2 };
    let beside = codec::size_without_blocks(&m.metadata, CertificateLevel::Quick, &[head]) + VIZMAPPER_SECTION_BYTES;
    assert_eq!(beside + coded, bytes.len());
    // Decoded and coded again it is as large, and without its network smaller by just that.
    let again = encoded(&back);
    assert!(again.len().abs_diff(bytes.len()) < bytes.len() / 50);
    assert_eq!(codec::decode(&again, "m").unwrap().vizmapper(), back.vizmapper());
    let without = encoded(&without_network(&m));
    assert_eq!(bytes.len() - without.len(), VIZMAPPER_SECTION_BYTES);
    assert_eq!(codec::decode(&without, "m").unwrap().vizmapper(), None);
}

/// Two particles for three hundred Gaussians: counts say nothing, opacities everything.
#[test]
fn opacities_do_not_depend_on_the_number_of_particles() {
    let many = block(shaded(300, 4, 0.0, 5.0));
    let few = Block { count: 2, mass: 2.0, ..many.clone() };
    let decoded = |b: &Block| codec::decode_block(&coded(b), "b").unwrap().gaussians;
    let (a, b) = (decoded(&many), decoded(&few));
    assert_eq!(a.law, b.law);
    assert_eq!((a.mean, a.cov), (b.mean, b.cov));
    assert_eq!(b.count.iter().sum::<f64>(), 2.0);
    // Nor do they on the counts that came with them.
    let mut other = many.clone();
    other.gaussians.count.fill(1.0);
    assert_eq!(decoded(&other).law, a.law);
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(32))]

    /// Opacities and grey levels come back within their steps, and the more exactly the finer.
    #[test]
    fn errors_are_bounded(seed in 0u64..1000, n in 1usize..60, q in 0.02f64..1.5) {
        let b = block(shaded(n, seed, 0.0, 50.0));
        let p = Precision { importance: 0.0, ..Precision::BALANCED }.scaled(q);
        let back = codec::decode_block(&Encoder::new(&b).unwrap().encode(&p), "b").unwrap();
        prop_assert_eq!((back.count, back.mass, back.bounds), (b.count, b.mass, b.bounds));
        let (a, c) = (columns(&b.gaussians), columns(&back.gaussians));
        for i in 0..n {
            let mean = back.gaussians.mean_of(i);
            let j = partner(&b.gaussians, mean);
            let widest = |m: &Mixture, i: usize| [0, 3, 5].map(|k| m.cov_of(i).0[k].sqrt()).into_iter().fold(0.0, f64::max);
            let reach = 20.0 * widest(&b.gaussians, j).max(widest(&back.gaussians, i));
            let near = |k: usize| (0..3).all(|d| (b.gaussians.mean[d][k] - mean[d]).abs() < reach);
            if (0..n).filter(|&k| near(k)).count() != 1 {
                continue;
            }
            // A step and what saves bits.
            let depth = |o: f64| (-(-o).ln_1p()).ln();
            prop_assert!((depth(a.opacity[j]) - depth(c.opacity[i])).abs() <= 1.01 * p.count, "{} {}", a.opacity[j], c.opacity[i]);
            let grey = |v: f64| v.max(1.0 / 1024.0).ln();
            prop_assert!((grey(a.grey[j]) - grey(c.grey[i])).abs() <= 1.01 * p.mass, "{} {}", a.grey[j], c.grey[i]);
        }
    }
}

#[test]
fn extreme_opacities_and_greys_are_coded() {
    let mut m = shaded(7, 1, 0.0, 5.0);
    let opacity = vec![0.0, f64::MIN_POSITIVE, 1e-9, 0.5, 1.0 - 1e-9, 1.0, 0.01];
    let grey = vec![0.0, 1e-300, 1.0, 50.0, 0.0, 1e200, 0.5];
    m.law = Law::AlphaBlend(AlphaBlend { opacity, grey, vizmapper: None });
    let b = Block { count: 7, mass: 7.0, ..block(m) };
    let back = model(vec![b], None, false);
    check_sums(&codec::decode(&encoded(&back), "m").unwrap());
}

/// Splats are placed by pictures: some leave the particles' bounds, and are not pulled back.
#[test]
fn splats_outside_the_bounds_stay_there() {
    let mut b = block(shaded(200, 6, 0.0, 5.0));
    let far = [[-3.0, 2.0, 2.0], [2.0, 40.0, 2.0]];
    for (i, mean) in far.iter().enumerate() {
        (0..3).for_each(|k| b.gaussians.mean[k][i] = mean[k]);
    }
    let bytes = coded(&b);
    let back = codec::decode_block(&bytes, "b").unwrap();
    for mean in far {
        let nearest = |k: usize, i: usize| (back.gaussians.mean[k][i] - mean[k]).abs() < 0.1;
        assert!((0..200).any(|i| (0..3).all(|k| nearest(k, i))), "{mean:?}");
    }
    assert_eq!((back.bounds.min[0], back.bounds.max[1]), (-3.0, 40.0));
    b.gaussians.mean[0][0] = -1.7e308;
    b.gaussians.mean[0][1] = 1.7e308;
    assert!(matches!(Encoder::new(&b), Err(Error::Argument { .. })));
}

#[test]
fn steps_scale_the_size() {
    let b = block(shaded(3000, 5, 0.0, 50.0));
    let encoder = Encoder::new(&b).unwrap();
    let size = |q: f64| encoder.encode(&Precision::BALANCED.scaled(q)).len();
    let sizes = [0.1, 0.5, 1.0, 2.0, 8.0].map(size);
    assert!(sizes.windows(2).all(|w| w[0] > w[1]), "{sizes:?}");
    for threads in [1, 3] {
        let code = || encoder.encode(&Precision::BALANCED);
        assert_eq!(on_threads(threads, code), code());
    }
}

#[test]
fn large_blocks_come_in_segments() {
    let b = block(shaded(70_000, 8, 0.0, 50.0));
    let bytes = coded(&b);
    let back = codec::decode_block(&bytes, "b").unwrap();
    check_sums(&model(vec![back.clone()], None, false));
    let mean = |g: &Mixture| columns(g).opacity.iter().sum::<f64>() / 70_000.0;
    assert!((mean(&back.gaussians) / mean(&b.gaussians) - 1.0).abs() < 0.01);
}

#[test]
fn what_cannot_be_coded_is_refused() {
    let refused = |change: &dyn Fn(&mut Mixture)| {
        let mut b = block(shaded(5, 1, 0.0, 5.0));
        change(&mut b.gaussians);
        assert!(matches!(Encoder::new(&b), Err(Error::Argument { .. })));
    };
    for o in [-1e-9, 1.0f64.next_up(), -0.5, f64::NAN] {
        refused(&|g| g.law.alpha_blend_mut().unwrap().opacity[2] = o);
    }
    for v in [-1e-9, f64::NAN, f64::INFINITY] {
        refused(&|g| g.law.alpha_blend_mut().unwrap().grey[2] = v);
    }
    refused(&|g| g.law.alpha_blend_mut().unwrap().grey.truncate(4));
    refused(&|g| g.columns.set(MASS, g.count.clone()));
    // Blocks of one law in a file of the other, and a network where there is none.
    let m = small();
    let plain = model(vec![block(mixture(12, 3, 0.0, 50.0, false))], None, false);
    let says = |m: Model, text: &str| {
        let error = codec::encode(&m, &Precision::BALANCED).unwrap_err();
        assert!(matches!(&error, Error::Argument { .. }) && error.to_string().contains(text), "{error}");
    };
    says(plain, "alpha-blend");
    let mut depth = without_network(&m);
    depth.metadata.law = LawKind::OpticalDepth;
    says(depth, "optical-depth");
    let coded = codec::coded_layers(&encoded(&without_network(&m)), "m").unwrap();
    let depth = LawKind::OpticalDepth;
    let lone = codec::assemble_with(&Metadata { law: depth, ..m.metadata }, Some(&network(1)), None, coded);
    assert!(lone.unwrap_err().to_string().contains("VizMapper"));
}

#[test]
fn truncations_and_flipped_bits_are_refused() {
    let bytes = encoded(&small());
    check_cuts(&bytes);
    check_bytes(&bytes, |byte| [1, 16, 128].map(|b| byte ^ b));
}

#[test]
fn damage_behind_the_checksums_does_not_panic() {
    let seeds = [small(), model(vec![block(shaded(40, 9, 1e8, 1e-3))], None, false)];
    for (s, m) in seeds.iter().enumerate() {
        let bytes = encoded(m);
        let mut decoded = 0;
        // Every bit once; of the network's weights, which are alike, some.
        let network = bytes.windows(4).position(|w| w == b"VIZM").map_or(0..0, |at| at + 100..at + 4700);
        let bits = (0..bytes.len() * 8).filter(|b| !network.contains(&(b / 8)) || b % 101 == 0);
        damaged(&bytes, s as u64, bits, 3000, |bad| {
            let Ok(m) = codec::decode(bad, "m") else { return };
            check_sums(&m);
            assert!(m.blocks().flat_map(|b| b.gaussians.cov.iter().flatten()).all(|v| v.is_finite()));
            assert!(m.vizmapper().iter().flat_map(|n| &n.parameters).all(|p| p.is_finite()));
            decoded += 1;
        });
        assert!(decoded > 0);
    }
}

/// A section's place in a file.
fn place(bytes: &[u8], tag: &[u8; 4]) -> usize {
    bytes.windows(4).position(|w| w == tag).unwrap()
}

#[test]
fn law_blocks_and_network_agree() {
    let law = 24 + 16 + 3;
    let changed = |bytes: &[u8], changes: &[(usize, u8)]| {
        let mut b = bytes.to_vec();
        changes.iter().for_each(|&(at, value)| b[at] = value);
        reseal(&mut b);
        codec::decode(&b, "m")
    };
    let corrupt = |r: Result<Model, Error>| assert!(matches!(r, Err(Error::Corrupt { .. })), "{r:?}");
    let newer = |r: Result<Model, Error>| assert!(matches!(r, Err(Error::Compatibility { .. })), "{r:?}");
    let alpha = encoded(&small());
    let alone = encoded(&without_network(&small()));
    let mut m = small();
    (m.metadata.law, m.layers[0].content[0].gaussians.law) = (LawKind::OpticalDepth, Law::OpticalDepth);
    let depth = encoded(&m);
    // The law says one thing, the blocks another.
    corrupt(changed(&alone, &[(law, 1)]));
    corrupt(changed(&alpha, &[(law, 1)]));
    corrupt(changed(&depth, &[(law, 2)]));
    newer(changed(&alone, &[(law, 3)]));
    let flags = place(&alone, b"BLOK") + 16 + 68;
    assert_eq!(alone[flags], 2);
    for value in [0, 1, 3, 4, 6, 0x82] {
        corrupt(changed(&alone, &[(flags, value)]));
    }
    // The network stands between what was measured and the layers, once.
    let (at, end) = (place(&alpha, b"VIZM"), place(&alpha, b"LAYR"));
    assert_eq!(end - at, VIZMAPPER_SECTION_BYTES);
    let network = &alpha[at..end];
    let put = |bytes: &[u8], at: usize| {
        let mut b = [&bytes[..at], network, &bytes[at..]].concat();
        let length = b.len() as u64;
        b[12..20].copy_from_slice(&length.to_le_bytes());
        reseal(&mut b);
        codec::decode(&b, "m")
    };
    assert_eq!(put(&alone, place(&alone, b"LAYR")).unwrap(), codec::decode(&alpha, "m").unwrap());
    for tag in [b"META", b"CERT", b"BLOK"] {
        corrupt(put(&alone, place(&alone, tag)));
    }
    corrupt(put(&alone, alone.len()));
    corrupt(put(&alpha, at));
    corrupt(put(&depth, place(&depth, b"LAYR")));
    newer(changed(&alpha, &[(at + 16, 5)]));
}

#[test]
fn merged_files_take_the_network_of_the_first_block() {
    let part = |i: u64| model(vec![block(shaded(20, i, 10.0 * i as f64, 1.0))], Some(network(i)), true);
    let files: Vec<Vec<u8>> = (1..4).map(|i| encoded(&part(i))).collect();
    let merge = |parts: &[&[u8]]| {
        let mut merge = Merge::default();
        parts.iter().enumerate().try_for_each(|(i, p)| merge.add(p, &format!("part {i}"), &Context::SILENT))?;
        merge.finish()
    };
    let [a, b, c] = [0, 1, 2].map(|i| &files[i][..]);
    let whole = merge(&[a, b, c]).unwrap();
    for parts in [[c, b, a], [b, a, c]] {
        assert_eq!(merge(&parts).unwrap(), whole);
    }
    assert_eq!(merge(&[&merge(&[b, c]).unwrap(), a]).unwrap(), whole);
    assert_eq!(merge(&[c, &merge(&[b, a]).unwrap()]).unwrap(), whole);
    let model = codec::decode(&whole, "merged").unwrap();
    check_sums(&model);
    assert_eq!((model.gaussians(), &model.certificate), (60, &None));
    let network_of = |bytes: &[u8]| codec::decode(bytes, "part").unwrap().vizmapper().cloned();
    assert_eq!(model.vizmapper().cloned(), network_of(a));
    // Shades are copied, not coded anew.
    let first = codec::decode(a, "a").unwrap();
    assert_eq!(model.layers[0].content[0].gaussians, first.layers[0].content[0].gaussians);
    // A part without a network that holds the first block leaves none.
    let bare = encoded(&without_network(&part(0)));
    assert_eq!(network_of(&merge(&[b, &bare]).unwrap()), None);
    // Laws do not mix.
    let mut other = part(5);
    (other.metadata.law, other.layers[0].content[0].gaussians.law) = (LawKind::OpticalDepth, Law::OpticalDepth);
    let error = merge(&[a, &encoded(&other)]).unwrap_err().to_string();
    assert!(error.contains("the image law is optical-depth, but that of part 0 is alpha-blend"), "{error}");
}

#[test]
fn coded_blocks_are_put_together_by_their_law() {
    let m = small();
    let bytes = encoded(&m);
    let coded = || codec::coded_layers(&bytes, "m").unwrap();
    let whole = |layers: Vec<CodedLayer>| {
        codec::assemble_with(&m.metadata, m.vizmapper().map(|v| &**v), m.certificate.as_ref(), layers)
    };
    assert_eq!(whole(coded()).unwrap(), bytes);
    let mut depth = m.metadata.clone();
    depth.law = LawKind::OpticalDepth;
    assert!(codec::assemble(&depth, None, coded()).is_err());
}

/// A file of law 2, and what it holds: see `format.rs`.
#[test]
fn files_of_version_1_0_stay_readable() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    let path = |name: &str| folder.join(name);
    if std::env::var_os("PARTICLEGS_WRITE_FIXTURES").is_some() {
        let m = model(vec![block(shaded(30, 11, 4.0, 6.0))], Some(network(2)), true);
        let bytes = encoded(&m);
        std::fs::write(path("format-1.0-alpha.json"), table(&codec::decode(&bytes, "m").unwrap()) + "\n").unwrap();
        std::fs::write(path("format-1.0-alpha.pgs"), bytes).unwrap();
    }
    let model = codec::decode(&std::fs::read(path("format-1.0-alpha.pgs")).unwrap(), "alpha").unwrap();
    check_sums(&model);
    assert_eq!(table(&model), std::fs::read_to_string(path("format-1.0-alpha.json")).unwrap().trim_end());
    assert_eq!(model.certificate, Some(certificate()));
}

/// The numbers of the first block, and of the network.
fn table(m: &Model) -> String {
    let g = &m.layers[0].content[0].gaussians;
    let shades = columns(g);
    let columns: Vec<&Vec<f64>> =
        g.mean.iter().chain(&g.cov).chain([&g.count, &shades.opacity, &shades.grey]).collect();
    common::table(&columns) + "\n" + &serde_json::to_string(&m.vizmapper().unwrap().parameters).unwrap()
}
