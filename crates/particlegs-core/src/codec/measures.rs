//! The section `meas`: figures that not every certificate has, as tagged fields (docs/format.md, section 3).

use super::certificate::{decibels, from_decibels, from_similarity, similarity};
use super::container::{MASS_POWER_SINCE, MEASURES_SINCE};
use super::wire::Reader;
use crate::model::{
    BANDS, CellDensity, Goal, GoalKind, GroupClass, HeldOut, Limit, LookPictures, MassPower, Measures,
    PICTURE_SETTINGS, POWER_LAYERS, PictureScore, PictureScores, Pictures, PicturesAt, PowerAgreement, Reached, Sample,
    Spacing, Subset, Transfer,
};
use crate::space::Bounds;

/// Tags of the fields.
const DENSITIES: u8 = 1;
const SPACING: u8 = 2;
const HELD_OUT: u8 = 3;
const GROUPS: u8 = 4;
const PICTURES: u8 = 5;
const SUBSET: u8 = 6;
const MASS_POWER: u8 = 7;
const SAMPLE: u8 = 8;
const BLOCKS: u8 = 9;
const GOAL: u8 = 10;
/// Bytes of a field's tag and length.
const FIELD_BYTES: usize = 3;
/// Bytes of the fields' values.
const DENSITIES_BYTES: usize = 3 * (8 + 4 * 4);
const SPACING_BYTES: usize = 2 * (8 + 4);
const HELD_OUT_BYTES: usize = 3 * 4 + 8 + 8 + BANDS.len() * 8;
const GROUPS_BYTES: usize = 3 * (4 + 6 * 4);
const POWER_BYTES: usize = 2 * 4;
const SAMPLE_BYTES: usize = 8 + 6 * 8;
const BLOCKS_BYTES: usize = 4;
const GOAL_BYTES: usize = 1 + 3 * 8;
/// Kinds of goals, in the order of their numbers from 1 on.
const GOALS: [GoalKind; 4] = [GoalKind::Psnr, GoalKind::PowerSpectrum, GoalKind::Correlation, GoalKind::Groups];
const SCORE_BYTES: usize = 2 + 2;
const LOOK_PICTURES_BYTES: usize = 1 + 2 * 5 * SCORE_BYTES;
const PICTURES_BYTES: usize = 2 + 2 + PICTURE_SETTINGS * (4 + 4 + 1 + 2 * LOOK_PICTURES_BYTES);
const SUBSET_BYTES: usize = 8 + 8 + 9 * SCORE_BYTES;
/// Stands for a share, and a deviation from 1, that there is none of.
const NONE: f32 = -2.0;
/// The SSIM of a picture that was not drawn.
const NOT_DRAWN: i16 = i16::MIN;
/// Stand for wave numbers that were not measured, and for nowhere, as in `stat`.
const NOT_MEASURED: f32 = -1.0;
const NEVER: f32 = 0.0;

/// Bytes of the section with what a quick certificate holds, and a full one, without a goal.
pub(crate) const QUICK_BYTES: usize = 3 * FIELD_BYTES + DENSITIES_BYTES + SPACING_BYTES + SUBSET_BYTES;
/// See [`QUICK_BYTES`].
pub(crate) const FULL_BYTES: usize = QUICK_BYTES + 3 * FIELD_BYTES + HELD_OUT_BYTES + GROUPS_BYTES + PICTURES_BYTES;

/// Bytes of the section of a certificate that is added up of blocks.
pub(crate) const ADDED_UP_BYTES: usize = 2 * FIELD_BYTES + DENSITIES_BYTES + BLOCKS_BYTES;

/// Bytes of the field for P(k) by mass of so many layers.
pub(crate) fn mass_power_bytes(layers: usize) -> usize {
    let own = if layers > 1 { layers.min(POWER_LAYERS) } else { 0 };
    FIELD_BYTES + (1 + own) * POWER_BYTES
}

/// Bytes of the field for the sample.
pub(crate) const SAMPLE_FIELD_BYTES: usize = FIELD_BYTES + SAMPLE_BYTES;

