//! Sections that a file keeps though its reader does not know them, and files that end early.

use super::container::{self, BLOCK, LAYER, META, STAGE, Section, Tag};
use super::{
    CodedFrame, Encoder, INDEX_FROM, Merge, Precision, SeriesClock, SeriesDecoder, SeriesFile, StoredBlock,
    StoredSection, assemble, assemble_series, coded_layers, decode, decode_block, decode_prefix, encode, read_info,
};
use crate::Error;
use crate::context::Context;
use crate::math::{Random, Sym3, each_axis};
use crate::model::{Block, LawKind, Layer, Mass, Metadata, Mixture, Model};
use crate::space::Bounds;

/// Clumps of Gaussians in a box at `corner`.
fn block(gaussians: usize, corner: f64, weighted: bool) -> Block {
    let mut mixture = Mixture::new(weighted);
    for i in 0..gaussians as u64 {
        let mut clump = Random::new(2, 0, i / 30);
        let mut r = Random::new(1, 0, i);
        let centre = each_axis(|_| clump.uniform());
        let mean = each_axis(|k| corner + 8.0 * centre[k] + (0.2 * r.normal()).clamp(-1.0, 1.0) + 1.0);
        let size = 1e-3 * (0.7 * r.normal()).exp();
        let count = 5.0 + (90.0 * r.uniform()).floor();
        mixture.push(mean, Sym3([2.0 * size, 0.3 * size, 0.0, size, 0.0, 0.5 * size]), count, 3.0 * count);
    }
    let count = mixture.count.iter().sum::<f64>() as u64;
    let bounds = Bounds { min: [corner; 3], max: [corner + 10.0; 3] };
    let mass = mixture.masses().map_or(count as f64, |m| m.iter().sum());
    Block { bounds, count, mass, gaussians: mixture }
}

/// A model of two layers with two blocks each, two of them in stages.
fn model() -> Model {
    let blocks = |weighted| vec![block(40, 0.0, weighted), block(5000, 20.0, weighted)];
    let layer = |name: &str, weighted| Layer {
        name: name.into(),
        mass: Mass::new(weighted, Some(2.0)),
        content: blocks(weighted),
    };
    let layers = vec![layer("dm", false), layer("gas", true)];
    let all = || layers.iter().flat_map(|l| &l.content);
    let bounds = Bounds { min: [0.0; 3], max: [30.0; 3] };
    let metadata = Metadata {
        mass: all().map(|b| b.mass).sum(),
        ..Metadata::new(LawKind::OpticalDepth, all().map(|b| b.count).sum(), bounds)
    };
    Model { metadata, layers, certificate: None }
}

fn file() -> Vec<u8> {
    encode(&model(), &Precision::BALANCED).unwrap()
}

fn sections(file: &[u8]) -> Vec<Section<'_>> {
    container::read(container::MODEL, file, "m").ok().unwrap().sections
}

fn with<'a>(file: &'a [u8], change: impl FnOnce(&mut Vec<Section<'a>>)) -> Vec<u8> {
    let mut all = sections(file);
    change(&mut all);
    container::write(container::MODEL, &all, false)
}

fn open(file: &[u8]) -> Vec<u8> {
    let mut open = file.to_vec();
    open[12..20].fill(0);
    let sum = crc32fast::hash(&open[..20]);
    open[20..24].copy_from_slice(&sum.to_le_bytes());
    open
}

fn merged(parts: &[&[u8]]) -> Vec<u8> {
    let mut merge = Merge::default();
    parts.iter().for_each(|p| merge.add(p, "a part", &Context::SILENT).unwrap());
    merge.finish().unwrap()
}

fn tags(file: &[u8]) -> Vec<Tag> {
    sections(file).iter().map(|s| s.tag).collect()
}

