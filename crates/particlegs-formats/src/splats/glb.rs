//! Binary glTF: primitives of points, and of `KHR_gaussian_splatting`, in their places of the scene.

use crate::affine::Affine;
use crate::format::FileHead;
use crate::numbers::{Bytes, NumberType, StridedColumn, StridedParticles};
use crate::pieces::{ParticlePiece, PieceReader};
use crate::single_file::{named, only};
use crate::{Choice, Description, Snapshot, Species, SpeciesField, SpeciesMass, TextResult, axes};
use particlegs_core::{Error, Result};
use particlegs_particles::SnapshotReader;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;
use std::ops::Range;
use std::path::PathBuf;

const MAGIC: &[u8; 4] = b"glTF";
/// Longest document that is read: it lists arrays, and does not hold them.
const LONGEST: u64 = 1 << 20;
const POINTS: u32 = 0;

pub fn detect(head: &FileHead) -> bool {
    head.bytes.starts_with(MAGIC)
}

#[derive(Clone)]
struct PrimitivePositions {
    rows: u64,
    kind: NumberType,
    axes: [StridedColumn; 3],
    world: Affine,
}

struct Glb {
    description: Description,
    place: String,
    bytes: Bytes,
    parts: Vec<PrimitivePositions>,
}

pub fn open(paths: &[PathBuf], _: &Choice) -> Result<Box<dyn Snapshot>> {
    let path = only(paths)?;
    let refuse = |message: String| Error::input_with(path, message, "the file is damaged or holds no points");
    let bytes = Bytes::from_filled_file(path)?;
    let (json, binary) = chunks(&bytes).map_err(refuse)?;
    let json = &bytes[json.start as usize..json.end as usize];
    let document: GltfDocument =
        serde_json::from_slice(json).map_err(|e| refuse(format!("the JSON document cannot be read: {e}")))?;
    let (parts, splats) = parts(&document, binary).map_err(refuse)?;
    let count = parts
        .iter()
        .try_fold(0u64, |n, p| n.checked_add(p.rows))
        .ok_or_else(|| refuse("there are too many points".into()))?;
    if count == 0 {
        return Err(refuse("there is no primitive of mode POINTS with positions".into()));
    }
    let (name, aliases, positions) = ("particles".into(), vec!["0".into()], "POSITION".to_string());
    let fields = vec![SpeciesField::new(&positions, parts[0].kind.name(), 3)];
    let species = Species { name, aliases, count, mass: SpeciesMass::Unknown, positions, fields };
    let title = if splats { "glTF 2.0 (binary) with KHR_gaussian_splatting" } else { "glTF 2.0 (binary), points" };
    let description = Description {
        species: vec![species],
        notes: if splats { vec![Description::SPLATS.into()] } else { Vec::new() },
        ..Description::new(title, std::slice::from_ref(path), named(path))
    };
    Ok(Box::new(Glb { description, place: path.display().to_string(), bytes, parts }))
}

fn chunks(bytes: &[u8]) -> TextResult<(Range<u64>, Range<u64>)> {
    let word = |at: u64| {
        let b = bytes.get(at as usize..at as usize + 4)?;
        Some(u64::from(u32::from_le_bytes([b[0], b[1], b[2], b[3]])))
    };
    let short = "the file is cut short";
    let (version, length) = (word(4).ok_or(short)?, word(8).ok_or(short)?);
    if version != 2 {
        return Err(format!("glTF version {version} is not supported (only 2 is)"));
    }
    if length > bytes.len() as u64 {
        return Err(format!("the file is cut short: {} of {length} bytes", bytes.len()));
    }
    // A chunk has its size, its kind, then its content; the first stands behind 12 bytes of the file's header.
    let chunk = |at: u64, kind: &[u8; 4]| {
        let (size, is) = (word(at)?, bytes.get(at as usize + 4..at as usize + 8)?);
        (is == kind && at + 8 + size <= length).then_some(at + 8..at + 8 + size)
    };
    let json = chunk(12, b"JSON").ok_or("the JSON document ends beyond the file")?;
    if json.end - json.start > LONGEST {
        return Err(format!("the JSON document has {} bytes; at most {LONGEST} are supported", json.end - json.start));
    }
    // Chunks begin at multiples of 4.
    let after = json.end.next_multiple_of(4);
    let binary = chunk(after, b"BIN\0").ok_or("the binary data are missing or end beyond the file")?;
    Ok((json, binary))
}

