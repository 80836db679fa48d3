// What a step tells: the loss and what gradients of pixels are multiplied by; Gaussians whose gradient is no number.
struct Faults {
    value: f32,
    scale: f32,
    share: f32,
    lit: f32,
    count: atomic<u32>,
    // The first and its group as one number, as the kernel of the law has it.
    first: atomic<u32>,
    // 1 where that of the network is no number.
    network: u32,
}