/// The section's bytes; `None` where nothing was measured.
pub(crate) fn write(m: &Measures) -> Option<Vec<u8>> {
    let mut out = Vec::with_capacity(FULL_BYTES);
    let mut field = |tag: u8, value: Vec<u8>| {
        out.push(tag);
        out.extend((value.len() as u16).to_le_bytes());
        out.extend(value);
    };
    if let Some(d) = &m.densities {
        field(DENSITIES, d.iter().flat_map(density_bytes).collect());
    }
    if let Some(s) = &m.spacing {
        let pair = |median: f64, regularity: f64| median.to_le_bytes().into_iter().chain(short(regularity));
        field(SPACING, pair(s.median, s.regularity).chain(pair(s.drawn_median, s.drawn_regularity)).collect());
    }
    if let Some(h) = &m.held_out {
        let mut value = Vec::with_capacity(HELD_OUT_BYTES);
        value.extend([h.bits, h.error, h.kernel_bits].into_iter().flat_map(short));
        value.extend(h.volume.to_le_bytes().into_iter().chain(h.k_max.to_le_bytes()));
        value.extend(h.transfer.iter().flat_map(|t| [optional(t.deviation), short(t.scatter)]).flatten());
        field(HELD_OUT, value);
    }
    if let Some(g) = &m.groups {
        field(GROUPS, g.iter().flat_map(class_bytes).collect());
    }
    if let Some(p) = &m.pictures {
        let size = [p.width, p.height].into_iter().flat_map(u16::to_le_bytes);
        field(PICTURES, size.chain(p.settings.iter().flat_map(setting_bytes)).collect());
    }
    if let Some(s) = &m.subset {
        let counts = [s.kept, s.bytes].into_iter().flat_map(u64::to_le_bytes);
        field(SUBSET, counts.chain(s.orbits.iter().flatten().flat_map(|s| score_bytes(s.as_ref()))).collect());
    }
    if let Some(p) = &m.mass_power {
        field(MASS_POWER, std::iter::once(&p.whole).chain(p.layers.iter().flatten()).flat_map(power_bytes).collect());
    }
    if let Some(s) = &m.sample {
        let corners = s.bounds.min.iter().chain(&s.bounds.max).flat_map(|v| v.to_le_bytes());
        field(SAMPLE, s.particles.to_le_bytes().into_iter().chain(corners).collect());
    }
    if let Some(blocks) = m.blocks {
        field(BLOCKS, blocks.to_le_bytes().to_vec());
    }
    if let Some(g) = &m.goal {
        field(GOAL, goal_bytes(g));
    }
    (!out.is_empty()).then_some(out)
}

/// The lowest minor version that has what was measured.
pub(crate) fn minor_version(m: &Measures) -> u8 {
    if m.mass_power.is_some() || m.sample.is_some() || m.blocks.is_some() { MASS_POWER_SINCE } else { MEASURES_SINCE }
}

fn short(v: f64) -> [u8; 4] {
    (v as f32).to_le_bytes()
}

fn optional(v: Option<f64>) -> [u8; 4] {
    v.map_or(NONE, |v| v as f32).to_le_bytes()
}

fn density_bytes(d: &CellDensity) -> Vec<u8> {
    let rest = [d.particles, d.correlation, d.mean_absolute_error, d.uniform_mean_absolute_error];
    d.edge.to_le_bytes().into_iter().chain(rest.into_iter().flat_map(short)).collect()
}

fn class_bytes(c: &GroupClass) -> Vec<u8> {
    let shares = [c.completeness, c.purity, c.mass].into_iter().flat_map(optional);
    let groups = u32::try_from(c.groups).unwrap_or(u32::MAX).to_le_bytes().into_iter();
    groups.chain(optional(c.number)).chain(short(c.number_scatter)).chain(shares).chain(short(c.mass_scatter)).collect()
}

fn goal_bytes(Reached { goal, reached }: &Reached) -> Vec<u8> {
    let number = GOALS.iter().position(|k| *k == goal.kind).map_or(0, |i| i as u8 + 1);
    let mut out = Vec::with_capacity(GOAL_BYTES);
    out.push(number);
    out.extend([goal.asked, goal.at, *reached].into_iter().flat_map(f64::to_le_bytes));
    out
}

fn power_bytes(p: &PowerAgreement) -> Vec<u8> {
    let limit = match p.within_1_percent_to {
        Limit::NotMeasured => NOT_MEASURED,
        Limit::Never => NEVER,
        Limit::At(k) => (k as f32).max(f32::MIN_POSITIVE),
    };
    optional(p.largest_deviation).into_iter().chain(limit.to_le_bytes()).collect()
}

fn setting_bytes(p: &PicturesAt) -> Vec<u8> {
    let looks = [&p.paraview, &p.expected].into_iter().flat_map(look_bytes);
    short(p.radius).into_iter().chain(short(p.opacity)).chain([u8::from(p.close)]).chain(looks).collect()
}

