//! Declarations of a certificate's figures: each once, with its name, coding, range, unit and tolerance. Coding,
//! comparison, printing and lists all pass over these declarations.

use super::unit::per_length;
use std::fmt;

crate::named_values! {
    /// Extent of the measurements of a decoded model.
    #[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
    #[serde(rename_all = "snake_case")]
    pub enum CertificateLevel {
        None = "none": "The file holds no scores",
        #[default]
        Quick = "quick": "Pictures, densities, power spectrum and distances",
        Full = "full": "Also groups, matched in eight draws, and cross-validation of models fitted to halves of the particles",
        Blocks = "blocks": "Sum of what each block measures on its own; no process holds all particles",
    }
}

impl CertificateLevel {
    /// Whether anything is measured.
    pub fn measures(self) -> bool {
        self != CertificateLevel::None
    }
}

/// Scores of one picture.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct PictureScore {
    /// Masked PSNR, dB. `None`: identical or nothing lit.
    pub masked_psnr: Option<f64>,
    /// SSIM.
    pub ssim: f64,
}

/// The value of a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MetricValue {
    /// There is no such number, or it was not measured.
    None,
    /// Of a limit: it holds nowhere.
    Never,
    /// A whole number.
    Count(u64),
    /// A real number.
    Real(f64),
    /// Scores of a picture.
    Score(PictureScore),
}

/// The coding of a figure in the file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Coding {
    /// A whole number of so many bytes.
    Whole(usize),
    /// A byte: the place in a list of names.
    Name(&'static [&'static str]),
    /// f32.
    F32,
    /// f64.
    F64,
    /// f32; -2 stands for none.
    OptionalF32,
    /// f32, up to where something holds: -1 stands for not measured, 0 for nowhere.
    UpTo,
    /// u32, from which number of particles on something holds: 0 stands for no number, the largest for not measured.
    From,
    /// Masked PSNR (u16, steps of 1/200 dB, the largest for none) and SSIM (i16, steps of 1/32767); the lowest SSIM
    /// stands for a picture that was not drawn.
    Score,
}

/// The unit of a figure.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum MetricUnit {
    /// None, or one that its name says.
    Plain,
    /// The unit of length.
    Length,
    /// The unit of length cubed.
    Volume,
    /// One over the unit of length.
    WaveNumber,
    /// A share, written in per cent.
    Share,
}

/// Tolerance of a figure that is measured again: the same program measures the same bits, another version may round
/// otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Tolerance {
    /// Not at all.
    Same,
    /// This much, and of numbers above 1 this share.
    Within(f64),
    /// This share.
    Relative(f64),
    /// 0.05 dB and 0.002 of SSIM.
    Score,
    /// It may be any.
    Any,
}

/// A figure: all that is known of it but its value.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Metric {
    /// In words.
    pub name: &'static str,
    /// Its coding.
    pub coding: Coding,
    /// Lowest and highest number; others are corrupt.
    pub range: [f64; 2],
    /// Its unit.
    pub unit: MetricUnit,
    /// Tolerance between two measurements.
    pub tolerance: Tolerance,
}

impl Metric {
    /// A figure from 0 on.
    pub(crate) const fn new(name: &'static str, coding: Coding) -> Metric {
        let tolerance = match coding {
            Coding::Whole(_) | Coding::Name(_) => Tolerance::Same,
            Coding::F32 | Coding::F64 | Coding::OptionalF32 => Tolerance::Within(0.001),
            Coding::UpTo | Coding::From => Tolerance::Relative(0.001),
            Coding::Score => Tolerance::Score,
        };
        let unit = if matches!(coding, Coding::UpTo) { MetricUnit::WaveNumber } else { MetricUnit::Plain };
        Metric { name, coding, range: [0.0, f64::MAX], unit, tolerance }
    }

    pub(crate) const fn range(self, least: f64, most: f64) -> Metric {
        Metric { range: [least, most], ..self }
    }

