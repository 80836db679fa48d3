//! The part of a glTF document that says where points lie.

use crate::affine::Affine;
use serde::Deserialize;
use serde::de::IgnoredAny;
use std::collections::BTreeMap;

#[derive(Deserialize, Default)]
#[serde(rename_all = "camelCase", default)]
pub struct GltfDocument {
    pub scene: Option<usize>,
    pub scenes: Vec<GltfScene>,
    pub nodes: Vec<GltfNode>,
    pub meshes: Vec<Mesh>,
    pub accessors: Vec<Accessor>,
    pub buffer_views: Vec<BufferView>,
    pub buffers: Vec<Buffer>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub struct GltfScene {
    pub nodes: Vec<usize>,
}

#[derive(Deserialize, Default)]
#[serde(default)]
pub struct GltfNode {
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
pub struct Mesh {
    pub primitives: Vec<Primitive>,
}

/// Points, lines or triangles.
#[derive(Deserialize, Default)]
#[serde(default)]
pub struct Primitive {
    pub attributes: BTreeMap<String, usize>,
    pub mode: Option<u32>,
    pub extensions: Extensions,
}

#[derive(Deserialize, Default)]
pub struct Extensions {
    #[serde(rename = "KHR_gaussian_splatting")]
    pub splats: Option<Splats>,
    #[serde(flatten)]
    pub others: BTreeMap<String, IgnoredAny>,
}

/// That of splats, which may itself be extended, e.g. by a compression.
#[derive(Deserialize, Default)]
#[serde(default)]
pub struct Splats {
    pub extensions: BTreeMap<String, IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct Accessor {
    pub buffer_view: Option<usize>,
    #[serde(default)]
    pub byte_offset: u64,
    pub component_type: u32,
    #[serde(default)]
    pub normalized: bool,
    pub count: u64,
    #[serde(rename = "type")]
    pub shape: String,
    pub sparse: Option<IgnoredAny>,
}

#[derive(Deserialize)]
#[serde(rename_all = "camelCase")]
pub struct BufferView {
    #[serde(default)]
    pub buffer: usize,
    #[serde(default)]
    pub byte_offset: u64,
    pub byte_length: u64,
    pub byte_stride: Option<u64>,
}

/// Bytes, in the file where they have no address.
#[derive(Deserialize)]
pub struct Buffer {
    pub uri: Option<IgnoredAny>,
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
    pub fn placed(&self) -> Result<Vec<(usize, Affine)>, String> {
        let Some(scene) = self.scenes.get(self.scene.unwrap_or(0)) else {
            return Ok((0..self.meshes.len()).map(|m| (m, Affine::IDENTITY)).collect());
        };
        let mut out = Vec::new();
        // A node has one parent: one seen twice is a loop or a lie.
        let mut seen = vec![false; self.nodes.len()];
        let mut open: Vec<(usize, Affine)> = scene.nodes.iter().rev().map(|&n| (n, Affine::IDENTITY)).collect();
        while let Some((number, parent)) = open.pop() {
            let node = self.nodes.get(number).ok_or("a scene refers to a node that does not exist")?;
            if std::mem::replace(&mut seen[number], true) {
                return Err(format!("node {number} has two parents"));
            }
            let world = parent.after(&node.local());
            out.extend(node.mesh.map(|mesh| (mesh, world)));
            open.extend(node.children.iter().rev().map(|&child| (child, world)));
        }
        Ok(out)
    }
}
