// What turns depth into whole numbers, and back.
struct Scale {
    up: f32,
    down: f32,
}
