//! The model file's promises: it comes back, it is refused whole when anything is wrong with it,
//! and files of this version stay readable.

#![allow(clippy::disallowed_methods)]

mod common;

use common::{
    block, certificate, check_bytes, check_cuts, coded, damaged, encoded, metadata, mixture, on_threads, partner,
    reseal,
};
use particlegs_core::codec::{Encoder, Precision};
use particlegs_core::context::Context;
use particlegs_core::math::Sym3;
use particlegs_core::model::{Block, CertificateLevel, Layer, Mass, Mixture, Model};
use particlegs_core::space::Cell;
use particlegs_core::{Error, codec};
use proptest::prelude::*;

fn head(blocks: usize) -> Layer<usize> {
    Layer { name: "dm".into(), mass: Mass::Each(5.1e9), content: blocks }
}

fn model(blocks: Vec<Block>, certified: bool) -> Model {
    let metadata = metadata(&blocks);
    let certificate = certified.then(certificate);
    let mass = Mass::new(blocks[0].gaussians.masses().is_some(), Some(5.1e9));
    Model { metadata, layers: vec![Layer { name: "dm".into(), mass, content: blocks }], certificate }
}

fn small() -> Model {
    model(vec![block(mixture(12, 3, 0.0, 50.0, false))], true)
}

#[test]
fn a_file_comes_back() {
    for weighted in [false, true] {
        let blocks = [1, 2].map(|s| block(mixture(400, s, 10.0 * s as f64, 5.0, weighted)));
        let mut m = model(blocks.to_vec(), true);
        common::add_drawn_densities(&mut m);
        let bytes = encoded(&m);
        let back = codec::decode(&bytes, "m.pgs").unwrap();
        assert_eq!(back.metadata, m.metadata);
        assert_eq!(back.gaussians(), 800);
        assert_eq!(back.certificate, m.certificate);
        for (a, b) in back.blocks().zip(m.blocks()) {
            assert_eq!((a.count, a.mass, a.bounds), (b.count, b.mass, b.bounds));
            assert_eq!(a.gaussians.count.iter().map(|&c| c as u64).sum::<u64>(), b.count);
            if let Some(mass) = a.gaussians.masses() {
                assert!((mass.iter().sum::<f64>() / b.mass - 1.0).abs() < 1e-12);
            }
        }
        let info = codec::read_info(&bytes, "m.pgs").unwrap();
        assert_eq!(info.layers[0].content.len(), 2);
        assert_eq!(codec::read_metadata(&bytes, "m.pgs").unwrap(), m.metadata);
        let coded: usize = info.layers[0].content.iter().map(|b| b.bytes as usize).sum();
        // What was kept has masses where there are any.
        assert_eq!(
            codec::size_without_blocks(&m.metadata, CertificateLevel::Quick, &[head(2)]) + coded,
            bytes.len() - if weighted { 11 } else { 0 }
        );
    }
}

#[test]
fn what_is_not_gaussians_is_small() {
    let m = small();
    let size = codec::size_without_blocks(&m.metadata, CertificateLevel::None, &[head(1)]);
    assert!(size < 400, "{size} bytes");
    let certified = codec::size_without_blocks(&m.metadata, CertificateLevel::Quick, &[head(1)]);
    assert!(certified - size <= 16 + 400);
}

