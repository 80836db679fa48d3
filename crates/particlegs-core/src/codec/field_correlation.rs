//! Correlations between two scalar fields of a block's Gaussians as bytes (docs/format.md, section 14).

use super::number_model::{FieldNumberCoder, FieldPredictor, expected};
use super::rans::{Coder, RansReader, RansWriter};
use super::wire::WireReader;
use crate::math::{each_axis, exp, norm};
use crate::model::Mixture;

/// Steps in standard errors: what lies within two errors of the guess is the guess.
const STEP: f32 = 4.0;
/// Numbers are the area tangents of correlations: their errors do not depend on them. So large at most.
const LARGEST: f64 = 4.0;
/// Gaussians of fewer particles say nothing of how correlations change with distance.
const FEW: f64 = 16.0;

/// Header of a section, before its stream.
#[derive(Clone, Copy, Debug, PartialEq)]
struct CorrelationHeader {
    /// Numbers of the two fields.
    fields: [u8; 2],
    /// In standard errors.
    step: f32,
    /// Variance of a number's change over a world unit.
    change: f32,
    /// The number where nothing is decoded yet.
    start: f32,
}

impl CorrelationHeader {
    fn write(&self) -> Vec<u8> {
        let floats = [self.step, self.change, self.start];
        self.fields.into_iter().chain(floats.into_iter().flat_map(f32::to_le_bytes)).collect()
    }

    fn read(r: &mut WireReader<'_>) -> Result<Self, String> {
        let (fields, [step, change, start]) = ([r.u8()?, r.u8()?], [r.f32()?, r.f32()?, r.f32()?]);
        let positive = |v: f32| v > 0.0 && v < 1e30;
        if fields[0] == fields[1] || !positive(step) || !positive(change) || !start.is_finite() {
            return Err("the head of a correlation is out of range".into());
        }
        Ok(CorrelationHeader { fields, step, change, start })
    }
}

/// Encodes the correlations of two fields, by their numbers, of a block's decoded Gaussians.
pub fn encode_correlation(fields: [u8; 2], correlations: &[f64], gaussians: &Mixture) -> Vec<u8> {
    // Correlations of 1 have an infinite area tangent, which the limit cuts off.
    let wanted: Vec<f64> =
        correlations.iter().map(|r| libm::atanh(r.clamp(-1.0, 1.0)).clamp(-LARGEST, LARGEST)).collect();
    let header = CorrelationHeader { fields, ..statistics(&wanted, gaussians) };
    let mut writer = RansWriter::default();
    // Every number is within the range that the walk accepts.
    let stream = walk(&header, gaussians, &mut writer, Some(&wanted)).map(|_| writer.finish()).unwrap_or_default();
    [header.write(), stream].concat()
}

/// Decodes a section: the numbers of its fields, and the correlations.
pub(crate) fn decode_correlation(bytes: &[u8], gaussians: &Mixture) -> Result<([u8; 2], Vec<f64>), String> {
    let mut r = WireReader::new(bytes);
    let header = CorrelationHeader::read(&mut r)?;
    let mut reader = RansReader::new(&bytes[r.position()..]).ok_or("a correlation's stream has no start")?;
    let numbers = walk(&header, gaussians, &mut reader, None)?;
    if !reader.finished() || !reader.rest().is_empty() {
        return Err("a correlation's stream does not end where it should".into());
    }
    let correlation = |z: f64| {
        // By the exact exponential and not by `tanh`, so that every machine gets the same bits.
        let t = exp(2.0 * z);
        (t - 1.0) / (t + 1.0)
    };
    Ok((header.fields, numbers.into_iter().map(correlation).collect()))
}

fn walk(
    header: &CorrelationHeader,
    g: &Mixture,
    c: &mut impl Coder,
    wanted: Option<&[f64]>,
) -> Result<Vec<f64>, String> {
    let (mut out, mut done, mut models) = (vec![0.0; g.len()], FieldPredictor::new(g), FieldNumberCoder::default());
    for i in 0..g.len() {
        let n = g.count[i];
        // Gaussians without a particle have a correlation of 0 (section 14).
        if n < 1.0 {
            continue;
        }
        if c.exhausted() {
            return Err("a correlation's stream ends too soon".into());
        }
        let neighbours = done.near(i);
        let weights = done.weights(&neighbours, f64::from(header.change), |_, count| 1.0 / count);
        let (guess, variance) = expected(&neighbours, &weights, f64::from(header.start), |j| out[j]);
        // Fisher's transform: the error of an area tangent hangs on the count alone.
        let error = 1.0 / n.sqrt();
        let step = f64::from(header.step) * error;
        let number = models.code(c, [guess, variance], [error, step], wanted.map(|w| w[i]))?;
        out[i] = number.clamp(-LARGEST, LARGEST);
        done.push(i);
    }
    Ok(out)
}

