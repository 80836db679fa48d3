//! Morton codes: they interleave the bits of three numbers, so that neighbours in space get similar codes.

use crate::{PositionColumns, finite_ends};
use particlegs_core::parallel;

/// Bits per axis when particles are sorted: three axes fill a code.
const ORDER_BITS: u32 = 21;

/// Number of bits of each axis in a code.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bits([u32; 3]);

impl Bits {
    /// Enough bits for the largest numbers; `None` if a code would need more than 64.
    pub fn new(last: [u32; 3]) -> Option<Bits> {
        let bits = last.map(|q| 32 - q.leading_zeros());
        (bits.iter().sum::<u32>() <= 64).then_some(Bits(bits))
    }

    /// The code of three numbers of these bits.
    pub fn code(&self, q: [u32; 3]) -> u64 {
        self.rounds().fold(0, |code, (bit, k)| code << 1 | u64::from(q[k] >> bit & 1))
    }

    /// The numbers of a code; `None` for one of more bits.
    pub fn numbers(&self, code: u64) -> Option<[u32; 3]> {
        let (mut q, mut left) = ([0; 3], self.0.iter().sum::<u32>());
        if left < 64 && code >> left != 0 {
            return None;
        }
        for (bit, k) in self.rounds() {
            left -= 1;
            q[k] |= ((code >> left & 1) as u32) << bit;
        }
        Some(q)
    }

    /// Bits and their axes, from the highest; axes with fewer bits start lower.
    fn rounds(&self) -> impl Iterator<Item = (u32, usize)> {
        let bits = self.0;
        let highest = bits[0].max(bits[1]).max(bits[2]);
        (0..highest).rev().flat_map(move |bit| (0..3).rev().filter(move |k| bit < bits[*k]).map(move |k| (bit, k)))
    }
}

/// Particle indices sorted by code; the sort is stable.
pub fn order_of(codes: &[u64]) -> Vec<u32> {
    let mut keys: Vec<(u64, u32)> = codes.iter().copied().zip(0u32..).collect();
    keys.sort_unstable();
    keys.into_iter().map(|k| k.1).collect()
}

/// Codes of particles in cubes, 2^21 along the longest edge of their bounds.
pub fn codes_of_places(particles: &PositionColumns) -> Vec<u64> {
    let ends = particles.each_ref().map(|c| finite_ends(c));
    let longest = ends.iter().map(|e| e[1] - e[0]).fold(0.0, f64::max);
    let cubes = f64::from(1 << ORDER_BITS);
    let scale = if longest > 0.0 { cubes / longest } else { 0.0 };
    let bits = Bits([ORDER_BITS; 3]);
    parallel::map_range(particles[0].len(), |i| {
        // The upper edge belongs to the last cube, and NaN becomes 0.
        let cube = |k: usize| ((f64::from(particles[k][i]) - ends[k][0]) * scale).clamp(0.0, cubes - 1.0) as u32;
        bits.code([cube(0), cube(1), cube(2)])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn codes_decode_to_their_numbers() {
        for last in [[0, 0, 0], [7, 7, 7], [0, 5, 1 << 20], [u32::MAX, u32::MAX, 0], [1, 0, 0]] {
            let bits = Bits::new(last).unwrap();
            for q in [[0; 3], last, last.map(|v| v / 3)] {
                assert_eq!(bits.numbers(bits.code(q)), Some(q));
            }
        }
        assert!(Bits::new([u32::MAX, u32::MAX, 1]).is_none());
        let bits = Bits::new([3, 3, 3]).unwrap();
        assert!(bits.numbers(64).is_none() && bits.numbers(63) == Some([3, 3, 3]));
        // Eight cubes of an edge of two are filled before the next.
        assert!(bits.code([1, 1, 1]) < bits.code([2, 0, 0]) && bits.code([1, 1, 1]) == 7);
    }

    #[test]
    fn neighbours_get_similar_codes() {
        let line: Vec<f32> = (0..64).map(|i| (i * 37 % 64) as f32).collect();
        let order = order_of(&codes_of_places(&[line.clone(), line.clone(), line.clone()]));
        let sorted: Vec<f32> = order.iter().map(|i| line[*i as usize]).collect();
        assert!(sorted.windows(2).all(|w| w[0] < w[1]), "{sorted:?}");
        // What has no place has one all the same.
        let odd = [vec![f32::NAN, 1.0, f32::INFINITY], vec![2.0; 3], vec![-1.0, 0.0, 5.0]];
        let mut order = order_of(&codes_of_places(&odd));
        order.sort_unstable();
        assert_eq!(order, [0, 1, 2]);
    }
}