#[test]
fn layers_that_differ_come_back() {
    let layer = |name: &str, seed, mass: Mass| Layer {
        name: name.into(),
        mass,
        content: vec![block(mixture(60, seed, 0.0, 5.0, mass.is_weighted()))],
    };
    let layers =
        vec![layer("dm", 1, Mass::Each(2.5)), layer("gas", 2, Mass::Weights(None)), layer("stars", 3, Mass::Unknown)];
    let mut m = model(layers.iter().flat_map(|l| l.content.clone()).collect(), false);
    m.layers = layers;
    m.metadata.cell = Some(Cell { origin: [-1.0, 2.0, 0.5], ..Cell::orthogonal([50.0; 3]) });
    let bytes = encoded(&m);
    assert_eq!(bytes[8..12], [1, 0, 1, 0]);
    let back = codec::decode(&bytes, "m.pgs").unwrap();
    assert_eq!(back.metadata, m.metadata);
    let said = |m: &Model| m.layers.iter().map(|l| l.mass).collect::<Vec<_>>();
    assert_eq!(said(&back), said(&m));
    assert_eq!(back.mass(), None);
    let info = codec::read_info(&bytes, "m.pgs").unwrap();
    assert!(info.layers[1].mass.is_weighted() && info.layers[0].mass == Mass::Each(2.5));
    let only = back.only(&["gas".into(), "dm".into()]).unwrap();
    assert_eq!(only.metadata.count, only.layers.iter().map(|l| l.count()).sum::<u64>());
    assert!(
        (only.mass().unwrap() - (2.5 * only.layers[0].content[0].mass + only.layers[1].content[0].mass)).abs() < 1e-6
    );
    assert!(only.only(&["stars".into()]).is_err());
}

#[test]
fn the_order_of_merging_does_not_show() {
    let m = model([1, 2, 3].map(|s| block(mixture(50, s, s as f64, 1.0, false))).to_vec(), false);
    let bytes = encoded(&m);
    let layers = codec::coded_layers(&bytes, "m.pgs").unwrap();
    let mut blocks = layers[0].content.clone();
    blocks.rotate_left(1);
    let again = Layer { name: "dm".into(), mass: Mass::Each(5.1e9), content: blocks };
    assert_eq!(codec::assemble(&m.metadata, None, vec![again]).unwrap(), bytes);
    // A block's bytes are its own: alone it codes to the same.
    let alone = coded(&m.layers[0].content[1]);
    assert!(layers[0].content.contains(&alone.into()));
}

#[test]
fn every_truncation_is_refused() {
    let bytes = encoded(&small());
    check_cuts(&bytes);
    let mut long = bytes;
    long.push(0);
    assert!(matches!(codec::decode(&long, "m"), Err(Error::Corrupt { .. })));
}

#[test]
fn every_flipped_bit_and_saturated_byte_is_refused() {
    check_bytes(&encoded(&small()), |byte| std::array::from_fn::<_, 8, _>(|b| byte ^ 1 << b));
}

#[test]
fn damage_behind_the_checksums_does_not_panic() {
    let seeds = [small(), model(vec![block(mixture(40, 9, 1e8, 1e-3, true))], false)];
    for (s, m) in seeds.iter().enumerate() {
        let bytes = encoded(m);
        let mut decoded = 0;
        damaged(&bytes, s as u64, 0..bytes.len() * 8, 4000, |bad| decoded += u32::from(sound(bad)));
        // Damaged places and colours of the stream may still be Gaussians.
        assert!(decoded > 0);
    }
}

/// Decodes; what is accepted keeps the format's promises.
fn sound(file: &[u8]) -> bool {
    let Ok(m) = codec::decode(file, "m") else { return false };
    for b in m.blocks() {
        assert_eq!(b.gaussians.count.iter().map(|&c| c as u64).sum::<u64>(), b.count);
        assert!(b.gaussians.cov.iter().chain(&b.gaussians.mean).flatten().all(|v| v.is_finite()));
    }
    true
}

#[test]
fn newer_files_are_told_apart() {
    let bytes = encoded(&small());
    let changed = |at: usize, value: u8| {
        let mut b = bytes.clone();
        b[at] = value;
        reseal(&mut b);
        codec::decode(&b, "m")
    };
    assert!(matches!(changed(8, 2), Err(Error::Compatibility { .. })));
    assert!(changed(9, 5).is_ok(), "a newer minor version is read");
    // The image law: the fourth byte of the first section's content.
    assert!(matches!(changed(24 + 16 + 3, 9), Err(Error::Compatibility { .. })));
    let add = |tag| codec::decode(&with_section(&bytes, tag, &[0; 6]), "m");
    assert_eq!(add(b"note").unwrap(), codec::decode(&bytes, "m").unwrap());
    assert_eq!(add(b"nOTE").unwrap(), codec::decode(&bytes, "m").unwrap());
    assert!(matches!(add(b"NOTE"), Err(Error::Compatibility { .. })));
}