    /// The same, of any number.
    pub(crate) const fn signed(self) -> Metric {
        self.range(f64::MIN, f64::MAX)
    }

    /// The same in a unit; what has a dimension is compared by shares.
    pub(crate) const fn unit(self, unit: MetricUnit) -> Metric {
        let tolerance = if matches!(unit, MetricUnit::Share) { self.tolerance } else { Tolerance::Relative(0.001) };
        Metric { unit, tolerance, ..self }
    }

    pub(crate) const fn tolerance(self, tolerance: Tolerance) -> Metric {
        Metric { tolerance, ..self }
    }

    /// A value in words; `unit` is the unit of length.
    pub fn describe(&self, value: MetricValue, unit: Option<&str>) -> String {
        let per = || unit.map_or_else(|| "1/length".into(), per_length);
        match (value, self.coding) {
            (MetricValue::None, _) => "not measured".into(),
            (MetricValue::Never, Coding::From) => "at no size".into(),
            (MetricValue::Never, _) => "nowhere".into(),
            (MetricValue::Count(n), Coding::Name(names)) => names.get(n as usize).map_or("", |n| n).into(),
            (MetricValue::Count(n), _) => n.to_string(),
            (MetricValue::Score(s), _) => {
                format!("{} dB, {:.4}", s.masked_psnr.map_or("-".into(), |v| format!("{v:.2}")), s.ssim)
            }
            (MetricValue::Real(n), Coding::From) => format!("from {n} particles on"),
            (MetricValue::Real(k), Coding::UpTo) => format!("up to k = {} {}", decimals(k), per()),
            (MetricValue::Real(v), _) => match self.unit {
                MetricUnit::Share => format!("{:.2} %", 100.0 * v),
                MetricUnit::WaveNumber => format!("{} {}", decimals(v), per()),
                MetricUnit::Length => unit.map_or(decimals(v), |u| format!("{} {u}", decimals(v))),
                MetricUnit::Volume => unit.map_or(decimals(v), |u| format!("{} ({u})^3", decimals(v))),
                MetricUnit::Plain => decimals(v),
            },
        }
    }
}

/// A number as tables show it: four decimals, or four digits behind the first of what these do not show.
pub fn decimals(v: f64) -> String {
    if v == 0.0 || (1e-3..1e6).contains(&v.abs()) { format!("{v:.4}") } else { format!("{v:.4e}") }
}

impl Tolerance {
    /// Whether what was measured is further from what is stored. Not a number is never near.
    pub fn is_passed(self, stored: MetricValue, measured: MetricValue) -> bool {
        let near = |a: f64, b: f64, by: f64| (a - b).abs() <= by;
        let within = match (self, stored, measured) {
            (Tolerance::Any, ..) => true,
            (Tolerance::Within(by), MetricValue::Real(a), MetricValue::Real(b)) => near(a, b, by * b.abs().max(1.0)),
            (Tolerance::Relative(by), MetricValue::Real(a), MetricValue::Real(b)) => near(a, b, by * b.abs()),
            (Tolerance::Score, MetricValue::Score(a), MetricValue::Score(b)) => {
                let psnr = match [a.masked_psnr, b.masked_psnr] {
                    [Some(a), Some(b)] => near(a, b, 0.05),
                    [a, b] => a == b,
                };
                psnr && near(a.ssim, b.ssim, 0.002)
            }
            (_, a, b) => a == b,
        };
        !within
    }
}

impl fmt::Display for Tolerance {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Tolerance::Same => f.write_str("same"),
            Tolerance::Within(by) => write!(f, "{by}"),
            Tolerance::Relative(share) => write!(f, "{} %", 100.0 * share),
            Tolerance::Score => f.write_str("0.05 dB, 0.002"),
            Tolerance::Any => f.write_str("any"),
        }
    }
}

