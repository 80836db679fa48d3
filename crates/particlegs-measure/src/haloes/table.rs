//! A catalogue of haloes as named columns.

/// A column of a catalogue, one value a halo.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HaloColumn {
    /// Name, as other catalogues have it where they have the quantity.
    pub name: String,
    /// Unit; empty of numbers without one.
    pub unit: String,
    /// Description of the quantity.
    pub description: String,
    /// Whether the values are whole numbers.
    pub whole: bool,
    /// NaN where there are too few particles.
    pub values: Vec<f64>,
}

/// Haloes, by mass, the heaviest first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct HaloCatalogue {
    /// Columns of one length.
    pub columns: Vec<HaloColumn>,
    /// Method and definitions of its numbers: lines of text.
    pub remarks: Vec<String>,
    /// Notes for a user.
    pub notes: Vec<String>,
    /// Centre of each, world units.
    pub centers: Vec<[f64; 3]>,
}

impl HaloCatalogue {
    /// Number of haloes.
    pub fn len(&self) -> usize {
        self.centers.len()
    }

    /// Whether it has no haloes.
    pub fn is_empty(&self) -> bool {
        self.centers.is_empty()
    }

    /// Values of a column.
    pub fn column(&self, name: &str) -> Option<&[f64]> {
        self.columns.iter().find(|c| c.name == name).map(|c| &c.values[..])
    }

    /// The masses that haloes are compared by, and their unit: M200m, or particles within R200m where masses are not
    /// known. NaN of haloes with too few particles.
    pub fn masses(&self) -> Option<(Vec<f64>, &str)> {
        let (column, unit) = match self.columns.iter().find(|c| c.name == "m200m") {
            Some(column) => (column, &column.unit[..]),
            None => (self.columns.iter().find(|c| c.name == "n200m")?, "particles"),
        };
        let radii = self.column("r200m")?;
        let value = |(m, r): (&f64, &f64)| if r.is_nan() { f64::NAN } else { *m };
        Some((column.values.iter().zip(radii).map(value).collect(), unit))
    }
}
