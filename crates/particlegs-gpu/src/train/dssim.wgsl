// 1 - SSIM: particlegs-train's loss::dssim. A Gaussian window of 11 pixels, sigma 1.5, pictures continued with zeros.

const HALF: i32 = 5;
const C1: f32 = 1e-4;
const C2: f32 = 9e-4;

fn window(k: i32) -> f32 {
    const WEIGHTS = array<f32, 6>(0.266011725, 0.213005538, 0.109360690, 0.036000772, 0.007598758, 0.001028380);
    return WEIGHTS[abs(k)];
}
