//! Altered certificates and metadata: every number and field, larger, smaller, missing and out of range.

use crate::common::{TestFolder, snapshot};
use particlegs_core::codec;
use particlegs_core::model::Coding;

/// Header of a model file, and tag and content of each section (docs/format.md, section 1).
pub fn sections(file: &[u8]) -> Vec<([u8; 4], Vec<u8>)> {
    let (mut at, mut all) = (24, Vec::new());
    while at < file.len() {
        let length = u64::from_le_bytes(file[at + 4..at + 12].try_into().unwrap()) as usize;
        all.push((file[at..at + 4].try_into().unwrap(), file[at + 16..at + 16 + length].to_vec()));
        at += 16 + length;
    }
    all
}

/// The CRC-32 of zlib, bit by bit.
fn checksum(bytes: &[u8]) -> u32 {
    !bytes.iter().fold(!0u32, |crc, b| {
        (0..8).fold(crc ^ u32::from(*b), |c, _| if c & 1 == 1 { c >> 1 ^ 0xedb8_8320 } else { c >> 1 })
    })
}

pub fn file_of(head: &[u8], sections: &[([u8; 4], Vec<u8>)]) -> Vec<u8> {
    let mut body = Vec::new();
    for (tag, content) in sections {
        let section_head = [&tag[..], &(content.len() as u64).to_le_bytes()].concat();
        body.extend(&section_head);
        body.extend(checksum(&[&section_head[..], content].concat()).to_le_bytes());
        body.extend(content);
    }
    let head = [&head[..12], &(24 + body.len() as u64).to_le_bytes()].concat();
    [&head[..], &checksum(&head).to_le_bytes(), &body].concat()
}

/// Tags and values of a certificate's groups or of metadata fields.
fn fields(section: &[u8]) -> Vec<(u8, Vec<u8>)> {
    let (mut at, mut all) = (0, Vec::new());
    while at < section.len() {
        let length = usize::from(u16::from_le_bytes([section[at + 1], section[at + 2]]));
        all.push((section[at], section[at + 3..at + 3 + length].to_vec()));
        at += 3 + length;
    }
    all
}

fn section_of(fields: &[(u8, Vec<u8>)]) -> Vec<u8> {
    fields.iter().flat_map(|(tag, v)| [&[*tag][..], &(v.len() as u16).to_le_bytes(), v].concat()).collect()
}

/// Other values for a number.
fn other_values(coding: Coding, bytes: &[u8]) -> Vec<Vec<u8>> {
    let reals = |v: f64| [1.2 * v, 0.8 * v, 1000.0 * v, 0.001 * v, v + 1.0, 0.0, -1.0, -2.0, 1e30, f64::NAN];
    let all: Vec<Vec<u8>> = match (coding, bytes.len()) {
        (Coding::F64, _) => {
            reals(f64::from_le_bytes(bytes.try_into().unwrap())).iter().map(|v| v.to_le_bytes().into()).collect()
        }
        (Coding::F32 | Coding::OptionalF32 | Coding::UpTo, _) => {
            let v = f64::from(f32::from_le_bytes(bytes.try_into().unwrap()));
            reals(v).iter().map(|v| (*v as f32).to_le_bytes().into()).collect()
        }
        (Coding::Score, _) => {
            let [psnr, ssim] = [0, 2].map(|at| u16::from_le_bytes([bytes[at], bytes[at + 1]]));
            let all = [(psnr.saturating_add(1200), ssim), (psnr.saturating_sub(1200), ssim), (psnr, 32_000)];
            let all = all.into_iter().chain([(u16::MAX, 32_767), (u16::MAX, 0x8000), (0, ssim)]);
            all.map(|(p, s)| [p.to_le_bytes(), s.to_le_bytes()].concat()).collect()
        }
        (_, length) => {
            let mut whole = [0; 8];
            whole[..length].copy_from_slice(bytes);
            let n = u64::from_le_bytes(whole);
            let all = [n + 1, n / 2, 2 * n, 0, n.wrapping_sub(1), u64::MAX];
            all.iter().map(|n| n.to_le_bytes()[..length].to_vec()).collect()
        }
    };
    all.into_iter().filter(|v| v != bytes).collect()
}

/// Bytes of a number.
fn length_of(coding: Coding) -> usize {
    match coding {
        Coding::Whole(bytes) => bytes,
        Coding::Name(_) => 1,
        Coding::F64 => 8,
        _ => 4,
    }
}

