//! SZ3 and ZFP as baselines: each axis is a column, in the input order or in Morton order.

use super::External;
use crate::{Baseline, CompressedParticles, PositionColumns, check_bound, morton};
use particlegs_core::{Error, Result};

/// Order of the columns.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum ColumnOrder {
    File,
    /// Morton order of cubes, 2^21 along the longest edge of the box, so that neighbours in space are neighbours in the
    /// columns. It is also the order after decoding.
    Morton,
}

/// A compression library.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum CompressionLibrary {
    /// SZ3 (Liang et al., IEEE Trans. Big Data 2023) with an absolute bound; each axis uses the better of two
    /// predictors: interpolation and Lorenzo (the default), or Lorenzo and regression.
    Sz3,
    /// ZFP (Lindstrom, IEEE TVCG 2014) with fixed accuracy; the tolerance is the bound.
    Zfp,
}

impl CompressionLibrary {
    fn name(self) -> &'static str {
        match self {
            CompressionLibrary::Sz3 => "SZ3",
            CompressionLibrary::Zfp => "ZFP",
        }
    }
}

pub struct LibraryBaseline {
    pub external: External,
    pub library: CompressionLibrary,
    pub order: ColumnOrder,
}

impl Baseline for LibraryBaseline {
    fn name(&self) -> &'static str {
        match (self.library, self.order) {
            (CompressionLibrary::Sz3, ColumnOrder::File) => "SZ3, file order",
            (CompressionLibrary::Sz3, ColumnOrder::Morton) => "SZ3, Morton order",
            (CompressionLibrary::Zfp, ColumnOrder::File) => "ZFP, file order",
            (CompressionLibrary::Zfp, ColumnOrder::Morton) => "ZFP, Morton order",
        }
    }

    fn source(&self) -> String {
        self.external.source(self.library.name())
    }

    fn compress(&self, particles: &PositionColumns, bound: f64) -> Result<CompressedParticles> {
        self.external.coded(self.library.name(), particles, bound, self.order)
    }

    fn decompress(&self, bytes: &[u8]) -> Result<PositionColumns> {
        self.external.columns(self.library.name(), bytes)
    }
}

impl External {
    fn coded(
        &self,
        name: &str,
        particles: &PositionColumns,
        bound: f64,
        order: ColumnOrder,
    ) -> Result<CompressedParticles> {
        check_bound(bound)?;
        let n = particles[0].len();
        if u32::try_from(n).is_err() || particles.iter().any(|c| c.len() != n) {
            return Err(Error::argument("the three columns must have one length below 2^32"));
        }
        let order = (order == ColumnOrder::Morton).then(|| morton::order_of(&morton::codes_of_places(particles)));
        let mut data = Vec::with_capacity(12 * n);
        for column in particles {
            match &order {
                None => column.iter().for_each(|v| data.extend(v.to_le_bytes())),
                Some(order) => order.iter().for_each(|i| data.extend(column[*i as usize].to_le_bytes())),
            }
        }
        Ok(CompressedParticles { bytes: self.compress(name, bound, n, &data)?, order })
    }

    fn columns(&self, name: &str, bytes: &[u8]) -> Result<PositionColumns> {
        let data = self.decompress(name, bytes)?;
        let (values, rest) = data.as_chunks::<4>();
        let n = values.len() / 3;
        if !rest.is_empty() || values.len() != 3 * n {
            return Err(Error::input(name, "its columns differ in length"));
        }
        Ok([0, 1, 2].map(|k| values[k * n..(k + 1) * n].iter().map(|v| f32::from_le_bytes(*v)).collect()))
    }
}