/// A file with one more section at its end.
fn with_section(file: &[u8], tag: &[u8; 4], content: &[u8]) -> Vec<u8> {
    let mut b = file.to_vec();
    b.extend(tag);
    b.extend((content.len() as u64).to_le_bytes());
    b.extend([0; 4]);
    b.extend(content);
    let length = b.len() as u64;
    b[12..20].copy_from_slice(&length.to_le_bytes());
    reseal(&mut b);
    b
}

#[test]
fn a_huge_claim_is_refused_before_it_is_believed() {
    let bytes = encoded(&small());
    let block = bytes.windows(4).position(|w| w == b"BLOK").unwrap() + 16;
    let mut b = bytes;
    b[block + 64..block + 68].copy_from_slice(&u32::MAX.to_le_bytes());
    reseal(&mut b);
    assert!(matches!(codec::decode(&b, "m"), Err(Error::Corrupt { .. })));
}

/// The end of a block's header, in a block of three stages: number of segments, length of the trunk, then
/// the lengths of the streams.
const TABLE: usize = 128;
const STAGES: usize = 3;

fn number(bytes: &[u8], at: usize) -> u32 {
    u32::from_le_bytes(bytes[at..at + 4].try_into().unwrap())
}

#[test]
fn large_blocks_come_in_segments() {
    let b = block(mixture(70_000, 8, 0.0, 50.0, true));
    let bytes = coded(&b);
    let segments = number(&bytes, TABLE) as usize;
    assert!((2..=3).contains(&segments), "{segments}");
    let lengths: u32 = (0..=STAGES * segments).map(|i| number(&bytes, TABLE + 4 + 4 * i)).sum();
    assert_eq!(TABLE + 8 + 4 * STAGES * segments + lengths as usize, bytes.len());
    let back = codec::decode_block(&bytes, "b").unwrap();
    assert_eq!(back.gaussians.len(), 70_000);
    assert_eq!(back.gaussians.count.iter().map(|&c| c as u64).sum::<u64>(), b.count);
    // The mixture as a whole is where it was: no segment is lost, doubled or out of place.
    for k in 0..3 {
        let mean = |m: &Mixture| m.mean[k].iter().sum::<f64>() / 70_000.0;
        assert!((mean(&back.gaussians) - mean(&b.gaussians)).abs() < 1e-3);
    }
    for threads in [1, 3] {
        assert_eq!(on_threads(threads, || coded(&b)), bytes);
        assert_eq!(on_threads(threads, || codec::decode_block(&bytes, "b").unwrap()), back);
    }
}

/// In any order, some or all, one after the other or several at once; and what there is of a model meanwhile.
#[test]
fn pieces_of_a_model_are_read_on_their_own() {
    let alone = |seed, x| block(mixture(500, seed, x, 5.0, true));
    let m = model(vec![alone(1, 0.0), block(mixture(70_000, 8, 20.0, 50.0, true)), alone(2, 90.0)], true);
    let bytes = encoded(&m);
    let whole = codec::decode(&bytes, "m").unwrap();
    let new = || codec::Decoder::new(&bytes[..], "m", &Context::SILENT).unwrap();
    let pieces = new().pieces();
    assert!((4..=5).contains(&pieces), "{pieces}");
    assert_eq!((0..pieces).map(|p| new().gaussians(p)).sum::<usize>(), whole.gaussians());
    for read in [vec![], vec![2], vec![3, 0], (0..pieces).rev().collect()] {
        let mut decoder = new();
        read.iter().for_each(|&p| decoder.read(p).unwrap());
        assert_eq!(decoder.finish().unwrap(), whole, "{read:?}");
    }
    let mut decoder = new();
    assert_eq!(decoder.info(), &codec::read_info(&bytes, "m").unwrap());
    let count =
        |d: &codec::Decoder<'_>| -> f64 { (0..pieces).map(|p| d.so_far(p).unwrap().count.iter().sum::<f64>()).sum() };
    let all = m.metadata.count as f64;
    assert!((count(&decoder) / all - 1.0).abs() < 1e-9);
    for p in 0..pieces {
        let boxes = decoder.so_far(p).unwrap();
        decoder.read(p).unwrap();
        let read = decoder.so_far(p).unwrap();
        assert_eq!((read.len(), decoder.layer(p)), (decoder.gaussians(p), 0));
        // Each lies in one of the boxes, whose half width is the root of 1.5 variances.
        let inside = |i: usize, b: usize| {
            (0..3).all(|k| {
                let off = read.mean[k][i] - boxes.mean[k][b];
                off.abs() <= (1.5 * boxes.cov[[0, 3, 5][k]][b]).sqrt() * 1.000_001
            })
        };
        assert!(boxes.len() < 100 && (0..read.len()).all(|i| (0..boxes.len()).any(|b| inside(i, b))), "{p}");
    }
    assert!((count(&decoder) / all - 1.0).abs() < 0.02, "{}", count(&decoder) / all);
    let mass: f64 = (0..pieces).map(|p| decoder.so_far(p).unwrap().masses().unwrap().iter().sum::<f64>()).sum();
    assert!((mass / m.metadata.mass - 1.0).abs() < 0.02, "{mass} {}", m.metadata.mass);
    let order = whole.blocks().flat_map(|b| b.gaussians.mean[0].clone());
    assert!((0..pieces).flat_map(|p| decoder.so_far(p).unwrap().mean[0].clone()).eq(order));
}