/// Every forgery of a file: a name, and the bytes.
fn forgeries(file: &[u8]) -> Vec<(String, Vec<u8>)> {
    let all = sections(file);
    let at = |tag: &[u8; 4]| all.iter().position(|s| s.0 == *tag).unwrap();
    let (meta, cert) = (at(b"META"), at(b"CERT"));
    let with = |place: usize, fields: &[(u8, Vec<u8>)]| {
        let mut altered = all.clone();
        altered[place].1 = section_of(fields);
        file_of(file, &altered)
    };
    let mut forgeries = Vec::new();
    let groups = fields(&all[cert].1);
    let certificate = codec::read_info(file, "m").unwrap().certificate.unwrap();
    for (group, entries) in certificate.groups() {
        let Some(place) = groups.iter().position(|g| g.0 == group.tag) else { continue };
        let mut start = 0;
        for entry in entries.unwrap() {
            let end = start + length_of(entry.metric.coding);
            for (i, value) in other_values(entry.metric.coding, &groups[place].1[start..end]).into_iter().enumerate() {
                let mut altered = groups.clone();
                altered[place].1.splice(start..end, value);
                let name = format!("{} {}: {} #{i}", group.name, entry.row, entry.metric.name);
                forgeries.push((name, with(cert, &altered)));
            }
            start = end;
        }
        assert_eq!(start, groups[place].1.len(), "{}", group.name);
        let without: Vec<_> = groups.iter().filter(|g| g.0 != group.tag).cloned().collect();
        forgeries.push((format!("{}: left out", group.name), with(cert, &without)));
    }
    for (tag, bytes) in [(9, vec![0; 92]), (12, 1u32.to_le_bytes().into()), (13, vec![0; 25]), (5, vec![0; 8])] {
        let mut altered: Vec<_> = groups.iter().filter(|g| g.0 != tag).cloned().collect();
        altered.push((tag, bytes));
        altered.sort();
        forgeries.push((format!("group {tag}: added"), with(cert, &altered)));
    }
    let metadata = fields(&all[meta].1);
    for (place, (tag, value)) in metadata.iter().enumerate() {
        // The source's name, the recipe and the program's version describe how the model was made.
        if [9, 40, 41].contains(tag) {
            continue;
        }
        for byte in 0..value.len() {
            let mut altered = metadata.clone();
            altered[place].1[byte] ^= 1 << (byte % 3);
            forgeries.push((format!("metadata {tag}: byte {byte}"), with(meta, &altered)));
        }
        let without: Vec<_> = metadata.iter().filter(|f| f.0 != *tag).cloned().collect();
        forgeries.push((format!("metadata {tag}: left out"), with(meta, &without)));
    }
    for (tag, value) in [(26u8, 1.5f64.to_le_bytes().to_vec()), (27, vec![1; 8]), (28, vec![1; 8])] {
        let mut altered = metadata.clone();
        altered.push((tag, value));
        altered.sort();
        forgeries.push((format!("metadata {tag}: added"), with(meta, &altered)));
    }
    forgeries
}

/// The words of a verdict by use, best first.
fn grades(dir: &TestFolder, json: &str) -> Vec<usize> {
    let value = dir.json(json);
    let ranks = ["good", "fair"];
    let rank = |f: &serde_json::Value| ranks.iter().position(|r| f["word"] == *r).unwrap_or(ranks.len());
    value["verdict"].as_array().unwrap().iter().map(rank).collect()
}

/// Verifies the forgeries that `each` picks against the snapshot: none gets a better verdict than the true file, and
/// almost none passes.
fn verified(certificate: &str, each: usize) {
    let dir = TestFolder::new();
    let place = |i: u32, k: u32| {
        let v = i.wrapping_mul(2_654_435_761).rotate_left(11 * k) >> 8;
        (v as f32 / 16_777_216.0).powi(2) * 20.0
    };
    snapshot(&dir.at("in"), &[0, 1, 2].map(|k| (0..600).map(|i| place(i, k)).collect()));
    let meta = r#"{"box": [20, 20, 20], "length_unit": "Mpc/h", "mass_unit": "Msun/h", "particle_mass": 7.5, "h": 0.7,
        "scale_factor": 0.5, "comoving": true, "omega_matter": 0.3}"#;
    dir.write("in/meta.json", meta);
    let file = dir.makes(&format!("compress in -o m.pgs --gaussians 20 -q --certificate {certificate}"));
    dir.runs("verify m.pgs in -q --json true.json");
    let best = grades(&dir, "true.json");
    let all = forgeries(&file);
    assert!(all.len() > 600, "{}", all.len());
    let (mut passed, mut better) = (Vec::new(), Vec::new());
    for (name, bytes) in all.iter().step_by(each) {
        dir.write("f.pgs", bytes);
        if dir.command("verify f.pgs in -q --json f.json").output().unwrap().status.success() {
            passed.push(name);
        }
        if dir.at("f.json").exists() {
            let now = grades(&dir, "f.json");
            if now.iter().zip(&best).any(|(n, b)| n < b) {
                better.push(format!("{name}: {now:?}, and {best:?}"));
            }
            std::fs::remove_file(dir.at("f.json")).unwrap();
        }
    }
    println!("{} of {} pass, {} with a better word: {passed:?}", passed.len(), all.len() / each, better.len());
    assert!(better.is_empty(), "{better:?}");
    assert!(passed.len() <= all.len() / each / 20, "{passed:?}");
}

#[test]
fn forged_certificates_and_metadata_are_refused() {
    verified("quick", 101);
}

#[test]
#[ignore = "slow"]
fn all_forged_certificates_and_metadata_are_refused() {
    verified("full", 31);
}
