// Rounded levels.
fn pixel_count() -> u32 {
    return frame.size.x * frame.size.y;
}

fn level_at(pixel: u32) -> u32 {
    let x = pixel % frame.size.x;
    let y = pixel / frame.size.x;
    var level = 0.0;
    if style.kind == 2u {
        level = blurred(x, y);
    } else {
        level = level_of(x, y);
    }
    return u32(clamp(round(level), 0.0, 255.0));
}
