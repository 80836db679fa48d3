//! Places and axes as fixed.wgsl has them.

/// Bits of the fraction of a place, and of an axis.
const FRACTION: i32 = 40;
const AXIS_FRACTION: i32 = 47;
/// Places as far as this from the middle of the training frame do not fit: the way between two others is below 2^22 along
/// each axis, and below 2^23, all that 64 bits hold, along any.
const FARTHEST: f64 = 2_097_152.0;

/// The words of a coordinate, low one first, where it fits.
pub(super) fn place(v: f64) -> Option<[u32; 2]> {
    (v.abs() < FARTHEST).then(|| words((v * 2f64.powi(FRACTION)).round() as i64))
}

/// The magnitude of a part of an axis, and 1 where it is negative.
pub(super) fn axis(v: f64) -> [u32; 4] {
    let [low, high] = words((v.abs().min(1.0) * 2f64.powi(AXIS_FRACTION)).round() as i64);
    [low, high, u32::from(v < 0.0), 0]
}

fn words(v: i64) -> [u32; 2] {
    [v as u32, (v >> 32) as u32]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::kernel::{BufferUse, Kernel};
    use crate::tests::device;
    use particlegs_core::math::Random;
    use wgpu::BufferUsages;

    /// A kernel that tries the functions of fixed.wgsl: a thread rounds a place, and what lies of it along an axis.
    const ASKED: &str = "
@group(0) @binding(0) var<storage, read> places: array<vec2u>;
@group(0) @binding(1) var<storage, read> axes: array<vec4u>;
@group(0) @binding(2) var<storage, read_write> found: array<vec4u>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x < arrayLength(&found) {
        let part = axis_product(magnitude(places[id.x]), axes[id.x].xy);
        found[id.x] = vec4u(bitcast<u32>(to_float(places[id.x])), part, u32(is_negative(places[id.x])));
    }
}
";

    /// Small and large, of few bits and of many, and halfway between two floats.
    fn places() -> Vec<i64> {
        let mut all = vec![0, 1, -1, 1 << 62, -(1 << 62), (1 << 24) - 1, 1 << 24, (1 << 32) - 1, 1 << 32];
        for bits in 25..62 {
            // The even one is below, above; a little more and a little less than half.
            let halves = [1i64 << (bits - 25), 3 << (bits - 25)].map(|v| (1 << (bits - 1)) + v);
            all.extend(halves.into_iter().flat_map(|v| [v, v + 1, v - 1, -v]));
        }
        let mut r = Random::new(4, 1, 0);
        all.extend((0..2000).map(|i| (r.normal() * 2f64.powi(i % 58)) as i64 ^ (r.uniform() * 4e9) as i64));
        all.resize(all.len().next_multiple_of(64), 5);
        all
    }

    #[test]
    #[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
    fn whole_numbers_are_multiplied_and_rounded_as_by_the_cpu() {
        let device = device();
        let places = places();
        let mut r = Random::new(5, 1, 0);
        let axes: Vec<[u32; 4]> =
            places.iter().enumerate().map(|(i, _)| axis(if i % 9 == 0 { 1.0 } else { r.uniform() })).collect();
        let sources = [ASKED, include_str!("fixed.wgsl")];
        let kernel = Kernel::new(&device, "fixed", &sources, &[BufferUse::Read, BufferUse::Read, BufferUse::Write]);
        let place_words: Vec<[u32; 2]> = places.iter().map(|v| words(*v)).collect();
        let place_buffer = device.filled("places", &place_words, BufferUsages::STORAGE);
        let along = device.filled("axes", &axes, BufferUsages::STORAGE);
        let bytes = 16 * places.len() as u64;
        let output = device.buffer("found", bytes, BufferUsages::STORAGE | BufferUsages::COPY_SRC);
        let bound = kernel.bind(&device, &[&place_buffer, &along, &output]);
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        kernel.run(&mut pass, &bound, [places.len() as u32 / 64, 1]);
        drop(pass);
        device.queue.submit([encoder.finish()]);
        let output_bytes = device.read(&output, bytes).unwrap();
        for ((place, axis), record) in places.iter().zip(&axes).zip(output_bytes.chunks_exact(16)) {
            let word = |k: usize| u32::from_le_bytes(record[4 * k..4 * k + 4].try_into().unwrap());
            let nearest = *place as f32 * 2f32.powi(-FRACTION);
            assert_eq!(f32::from_bits(word(0)), nearest, "{place}");
            let along = u128::from(axis[0]) | u128::from(axis[1]) << 32;
            let part = ((u128::from(place.unsigned_abs()) * along) >> AXIS_FRACTION) as u64;
            assert_eq!([word(1), word(2)], words(part as i64), "{place} along {axis:?}");
            assert_eq!(word(3), u32::from(*place < 0));
        }
    }

    #[test]
    fn places_fit_where_their_differences_do() {
        assert_eq!(place(1.0), Some([0, 1 << 8]));
        assert_eq!(place(-1.0), Some([0, 0xffff_ff00]));
        assert!(place(FARTHEST.next_down()).is_some() && place(FARTHEST).is_none() && place(f64::NAN).is_none());
        assert_eq!(axis(-1.0), [0, 1 << 15, 1, 0]);
        // No more than 1, whatever rounding left of it.
        assert_eq!(axis(1.0 + 1e-15), [0, 1 << 15, 0, 0]);
    }
}
