//! Gaussian splats of viewers, read as points: SPZ, binary glTF, .splat records. (Splats in PLY
//! files are points of PLY files.) Models of the alpha-blend law are written as the `published` PLY.

mod glb;
mod published;
mod spz;

pub use published::write_splats;

use crate::affine::Affine;
use crate::columns::{ColumnarField, ColumnarSnapshot, one_species};
use crate::format::FileHead;
use crate::numbers::{Bytes, NumberType};
use crate::single_file::{named, only};
use crate::stored_bytes::StoredBytes;
use crate::{Choice, Description, Format, Snapshot};
use particlegs_core::{Error, Result};
use std::path::PathBuf;

/// Binary glTF, with `KHR_gaussian_splatting` or plain points.
pub const GLB: Format = Format { name: "glb", title: "glTF splats or points", detect: glb::detect, open: glb::open };
pub const SPZ: Format = Format { name: "spz", title: "SPZ splats", detect: spz::detect, open: spz::open };
/// Records of 32 bytes, without a signature: position and size as 3 f32 each, colour and rotation as 4 bytes each.
pub const SPLAT: Format = Format { name: "splat", title: ".splat records", detect, open };

const RECORD: usize = 32;

/// There is no signature: the name must say it, and the first records must look like splats.
fn detect(head: &FileHead) -> bool {
    let named = head.path.extension().is_some_and(|e| e.eq_ignore_ascii_case("splat"));
    let plausible = |record: &[u8]| {
        let value = |k: usize| NumberType::F32.get(&record[4 * k..], false);
        (0..3).all(|k| value(k).abs() < 1e9) && (3..6).all(|k| (0.0..1e9).contains(&value(k)))
    };
    named
        && head.compression.is_none()
        && head.length.is_multiple_of(RECORD as u64)
        && head.bytes.len() >= RECORD
        && head.bytes.chunks_exact(RECORD).all(plausible)
}

