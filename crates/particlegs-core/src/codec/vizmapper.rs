//! The section `VIZM`: the network of the alpha-blend law in 8 bits a weight (docs/format.md,
//! section 13).

use super::wire::{SectionFault, WireReader};
use crate::model::{VIZMAPPER_PARAMETERS, VIZMAPPER_SHAPE, VizMapper, VizRanges};
use crate::{Error, Result};

const LAYERS: usize = VIZMAPPER_SHAPE.len() - 1;
/// Bytes of the section: shape, ranges; two steps a layer; weights of one byte, biases of two.
pub const VIZMAPPER_BYTES: usize = 2 * VIZMAPPER_SHAPE.len() + 3 * 8 + 8 * LAYERS + WEIGHTS + 2 * BIASES;
const BIASES: usize = VIZMAPPER_SHAPE[1] + VIZMAPPER_SHAPE[2] + VIZMAPPER_SHAPE[3];
const WEIGHTS: usize = VIZMAPPER_PARAMETERS - BIASES;
/// Largest weights and biases in steps: the numbers that have an opposite.
const MOST_WEIGHT: f32 = 127.0;
const MOST_BIAS: f32 = 32_767.0;
/// Steps beyond this are no network's.
const WIDEST_STEP: f32 = 1e6;

pub fn write(network: &VizMapper) -> Result<Vec<u8>> {
    let p = &network.parameters;
    let most = WIDEST_STEP * MOST_WEIGHT;
    if p.len() != VIZMAPPER_PARAMETERS || !p.iter().all(|v| v.abs() <= most) {
        let message = format!("a VizMapper of {} parameters has a wrong number or infinite ones", p.len());
        return Err(Error::argument(message));
    }
    check_ranges(&network.ranges).map_err(Error::argument)?;
    let mut out = Vec::with_capacity(VIZMAPPER_BYTES);
    VIZMAPPER_SHAPE.iter().for_each(|&n| out.extend((n as u16).to_le_bytes()));
    let VizRanges { scale, opacity, floor } = network.ranges;
    [scale, opacity, floor].iter().for_each(|v| out.extend(v.to_le_bytes()));
    let mut rest = &p[..];
    for pair in VIZMAPPER_SHAPE.windows(2) {
        let (weights, others) = rest.split_at(pair[0] * pair[1]);
        let (biases, others) = others.split_at(pair[1]);
        rest = others;
        let (step, bias_step) = (step(weights, MOST_WEIGHT), step(biases, MOST_BIAS));
        out.extend(step.to_le_bytes());
        out.extend(bias_step.to_le_bytes());
        weights.iter().for_each(|&w| out.extend((in_steps(w, step, MOST_WEIGHT) as i8).to_le_bytes()));
        biases.iter().for_each(|&b| out.extend((in_steps(b, bias_step, MOST_BIAS) as i16).to_le_bytes()));
    }
    Ok(out)
}

pub fn read(bytes: &[u8]) -> std::result::Result<VizMapper, SectionFault> {
    let mut r = WireReader::new(bytes);
    let shape = [r.u16()?, r.u16()?, r.u16()?, r.u16()?];
    if shape.map(usize::from) != VIZMAPPER_SHAPE {
        return Err(SectionFault::Unknown(format!("unknown VizMapper shape {shape:?}")));
    }
    let ranges = VizRanges { scale: r.f64()?, opacity: r.f64()?, floor: r.f64()? };
    check_ranges(&ranges)?;
    let mut parameters = Vec::with_capacity(VIZMAPPER_PARAMETERS);
    for pair in VIZMAPPER_SHAPE.windows(2) {
        let (step, bias_step) = (r.f32()?, r.f32()?);
        if ![step, bias_step].iter().all(|s| (0.0..=WIDEST_STEP).contains(s)) {
            return Err(SectionFault::Corrupt(format!("a VizMapper has invalid steps {step} and {bias_step}")));
        }
        for _ in 0..pair[0] * pair[1] {
            let w = r.u8()? as i8;
            if w == i8::MIN {
                return Err(SectionFault::Corrupt("a weight of a VizMapper is out of range".into()));
            }
            parameters.push(f32::from(w) * step);
        }
        for _ in 0..pair[1] {
            let b = r.u16()? as i16;
            if b == i16::MIN {
                return Err(SectionFault::Corrupt("a bias of a VizMapper is out of range".into()));
            }
            parameters.push(f32::from(b) * bias_step);
        }
    }
    if !r.is_done() {
        return Err(SectionFault::Corrupt(format!("a VizMapper has a wrong size: {} bytes", bytes.len())));
    }
    Ok(VizMapper { parameters, ranges })
}