/// Figures that are measured together: a field of the file's section.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct MetricGroup {
    /// Tag in the file.
    pub tag: u8,
    /// Levels of certificates that have it; groups of none are there where the snapshot or the user asks for them.
    pub levels: &'static [CertificateLevel],
    /// In short.
    pub name: &'static str,
    /// In words.
    pub words: &'static str,
}

impl MetricGroup {
    /// Tag of the density on a grid.
    pub const DENSITY: u8 = 2;
    /// Tag of P(k), r(k) and numbers of groups.
    pub const SCIENCE: u8 = 4;
    /// Tag of what was asked for.
    pub const GOAL: u8 = 13;

    /// The figures that are in no row, in one sentence; `unit` is the unit of length.
    pub fn describe(&self, entries: &[MetricEntry], unit: Option<&str>) -> String {
        let without_row = entries.iter().filter(|e| e.row.is_empty());
        let words: Vec<String> =
            without_row.map(|e| format!("{} {}", e.metric.name, e.metric.describe(e.value, unit))).collect();
        format!("{}: {}", self.words, words.join(", ")).trim_end().to_string()
    }
}

/// A figure of a certificate.
#[derive(Clone, Debug, PartialEq)]
pub struct MetricEntry {
    /// The one of several alike that it is of (`mid paraview`); empty where there is but one.
    pub row: String,
    /// The figure.
    pub metric: Metric,
    /// Its value.
    pub value: MetricValue,
}

/// Passes over the figures of a certificate, group by group, in the order of their tags.
pub(crate) trait MetricVisitor {
    type Error;