#[test]
fn stages_come_after_the_first_stages_of_all_blocks() {
    let file = file();
    assert_eq!(tags(&file), [META, LAYER, BLOCK, BLOCK, LAYER, BLOCK, BLOCK, STAGE, STAGE, STAGE, STAGE]);
    let owners: Vec<Option<u32>> = sections(&file)[7..].iter().map(|s| s.block).collect();
    assert_eq!(owners, [Some(1), Some(3), Some(1), Some(3)]);
}

#[test]
fn unknown_sections_in_every_place_are_read_and_survive_merging() {
    let file = file();
    let places = sections(&file).len();
    let whole = decode(&file, "m").unwrap();
    for at in 1..=places {
        for (tag, block) in [(*b"xTRa", None), (*b"xtra", Some(2)), (*b"xtra", Some(0))] {
            let other = with(&file, |all| all.insert(at, Section::new(tag, block, b"what is to come")));
            assert_eq!(decode(&other, "m").unwrap(), whole, "{at}");
            let info = read_info(&other, "m").unwrap();
            assert_eq!(info.other_sections, [(tag.escape_ascii().to_string(), 15)]);
            let merged = merged(&[&other]);
            let copies: Vec<_> = sections(&merged).into_iter().filter(|s| s.tag == tag).collect();
            assert_eq!(copies.len(), 1, "{at}");
            assert_eq!((copies[0].block, copies[0].bytes), (block, &b"what is to come"[..]));
        }
    }
}

#[test]
fn sections_move_with_their_blocks_when_files_are_merged() {
    let file_at = |corner: f64, content: &[u8]| {
        let block = block(30, corner, false);
        let metadata = Metadata::new(LawKind::OpticalDepth, block.count, block.bounds);
        let coded = Encoder::new(&block).unwrap().encode(&Precision::BALANCED);
        let sections = vec![StoredSection { tag: *b"fiLD", bytes: content.to_vec() }];
        let layer =
            Layer { name: "dm".into(), mass: Mass::Unknown, content: vec![StoredBlock { bytes: coded, sections }] };
        assemble(&metadata, None, vec![layer]).unwrap()
    };
    let (a, b) = (file_at(50.0, b"right"), file_at(0.0, b"left"));
    let merged_file = merged(&[&a, &b]);
    assert_eq!(merged_file, merged(&[&b, &a]));
    let layers = coded_layers(&merged_file, "m").unwrap();
    let contents: Vec<&[u8]> = layers[0].content.iter().map(|b| &b.sections[0].bytes[..]).collect();
    assert_eq!(contents, [b"left", &b"right"[..]]);
}

#[test]
fn what_may_not_be_skipped_or_belongs_to_no_block_is_refused() {
    let file = file();
    let refused = |tag: &Tag, block| with(&file, |all| all.push(Section::new(*tag, block, b"")));
    assert!(matches!(decode(&refused(b"XTRA", None), "m"), Err(Error::Compatibility { .. })));
    assert!(matches!(decode(&refused(b"Xtra", Some(0)), "m"), Err(Error::Compatibility { .. })));
    assert!(matches!(decode(&refused(b"xtra", Some(4)), "m"), Err(Error::Corrupt { .. })));
    assert!(matches!(decode(&refused(b"META", None), "m"), Err(Error::Corrupt { .. })));
    assert!(matches!(decode(&refused(b"x1RA", None), "m"), Err(Error::Corrupt { .. })));
    let first = with(&file, |all| all.insert(0, Section::new(*b"xTRA", None, b"")));
    assert!(matches!(decode(&first, "m"), Err(Error::Corrupt { .. })));
    // A block that is missing before stages of others.
    let gap = open(&with(&file, |all| {
        all.remove(6);
    }));
    assert!(matches!(decode(&gap, "m"), Err(Error::Corrupt { .. })));
    // The last stage that is there, a byte too short or too long; the table of the block says how long it is.
    let cut = with(&file, |all| all.truncate(7));
    assert!(decode(&cut, "m").is_ok());
    for at in [3, 6] {
        let block = sections(&cut)[at].bytes;
        for other in [&block[..block.len() - 2], &[block, &[0, 0]].concat()] {
            let other = with(&cut, |all| all[at].bytes = other);
            assert!(matches!(decode(&other, "m"), Err(Error::Corrupt { .. })), "{at}");
        }
    }
    // A stage twice, of another block, or before an earlier one.
    for (from, to) in [(7, 8), (8, 7), (9, 7), (10, 9)] {
        let moved = with(&file, |all| all.swap(from, to));
        assert!(matches!(decode(&moved, "m"), Err(Error::Corrupt { .. })), "{from} {to}");
        let twice = with(&file, |all| all[to] = all[from]);
        assert!(matches!(decode(&twice, "m"), Err(Error::Corrupt { .. })), "{from} {to}");
    }
}