/// Scales stay positive, opacities keep a positive factor.
fn check_ranges(r: &VizRanges) -> std::result::Result<(), String> {
    let valid = (0.0..1.0).contains(&r.scale) && (0.0..=16.0).contains(&r.opacity) && r.floor > 0.0 && r.floor <= 1.0;
    if valid {
        Ok(())
    } else {
        let VizRanges { scale, opacity, floor } = r;
        Err(format!(
            "a VizMapper range is invalid: scale {scale} must be in [0, 1), opacity {opacity} in [0, 16], floor {floor} in (0, 1]"
        ))
    }
}

/// The step in which the largest of the values is `most`.
fn step(values: &[f32], most: f32) -> f32 {
    values.iter().fold(0.0f32, |m, v| m.max(v.abs())) / most
}

fn in_steps(value: f32, step: f32, most: f32) -> f32 {
    // A layer of zeros has a step of 0.
    if step > 0.0 { (value / step).round().clamp(-most, most) } else { 0.0 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::Random;
    use crate::render::alpha::network::twin::plain;

    /// Weights as a network's before and after training: uniform within 1 / sqrt(inputs), the last
    /// layer's zero; then all moved, the first layer's most.
    fn network(seed: u64, trained: bool) -> VizMapper {
        let mut parameters = Vec::new();
        for (layer, pair) in VIZMAPPER_SHAPE.windows(2).enumerate() {
            for i in 0..pair[0] * pair[1] + pair[1] {
                let mut r = Random::new(seed, layer as u32, i as u64);
                let uniform = (2.0 * r.uniform() - 1.0) / (pair[0] as f64).sqrt();
                let start = if layer == LAYERS - 1 { 0.0 } else { uniform };
                let moved = if trained { [0.4, 0.15, 0.15][layer] * r.normal() } else { 0.0 };
                parameters.push((start + moved) as f32);
            }
        }
        VizMapper { parameters, ranges: VizRanges::TRAINING }
    }

    /// Outputs in -1 to 1, before the ranges (paper section III-B).
    fn outputs(n: &VizMapper, input: [f64; 4]) -> [f64; 2] {
        let parameters: Vec<f64> = n.parameters.iter().map(|v| f64::from(*v)).collect();
        plain(&parameters, input)
    }

    #[test]
    fn outputs_come_back_within_a_hundredth() {
        for trained in [false, true] {
            let (mut worst, mut squares, mut n) = (0.0f64, 0.0, 0.0);
            for seed in 0..3 {
                let a = network(seed, trained);
                let bytes = write(&a).unwrap();
                assert_eq!(bytes.len(), VIZMAPPER_BYTES);
                let b = read(&bytes).ok().unwrap();
                assert_eq!(a.ranges, b.ranges);
                for i in 0..500 {
                    let mut r = Random::new(seed, 9, i);
                    let f =
                        [1.5 * r.uniform() - 0.75, 1.5 * r.uniform() - 0.75, 0.5 + 0.8 * r.normal(), 0.6 * r.normal()];
                    for (p, q) in outputs(&a, f).iter().zip(outputs(&b, f)) {
                        worst = worst.max((p - q).abs());
                        squares += (p - q) * (p - q);
                        n += 1.0;
                    }
                }
            }
            let rms: f64 = (squares / n).sqrt();
            println!("trained {trained}: {VIZMAPPER_BYTES} bytes, output error rms {rms:.5}, largest {worst:.5}, of 1");
            assert!(rms < 0.01 && worst < 0.05, "{rms} {worst}");
            assert!(trained || worst == 0.0, "a network that changes nothing still changes nothing");
        }
    }

    #[test]
    fn what_contradicts_is_refused() {
        let bytes = write(&network(1, true)).unwrap();
        let with = |at: usize, value: &[u8]| {
            let mut b = bytes.clone();
            b[at..at + value.len()].copy_from_slice(value);
            read(&b)
        };
        assert!(matches!(with(0, &[5]), Err(SectionFault::Unknown(_))));
        for range in [f64::NAN, -0.1, 17.0, f64::INFINITY] {
            for k in 0..3 {
                assert!(matches!(with(8 + 8 * k, &range.to_le_bytes()), Err(SectionFault::Corrupt(_))), "{range}");
            }
        }
        for step in [f32::NAN, -1.0, f32::INFINITY, 2e6] {
            assert!(with(32, &step.to_le_bytes()).is_err() && with(36, &step.to_le_bytes()).is_err(), "{step}");
        }
        assert!(with(40, &[0x80]).is_err() && with(40 + 256, &[0, 0x80]).is_err());
        assert!(read(&bytes[..bytes.len() - 1]).is_err() && read(&[&bytes[..], &[0]].concat()).is_err());
        let n = network(1, true);
        let bad = |change: fn(&mut VizMapper)| {
            let mut n = n.clone();
            change(&mut n);
            assert!(write(&n).is_err());
        };
        bad(|n| n.parameters.truncate(4609));
        bad(|n| n.parameters[7] = f32::NAN);
        bad(|n| n.ranges.floor = 0.0);
    }
}
