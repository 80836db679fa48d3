// The picture after FXAA.

@group(0) @binding(2) var<storage, read_write> picture: array<u32>;

fn pixel_count() -> u32 {
    return view.size.x * view.size.y;
}

fn level_at(pixel: u32) -> u32 {
    return filtered(vec2i(vec2u(pixel % view.size.x, pixel / view.size.x)));
}