    /// A group begins; `is_present`: the certificate has it. Whether it is to be there, and visited.
    fn begin(&mut self, group: &MetricGroup, is_present: bool) -> Result<bool, Self::Error>;
    fn end(&mut self, _: &MetricGroup) -> Result<(), Self::Error> {
        Ok(())
    }
    /// Whether there is another element in a list of any length. `is_present`: the certificate has it.
    fn more(&mut self, is_present: bool) -> bool {
        is_present
    }
    /// A figure with its value; returns the value that it is to have.
    fn metric(&mut self, metric: &Metric, value: MetricValue) -> Result<MetricValue, Self::Error>;
    /// Checks the figures of one record against each other.
    fn agree(&mut self, _: impl FnOnce() -> Result<(), String>) -> Result<(), Self::Error> {
        Ok(())
    }
    /// The figures that follow, up to `leave`, are of one of several alike.
    fn enter(&mut self, _: &'static str) {}
    fn leave(&mut self) {}
}

/// A part that a visitor passes over, declared in the form `F`: [`Metric`] for a figure, a name for a record, names for
/// a list of records.
pub(crate) trait MetricField<F> {
    fn visit<V: MetricVisitor>(&mut self, form: F, v: &mut V) -> Result<(), V::Error>;
}

impl<T: Copy + From<MetricValue>> MetricField<Metric> for T
where
    MetricValue: From<T>,
{
    fn visit<V: MetricVisitor>(&mut self, form: Metric, v: &mut V) -> Result<(), V::Error> {
        *self = v.metric(&form, MetricValue::from(*self))?.into();
        Ok(())
    }
}

impl<T: MetricField<&'static str>, const N: usize> MetricField<[&'static str; N]> for [T; N] {
    fn visit<V: MetricVisitor>(&mut self, names: [&'static str; N], v: &mut V) -> Result<(), V::Error> {
        self.iter_mut().zip(names).try_for_each(|(one, name)| one.visit(name, v))
    }
}

/// An element of a list of any length up to the array's.
impl<T: MetricField<&'static str> + Default + Copy> MetricField<&'static str> for Option<T> {
    fn visit<V: MetricVisitor>(&mut self, name: &'static str, v: &mut V) -> Result<(), V::Error> {
        *self = v.more(self.is_some()).then(|| self.unwrap_or_default());
        self.as_mut().map_or(Ok(()), |one| one.visit(name, v))
    }
}

/// A group that a certificate may have, and the form of what is in it.
pub(crate) struct OptionalGroup<F>(pub MetricGroup, pub F);

pub(crate) struct RequiredGroup<F>(pub OptionalGroup<F>);

impl<T: MetricField<F> + Default + Copy, F> MetricField<OptionalGroup<F>> for Option<T> {
    fn visit<V: MetricVisitor>(
        &mut self,
        OptionalGroup(group, form): OptionalGroup<F>,
        v: &mut V,
    ) -> Result<(), V::Error> {
        *self = v.begin(&group, self.is_some())?.then(|| self.unwrap_or_default());
        let Some(content) = self else { return Ok(()) };
        content.visit(form, v)?;
        v.end(&group)
    }
}

impl<T: MetricField<F>, F> MetricField<RequiredGroup<F>> for T {
    fn visit<V: MetricVisitor>(
        &mut self,
        RequiredGroup(OptionalGroup(group, form)): RequiredGroup<F>,
        v: &mut V,
    ) -> Result<(), V::Error> {
        v.begin(&group, true)?;
        self.visit(form, v)?;
        v.end(&group)
    }
}

/// Numbers of a type as values, and back.
macro_rules! values {
    ($($type:ty: $value:ident as $number:ty),*) => { $(
        impl From<$type> for MetricValue {
            fn from(v: $type) -> Self {
                MetricValue::$value(<$number>::from(v))
            }
        }
        impl From<MetricValue> for $type {
            fn from(v: MetricValue) -> Self {
                if let MetricValue::$value(n) = v { n as $type } else { <$type>::default() }
            }
        }
    )* };
}

values!(u8: Count as u64, u16: Count as u64, u32: Count as u64, u64: Count as u64, f64: Real as f64);

/// Numbers that may be missing as values, and back.
macro_rules! optional_values {
    ($($type:ty: $value:ident),*) => { $(
        impl From<Option<$type>> for MetricValue {
            fn from(v: Option<$type>) -> Self {
                v.map_or(MetricValue::None, MetricValue::$value)
            }
        }
        impl From<MetricValue> for Option<$type> {
            fn from(v: MetricValue) -> Self {
                if let MetricValue::$value(v) = v { Some(v) } else { None }
            }
        }
    )* };
}

optional_values!(f64: Real, PictureScore: Score);

/// Enums without content as values, and back: their places in `ALL`.
macro_rules! enum_values {
    ($($type:ty),*) => { $(
        impl From<$type> for $crate::model::MetricValue {
            fn from(v: $type) -> Self {
                $crate::model::MetricValue::Count(v as u64)
            }
        }
        impl From<$crate::model::MetricValue> for $type {
            fn from(v: $crate::model::MetricValue) -> Self {
                let $crate::model::MetricValue::Count(n) = v else { return <$type>::ALL[0] };
                <$type>::ALL.get(n as usize).copied().unwrap_or(<$type>::ALL[0])
            }
        }
    )* };
}
pub(crate) use enum_values;

/// Declares a record: a struct of public fields, and of each field the form by which it is visited.
macro_rules! record {
    ($(#[$meta:meta])* $name:ident $(agrees by $agree:path)? {
        $($(#[$field_meta:meta])* $field:ident: $type:ty = $form:expr;)*
    }) => {
        // What a figure's own name says needs no other words.
        $(#[$meta])*
        #[allow(missing_docs)]
        #[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
        pub struct $name {
            $($(#[$field_meta])* pub $field: $type,)*
        }

        impl $crate::model::metric::MetricField<&'static str> for $name {
            fn visit<V: $crate::model::metric::MetricVisitor>(
                &mut self,
                name: &'static str,
                v: &mut V,
            ) -> Result<(), V::Error> {
                v.enter(name);
                $($crate::model::metric::MetricField::visit(&mut self.$field, $form, v)?;)*
                v.leave();
                $(v.agree(|| $agree(self))?;)?
                Ok(())
            }
        }
    };
}
pub(crate) use record;