/// All primitives of points, and whether any are splats.
fn parts(document: &GltfDocument, binary: Range<u64>) -> TextResult<(Vec<PrimitivePositions>, bool)> {
    let (mut out, mut splats) = (Vec::new(), false);
    for (mesh, world) in document.placed()? {
        let mesh = document.meshes.get(mesh).ok_or("a node refers to a mesh that does not exist")?;
        for primitive in &mesh.primitives {
            let is_splats = primitive.extensions.splats.is_some();
            if primitive.mode != Some(POINTS) && !is_splats {
                continue;
            }
            splats |= is_splats;
            out.extend(part(document, primitive, &binary, world)?);
        }
    }
    Ok((out, splats))
}

fn part(
    document: &GltfDocument,
    primitive: &Primitive,
    binary: &Range<u64>,
    world: Affine,
) -> TextResult<Option<PrimitivePositions>> {
    let Some(&accessor) = primitive.attributes.get("POSITION") else { return Ok(None) };
    let accessor = document.accessors.get(accessor).ok_or("positions refer to an accessor that does not exist")?;
    let inner = primitive.extensions.splats.iter().flat_map(|s| s.extensions.keys());
    let compression = inner.chain(primitive.extensions.others.keys()).find(|name| name.contains("compression"));
    if let Some(name) = compression {
        return Err(format!("positions are compressed with {}, which is not supported", name.escape_debug()));
    }
    if accessor.sparse.is_some() {
        return Err("positions are a sparse accessor, which is not supported".into());
    }
    let (Some(view), "VEC3") = (accessor.buffer_view, &accessor.shape[..]) else {
        return Err("positions are not an array of VEC3".into());
    };
    let (kind, largest) = number(accessor)?;
    let view = document.buffer_views.get(view).ok_or("positions refer to a buffer view that does not exist")?;
    let buffer = document.buffers.get(view.buffer).ok_or("positions refer to a buffer that does not exist")?;
    if view.buffer != 0 || buffer.uri.is_some() {
        return Err("positions are in another file: export the scene as one binary file".into());
    }
    let stride = view.byte_stride.unwrap_or(3 * kind.bytes());
    if !(3 * kind.bytes()..=4096).contains(&stride) {
        return Err(format!("positions have a wrong stride of {stride} bytes"));
    }
    let offset = view.byte_offset.checked_add(accessor.byte_offset).ok_or("positions begin beyond the end")?;
    let lane =
        |k: u64| StridedColumn { offset: offset.saturating_add(k * kind.bytes()), stride, kind, big_endian: false };
    // Within the view, and the view within the binary data.
    let view_end = view.byte_offset.checked_add(view.byte_length).filter(|&end| end <= binary.end - binary.start);
    let end = view_end.ok_or("positions are beyond the end of the file")?;
    if !(0..3).all(|k| lane(k).fits(accessor.count, end as usize)) {
        return Err(format!("{} positions exceed their view of {} bytes", accessor.count, view.byte_length));
    }
    let axes = [0, 1, 2].map(|k| StridedColumn { offset: lane(k).offset + binary.start, ..lane(k) });
    let world = world.after(&Affine::scale(1.0 / largest));
    Ok(Some(PrimitivePositions { rows: accessor.count, kind, axes, world }))
}

/// An accessor's type, and what stands for 1.
fn number(accessor: &Accessor) -> TextResult<(NumberType, f64)> {
    // Types have the numbers that OpenGL gives them.
    let (kind, largest) = match accessor.component_type {
        5120 => (NumberType::I8, 127.0),
        5121 => (NumberType::U8, 255.0),
        5122 => (NumberType::I16, 32_767.0),
        5123 => (NumberType::U16, 65_535.0),
        5126 => (NumberType::F32, 1.0),
        other => return Err(format!("positions have the unknown type {other}")),
    };
    Ok((kind, if accessor.normalized { largest } else { 1.0 }))
}

impl Snapshot for Glb {
    fn description(&self) -> &Description {
        &self.description
    }