fn open(paths: &[PathBuf], _: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let bytes = Bytes::from_filled_file(path)?;
    let length = bytes.len() as u64;
    if !length.is_multiple_of(RECORD as u64) {
        let message = format!("the size of {length} bytes is not a multiple of {RECORD}, the size of a record");
        return Err(Error::input_with(path, message, "the file is cut short or not a .splat file"));
    }
    let stored = StoredBytes::plain_file(bytes);
    let stride = RECORD as u64;
    let fields = vec![
        ColumnarField::in_records("position", NumberType::F32, 3, [0, stride, 0]),
        ColumnarField::in_records("scale", NumberType::F32, 3, [0, stride, 12]),
        ColumnarField::in_records("color", NumberType::U8, 4, [0, stride, 24]),
        ColumnarField::in_records("rotation", NumberType::U8, 4, [0, stride, 28]),
    ];
    let count = length / stride;
    let description = Description {
        species: vec![one_species(count, &fields, "position".into(), |_| None)],
        notes: vec![Description::SPLATS.into()],
        ..Description::new(".splat records", std::slice::from_ref(path), named(path))
    };
    let place = path.display().to_string();
    Ok(Box::new(ColumnarSnapshot { description, place, stored: vec![stored], fields, world: Affine::IDENTITY }))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{gzip, open_bytes};

    /// A binary glTF file of a document and data.
    fn glb(json: &str, data: &[u8]) -> Vec<u8> {
        let json = format!("{json}{}", " ".repeat(json.len().next_multiple_of(4) - json.len()));
        let mut out = b"glTF\x02\0\0\0".to_vec();
        out.extend((28 + json.len() as u32 + data.len() as u32).to_le_bytes());
        out.extend((json.len() as u32).to_le_bytes());
        out.extend(b"JSON");
        out.extend(json.as_bytes());
        out.extend((data.len() as u32).to_le_bytes());
        out.extend(b"BIN\0");
        out.extend(data);
        out
    }

    fn rows(name: &str, bytes: &[u8]) -> particlegs_core::Result<Vec<[f64; 4]>> {
        let snapshot = open_bytes(name, bytes)?;
        crate::testing::rows(&*snapshot, 0, &Choice::default())
    }

    const ARRAYS: &str = r#""accessors":[{"bufferView":0,"componentType":5126,"count":2,"type":"VEC3","max":[9,9,9]}],
        "bufferViews":[{"buffer":0,"byteLength":24}],"buffers":[{"byteLength":24}],
        "meshes":[{"primitives":[{"mode":0,"attributes":{"POSITION":0}}]},
                  {"primitives":[{"attributes":{"POSITION":0}}]}]"#;

    #[test]
    fn meshes_of_points_are_placed_by_their_nodes() {
        let data: Vec<u8> = [1f32, 2., 3., 4., 5., 6.].iter().flat_map(|v| v.to_le_bytes()).collect();
        let plain = rows("a", &glb(&format!("{{{ARRAYS}}}"), &data)).unwrap();
        assert_eq!(plain, [[1.0, 2.0, 3.0, 0.0], [4.0, 5.0, 6.0, 0.0]]);
        // A quarter turn about z within a shift; the second mesh is of triangles.
        let nodes = r#""scenes":[{"nodes":[1]}],"nodes":[{"mesh":0,"rotation":[0,0,0.7071067811865476,0.7071067811865476],
            "scale":[2,2,2]},{"children":[0,2],"translation":[10,0,0]},{"mesh":1}]"#;
        let placed = rows("a", &glb(&format!("{{{nodes},{ARRAYS}}}"), &data)).unwrap();
        for (seen, wanted) in placed.iter().zip([[6.0, 2.0, 6.0], [0.0, 8.0, 12.0]]) {
            assert!((0..3).all(|k| (seen[k] - wanted[k]).abs() < 1e-5), "{seen:?}");
        }
    }

    #[test]
    fn lies_in_documents_are_refused() {
        let refused = |nodes: &str, arrays: &str, words: &str| {
            let error = rows("a", &glb(&format!("{{{nodes}{arrays}}}"), &[0; 24])).err().unwrap().to_string();
            assert!(error.contains(words), "{error}");
        };
        refused(r#""scenes":[{"nodes":[0]}],"nodes":[{"mesh":0,"children":[0]}],"#, ARRAYS, "two parents");
        refused(r#""scenes":[{"nodes":[7]}],"#, ARRAYS, "does not exist");
        refused("", &ARRAYS.replace("\"count\":2", "\"count\":3"), "exceed their view");
        refused("", &ARRAYS.replace("\"count\":2", "\"count\":18446744073709551615"), "exceed their view");
        refused("", &ARRAYS.replace(r#"0,"byteLength":24"#, r#"0,"byteLength":9999999999"#), "beyond the end");
        refused("", &ARRAYS.replace("\"mode\":0", "\"mode\":4"), "no primitive of mode POINTS");
        refused("", &ARRAYS.replace("VEC3", "VEC4"), "VEC3");
        refused("", &ARRAYS.replace("\"mode\":0", r#""mode":0,"extensions":{"KHR_spz_compression":{}}"#), "compressed");
    }

    /// An SPZ file before compression: two splats without harmonics.
    fn spz(version: u32, positions: &[u8], rest: usize) -> Vec<u8> {
        let mut out = b"NGSP".to_vec();
        out.extend(version.to_le_bytes());
        out.extend(2u32.to_le_bytes());
        out.extend([0, 8, 0, 0]);
        out.extend(positions);
        out.extend(vec![0x80; rest]);
        out
    }

    #[test]
    fn spz_in_gzip_and_plain() {
        let fixed: Vec<u8> =
            [256i32, -128, 0, 1, 2, 256_000].iter().flat_map(|v| v.to_le_bytes()[..3].to_vec()).collect();
        let half: Vec<u8> =
            [0x3c00u16, 0xb800, 0, 0x1c00, 0x2000, 0x63d0].iter().flat_map(|v| v.to_le_bytes()).collect();
        let wanted = [[1.0, -0.5, 0.0, 0.0], [0.00390625, 0.0078125, 1000.0, 0.0]];
        for bytes in [spz(1, &half, 20), spz(2, &fixed, 20), spz(3, &fixed, 22)] {
            assert_eq!(rows("a", &bytes).unwrap(), wanted);
            let packed = gzip(&bytes);
            assert_eq!(rows("a", &packed).unwrap(), wanted);
            for cut in 0..packed.len() {
                assert!(rows("a", &packed[..cut]).is_err(), "cut at {cut}");
            }
            assert!(rows("a", &bytes[..bytes.len() - 1]).is_err());
        }
        assert!(rows("a", &spz(5, &fixed, 20)).is_err());
    }

    #[test]
    fn records_are_known_by_their_name_only() {
        let record: Vec<u8> = [1f32, 2., 3., 0.1, 0.1, 0.1, 0., 0.].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert_eq!(rows("a.splat", &record).unwrap(), [[1.0, 2.0, 3.0, 0.0]]);
        assert!(rows("a.bin", &record).is_err());
        let negative: Vec<u8> = [1f32, 2., 3., -0.1, 0.1, 0.1, 0., 0.].iter().flat_map(|v| v.to_le_bytes()).collect();
        assert!(rows("a.splat", &negative).is_err());
    }
}