fn look_bytes(l: &LookPictures) -> Vec<u8> {
    let of = |s: &PictureScores| {
        let [model, noise_free, black, even] = [s.model, s.noise_free, s.all_black, s.uniform_box].map(Some);
        [model, noise_free, black, even, s.subset]
    };
    let scores = of(&l.mean).into_iter().chain(of(&l.worst));
    [l.worst_view].into_iter().chain(scores.flat_map(|s| score_bytes(s.as_ref()))).collect()
}

fn score_bytes(s: Option<&PictureScore>) -> [u8; SCORE_BYTES] {
    let psnr = decibels(s.and_then(|s| s.masked_psnr)).to_le_bytes();
    let ssim = s.map_or(NOT_DRAWN, |s| similarity(s.ssim)).to_le_bytes();
    [psnr[0], psnr[1], ssim[0], ssim[1]]
}

/// Reads the section. Fields of unknown tags are skipped.
pub(crate) fn read(bytes: &[u8]) -> Result<Measures, String> {
    let mut r = Reader::new(bytes);
    let mut found = Measures::default();
    let mut last = 0;
    while !r.is_done() {
        let tag = r.u8()?;
        if tag <= last {
            return Err(format!("a measure {tag} after {last}"));
        }
        last = tag;
        let length = usize::from(r.u16()?);
        let mut value = Reader::new(r.take(length)?);
        match tag {
            DENSITIES => found.densities = Some([density(&mut value)?, density(&mut value)?, density(&mut value)?]),
            SPACING => found.spacing = Some(spacing(&mut value)?),
            HELD_OUT => found.held_out = Some(held_out(&mut value)?),
            GROUPS => found.groups = Some([class(&mut value)?, class(&mut value)?, class(&mut value)?]),
            PICTURES => found.pictures = Some(pictures(&mut value)?),
            SUBSET => found.subset = Some(subset(&mut value)?),
            MASS_POWER => found.mass_power = Some(mass_power(&mut value, length)?),
            SAMPLE => found.sample = Some(sample(&mut value)?),
            BLOCKS => found.blocks = Some(value.u32()?),
            GOAL => found.goal = goal(&mut value)?,
            _ => continue,
        }
        if !value.is_done() {
            return Err(format!("a measure {tag} of {length} bytes"));
        }
    }
    Ok(found)
}

/// A number from `least` on.
fn at_least(v: f64, least: f64, what: &str) -> Result<f64, String> {
    if v >= least && v.is_finite() { Ok(v) } else { Err(format!("{what} of {v}")) }
}

fn real(r: &mut Reader<'_>, least: f64, what: &str) -> Result<f64, String> {
    at_least(f64::from(r.f32()?), least, what)
}

/// A number from `least` on, or none.
fn real_or_none(r: &mut Reader<'_>, least: f64, what: &str) -> Result<Option<f64>, String> {
    match r.f32()? {
        NONE => Ok(None),
        v => at_least(f64::from(v), least, what).map(Some),
    }
}

fn density(r: &mut Reader<'_>) -> Result<CellDensity, String> {
    Ok(CellDensity {
        edge: at_least(r.f64()?, f64::MIN_POSITIVE, "an edge")?,
        particles: real(r, 0.0, "particles in a cell")?,
        correlation: real(r, -1.0, "a correlation")?,
        mean_absolute_error: real(r, 0.0, "an error")?,
        uniform_mean_absolute_error: real(r, 0.0, "an error")?,
    })
}

fn spacing(r: &mut Reader<'_>) -> Result<Spacing, String> {
    Ok(Spacing {
        median: at_least(r.f64()?, 0.0, "a distance")?,
        regularity: real(r, 0.0, "a ratio of distances")?,
        drawn_median: at_least(r.f64()?, 0.0, "a distance")?,
        drawn_regularity: real(r, 0.0, "a ratio of distances")?,
    })
}

fn held_out(r: &mut Reader<'_>) -> Result<HeldOut, String> {
    let (bits, error) = (real(r, f64::from(f32::MIN), "bits")?, real(r, 0.0, "an error")?);
    let kernel_bits = real(r, f64::from(f32::MIN), "bits")?;
    let (volume, k_max) = (at_least(r.f64()?, 0.0, "a volume")?, at_least(r.f64()?, 0.0, "a wave number")?);
    let mut transfer = [Transfer::default(); BANDS.len()];
    for t in &mut transfer {
        let deviation = real_or_none(r, f64::from(f32::MIN), "a deviation")?;
        *t = Transfer { deviation, scatter: real(r, 0.0, "a scatter")? };
    }
    Ok(HeldOut { bits, error, kernel_bits, volume, k_max, transfer })
}

