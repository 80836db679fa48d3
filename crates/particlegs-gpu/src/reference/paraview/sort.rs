//! Keys sorted by their upper bits, in whose order equal ones stay: four bits at a time.

use crate::Device;
use crate::kernel::{Kernel, Use};
use bytemuck::{Pod, Zeroable};

/// Keys of a block (sort.wgsl says so too).
const BLOCK: u32 = 1024;
/// Bits of a digit.
const BITS: u32 = 4;
/// Keys are sorted by the bits from this one on.
const LOWEST: u32 = 8;
/// Digits of a key at most.
const DIGITS: u32 = (32 - LOWEST) / BITS;

#[derive(Clone, Copy, Debug, Pod, Zeroable)]
#[repr(C)]
struct DigitRecord {
    count: u32,
    shift: u32,
    blocks: u32,
    pad: u32,
}

/// Sorts keys.
pub(super) struct Sorter {
    count: Kernel,
    starts: Kernel,
    place: Kernel,
}

/// The memory of keys, and what sorts them.
pub(super) struct Keys {
    /// Sorted from one to the other.
    pub buffers: [wgpu::Buffer; 2],
    starts: wgpu::Buffer,
    digits: Vec<wgpu::Buffer>,
}

impl Keys {
    /// For so many.
    pub fn new(device: &Device, most: u32) -> Keys {
        use wgpu::BufferUsages as Use;
        // Tests alone write and read them.
        let both = if cfg!(test) { Use::COPY_DST | Use::COPY_SRC } else { Use::empty() };
        let (bytes, blocks) = (4 * u64::from(most), u64::from(most.div_ceil(BLOCK)));
        let digit = |_| device.buffer("digit", size_of::<DigitRecord>() as u64, Use::UNIFORM | Use::COPY_DST);
        Keys {
            buffers: ["keys", "sorted keys"].map(|label| device.buffer(label, bytes, Use::STORAGE | both)),
            starts: device.buffer("starts", 4 * 16 * blocks, Use::STORAGE),
            digits: (0..DIGITS).map(digit).collect(),
        }
    }
}

impl Sorter {
    pub fn new(device: &Device) -> Sorter {
        let sort = include_str!("sort.wgsl");
        let kernel =
            |label, main, own: &[Use]| Kernel::new(device, label, &[main, sort], &[&[Use::Uniform], own].concat());
        Sorter {
            count: kernel("count of digits", include_str!("sort_count_main.wgsl"), &[Use::Read, Use::Write]),
            starts: kernel("starts of digits", include_str!("sort_starts_main.wgsl"), &[Use::Write]),
            place: kernel("sort", include_str!("sort_main.wgsl"), &[Use::Read, Use::Read, Use::Write]),
        }
    }

    /// Sorts the first `count` keys of the first buffer by `bits` bits; where they are then.
    pub fn sort<'a>(&self, device: &Device, keys: &'a Keys, count: u32, bits: u32) -> &'a wgpu::Buffer {
        let blocks = count.div_ceil(BLOCK);
        let digits = bits.div_ceil(BITS).min(DIGITS) as usize;
        let mut encoder = device.device.create_command_encoder(&Default::default());
        let mut pass = encoder.begin_compute_pass(&Default::default());
        for (k, digit) in keys.digits[..digits].iter().enumerate() {
            let record = DigitRecord { count, shift: LOWEST + BITS * k as u32, blocks, pad: 0 };
            device.queue.write_buffer(digit, 0, bytemuck::bytes_of(&record));
            let [old, new] = [k, k + 1].map(|k| &keys.buffers[k % 2]);
            let counted = self.count.bind(device, &[digit, old, &keys.starts]);
            self.count.run(&mut pass, &counted, [blocks, 1]);
            self.starts.run(&mut pass, &self.starts.bind(device, &[digit, &keys.starts]), [1, 1]);
            let placed = self.place.bind(device, &[digit, old, &keys.starts, new]);
            self.place.run(&mut pass, &placed, [blocks, 1]);
        }
        drop(pass);
        device.queue.submit([encoder.finish()]);
        &keys.buffers[digits % 2]
    }
}

#[cfg(test)]
impl Sorter {
    /// Keys, sorted on the device.
    pub fn sorted(&self, device: &Device, memory: &Keys, keys: &[u32], bits: u32) -> Vec<u32> {
        device.queue.write_buffer(&memory.buffers[0], 0, bytemuck::cast_slice(keys));
        let at = self.sort(device, memory, keys.len() as u32, bits);
        bytemuck::pod_collect_to_vec(&device.read(at, 4 * keys.len() as u64).unwrap())
    }
}
