//! A size that positions and fields meet together: bytes of fields are known once a model is fitted, so the fit is
//! repeated.

use super::{CompressedModel, Compression, FieldSelection, Options};
use particlegs_core::checkpoint::NoCheckpoints;
use particlegs_core::context::Context;
use particlegs_core::model::Target;
use particlegs_core::{Error, Result};
use particlegs_particles::Particles;

/// Fits at most.
const FITS: usize = 6;
/// A file that fills this share of the size is good enough, and the share that the next one is to fill.
const FILLED: f64 = 0.98;
const AIM: f64 = 0.99;
/// Bytes that a Gaussian and a number of a field take about: for the first fit.
const GAUSSIAN: f64 = 5.0;
const NUMBER: f64 = 3.0;

/// Compresses particles to a file that has at most the size of the target with its fields. The recipe of the file has
/// the size that positions and masses got.
///
/// # Errors
/// [`Error::Unreachable`] where no fit gives such a file; those of a compression.
pub(super) fn compress_to_total(
    particles: &Particles,
    options: &Options,
    fields: &FieldSelection<'_>,
    context: &Context<'_>,
) -> Result<CompressedModel> {
    let Target::Size(total) = options.target else { return Err(Error::argument("the target is not a size")) };
    let numbers: usize = fields.quantities().iter().map(|q| q.component_names().len()).sum();
    let mut size = (total as f64 * GAUSSIAN / (GAUSSIAN + NUMBER * numbers as f64)) as u64;
    let (mut best, mut fits) = (None::<CompressedModel>, Vec::new());
    for _ in 0..FITS {
        let options = Options { target: Target::Size(size.max(1)), ..options.clone() };
        let planned = Compression::of_positions(particles, fields.omitted(), &options, context);
        let mut done = match planned.and_then(|planned| planned.fit(&mut NoCheckpoints, context)) {
            // Less than the positions alone need: the best so far stands.
            Err(Error::Unreachable { .. }) => break,
            done => done?,
        };
        done.notes.splice(0..0, fields.notes().iter().cloned());
        let filled = done.bytes.len() as f64 > FILLED * size as f64;
        let done = fields.add_to_model(done, context)?;
        let whole = done.bytes.len() as u64;
        context.message(&format!("{size} bytes for positions and masses: {whole} bytes with fields"));
        fits.push([size as f64, whole as f64]);
        if whole <= total {
            // A fit that does not fill its size would make nothing of a larger one.
            let enough = whole as f64 >= FILLED * total as f64 || !filled;
            best = best.filter(|b| b.bytes.len() as u64 > whole).or(Some(done));
            if enough {
                break;
            }
        }
        size = next_size(&fits, total as f64);
    }
    best.ok_or_else(|| {
        let message = format!("no file of at most {total} bytes stores these positions and fields");
        Error::unreachable(message, "use a larger size, or fewer fields")
    })
}

/// The size to try, by sizes and whole sizes so far: on the line between the largest that was small enough and the
/// smallest that was not; else through the last two.
fn next_size(fits: &[[f64; 2]], total: f64) -> u64 {
    let aim = AIM * total;
    let low = fits.iter().filter(|f| f[1] <= total).max_by(|a, b| a[0].total_cmp(&b[0]));
    let high = fits.iter().filter(|f| f[1] > total).min_by(|a, b| a[0].total_cmp(&b[0]));
    let last = fits[fits.len() - 1];
    let [a, b] = match (low, high) {
        (Some(low), Some(high)) => [*low, *high],
        _ => [last, fits.iter().rev().nth(1).copied().unwrap_or([0.0; 2])],
    };
    // No file grows by less than its positions do.
    let slope = ((b[1] - a[1]) / (b[0] - a[0])).max(1.0);
    (a[0] + (aim - a[1]) / slope).clamp(0.3 * last[0], 3.0 * last[0]) as u64
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sizes_are_found_where_fields_grow_unevenly() {
        // Many Gaussians at first, then only finer numbers.
        let whole = |size: f64| size + 3.0 * size.min(20_000.0) + 0.3 * (size - 20_000.0).max(0.0).sqrt();
        for total in [5e3, 2e4, 7e4, 9e4, 2e5] {
            let mut fits = vec![[0.4 * total, whole(0.4 * total)]];
            while fits.len() < FITS && !(FILLED * total..=total).contains(&fits[fits.len() - 1][1]) {
                let next = next_size(&fits, total) as f64;
                fits.push([next, whole(next)]);
            }
            assert!((FILLED * total..=total).contains(&fits[fits.len() - 1][1]), "{total}: {fits:?}");
        }
    }
}
