//! VTP out: appended raw little-endian arrays, each at a place known beforehand.
//!
//! Points are float32 triples, or float64 where positions have more digits. One cell holds all of them as vertices: ParaView's Point Gaussian
//! needs no cell, but what it shows at first, surfaces, does. Masses are an array where particles
//! have weights or layers different masses, layers are numbered by an array where there are several.

use crate::fields::OutField;
use particlegs_core::context::Context;
use particlegs_core::model::{Layer, Mass};
use particlegs_core::text::{one_line, xml as within_xml};
use particlegs_core::{Error, Result, parallel};
use particlegs_files::output::PlacedFile;
use particlegs_particles::{Number, Run, SelectedParticles};
use std::fmt::Write;
use std::ops::Range;
use std::path::Path;

/// Bytes before each array: its length.
const LENGTH: u64 = 8;
/// Numbers begin at a multiple of this.
const ALIGNMENT: usize = 64;

/// First byte of each array's numbers, from the first array's length on; none where it is left out.
struct ArrayOffsets {
    points: u64,
    mass: Option<u64>,
    vertices: u64,
    /// Bytes of a vertex' number.
    vertex: u64,
    offsets: u64,
    species: Option<u64>,
    /// Fields that all layers have: of each layer, and where they lie.
    fields: Vec<(Vec<OutField>, u64)>,
    /// Whether points are float64.
    wide: bool,
    end: u64,
}

impl ArrayOffsets {
    fn new(count: u64, mass: bool, species: bool, fields: Vec<Vec<OutField>>, wide: bool) -> ArrayOffsets {
        let mut end = 0;
        let mut place = |bytes: u64| {
            let start = end + LENGTH;
            end = start + bytes;
            start
        };
        let vertex = if count <= i32::MAX as u64 { 4 } else { 8 };
        // Bytes come last, so that the other numbers stay aligned.
        let points = place(if wide { 24 } else { 12 } * count);
        let with_place = |field: Vec<OutField>, place: &mut dyn FnMut(u64) -> u64| {
            let bytes = field[0].number.bytes() * field[0].columns.len() as u64 * count;
            // So that what follows is aligned.
            let at = place(bytes.next_multiple_of(8));
            (field, at)
        };
        let mass = mass.then(|| place(4 * count));
        let (vertices, offsets) = (place(vertex * count), place(vertex));
        let fields = fields.into_iter().map(|f| with_place(f, &mut place)).collect();
        let species = species.then(|| place(count));
        ArrayOffsets { points, mass, vertices, vertex, offsets, species, fields, wide, end }
    }
}

/// Writes `particles` as VTP; gives the bytes written. Nothing is left where it fails.
pub fn write(particles: &SelectedParticles<'_>, out: &Path, context: &Context<'_>) -> Result<u64> {
    let layers = particles.layers();
    if layers.len() > 256 {
        return Err(Error::argument(format!("a VTP file can store at most 256 layers, not {}", layers.len())));
    }
    let count = particles.total();
    let unlike = layers.iter().any(|l| l.mass.unit() != layers[0].mass.unit());
    let fields = common(particles);
    let mass = (particles.weighted() || unlike) && !fields.iter().any(|f| is_mass(&f[0].name));
    let layout = ArrayOffsets::new(count, mass, layers.len() > 1, fields, particles.is_wide());
    let head = head(particles, &layers, &layout)?;
    let tail = "\n  </AppendedData>\n</VTKFile>\n";
    let start = head.len() as u64;
    let length = start + layout.end + tail.len() as u64;
    let file = PlacedFile::create(out, length)?;
    file.write_at(head.as_bytes(), 0)?;
    file.write_at(tail.as_bytes(), start + layout.end)?;
    let sized = [
        (Some(layout.points), if layout.wide { 24 } else { 12 } * count),
        (layout.mass, 4 * count),
        (Some(layout.vertices), layout.vertex * count),
        (Some(layout.offsets), layout.vertex),
        (layout.species, count),
    ];
    let sized_field = |(field, place): &(Vec<OutField>, u64)| {
        (Some(*place), field[0].number.bytes() * field[0].columns.len() as u64 * count)
    };
    let sized = sized.into_iter().chain(layout.fields.iter().map(sized_field));
    for (place, bytes) in sized.filter_map(|(p, b)| p.map(|p| (p, b))) {
        file.write_at(&bytes.to_le_bytes(), start + place - LENGTH)?;
    }
    file.write_at(&count.to_le_bytes()[..layout.vertex as usize], start + layout.offsets)?;
    let arrays = Arrays { file: &file, start, layout: &layout };
    context.begin("writing", count);
    let scratch = parallel::Scratch::<Vec<u8>>::default();
    particles.for_each_run(context, &|id, run| {
        let layer = particles.layer_of(id);
        let mass = layers.get(layer).map(|l| l.mass);
        scratch.with(|bytes| arrays.write_run((particles.first(id), particles.origin()), run, layer, mass, bytes))?;
        context.advance(run.columns[0].len() as u64);
        Ok(())
    })?;
    file.finish()?;
    context.end();
    Ok(length)
}