/// The header's statistics of all of a block's numbers: their mean, and how they change with distance.
fn statistics(numbers: &[f64], g: &Mixture) -> CorrelationHeader {
    let indices: Vec<usize> = (0..g.len()).filter(|&i| g.count[i] >= 1.0).collect();
    let sum = |value: &dyn Fn(usize) -> f64| indices.iter().map(|&i| value(i)).sum::<f64>();
    let start = sum(&|i| g.count[i] * numbers[i]) / sum(&|i| g.count[i]).max(1.0);
    let (mut change, mut pairs) = (0.0, 0.0f64);
    for pair in indices.windows(2) {
        let [i, j] = [pair[0], pair[1]];
        let d = norm(each_axis(|k| g.mean[k][i] - g.mean[k][j]));
        if d > 0.0 && g.count[i] >= FEW && g.count[j] >= FEW {
            let difference = numbers[i] - numbers[j];
            // Noise of both is taken away, because e and E of section 14 add it to what is expected.
            change += (difference * difference - 1.0 / g.count[i] - 1.0 / g.count[j]) / d;
            pairs += 1.0;
        }
    }
    let change = (change / pairs.max(1.0)).clamp(1e-12, 1e25) as f32;
    CorrelationHeader { fields: [0; 2], step: STEP, change, start: start as f32 }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::math::{Random, Sym3};

    fn scene() -> (Mixture, Vec<f64>) {
        let (mut m, mut r) = (Mixture::new(false), Vec::new());
        for i in 0..400 {
            let mut random = Random::new(5, 0, i);
            let place = i as f64 / 40.0;
            let count = if i % 50 == 7 { 0.0 } else { (1.0 + 200.0 * random.uniform()).floor() };
            m.push([place, random.normal(), 0.0], Sym3::scaled_identity(0.01), count, 0.0);
            r.push(libm::tanh(libm::sin(place) + random.normal() / count.max(1.0).sqrt()));
        }
        (m, r)
    }

    #[test]
    fn correlations_come_back_within_their_errors_in_few_bytes() {
        let (m, r) = scene();
        let bytes = encode_correlation([1, 4], &r, &m);
        let (fields, back) = decode_correlation(&bytes, &m).unwrap();
        assert_eq!(fields, [1, 4]);
        assert!(bytes.len() < 200, "{} bytes", bytes.len());
        for i in (0..m.len()).filter(|&i| m.count[i] >= 1.0) {
            let difference = libm::atanh(r[i]).clamp(-LARGEST, LARGEST) - libm::atanh(back[i]);
            assert!(difference.abs() < 2.001 / m.count[i].sqrt(), "{i}: {difference}");
        }
        // Steps of four errors add no more noise than there is: what lies near the neighbours is theirs.
        let error = |correlations: &[f64]| {
            let difference = |i: usize| correlations[i] - libm::tanh(libm::sin(i as f64 / 40.0));
            let indices = (0..m.len()).filter(|&i| m.count[i] >= 1.0);
            indices.map(|i| difference(i) * difference(i)).sum::<f64>()
        };
        assert!(error(&back) < 1.3 * error(&r), "{} {}", error(&back), error(&r));
    }

    #[test]
    fn damaged_sections_are_refused_or_correlations() {
        let (m, r) = scene();
        let bytes = encode_correlation([0, 1], &r, &m);
        for cut in 0..bytes.len() {
            assert!(decode_correlation(&bytes[..cut], &m).is_err(), "cut at {cut}");
        }
        for at in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[at] ^= 0x14;
            if let Ok((_, back)) = decode_correlation(&damaged, &m) {
                assert!(back.iter().all(|r| r.abs() < 1.0), "byte {at}");
            }
        }
    }
}