#[test]
fn a_table_of_streams_that_lies_is_refused() {
    let b = block(mixture(70_000, 8, 0.0, 50.0, false));
    let bytes = coded(&b);
    let refused = |changes: &[(usize, u32)], case: &str| {
        let mut bad = bytes.clone();
        for &(field, value) in changes {
            bad[TABLE + 4 * field..TABLE + 4 * field + 4].copy_from_slice(&value.to_le_bytes());
        }
        assert!(matches!(codec::decode_block(&bad, "b"), Err(Error::Corrupt { .. })), "{case}");
    };
    let field = |i: usize| number(&bytes, TABLE + 4 * i);
    let segments = field(0);
    for k in [0, segments - 1, segments + 1, 4, u32::MAX] {
        refused(&[(0, k)], &format!("{k} segments"));
    }
    for i in 1..=STAGES * segments as usize + 1 {
        for length in [0, 7, field(i) - 2, field(i) - 1, field(i) + 1, field(i) + 2, bytes.len() as u32, u32::MAX] {
            refused(&[(i, length)], &format!("length {i} is {length}"));
        }
    }
    // Lengths that lie but sum to the truth.
    refused(&[(1, field(1) - 2), (2, field(2) + 2)], "from the trunk to a segment");
    refused(&[(2, field(2) - 2), (3, field(3) + 2)], "from a segment to the next");
    refused(&[(2, field(3)), (3, field(2))], "exchanged");
    for n in [TABLE, TABLE + 3, TABLE + 11, bytes.len() - 1] {
        assert!(matches!(codec::decode_block(&bytes[..n], "b"), Err(Error::Corrupt { .. })), "cut at {n}");
    }
    let mut long = bytes.clone();
    long.extend([0, 0]);
    assert!(matches!(codec::decode_block(&long, "b"), Err(Error::Corrupt { .. })));
}

#[test]
fn a_pile_that_cannot_be_taken_apart_is_one_segment() {
    let mut g = Mixture::default();
    (0..66_000).for_each(|_| g.push([3.0; 3], Sym3::scaled_identity(1.0), 2.0, 2.0));
    let b = block(g);
    let bytes = coded(&b);
    assert_eq!(number(&bytes, TABLE), 1);
    assert_eq!(codec::decode_block(&bytes, "b").unwrap().gaussians.mean, b.gaussians.mean);
}