struct Arrays<'a> {
    file: &'a PlacedFile,
    /// The byte that their layout counts from.
    start: u64,
    layout: &'a ArrayOffsets,
}

impl Arrays<'_> {
    /// Writes the part that a run has of every array: it begins at particle `first`, is about `origin`, and its layer has
    /// `mass`.
    fn write_run(
        &self,
        (first, origin): (u64, [f64; 3]),
        run: &Run,
        layer: usize,
        mass: Option<Mass>,
        bytes: &mut Vec<u8>,
    ) -> Result<()> {
        let &Arrays { file, start, layout } = self;
        let [x, y, z, w] = &run.columns;
        bytes.clear();
        if layout.wide {
            bytes.extend((0..x.len()).flat_map(|i| run.wide(origin, i)).flat_map(f64::to_le_bytes));
        } else {
            bytes.extend((0..x.len()).flat_map(|i| [x[i], y[i], z[i]]).flat_map(f32::to_le_bytes));
        }
        file.write_at(bytes, start + layout.points + if layout.wide { 24 } else { 12 } * first)?;
        for (field, place) in &layout.fields {
            let Some(field) = field.get(layer).filter(|_| !x.is_empty()) else { continue };
            bytes.clear();
            field.append(run, bytes);
            file.write_at(bytes, start + place + field.number.bytes() * field.columns.len() as u64 * first)?;
        }
        if let Some(place) = layout.mass {
            let weight_of = |i: usize| w.get(i).copied().unwrap_or(1.0);
            let mass_of = |i: usize| match mass {
                // Weights count in units of the layer's mass, where it has one.
                Some(Mass::Weights(Some(unit))) => (f64::from(weight_of(i)) * unit) as f32,
                Some(Mass::Each(each)) => each as f32,
                _ => weight_of(i),
            };
            bytes.clear();
            bytes.extend((0..x.len()).map(mass_of).flat_map(f32::to_le_bytes));
            file.write_at(bytes, start + place + 4 * first)?;
        }
        bytes.clear();
        let vertices = first..first + x.len() as u64;
        match layout.vertex {
            4 => bytes.extend(vertices.flat_map(|i| (i as u32).to_le_bytes())),
            _ => bytes.extend(vertices.flat_map(u64::to_le_bytes)),
        }
        file.write_at(bytes, start + layout.vertices + layout.vertex * first)?;
        if let Some(place) = layout.species {
            bytes.clear();
            bytes.resize(x.len(), layer as u8);
            file.write_at(bytes, start + place + first)?;
        }
        Ok(())
    }
}

/// Names that a reader takes for masses.
fn is_mass(name: &str) -> bool {
    matches!(&name.to_lowercase()[..], "mass" | "masses")
}

pub fn common(particles: &SelectedParticles<'_>) -> Vec<Vec<OutField>> {
    crate::fields::common(particles, &[], &["Points", "species", "connectivity", "offsets"])
}