    fn reader(&self, species: usize, choice: &Choice) -> Result<Box<dyn SnapshotReader>> {
        let species = self.description.species.get(species);
        let species = species.ok_or_else(|| Error::argument("the file has only one particle type"))?;
        axes::columns(&self.place, species, choice)?;
        let mut pieces: Vec<Box<dyn ParticlePiece>> = Vec::new();
        for part in &self.parts {
            let inner = StridedParticles::new(&self.place, self.bytes.clone(), part.rows, &part.axes)?;
            // Moved positions have more digits than the f32 that they were.
            pieces.push(part.world.moved(true, Box::new(inner)));
        }
        Ok(Box::new(PieceReader::new(self.description.meta.clone(), pieces, false)?))
    }
}

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
struct GltfDocument {
    scene: Option<usize>,
    scenes: Vec<GltfScene>,
    nodes: Vec<GltfNode>,
    meshes: Vec<Mesh>,
    accessors: Vec<Accessor>,
    buffer_views: Vec<BufferView>,
    buffers: Vec<Buffer>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct GltfScene {
    nodes: Vec<usize>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct GltfNode {
    mesh: Option<usize>,
    children: Vec<usize>,
    /// Columns first.
    matrix: Option<[f64; 16]>,
    translation: Option<[f64; 3]>,
    /// x, y, z, w.
    rotation: Option<[f64; 4]>,
    scale: Option<[f64; 3]>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
struct Mesh {
    primitives: Vec<Primitive>,
}

/// Points, lines or triangles.
#[derive(Deserialize, Default)]
#[serde(default)]
struct Primitive {
    attributes: BTreeMap<String, usize>,
    mode: Option<u32>,
    extensions: Extensions,
}

#[derive(Deserialize, Default)]
struct Extensions {
    #[serde(rename = "KHR_gaussian_splatting")]
    splats: Option<Splats>,
    #[serde(flatten)]
    others: BTreeMap<String, IgnoredAny>,
}

/// That of splats, which may itself be extended, e.g. by a compression.
#[derive(Deserialize, Default)]
#[serde(default)]
struct Splats {
    extensions: BTreeMap<String, IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct Accessor {
    buffer_view: Option<usize>,
    #[serde(default)]
    byte_offset: u64,
    component_type: u32,
    #[serde(default)]
    normalized: bool,
    count: u64,
    #[serde(rename = "type")]
    shape: String,
    sparse: Option<IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
struct BufferView {
    #[serde(default)]
    buffer: usize,
    #[serde(default)]
    byte_offset: u64,
    byte_length: u64,
    byte_stride: Option<u64>,
}

/// Bytes, in the file where they have no address.
#[derive(Deserialize)]
struct Buffer {
    uri: Option<IgnoredAny>,
}

impl GltfNode {
    fn local(&self) -> Affine {
        if let Some(m) = self.matrix {
            let matrix = [0, 1, 2].map(|i| [m[i], m[4 + i], m[8 + i]]);
            return Affine { matrix, shift: [m[12], m[13], m[14]] };
        }
        let [x, y, z, w] = self.rotation.unwrap_or([0.0, 0.0, 0.0, 1.0]);
        let turn = [
            [1.0 - 2.0 * (y * y + z * z), 2.0 * (x * y - z * w), 2.0 * (x * z + y * w)],
            [2.0 * (x * y + z * w), 1.0 - 2.0 * (x * x + z * z), 2.0 * (y * z - x * w)],
            [2.0 * (x * z - y * w), 2.0 * (y * z + x * w), 1.0 - 2.0 * (x * x + y * y)],
        ];
        let scale = self.scale.unwrap_or([1.0; 3]);
        let matrix = turn.map(|row| [row[0] * scale[0], row[1] * scale[1], row[2] * scale[2]]);
        Affine { matrix, shift: self.translation.unwrap_or([0.0; 3]) }
    }
}

impl GltfDocument {
    /// Meshes and how they are placed in the world, each where a node of the scene shows it; all of
    /// them as they are where there is no scene.
    fn placed(&self) -> TextResult<Vec<(usize, Affine)>> {
        let Some(scene) = self.scenes.get(self.scene.unwrap_or(0)) else {
            return Ok((0..self.meshes.len()).map(|m| (m, Affine::IDENTITY)).collect());
        };
        let mut out = Vec::new();
        // A node has one parent: one reached twice is a loop or a lie.
        let mut has_parent = vec![false; self.nodes.len()];
        let mut open: Vec<(usize, Affine)> = scene.nodes.iter().rev().map(|&n| (n, Affine::IDENTITY)).collect();
        while let Some((number, parent)) = open.pop() {
            let node = self.nodes.get(number).ok_or("a scene refers to a node that does not exist")?;
            if std::mem::replace(&mut has_parent[number], true) {
                return Err(format!("node {number} has two parents"));
            }
            let world = parent.after(&node.local());
            out.extend(node.mesh.map(|mesh| (mesh, world)));
            open.extend(node.children.iter().rev().map(|&child| (child, world)));
        }
        Ok(out)
    }
}
