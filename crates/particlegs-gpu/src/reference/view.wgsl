// A camera, and how depth is rounded (mod.rs has the same record).

struct View {
    // World to camera, rows x, y, z of (rotation | translation).
    rows: array<vec4f, 3>,
    // Of the projection: p00, p11, p22, p23.
    projection: vec4f,
    size: vec2u,
    radius: f32,
    opacity: f32,
    // What depth is multiplied by before it is rounded.
    scale: f32,
    // Particles of the piece; those of this dispatch, from the first to before the last. In paraview/rest*.wgsl rows.
    count: u32,
    first: u32,
    last: u32,
    // Always 0, which no compiler knows.
    nothing: u32,
    // In paraview/: the rows, from the bottom, whose layers are bound; from the first to before the last.
    strip: vec2u,
}
