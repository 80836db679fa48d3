// A pixel's layers to its level; rows of the picture go down, those of layers up.

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> layers: array<u32>;
@group(0) @binding(2) var<storage, read_write> picture: array<u32>;

fn level_of(layer: u32) -> u32 {
    let front = to_float(layer & 255u);
    let back = to_float(layer >> 8u);
    return to_byte(plus(front, times(back, minus(1.0, front))));
}

fn pixel_count() -> u32 {
    return view.size.x * (view.strip.y - view.strip.x);
}

fn level_at(pixel: u32) -> u32 {
    let row = view.strip.y - view.strip.x - 1u - pixel / view.size.x;
    return level_of(layers[row * view.size.x + pixel % view.size.x]);
}