/// VTK's name of a type of numbers.
fn kind_of(number: Number) -> &'static str {
    match number {
        Number::F32 => "Float32",
        Number::F64 => "Float64",
        Number::I8 => "Int8",
        Number::I16 => "Int16",
        Number::I32 => "Int32",
        Number::I64 => "Int64",
        Number::U8 => "UInt8",
        Number::U16 => "UInt16",
        Number::U32 => "UInt32",
        Number::U64 => "UInt64",
    }
}

/// The XML up to the first array, as long as alignment needs.
fn head(particles: &SelectedParticles<'_>, layers: &[Layer<Range<u64>>], layout: &ArrayOffsets) -> Result<String> {
    let mut xml = String::from("<?xml version=\"1.0\"?>\n");
    text(particles, layers, layout, &mut xml).map_err(|_| Error::argument("cannot write the VTP header"))?;
    let opening = "  <AppendedData encoding=\"raw\">";
    let end = xml.len() + opening.len() + 1 + LENGTH as usize;
    let blanks = end.next_multiple_of(ALIGNMENT) - end;
    xml += opening;
    xml.extend(std::iter::repeat_n(' ', blanks));
    xml.push('_');
    Ok(xml)
}

fn text(
    particles: &SelectedParticles<'_>,
    layers: &[Layer<Range<u64>>],
    layout: &ArrayOffsets,
    xml: &mut String,
) -> std::fmt::Result {
    let count = particles.total();
    // Two dashes would end a comment.
    let shown = |text: &str| one_line(text).replace('-', "_");
    if let Some(unit) = particles.meta().units.length_text() {
        writeln!(xml, "<!-- lengths in {} -->", shown(unit))?;
    }
    if layout.species.is_some() {
        for (i, layer) in layers.iter().enumerate() {
            writeln!(xml, "<!-- species {i}: {} -->", shown(&layer.name))?;
        }
    }
    writeln!(xml, "<VTKFile type=\"PolyData\" version=\"1.0\" byte_order=\"LittleEndian\" header_type=\"UInt64\">")?;
    writeln!(xml, "  <PolyData>")?;
    if let Some(time) = particles.meta().epoch.time.filter(|t| t.is_finite()) {
        writeln!(
            xml,
            "    <FieldData>\n      <DataArray type=\"Float64\" Name=\"TimeValue\" NumberOfTuples=\"1\" format=\"ascii\">{time:e}</DataArray>\n    </FieldData>"
        )?;
    }
    writeln!(
        xml,
        "    <Piece NumberOfPoints=\"{count}\" NumberOfVerts=\"1\" NumberOfLines=\"0\" NumberOfStrips=\"0\" NumberOfPolys=\"0\">"
    )?;
    let array = |xml: &mut String, kind: &str, name: &str, components: u32, place: u64| {
        let offset = place - LENGTH;
        writeln!(
            xml,
            "        <DataArray type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\" format=\"appended\" offset=\"{offset}\"/>"
        )
    };
    writeln!(xml, "      <PointData>")?;
    if let Some(place) = layout.mass {
        array(xml, "Float32", "mass", 1, place)?;
    }
    for (field, place) in &layout.fields {
        let field = &field[0];
        let name = within_xml(&field.name);
        array(xml, kind_of(field.number), &name, field.columns.len() as u32, *place)?;
    }
    if let Some(place) = layout.species {
        array(xml, "UInt8", "species", 1, place)?;
    }
    writeln!(xml, "      </PointData>\n      <Points>")?;
    array(xml, if layout.wide { "Float64" } else { "Float32" }, "Points", 3, layout.points)?;
    writeln!(xml, "      </Points>\n      <Verts>")?;
    let kind = if layout.vertex == 4 { "Int32" } else { "Int64" };
    array(xml, kind, "connectivity", 1, layout.vertices)?;
    array(xml, kind, "offsets", 1, layout.offsets)?;
    writeln!(xml, "      </Verts>\n    </Piece>\n  </PolyData>")
}
