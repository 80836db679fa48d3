// What turns depth into whole numbers, and back, on a plane.
struct Scale {
    up: f32,
    down: f32,
}