fn class(r: &mut Reader<'_>) -> Result<GroupClass, String> {
    Ok(GroupClass {
        groups: u64::from(r.u32()?),
        number: real_or_none(r, 0.0, "a share")?,
        number_scatter: real(r, 0.0, "a scatter")?,
        completeness: real_or_none(r, 0.0, "a share")?,
        purity: real_or_none(r, 0.0, "a share")?,
        mass: real_or_none(r, 0.0, "a share")?,
        mass_scatter: real(r, 0.0, "a scatter")?,
    })
}

/// `None` for a kind that is yet to be thought of.
fn goal(r: &mut Reader<'_>) -> Result<Option<Reached>, String> {
    let kind = usize::from(r.u8()?).checked_sub(1).and_then(|i| GOALS.get(i).copied());
    let (asked, at) = (at_least(r.f64()?, 0.0, "a goal")?, at_least(r.f64()?, 0.0, "a goal's place")?);
    let reached = at_least(r.f64()?, f64::MIN, "what was reached")?;
    Ok(kind.map(|kind| Reached { goal: Goal { kind, asked, at }, reached }))
}

fn mass_power(r: &mut Reader<'_>, length: usize) -> Result<MassPower, String> {
    let own = (length / POWER_BYTES).saturating_sub(1);
    if own == 1 || own > POWER_LAYERS {
        return Err(format!("P(k) of mass of {length} bytes"));
    }
    let mut found = MassPower { whole: power(r)?, layers: [None; POWER_LAYERS] };
    for layer in &mut found.layers[..own] {
        *layer = Some(power(r)?);
    }
    Ok(found)
}

fn sample(r: &mut Reader<'_>) -> Result<Sample, String> {
    let particles = r.u64()?;
    let mut corners = [0.0; 6];
    for corner in &mut corners {
        *corner = at_least(r.f64()?, f64::MIN, "a corner")?;
    }
    let [a, b, c, d, e, f] = corners;
    if particles == 0 || !(a <= d && b <= e && c <= f) {
        return Err(format!("a sample of {particles} particles, or corners out of order"));
    }
    Ok(Sample { particles, bounds: Bounds { min: [a, b, c], max: [d, e, f] } })
}

fn power(r: &mut Reader<'_>) -> Result<PowerAgreement, String> {
    let largest_deviation = real_or_none(r, 0.0, "a deviation")?;
    let within_1_percent_to = match r.f32()? {
        NOT_MEASURED => Limit::NotMeasured,
        NEVER => Limit::Never,
        k => Limit::At(at_least(f64::from(k), 0.0, "a wave number")?),
    };
    Ok(PowerAgreement { largest_deviation, within_1_percent_to })
}

fn pictures(r: &mut Reader<'_>) -> Result<Pictures, String> {
    let (width, height) = (r.u16()?, r.u16()?);
    let mut settings = Vec::with_capacity(PICTURE_SETTINGS);
    for _ in 0..PICTURE_SETTINGS {
        settings.push(setting(r)?);
    }
    let settings = settings.try_into().map_err(|_| "settings of another number")?;
    Ok(Pictures { width, height, settings })
}

fn setting(r: &mut Reader<'_>) -> Result<PicturesAt, String> {
    let radius = real(r, f64::from(f32::MIN_POSITIVE), "a radius")?;
    let opacity = real(r, f64::from(f32::MIN_POSITIVE), "an opacity")?;
    if opacity > 1.0 {
        return Err(format!("an opacity of {opacity}"));
    }
    let close = match r.u8()? {
        from @ 0..2 => from == 1,
        other => return Err(format!("views from {other}")),
    };
    Ok(PicturesAt { radius, opacity, close, paraview: look(r)?, expected: look(r)? })
}

fn look(r: &mut Reader<'_>) -> Result<LookPictures, String> {
    let worst_view = r.u8()?;
    if worst_view > 2 {
        return Err(format!("a worst view {worst_view}"));
    }
    Ok(LookPictures { worst_view, mean: scores(r)?, worst: scores(r)? })
}

fn scores(r: &mut Reader<'_>) -> Result<PictureScores, String> {
    Ok(PictureScores {
        model: score(r)?,
        noise_free: score(r)?,
        all_black: score(r)?,
        uniform_box: score(r)?,
        subset: score_or_none(r)?,
    })
}

