//! Splats as glTF 2.0 with `KHR_gaussian_splatting` (ratified by Khronos in 2026): a mesh of points a layer.
//!
//! Attributes are float32: places, turns as quaternions (x, y, z, w), standard deviations and opacities as they
//! are, not their logarithms and logits, and the colour's spherical harmonic of degree 0. `COLOR_0` is for
//! viewers that know points alone.

use super::{Notes, RUN, written};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use particlegs_core::camera::Normalisation;
use particlegs_core::context::Context;
use particlegs_core::model::{Block, Layer, Model};
use particlegs_core::{Error, Hint, Result};
use serde_json::{Value, json};
use std::path::Path;

#[derive(Clone, Copy, PartialEq)]
pub enum GltfForm {
    /// One after the other (.glb).
    Binary,
    /// The numbers as base64 within the document (.gltf).
    Text,
}

/// The constant spherical harmonic, 1 / (2 sqrt(pi)): colours are 0.5 + this times the coefficient.
const HARMONIC: f32 = 0.282_094_8;
const FLOAT: u32 = 5126;
const BYTE: u32 = 5121;
const ARRAY_BUFFER: u32 = 34962;
const POINTS: u32 = 0;
/// Attributes in the order of their arrays: name, shape, bytes of a Gaussian.
const ATTRIBUTES: [(&str, &str, u64); 6] = [
    ("POSITION", "VEC3", 12),
    ("KHR_gaussian_splatting:ROTATION", "VEC4", 16),
    ("KHR_gaussian_splatting:SCALE", "VEC3", 12),
    ("KHR_gaussian_splatting:OPACITY", "SCALAR", 4),
    ("KHR_gaussian_splatting:SH_DEGREE_0_COEF_0", "VEC3", 12),
    ("COLOR_0", "VEC4", 4),
];
const BYTES: u64 = 60;

/// Writes the splats of an alpha-blend model in the frame of [`Normalisation`].
pub fn write(
    model: &Model,
    colors: Option<&[[f32; 3]]>,
    notes: &Notes,
    out: &Path,
    form: GltfForm,
    context: &Context<'_>,
) -> Result<u64> {
    let bytes = BYTES * model.gaussians() as u64;
    if bytes == 0 {
        return Err(Error::argument("the model has no Gaussians; glTF cannot store empty arrays"));
    }
    // GLB counts in 32 bits; a MiB is left for the document.
    if form == GltfForm::Binary && bytes > u64::from(u32::MAX) - (1 << 20) {
        let message = format!("{} Gaussians do not fit into a GLB file, which is limited to 4 GiB", model.gaussians());
        return Err(Error::argument_with(
            message,
            Hint::from("write a PLY, or make the model smaller with ").command("simplify", ""),
        ));
    }
    let text = if form == GltfForm::Text { bytes / 3 * 4 } else { 0 };
    // The columns and the buffer; as text its base64, alone and in the document.
    context.require_memory("a glTF", 2 * bytes + 2 * text)?;
    let (document, binary) = scene(model, colors, notes, context)?;
    match form {
        GltfForm::Binary => binary_file(document, &binary, out, context),
        GltfForm::Text => {
            let mut document = document;
            document["buffers"][0]["uri"] =
                format!("data:application/octet-stream;base64,{}", STANDARD.encode(&binary)).into();
            let text = serde_json::to_vec(&document).expect("plain data");
            written(out, text.len() as u64, context, |sink| sink.put(&text))
        }
    }
}