#[test]
fn degenerate_gaussians_are_coded() {
    let cases: [(&str, Vec<[f64; 3]>, Sym3); 5] = [
        ("one particle", vec![[1.0, 2.0, 3.0]], Sym3::default()),
        ("all equal", vec![[5.0; 3]; 9], Sym3::default()),
        ("a line", (0..9).map(|i| [f64::from(i), 0.0, 0.0]).collect(), Sym3([0.1, 0.0, 0.0, 0.0, 0.0, 0.0])),
        (
            "a plane",
            (0..9).map(|i| [f64::from(i), f64::from(i * i % 7), 2.0]).collect(),
            Sym3([0.1, 0.0, 0.0, 0.2, 0.0, 0.0]),
        ),
        (
            "far away",
            (0..9).map(|i| [1e30 + 1e25 * f64::from(i), 0.0, 1e-30]).collect(),
            Sym3([1e48, 0.0, 0.0, 0.0, 0.0, 0.0]),
        ),
    ];
    for (name, means, cov) in cases {
        let mut g = Mixture::default();
        means.iter().for_each(|&m| g.push(m, cov, 1.0, 1.0));
        let m = model(vec![block(g)], false);
        let back = codec::decode(&encoded(&m), name).unwrap();
        let g = &back.layers[0].content[0].gaussians;
        assert_eq!(g.count, vec![1.0; means.len()], "{name}");
        let extent = m.layers[0].content[0].bounds.extent();
        for i in 0..g.len() {
            let original = &m.layers[0].content[0].gaussians;
            let near = original.mean_of(partner(original, g.mean_of(i)));
            for k in 0..3 {
                assert!((g.mean[k][i] - near[k]).abs() <= 0.1 * extent[k], "{name}");
            }
            assert!(g.cov_of(i).inverse().is_some() || extent[0] < 1e-20 || extent[0] > 1e20, "{name}");
        }
    }
}

#[test]
fn a_small_feature_in_a_large_box_stands_still() {
    // Two Gaussians of 1e-9 of the box, a few of their radii apart, and two at the corners.
    let mut g = Mixture::default();
    for (x, size) in [(0.0, 1.0), (1e9, 1.0), (123_456_789.0, 1.0), (123_456_793.0, 1.0)] {
        g.push([x; 3], Sym3::scaled_identity(size), 100.0, 100.0);
    }
    let m = model(vec![block(g)], false);
    let back = codec::decode(&encoded(&m), "m").unwrap();
    let means = &back.layers[0].content[0].gaussians.mean[0];
    for x in [0.0, 123_456_789.0, 123_456_793.0, 1e9] {
        let error = means.iter().map(|v| (v - x).abs()).fold(f64::INFINITY, f64::min);
        assert!(error < 0.6, "{error} radii at {x}");
    }
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(48))]

    /// Each number comes back within what its step allows.
    #[test]
    fn errors_are_bounded(
        seed in 0u64..1000,
        n in 1usize..60,
        exponent in -30i32..30,
        shift in -3f64..3.0,
        q in 0.05f64..1.5,
    ) {
        let scale = 10f64.powi(exponent);
        let b = block(mixture(n, seed, shift * scale, scale, seed % 2 == 0));
        // Steps that do not depend on the Gaussian, so that the bound is plain.
        let p = Precision { importance: 0.0, ..Precision::BALANCED }.scaled(q);
        let bytes = Encoder::new(&b).unwrap().encode(&p);
        let back = codec::decode_block(&bytes, "b").unwrap();
        prop_assert_eq!(back.gaussians.len(), n);
        prop_assert_eq!(back.gaussians.count.iter().map(|&c| c as u64).sum::<u64>(), b.count);
        for i in 0..n {
            let g = &back.gaussians;
            let j = partner(&b.gaussians, g.mean_of(i));
            let log = |c: &Sym3| c.scale(1.0 / scale / scale).eigen().values.map(|v| 0.5 * v.ln());
            let (a, c) = (log(&g.cov_of(i)), log(&b.gaussians.cov_of(j)));
            // The partner may be another of a close pair: compare where it is plainly itself.
            let widest = |l: [f64; 3]| scale * l[0].exp();
            let lonely_reach = 2.8 * p.position * widest(a).max(widest(c));
            let lonely = (0..n).filter(|&k| (0..3).all(|d| (b.gaussians.mean[d][k] - b.gaussians.mean[d][j]).abs() < 4.0 * lonely_reach)).count() == 1;
            if !lonely || c[0] - c[2] > 6.0 {
                continue;
            }
            for k in 0..3 {
                let close = (g.mean[k][i] - b.gaussians.mean[k][j]).abs();
                // Three axes, each off by 1.6 steps of the Gaussian's own width at most.
                let width = [g.cov_of(i), b.gaussians.cov_of(j)].map(|c| c.0[[0, 3, 5][k]].sqrt());
                let reach = 1.6 * 3f64.sqrt() * p.position * width[0].max(width[1]);
                prop_assert!(close <= reach + 1e-12 * scale * (1.0 + shift.abs()), "{close} > {reach}");
                // Size and five shape numbers, each off by a step at most (a step and a half where bits are saved).
                let bound = 1.01 * p.size + 1.5 * p.shape * 5f64.sqrt();
                prop_assert!((a[k] - c[k]).abs() <= bound, "{a:?} {c:?}");
            }
        }
    }
}

