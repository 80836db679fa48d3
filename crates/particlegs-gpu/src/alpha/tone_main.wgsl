// Brightness to grey levels: what core's tone makes of the depth that looks as bright.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> sums: array<f32>;
@group(0) @binding(2) var<storage, read_write> picture: array<u32>;

fn pixel_count() -> u32 {
    return frame.size.x * frame.size.y;
}

fn level_at(pixel: u32) -> u32 {
    return u32(round(255.0 * clamp(sums[pixel], 0.0, frame.brightest)));
}