fn score(r: &mut Reader<'_>) -> Result<PictureScore, String> {
    Ok(PictureScore { masked_psnr: from_decibels(r.u16()?), ssim: from_similarity(r.u16()?)? })
}

/// A score, or none of a picture that was not drawn.
fn score_or_none(r: &mut Reader<'_>) -> Result<Option<PictureScore>, String> {
    match (r.u16()?, r.u16()?) {
        (psnr, ssim) if ssim as i16 != NOT_DRAWN => {
            Ok(Some(PictureScore { masked_psnr: from_decibels(psnr), ssim: from_similarity(ssim)? }))
        }
        (psnr, _) if from_decibels(psnr).is_none() => Ok(None),
        (psnr, _) => Err(format!("{psnr} steps of a decibel of a picture that was not drawn")),
    }
}

fn subset(r: &mut Reader<'_>) -> Result<Subset, String> {
    let (kept, bytes) = (r.u64()?, r.u64()?);
    if kept == 0 {
        return Err("a subset of no particles".into());
    }
    let mut orbits = [[None; 3]; 3];
    for s in orbits.iter_mut().flatten() {
        *s = score_or_none(r)?;
    }
    Ok(Subset { kept, bytes, orbits })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn score_of(psnr: f64) -> PictureScore {
        PictureScore { masked_psnr: Some(psnr), ssim: -1.0 }
    }

    fn pictures_of(subset: Option<PictureScore>) -> Pictures {
        let none = PictureScore { masked_psnr: None, ssim: 1.0 };
        let scores = |model| PictureScores {
            model: score_of(model),
            noise_free: none,
            all_black: score_of(4.0),
            uniform_box: score_of(11.0),
            subset,
        };
        let look = LookPictures { worst_view: 2, mean: scores(23.5), worst: scores(22.0) };
        let at = |radius| PicturesAt { radius, opacity: 0.5, close: radius == 0.5, paraview: look, expected: look };
        Pictures { width: 960, height: 540, settings: [0.5, 1.0, 6.0, 0.5, 1.0, 6.0, 1.0].map(at) }
    }

    fn measures() -> Measures {
        let density = |edge| CellDensity {
            edge,
            particles: 8.0,
            correlation: 0.9375,
            mean_absolute_error: 0.25,
            uniform_mean_absolute_error: 1.5,
        };
        let class = |number| GroupClass {
            groups: 2617,
            number,
            number_scatter: 0.0625,
            completeness: Some(0.75),
            purity: None,
            mass: Some(1.0),
            mass_scatter: 0.125,
        };
        let mut transfer = [Transfer { deviation: Some(-0.0078125), scatter: 0.5 }; BANDS.len()];
        transfer[0].deviation = None;
        Measures {
            densities: Some([0.1, 1e-60, 1e60].map(density)),
            spacing: Some(Spacing { median: 0.1, regularity: 0.5, drawn_median: 0.2, drawn_regularity: 0.375 }),
            held_out: Some(HeldOut {
                bits: -1.5,
                error: 0.0,
                kernel_bits: 2.0,
                volume: 125_000.0,
                k_max: 8.1,
                transfer,
            }),
            groups: Some([class(Some(1.0)), class(None), class(Some(0.5))]),
            pictures: Some(pictures_of(Some(score_of(24.5)))),
            subset: Some(Subset { kept: 67_628, bytes: 83_832, orbits: [[None, None, Some(score_of(25.0))]; 3] }),
            goal: None,
            mass_power: None,
            sample: None,
            blocks: None,
        }
    }

    #[test]
    fn goals_of_every_kind_come_back() {
        for (i, kind) in GOALS.into_iter().enumerate() {
            let goal = Some(Reached { goal: Goal { kind, asked: 0.01, at: 2.0 }, reached: 0.0097 });
            let bytes = write(&Measures { goal, ..measures() }).unwrap();
            assert_eq!(bytes.len(), FULL_BYTES + FIELD_BYTES + GOAL_BYTES);
            assert_eq!(read(&bytes).unwrap().goal, goal);
            let at = bytes.len() - GOAL_BYTES;
            assert_eq!(usize::from(bytes[at]), i + 1);
            // One that is yet to be thought of is no goal; one that is no number is corrupt.
            let mut other = bytes.clone();
            other[at] = 77;
            assert_eq!(read(&other).unwrap(), measures());
            other[at + 1..at + 9].copy_from_slice(&f64::NAN.to_le_bytes());
            assert!(read(&other).is_err() && read(&bytes[..bytes.len() - 1]).is_err());
        }
    }

    #[test]
    fn comes_back_whole_or_in_part() {
        let all = measures();
        let bytes = write(&all).unwrap();
        assert_eq!(bytes.len(), FULL_BYTES);
        assert_eq!(read(&bytes).unwrap(), all);
        let quick = Measures { held_out: None, groups: None, pictures: None, ..all };
        let bytes = write(&quick).unwrap();
        assert_eq!((bytes.len(), read(&bytes).unwrap()), (QUICK_BYTES, quick));
        assert_eq!(write(&Measures::default()), None);
        // Pictures without the subset's.
        let alone = Measures { pictures: Some(pictures_of(None)), ..Measures::default() };
        assert_eq!(read(&write(&alone).unwrap()).unwrap(), alone);
        // A field that is yet to be thought of.
        let later = [&bytes[..], &[200, 2, 0, 7, 7]].concat();
        assert_eq!(read(&later).unwrap(), quick);
    }

    #[test]
    fn samples_come_back_and_empty_ones_do_not() {
        let bounds = Bounds { min: [-1.0, 0.0, 2.0], max: [0.5, 0.0, 1e9] };
        let with = |particles, bounds| Measures { sample: Some(Sample { particles, bounds }), ..measures() };
        let all = with(2_000_000, bounds);
        let bytes = write(&all).unwrap();
        assert_eq!((bytes.len(), read(&bytes).unwrap()), (FULL_BYTES + SAMPLE_FIELD_BYTES, all));
        assert!(read(&write(&with(0, bounds)).unwrap()).is_err());
        assert!(read(&write(&with(1, Bounds { min: bounds.max, max: bounds.min })).unwrap()).is_err());
    }

    #[test]
    fn power_of_mass_comes_back_by_layer() {
        let power = |largest_deviation, within_1_percent_to| PowerAgreement { largest_deviation, within_1_percent_to };
        let mut layers = [None; POWER_LAYERS];
        let whole = power(Some(0.5), Limit::At(2.5));
        for own in [0, 2, POWER_LAYERS] {
            (0..own).for_each(|l| layers[l] = Some(power(None, [Limit::Never, Limit::NotMeasured][l % 2])));
            let mass_power = Some(MassPower { whole, layers });
            let all = Measures { mass_power, ..measures() };
            let bytes = write(&all).unwrap();
            assert_eq!(bytes.len(), FULL_BYTES + mass_power_bytes(own));
            assert_eq!((read(&bytes).unwrap(), minor_version(&all)), (all, MASS_POWER_SINCE));
            // One layer alone is the whole; no layer is in two fields.
            let field = write(&Measures { mass_power, ..Measures::default() }).unwrap();
            let cut = [&[MASS_POWER, 16, 0][..], &field[3..11], &field[3..11]].concat();
            assert!(read(&cut).is_err() && read(&[&field[..], &field[..]].concat()).is_err());
        }
    }

    #[test]
    fn contradictions_are_refused() {
        let bytes = write(&measures()).unwrap();
        for n in 1..bytes.len() {
            let cut = read(&bytes[..n]);
            // Whole fields may end a section.
            assert!(cut.is_err() || cut.is_ok_and(|m| write(&m).unwrap() == bytes[..n]), "{n}");
        }
        assert!(read(&[&bytes[..], &bytes[..]].concat()).is_err());
        let mut nan = bytes.clone();
        nan[3..11].copy_from_slice(&f64::NAN.to_le_bytes());
        assert!(read(&nan).is_err());
        let alone = write(&Measures { pictures: Some(pictures_of(None)), ..Measures::default() }).unwrap();
        // Radius, opacity, where from, the worst view, a score beside a picture that was not drawn.
        let last = alone.len() - 4;
        for (at, byte) in [(10, 0xff), (14, 0x7f), (15, 2), (16, 3), (last, 0)] {
            let mut forged = alone.clone();
            forged[at] = byte;
            assert!(read(&forged).is_err(), "{at}");
        }
        let subset = Measures { subset: measures().subset, ..Measures::default() };
        let mut none_kept = write(&subset).unwrap();
        none_kept[3..11].fill(0);
        assert!(read(&none_kept).is_err());
        let mut longer = bytes;
        longer[1] += 1;
        assert!(read(&longer).is_err());
    }
}