#[test]
fn files_of_before_the_first_release_and_series_are_told_apart() {
    let kind = |kind: u8| {
        let mut file = file();
        file[10] = kind;
        let sum = crc32fast::hash(&file[..20]);
        file[20..24].copy_from_slice(&sum.to_le_bytes());
        decode(&file, "m").unwrap_err().to_string()
    };
    assert!(kind(0).contains("made before the first release: compress again"), "{}", kind(0));
    assert!(kind(2).contains("series"), "{}", kind(2));
    assert!(kind(9).contains("kind 9"), "{}", kind(9));
}

#[test]
fn an_index_lists_what_there_is() {
    let file = file();
    let all = sections(&file);
    let indexed = container::write(container::MODEL, &all, true);
    assert_eq!(decode(&indexed, "m").unwrap(), decode(&file, "m").unwrap());
    // It is left out of what merging copies, and of an open file the end may be missing.
    assert_eq!(merged(&[&indexed]), merged(&[&file]));
    let opened = open(&indexed);
    assert!(decode(&opened[..opened.len() - 1], "m").is_ok());
    // Another section than it lists.
    let mut other = all.clone();
    other.push(Section::new(*b"xTRA", None, b""));
    let listed = container::write(container::MODEL, &other, true);
    let without = {
        let mut all = sections(&listed);
        let index = Section::new(*b"iNDX", None, &listed[container::HEAD_BYTES + 16 + all[0].bytes.len() + 16..]);
        let length = container::ENTRY_BYTES * (all.len() - 1);
        all.pop();
        all.insert(1, Section { bytes: &index.bytes[..length], ..index });
        container::write(container::MODEL, &all, false)
    };
    assert!(matches!(decode(&without, "m"), Err(Error::Corrupt { .. })));
}

/// An open file, cut anywhere: what is whole of it is read, and its particles are those of the blocks that are there.
#[test]
fn an_open_file_is_read_up_to_its_last_whole_section() {
    let opened = open(&file());
    let whole = decode(&file(), "m").unwrap();
    assert_eq!(decode(&opened, "m").unwrap(), whole);
    let ends: Vec<usize> = sections(&opened).iter().skip(1).map(|s| s.offset).chain([opened.len()]).collect();
    let mut particles = 0;
    for window in ends.windows(2) {
        let cut = &opened[..window[0]];
        let cut_sections = sections(cut);
        let blocks = cut_sections.iter().filter(|s| s.tag == BLOCK).count();
        if blocks == 0 {
            assert!(matches!(decode(cut, "m"), Err(Error::Corrupt { .. })));
            continue;
        }
        let model = decode(cut, "m").unwrap();
        assert_eq!(model.blocks().count(), blocks);
        assert_eq!(model.metadata.count, model.blocks().map(|b| b.count).sum::<u64>());
        for block in model.blocks() {
            assert_eq!(block.gaussians.count.iter().sum::<f64>(), block.count as f64);
            let mass: f64 = block.gaussians.masses().map_or(block.mass, |m| m.iter().sum());
            assert!((mass / block.mass - 1.0).abs() < 1e-12);
        }
        assert!(model.metadata.count >= particles);
        particles = model.metadata.count;
        let info = read_info(cut, "m").unwrap();
        assert!(info.missing().is_some() && info.certificate.is_none());
        assert_eq!(info.missing_particles, whole.metadata.count - particles);
        // A merge writes what is there as a file of its own, and a cut within a section changes nothing.
        assert_eq!(decode(&merged(&[cut]), "m").unwrap().layers, model.layers);
        assert_eq!(decode(&opened[..(window[0] + window[1]) / 2], "m").unwrap(), model);
    }
    // A file that says how long it is may not end early.
    assert!(matches!(decode(&file()[..ends[3]], "m"), Err(Error::Corrupt { .. })));
}