#[test]
fn threads_and_simd_give_the_same_bytes() {
    let m = model(vec![block(mixture(3000, 5, 0.0, 1.0, true))], false);
    let code = || encoded(&m);
    let bytes = code();
    for threads in [1, 2, 5] {
        assert_eq!(on_threads(threads, code), bytes);
        let back = on_threads(threads, || codec::decode(&bytes, "m"));
        assert_eq!(back.unwrap(), codec::decode(&bytes, "m").unwrap());
    }
}

/// Files of version 1.0 and what they hold, one of them with all that is to come: an open file with an index and
/// sections that nobody knows yet. To write them anew after a deliberate change: PARTICLEGS_WRITE_FIXTURES=1.
#[test]
fn files_of_version_1_0_stay_readable() {
    let folder = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/fixtures");
    let path = |name: &str| folder.join(name);
    if std::env::var_os("PARTICLEGS_WRITE_FIXTURES").is_some() {
        let m = model(vec![block(mixture(30, 11, 4.0, 6.0, true))], true);
        let bytes = encoded(&m);
        let mut room = with_section(&bytes, b"fiLD", b"\0\0\0\0a field of block 0");
        room = with_section(&room, b"paRT", b"\0\0\0\0its particles");
        room = with_section(&room, b"nOTe", b"of the whole file");
        room = with_section(&room, b"iNDX", &index(&room));
        room[12..20].fill(0);
        reseal(&mut room);
        room.extend(b"LAYR and the rest of a section that was not written whole");
        std::fs::write(path("format-1.0.json"), table(&codec::decode(&bytes, "m").unwrap()) + "\n").unwrap();
        std::fs::write(path("format-1.0.pgs"), bytes).unwrap();
        std::fs::write(path("format-1.0-room.pgs"), room).unwrap();
    }
    for (name, others) in [("format-1.0.pgs", vec![]), ("format-1.0-room.pgs", vec!["fiLD", "paRT", "nOTe"])] {
        let bytes = std::fs::read(path(name)).unwrap();
        let model = codec::decode(&bytes, name).unwrap();
        let values = std::fs::read_to_string(path("format-1.0.json")).unwrap();
        assert_eq!(table(&model), values.trim_end());
        assert_eq!(model.certificate, Some(certificate()));
        let info = codec::read_info(&bytes, name).unwrap();
        assert_eq!(info.missing(), None);
        assert_eq!(info.other_sections.iter().map(|s| &s.0[..]).collect::<Vec<_>>(), others);
    }
}

/// The entries of a file's index.
fn index(file: &[u8]) -> Vec<u8> {
    let (mut out, mut at) = (Vec::new(), 24);
    while at < file.len() {
        let length = u64::from_le_bytes(file[at + 4..at + 12].try_into().unwrap());
        out.extend(&file[at..at + 4]);
        let block = if file[at + 1].is_ascii_lowercase() { number(file, at + 16) } else { u32::MAX };
        out.extend(block.to_le_bytes());
        out.extend((at as u64).to_le_bytes());
        out.extend(length.to_le_bytes());
        at += 16 + length as usize;
    }
    out
}

/// The numbers of the first block.
fn table(m: &Model) -> String {
    let g = &m.layers[0].content[0].gaussians;
    common::table(&g.mean.iter().chain(&g.cov).chain([&g.count]).chain(g.masses()).collect::<Vec<_>>())
}
