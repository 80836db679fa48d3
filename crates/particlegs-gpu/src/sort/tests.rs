//! Against std's stable sort.

use super::*;
use crate::tests::device;
use particlegs_core::math::Random;

/// The first `n` keys with their values, sorted; those behind them as they were.
fn sorted(
    device: &Device,
    carry: SortPayload,
    n: u32,
    bits: Range<u32>,
    keys: &[u32],
    values: &[u32],
) -> Vec<(u32, u32)> {
    let sorter = Sorter::new(device, carry);
    let sort = sorter.room(device, keys.len() as u32, bits);
    device.queue.write_buffer(&sort.keys, 0, bytemuck::cast_slice(keys));
    if carry == SortPayload::Values {
        device.queue.write_buffer(&sort.values, 0, bytemuck::cast_slice(values));
    }
    sort.set(&device.queue, n);
    let mut encoder = device.device.create_command_encoder(&Default::default());
    let mut pass = encoder.begin_compute_pass(&Default::default());
    sorter.run(&mut pass, &sort, n);
    drop(pass);
    device.queue.submit([encoder.finish()]);
    let read = |b: &wgpu::Buffer| -> Vec<u32> {
        bytemuck::pod_collect_to_vec(&device.read(b, 4 * keys.len() as u64).unwrap())
    };
    let values = if carry == SortPayload::Values { read(&sort.values) } else { values.to_vec() };
    read(&sort.keys).into_iter().zip(values).collect()
}

/// Those of equal keys stay in their order; what lies behind them stays where it is.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn sorted_as_by_std() {
    let device = device();
    for (n, room, bits, ties) in [
        (0, 600, 32, 1),
        (1, 1, 32, 1),
        (511, 511, 32, 3),
        (512, 513, 32, 1 << 20),
        (513, 600, 9, 1),
        (5000, 5001, 8, 100),
        (70_000, 80_000, 32, 1000),
        (70_000, 70_000, 17, 7),
    ] {
        let mut r = Random::new(n, 2, bits);
        let largest = if bits == 32 { 4294967295.0 } else { (1u64 << bits) as f64 - 1.0 };
        let key = |r: &mut Random| ((r.uniform() * largest) as u32 / ties) * ties;
        let keys: Vec<u32> =
            (0..room).map(|i| if i % 11 == 0 { u32::MAX >> (32 - bits) } else { key(&mut r) }).collect();
        let values: Vec<u32> = (0..room as u32).map(|i| i.wrapping_mul(2654435761)).collect();
        let got = sorted(&device, SortPayload::Values, n as u32, 0..bits as u32, &keys, &values);
        let mut wanted: Vec<(u32, u32)> = keys.into_iter().zip(values).collect();
        wanted[..n as usize].sort_by_key(|(key, _)| *key);
        assert!(got == wanted, "{n} of {room} with {bits} bits");
    }
}

/// By their upper bits alone, equal ones in the order in which they came.
#[test]
#[ignore = "needs a GPU, or Mesa's lavapipe: tests/gpu/run.sh"]
fn keys_alone_are_sorted_by_some_bits() {
    let device = device();
    for (count, most) in [(1u32, 1u32), (1000, 3), (1025, 57_600), (70_000, 1 << 24)] {
        let mut r = Random::new(8, 1, 0);
        let mut key = || ((r.uniform() * f64::from(most)) as u32) << 8 | (r.bits() as u32 & 255);
        let keys: Vec<u32> = (0..count).map(|_| key()).collect();
        let bits = (u32::BITS - (most - 1).leading_zeros()).max(1);
        let got = sorted(&device, SortPayload::Nothing, count, 8..8 + bits, &keys, &vec![0; keys.len()]);
        let mut wanted = keys.clone();
        wanted.sort_by_key(|k| k >> 8);
        assert!(got.iter().map(|(key, _)| *key).eq(wanted), "{count} keys below {most}");
    }
}