fn scene(model: &Model, colors: Option<&[[f32; 3]]>, notes: &Notes, context: &Context<'_>) -> Result<(Value, Vec<u8>)> {
    let frame = Normalisation::new(&model.metadata.bounds);
    let mut binary = Vec::new();
    let (mut meshes, mut nodes, mut accessors, mut views) = (vec![], vec![], vec![], vec![]);
    let mut colors = colors;
    for layer in &model.layers {
        let count = layer.content.iter().map(|b| b.gaussians.len()).sum();
        let color_split = colors.map(|all| all.split_at(count));
        colors = color_split.map(|o| o.1);
        if count == 0 {
            continue;
        }
        let columns = LayerArrays::new(layer, color_split.map(|o| o.0), &frame, context)?;
        let first = accessors.len();
        let mut attributes = serde_json::Map::new();
        for (k, (name, shape, bytes)) in ATTRIBUTES.iter().enumerate() {
            attributes.insert(name.to_string(), (first + k).into());
            views.push(json!({
                "buffer": 0, "byteOffset": binary.len(), "byteLength": bytes * count as u64, "target": ARRAY_BUFFER,
            }));
            let kind = if *name == "COLOR_0" { BYTE } else { FLOAT };
            let mut accessor = json!({ "bufferView": first + k, "componentType": kind, "count": count, "type": shape });
            if kind == BYTE {
                accessor["normalized"] = true.into();
                binary.extend_from_slice(&columns.fallback);
            } else {
                binary.extend(columns.floats[k].iter().flat_map(|v| v.to_le_bytes()));
            }
            // glTF requires the extent of positions, and of nothing else.
            if *name == "POSITION" {
                let [min, max] = columns.extent();
                (accessor["min"], accessor["max"]) = (json!(min), json!(max));
            }
            accessors.push(accessor);
        }
        let splats = json!({ "kernel": "ellipse", "colorSpace": "srgb_rec709_display" });
        nodes.push(json!({ "name": layer.name, "mesh": meshes.len() }));
        meshes.push(json!({ "name": layer.name, "primitives": [{
            "mode": POINTS, "attributes": attributes, "extensions": { "KHR_gaussian_splatting": splats },
        }]}));
    }
    let document = json!({
        "asset": { "version": "2.0", "generator": concat!("particlegs ", env!("CARGO_PKG_VERSION")), "extras": notes.json() },
        "extensionsUsed": ["KHR_gaussian_splatting"],
        "scene": 0,
        "scenes": [{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
        "nodes": nodes,
        "meshes": meshes,
        "accessors": accessors,
        "bufferViews": views,
        "buffers": [{ "byteLength": binary.len() }],
    });
    Ok((document, binary))
}

struct LayerArrays {
    /// Places, turns, deviations, opacities, harmonics.
    floats: [Vec<f32>; 5],
    /// Linear colours and opacities in bytes.
    fallback: Vec<u8>,
}

impl LayerArrays {
    fn new(
        layer: &Layer<Vec<Block>>,
        colors: Option<&[[f32; 3]]>,
        frame: &Normalisation,
        context: &Context<'_>,
    ) -> Result<LayerArrays> {
        let mut columns = LayerArrays { floats: Default::default(), fallback: Vec::new() };
        let gaussians = layer.content.iter().flat_map(|b| (0..b.gaussians.len()).map(|i| (&b.gaussians, i)));
        for (number, (g, i)) in gaussians.enumerate() {
            if number.is_multiple_of(RUN) {
                context.check()?;
            }
            let (opacity, grey) = g.law.alpha_blend().map_or((0.5, 0.5), |s| (s.opacity[i] as f32, s.grey[i] as f32));
            let color = colors.map_or([grey; 3], |c| c[number]);
            let (mean, (deviations, [w, x, y, z])) = (g.mean_of(i), g.cov_of(i).deviations_and_turn());
            let [places, turns, sizes, opacities, harmonics] = &mut columns.floats;
            places.extend((0..3).map(|k| ((mean[k] - frame.center[k]) * frame.scale) as f32));
            turns.extend([x, y, z, w].map(|v| v as f32));
            sizes.extend(deviations.map(|d| (d * frame.scale) as f32));
            opacities.push(opacity.clamp(0.0, 1.0));
            harmonics.extend(color.map(|v| (v - 0.5) / HARMONIC));
            // COLOR_0 is linear by definition; the harmonics are sRGB, as `colorSpace` says.
            columns.fallback.extend(color.map(|v| byte(linear(v))));
            columns.fallback.push(byte(opacity));
        }
        if columns.floats.iter().flatten().any(|v| !v.is_finite()) {
            return Err(Error::argument("a Gaussian is too large or too small for float32"));
        }
        Ok(columns)
    }

    fn extent(&self) -> [[f32; 3]; 2] {
        let start = [[f32::INFINITY; 3], [f32::NEG_INFINITY; 3]];
        self.floats[0]
            .chunks_exact(3)
            .fold(start, |[low, high], p| [[0, 1, 2].map(|k| low[k].min(p[k])), [0, 1, 2].map(|k| high[k].max(p[k]))])
    }
}

/// The light of an sRGB level (IEC 61966-2-1).
fn linear(level: f32) -> f32 {
    if level <= 0.04045 { level / 12.92 } else { ((level + 0.055) / 1.055).powf(2.4) }
}

/// The nearest of 256 steps.
fn byte(share: f32) -> u8 {
    (255.0 * share).round() as u8
}

/// A GLB: a head, and chunks that begin at multiples of four.
fn binary_file(document: Value, binary: &[u8], out: &Path, context: &Context<'_>) -> Result<u64> {
    let mut text = serde_json::to_vec(&document).expect("plain data");
    // A chunk of JSON is filled up with blanks.
    text.resize(text.len().next_multiple_of(4), b' ');
    // A Gaussian's bytes are a multiple of four, and so are those of all.
    let length = 12 + 8 + text.len() as u64 + 8 + binary.len() as u64;
    let too_long = || Error::argument("the JSON document is too long for a GLB file");
    let word = |n: u64| u32::try_from(n).map(u32::to_le_bytes).map_err(|_| too_long());
    let mut head = b"glTF\x02\0\0\0".to_vec();
    head.extend(word(length)?);
    head.extend(word(text.len() as u64)?);
    head.extend(b"JSON");
    head.extend(text);
    head.extend(word(binary.len() as u64)?);
    head.extend(b"BIN\0");
    written(out, length, context, |sink| {
        sink.put(&head)?;
        sink.put(binary)
    })
}