/// Blocks of every law, cut at every byte: particles and mass are the whole block's, and nothing panics.
#[test]
fn a_block_cut_anywhere_is_a_mixture_of_all_its_particles() {
    for block in [block(300, 0.0, false), block(300, 5.0, true), block(4200, 0.0, false)] {
        let coded = Encoder::new(&block).unwrap().encode(&Precision::BALANCED);
        let whole = decode_block(&coded, "b").unwrap();
        let step = coded.len() / 400 + 1;
        let (mut least, mut decoded_parts) = (1, 0);
        for n in (0..coded.len()).step_by(step) {
            let Ok(part) = decode_prefix(&coded[..n], "b") else { continue };
            decoded_parts += 1;
            assert_eq!(part.gaussians.count.iter().sum::<f64>(), block.count as f64);
            if let Some(mass) = part.gaussians.masses() {
                assert!((mass.iter().sum::<f64>() / block.mass - 1.0).abs() < 1e-12);
            }
            assert!(part.gaussians.len() >= least, "{n}");
            least = part.gaussians.len();
        }
        assert!(decoded_parts > 300, "{decoded_parts}");
        assert_eq!(least, block.gaussians.len());
        assert_eq!(decode_prefix(&coded, "b").unwrap(), whole);
    }
}

#[test]
fn a_series_begins_with_its_index_and_takes_frames_as_they_come() {
    let context = Context::SILENT;
    let keyframe = encode(&model(), &Precision::BALANCED).unwrap();
    let frame = |time| Some(CodedFrame { time, keyframe: true, bytes: keyframe.clone() });
    let file = assemble_series(SeriesClock::Time, "", &[frame(1.0), None, frame(2.0)]).unwrap();
    let whole = SeriesFile::read(&file, "s").unwrap();
    let end = SeriesFile::index_end(&file[..INDEX_FROM], "s").unwrap();
    assert!(SeriesFile::index_end(&file[..INDEX_FROM - 1], "s").is_err());
    assert!(SeriesFile::read_start(&file[..end - 1], "s").is_err());
    assert!(SeriesFile::index_end(&keyframe, "s").is_err());
    assert!(SeriesFile::read_start(&file[..end], "s").unwrap().frame_bytes(0).is_err());

    let start = SeriesFile::read_start(&file[..whole.frames[0].place.end], "s").unwrap();
    assert_eq!((start.clock, &start.frames), (whole.clock, &whole.frames));
    let mut decoder = SeriesDecoder::of(start);
    let first = decoder.model_at(1.0, &context).unwrap();
    let missing = decoder.model_at(1.5, &context).unwrap_err().to_string();
    assert!(missing.contains("frame 2 of 3: its bytes are not loaded"), "{missing}");
    assert!(decoder.add_frame(2, vec![0; 3]).is_err() && decoder.add_frame(1, Vec::new()).is_err());
    assert!(decoder.add_frame(3, keyframe.clone()).is_err());
    decoder.add_frame(2, file[whole.frames[2].place.clone()].to_vec()).unwrap();
    assert_eq!(decoder.model_at(1.5, &context).unwrap(), SeriesDecoder::new(&whole).model_at(1.5, &context).unwrap());
    assert_eq!(decoder.model_at(1.0, &context).unwrap(), first);
}
