// How far a step goes: particlegs-train's depth::steps::StepSize. By place, shape, count.
struct Step {
    // Adam's rates over the correction of the mean gradients.
    rate: vec4f,
    // The inverse correction of the mean squares.
    unroot: vec4f,
    // What a group's mean root of squares is multiplied by to be added in Adam's division.
    epsilon: vec4f,
    // Decays of Adam's means.
    beta: vec2f,
    // Share of ln(count / count at the start) that is taken back.
    decay: f32,
    // Share that the average takes of the new Gaussians.
    average: f32,
    // Gaussians, and groups of neighbours.
    count: u32,
    groups: u32,
    pad0: u32,
    pad1: u32,
}

const PARTS: u32 = 64u;

fn kind_of(k: u32) -> u32 {
    return select(select(2u, 1u, k < 9u), 0u, k < 3u);
}
