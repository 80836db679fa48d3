//! Numbers sorted by 32-bit keys: a radix sort, stable, four bits a pass.

use crate::kernel::{BufferUse, Kernel};
use crate::{Device, groups};
use std::ops::Range;

const SORT: &str = include_str!("sort.wgsl");
/// Values of four bits.
const DIGITS: u32 = 16;
/// Keys of a thread, and of a workgroup.
const EACH: u32 = 8;
const BLOCK: u32 = 512;

/// Whether values go with keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum SortPayload {
    Values,
    /// Nothing but the key's own bits that it is not sorted by.
    Nothing,
}

pub(crate) struct Sorter {
    carry: SortPayload,
    count: Kernel,
    scan: Kernel,
    scatter: Kernel,
}

/// A number of keys and values that are sorted where they lie, and what is bound to kernels.
pub(crate) struct Sort {
    pub keys: wgpu::Buffer,
    /// Empty where keys carry nothing.
    pub values: wgpu::Buffer,
    passes: Vec<SortPass>,
    /// Second places of keys and values, counts and their sums: what is written before it is read.
    #[cfg(test)]
    pub scratch: [wgpu::Buffer; 4],
}

struct SortPass {
    record: wgpu::Buffer,
    shift: u32,
    count: wgpu::BindGroup,
    scan: wgpu::BindGroup,
    scatter: wgpu::BindGroup,
}

#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
#[repr(C)]
struct PassRecord {
    count: u32,
    blocks: u32,
    shift: u32,
    pad: u32,
}

impl Sorter {
    /// Compiled for a device.
    pub fn new(device: &Device, carry: SortPayload) -> Sorter {
        use BufferUse::{Read, Uniform, Write};
        let new = |label, sources: &[&str], uses: &[BufferUse]| Kernel::new(device, label, sources, uses);
        let (carried, carried_uses): (_, &[BufferUse]) = match carry {
            SortPayload::Values => (include_str!("values.wgsl"), &[Read, Write]),
            SortPayload::Nothing => (include_str!("no_values.wgsl"), &[]),
        };
        Sorter {
            carry,
            count: new("digits", &[include_str!("count_main.wgsl"), SORT], &[Uniform, Read, Write]),
            scan: new(
                "places of digits",
                &[include_str!("scan_main.wgsl"), SORT, include_str!("../share.wgsl")],
                &[Uniform, Write, Write],
            ),
            scatter: new(
                "scatter",
                &[include_str!("scatter_main.wgsl"), carried, SORT],
                &[&[Uniform, Read, Read, Read, Write], carried_uses].concat(),
            ),
        }
    }

    /// Room for `most` keys that are sorted by some of their bits.
    pub fn room(&self, device: &Device, most: u32, bits: Range<u32>) -> Sort {
        use wgpu::BufferUsages as Use;
        let storage = Use::STORAGE | Use::COPY_DST | Use::COPY_SRC;
        let column = |label, count: u32| device.buffer(label, 4 * u64::from(count), storage);
        let carried = if self.carry == SortPayload::Values { most } else { 0 };
        let [keys, other_keys] = ["keys", "other keys"].map(|label| column(label, most));
        let [values, other_values] = ["values", "other values"].map(|label| column(label, carried));
        let counts = column("digits", DIGITS * most.div_ceil(BLOCK));
        let totals = column("all digits", DIGITS);
        let pass = |k: u32| {
            let (forward, backward) = ([&keys, &values], [&other_keys, &other_values]);
            let (source, target) = if k.is_multiple_of(2) { (forward, backward) } else { (backward, forward) };
            let record = device.buffer("pass", size_of::<PassRecord>() as u64, Use::UNIFORM | Use::COPY_DST);
            let mut all = vec![&record, source[0], &counts, &totals, target[0]];
            if self.carry == SortPayload::Values {
                all.extend([source[1], target[1]]);
            }
            SortPass {
                shift: bits.start + 4 * k,
                count: self.count.bind(device, &[&record, source[0], &counts]),
                scan: self.scan.bind(device, &[&record, &counts, &totals]),
                scatter: self.scatter.bind(device, &all),
                record,
            }
        };
        // An even number of them, so that all comes back to its first place.
        let passes = (0..2 * (bits.end - bits.start).div_ceil(8)).map(pass).collect();
        Sort {
            keys,
            values,
            passes,
            #[cfg(test)]
            scratch: [other_keys, other_values, counts, totals],
        }
    }

    /// Sorts the first `count`, which were said before by [`Sort::set`].
    pub fn run(&self, pass: &mut wgpu::ComputePass<'_>, sort: &Sort, count: u32) {
        let blocks = groups(u64::from(count.div_ceil(EACH)));
        for step in &sort.passes {
            self.count.run(pass, &step.count, blocks);
            self.scan.run(pass, &step.scan, [DIGITS, 1]);
            self.scatter.run(pass, &step.scatter, blocks);
        }
    }
}

impl Sort {
    /// Says how many are to be sorted in what is submitted next.
    pub fn set(&self, queue: &wgpu::Queue, count: u32) {
        for pass in &self.passes {
            let record = PassRecord { count, blocks: count.div_ceil(BLOCK), shift: pass.shift, pad: 0 };
            queue.write_buffer(&pass.record, 0, bytemuck::bytes_of(&record));
        }
    }
}

#[cfg(test)]
mod tests {
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
}
