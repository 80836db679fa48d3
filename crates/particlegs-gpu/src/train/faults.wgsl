// What a step tells: the loss and what gradients of pixels are multiplied by; Gaussians whose gradient is no number.
struct Faults {
    value: f32,
    scale: f32,
    share: f32,
    lit: f32,
    count: atomic<u32>,
    // The first, times 4, and its group: 0 position, 1 covariance, 2 count.
    first: atomic<u32>,
}
